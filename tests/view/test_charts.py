"""Frequency charts, heat maps and drawings of parts: what is labelled and marked."""

import numpy as np
import pandas as pd
import pytest
import synthetic
from test_pictures import ink

from bladefem.scene.kinds import kind_named
from bladefem.scene.tables import Scene
from bladefem.scene.toml import vary
from bladefem.study.modes.crossings import campbell_crossings
from bladefem.view.convergence import draw_convergence
from bladefem.view.speed import (
    draw_campbell,
    draw_interference,
    draw_nodal_diameters,
    spread_labels,
)


def texts(figure):
    """All words of a figure's axes."""
    return " ".join(
        t.get_text()
        for ax in figure.axes
        for t in [
            *ax.texts,
            ax.title,
            ax.xaxis.label,
            ax.yaxis.label,
            *(ax.get_legend().texts if ax.get_legend() else []),
        ]
    )


def test_campbell_marks_every_crossing(folder):
    table = synthetic.campbell()
    crossings = campbell_crossings(table, range(1, 11))
    figure = draw_campbell(
        table, range(1, 11), folder / "campbell.png", crossings=crossings, operating=838.0
    )
    rings = next(line for line in figure.axes[0].lines if line.get_label() == "crossing")
    assert len(rings.get_xdata()) == len(crossings) == 14
    assert all(f"EO {k}" in texts(figure) for k in range(1, 11))
    assert ink(folder / "campbell.png") > 0.03


def test_campbell_draws_both_waves():
    """Waves under Coriolis forces, on which crossings lie; one line where both are the same."""
    speed = np.linspace(0.0, 500.0, 3)
    still = np.full(3, 400.0)
    lines = {"forward": still - 0.02 * speed, "backward": still + 0.02 * speed}
    names = {"mode": 1, "speed": speed, "frequency": still}
    split = pd.DataFrame({**names, "nodal_diameter": 2, **lines})
    standing = pd.DataFrame(
        {**names, "nodal_diameter": 0, "forward": still - 1, "backward": still - 1}
    )
    drawn = draw_campbell(pd.concat([split, standing]), [3]).axes[0].lines
    heights = {
        (line.get_linestyle(), line.get_ydata()[-1]) for line in drawn if len(line.get_xdata()) == 3
    }
    assert heights == {("-", 390.0), ("--", 410.0), ("-", 399.0)}


def test_interference_rings_what_is_too_close(folder):
    table = synthetic.wheel_frequencies()
    figure = draw_interference(
        table, 24, 2 * np.pi * 771.0 / 6, folder / "safe.png", orders=[6, 12]
    )
    rings = next(line for line in figure.axes[0].lines if "closer" in str(line.get_label()))
    assert rings.get_xydata()[0].tolist() == pytest.approx([6, 771.43], abs=0.01)
    assert len(rings.get_xydata()) == 1
    draw_nodal_diameters(table, folder / "diameters.png")
    assert ink(folder / "diameters.png") > 0.02


def test_numbers_of_low_engine_orders_do_not_cross_the_axis():
    """Orders 1 to 8 at a hundredth of the highest frequency and more."""
    table = synthetic.wheel_frequencies()
    step = table["frequency"].max() / 100
    figure = draw_interference(table, 24, 2 * np.pi * step, orders=range(1, 9))
    figure.draw_without_rendering()
    (ax,) = figure.axes
    numbers = [text for text in ax.texts if text.get_text().isdigit()]
    assert len(numbers) == 8
    floor = ax.get_window_extent().y0
    assert all(text.get_window_extent().y0 > floor for text in numbers)


@pytest.mark.parametrize(
    "kind, part, table, skipped",
    [
        ("wedge sector", "aerofoil", "aerofoil", {"section"}),
        ("wedge sector", "platform", "platform", {"length"}),
        ("wedge sector", "platform", "damper", {"mass"}),
        ("wedge sector", "sector", "disc", set()),
        ("plane blades", "plane", "plane", {"damper_mass"}),
        ("z mass", "z_mass", "z_mass", set()),
        ("hertz", "hertz", "hertz", {"dimension", "interference"}),
        ("punch", "punch", "punch", {"dimension", "interference"}),
    ],
)
def test_drawings_label_every_parameter(kind, part, table, skipped, folder):
    scene = Scene(kind=kind)
    figure = kind_named(kind).pictures[part](scene, file=folder / f"{part}.png")
    names = set(type(getattr(scene, table)).__dataclass_fields__) - skipped
    missing = {name for name in names if name not in texts(figure)}
    assert not missing
    assert ink(folder / f"{part}.png") > 0.05


def test_refinement_shows_the_limit_and_doubts(folder):
    """Believed orders are drawn down to their limit, the others are named."""
    h = np.array([4e-3, 3e-3, 2e-3])
    points = pd.DataFrame(
        {
            "size": np.tile(h, 2),
            "mode": np.repeat([1, 2], 3),
            "frequency": [*(100 + 1e5 * h**2), 50.0, 51.0, 50.5],
        }
    )
    summary = pd.DataFrame(
        {
            "mode": [1, 2],
            "frequency": [100.4, 50.5],
            "limit": [100.0, 50.5],
            "order": [2.0, np.nan],
            "reason": ["", "the frequencies do not fall into line"],
        }
    )
    figure = draw_convergence(points, summary, folder / "convergence.png")
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert set(labels) == {"mode 1: order 2.0, limit 100 Hz", "mode 2: no order"}
    fit = next(line for line in figure.axes[0].lines if len(line.get_xdata()) == 80)
    assert fit.get_ydata()[0] == pytest.approx(100 * (100 / 100.4 - 1)) and fit.get_ydata()[
        -1
    ] == pytest.approx(100 * (101.6 / 100.4 - 1))
    assert (folder / "convergence.png").stat().st_size > 5000


def test_names_beside_lines_stay_apart():
    """Two that collide part about their mean, and push no third that is far; a chain of them stays
    in order.
    """
    np.testing.assert_allclose(spread_labels(np.array([1.0, 1.1, 5.0]), 0.5), [0.8, 1.3, 5.0])
    moved = spread_labels(np.array([0.0, 0.4, 0.5, 0.6, 1.2, 3.0]), 0.5)
    assert (np.diff(moved) > 0.5 - 1e-12).all() and moved[-1] == 3.0
    assert moved[:5].mean() == pytest.approx(np.mean([0.0, 0.4, 0.5, 0.6, 1.2]))


def test_every_damper_shape_is_drawn():
    pictures = kind_named("wedge sector").pictures
    titles = [
        ax.get_title(loc="left") or ax.get_title() for ax in pictures["dampers"](Scene()).axes
    ]
    assert titles == ["wedge", "wedge, angle_next given", "round bar", "plate"]


def test_a_plate_is_drawn_without_angles():
    plate = vary(Scene(), "damper.shape", "plate", "damper.angle", "90 deg", "damper.base", "4 mm")
    said = texts(kind_named("wedge sector").pictures["platform"](plate))
    assert "base 4 mm" in said
    assert "angle" not in said

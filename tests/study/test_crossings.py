"""Engine orders against frequencies with closed forms."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from bladefem.report.modes import drawn_orders
from bladefem.scene.tables import Scene
from bladefem.scene.toml import vary
from bladefem.study.modes.crossings import (
    campbell_crossings,
    crossing_margins,
    interference_table,
)
from bladefem.study.modes.survey import orders_remark


def southwell(speeds, still=300.0, factor=1.7):
    """f^2 = f0^2 + B (speed / 2 pi)^2."""
    return np.sqrt(still**2 + factor * (speeds / (2 * np.pi)) ** 2)


def test_crossing_of_a_southwell_line_is_exact_with_three_speeds():
    """EO^2 s^2 = f0^2 + B s^2 gives s = f0 / sqrt(EO^2 - B), whatever the speeds between."""
    speeds = np.array([0.0, 400.0, 1500.0])
    table = pd.DataFrame({"speed": speeds, "mode": 1, "frequency": southwell(speeds)})
    found = campbell_crossings(table, [2, 3, 4, 6])
    expected = 2 * np.pi * 300.0 / np.sqrt(np.array([6, 4, 3, 2]) ** 2 - 1.7)
    assert np.allclose(found["speed"], expected, rtol=1e-12)
    assert np.allclose(found["frequency"], southwell(expected), rtol=1e-12)


def test_only_the_folded_diameter_crosses():
    speeds = np.linspace(0, 1500, 4)
    table = pd.concat(
        [
            pd.DataFrame(
                {"speed": speeds, "mode": 1, "nodal_diameter": n, "frequency": southwell(speeds)}
            )
            for n in range(7)
        ]
    )
    found = campbell_crossings(table, [3, 9, 4], sectors=12)
    assert sorted(zip(found["engine_order"], found["nodal_diameter"], strict=True)) == [
        (3, 3),
        (4, 4),
        (9, 3),
    ]


def test_a_crossing_on_a_given_speed_is_found_once():
    table = pd.DataFrame(
        {"speed": 2 * np.pi * np.array([50.0, 100.0, 150.0]), "mode": 1, "frequency": 400.0}
    )
    assert np.allclose(campbell_crossings(table, [4])["speed"], 200 * np.pi)


def test_interference_and_margins():
    table = pd.DataFrame(
        {
            "nodal_diameter": np.repeat(np.arange(7), 2),
            "mode": [1, 2] * 7,
            "frequency": np.tile([390.0, 1000.0], 7),
        }
    )
    speed = 2 * np.pi * 100.0
    rows = interference_table(table, 12, speed, [4, 8, 10])
    assert rows["wave"].tolist() == ["with"] * 2 + ["against"] * 4
    assert np.allclose(
        rows["margin"], [390 / 400 - 1, 1.5, 390 / 800 - 1, 0.25, 390 / 1000 - 1, 0.0]
    )
    assert crossing_margins(table, 12, speed, [4, 8, 10])["verdict"].tolist() == [
        "close",
        "ok",
        "close",
    ]


def test_nothing_is_excited_at_rest():
    table = pd.DataFrame(
        {"nodal_diameter": [2, 2, 3], "mode": [1, 2, 1], "frequency": [390.0, 1000.0, 400.0]}
    )
    found = crossing_margins(table, 12, 0.0, [2, 3, 5])
    assert found["verdict"].tolist() == ["not excited at rest"] * 2
    assert found["mode"].tolist() == [1, 1] and found["margin"].isna().all()


def test_orders_of_the_diagrams_are_told():
    scene = vary(Scene(), "excitation.engine_order", "9")
    assert "engine orders 1 to 12, up to 3 above excitation.engine_order = 9" in orders_remark(
        scene, ["excitation.engine_order"]
    )
    assert orders_remark(scene, ["kind"]).endswith("= 9, the default: the scene gives none")
    assert orders_remark(scene, None).endswith("= 9")


def test_pictures_have_the_lowest_orders_and_the_neighbours():
    crossings = pd.DataFrame({"engine_order": [*range(2, 23), 40]})
    found = SimpleNamespace(crossings=crossings)
    assert drawn_orders(20, found) == [2, 3, 4, 5, 17, 18, 19, 20, 21, 22]
    assert drawn_orders(30, found) == [2, 3, 4, 5, 30]

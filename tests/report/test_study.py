"""A study's tables and picture, of a field that is a number and of one that is a word."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from limit_stubs import linear_limits

from bladefem.report.best_value import best_value_lines, within_errors, worst_speed_headlines
from bladefem.report.study import (
    Variant,
    best_values,
    study_tables,
    warnings_of_all,
    write_study,
)
from bladefem.report.study_map import write_map, write_scatter
from bladefem.scene.tables import Scene
from bladefem.scene.toml import vary
from bladefem.util.message import warning
from bladefem.view.study import draw_study


def curve(load, amplitude):
    return SimpleNamespace(
        load=load,
        mass=None,
        friction_work=1e-3,
        slipping_at_peak=2,
        drift_at_peak=0.0,
        peak_frequency=830.0,
        peak_amplitude=amplitude,
        settings=SimpleNamespace(error=0.01, harmonics=3),
        halved=np.nan,
        body_mesh=np.nan,
        layer_law=np.nan,
        error=0.01,
        interval=None,
        lower=None,
        is_march=False,
        keeps_unstable=False,
        reaches_layer=False,
        frequency=np.arange(4.0),
        converged=np.ones(4, bool),
    )


def response(*amplitudes):
    return SimpleNamespace(
        limits=linear_limits(), curves=[curve(20.0 * (i + 1), a) for i, a in enumerate(amplitudes)]
    )


@pytest.mark.parametrize(
    ("field", "texts", "head"),
    [
        ("damper.angle", ("30 deg", "45 deg"), "damper.angle [rad]"),
        ("contact.normal", ("coupled", "prescribed"), "contact.normal"),
    ],
)
def test_best_load_of_each_value(field, texts, head, tmp_path):
    variants = [
        Variant(text, vary(Scene(), field, text), response(*amplitudes))
        for text, amplitudes in zip(texts, ((5e-5, 3e-5), (2e-5, 4e-5)), strict=True)
    ]
    table, loads = study_tables(variants)
    assert list(table["value"]) == list(texts) and list(table["load"]) == [40.0, 20.0]
    assert list(table["peak_amplitude"]) == [3e-5, 2e-5] and list(
        table["reduction"]
    ) == pytest.approx([10 / 3, 5.0])
    assert len(loads) == 8
    _, files = write_study(field, variants, tmp_path)
    assert [f.name for f in files] == [
        *(f"{stem}.{kind}" for stem in ("study", "study_loads") for kind in ("csv", "md", "tex")),
        "study.png",
        "report_study.html",
        "report_study.md",
    ]
    assert all(f.stat().st_size > 100 for f in files)
    page = files[-1].read_text(encoding="utf-8")
    beyond = "best of 2 values, the last: better ones may lie beyond" in page
    assert beyond == head.endswith("[rad]")
    for stem in ("study", "study_loads"):
        assert next(iter(pd.read_csv(tmp_path / f"{stem}.csv"))) == head
    assert f"| {field} |" in (tmp_path / "study.md").read_text(encoding="utf-8")
    assert "with 20 N on each seat, the smallest load studied" in page


def test_the_damper_as_it_is_stands_beside_the_best_load(tmp_path):
    """Over speeds it has no best load to choose: its own one grows with their square."""
    texts, amplitudes = ("6000 rpm", "9000 rpm"), ((3e-5, 5e-5, 9e-5), (2e-5, 4e-5, 8e-5))
    variants = [
        Variant(text, vary(Scene(), "operation.speed", text), response(*some), own=own)
        for text, some, own in zip(texts, amplitudes, (40.01, 60.02), strict=True)
    ]
    table, _ = study_tables(variants)
    assert list(table["own_load"]) == [40.0, 60.0] and list(table["own_amplitude"]) == [5e-5, 8e-5]
    _, files = write_study("operation.speed", variants, tmp_path)
    page = files[-1].read_text(encoding="utf-8")
    assert "the damper's own load, smallest: **50 µm**, ± 1 % (6000 rpm: 40 N on each seat)" in page
    assert "the damper's own load, largest: **80 µm**, ± 1 % (9000 rpm: 60 N on each seat)" in page
    assert {"own_load [N]", "own_amplitude [m]", "own_frequency [Hz]", "own_error"} <= {
        *pd.read_csv(tmp_path / "study.csv")
    }
    mus = ("0.2", "0.3")
    four = [
        replace(one, scene=vary(one.scene, "contact.mu", mu), text=f"{one.text}; {mu}")
        for one in variants
        for mu in mus
    ]
    _, files = write_map(("operation.speed", "contact.mu"), (texts, mus), four, tmp_path)
    page = files[-1].read_text(encoding="utf-8")
    assert "(9000 rpm; 0.2: 60 N on each seat)" in page
    assert "best contact.mu for all speeds, under the damper's own load: **not determined**" in page
    # not where nobody asked for it
    assert "own_load" not in study_tables([replace(one, own=None) for one in variants])[0]


ANGLE_AND_MU = ("damper.angle", "contact.mu")


def of_angles_and_mus(angles, mus):
    """Variants of a map: 30 deg and 0.3 have the smallest amplitude."""
    return [
        Variant(
            f"{a}; {m}",
            vary(vary(Scene(), ANGLE_AND_MU[0], a), ANGLE_AND_MU[1], m),
            response(5e-5, (3 - (m == "0.3") + (a == "45 deg")) * 1e-5, 6e-5),
        )
        for a in angles
        for m in mus
    ]


def test_a_map_says_what_it_shows_and_where_it_ends(tmp_path):
    values = ("30 deg", "45 deg"), ("0.2", "0.3", "0.4")
    _, files = write_map(ANGLE_AND_MU, values, of_angles_and_mus(*values), tmp_path)
    page = files[-1].read_text(encoding="utf-8")
    assert "over the values of both fields" in page
    assert "best damper.angle: **30 deg**, best of 2 values, the first" in page
    assert "best contact.mu: **0.3**, best of 3 values\n" in page
    assert "with 40 N on each seat)" in page


def own_loads(amplitudes, errors):
    """Two masses at two speeds under their own loads, as a study's table has them."""
    return pd.DataFrame(
        {
            "damper.mass": ["4 g", "4 g", "8 g", "8 g"],
            "operation.speed": ["4000 rpm", "5000 rpm"] * 2,
            "own_amplitude": amplitudes,
            "own_error": errors,
            "peak_amplitude": 1e-5,
            "error": 0.0,
        }
    )


@pytest.mark.parametrize(
    ("amplitudes", "errors", "value", "uncertainty"),
    [
        # 4 g has the smallest of all amplitudes, and the largest
        ((1e-5, 9e-5, 5e-5, 6e-5), (0.1, 0.1, 0.1, 0.1), "8 g", "best of 2 values, the last"),
        ((1e-5, 9e-5, 5e-5, 6e-5), (0.1, 0.3, 0.1, 0.1), "not determined", "do not separate"),
        # at 4000 rpm it may be 85 um, as far as is known
        ((5e-5, 6e-5, 7e-5, 9e-5), (0.7, 0.1, 0.1, 0.1), "not determined", "do not separate"),
        ((1e-5, 9e-5, 5e-5, 6e-5), (0.1, 0.1, np.inf, 0.1), "not determined", "do not separate"),
        ((1e-5, 9e-5, np.nan, 6e-5), (0.1, 0.1, 0.1, 0.1), None, None),
    ],
)
def test_the_value_for_all_speeds_has_the_smallest_largest_amplitude(
    amplitudes, errors, value, uncertainty
):
    found = worst_speed_headlines(own_loads(amplitudes, errors), "damper.mass", ["4 g", "8 g"])
    assert [one.value for one in found] == ([value] if value else [])
    for one in found:
        assert uncertainty in one.uncertainty
        assert "4 g: " in one.remark and "8 g: " in one.remark
    if value == "8 g":
        assert "4 g: 90 µm ± 10 %, at 5000 rpm; 8 g: 60 µm ± 10 %, at 5000 rpm" in found[0].remark


def test_an_unfinished_study_says_what_it_is_the_best_of(tmp_path):
    """The page is written after each run: values that were not run yet are none of those compared."""
    values = ("30 deg", "45 deg"), ("0.2", "0.3")
    done = of_angles_and_mus(("30 deg",), values[1])
    _, files = write_map(ANGLE_AND_MU, values, done, tmp_path)
    page = files[-1].read_text(encoding="utf-8")
    assert "runs finished: **2 of 4**, what follows is of these alone" in page
    assert "best damper.angle: **30 deg**, the only value studied" in page
    assert "best contact.mu: **0.3**, best of 2 values, the last" in page
    some = of_values((2e-5,), (0.01,))
    for write, name in ((write_study, "contact.mu"), (write_scatter, ["contact.mu"])):
        _, files = write(name, some, tmp_path, 3)
        assert "runs finished: **1 of 3**" in files[-1].read_text(encoding="utf-8")
        _, files = write(name, some, tmp_path, 1)
        assert "runs finished" not in files[-1].read_text(encoding="utf-8")


def of_values(amplitudes, errors):
    """A study of contact.mu with these amplitudes and errors at the best load."""
    variants = []
    for number, (amplitude, error) in enumerate(zip(amplitudes, errors, strict=True)):
        text = f"{0.2 + 0.1 * number:.1f}"
        one = response(2 * amplitude, amplitude)
        for each in one.curves:
            each.error = error
        variants.append(Variant(text, vary(Scene(), "contact.mu", text), one))
    return variants


@pytest.mark.parametrize(
    ("amplitudes", "errors", "near"),
    [
        ((139.53e-6, 140.49e-6, 2e-4), (0.14, 0.15, 0.01), ["0.2", "0.3"]),
        ((3.16e-6, 2.507e-6), (0.19, 0.71), ["0.2", "0.3"]),
        ((2e-6, 3e-6), (np.inf, 0.01), ["0.2", "0.3"]),
        ((2e-6, 3e-6), (0.01, np.inf), ["0.2", "0.3"]),
        ((2e-6, 3e-6), (np.nan, 0.1), ["0.2"]),
        ((2e-6, 3e-6), (0.1, 0.1), ["0.2"]),
    ],
)
def test_no_value_is_best_that_the_errors_do_not_separate(amplitudes, errors, near, tmp_path):
    table, files = write_study("contact.mu", of_values(amplitudes, errors), tmp_path)
    assert list(within_errors(table)["value"]) == near
    page = files[-1].read_text(encoding="utf-8")
    terminal = best_value_lines(best_values("contact.mu", table))
    if len(near) == 1:
        assert "best contact.mu: **0.2**, best of 2 values" in page
        assert terminal.startswith("best contact.mu: 0.2, best of 2 values")
        return
    said = "the estimated errors do not separate 0.2 and 0.3"
    assert f"best contact.mu: **not determined**, {said}" in page
    assert f"best contact.mu: not determined: {said}" in terminal
    assert "smallest resonance amplitude: **" in page and "amplitude there" not in page


def test_one_field_of_a_map_may_be_determined_alone(tmp_path):
    names, values = ("damper.angle", "contact.mu"), (("30 deg", "45 deg"), ("0.2", "0.3"))
    heights = {("30 deg", "0.2"): 2e-5, ("30 deg", "0.3"): 2.01e-5}
    variants = [
        Variant(
            f"{a}; {m}",
            vary(vary(Scene(), names[0], a), names[1], m),
            response(heights.get((a, m), 5e-5), 6e-5),
        )
        for a in values[0]
        for m in values[1]
    ]
    _, files = write_map(names, values, variants, tmp_path)
    page = files[-1].read_text(encoding="utf-8")
    assert "best damper.angle: **30 deg**, best of 2 values" in page
    assert "best contact.mu: **not determined**, the estimated errors do not separate" in page


def test_warnings_of_all_values_are_on_the_page_each_once(tmp_path):
    variants = [
        replace(one, warnings=("2 of 40 points did not converge", *more))
        for one, more in zip(of_values((2e-5, 3e-5), (0.01, 0.01)), (("a torus",), ()), strict=True)
    ]
    _, files = write_study("contact.mu", variants, tmp_path)
    page = files[-1].read_text(encoding="utf-8")
    assert "- contact.mu = 0.2; contact.mu = 0.3: 2 of 40 points did not converge\n" in page
    assert "- contact.mu = 0.2: a torus\n" in page
    # three labels before a sentence would bury it
    four = [
        replace(one, warnings=(*(("a torus",) if number else ()), "a coarse mesh"))
        for number, one in enumerate(of_values(4 * (2e-5,), 4 * (0.01,)))
    ]
    said = warnings_of_all(["contact.mu"], four)
    assert said[0] == "all 4 runs: a coarse mesh"
    assert said[1] == "contact.mu = 0.3; contact.mu = 0.4; contact.mu = 0.5: a torus"


def test_warnings_of_several_values_keep_their_advice_and_all_details():
    both = [
        replace(one, warnings=(warning("unstable under 9 N", "use a march", f"{number} um"),))
        for number, one in enumerate(of_values(2 * (2e-5,), 2 * (0.01,)))
    ]
    (said,) = warnings_of_all(["contact.mu"], both)
    assert said == "contact.mu = 0.2; contact.mu = 0.3: unstable under 9 N"
    assert said.advice == "use a march"
    assert said.detail == "contact.mu = 0.2: 0 um. contact.mu = 0.3: 1 um"
    # two of one run that differ in their details
    twice = [replace(both[0], warnings=(*both[0].warnings, *both[1].warnings))]
    assert warnings_of_all(["contact.mu"], twice)[0].detail == "contact.mu = 0.2: 0 um. 1 um"


def test_bars_and_marks_tell_how_sure_each_resonance_is():
    variants = of_values((2e-5, 3e-5, 4e-5), (0.5, 0.01, np.inf))
    for each in variants[0].response.curves:
        each.is_march = True
    for each in variants[2].response.curves:
        each.keeps_unstable = True
    table, loads = study_tables(variants)
    assert list(table["given_by"]) == ["march in time", "balance", "unstable balance"]
    figure = draw_study(table.assign(axis=[0.2, 0.3, 0.4]), loads)
    left, right = figure.axes[0], figure.axes[-1]
    bars = left.containers[0].lines[2][0].get_segments()
    heights = [segment[:, 1] for segment in bars]
    np.testing.assert_allclose(heights, [[10, 30], [29.7, 30.3], [40, 40]])
    marks = {
        (line.get_marker(), line.get_mfc()) for line in left.lines if len(line.get_xdata()) == 1
    }
    assert {mark for mark, _ in marks} >= {"D", "s"} and ("s", "white") in marks
    words = [text.get_text() for text in right.get_legend().get_texts()]
    assert words[-3:] == ["march in time", "unstable balance", "error unknown (hollow)"]

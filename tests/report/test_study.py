"""A study's tables and picture, of a field that is a number and of one that is a word."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from limit_stubs import linear_limits

from bladefem.report.study import Variant, study_tables, write_study
from bladefem.report.study_map import write_map
from bladefem.scene.tables import Scene
from bladefem.scene.toml import vary


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
        frequency=np.arange(4.0),
        converged=np.ones(4, bool),
    )


def response(*amplitudes):
    return SimpleNamespace(
        limits=linear_limits(), curves=[curve(20.0 * (i + 1), a) for i, a in enumerate(amplitudes)]
    )


@pytest.mark.parametrize(
    ("field", "texts", "number"),
    [
        ("damper.angle", ("30 deg", "45 deg"), "damper.angle [rad]"),
        ("contact.normal", ("coupled", "prescribed"), None),
    ],
)
def test_best_load_of_each_value(field, texts, number, tmp_path):
    variants = [
        Variant(text, vary(Scene(), field, text), response(*amplitudes))
        for text, amplitudes in zip(texts, ((5e-5, 3e-5), (2e-5, 4e-5)), strict=True)
    ]
    table, loads = study_tables(field, variants)
    assert list(table["value"]) == list(texts) and list(table["load"]) == [40.0, 20.0]
    assert list(table["peak_amplitude"]) == [3e-5, 2e-5] and list(
        table["reduction"]
    ) == pytest.approx([10 / 3, 5.0])
    assert len(loads) == 8 and [name for name in table if "[" in name] == (
        [number] if number else []
    )
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
    assert beyond == (number is not None)
    assert "with 20 N on each seat, the smallest load studied" in page


def test_a_map_says_what_it_shows_and_where_it_ends(tmp_path):
    names, values = ("damper.angle", "contact.mu"), (("30 deg", "45 deg"), ("0.2", "0.3", "0.4"))
    variants = [
        Variant(f"{a}; {m}", Scene(), response(5e-5, (3 - (m == "0.3")) * 1e-5, 6e-5))
        for a in values[0]
        for m in values[1]
    ]
    _, files = write_map(names, values, variants, tmp_path)
    page = files[-1].read_text(encoding="utf-8")
    assert "over the values of both fields" in page
    assert "best damper.angle: **30 deg**, best of 2 values, the first" in page
    assert "best contact.mu: **0.3**, best of 3 values\n" in page
    assert "with 40 N on each seat)" in page

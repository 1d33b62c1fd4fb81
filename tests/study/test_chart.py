"""The chart on the reference blade: known orders of accuracy, known failures, files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bladefem.hbm.api import solve
from bladefem.hbm.reference import reference_model
from bladefem.report.chart import write_chart
from bladefem.scene_file import load_scene
from bladefem.study.chart import chart, resonance
from bladefem.study.chart_mesh import mesh_table
from bladefem.study.family import family_of
from bladefem.study.methods import applicable, exact, shooting, tangential
from bladefem.study.settings import Settings, first_for

PLANE = Path(__file__).parents[2] / "scenes" / "plane.toml"

@pytest.fixture(scope="module")
def made():
    family = family_of(reference_model(load=3.0, points=2, modes=12, harmonics=63))
    return chart(family, first_for(family.modes), 2, 0.02, 12.0, (1150.0, 1600.0))


def test_balance_converges_with_harmonics(made):
    error = made.methods.set_index("name")["error_phasor"]
    assert error["H 1"] > 3 * error["H 3"] > 3 * error["H 7"]
    assert error["H 3"] < 1e-3


def test_automatic_choice_is_marked_and_right(made):
    for table in (made.methods, made.models):
        chosen = table[table["chosen"]]
        assert len(chosen) == 1
        assert chosen["error"].iloc[0] < 0.02


def test_poor_models_are_seen(made):
    models = made.models.set_index("name")
    assert models.loc["1 mode", "error"] > 0.1          # mode 2 is studied
    assert any("1 mode: its resonance lies outside" in remark for remark in made.remarks)
    assert any("changed by" in remark for remark in made.remarks)


def test_files_are_written(made, tmp_path):
    files = write_chart(made, tmp_path, 0.02, "reference blade")
    assert all(file.stat().st_size > 100 for file in files)
    assert len(pd.read_csv(files[0])) == len(made.methods)


def test_exact_events_and_shooting_agree_with_the_balance():
    """Shooting has no truncation, the balance of 15 harmonics 2e-6 of it; stiff modes are quasi-static to 1e-3."""
    model = tangential(reference_model(load=3.0, points=1, modes=8, harmonics=15))
    omega = 2 * np.pi * 1340.0
    balance = solve(model, omega, 15, 4096).probe[1, 0]
    assert exact(15)(model, omega, None).first == pytest.approx(balance, rel=1e-5)
    assert shooting(model, omega, None).first == pytest.approx(balance, rel=1e-4)


def test_methods_in_time_refuse_what_they_cannot_do():
    assert applicable(reference_model(phase=1.0)) == "blades are not in phase"
    assert applicable(reference_model()) == ""


def test_resonance_of_one_mode_is_exact():
    """1/amplitude^2 of a weakly damped oscillator is a parabola in omega^2."""
    omega = np.linspace(0.97, 1.03, 7)
    first = 1 / (1 - omega**2 + 0.02j)
    peak = resonance(omega, first)
    assert peak.frequency * 2 * np.pi == pytest.approx(1.0, rel=1e-9)
    assert peak.amplitude == pytest.approx(50.0, rel=1e-9)


def test_meshes_of_second_order_agree_and_those_of_first_do_not():
    """Plane blade in bending: 12 and 8 mm differ by 1 % of the frequency, linear triangles are far too stiff."""
    scene, remarks = load_scene(PLANE), []
    table = mesh_table(scene, Settings(10, 1, 64, "rigid", 4), 40.0, [0.012, 0.008], 300.0, remarks)
    rows = table.set_index(["family", "name"])
    assert list(rows.index) == [(order, size) for order in ("order 1", "order 2") for size in ("12 mm", "8 mm")]
    assert rows.loc[("order 2", "8 mm"), "error_frequency"] == 0.0
    assert rows.loc[("order 2", "12 mm"), "error_frequency"] < 0.02
    assert rows.loc["order 1", "error_frequency"].min() > 0.05
    assert "8 mm of second order" in remarks[0]


def test_a_mesh_that_would_take_too_long_is_left_out_and_named():
    remarks = []
    table = mesh_table(load_scene(PLANE), Settings(10, 1, 64, "rigid", 4), 40.0, [0.012, 1e-4], 10.0, remarks)
    assert table["left_out"].tolist() == [False, True, False, True]
    assert sum("0.1 mm: left out" in remark for remark in remarks) == 2

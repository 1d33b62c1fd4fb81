"""A damper of another mass: scaled from the reduced one as if it had been meshed with that
density.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from bladefem.report.best_load import of_same_damper
from bladefem.report.response_arrays import resonance_arrays
from bladefem.report.response_points import linear_points
from bladefem.report.statements import response_answer
from bladefem.scene.toml import load_scene
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import middle_case
from bladefem.study.pipeline.damper_contact import contact_patches
from bladefem.study.pipeline.design_table import design_table
from bladefem.study.pipeline.linear_limits import full_stick
from bladefem.study.pipeline.reduced_sector import reduce_sector, with_damper_mass
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.stability.lower_motion import LowerMotion


def receptance(model, omega):
    """(p, p) displacement for a unit force at the ports [m/N]."""
    return (model.shapes / (model.omega**2 - omega**2)) @ model.shapes.T + model.residual


def test_weighted_damper_is_the_one_with_that_density():
    found = {}
    for mass in ("20 g", "70 g"):
        scene = load_scene("scenes/plane.toml", ["mesh.size=6 mm", f"plane.damper_mass={mass}"])
        bodies = Bodies(scene, build_mesh(scene))
        found[mass] = reduce_sector(bodies, contact_patches(bodies.mesh), [0], 4)
    scaled, meshed = with_damper_mass(found["20 g"], 0.07), found["70 g"]
    assert np.isclose(scaled.mass, 0.07) and np.isclose(meshed.mass, 0.07, rtol=1e-9)
    for omega in (300.0, 2 * np.pi * 5000.0):
        a, b = receptance(scaled.damper, omega), receptance(meshed.damper, omega)
        assert abs(a - b).max() < 1e-7 * abs(b).max()
    assert with_damper_mass(meshed, None) is meshed


@pytest.mark.parametrize("masses", [(None,), (1e-3, 5e-3), (1e-3, 3e-3, 5e-3)])
@pytest.mark.parametrize("loads", [(5.0, 40.0, 300.0), (300.0, 5.0, 40.0)])
def test_modes_are_chosen_under_a_middle_load(masses, loads):
    """Of two masses the first load of the second one stood in the middle of the list: 5 N, at which
    the damper of a blade of 95 mm lifts off, so that the run was refused.
    """
    cases = [LoadCase(load, None, None, mass) for mass in masses for load in loads]
    assert middle_case(cases).load == 40.0
    assert middle_case(cases).mass == masses[len(masses) // 2]


@pytest.fixture(scope="module")
def two_masses():
    """Responses under a load at which nothing slips."""
    changes = ("mesh.size=6 mm", "study.loads=500 N", "study.stability=false")
    scene = load_scene("scenes/plane.toml", [*changes, "study.masses=5 g, 50 g"])
    return pipeline.run(scene, None, until="response").response


def test_each_mass_has_a_full_stick_of_its_own(two_masses):
    """That of the other one is 111 Hz off; without damper there is no mass."""
    limits, curves = two_masses.limits, two_masses.curves
    assert [limit.mass for limit in limits] == [None, 0.005, 0.05]
    for curve in curves:
        stuck = full_stick(limits, curve.mass)
        assert stuck.peak_frequency == pytest.approx(curve.peak_frequency, rel=1e-4)
        assert stuck.peak_amplitude == pytest.approx(curve.peak_amplitude, rel=1e-3)
    assert abs(limits[1].peak_frequency - limits[2].peak_frequency) > 100.0


def test_tables_give_each_mass_its_full_stick(two_masses):
    table = pd.DataFrame(design_table(two_masses.curves, two_masses.limits))
    assert table["load"].tolist() == [0.0, 500.0, 500.0, np.inf, np.inf]
    for mass, rows in table.groupby("mass"):
        loaded, stuck = rows["peak_frequency"]
        assert stuck == pytest.approx(loaded, rel=1e-4), mass
        own = of_same_damper(table, rows.iloc[0])
        assert own["load"].tolist() == [0.0, 500.0, np.inf]
    points = [linear_points(limit) for limit in two_masses.limits]
    assert "mass" not in points[0] and [p["mass"].iloc[0] for p in points[1:]] == [0.005, 0.05]
    data = resonance_arrays(two_masses.curves, two_masses.limits)
    assert np.isfinite(data["frequency"]).all()
    stuck = data["frequency"].sel(load=[500.0, np.inf]).to_numpy()
    np.testing.assert_allclose(stuck[:, 0], stuck[:, 1], rtol=1e-4)


def test_a_lower_motion_has_a_column_of_the_table(two_masses):
    """Only where some load has one; empty elsewhere."""
    light, heavy = two_masses.curves
    table = design_table([light, replace(heavy, lower=LowerMotion(1.16e-4))], two_masses.limits)
    np.testing.assert_array_equal(
        table["lower_amplitude"], [np.nan, np.nan, 1.2e-4, np.nan, np.nan]
    )
    assert "lower_amplitude" not in design_table(two_masses.curves, two_masses.limits)


def test_the_answer_names_the_full_stick_of_its_damper():
    """The better damper by its amplitude is the light one."""
    summary = pd.DataFrame(
        {
            "load": [0.0, 40.0, 40.0, np.inf, np.inf],
            "mass": [np.nan, 0.005, 0.05, 0.005, 0.05],
            "peak_frequency": [1120.0, 1150.0, 1060.0, 1162.0, 1051.0],
            "peak_amplitude": [8e-5, 2e-5, 3e-5, 6e-5, 1e-5],
            "error": 0.02,
        }
    )
    numbers = {what: (value, remark) for what, value, remark in response_answer(summary).numbers}
    # the other damper's full stick lies below it, its own far above
    assert "lowest resonance amplitude found" not in numbers
    value, remark = numbers["resonance frequency there"]
    assert value == "1150 Hz" and remark == "1120 Hz free, 1162 Hz in full stick"

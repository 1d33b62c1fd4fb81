"""Heat from a scene to modes, seats and stresses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bladefem.scene.toml import load_scene
from bladefem.study.modes.stress import mode_strength
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.damper_contact import condense_contact, contact_patches, thermal_gap
from bladefem.study.pipeline.history import condense_friction
from bladefem.study.pipeline.normal_modes import find_modes
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.stage_inputs import stage_key

SCENES = Path(__file__).parents[2] / "scenes"
HOT = [
    "mesh.scale=3",
    "material.blade.expansion=1.2e-5",
    "material.damper.expansion=1.2e-5",
]


def test_a_free_wheel_grows_without_opening_its_seats():
    """Wheel and damper of one expansion grow alike: what the heat does to the gaps is a rigid motion
    of the damper, and no stress is left.
    """
    scene = load_scene(
        SCENES / "wedge.toml",
        [*HOT, "support.clamp=''", "operation.stiffening=false", "temperature.uniform=893.15"],
    )
    bodies = Bodies(scene, build_mesh(scene))
    patches = contact_patches(bodies.mesh)
    opened = thermal_gap(bodies, patches)
    problem = condense_contact(bodies, patches)
    # with friction as well
    rough = condense_friction(bodies, patches)
    np.testing.assert_allclose(rough.clearance, problem.clearance, atol=1e-12)
    rigid = problem.rigid
    left = opened - rigid @ np.linalg.lstsq(rigid, opened, rcond=None)[0]
    assert abs(opened).max() > 1e-3 and abs(left).max() < 1e-12
    inside = np.unique(bodies.mesh.bodies["blade"])
    grown = 1.2e-5 * 600 * bodies.mesh.points
    np.testing.assert_allclose(bodies.thermal_displacement[inside], grown[inside], atol=1e-7)


@pytest.fixture(scope="module")
def mesh():
    return build_mesh(load_scene(SCENES / "plane.toml", HOT))


def test_a_file_of_one_temperature_is_the_uniform_one(mesh, tmp_path):
    file = tmp_path / "t.csv"
    rows = [f"{x},{y},0,300" for x in (0, 150) for y in (-50, 50)]
    file.write_text("\n".join(["x [mm],y [mm],z [mm],T [degC]", *rows]))
    uniform = load_scene(SCENES / "plane.toml", [*HOT, "temperature.uniform=300 degC"])
    given = load_scene(SCENES / "plane.toml", [*HOT, f"temperature.file={file}"])
    one, other = (find_modes(Bodies(s, mesh))[0] for s in (uniform, given))
    np.testing.assert_allclose(one.frequencies, other.frequencies, rtol=1e-8)
    keys = {stage_key("modes", s) for s in (uniform, given)}
    assert len(keys) == 2


def test_heat_at_rest_makes_mean_stress(mesh):
    """At the clamp, of the order of E alpha dT."""
    hot = load_scene(
        SCENES / "plane.toml", [*HOT, "operation.speed=0 rpm", "temperature.uniform=120 degC"]
    )
    bodies = Bodies(hot, mesh)
    steady = mode_strength(bodies, find_modes(bodies)[0]).steady
    assert 0.3 < steady / (hot.material.blade.E * 1.2e-5 * 100) < 3
    cold = replace(hot, temperature=replace(hot.temperature, uniform=None))
    bodies = Bodies(cold, mesh)
    assert mode_strength(bodies, find_modes(bodies)[0]).steady == 0


def test_softer_when_hot(mesh):
    """A table alone, without thermal strain: frequencies go with the root of E."""
    found = []
    for E in (200, 100):
        tables = [f"material.blade.table=20 degC: E={E} GPa", "operation.speed=0 rpm"]
        scene = load_scene(SCENES / "plane.toml", [*HOT, *tables])
        found.append(find_modes(Bodies(scene, mesh))[0].frequencies)
    np.testing.assert_allclose(found[0] / found[1], np.sqrt(2), rtol=1e-7)

"""One contact law in statics and vibration: the harmonic 0 of the balance seats the damper as the
complementarity problem does.
"""

from dataclasses import replace

import numpy as np
import pytest

from bladefem import load_scene
from bladefem.contact.seating import solve as seat
from bladefem.hbm.solve import solve
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.assemble_model import joint_model
from bladefem.study.pipeline.stages import (
    Bodies,
    build_mesh,
    harmonic_diameters,
    on_layer,
    reduce_sector,
    seat_damper,
)
from bladefem.study.pipeline.validate_mesh import found_patches

LOAD = 20.0
OTHER = 26.0
OMEGA = 2 * np.pi * 150.0


@pytest.fixture(scope="module")
def parts():
    """Plane blades on a coarse mesh, whose bodies have the same stiffness at rest and vibrating."""
    given = ["mesh.scale=3", "model.modes=20", "operation.stiffening=false", "contact.mu=0.001"]
    scene = load_scene("scenes/plane.toml", given)
    mesh = build_mesh(scene)
    bodies = Bodies(scene, mesh)
    patches = found_patches(scene, mesh, excited=True)
    problem = seat_damper(bodies, patches)
    reduced = reduce_sector(bodies, patches, harmonic_diameters(scene, mesh, 1), 20)
    return scene, mesh, patches, problem, reduced


def model_of(parts, load, *given):
    scene, mesh, patches, problem, reduced = parts
    scene = load_scene("scenes/plane.toml", ["contact.mu=0.001", *given])
    problem = on_layer(scene, problem)
    maps = seat(problem, 0.0, normal=load, bedded=True)
    case = pipeline.load_cases(scene, mesh, pipeline.Seating(problem, {load: maps}))[0]
    model = joint_model(scene, mesh, reduced, patches, case, 1, "rigid")
    return model, np.concatenate([m.force for m in maps]), problem


@pytest.mark.parametrize("stiffness", ["4e10", "4e12"])
def test_without_excitation_the_model_rests_in_the_seated_state(parts, stiffness):
    model, force, _ = model_of(parts, LOAD, f"contact.kn_area={stiffness} N/m^3")
    still = replace(model, excitation={1: np.zeros(1)})
    point = solve(still, OMEGA, 1, 64)
    assert point.converged
    assert np.abs(point.f[:, 0, 0] - force).max() < 1e-10 * force.max()
    assert np.abs(point.f[:, :, 1:]).max() < 1e-10 * force.max()

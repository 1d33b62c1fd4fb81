"""One contact law in statics and vibration: the harmonic 0 of the balance seats the damper as the
complementarity problem does.
"""

from dataclasses import replace

import numpy as np
import pytest

from bladefem import load_scene
from bladefem.contact.seating import solve_seating as seat
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.solve import solve
from bladefem.study.pipeline.assemble_model import joint_model
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.damper_contact import on_layer, seat_damper
from bladefem.study.pipeline.normal_modes import harmonic_diameters
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.run_records import Seating
from bladefem.study.pipeline.scene_mesh import build_mesh
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
    case = load_cases(scene, mesh, Seating(problem, {load: maps}))[0]
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


@pytest.mark.parametrize(("stiffness", "radius"), [("4e10", 0.5), ("4e12", 20.0), ("1e15", 100.0)])
def test_the_static_part_under_another_load_gives_that_pressure_map(parts, stiffness, radius):
    """Elements of one load, flexibility of harmonic 0, and the additional load on the damper: the
    map of the other load. Crowned seats, so that the contact grows with the load.
    """
    scene, mesh, patches, problem, reduced = parts
    scene = load_scene("scenes/plane.toml", [f"contact.kn_area={stiffness} N/m^3"])
    across = np.concatenate([p.points @ p.frame[0, 1] for p in patches])
    middle = np.concatenate(
        [np.full(len(p.area), (p.points @ p.frame[0, 1]).mean()) for p in patches]
    )
    crown = (across - middle) ** 2 / (2 * radius)
    problem = replace(on_layer(scene, problem), clearance=crown)
    maps = {load: seat(problem, 0.0, normal=load) for load in (LOAD, OTHER)}
    first, second = (np.concatenate([m.force for m in maps[load]]) for load in (LOAD, OTHER))
    assert np.abs(second - OTHER / LOAD * first).max() > 1e-3 * first.max()
    case = load_cases(scene, mesh, Seating(problem, {LOAD: maps[LOAD]}))[0]
    model = joint_model(scene, mesh, reduced, patches, case, 1, "elastic")
    linear = condense(model, OMEGA, 1)
    rows = slice(None, None, model.directions)
    scale = [
        -(problem.load @ problem.rigid.T @ f) / (problem.load @ problem.load)
        for f in (first, second)
    ]
    found = settled(
        linear.G[0].real[rows, rows],
        problem.rigid,
        model.elements,
        -(scale[1] - scale[0]) * problem.damper_swell,
        -scale[1] * problem.load,
    )
    assert np.abs(found - second).max() < 1e-8 * second.max()


def settled(G, B, elements, free, load):
    """Normal forces of elements n0 + kn w between bodies w = free - G (f - f0) + B q, B^T f = load;
    by a dense active set, without friction.
    """
    kn = elements.kn
    n0 = elements.n0
    rest = np.maximum(n0, 0.0)
    active = n0 > 0
    for _ in range(50):
        spring = kn * active
        system = np.block(
            [[np.eye(len(kn)) + G * spring, -B], [B.T * spring, np.zeros((B.shape[1],) * 2)]]
        )
        right = np.concatenate([free + G @ (rest - n0 * active), load - B.T @ (n0 * active)])
        w = np.linalg.lstsq(system, right, rcond=1e-14)[0][: len(kn)]
        now = n0 + kn * w > 0
        if np.array_equal(now, active):
            return np.maximum(n0 + kn * w, 0.0)
        active = now
    raise AssertionError("the active set did not settle")

"""Motion and stress of a damped resonance: judged by one full-order harmonic solve."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from bladefem.contact.patch import port_matrix
from bladefem.contact.seating import solve_seating as seat
from bladefem.errors import NotSolvedError
from bladefem.fem.alternating_stress import alternating_stress
from bladefem.fem.flexibility import unknown_places
from bladefem.fem.forced_motion import forced_motion
from bladefem.fem.modes import modes as normal_modes
from bladefem.fem.stress import gauss_stress, nodal_stress, von_mises
from bladefem.friction.fourier import to_complex
from bladefem.hbm.solve import solve
from bladefem.scene.toml import load_scene
from bladefem.study.modes.linear_response import excitation_load
from bladefem.study.pipeline import damped_motion as subject
from bladefem.study.pipeline.assemble_model import joint_model, rigid_body
from bladefem.study.pipeline.best_load_remarks import stress_message
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.case_models import load_cases
from bladefem.study.pipeline.coriolis import has_coriolis, with_coriolis
from bladefem.study.pipeline.damper_contact import seat_damper
from bladefem.study.pipeline.normal_modes import find_modes, harmonic_diameters
from bladefem.study.pipeline.reduced_sector import reduce_sector
from bladefem.study.pipeline.run_records import Seating
from bladefem.study.pipeline.scene_mesh import build_mesh
from bladefem.study.pipeline.validate_mesh import found_patches

LOAD = 2.0


def scipy_matrix(matrix):
    """A PETSc matrix, or the parts of a folded one, as SciPy's."""
    if hasattr(matrix, "C"):
        return matrix.C.conj().T @ matrix.A @ matrix.C
    indptr, indices, data = matrix.getValuesCSR()
    return sp.csr_matrix((data, indices, indptr), shape=matrix.size)


def full_order(flex, found, load, omega, ratio):
    """(K - w^2 M + j w C) u = load by a sparse factorisation; C damps the given modes."""
    con = flex.con
    K = scipy_matrix(con.K)
    M = scipy_matrix(con.M)
    places = unknown_places(con)
    X = found.shapes[:, :, : con.body.dim].reshape(len(found.frequencies), -1)[:, places].T
    natural = 2 * np.pi * found.frequencies
    MX = M @ X
    factor = splu(sp.csc_matrix(K - omega**2 * M).astype(complex))
    b = con.T.conj().T @ load
    # Woodbury for the damping, which acts on the modes
    small = np.diag(1 / (1j * omega * 2 * ratio * natural))
    A_MX = factor.solve(np.ascontiguousarray(MX, dtype=complex))
    x = factor.solve(np.asarray(b, dtype=complex))
    x = x - A_MX @ np.linalg.solve(small + MX.conj().T @ A_MX, MX.conj().T @ x)
    return (con.T @ x).reshape(-1, con.body.dim)


@pytest.fixture(scope="module")
def plane():
    """The plane blades on a coarse mesh with an interblade phase, solved at one frequency."""
    scene = load_scene(
        "scenes/plane.toml",
        ["mesh.scale=3", "excitation.phase=60 deg", "model.modes=20", "study.loads=2 N"],
    )
    mesh = build_mesh(scene)
    bodies = Bodies(scene, mesh)
    patches = found_patches(scene, mesh, excited=True)
    problem = seat_damper(bodies, patches)
    maps = {LOAD: seat(problem, 0.0, normal=LOAD)}
    case = load_cases(scene, mesh, Seating(problem, maps))[0]
    reduced = reduce_sector(bodies, patches, harmonic_diameters(scene, mesh, 3), 20)
    model = joint_model(scene, mesh, reduced, patches, case, 5, "rigid")
    flex = bodies.factorised(0)
    found = normal_modes(flex.con, 20, flex, tolerance=1e-11)
    # beside the resonance: the judge's undamped factorisation is singular on it
    solution = solve(model, found.frequencies[1] * 2 * np.pi * 1.02, 5, 256)
    assert solution.converged and solution.work.friction > 1e-6
    return scene, bodies, patches, case, solution, found, flex


def test_displacement_and_stress_equal_a_full_order_solve(plane):
    scene, bodies, patches, case, solution, found, flex = plane
    point = subject.SolvedPoint(case, solution)
    motion = subject.damped_motion(bodies, patches, [found], point)
    loads = subject.blade_loads(bodies, patches, point)
    for h, u in enumerate(motion.harmonics, 1):
        exact = full_order(flex, found, loads[h - 1], h * solution.omega, scene.operation.damping)
        assert abs(u - exact).max() < 1e-6 * abs(exact).max()
        stress = gauss_stress(bodies.still_blade, u).stress
        wanted = gauss_stress(bodies.still_blade, exact).stress
        assert abs(stress - wanted).max() < 1e-3 * abs(wanted).max()


def test_the_probe_moves_as_in_the_balance(plane):
    _, bodies, patches, case, solution, found, _ = plane
    motion = subject.damped_motion(bodies, patches, [found], subject.SolvedPoint(case, solution))
    assert motion.mismatch < 1e-3
    assert motion.probe[0] == pytest.approx(solution.probe[1, 0], rel=1e-3)


def relative_motion(bodies, patches, solution, moved, phase):
    """(H, ports) motion of the blades relative to the damper at the contact: the next blade does an
    interblade phase later what this one does at its other seat."""
    blade = port_matrix(patches, bodies.mesh, "blade")
    damper = port_matrix(patches, bodies.mesh, "damper")
    of_next = np.arange(blade.shape[1]) >= len(patches[0].area) * bodies.mesh.dimension
    found = []
    for h, u in enumerate(moved, 1):
        seen = np.where(of_next, np.exp(1j * h * phase), 1.0) * (blade.T @ u.ravel())
        found.append(seen - damper.T @ u.ravel())
    return np.array(found)


@pytest.mark.parametrize("damper", ["rigid", "mass"])
def test_the_damper_moves_as_the_balance_has_it(plane, damper):
    """Blade by its finite elements, damper by its inertia: the difference at the contact is the
    relative motion that the balance solved for."""
    scene, bodies, patches, case, solution, found, _ = plane
    reduced = reduce_sector(bodies, patches, harmonic_diameters(scene, bodies.mesh, 3), 20)
    if damper == "mass":
        model = joint_model(scene, bodies.mesh, reduced, patches, case, 5, damper)
        solution = solve(model, solution.omega, 5, 256)
        assert solution.converged
    body = rigid_body(scene, bodies.mesh, reduced, patches, damper)
    point = subject.SolvedPoint(case, solution)
    motion = subject.damped_motion(bodies, patches, [found], point)
    moved = subject.damper_motion(bodies.mesh, patches, point, body)
    assert np.abs(motion.harmonics * moved).max() == 0.0
    there = relative_motion(
        bodies, patches, solution, motion.harmonics + moved, scene.excitation.phase
    )
    n, d, _ = solution.w.shape
    w = to_complex(solution.w.reshape(n * d, -1)).T[1:]
    # the paper's damper has tangential motion only
    rows = np.arange(there.shape[1]).reshape(n, -1)[:, -d:].ravel()
    assert abs(there[:, rows] - w).max() < 1e-3 * abs(w).max()


def test_more_harmonics_are_followed_in_time():
    """Two harmonics of one field reach what their sum reaches, not the sum of their maxima."""
    scene = load_scene("scenes/plane.toml", ["mesh.scale=4"])
    bodies = Bodies(scene, build_mesh(scene))
    u = np.zeros((len(bodies.mesh.points), 2))
    u[:, 1] = bodies.mesh.points[:, 0] ** 2
    one = alternating_stress(bodies.still_blade, np.array([u + 0j]))
    assert one.field.max() == one.largest
    # one harmonic: the field is its amplitude, and the bound of the others is no smaller
    amplitude = von_mises(nodal_stress(bodies.still_blade, u + 0j))
    np.testing.assert_allclose(one.field, amplitude, rtol=2e-2, atol=1e-6 * one.largest)
    # cos t - cos(3 t) / 3 reaches 0.943 of the amplitude, cos t + cos(3 t) / 3 reaches 4/3 of it
    flat = alternating_stress(bodies.still_blade, np.array([u + 0j, 0 * u, -u / 3 + 0j]))
    sharp = alternating_stress(bodies.still_blade, np.array([u + 0j, 0 * u, u / 3 + 0j]))
    assert flat.largest / one.largest == pytest.approx(2 * np.sqrt(2) / 3, rel=2e-3)
    assert sharp.largest / one.largest == pytest.approx(4 / 3, rel=1e-9)


def test_too_few_modes_are_refused(plane):
    _, bodies, _, _, _, found, flex = plane
    load = excitation_load(bodies)
    few = replace(found, frequencies=found.frequencies[:1], shapes=found.shapes[:1])
    with pytest.raises(NotSolvedError, match="expected modes beyond the frequency"):
        forced_motion(flex, few, load[:, None], np.array([2 * np.pi * 3000.0]), np.zeros(1))


@pytest.mark.parametrize("order, fast", [(9, False), (27, False), (27, True)])
def test_a_wheel_moves_at_the_probe_as_in_the_balance(order, fast):
    """Harmonics in several nodal diameters, waves with and against the rotation; with Coriolis
    forces, which move the resonance by many of its widths.
    """
    fields = [
        "mesh.size=14 mm",
        "mesh.scale=1.5",
        "model.modes=20",
        f"excitation.engine_order={order}",
    ]
    fields += ["operation.speed=9000 rpm", "operation.coriolis=true"] if fast else []
    scene = load_scene("scenes/wedge.toml", fields)
    mesh = build_mesh(scene)
    bodies = Bodies(scene, mesh)
    patches = found_patches(scene, mesh, excited=True)
    problem = seat_damper(bodies, patches)
    maps = {20.0: seat(problem, scene.operation.speed, normal=20.0, bedded=True)}
    case = load_cases(scene, mesh, Seating(problem, maps))[0]
    diameters = harmonic_diameters(scene, mesh, 3)
    reduced = with_coriolis(scene, reduce_sector(bodies, patches, diameters, 20))
    assert has_coriolis(reduced) == fast
    model = joint_model(scene, mesh, reduced, patches, case, 3, "elastic")
    # Coriolis forces couple the modes that are kept: here and in the balance the same ones
    modes = find_modes(bodies, diameters, 20 if fast else 12)
    excited = next(one for one in modes if one.nodal_diameter == 9)
    solution = solve(model, excited.frequencies[0] * 2 * np.pi, 3, 128)
    assert solution.converged and solution.work.friction > 0
    motion = subject.damped_motion(bodies, patches, modes, subject.SolvedPoint(case, solution))
    assert motion.mismatch < 2e-3


@pytest.mark.parametrize(("error", "warns"), [(0.05, False), (0.5, True)])
def test_a_stress_that_the_mesh_does_not_carry_is_a_warning(error, warns):
    stress = SimpleNamespace(
        load=80.0, largest=2e7, place=np.zeros(3), mesh_error=error, mismatch=1e-6
    )
    said = stress_message(stress)
    assert "20 MPa" in said
    # in proportion where a march gives another amplitude than the balance
    assert "18 MPa" in stress_message(stress, 0.9)
    assert ("too large to rely on" in said) == warns
    # of another motion than the balance's
    stress.mismatch = 0.3
    said = stress_message(stress)
    assert "differs by 30 %" in said and said.level == "warning"

"""Coriolis forces of reduced bodies: against full matrices, CalculiX and their assembled form."""

import json
from dataclasses import replace
from pathlib import Path

import decks
import numpy as np
import pytest
import scipy.sparse as sp
from structured import sector

from bladefem.fem.body import assemble, body_properties
from bladefem.fem.compat import MPI, assemble_matrix, dolfinx, ufl
from bladefem.fem.constraint import constrain, in_step, transformation
from bladefem.fem.flexibility import flexible
from bladefem.fem.gyroscopic import Spin, coupling, waves
from bladefem.fem.linear_preload import linear_tangent, unit_speed_displacement
from bladefem.fem.modes import modes
from bladefem.fem.ports import PortReduction, port_model, port_models
from bladefem.hbm.linear.bodies import Damping, port_receptance
from bladefem.hbm.linear_resonances import wave_frequencies
from bladefem.scene.tables import Material
from bladefem.study.modes.linear_response import Forced, probe_response

GOLDEN = json.loads((Path(__file__).parent / "ccx_decks.json").read_text())
AXIS = (0.0, 0.0, 1.0)
SPEED = 900.0


def assembled(body):
    """G by its own form 2 rho v . (a x u)."""
    _, rho, _ = body_properties(body, (2, 6))
    u, v = ufl.TrialFunction(body.space), ufl.TestFunction(body.space)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    cross = dolfinx.fem.Constant(body.space.mesh, turn)
    form = 2 * rho * ufl.inner(v, cross * u) * ufl.dx(metadata={"quadrature_degree": 6})
    return assemble_matrix(form)


def in_mesh_numbering(body, A):
    """Sparse, rows and columns as the mesh counts its displacements."""
    indptr, indices, data = A.getValuesCSR()
    rows = body.scalar_rows
    return sp.csr_matrix((data, indices, indptr))[rows][:, rows]


@pytest.fixture(scope="module")
def ring():
    """A sector in nodal diameters 0, 2 and 3 (of 6): its full matrices and two ports."""
    mesh = sector(6, (2, 1, 1), bump=0.2)
    body = replace(assemble(mesh, "blade", Material(), MPI.COMM_SELF), hold="x0")
    ports = sp.lil_matrix((3 * len(mesh.points), 2))
    tip = np.unique(mesh.faces["x1"])
    ports[3 * tip[3] + 1, 0] = 1.0
    ports[3 * tip[5], 1] = 1.0
    return body, sp.csc_matrix(ports)


@pytest.mark.parametrize("n", [0, 2, 3])
def test_reduced_response_is_that_of_full_matrices(ring, n):
    """(K + j w C + j w Omega G - w^2 M) u = f, solved directly; all modes are kept."""
    body, P = ring
    con = constrain(body, "x0", n)
    T = con.T
    K, M, G = (
        (T.conj().T @ in_mesh_numbering(body, A) @ T).toarray()
        for A in (body.K, body.M, assembled(body))
    )
    spin = Spin(AXIS, SPEED)
    names = {"contact": slice(0, 1), "probe": slice(1, 2)}
    whole = port_model(con, PortReduction(P, names, len(K), spin=spin))
    mass, stiff = 3.0, 2e-7
    wanted = PortReduction(P, names, 30, spin=spin)
    few = dict(port_models(transformation(body, "x0", True), wanted, [n]))[n]
    F = (P.T @ T).toarray().conj().T
    both = np.arange(2)
    for w in whole.omega[0] * np.array([0.5, 0.999, 1.3]):
        damped = K - w**2 * M + 1j * w * (SPEED * G + mass * M + stiff * K)
        direct = F.conj().T @ np.linalg.solve(damped, F)
        law = Damping(mass=mass, stiffness=stiff)
        ours = port_receptance(whole, law, w, both, both)
        np.testing.assert_allclose(ours, direct, rtol=0, atol=1e-6 * abs(direct).max())
        without = port_receptance(replace(whole, damping=None), law, w, both, both)
        assert abs(without - direct).max() > 1e-4 * abs(direct).max()
        # thirty modes and the residual flexibility: Coriolis forces of the others are missing
        near = port_receptance(few, law, w, both, both)
        np.testing.assert_allclose(near, direct, rtol=0, atol=2e-3 * abs(direct).max())


def test_craig_bampton_has_the_same_coriolis_forces(ring):
    """With all its modes it is the body itself, like the free modes."""
    body, P = ring
    con = constrain(body, "x0", 2)
    names = {"contact": slice(0, 1), "probe": slice(1, 2)}
    spin = Spin(AXIS, SPEED)
    size = con.T.shape[1]
    free = port_model(con, PortReduction(P, names, size, spin=spin))
    fixed = port_model(con, PortReduction(P, names, 40, kind="craig-bampton", spin=spin))
    ours, theirs = (wave_frequencies(model.omega, model.damping)[:6] for model in (free, fixed))
    np.testing.assert_allclose(ours, theirs, rtol=1e-4)


def test_linear_response_in_a_rotating_frame():
    """Foucault's pendulum under a force along x: x = (w0^2 - W^2 - w^2) F / determinant, and the two
    resonances lie at w0 - W and w0 + W.
    """
    w0, speed, force = 300.0, 40.0, 2.0
    omega = np.full(2, np.sqrt(w0**2 - speed**2))
    shapes = np.zeros((2, 1, 3))
    shapes[[0, 1], 0, [0, 1]] = 1.0
    response = Forced(
        1,
        omega,
        shapes,
        np.array([force, 0.0]),
        np.zeros((1, 3)),
        Damping(),
        None,
        speed * np.array([[0.0, -2.0], [2.0, 0.0]]),
    )
    np.testing.assert_allclose(response.waves, [w0 - speed, w0 + speed], rtol=1e-12)
    for w in (100.0, 250.0, 355.0):
        own = omega[0] ** 2 - w**2
        exact = own * force / (own**2 - (2 * speed * w) ** 2)
        found = probe_response(response, np.array([1.0, 0.0, 0.0]), np.array([w / (2 * np.pi)]))
        np.testing.assert_allclose(found, exact, rtol=1e-10)


def test_standing_bodies_have_no_such_damping(ring):
    """No speed, or no rotation given."""
    body, P = ring
    con = constrain(body, "x0", 2)
    names = {"contact": slice(0, 2)}
    assert port_model(con, PortReduction(P, names, 4)).damping is None
    at_rest = PortReduction(P, names, 4, spin=Spin(AXIS, 0.0))
    assert port_model(con, at_rest).damping is None


def test_waves_of_a_turning_bar_are_those_of_calculix():
    """*COMPLEX FREQUENCY, CORIOLIS on the same mesh and quadrature; ccx prints seven digits, and
    its complex frequencies scatter by 3e-6.
    """
    mesh = decks.turning_bar()
    body = replace(assemble(mesh, "blade", Material(), MPI.COMM_SELF, quadrature="ccx"), hold="z0")
    moved = unit_speed_displacement(flexible(in_step(body)))
    speed = decks.TURNING_SPEED
    K = linear_tangent(body, speed**2 * moved, speed, quadrature="ccx")
    found = modes(constrain(replace(body, K=K)), decks.TURNING_MODES)
    np.testing.assert_allclose(found.frequencies, GOLDEN["turning"]["real"], rtol=1e-6)
    split = waves(found, coupling(body, found), speed)
    np.testing.assert_allclose(split.forward, GOLDEN["turning"]["complex"], rtol=5e-6)
    np.testing.assert_allclose(split.backward, GOLDEN["turning"]["complex"], rtol=5e-6)

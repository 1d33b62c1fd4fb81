"""The motion under harmonic loads against dense solves of the whole body, and what it takes."""

from dataclasses import replace

import numpy as np
import pytest
from structured import sector

from bladefem.errors import NotSolvedError
from bladefem.fem import forced_motion as subject
from bladefem.fem.body import assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain, restrict_load
from bladefem.fem.flexibility import flexible, unknown_places
from bladefem.fem.linalg import apply_block
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material

KEPT = 6


@pytest.fixture(scope="module", params=[0, 2])
def wheel(request):
    """A coarse sector in a nodal diameter (0 real, 2 complex), its modes, and loads in the order of
    the unknowns.
    """
    body = assemble(sector(8, (2, 2, 1)), "blade", Material(), MPI.COMM_SELF)
    flex = flexible(constrain(body, "clamp", request.param))
    found = modes(flex.con, KEPT + 2, flex, tolerance=1e-11)
    draw = np.random.default_rng(1).standard_normal
    loads = draw((body.mesh.points.size, 5)) + 1j * draw((body.mesh.points.size, 5))
    return flex, found, loads


def kept(found):
    """The lowest modes."""
    return replace(found, frequencies=found.frequencies[:KEPT], shapes=found.shapes[:KEPT])


def dense_motion(flex, found, loads, omega, viscous):
    """(n_points, dim, k) by dense matrices, the modes kept damped."""
    con = flex.con
    unit = np.eye(con.T.shape[1], dtype=con.dtype)
    K, M = apply_block(con.K, unit), apply_block(con.M, unit)
    image = M @ found.shapes[:KEPT].reshape(KEPT, -1)[:, unknown_places(con)].T
    columns = [
        con.T @ np.linalg.solve(K - w**2 * M + 1j * w * (image * viscous) @ image.conj().T, f)
        for w, f in zip(omega, restrict_load(con, loads).T, strict=True)
    ]
    return np.stack(columns, axis=1).reshape(*found.shapes.shape[1:], -1)


def test_motion_equals_a_dense_solve(wheel):
    """Static, beside a resonance, close below the first mode that is left out, with and against the
    rotation, and at a complex frequency.
    """
    flex, found, loads = wheel
    natural = 2 * np.pi * found.frequencies
    omega = np.array([0, 1.03 * natural[1], 0.8 * natural[KEPT], -0.6 * natural[KEPT], 1 + 0.02j])
    omega[4] *= 0.5 * natural[KEPT]
    viscous = 0.002 * natural[:KEPT]
    u = subject.forced_motion(flex, kept(found), loads, omega, viscous).displacement
    exact = dense_motion(flex, found, loads, omega, viscous)
    for k in range(len(omega)):
        assert abs(u[:, :, k] - exact[:, :, k]).max() < 3e-8 * abs(exact[:, :, k]).max()


def test_fewer_solves_than_the_series_of_inertia(wheel, monkeypatch):
    """At 0.8 of the first mode left out each term of the geometric series is 0.64 of the one
    before: 1e-9 takes more than 40 solves. Low harmonics end after a few of them.
    """
    flex, found, loads = wheel
    columns = []
    plain = subject.compliance
    monkeypatch.setattr(
        subject, "compliance", lambda f, B: columns.append(B.shape[1]) or plain(f, B)
    )
    highest = 2 * np.pi * found.frequencies[KEPT]
    omega = np.array([0.05, 0.1, 0.2, 0.4, 0.8]) * highest
    subject.forced_motion(flex, kept(found), loads, omega, np.zeros(KEPT))
    assert len(columns) <= 20
    assert sum(columns) <= 50


def test_a_mode_that_is_missing_below_the_frequency_is_told(wheel):
    flex, found, loads = wheel
    omega = np.full(5, 2 * np.pi * found.frequencies[KEPT] * 1.02)
    with pytest.raises(NotSolvedError, match="expected modes beyond the frequency"):
        subject.forced_motion(flex, kept(found), loads, omega, np.zeros(KEPT))


def test_no_load_no_motion(wheel):
    flex, found, loads = wheel
    u = subject.forced_motion(
        flex, kept(found), 0 * loads, np.linspace(0, 1, 5), np.zeros(KEPT)
    ).displacement
    assert not u.any()

"""Coriolis forces of the damper itself: against a free body of point masses between two blades, in
physical coordinates of a frame that turns.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from bladefem.data import Elements, RigidBody
from bladefem.errors import InputError
from bladefem.hbm.linear_resonances import stuck_partners, stuck_resonances
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.nonlinear_modes import nonlinear_mode
from bladefem.hbm.parameters import vary
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.reduction.matrices import port_model_from_matrices

TIGHT = Options(tolerance=1e-13)
SPEED = 0.35
# a x v, the axis along z
ACROSS = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
# radial, circumferential and axial stiffness of a blade
BLADE = np.array([[6.0, 0.5, 0.2], [0.5, 1.0, 0.3], [0.2, 0.3, 2.5]])
# point masses of the damper and where they are from its centre
MASSES = np.array([0.06, 0.05, 0.04, 0.05, 0.03])
PLACES = np.array(
    [[0.5, 0.3, -0.6], [-0.4, 0.5, 0.4], [0.3, -0.6, 0.5], [-0.5, -0.4, -0.5], [0.1, 0.6, 0.1]]
)
# contacts: which blade, where on the damper, along which directions
SEATS = ((0, [0.3, -0.5, 0.4]), (0, [0.2, -0.5, -0.5]), (1, [0.3, 0.5, 0.5]), (1, [0.1, 0.5, -0.4]))
SPRINGS = np.array([1.4, 0.9])


def moving(place):
    """(3, 6) displacement of a point by translations and rotations."""
    x, y, z = place
    return np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])


def of_points(matrix):
    """(6, 6) what each unit of mass does by a matrix (3, 3), summed over the damper."""
    return sum(m * moving(p).T @ matrix @ moving(p) for m, p in zip(MASSES, PLACES, strict=True))


def frame_of(blade):
    """(3, 3) normal out of the blade and two tangents of an inclined flank."""
    side = 1.0 if blade == 0 else -1.0
    normal = np.array([0.6, 0.8 * side, 0.0])
    return np.stack([normal, np.cross([0.0, 0.0, 1.0], normal), [0.0, 0.0, 1.0]])


def contacts(normal):
    """Rows at the contacts of the blades' motion (n, 6) and of the damper's (n, 6)."""
    ours, theirs = [], []
    for blade, place in SEATS:
        rows = frame_of(blade)[0 if normal else 1 :][: 3 if normal else 1]
        ours.append(np.kron(np.eye(2)[[blade]], rows))
        theirs.append(rows @ moving(place))
    return np.vstack(ours), np.vstack(theirs)


# excitation of both blades, the second one later
FORCE = np.kron([1.0, np.exp(0.9j)], [0.0, 1.0, 0.2])


def bodies(speed=SPEED, loss=0.01):
    """Matrices (12, 12) of both blades, then of the damper."""
    turning = 2 * speed * ACROSS
    K = linalg.block_diag(BLADE, 1.1 * BLADE, np.zeros((6, 6)))
    M = linalg.block_diag(np.eye(6), of_points(np.eye(3)))
    C = linalg.block_diag(turning, turning, of_points(turning))
    C[:6, :6] += loss * np.eye(6)
    return K, M, C


def turning_model(normal=True, speed=SPEED, n0=0.5, force=1.0, elastic=False, loss=0.01):
    """The model of the balance, its damper rigid or with a further, elastic motion."""
    K, M, C = bodies(speed, loss)
    ours, theirs = contacts(normal)
    ports = {"contact": ours, "load": np.stack([FORCE.real, FORCE.imag]), "probe": np.eye(6)[[1]]}
    blades = port_model_from_matrices(M[:6, :6], K[:6, :6], ports, C=C[:6, :6])
    n = len(SEATS)
    kn = SPRINGS[1] if normal else 0.0
    elements = Elements(
        np.full(n, SPRINGS[0]), np.full(n, kn), np.full(n, 0.4), np.full(n, n0), 2 if normal else 1
    )
    damper = RigidBody(M[6:, 6:], theirs, gyroscopic=C[6:, 6:])
    if elastic:
        damper = (port_model_from_matrices(M[6:, 6:], K[6:, 6:], {"contact": theirs}, C=C[6:, 6:]),)
    # Re and Im of FORCE are ports of their own
    load = force * np.array([1.0, 1.0j])
    return ReducedModel((blades,), elements, {1: load}, Damping(), damper, Damping())


def stuck_matrices(normal=True, **others):
    """K, M, C (12, 12) of the whole, contacts closed."""
    K, M, C = bodies(**others)
    ours, theirs = contacts(normal)
    relative = np.hstack([ours, -theirs])
    k = np.tile([SPRINGS[1], SPRINGS[0], SPRINGS[0]] if normal else SPRINGS[:1], len(SEATS))
    return K + relative.T @ (k[:, None] * relative), M, C


def natural_frequencies(K, M, C):
    """(m,) [rad/s] of undamped motions, from the first-order form."""
    m = len(K)
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    values = np.linalg.eigvals(A)
    return np.sort(values.imag[values.imag > 1e-6])


@pytest.mark.parametrize("elastic", [False, True])
def test_waves_in_full_stick(elastic):
    exact = natural_frequencies(*stuck_matrices(loss=0.0))
    found = stuck_resonances(turning_model(elastic=elastic, loss=0.0))
    np.testing.assert_allclose(found, exact, rtol=1e-8)
    # the damper's part is felt
    K, M, C = stuck_matrices(loss=0.0)
    C[6:, 6:] = 0.0
    assert abs(natural_frequencies(K, M, C) / exact - 1).max() > 0.02
    assert np.isin(stuck_partners(turning_model(elastic=elastic, loss=0.0)), found).all()


@pytest.mark.parametrize("elastic", [False, True])
def test_response_in_full_stick(elastic):
    K, M, C = stuck_matrices()
    model = turning_model(elastic=elastic, n0=1e6)
    # a free damper circles with twice the speed: there its contacts alone hold it
    for omega in (2 * SPEED, 2 * SPEED * (1 + 1e-13), 2 * SPEED * (1 + 1e-6), 1.1, 1.9):
        exact = np.linalg.solve(K - omega**2 * M + 1j * omega * C, np.r_[FORCE, np.zeros(6)])
        found = solve(model, omega, 1, 64, options=TIGHT)
        assert found.converged
        accurate = 1e-4 if abs(omega / (2 * SPEED) - 1) < 1e-5 else 1e-8
        assert found.probe[1, 0] == pytest.approx(exact[1], rel=accurate)


def test_a_damper_that_no_contact_keeps_from_circling():
    """Contacts that feel it turn alone: at twice the speed the blades do not notice."""
    _, M, C = bodies()
    theirs = contacts(False)[1].copy()
    theirs[:, [0, 1, 2, 5]] = 0.0
    model = turning_model(normal=False)
    free = replace(model, damper=RigidBody(M[6:, 6:], theirs, gyroscopic=C[6:, 6:]))
    found, beside = (solve(free, 2 * SPEED * (1 + share), 1, 64) for share in (0, 1e-4))
    assert found.converged
    np.testing.assert_allclose(found.probe, beside.probe, atol=1e-3 * abs(beside.probe).max())


OMEGA = 1.12
STEPS = 400


def waveform(point):
    """(STEPS,) the probe over a period, without its mean."""
    t = np.linspace(0.0, 2 * np.pi, STEPS, endpoint=False)
    orders = np.arange(1, len(point.probe))
    return (np.exp(1j * np.outer(t, orders)) @ point.probe[1:, 0]).real


def slipping_march(n0, omega, periods=50, steps=STEPS):
    """(steps,) the probe over the last period, from central differences with Jenkins elements."""
    K, M, C = bodies(loss=0.06)
    ours, theirs = contacts(False)
    W = np.hstack([ours, -theirs])
    h = 2 * np.pi / omega / steps
    ahead = np.linalg.inv(M / h**2 + C / (2 * h))
    back = M / h**2 - C / (2 * h)
    middle = 2 * M / h**2 - K
    push = np.exp(1j * omega * h * np.arange(steps))[:, None] * FORCE
    load = np.hstack([push.real, np.zeros((steps, 6))])
    limit = 0.4 * n0
    q = before = np.zeros(12)
    anchor = np.zeros(len(SEATS))
    seen = np.zeros(steps)
    for step in range(periods * steps):
        w = W @ q
        friction = np.clip(SPRINGS[0] * (w - anchor), -limit, limit)
        anchor = w - friction / SPRINGS[0]
        seen[step % steps] = q[1]
        after = ahead @ (load[step % steps] + middle @ q - back @ before - W.T @ friction)
        before, q = q, after
    return seen


def test_slipping_response_is_that_of_a_march():
    """Tangential contacts that slip, every step of the march next to the balance; without the
    damper's Coriolis forces the amplitude is 11 % higher or lower.
    """
    model = turning_model(normal=False, n0=0.5, loss=0.06)
    found = solve(model, OMEGA, 15, 256)
    assert found.converged and found.work.friction > 0.3 * found.work.input
    marched = slipping_march(0.5, OMEGA)
    height = np.ptp(marched) / 2
    np.testing.assert_allclose(waveform(found), marched - marched.mean(), atol=5e-3 * height)
    still = replace(model, damper=replace(model.damper, gyroscopic=None))
    assert abs(np.ptp(waveform(solve(still, OMEGA, 15, 256))) / 2 / height - 1) > 0.1


def test_slipping_response_at_twice_the_speed_is_that_of_a_march():
    """The first harmonic meets the circling of a free damper; at the frequency of the speed the
    second one does.
    """
    model = turning_model(normal=False, n0=0.15, loss=0.06)
    found = solve(model, 2 * SPEED, 15, 256)
    assert found.converged and found.work.friction > 0.05 * found.work.input
    marched = slipping_march(0.15, 2 * SPEED)
    height = np.ptp(marched) / 2
    np.testing.assert_allclose(waveform(found), marched - marched.mean(), atol=5e-3 * height)
    at, near, beside = (solve(model, SPEED * (1 + share), 3, 256) for share in (0, 1e-8, 1e-4))
    assert at.converged and near.converged
    for one in (at, near):
        np.testing.assert_allclose(one.probe, beside.probe, atol=1e-3 * abs(beside.probe).max())


@pytest.mark.parametrize("elastic", [False, True])
def test_derivatives_are_those_of_differences(elastic):
    """The mass takes its Coriolis forces along; damping has none of them."""
    model = turning_model(elastic=elastic, force=0.7)
    omega, step = 1.12, 1e-5
    point = solve(model, omega, 3, 256, options=TIGHT)
    assert point.converged and point.work.friction > 0.05 * point.work.input
    for name in ("omega", "mass", "damping"):
        ends = []
        for sign in (1, -1):
            changed = model if name == "omega" else vary(model, name, np.exp(sign * step))
            moved = omega + sign * step * (name == "omega")
            ends.append(solve(changed, moved, 3, 256, start=point, options=TIGHT).probe)
        found = sensitivities(model, point, [name])[name].probe
        exact = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(found, exact, atol=1e-6 * abs(exact).max(), err_msg=name)


@pytest.mark.parametrize("elastic", [False, True])
def test_nonlinear_mode_of_small_motions(elastic):
    """It begins at the wave in full stick."""
    model = turning_model(elastic=elastic, loss=0.0)
    (point,) = nonlinear_mode(model, np.array([1e-6]), 0, H=1, samples=64)
    assert point.converged
    exact = natural_frequencies(*stuck_matrices(loss=0.0))
    assert abs(exact / point.omega - 1).min() < 1e-8


def test_a_matrix_that_is_not_skew_is_refused():
    model = turning_model()
    with pytest.raises(InputError, match=r"gyroscopic of shape \(6, 6\): expected a skew"):
        replace(model, damper=replace(model.damper, gyroscopic=np.eye(6)))
    with pytest.raises(InputError, match=r"gyroscopic of shape \(2, 2\): expected a skew"):
        replace(model, damper=replace(model.damper, gyroscopic=np.zeros((2, 2))))

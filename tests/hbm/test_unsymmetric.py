"""Unsymmetric stiffness, gyroscopic damping: against the full matrices, in frequency and in time."""

from dataclasses import replace

import numpy as np
import pytest

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.nonlinear_modes import nonlinear_mode
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.hbm.stability import STABLE, UNIQUE, UNSTABLE, stability_verdict
from bladefem.reduction.matrices import port_model_from_matrices

SIZE = 5
# size of the forces without energy
SKEW = 0.15
TIGHT = Options(tolerance=1e-12)
# readings: normal and tangent of two contacts
READINGS = np.array(
    [
        [0.8, -0.3, 0.1, 0.0, 0.4],
        [0.2, 0.7, -0.5, 0.3, 0.0],
        [0.0, 0.4, 0.9, -0.2, 0.1],
        [-0.3, 0.1, 0.2, 0.8, 0.5],
    ]
)


def matrices(skew=SKEW):
    """M, K, C: a chain with whirl, and forces across it that have no energy."""
    rng = np.random.default_rng(8)
    K = 2.0 * np.eye(SIZE) - np.eye(SIZE, k=1) - np.eye(SIZE, k=-1)
    turn = rng.normal(size=(2, SIZE, SIZE))
    turn = turn - turn.swapaxes(1, 2)
    M = np.diag(rng.uniform(0.5, 2.0, SIZE))
    return M, K + skew * turn[0], 0.1 * K + 0.15 * np.eye(SIZE) + 0.1 * turn[1]


def rotor(skew=SKEW, kn=1.0, n0=0.3):
    M, K, C = matrices(skew)
    ports = {"contact": READINGS, "load": np.eye(SIZE)[:1], "probe": np.eye(SIZE)[-1:]}
    side = port_model_from_matrices(M, K, ports, C=C, unsymmetric=True)
    one = np.ones(2)
    elements = Elements(0.7 * one, kn * one, 0.4 * one, n0 * one, tangents=1)
    return ReducedModel((side,), elements, {1: np.array([1.0])})


def marched(model, skew, omega, periods, steps=2000):
    """(19,) complex amplitudes at the probe over the last period, and the change of the motion from
    the one before, by leapfrog with the velocity-dependent forces solved at each step.
    """
    M, K, C = matrices(skew)
    e = model.elements
    normal, tangent = READINGS[::2], READINGS[1::2]
    dt = 2 * np.pi / omega / steps
    inverse = np.linalg.inv(M + dt / 2 * C)
    q = np.zeros(SIZE)
    v = np.zeros(SIZE)
    slider = np.zeros(2)
    history = np.empty((2, steps))
    for k in range(periods * steps):
        history[k // steps % 2, k % steps] = q[-1]
        load = np.maximum(e.n0 + e.kn * (normal @ q), 0.0)
        friction = np.clip(e.kt * (tangent @ q - slider), -e.mu * load, e.mu * load)
        slider = tangent @ q - friction / e.kt
        push = -(K @ q) - normal.T @ (load - e.n0) - tangent.T @ friction
        push[0] += np.cos(omega * k * dt)
        v = inverse @ ((M - dt / 2 * C) @ v + dt * push)
        q = q + dt * v
    last = history[(periods - 1) % 2]
    change = abs(history[0] - history[1]).max() / abs(last).max()
    return 2 / steps * np.fft.rfft(last)[1:20], change


@pytest.mark.parametrize("omega", [0.4, 1.1, 1.9])
def test_full_stick_is_the_response_of_the_full_matrices(omega):
    model = rotor(n0=1e6)
    point = solve(model, omega, 3, 64, options=TIGHT)
    M, K, C = matrices()
    springs = np.array([1.0, 0.7, 1.0, 0.7])
    stiff = K + READINGS.T @ (springs[:, None] * READINGS)
    q = np.linalg.solve(stiff - omega**2 * M + 1j * omega * C, np.eye(SIZE)[0])
    assert point.probe[1, 0] == pytest.approx(q[-1], rel=1e-8)
    symmetric = solve(rotor(skew=0.0, n0=1e6), omega, 3, 64, options=TIGHT)
    assert abs(symmetric.probe[1, 0] / point.probe[1, 0] - 1) > 0.02


@pytest.mark.parametrize(("omega", "n0", "state"), [(0.7, 0.3, "slip"), (1.2, 0.1, "lift")])
def test_slip_and_lift_off_agree_with_a_march_in_time(omega, n0, state):
    """The mean, which lift-off raises, sees the unsymmetric stiffness too."""
    model = rotor(n0=n0)
    point = solve(model, omega, 15, 2048, options=TIGHT)
    assert point.converged and point.states[state] == 2
    lines, change = marched(model, SKEW, omega, 30)
    assert change < 1e-4
    height = np.linalg.norm(lines)
    assert np.linalg.norm(point.probe[1:, 0] - lines[:15]) < 1e-4 * height
    assert abs(point.work.imbalance) < 1e-3
    assert stability_verdict(model, point).verdict == STABLE


def test_contacts_that_share_a_basis_are_those_of_few():
    """Each of the two contacts as many small ones side by side."""
    model = rotor(n0=0.1)
    few = solve(model, 1.2, 5, 256, options=TIGHT)
    assert few.converged and few.states["lift"] == 2
    parts = 20
    e = model.elements
    small = {name: np.tile(getattr(e, name), parts) / parts for name in ("kt", "kn", "n0")}
    M, K, C = matrices()
    ports = {
        "contact": np.tile(READINGS, (parts, 1)),
        "load": np.eye(SIZE)[:1],
        "probe": np.eye(SIZE)[-1:],
    }
    side = port_model_from_matrices(M, K, ports, C=C, unsymmetric=True)
    elements = replace(e, mu=np.tile(e.mu, parts), **small)
    many = solve(replace(model, sides=(side,), elements=elements), 1.2, 5, 256, options=TIGHT)
    assert many.converged
    np.testing.assert_allclose(many.probe, few.probe, atol=1e-9 * abs(few.probe).max())


def test_work_of_the_unsymmetric_stiffness_closes_the_balance():
    """It is lost or gained in the bodies."""
    point = solve(rotor(n0=0.2), 0.9, 15, 2048, options=TIGHT)
    assert point.converged and abs(point.work.imbalance) < 1e-3
    still = solve(rotor(n0=0.2, skew=0.0), 0.9, 15, 2048, options=TIGHT)
    assert abs(point.work.damping / still.work.damping - 1) > 0.02


def test_derivatives_with_the_frequency():
    model = rotor()
    ends = [solve(model, 0.9 + step, 5, 512, options=TIGHT) for step in (-1e-5, 1e-5)]
    point = solve(model, 0.9, 5, 512, options=TIGHT)
    slope = sensitivities(model, point, ["omega"])["omega"].size[0]
    assert slope == pytest.approx((size(ends[1]) - size(ends[0])) / 2e-5, rel=1e-4)


def test_forces_without_energy_drive_a_motion_that_damping_does_not_hold():
    """Prescribed normal loads no more mean that there is one motion: it is judged, and flutters
    where a march leaves it.
    """
    for skew, verdict in ((SKEW, STABLE), (0.8, UNSTABLE)):
        model = rotor(skew=skew, kn=0.0, n0=0.05)
        model = replace(model, elements=replace(model.elements, kn=np.zeros(2)))
        point = solve(model, 0.9, 5, 512)
        assert point.converged
        found = stability_verdict(model, point)
        assert found.verdict == verdict
        M, K, C = matrices(skew)
        state = np.block(
            [
                [np.zeros((SIZE, SIZE)), np.eye(SIZE)],
                [-np.linalg.solve(M, K), -np.linalg.solve(M, C)],
            ]
        )
        assert (np.linalg.eigvals(state).real.max() > 0) == (verdict == UNSTABLE)
    symmetric = rotor(skew=0.0, kn=0.0)
    assert stability_verdict(symmetric, solve(symmetric, 0.9, 5, 512)).verdict == UNIQUE


def test_nonlinear_modes_refuse_it():
    model = rotor()
    undamped = replace(model, sides=(replace(model.side(1), damping=None),))
    with pytest.raises(InputError, match="unsymmetric"):
        next(iter(nonlinear_mode(undamped, [1.0])))

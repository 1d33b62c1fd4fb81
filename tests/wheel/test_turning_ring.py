"""Coriolis forces of blades and dampers in motions that slip and lift off: the balance of one
sector, its verdict and its march against a march of all sectors by central differences.
"""

from dataclasses import replace

import numpy as np
import pytest
from rings import (
    EO,
    FACES,
    LINK,
    LOAD,
    MASS,
    OWN,
    PROBE,
    TURNING,
    N,
    elements,
    forces,
    ring_wheel,
)

from bladefem.friction.fourier import to_complex
from bladefem.hbm.model import Damping
from bladefem.hbm.ring_march import march_ring, state_of_solution
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import STABLE, UNSTABLE, stability_verdict
from bladefem.wheel.tuned import tuned_sector

H, STEPS = 15, 400
LOSS, FORCE, OMEGA = 0.06, 0.9, 2.3
BLADE_SKEW = np.array([[0.0, -0.5, 0.1], [0.5, 0.0, 0.3], [-0.1, -0.3, 0.0]])


def ring_matrices(loss):
    """M, C, K (5 N, 5 N) of all sectors, then of all dampers, and relative motions at the contacts
    (2, 2 N, 5 N): normal, tangential.
    """
    following = np.roll(np.eye(N), 1, axis=1)
    K = np.zeros((5 * N, 5 * N))
    K[: 3 * N, : 3 * N] = (
        np.kron(np.eye(N), OWN) + np.kron(following, LINK) + np.kron(following.T, LINK.T)
    )
    M, C = np.zeros_like(K), np.zeros_like(K)
    M[: 3 * N, : 3 * N] = np.kron(np.eye(N), MASS)
    M[3 * N :, 3 * N :] = np.kron(np.eye(N), TURNING.mass)
    C[: 3 * N, : 3 * N] = np.kron(np.eye(N), BLADE_SKEW + loss * MASS)
    C[3 * N :, 3 * N :] = np.kron(np.eye(N), TURNING.gyroscopic)
    rows = []
    for b in range(N):
        here = np.kron(np.eye(N)[[b]], FACES[:2])
        there = np.kron(following[[b]], FACES[2:])
        ours = np.vstack([here, there])
        rows.append(np.hstack([ours, -np.kron(np.eye(N)[[b]], TURNING.B)]))
    rows = np.vstack(rows)
    return M, C, K, np.stack([rows[::2], rows[1::2]])


def state_of(point, own, force, omega):
    """Displacements and velocities (5 N,) of all sectors and anchors (2 N,) of the friction elements
    at the beginning of a period of the balance's motion.
    """
    M, C, K, rows = ring_matrices(LOSS)
    contact, w = to_complex(point.f), to_complex(point.w)
    contact[:, 0, 0] -= own.n0
    q, v = np.zeros(5 * N), np.zeros(5 * N)
    for h in range(H + 1):
        turn = np.exp(2j * np.pi * h * EO * np.arange(N) / N)
        forces_h, w_h = (np.kron(turn, x[:, :, h].T).reshape(2, -1) for x in (contact, w))
        push = -np.einsum("dnk,dn->k", rows, forces_h)
        if h == 1:
            push[: 3 * N] += np.kron(force * turn, LOAD[0])
        if h:
            x = np.linalg.solve(K + 1j * h * omega * C - (h * omega) ** 2 * M, push)
        else:
            # nothing but the contacts tells where the dampers are
            both = np.vstack([K, *rows])
            x = np.linalg.lstsq(both, np.concatenate([push, *w_h]), rcond=None)[0]
        q += x.real
        v += (1j * h * omega * x).real
    phases = np.exp(2j * np.pi * EO * np.outer(np.arange(H + 1), np.arange(N)) / N)
    friction = (contact[:, 1] @ phases).real.T.ravel()
    return q, v, rows[1] @ q - friction / np.tile(own.kt, N)


def marched(own, force, omega, periods, start=None):
    """(STEPS, N) probes of all blades in the last period, from rest or from `state_of` a balance."""
    M, C, K, (normal, tangent) = ring_matrices(LOSS)
    h = 2 * np.pi / omega / STEPS
    ahead = np.linalg.inv(M / h**2 + C / (2 * h))
    back = M / h**2 - C / (2 * h)
    middle = 2 * M / h**2 - K
    t = h * np.arange(STEPS)[:, None]
    push = force * np.cos(omega * t + 2 * np.pi * EO * np.arange(N) / N)
    load = np.pad(np.kron(push, LOAD), ((0, 0), (0, 2 * N)))
    kt, kn, mu, n0 = (np.tile(x, N) for x in (own.kt, own.kn, own.mu, own.n0))
    q, v, anchor = (np.zeros(5 * N), np.zeros(5 * N), np.zeros(2 * N)) if start is None else start
    before = None
    seen = np.zeros((STEPS, N))
    for step in range(periods * STEPS):
        pressed = np.maximum(n0 + kn * (normal @ q), 0.0)
        w = tangent @ q
        friction = np.clip(kt * (w - anchor), -mu * pressed, mu * pressed)
        anchor = w - friction / kt
        seen[step % STEPS] = (q[: 3 * N].reshape(N, 3) @ PROBE.T)[:, 0]
        forces_now = load[step % STEPS] - normal.T @ (pressed - n0) - tangent.T @ friction
        if before is None:
            before = q - h * v + h**2 / 2 * np.linalg.solve(M, forces_now - K @ q - C @ v)
        after = ahead @ (forces_now + middle @ q - back @ before)
        before, q = q, after
    return seen


def waveform(coefficients, count=STEPS):
    """(count,) one period of complex harmonics (H+1,), without the mean."""
    t = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    orders = np.arange(1, len(coefficients))
    return (np.exp(1j * np.outer(t, orders)) @ coefficients[1:]).real


def balance_of(n0, mu, damper=TURNING):
    """The elements and the sector's model, and its balance at OMEGA."""
    own = elements(2, 2.0, n0, mu)
    wheel = ring_wheel(own, damper, forces({1: FORCE}), Damping(), BLADE_SKEW + LOSS * MASS)
    model = tuned_sector(wheel, H)
    point = solve(model, OMEGA, H, 512)
    assert point.converged
    return own, model, point


def test_wave_that_slips_is_the_marched_one():
    """From rest, all contacts slip; without the dampers' Coriolis forces it is 9 % higher."""
    own, model, point = balance_of(1.0, 0.3)
    assert point.states["slip"] == 2 and point.work.friction > 0.5 * point.work.input
    assert stability_verdict(model, point).verdict == STABLE
    exact = marched(own, FORCE, OMEGA, 120)
    height = np.ptp(exact[:, 0]) / 2
    # each blade does what the one before does, later
    np.testing.assert_allclose(np.ptp(exact, axis=0) / 2, height, rtol=1e-3)
    ours = waveform(point.probe[:, 0])
    np.testing.assert_allclose(ours, exact[:, 0] - exact[:, 0].mean(), atol=1e-3 * height)
    own_march = march_ring(model, state_of_solution(model, point), 10, 512)
    assert np.ptp(own_march.motion[-1][0]) / 2 == pytest.approx(height, rel=1e-3)
    _, _, still = balance_of(1.0, 0.3, replace(TURNING, gyroscopic=None))
    assert np.ptp(waveform(still.probe[:, 0])) / 2 > 1.08 * height


@pytest.mark.parametrize(("n0", "mu", "verdict"), [(0.6, 0.1, STABLE), (1.0, 0.15, UNSTABLE)])
def test_verdict_on_a_wave_that_lifts_off_is_that_of_the_march(n0, mu, verdict):
    """Begun on the balance's motion it stays there, or leaves it."""
    own, model, point = balance_of(n0, mu)
    assert point.states["lift"] > 0
    found = stability_verdict(model, point)
    assert found.verdict == verdict
    start = state_of(point, own, FORCE, OMEGA)
    seen = marched(own, FORCE, OMEGA, 30, start)[:, 0]
    ours = waveform(point.probe[:, 0])
    off = abs(seen - seen.mean() - ours).max() / (np.ptp(ours) / 2)
    assert off < 1e-3 if verdict == STABLE else off > 0.1

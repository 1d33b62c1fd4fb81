"""Twelve lumped blades, mistuned, with a friction element between neighbours: the balance against
plain marching in time, which knows neither nodal diameters nor harmonics.
"""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from scipy import linalg

from bladefem.wheel.lumped import (
    PLATFORM,
    TIP,
    LumpedBlades,
    lumped_matrices,
    lumped_pattern,
    lumped_wheel,
)
from bladefem.wheel.model import engine_order
from bladefem.wheel.solve import solve_wheel

COUNT = 12
ORDER = 3
BLADES = LumpedBlades(count=COUNT, damping=0.02)
KT = 2e5
STEPS = 800
PERIODS = 75


def ring_matrices(deviation):
    """M (diagonal), C, K of all blades; damping belongs to the tuned modes."""
    M, K, to_next = lumped_matrices(BLADES)
    following = np.roll(np.eye(COUNT), 1, axis=1)
    tuned = np.kron(np.eye(COUNT), K) + np.kron(following, to_next)
    tuned += np.kron(following.T, to_next.T)
    mass = np.kron(np.eye(COUNT), M)
    values, modes = linalg.eigh(tuned, mass)
    C = mass @ modes @ np.diag(2 * BLADES.damping * np.sqrt(values)) @ modes.T @ mass
    stiffness = tuned.copy()
    for b, share in enumerate(deviation):
        i = 3 * b + np.arange(3)
        for a, e, k in ((i[1], i[2], BLADES.aerofoil), (i[0], i[1], BLADES.shank)):
            stiffness[[a, e], [a, e]] += share * k
            stiffness[[a, e], [e, a]] -= share * k
    return np.diag(mass), C, stiffness


def march(omega, deviation, orders, limit, wanted, periods=PERIODS, steps=STEPS):
    """Harmonics of all tips (N, wanted), and friction work of each element in the last period.

    Args:
        orders: harmonic of omega to the engine order, its force and its phase on blade 0.
        wanted: harmonics of omega.
        steps: in a period of omega.
    """
    mass, C, K = ring_matrices(deviation)
    dt = 2 * np.pi / omega / steps
    platform = 3 * np.arange(COUNT) + PLATFORM
    tip = 3 * np.arange(COUNT) + TIP
    around = 2 * np.pi * np.arange(COUNT) / COUNT
    # (M / dt^2 + C / 2 dt) x_new = F - K x + 2 M x / dt^2 - (M / dt^2 - C / 2 dt) x_old
    left = linalg.inv(np.diag(mass) / dt**2 + C / (2 * dt))
    now_matrix = left @ (2 * np.diag(mass) / dt**2 - K)
    old_matrix = -left @ (np.diag(mass) / dt**2 - C / (2 * dt))
    step_matrix = np.hstack([now_matrix, old_matrix, left])
    ends = np.array([platform, np.roll(platform, -1)])
    angle = omega * dt * np.arange(steps * periods)[:, None]
    drive = np.zeros((len(angle), COUNT))
    for h, (order, force, phase) in orders.items():
        drive += force * np.cos(h * angle + order * around + phase)
    tips, slid = march_in_loops(step_matrix, ends, tip, drive, limit / KT, steps)
    turns = np.exp(-1j * angle[-steps:] * np.array(wanted))
    return 2 / steps * tips.T @ turns, limit * slid


@njit(cache=True)
def take_step(step_matrix, state):
    """Displacements now and before (2m,) become those of the next step and those of now.

    Args:
        step_matrix: (m, 3m) the next displacements from a state.
        state: (3m,) displacements now and before, and loads; changed.
    """
    m = len(step_matrix)
    moved = np.zeros(m)
    for i in range(m):
        for k in range(3 * m):
            moved[i] += step_matrix[i, k] * state[k]
    for i in range(m):
        state[m + i] = state[i]
        state[i] = moved[i]


@njit(cache=True)
def march_in_loops(step_matrix, ends, tip, drive, reach, steps):
    """Tips (steps, N) and how far each slider goes (N,) in the last period.

    Args:
        step_matrix: (m, 3m) the next displacements from the present ones, those before and loads.
        ends: (2, N) coordinates between which each element is.
        drive: (periods * steps, N) forces on the tips.
    """
    count, m = len(tip), len(step_matrix)
    # displacements now and before, and loads
    state = np.zeros(3 * m)
    slider = np.zeros(count)
    slid = np.zeros(count)
    tips = np.zeros((steps, count))
    for step in range(len(drive)):
        for i in range(m):
            state[2 * m + i] = 0.0
        for s in range(count):
            state[2 * m + tip[s]] = drive[step, s]
            # the last period remains
            tips[step % steps, s] = state[tip[s]]
        for s in range(count):
            w = state[ends[0, s]] - state[ends[1, s]]
            before = slider[s]
            slider[s] = min(max(before, w - reach), w + reach)
            if step >= len(drive) - steps:
                slid[s] += abs(slider[s] - before)
            f = KT * (w - slider[s])
            state[2 * m + ends[0, s]] -= f
            state[2 * m + ends[1, s]] += f
        take_step(step_matrix, state)
    return tips, slid


@pytest.mark.parametrize("limit", [3.0])
def test_wheel_equals_marching_in_time(limit):
    force = 10.0
    rng = np.random.default_rng(1)
    deviation = 0.02 * rng.normal(size=COUNT)
    M, K, _ = lumped_matrices(BLADES)
    omega = 1.01 * np.sqrt(linalg.eigh(K, M)[0][0])
    tips, work = march(omega, deviation, {1: (ORDER, force, 0.0)}, limit, [1])
    tips = tips[:, 0]
    wheel = lumped_wheel(BLADES, ORDER, force, KT, limit)
    found = solve_wheel(wheel, omega, 15, 0, pattern=lumped_pattern(BLADES, deviation))
    assert found.converged
    # every damper slips, and blades differ by a fifth at least
    assert (found.shares[..., 1] > 0.05).all()
    assert np.ptp(abs(tips)) > 0.2 * abs(tips).mean()
    np.testing.assert_allclose(found.probe[:, 1, 0], tips, atol=5e-4 * abs(tips).max())
    np.testing.assert_allclose(found.dissipated, work, rtol=5e-3)


def test_orders_that_are_no_multiples_equal_marching_in_time():
    """Orders 2 and 3: harmonics 2 and 3 of a period of one revolution, the second ahead by 40
    deg.
    """
    limit = 3.0
    first, second, phase = 10.0, 300.0, np.radians(40)
    deviation = 0.02 * np.random.default_rng(1).normal(size=COUNT)
    M, K, _ = lumped_matrices(BLADES)
    omega = 1.01 * np.sqrt(linalg.eigh(K, M)[0][0]) / ORDER
    orders = {3: (3, first, 0.0), 2: (2, second, phase)}
    tips, work = march(omega, deviation, orders, limit, [1, 2, 3], 25, 3 * STEPS)
    excitation = {
        3: engine_order(COUNT, 3, np.array([first])),
        2: engine_order(COUNT, 2, np.array([second]), phase),
    }
    wheel = replace(lumped_wheel(BLADES, ORDER, first, KT, limit), excitation=excitation)
    found = solve_wheel(wheel, omega, 30, 0, pattern=lumped_pattern(BLADES, deviation))
    assert found.converged
    assert (found.shares[..., 1] > 0.05).all()
    largest = abs(tips).max()
    assert abs(tips[:, 1]).max() > 0.1 * largest
    # the second order makes the dampers slip for the first one too
    alone, _ = march(omega, deviation, {3: orders[3]}, limit, [3], 25, 3 * STEPS)
    assert abs(alone[:, 0] - tips[:, 2]).max() > 0.02 * largest
    np.testing.assert_allclose(found.probe[:, 1:4, 0], tips, atol=5e-4 * largest)
    np.testing.assert_allclose(found.dissipated, work, rtol=5e-3)

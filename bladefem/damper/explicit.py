"""Explicit time integration: leapfrog with the return map, the paper's way to the motion of the
damper (Sect. 5.1).

Cheap, second order, and treacherous in two ways. Beyond dt = 2 / omega_max the friction saturates
and the run stays finite and wrong: such a step is refused. And a damper that sticks has no damping,
so from rest it never settles: the cycle then comes back with its residual of periodicity and the
reason "not periodic".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from bladefem.errors import InputError

from ..friction.time_step import stable_step, step_1d
from ..time.event_integrator import State, state_at_rest
from ..time.system import System

# relative change over a period, below which a march has become periodic
SETTLED_CHANGE = 1e-6

March = Callable[[State], tuple[State, np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Cycle:
    """The last period of a march in time."""

    # (s, d) at equal instants from the end of the period on [m kg^1/2]
    q: np.ndarray
    # (s, n) friction force on the damper side [N]
    force: np.ndarray
    # (s, n) relative displacement [m]
    w: np.ndarray
    # at the end
    state: State
    # change of motion and force over the last period, relative [1]
    residual: float
    # marched
    periods: int
    # "periodic", or why the march stopped
    reason: str


def stable_steps(system: System, omega: float) -> int:
    """Fewest explicit steps a period: dt < 2 / omega_max, all elements stuck."""
    return int(np.floor(2 * np.pi / omega / stable_step(system.fastest))) + 1


def check_steps(
    system: System,
    omega: float,
    steps: int,
) -> None:
    """Raise InputError when there are fewer steps a period than ``stable_steps``."""
    least = stable_steps(system, omega)
    if steps < least:
        raise InputError(
            f"steps = {steps} a period: expected at least {least}, the stability limit of explicit "
            "integration (omega_max dt < 2)"
        )


def damper_cycle(
    system: System,
    omega: float,
    steps: int,
    start: State | None = None,
    most: int = 300,
) -> Cycle:
    """March explicitly until motion and friction forces repeat over one period.

    Args:
        steps: time steps a period.
        start: from rest when left out.
        most: largest number of periods.

    Raises:
        InputError: the step is beyond the stability limit.
    """
    check_steps(system, omega, steps)
    return march_to_periodic(
        explicit_march(system, omega, steps), start or state_at_rest(system), most, SETTLED_CHANGE
    )


def march_to_periodic(
    march: March,
    start: State,
    most: int,
    tolerance: float,
) -> Cycle:
    """March period by period, from state to (state, q, w, force), until motion and force repeat."""
    state = start
    last = None
    residual = np.inf
    period = 0
    while residual >= tolerance and period < most:
        period += 1
        state, q, w, force = march(state)
        swings = q - q.mean(axis=0), force - force.mean(axis=0)
        if last is not None:
            residual = max(map(_relative_change, swings, last))
        last = swings
        if not np.isfinite(q[-1]).all():
            return Cycle(q, force, w, state, np.inf, period, "the motion grew beyond all bounds")
    reason = (
        "periodic"
        if residual < tolerance
        else f"not periodic after {most} periods, change {residual:.1e}"
    )
    return Cycle(q, force, w, state, residual, period, reason)


def explicit_march(
    system: System,
    omega: float,
    steps: int,
) -> March:
    """A function that marches one period from t = 0: state to (state, q (s, d), w (s, n), friction
    force (s, n)).

    Row m of the histories is at t = m dt; row 0 is the end of the period, so that a settled cycle
    starts at t = 0. The step is not checked here.

    Raises:
        InputError: coupled damping; the leapfrog needs a diagonal one.
    """
    if np.abs(system.damping - np.diag(np.diag(system.damping))).max() > 0:
        raise InputError("System.damping: expected a diagonal matrix for explicit integration")
    d = len(system.stiffness)
    inputs = tuple(sample_fourier(a, steps) for a in (system.force, system.drive, system.normal))
    arrays = tuple(
        np.ascontiguousarray(a)
        for a in (
            system.stiffness,
            np.diag(system.damping),
            system.W,
            system.V,
            system.kt,
            system.mu,
            system.R,
            system.normal[:, 0],
        )
    )

    def march(state: State) -> tuple[State, np.ndarray, np.ndarray, np.ndarray]:
        y = np.concatenate([state.q, state.v, state.z])
        q, w, force = _leapfrog_period(arrays, y, inputs, 2 * np.pi / omega / steps)
        return State(y[:d].copy(), y[d : 2 * d].copy(), y[2 * d :].copy()), q, w, force

    return march


def sample_fourier(coefficients: np.ndarray, steps: int) -> np.ndarray:
    """Values (steps + 1, rows) of Fourier coefficients (rows, 2H+1) at steps + 1 instants of one
    period.
    """
    angle = (
        2
        * np.pi
        * np.outer(np.arange(steps + 1) / steps, np.arange(1, coefficients.shape[1] // 2 + 1))
    )
    return (
        coefficients[:, 0]
        + np.cos(angle) @ coefficients[:, 1::2].T
        + np.sin(angle) @ coefficients[:, 2::2].T
    )


def _relative_change(now: np.ndarray, then: np.ndarray) -> float:
    """Largest change from one period (s, n) to the next, each about its mean, over the swing."""
    return float(np.abs(now - then).max() / max(np.abs(now).max(), 1e-300))


@njit(cache=True)
def _leapfrog_period(arrays, y, inputs, dt):
    L, D, W, V, kt, mu, react, rest_load = arrays
    p, g, n0 = inputs
    n, d = W.shape
    steps = p.shape[0] - 1
    Q = np.empty((steps, d))
    R = np.empty((steps, n))
    F = np.empty((steps, n))
    q = y[:d]
    v = y[d : 2 * d]
    z = y[2 * d :]
    a = np.empty(d)
    before = np.empty(n)
    for m in range(steps + 1):
        row = m % steps
        for k in range(d):
            a[k] = p[m, k] - L[k] * q[k]
        for i in range(n):
            w = g[m, i]
            N = n0[m, i]
            for k in range(d):
                w += W[i, k] * q[k]
                N += V[i, k] * q[k]
            f = step_1d(kt[i] * (w - z[i]), before[i] if m > 0 else N, N, mu[i])
            z[i], before[i] = w - f / kt[i], N
            lift = max(N, 0.0) - rest_load[i]
            for k in range(d):
                a[k] -= f * W[i, k] + lift * react[i, k]
            R[row, i] = w
            F[row, i] = f
        for k in range(d):
            Q[row, k] = q[k]
            if m > 0:
                v[k] = (v[k] + 0.5 * dt * a[k]) / (1 + 0.5 * dt * D[k])
            if m < steps:
                v[k] += 0.5 * dt * (a[k] - D[k] * v[k])
                q[k] += dt * v[k]
    return Q, R, F

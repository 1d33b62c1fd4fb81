"""Periodic solutions by shooting on the exact flow, with their Floquet multipliers.

Unknown is the state (q, v, z) at the start of a period, the residual is its change over the period,
the Jacobian is the monodromy matrix minus one, exact across events. Sliders that never move have a
multiplier of exactly one: their value is free (the mean force of a stuck contact is not determined
by the periodic motion) and the step of least norm leaves them where the preload put them. Undamped
stuck dampers, which time integration from rest never brings to a cycle, are no special case here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..util.newton import halve_step, iterate_newton
from .event_integrator import State, Trajectory, integrate_periods, stuck_start
from .system import System

# step share below which periods are marched instead
SHORTEST_STEP_SHARE = 2.0**-3
# periods marched where Newton makes no headway
MARCHED_PERIODS = 8
# change over one period, relative to the size of the motion, below which it is periodic
PERIODICITY_TOLERANCE = 1e-10


@dataclass(frozen=True)
class Periodic:
    """A periodic solution, or the last attempt with the reason."""

    # base circular frequency [rad/s]
    omega: float
    # one period from the solution, with its tangent
    trajectory: Trajectory
    # state at t = 0
    start: State
    # change over the period over the size of the motion [1]
    residual: float
    # Newton steps, those after marching included
    iterations: int
    # periods integrated altogether
    periods: int
    # "periodic", or why it stopped
    reason: str

    @property
    def converged(self) -> bool:
        return self.reason == "periodic"


def periodic_solution(
    system: System,
    omega: float,
    start: State | None = None,
    most: int = 40,
    samples: int = 256,
) -> Periodic:
    """A periodic solution near ``start`` (the stuck motion when left out).

    Newton with step halving; where Newton makes no headway some periods are marched instead, since
    the flow of a dissipative system leads towards its attractor.

    Args:
        most: largest number of Newton steps.
        samples: equal instants a period in the returned trajectory.
    """
    shooting = _Shooting(system, omega, samples)
    run = iterate_newton(
        shooting.integrate_from(start or stuck_start(system, omega)),
        lambda guess: guess.residual,
        shooting.advance_guess,
        PERIODICITY_TOLERANCE,
        most,
    )
    end = run.state
    if end.trajectory.reason != "done":
        reason = end.trajectory.reason
    elif run.converged:
        reason = "periodic"
    else:
        reason = f"change {run.error:.1e} over a period after {run.iterations} Newton steps"
    return Periodic(
        omega, end.trajectory, end.start, run.error, run.iterations, shooting.periods, reason
    )


@dataclass(frozen=True)
class _Guess:
    """A state at the start of a period, and what becomes of it."""

    start: State
    trajectory: Trajectory
    # of the unknowns
    scale: np.ndarray
    # change over the period over the size of the motion [1]
    residual: float


class _Shooting:
    """Newton steps on the period map of one system, and the periods integrated for them."""

    def __init__(
        self,
        system: System,
        omega: float,
        samples: int,
    ) -> None:
        self.system = system
        self.omega = omega
        self.samples = samples
        self.periods = 0

    def integrate_from(self, start: State) -> _Guess:
        """One period with its tangent."""
        self.periods += 1
        trajectory = integrate_periods(self.system, self.omega, start, self.samples, tangent=True)
        scale = _unknown_scales(self.system, self.omega, start)
        return _Guess(start, trajectory, scale, _period_residual(trajectory, start, scale))

    def advance_guess(self, guess: _Guess) -> _Guess:
        """After a Newton step that lowers the residual, else after some periods of marching."""
        move = _newton_step(guess.trajectory, guess.start, guess.scale)
        better = halve_step(
            lambda share: self.integrate_from(_shift_state(guess.start, share * move)),
            lambda trial, _: (
                _period_residual(trial.trajectory, trial.start, guess.scale) < 0.9 * guess.residual
            ),
            SHORTEST_STEP_SHARE,
        )
        if better is not None:
            return better
        self.periods += MARCHED_PERIODS
        marched = integrate_periods(
            self.system, self.omega, guess.trajectory.state, self.samples, MARCHED_PERIODS
        )
        return self.integrate_from(marched.state)


def floquet_multipliers(solution: Periodic) -> np.ndarray:
    """Floquet multipliers (2d + n,), largest modulus first; stable when none exceeds one.

    One multiplier equals one for each element that sticks through the whole period: a neutral shift
    of its slider.
    """
    values = np.linalg.eigvals(solution.trajectory.monodromy)
    return values[np.argsort(-np.abs(values))]


def probe_harmonics(
    solution: Periodic,
    system: System,
    highest: int,
) -> np.ndarray:
    """Complex harmonics 0..highest of the probe (k, highest + 1) [m], Re(c e^{j h w t})."""
    return _fourier_rows(solution.trajectory.q @ system.probe.T, highest)


def _fourier_rows(signal: np.ndarray, highest: int) -> np.ndarray:
    lines = np.fft.rfft(signal, axis=0)[: highest + 1].T / len(signal)
    lines[:, 1:] *= 2
    return lines


def _unknown_scales(
    system: System,
    omega: float,
    state: State,
) -> np.ndarray:
    """Sizes of (q, v, z): one length for q and z each, the velocity by the base frequency."""
    d = len(state.q)
    n = len(state.z)
    q = max(np.abs(state.q).max(), np.abs(state.v).max() / omega, 1e-12)
    z = max(q * np.abs(system.W).max(), np.abs(system.drive).max(), 1e-12)
    return np.r_[np.full(d, q), np.full(d, q * omega), np.full(n, z)]


def _pack_state(state: State) -> np.ndarray:
    return np.r_[state.q, state.v, state.z]


def _period_residual(
    now: Trajectory,
    state: State,
    scale: np.ndarray,
) -> float:
    return (
        float(np.abs((_pack_state(now.state) - _pack_state(state)) / scale).max())
        if now.reason == "done"
        else np.inf
    )


def _newton_step(
    now: Trajectory,
    state: State,
    scale: np.ndarray,
) -> np.ndarray:
    """Least-norm step in the scaled unknowns, back in their units."""
    J = (now.monodromy - np.eye(len(scale))) * (scale / scale[:, None])
    return (
        scale
        * np.linalg.lstsq(J, (_pack_state(state) - _pack_state(now.state)) / scale, rcond=1e-11)[0]
    )


def _shift_state(state: State, move: np.ndarray) -> State:
    d = len(state.q)
    return State(state.q + move[:d], state.v + move[d : 2 * d], state.z + move[2 * d :])

"""One motion of a nonlinear mode by Newton's method, at given amplitude or on a plane.

Unknowns are q, the displacements beyond the still ones over the amplitude a, and s = log a;
frequency and damping follow from them. Mean displacements count neither in distances nor in
directions: those of a free damper that slides everywhere are hardly determined, and drift without
a change of the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import linalg

from ..util.newton import halve_step, iterate_newton
from ..util.percent import percent
from .mode_equations import (
    ModeFrame,
    ModeState,
    amplitude_derivative,
    mode_jacobian,
    mode_residual,
)

# Newton steps at given amplitude, and of an arc
MAX_NEWTON_STEPS = 40
MAX_ARC_STEPS = 15
# step share below which the search direction is given up
SHORTEST_STEP_SHARE = 2.0**-10
# residual of the motion, relative to its size
RESIDUAL_TOLERANCE = 1e-10
# share of critical: sampled friction damps by less only on motions that are none of the joint's
SMALLEST_DAMPING = -1e-6


@dataclass(frozen=True)
class PathSpot:
    """A motion of the branch: converged, or the best that was found, with the reason."""

    # (N,) displacements beyond the still ones over the amplitude, and log of the amplitude
    q: np.ndarray
    s: float
    state: ModeState
    converged: bool
    reason: str
    iterations: int
    # relative to the size of the motion [1]
    residual: float
    # the amplitude turns here
    fold: bool = False

    @property
    def amplitude(self) -> float:
        return float(np.exp(self.s))


@dataclass(frozen=True)
class Plane:
    """What a motion is to fulfil next to its equations: normal . (q - q0, s - s0) = 0."""

    q0: np.ndarray
    s0: float
    # None: the amplitude is given
    normal: tuple[np.ndarray, float] | None = None


@dataclass(frozen=True)
class NewtonState:
    """Where Newton's method is."""

    q: np.ndarray
    s: float
    state: ModeState
    # distance from the plane
    off: float


def bordered_jacobian(
    frame: ModeFrame, state: ModeState, q: np.ndarray, amplitude: float
) -> np.ndarray:
    """(N + 1, N + 1) derivatives of the residual over the amplitude by q and log a; the last row is
    the caller's.
    """
    N = len(q)
    J = mode_jacobian(frame, state, amplitude)
    bordered = np.empty((N + 1, N + 1))
    bordered[:N, :N] = J
    bordered[:N, N] = J @ q + amplitude_derivative(frame, state, amplitude) - state.r / amplitude
    return bordered


def distance_of(frame: ModeFrame, q: np.ndarray, predicted: np.ndarray) -> float:
    """Of a motion from the predicted one, over its size."""
    return float(np.linalg.norm((q - predicted)[frame.moving]) / size_of(frame, q))


def size_of(frame: ModeFrame, q: np.ndarray) -> float:
    """Of the moving part of a motion."""
    return float(np.linalg.norm(q[frame.moving]))


def carried_motion(frame: ModeFrame, last: PathSpot, change: np.ndarray, s: float) -> np.ndarray:
    """(N,) a motion changed, at log a = s, on the mean displacements that it has."""
    mean = last.q * np.exp(last.s - s)
    return np.where(frame.moving, last.q + change, mean)


def solve_on_plane(
    frame: ModeFrame,
    plane: Plane,
    most_steps: int,
) -> PathSpot:
    """Newton from the plane's own point."""
    run = iterate_newton(
        newton_state(frame, plane, plane.q0, plane.s0),
        _error,
        partial(_advance, frame, plane),
        RESIDUAL_TOLERANCE,
        most_steps,
    )
    end = run.state
    feeds = run.converged and end.state.zeta < SMALLEST_DAMPING
    converged = run.converged and not feeds
    reason = f"friction would feed the motion, {percent(end.state.zeta)}" if feeds else run.reason
    return PathSpot(end.q, end.s, end.state, converged, reason, run.iterations, run.error)


def newton_state(
    frame: ModeFrame,
    plane: Plane,
    q: np.ndarray,
    s: float,
) -> NewtonState:
    """The residual of a motion, and how far it is off the plane."""
    amplitude = float(np.exp(s))
    state = mode_residual(frame, frame.still + amplitude * q, amplitude)
    off = 0.0
    if plane.normal is not None:
        off = float(plane.normal[0] @ (q - plane.q0) + plane.normal[1] * (s - plane.s0))
    return NewtonState(q, s, state, off)


def _error(it: NewtonState) -> float:
    size = np.linalg.norm(it.state.w)
    return float(np.hypot(np.linalg.norm(it.state.r) / size, it.off))


def _merit(plane: Plane, it: NewtonState) -> float:
    """Residual over the amplitude, which may change, and over the size at the start."""
    size = np.linalg.norm(plane.q0)
    return float(np.hypot(np.linalg.norm(it.state.r) / (np.exp(it.s) * size), it.off))


def _advance(frame: ModeFrame, plane: Plane, it: NewtonState) -> NewtonState | None:
    """The first halving of the Newton step that lowers the residual, or None."""
    amplitude = float(np.exp(it.s))
    rhs = it.state.r / amplitude
    if plane.normal is None:
        J = mode_jacobian(frame, it.state, amplitude)
        dq, ds = linalg.solve(J, rhs, overwrite_a=True), 0.0
    else:
        N = len(rhs)
        bordered = bordered_jacobian(frame, it.state, it.q, amplitude)
        bordered[N, :N], bordered[N, N] = plane.normal
        step = linalg.solve(bordered, np.append(rhs, it.off), overwrite_a=True)
        dq, ds = step[:N], float(step[N])
    before = _merit(plane, it)
    return halve_step(
        lambda share: newton_state(frame, plane, it.q - share * dq, it.s - share * ds),
        lambda trial, share: _merit(plane, trial) <= (1 - 1e-4 * share) * before,
        SHORTEST_STEP_SHARE,
    )

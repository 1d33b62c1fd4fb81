"""A motion of a nonlinear mode at a given amplitude that its branch does not lead to.

Where a multiple of the frequency meets another mode, the branch follows that mode far away: nothing
but friction damps it, and friction hardly does. Other modes are lent a damping, with which the
branch passes; the contacts' alternating forces are raised from nothing, where the mode moves alone,
and the damping is taken back at the amplitude that is wanted. Both are paths by pseudo-arclength in
the displacements and the share p of the way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy import linalg

from ..util.newton import halve_step, iterate_newton
from .mode_equations import ModeFrame, ModeState, mode_jacobian, mode_residual

# damping ratios that are lent, in the order in which they are tried: the first three find most of
# what can be found, each of the others a few more
LENT_DAMPING = (0.1, 0.03, 0.3, 0.05, 0.2, 1.0, 0.0)
# power by which it is taken back: slowly at the end, where resonances become sharp
TAKEN_BACK = 3
# first, longest and shortest arc in the share of the way and relative change of the motion
FIRST_ARC, LONGEST_ARC, SHORTEST_ARC = 0.05, 0.3, 1e-4
ARC_REDUCTION, ARC_GROWTH, QUICK_STEPS = 0.3, 1.6, 4
# cosine of the angle between two arcs below which the second one is shortened, and the arc from
# which on it may turn by any
SMALLEST_COSINE, CORNER_ARC = 0.8, 1e-3
# share of the way behind its begin at which it is given up
FARTHEST_BACK = -1.0
MAX_STEPS, MAX_LAST_STEPS = 12, 40
SHORTEST_STEP_SHARE = 2.0**-10
RESIDUAL_TOLERANCE = 1e-10
# of the share, for differences
DIFFERENCE_STEP = 1e-6


@dataclass(frozen=True)
class _Point:
    # (N,) displacements, share of the way, and distance from the plane in which they are sought
    x: np.ndarray
    p: float
    state: ModeState
    off: float = 0.0


@dataclass(frozen=True)
class _Way:
    """From share 0 to 1 of what changes, at one amplitude."""

    frame: Callable[[float], ModeFrame]
    amplitude: float
    # (N,) of harmonics above the mean
    moving: np.ndarray

    def at(self, x: np.ndarray, p: float) -> _Point:
        return _Point(x, p, mode_residual(self.frame(p), x, self.amplitude))

    def by_share(self, x: np.ndarray, p: float) -> np.ndarray:
        """(N,) derivative of the residual."""
        ahead, behind = (self.at(x, p + d).state.r for d in (DIFFERENCE_STEP, -DIFFERENCE_STEP))
        return np.asarray((ahead - behind) / (2 * DIFFERENCE_STEP))


def led_motions(
    frame: ModeFrame, alone: np.ndarray, amplitude: float, arcs: int
) -> Iterator[np.ndarray]:
    """Displacements (N,) at an amplitude, one for each lent damping with which they are found [m].

    Args:
        alone: (N,) the mode without forces of its contacts [m].
        arcs: at most, of each of the two ways.
    """
    for lent in LENT_DAMPING:
        raised = partial(_raised, frame, lent)
        x = _led(_Way(raised, amplitude, frame.moving), alone, arcs)
        if x is not None and lent > 0:
            taken = partial(_taken_back, frame, lent)
            x = _led(_Way(taken, amplitude, frame.moving), x, arcs)
        if x is not None:
            yield x


def _raised(frame: ModeFrame, lent: float, p: float) -> ModeFrame:
    return replace(frame, share=p, lent=lent)


def _taken_back(frame: ModeFrame, lent: float, p: float) -> ModeFrame:
    return replace(frame, lent=lent * max(1 - p, 0.0) ** TAKEN_BACK)


def _led(way: _Way, x: np.ndarray, arcs: int) -> np.ndarray | None:
    """The displacements at the end of a way, None where it is not reached."""
    begun = _solved(way, way.at(x, 0.0), None, MAX_LAST_STEPS)
    if begun is None:
        return None
    trail = [begun[0]]
    arc = FIRST_ARC
    for _ in range(arcs):
        last = trail[-1]
        size = float(np.linalg.norm(last.x[way.moving]))
        dx, dp = _direction(way, trail, size)
        start = way.at(last.x + arc * size * dx, last.p + arc * dp)
        found = _solved(way, start, (dx / size, dp), MAX_STEPS)
        if found is None or _turns(way, last, found[0], (dx, dp), size, arc):
            arc *= ARC_REDUCTION
            if arc < SHORTEST_ARC:
                return None
            continue
        point, steps = found
        if point.p >= 1:
            share = (1 - last.p) / (point.p - last.p)
            end = way.at(last.x + share * (point.x - last.x), 1.0)
            ended = _solved(way, end, None, MAX_LAST_STEPS)
            return None if ended is None else ended[0].x
        if point.p < FARTHEST_BACK:
            return None
        trail = [last, point]
        if steps <= QUICK_STEPS:
            arc = min(ARC_GROWTH * arc, LONGEST_ARC)
    return None


def _direction(way: _Way, trail: list[_Point], size: float) -> tuple[np.ndarray, float]:
    """Direction of the secant through the last two points, length 1; forward for one point."""
    if len(trail) == 1:
        return np.zeros_like(trail[0].x), 1.0
    change = np.where(way.moving, trail[-1].x - trail[-2].x, 0.0) / size
    p = trail[-1].p - trail[-2].p
    length = float(np.hypot(np.linalg.norm(change), p))
    return change / length, p / length


def _turns(
    way: _Way,
    last: _Point,
    point: _Point,
    direction: tuple[np.ndarray, float],
    size: float,
    arc: float,
) -> bool:
    """Whether an arc turns too sharply from the last direction."""
    if arc <= CORNER_ARC:
        return False
    change = np.where(way.moving, point.x - last.x, 0.0) / size
    p = point.p - last.p
    length = np.hypot(np.linalg.norm(change), p)
    return bool(change @ direction[0] + p * direction[1] < SMALLEST_COSINE * length)


def _solved(
    way: _Way,
    start: _Point,
    normal: tuple[np.ndarray, float] | None,
    most: int,
) -> tuple[_Point, int] | None:
    """Newton from a point in the plane through it, or at its share, and the steps that it took."""
    run = iterate_newton(
        start, _error, partial(_advance, way, start, normal), RESIDUAL_TOLERANCE, most
    )
    return (run.state, run.iterations) if run.converged else None


def _error(point: _Point) -> float:
    size = np.linalg.norm(point.state.w)
    return float(np.hypot(np.linalg.norm(point.state.r) / size, point.off))


def _advance(
    way: _Way,
    start: _Point,
    normal: tuple[np.ndarray, float] | None,
    point: _Point,
) -> _Point | None:
    """The first halving of the Newton step that lowers the residual, or None."""
    J = mode_jacobian(way.frame(point.p), point.state, way.amplitude)
    N = len(J)
    if normal is None:
        dx, dp = linalg.solve(J, point.state.r, overwrite_a=True), 0.0
    else:
        bordered = np.empty((N + 1, N + 1))
        bordered[:N, :N] = J
        bordered[:N, N] = way.by_share(point.x, point.p)
        bordered[N, :N], bordered[N, N] = normal
        step = linalg.solve(bordered, np.append(point.state.r, point.off), overwrite_a=True)
        dx, dp = step[:N], float(step[N])
    before = _error(point)

    def trial(share: float) -> _Point:
        x, p = point.x - share * dx, point.p - share * dp
        if normal is None:
            return way.at(x, p)
        off = normal[0] @ (x - start.x) + normal[1] * (p - start.p)
        return replace(way.at(x, p), off=float(off))

    return halve_step(
        trial, lambda one, share: _error(one) <= (1 - 1e-4 * share) * before, SHORTEST_STEP_SHARE
    )

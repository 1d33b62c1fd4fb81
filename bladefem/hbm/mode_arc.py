"""A nonlinear mode followed by pseudo-arclength (Keller 1977) with the secant as direction.

Sampled forces have corners where a contact opens or begins to slip: there the branch may turn by
more than a right angle and misses the plane in which the secant looks for it. Arcs that fail are
tried again along the tangents of the pieces that meet there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import linalg

from .mode_equations import (
    ModeFrame,
)
from .mode_newton import (
    MAX_ARC_STEPS,
    PathSpot,
    Plane,
    bordered_jacobian,
    carried_motion,
    newton_state,
    size_of,
    solve_on_plane,
)

# first, longest and shortest arc, in the logarithm of the amplitude and relative change of q
FIRST_ARC, LONGEST_ARC, SHORTEST_ARC = 0.05, 0.3, 1e-4
# change of the arc after a step that fails, and after one of at most that many Newton steps
ARC_REDUCTION, ARC_GROWTH, QUICK_STEPS = 0.3, 1.6, 4
# cosine of the angle between two arcs below which the second one is shortened
SMALLEST_COSINE = 0.8
# longest arc across a fold: its amplitude is then known to some 1e-4
FOLD_ARC = 0.02
# arcs that may turn by any angle: the forces of sampled friction have corners
CORNER_ARC = 1e-3
# lengths at which a corner is looked beyond, and tried to be passed, over the arc that fails
CORNER_PROBES = (1.0, 10.0, 0.1, 0.0)
CORNER_ARCS = (1.0, 3.0, 10.0)
# cosine of the angle to the last arc below which an arc leads back
BACK_COSINE = -0.98
# way back in the logarithm of the amplitude at which the branch is given up
FARTHEST_RETURN = 4.0


def follow_arcs(
    frame: ModeFrame,
    s: float,
    known: tuple[PathSpot, ...],
    arcs: int,
) -> tuple[list[PathSpot], str]:
    """Arcs from the last motion known to an amplitude, which is solved last; "" or why it is not
    reached.
    """
    way = np.sign(s - known[-1].s) or 1.0
    trail = list(known)
    spots: list[PathSpot] = []
    arc = FIRST_ARC
    reason = ""
    for _ in range(arcs):
        direction = _direction(frame, trail, way)
        spot = _step(frame, trail[-1], direction, arc)
        if not spot.converged and arc <= CORNER_ARC:
            spot = _round_corner(frame, trail[-1], direction, arc, spot)
        reason = spot.reason
        if spot.converged:
            reason = _refused(frame, trail, spot, direction, arc)
        if reason:
            arc *= ARC_REDUCTION
            if arc < SHORTEST_ARC:
                return spots, reason
            continue
        passed = way * (spot.s - s) >= 0
        if passed:
            trail.append(spot)
            end = solve_on_plane(frame, Plane(_between(trail, s), s), MAX_ARC_STEPS)
            return ([*spots, end], "") if end.converged else (spots, end.reason)
        if len(trail) > 1 and (spot.s - trail[-1].s) * (trail[-1].s - trail[-2].s) < 0:
            trail[-1] = replace(trail[-1], fold=True)
            if spots:
                spots[-1] = trail[-1]
        trail.append(spot)
        spots.append(spot)
        if way * (spot.s - known[-1].s) < -FARTHEST_RETURN:
            return spots, "the branch returns to far other amplitudes"
        if spot.iterations <= QUICK_STEPS:
            arc = min(ARC_GROWTH * arc, LONGEST_ARC)
    return spots, f"{arcs} motions do not reach the next amplitude"


def _refused(
    frame: ModeFrame,
    trail: list[PathSpot],
    spot: PathSpot,
    direction: tuple[np.ndarray, float],
    arc: float,
) -> str:
    """Why an arc has to be shortened, or "": it turns too sharply, or is too long across a fold."""
    if arc <= CORNER_ARC:
        return ""
    change = np.where(frame.moving, spot.q - trail[-1].q, 0.0)
    step = change / size_of(frame, trail[-1].q), spot.s - trail[-1].s
    length = np.hypot(np.linalg.norm(step[0]), step[1])
    if (step[0] @ direction[0] + step[1] * direction[1]) / length < SMALLEST_COSINE:
        return "the branch turns sharply"
    turned = step[1] * direction[1] < 0
    return "the amplitude turns" if turned and arc > FOLD_ARC else ""


def _direction(
    frame: ModeFrame,
    trail: list[PathSpot],
    way: float,
) -> tuple[np.ndarray, float]:
    """Direction of the secant through the last two motions, length 1; of growing amplitude for one
    motion.
    """
    if len(trail) == 1:
        return np.zeros_like(trail[-1].q), float(way)
    change = np.where(frame.moving, trail[-1].q - trail[-2].q, 0.0)
    q = change / size_of(frame, trail[-1].q)
    s = trail[-1].s - trail[-2].s
    length = np.hypot(np.linalg.norm(q), s)
    return q / length, float(s / length)


def _step(
    frame: ModeFrame,
    last: PathSpot,
    direction: tuple[np.ndarray, float],
    arc: float,
) -> PathSpot:
    size = size_of(frame, last.q)
    s = last.s + arc * direction[1]
    q = carried_motion(frame, last, arc * size * direction[0], s)
    return solve_on_plane(frame, Plane(q, s, (direction[0] / size, direction[1])), MAX_ARC_STEPS)


def _round_corner(
    frame: ModeFrame,
    last: PathSpot,
    direction: tuple[np.ndarray, float],
    arc: float,
    failed: PathSpot,
) -> PathSpot:
    """The motion after a corner of the branch, or the one that failed.

    Args:
        failed: where the search along the direction ended.
    """
    size = size_of(frame, last.q)
    probes = [failed]
    for reach in CORNER_PROBES:
        s = last.s + reach * arc * direction[1]
        q = carried_motion(frame, last, reach * arc * size * direction[0], s)
        state = newton_state(frame, Plane(q, s), q, s).state
        probes.append(replace(last, q=q, s=s, state=state))
    for probe in probes:
        try:
            along = _tangent(frame, probe, direction)
        except linalg.LinAlgError:
            continue
        for way in (along, (-along[0], -along[1])):
            for longer in CORNER_ARCS:
                spot = _step(frame, last, way, longer * arc)
                if spot.converged and _leaves(frame, last, spot, direction, longer * arc):
                    return spot
    return failed


def _leaves(
    frame: ModeFrame,
    last: PathSpot,
    spot: PathSpot,
    direction: tuple[np.ndarray, float],
    arc: float,
) -> bool:
    """Whether a motion is another one than the last, and not on the way that led there."""
    change = np.where(frame.moving, spot.q - last.q, 0.0) / size_of(frame, last.q)
    step = spot.s - last.s
    length = np.hypot(np.linalg.norm(change), step)
    ahead = (change @ direction[0] + step * direction[1]) / max(length, np.finfo(float).tiny)
    return bool(length > 0.2 * arc and ahead > BACK_COSINE)


def _tangent(
    frame: ModeFrame,
    spot: PathSpot,
    direction: tuple[np.ndarray, float],
) -> tuple[np.ndarray, float]:
    """Tangent of the branch, length 1, on the piece of the forces on which a motion lies.

    Raises:
        LinAlgError: the direction is at a right angle to it.
    """
    N = len(spot.q)
    size = size_of(frame, spot.q)
    bordered = bordered_jacobian(frame, spot.state, spot.q, spot.amplitude)
    bordered[N, :N] = direction[0] / size
    bordered[N, N] = direction[1]
    along = linalg.solve(bordered, np.append(np.zeros(N), 1.0), overwrite_a=True)
    q = np.where(frame.moving, along[:N], 0.0) / size
    length = np.hypot(np.linalg.norm(q), along[N])
    return q / length, float(along[N] / length)


def _between(trail: list[PathSpot], s: float) -> np.ndarray:
    """(N,) between the last two motions, at log a = s."""
    before, after = trail[-2:]
    if after.s == before.s:
        return after.q
    share = (s - before.s) / (after.s - before.s)
    return before.q + share * (after.q - before.q)

"""Continuation of a nonlinear mode in amplitude and round its folds.

Unknowns are q, the displacements beyond the still ones over the amplitude a, and s = log a;
frequency and damping follow from them. Between amplitudes that are asked for the branch is stepped
at given amplitude, started on the line through the two motions known last. Where Newton fails, or
the motion found lies far from the one predicted, and shorter steps do not mend it, the branch is
followed by pseudo-arclength (Keller 1977) with the secant as direction, until the amplitude is
passed. Sampled forces have corners where a contact opens or begins to slip: there the branch may
turn by more than a right angle and misses the plane in which the secant looks for it. Arcs that
fail are tried again along the tangents of the pieces that meet there. Amplitudes that are not
reached from below are tried from above, where the branch is found again. Mean displacements count
neither in distances nor in directions: those of a free damper that slides everywhere are hardly
determined, and drift without a change of the motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy import linalg

from ..friction.fourier import to_real
from ..util.newton import halve_step, iterate_newton
from ..util.percent import percent
from .mode_detour import led_motions
from .mode_equations import (
    ModeFrame,
    ModeState,
    amplitude_derivative,
    mode_jacobian,
    mode_residual,
    nearest_mode,
    stuck_mode,
)

# Newton steps at given amplitude, and of an arc
MAX_NEWTON_STEPS = 40
MAX_ARC_STEPS = 15
# extrapolation from two motions, over the step between them
FARTHEST_PREDICTION = 2.0
# distance of a motion from the predicted one, over its size, beyond which it may be on another part
# of the branch
FARTHEST_CORRECTION = 0.7
# halvings of the step in amplitude before the branch is followed by arclength
MAX_HALVINGS = 4
# step share below which the search direction is given up
SHORTEST_STEP_SHARE = 2.0**-10
# residual of the motion, relative to its size
RESIDUAL_TOLERANCE = 1e-10
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
# share of critical: sampled friction damps by less only on motions that are none of the joint's
SMALLEST_DAMPING = -1e-6
# way back in the logarithm of the amplitude at which the branch is given up
FARTHEST_RETURN = 4.0
# folds that a reason lists
TURNS_TOLD = 3
# motions between two amplitudes that are asked for, and of each way of a detour
MAX_ARCS = 200
MAX_DETOUR_ARCS = 200


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
class _Plane:
    """What a motion is to fulfil next to its equations: normal . (q - q0, s - s0) = 0."""

    q0: np.ndarray
    s0: float
    # None: the amplitude is given
    normal: tuple[np.ndarray, float] | None = None


@dataclass(frozen=True)
class _Iterate:
    q: np.ndarray
    s: float
    state: ModeState
    # distance from the plane
    off: float


def follow_mode(
    frame: ModeFrame,
    amplitudes: Iterable[float],
    start: PathSpot | None = None,
    arcs: int = MAX_ARCS,
) -> Iterator[PathSpot]:
    """Motions along the branch through the amplitudes, with those between them where it turns.

    The first one starts from a motion known, or from full stick. An amplitude that is not found
    gives a motion that is not converged, with the reason.
    """
    known: tuple[PathSpot, ...] = () if start is None else (start,)
    # why the branch was given up, and the amplitudes that were not reached since
    ended = ""
    missing: list[PathSpot] = []
    # the last two that were reached at given amplitude
    plain = known
    for amplitude in amplitudes:
        s = float(np.log(amplitude))
        spots, lost, near = _towards(frame, s, known, plain, ended, arcs)
        if spots[-1].converged:
            below = _from_above(frame, missing, spots[-1])
            yield from _by_detours(frame, list(below), arcs)
            missing = []
            yield from spots
        else:
            missing += spots
        solved = [spot for spot in spots if spot.converged]
        if lost:
            ended = lost
        if lost and spots[-1].converged:
            # begun again
            known, ended = (spots[-1],), ""
        else:
            known = (*known, *solved)[-2:]
        plain = near or known
    yield from _by_detours(frame, missing, arcs)


def _by_detours(frame: ModeFrame, spots: list[PathSpot], arcs: int) -> Iterator[PathSpot]:
    """The motions with those that were not reached, from one found by a detour, or from such a one
    at the next amplitude above or below.
    """
    found = list(spots)
    known: tuple[PathSpot, ...] = ()
    for i, spot in enumerate(spots):
        if spot.converged:
            known = ()
            continue
        made = _towards(frame, spot.s, known, known, "", arcs)[0][-1] if known else None
        if made is None or not made.converged:
            made = _detour(frame, spot.s, arcs)
        known = () if made is None else (*known[-1:], made)
        if made is not None:
            found[i] = replace(made, reason=f"begun again by a detour, {spot.reason}")
    for i in reversed(range(len(found) - 1)):
        above = found[i + 1]
        if not found[i].converged and above.converged:
            steps = _shorter_steps(frame, found[i].s, (above,))
            if steps[-1].s == found[i].s:
                found[i] = replace(steps[-1], reason="reached from above")
    yield from found


def _detour(frame: ModeFrame, s: float, arcs: int) -> PathSpot | None:
    """A motion at an amplitude that the branch does not lead to, if one is found."""
    amplitude = float(np.exp(s))
    alone = frame.still + amplitude * _without_contact(frame)
    for x in led_motions(frame, alone, amplitude, min(arcs, MAX_DETOUR_ARCS)):
        spot = _solve(frame, _Plane((x - frame.still) / amplitude, s), MAX_NEWTON_STEPS)
        if spot.converged:
            return spot
    return None


def _from_above(
    frame: ModeFrame,
    missing: list[PathSpot],
    found: PathSpot,
) -> Iterator[PathSpot]:
    """The motions at amplitudes that were not reached, stepped down to from one above them."""
    known: tuple[PathSpot, ...] = (found,)
    reached = []
    for spot in reversed(missing):
        steps = _shorter_steps(frame, spot.s, known)
        if steps[-1].s != spot.s:
            break
        known = steps
        reached.append(replace(steps[-1], reason="reached from above"))
    yield from missing[: len(missing) - len(reached)]
    yield from reversed(reached)


def _towards(
    frame: ModeFrame,
    s: float,
    known: tuple[PathSpot, ...],
    plain: tuple[PathSpot, ...],
    ended: str,
    arcs: int,
) -> tuple[list[PathSpot], str, tuple[PathSpot, ...]]:
    """Motions up to an amplitude, and why the branch was lost on the way, if it was; also
    the last two motions at given amplitude, none where it is begun.

    Of a branch that is lost only the motion at the amplitude is given, begun again or not found.
    """
    if not known:
        spot = _solve(frame, _Plane(_full_stick(frame, s), s), MAX_NEWTON_STEPS)
        return [spot], "", ()
    reason, near = ended, plain
    if not ended:
        near = _shorter_steps(frame, s, known)
        if near[-1].s == s:
            return [near[-1]], "", near
        spots, reason = _walk(frame, s, near, arcs)
        if not reason:
            # without a fold, what lies between shows nothing new
            return spots if any(spot.fold for spot in spots) else spots[-1:], "", near
        turns = [f"{spot.amplitude:.4g}" for spot in spots if spot.fold]
        if turns:
            more = f" and {len(turns) - TURNS_TOLD} times more" if len(turns) > TURNS_TOLD else ""
            named = " and ".join(turns[:TURNS_TOLD])
            reason = f"the amplitude turns back at {named}{more}, then {reason}"
        # what does not come back is left out
        known = plain = near
    starts = [
        _predicted(frame, known, s),
        _predicted(frame, plain, s),
        _full_stick(frame, s),
        _without_contact(frame),
    ]
    for q in starts:
        spot = _solve(frame, _Plane(q, s), MAX_NEWTON_STEPS)
        if spot.converged:
            return [replace(spot, reason=f"begun again, {reason}")], reason, ()
    text = f"not followed beyond an amplitude of {known[-1].amplitude:.4g}: {reason}"
    text += _met_there(frame, known[-1])
    return [replace(spot, reason=text)], reason, near


def _met_there(frame: ModeFrame, spot: PathSpot) -> str:
    """Which other mode of the blade a multiple of the frequency comes nearest to."""
    own = nearest_mode(frame, spot.state.omega)
    if own is None:
        return ""
    harmonic, mode, off = own
    return f"; {harmonic} times its frequency is {percent(abs(off))} off mode {mode + 1} there"


def _shorter_steps(
    frame: ModeFrame,
    s: float,
    known: tuple[PathSpot, ...],
) -> tuple[PathSpot, ...]:
    """The last two motions on the way to an amplitude, in steps that are halved where the motion is
    not found, or not near the predicted one; the last one has that amplitude if it is reached.
    """
    aims = [s]
    while aims and len(aims) <= MAX_HALVINGS + 1:
        predicted = _predicted(frame, known, aims[-1])
        spot = _solve(frame, _Plane(predicted, aims[-1]), MAX_NEWTON_STEPS)
        if spot.converged and _distance(frame, spot.q, predicted) <= FARTHEST_CORRECTION:
            known = (*known[-1:], spot)
            aims.pop()
        else:
            aims.append((known[-1].s + aims[-1]) / 2)
    return known


def _walk(
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
            end = _solve(frame, _Plane(_between(trail, s), s), MAX_ARC_STEPS)
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
    step = change / _size(frame, trail[-1].q), spot.s - trail[-1].s
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
    q = change / _size(frame, trail[-1].q)
    s = trail[-1].s - trail[-2].s
    length = np.hypot(np.linalg.norm(q), s)
    return q / length, float(s / length)


def _step(
    frame: ModeFrame,
    last: PathSpot,
    direction: tuple[np.ndarray, float],
    arc: float,
) -> PathSpot:
    size = _size(frame, last.q)
    s = last.s + arc * direction[1]
    q = _carried(frame, last, arc * size * direction[0], s)
    return _solve(frame, _Plane(q, s, (direction[0] / size, direction[1])), MAX_ARC_STEPS)


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
    size = _size(frame, last.q)
    probes = [failed]
    for reach in CORNER_PROBES:
        s = last.s + reach * arc * direction[1]
        q = _carried(frame, last, reach * arc * size * direction[0], s)
        state = _iterate(frame, _Plane(q, s), q, s).state
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
    change = np.where(frame.moving, spot.q - last.q, 0.0) / _size(frame, last.q)
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
    size = _size(frame, spot.q)
    bordered = _bordered(frame, spot.state, spot.q, spot.amplitude)
    bordered[N, :N] = direction[0] / size
    bordered[N, N] = direction[1]
    along = linalg.solve(bordered, np.append(np.zeros(N), 1.0), overwrite_a=True)
    q = np.where(frame.moving, along[:N], 0.0) / size
    length = np.hypot(np.linalg.norm(q), along[N])
    return q / length, float(along[N] / length)


def _bordered(frame: ModeFrame, state: ModeState, q: np.ndarray, amplitude: float) -> np.ndarray:
    """(N + 1, N + 1) derivatives of the residual over the amplitude by q and log a; the last row is
    the caller's.
    """
    N = len(q)
    J = mode_jacobian(frame, state, amplitude)
    bordered = np.empty((N + 1, N + 1))
    bordered[:N, :N] = J
    bordered[:N, N] = J @ q + amplitude_derivative(frame, state, amplitude) - state.r / amplitude
    return bordered


def _distance(frame: ModeFrame, q: np.ndarray, predicted: np.ndarray) -> float:
    return float(np.linalg.norm((q - predicted)[frame.moving]) / _size(frame, q))


def _size(frame: ModeFrame, q: np.ndarray) -> float:
    return float(np.linalg.norm(q[frame.moving]))


def _carried(frame: ModeFrame, last: PathSpot, change: np.ndarray, s: float) -> np.ndarray:
    """(N,) a motion changed, at log a = s, on the mean displacements that it has."""
    mean = last.q * np.exp(last.s - s)
    return np.where(frame.moving, last.q + change, mean)


def _full_stick(frame: ModeFrame, s: float) -> np.ndarray:
    """(N,) of the linear mode about unloaded contacts."""
    motion = np.zeros((len(frame.shape), frame.H + 1), dtype=complex)
    motion[:, 1] = stuck_mode(frame)
    return to_real(motion).ravel() - np.exp(-s) * frame.still


def _without_contact(frame: ModeFrame) -> np.ndarray:
    """(N,) of the mode alone, as where the amplitude is so large that contacts hardly matter."""
    motion = np.zeros((len(frame.shape), frame.H + 1), dtype=complex)
    motion[:, 1] = frame.shape
    return to_real(motion).ravel()


def _predicted(frame: ModeFrame, known: tuple[PathSpot, ...], s: float) -> np.ndarray:
    """(N,) on the line through the last two motions against log a, unless that is too far off."""
    last = known[-1]
    change = np.zeros_like(last.q)
    if len(known) > 1 and last.s != known[-2].s:
        share = (s - last.s) / (last.s - known[-2].s)
        if 0 < share <= FARTHEST_PREDICTION:
            change = share * (last.q - known[-2].q)
    return _carried(frame, last, change, s)


def _between(trail: list[PathSpot], s: float) -> np.ndarray:
    """(N,) between the last two motions, at log a = s."""
    before, after = trail[-2:]
    if after.s == before.s:
        return after.q
    share = (s - before.s) / (after.s - before.s)
    return before.q + share * (after.q - before.q)


def _solve(
    frame: ModeFrame,
    plane: _Plane,
    most_steps: int,
) -> PathSpot:
    """Newton from the plane's own point."""
    run = iterate_newton(
        _iterate(frame, plane, plane.q0, plane.s0),
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


def _iterate(
    frame: ModeFrame,
    plane: _Plane,
    q: np.ndarray,
    s: float,
) -> _Iterate:
    amplitude = float(np.exp(s))
    state = mode_residual(frame, frame.still + amplitude * q, amplitude)
    off = 0.0
    if plane.normal is not None:
        off = float(plane.normal[0] @ (q - plane.q0) + plane.normal[1] * (s - plane.s0))
    return _Iterate(q, s, state, off)


def _error(it: _Iterate) -> float:
    size = np.linalg.norm(it.state.w)
    return float(np.hypot(np.linalg.norm(it.state.r) / size, it.off))


def _merit(plane: _Plane, it: _Iterate) -> float:
    """Residual over the amplitude, which may change, and over the size at the start."""
    size = np.linalg.norm(plane.q0)
    return float(np.hypot(np.linalg.norm(it.state.r) / (np.exp(it.s) * size), it.off))


def _advance(frame: ModeFrame, plane: _Plane, it: _Iterate) -> _Iterate | None:
    """The first halving of the Newton step that lowers the residual, or None."""
    amplitude = float(np.exp(it.s))
    rhs = it.state.r / amplitude
    if plane.normal is None:
        J = mode_jacobian(frame, it.state, amplitude)
        dq, ds = linalg.solve(J, rhs, overwrite_a=True), 0.0
    else:
        N = len(rhs)
        bordered = _bordered(frame, it.state, it.q, amplitude)
        bordered[N, :N], bordered[N, N] = plane.normal
        step = linalg.solve(bordered, np.append(rhs, it.off), overwrite_a=True)
        dq, ds = step[:N], float(step[N])
    before = _merit(plane, it)
    return halve_step(
        lambda share: _iterate(frame, plane, it.q - share * dq, it.s - share * ds),
        lambda trial, share: _merit(plane, trial) <= (1 - 1e-4 * share) * before,
        SHORTEST_STEP_SHARE,
    )

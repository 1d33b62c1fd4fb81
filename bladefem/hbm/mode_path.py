"""Continuation of a nonlinear mode in amplitude and round its folds.

Between amplitudes that are asked for the branch is stepped at given amplitude, started on the line
through the two motions known last (``mode_newton``). Where Newton fails, or the motion found lies
far from the one predicted, and shorter steps do not mend it, the branch is followed by arclength
(``mode_arc``), until the amplitude is passed. Amplitudes that are not reached from below are tried
from above, where the branch is found again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ..friction.fourier import to_real
from ..util.percent import percent
from .mode_arc import follow_arcs
from .mode_detour import led_motions
from .mode_equations import (
    ModeFrame,
    nearest_mode,
    stuck_mode,
)
from .mode_newton import (
    MAX_NEWTON_STEPS,
    PathSpot,
    Plane,
    carried_motion,
    distance_of,
    solve_on_plane,
)

# extrapolation from two motions, over the step between them
FARTHEST_PREDICTION = 2.0
# distance of a motion from the predicted one, over its size, beyond which it may be on another part
# of the branch
FARTHEST_CORRECTION = 0.7
# halvings of the step in amplitude before the branch is followed by arclength
MAX_HALVINGS = 4
# folds that a reason lists
TURNS_TOLD = 3
# motions between two amplitudes that are asked for, and of each way of a detour
MAX_ARCS = 200
MAX_DETOUR_ARCS = 200


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
        spot = solve_on_plane(frame, Plane((x - frame.still) / amplitude, s), MAX_NEWTON_STEPS)
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
        spot = solve_on_plane(frame, Plane(_full_stick(frame, s), s), MAX_NEWTON_STEPS)
        return [spot], "", ()
    reason, near = ended, plain
    if not ended:
        near = _shorter_steps(frame, s, known)
        if near[-1].s == s:
            return [near[-1]], "", near
        spots, reason = follow_arcs(frame, s, near, arcs)
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
        spot = solve_on_plane(frame, Plane(q, s), MAX_NEWTON_STEPS)
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
        spot = solve_on_plane(frame, Plane(predicted, aims[-1]), MAX_NEWTON_STEPS)
        if spot.converged and distance_of(frame, spot.q, predicted) <= FARTHEST_CORRECTION:
            known = (*known[-1:], spot)
            aims.pop()
        else:
            aims.append((known[-1].s + aims[-1]) / 2)
    return known


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
    return carried_motion(frame, last, change, s)

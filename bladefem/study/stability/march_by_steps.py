"""A march from an unstable motion by time steps, with more of them where they were too long.

Figures behind the limits: docs/verification.md, "Limits of marches and balances".
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...errors import InputError, NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.ring_march import (
    PERIODS_AT_ONCE,
    march_ring,
    state_of_solution,
    steps_are_resolved,
)
from ...hbm.solution import Solution, lifts_off, size
from .kept_band import (
    DISTURBANCE_SHARE,
    LONGER_WHILE_WIDENING,
    PARTS,
    KeptBand,
    amplitudes_of_periods,
    band_of,
    ends_of_parts,
    has_settled,
    too_long_reason,
    unknown_band,
    widens_at_end,
)

# operations that the first period shows to be needed above which it is given up, some 15 s; the
# second where no fewer contact points are left to march with
MAX_COUNTED = 3e11
MAX_COUNTED_LAST = 6e11
# 2.2e-11 on the shipped wedge, 3.4e-11 with the default layer, 7e-11 with one of 1e5 N/mm^3 [s]
SECONDS_PER_OPERATION = 5e-11
# periods before the amplitudes are taken, and those in which they are
LEFT_BY_STEPS = 150
KEPT_BY_STEPS = 50
# instants of a period, and periods before and after with more than the first of them
INSTANTS_BY_STEPS = (256, 512, 1024)
REFINED_PERIODS = (75, 25)
# of the motion at the start: a band that reaches beyond it is marched again with more instants, as
# steps that are too long for impacts feed them energy
GROWN_RATIO = 1.2
# of the motion at the start: a band farther from it, by steps too long for forces that are linear
# in them, is marched again with more instants, until two agree by AGREEING_SHARE
HELD_SHARE = 0.03
AGREEING_SHARE = 0.02
# periods of a march that has not settled and is above what is known, at most, over those that it
# has otherwise
LONGER_WHILE_UNSETTLED = 2


@dataclass(frozen=True)
class _MarchPlan:
    """How a march is made, and how long it may be."""

    # of a period
    instants: int
    # periods before the amplitudes are taken, and those in which they are
    left: int
    kept: int
    # operations that it may need, as its first periods show
    counted: float
    # amplitude above which it goes on until its band has settled [m]
    known: float


def band_by_steps(
    model: ReducedModel,
    point: Solution,
    counted: float = MAX_COUNTED,
    known: float = np.inf,
) -> KeptBand:
    """Band of amplitudes by time stepping: with two tangents, and for travelling waves.

    Begun with the fewest instants whose steps are short enough for the bodies on their contacts.
    Marched again with more of them where the blade seems to leave the motion at the start and
    steps were too long, for that or for impacts, and where the forces of a step were not found.

    Args:
        counted: operations that it may need, as its first periods show.
        known: amplitude above which the blade is marched on until its band has settled [m].
    """
    band = before = unknown_band(point, "nothing was marched")
    left = False
    try:
        tried = _instants_to_try(model, point.omega)
    except InputError as error:
        return unknown_band(point, str(error))
    for instants in tried:
        usual = instants == INSTANTS_BY_STEPS[0]
        periods = (LEFT_BY_STEPS, KEPT_BY_STEPS) if usual else REFINED_PERIODS
        try:
            plan = _MarchPlan(instants, *periods, counted, known)
            found, resolved = _band_with(model, point, plan)
        except (InputError, NotSolvedError) as error:
            return unknown_band(point, str(error))
        before, band = band, found
        if found.too_long:
            return found
        if found.reason:
            continue
        grown = band.highest > GROWN_RATIO * size(point) and lifts_off(point)
        left = not resolved and not band.holds(size(point), HELD_SHARE)
        if not grown and (not left or _agree(before, band, size(point))):
            return band
    if band.reason or before.reason or not left:
        return band
    # how far more instants would still lead is not known
    return _both(before, band)


def _instants_to_try(model: ReducedModel, omega: float) -> tuple[int, ...]:
    """From the fewest instants on with steps short enough for forces that are linear in them; all
    where none are. Longer steps take more iterations each, and more time in all.
    """
    for k, instants in enumerate(INSTANTS_BY_STEPS):
        if steps_are_resolved(model, omega, instants):
            return INSTANTS_BY_STEPS[k:]
    return INSTANTS_BY_STEPS


def _both(one: KeptBand, other: KeptBand) -> KeptBand:
    """The band that contains two."""
    lowest, highest = min(one.lowest, other.lowest), max(one.highest, other.highest)
    return replace(other, lowest=lowest, highest=highest)


def _agree(one: KeptBand, other: KeptBand, amplitude: float) -> bool:
    """Both ends of two bands are the same, over an amplitude."""
    if one.reason:
        return False
    ends = (one.lowest, other.lowest), (one.highest, other.highest)
    return all(abs(a - b) <= AGREEING_SHARE * amplitude for a, b in ends)


def _band_with(model: ReducedModel, point: Solution, plan: _MarchPlan) -> tuple[KeptBand, bool]:
    """The band by a plan, and whether steps were short enough for forces that are linear in
    them.
    """
    instants, kept = plan.instants, plan.kept
    usual = plan.left + kept
    enough = partial(_known_enough, point, instants)
    start = state_of_solution(model, point, DISTURBANCE_SHARE)
    march = march_ring(model, start, usual, instants, enough, plan.counted)
    if march.operations > plan.counted:
        reason = too_long_reason(march.operations * SECONDS_PER_OPERATION)
        return replace(unknown_band(point, reason), too_long=True), march.resolved
    motion, spent = march.motion, march.friction_work
    affordable = usual * plan.counted / march.operations
    ended = len(motion) < usual
    while not ended and march.settled and len(motion) + kept <= affordable:
        periods = _worthwhile_periods(motion, point, plan.known)
        if len(motion) + kept > periods or _grown_too_far(motion, point, instants):
            break
        march = march_ring(model, march.end, kept, instants)
        motion = np.concatenate([motion, march.motion])
        spent = np.concatenate([spent, march.friction_work])
    if not (march.settled and np.isfinite(motion).all()):
        reason = "the contact forces of a step of the march were not found"
        return unknown_band(point, reason), march.resolved
    widens = not ended and widens_at_end(motion, point)
    unsettled = not has_settled(motion, point)
    if unsettled and not widens and np.isfinite(plan.known):
        # what has no period is not known by a few of them
        kept = PARTS * PERIODS_AT_ONCE
    first = len(motion) - (PERIODS_AT_ONCE if ended else kept)
    band = band_of(point, motion[first:], len(motion), float(spent[first:].mean()))
    return replace(band, widens=widens, unsettled=unsettled), march.resolved


def _worthwhile_periods(motion: np.ndarray, point: Solution, known: float) -> int:
    """How long a march is worth to be at most: its band widens, or is above what is known and has
    not settled; 0 where it is at its end.
    """
    usual = LEFT_BY_STEPS + KEPT_BY_STEPS
    if widens_at_end(motion, point):
        return LONGER_WHILE_WIDENING * usual
    above = ends_of_parts(motion, point).max() > known
    return LONGER_WHILE_UNSETTLED * usual if above and not has_settled(motion, point) else 0


def _known_enough(point: Solution, instants: int, motion: np.ndarray) -> bool:
    """A march by steps may end: it has settled, or has grown so far that it is repeated with more
    instants.
    """
    return _grown_too_far(motion, point, instants) or has_settled(motion, point)


def _grown_too_far(motion: np.ndarray, point: Solution, instants: int) -> bool:
    """It is repeated with more instants."""
    again = instants < INSTANTS_BY_STEPS[-1] and lifts_off(point)
    return again and bool(
        amplitudes_of_periods(motion, point.harmonics).max() > GROWN_RATIO * size(point)
    )

"""The resonance of a damper that bounces, sought by marching in time.

Where most contacts lift off several motions exist at one frequency, few of them are periodic, and
balances of the harmonics that are solved at all end on different ones. A march needs neither: the
blade is driven harder than it is for a while and then left to come down, which leads it to the
highest motion that it keeps there. From that the frequency is moved uphill step by step, the motion
taken along, until the amplitude falls on both sides or the blade jumps to a lower motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.ring_march import Drive, driven_anew, state_of_solution
from ...hbm.solution import Solution
from ...util.arrays import RealArray
from ..adaptive.family import Family, family_member
from ..adaptive.resonance_choice import LIFTING_POINTS
from ..adaptive.settings import Settings
from .error_in_time import carried_motion
from .settled_march import (
    CLIMBING_INSTANTS,
    MOST_INSTANTS,
    SETTLED_CHANGE,
    MarchBudget,
    MarchFailedError,
    SettledMotion,
    half_band,
    limited_march,
    settle,
    settle_at,
    settle_calmly,
)
from .uphill_climb import JUMP_SHARE, Top, climb, follow_uphill, highest_uphill, refine_top
from .verdicts import model_in_time, settings_in_time

# Figures behind these limits: docs/verification.md, "Limits of marches and balances".
# excitation over its own for these periods, before the blade comes up from below
UNDERDRIVE = 0.8
UNDERDRIVEN_PERIODS = 25
# change by half the step in time, of a layer that stiffens, below which steps are short enough
LARGEST_STEP_CHANGE = 0.05
# relative error from which nothing is known: the blade might as well stand still
LARGEST_ERROR = 1.0
# steps towards a jump with more contact points
FINER_STEPS = 2
# relative change by more contact points, above which their resonance may be at another frequency
MOVED_BY_POINTS = 0.1
# times the contact points that judge a resonance: twice as many may change it less than all do
MORE_POINTS = 4
# times as many with a layer that stiffens: its steps take more, most of all in the first period on
# other contact points, by which a march is judged (3 times on ground faces under 36 N)
MORE_WITH_LAW = 3.0


@dataclass(frozen=True)
class ResonanceInTime:
    """The highest motion that marches from frequency to frequency ended on."""

    # [Hz]
    frequency: float
    # amplitudes of single periods, as those of ``KeptBand`` [m]
    lowest: float
    highest: float
    # of the highest, estimated and relative: by the contact points, by where marches start, by
    # their steps in time, by the width of the band; inf where not even that is known
    error: float
    # on each seat
    points: int
    # frequencies that were marched at, and periods at all of them
    frequencies: int
    periods: int
    # of a blade's dampers in a period, mean of the periods whose amplitudes count [J]
    friction_work: float = np.nan
    # with the law of a layer that stiffens, whose tangent the balances have
    by_law: bool = False

    @property
    def sentence(self) -> str:
        """What was found, in words."""
        return (
            f"the blade keeps between {1e6 * self.lowest:.4g} and {1e6 * self.highest:.4g} um at "
            f"{self.frequency:.5g} Hz ({self.frequencies} frequencies, {self.periods} periods)"
        )


@dataclass(frozen=True)
class _Reported:
    """The resonance that is reported, with the contact points of a seat (None: all) that it was
    marched with, and its estimated relative error but for the way that is left to its limit.
    """

    best: SettledMotion
    points: int | None
    error: float


def resonance_in_time(
    models: Family,
    settings: Settings,
    motion: Solution,
    decay: RealArray | None = None,
) -> ResonanceInTime | None:
    """The resonance next to a motion of the balance; None where marching is not possible, takes too
    long, or leads nowhere.

    Args:
        motion: the highest one of the balance, of these settings.
        decay: (n,) of ``contact.equivalent_layer.decay_lengths`` for the finest elements [m]: the
            marches follow the law of the layer, where the balance has its tangent; None for a
            linear layer.
    """
    points = LIFTING_POINTS if "points" in settings.chosen else settings.points
    settings_here = settings_in_time(models, replace(settings, points=points))
    try:
        model = _marched_model(models, settings_here, decay)
        start = motion
        if len(family_member(models, settings).model.springs) != len(model.springs):
            start = carried_motion(models, settings, motion, settings_here)
        work = MarchBudget(1.0 if model.decay is None else MORE_WITH_LAW)
        top, error = _by_short_steps(model, start, work)
        reported = _with_more_points(
            models, settings_here, decay, _Reported(top.best, points, error), top, work
        )
        finest = _marched_model(models, replace(settings_here, points=reported.points), decay)
        best = settle_calmly(finest, reported.best, work)
    except (InputError, MarchFailedError):
        return None
    error = reported.error + best.left
    return ResonanceInTime(
        best.omega / (2 * np.pi),
        best.lowest,
        best.highest,
        error if error < LARGEST_ERROR else float(np.inf),
        reported.points or _most_points(models, settings_here),
        len(work.frequencies),
        work.periods,
        best.friction_work,
        model.decay is not None,
    )


def _marched_model(models: Family, settings: Settings, decay: RealArray | None) -> ReducedModel:
    """The model of marches, with the law of its layer where that stiffens."""
    model = model_in_time(models, settings)
    if decay is None or not np.isfinite(decay).any():
        return model
    # elements are on one seat each, which has one length
    groups = family_member(models, settings).groups
    return replace(model, decay=decay[np.unique(groups, return_index=True)[1]])


def _by_short_steps(model: ReducedModel, start: Solution, work: MarchBudget) -> tuple[Top, float]:
    """The highest motion uphill of a start, and its estimated relative error but for that by the
    contact points, by steps so short that half of them change it little.

    How short they have to be depends on how stiff the contacts become where they are pressed: a
    layer that stiffens may be some hundred times stiffer in an impact than at rest.

    Raises:
        MarchFailedError: it was not closed in, or no steps were short enough.
    """
    state = state_of_solution(model, start)
    while True:
        top = highest_uphill(model, state, work)
        above = top.best
        top = replace(top, best=settle(model, above.state, work, work.final_instants))
        if top.jump:
            # the frequency of a jump depends on the steps in time
            work.instants = work.final_instants
            top = refine_top(model, top, work)
        best = top.best
        if model.decay is None and best.resolved:
            return top, _error(model, top, above, work)
        instants = work.final_instants
        finer = settle(model, best.state, work, 2 * instants)
        change = abs(finer.mean / best.mean - 1)
        # no two periods are alike in a wide band, which the error contains as well
        tolerated = max(LARGEST_STEP_CHANGE, half_band(best))
        if model.decay is None or change < tolerated:
            return top, _error(model, top, above, work) + change
        if 4 * instants > MOST_INSTANTS or work.exhausted:
            raise MarchFailedError
        state = finer.state
        work.shorten_steps(2 * instants)


def _error(model: ReducedModel, top: Top, above: SettledMotion, work: MarchBudget) -> float:
    """Estimated relative error of the highest amplitude, but for those by the contact points, by
    the steps in time, and by the way that is left to the limit.

    Args:
        above: what the climb ended on, with longer steps in time, on its way down.
    """
    if not top.closed_in:
        return float(np.inf)
    best = top.best
    below = driven_anew(model, best.state, Drive(best.omega, UNDERDRIVE))
    below = limited_march(model, below, UNDERDRIVEN_PERIODS, work).end
    from_below = settle(model, driven_anew(model, below, Drive(best.omega)), work)
    # a motion at another frequency, or another one to which the blade fell, says nothing
    others = [one for one in (above, from_below) if one.omega == best.omega]
    changes = [abs(one.mean / best.mean - 1) for one in others if one.mean > JUMP_SHARE * best.mean]
    error = max([SETTLED_CHANGE, *changes])
    # single periods that are higher may come
    return error + half_band(best) + top.left


def _with_more_points(
    models: Family,
    settings: Settings,
    decay: RealArray | None,
    few: _Reported,
    top: Top,
    work: MarchBudget,
) -> _Reported:
    """The resonance with MORE_POINTS times the contact points. What these change is more than what
    is left to all of them where the change is of first order.

    Where they change much they have their own resonance, which is sought; where the blade jumps it
    is followed as far as these points let it. Where it does not keep the motion with them the
    change is taken next to it, twice, and the resonance stays what it was.

    Args:
        few: of the top, with the contact points of the settings.
    """
    points, most = settings.points, _most_points(models, settings)
    if points is None or points >= most or not top.closed_in:
        return few
    finer = MORE_POINTS * points if MORE_POINTS * points < most else None
    model = _marched_model(models, replace(settings, points=finer), decay)
    if decay is None:
        work.instants = CLIMBING_INSTANTS
    best, neighbour = top.best, top.neighbour
    found = settle_at(model, best, best.omega, work)
    if found.mean > JUMP_SHARE * best.mean:
        if not top.jump and abs(found.mean / best.mean - 1) > MOVED_BY_POINTS:
            return _sought_anew(model, few, found, finer, top, work)
        if top.jump:
            found = refine_top(model, replace(top, best=found), work, FINER_STEPS).best
        return _Reported(found, finer, few.error + abs(found.mean / best.mean - 1))
    found = settle_at(model, neighbour, neighbour.omega, work)
    if found.mean < JUMP_SHARE * neighbour.mean:
        return replace(few, error=float(np.inf))
    beside = 1 - neighbour.mean / best.mean
    change = abs(found.mean / neighbour.mean - 1)
    if decay is None:
        return replace(few, error=few.error + 2 * change + beside)
    # few points of a layer that stiffens as it is pressed are too few for its resonance itself
    away = neighbour.omega - best.omega
    found = follow_uphill(model, found, away, work, FINER_STEPS)
    return _Reported(found, finer, few.error + change + beside)


def _sought_anew(
    model: ReducedModel,
    few: _Reported,
    found: SettledMotion,
    points: int | None,
    top: Top,
    work: MarchBudget,
) -> _Reported:
    """The resonance of more contact points uphill of what they keep where fewer have theirs.

    Its error is that of these points, and what they change from one resonance to the other.

    Args:
        found: at the frequency of the top.
        points: of a seat; None for all.
        top: of fewer points.
    """
    before = top.best
    try:
        again = climb(model, found, top.bend, work, top.neighbour.omega > before.omega)
    except MarchFailedError:
        return _Reported(found, points, few.error + abs(found.mean / before.mean - 1))
    change = abs(again.best.mean / before.mean - 1)
    return _Reported(again.best, points, _error(model, again, again.best, work) + change)


def _most_points(models: Family, settings: Settings) -> int:
    """Contact points of a seat of the richest model; there are two seats."""
    return -(-len(family_member(models, replace(settings, points=None)).groups) // 2)

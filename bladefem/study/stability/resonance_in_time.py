"""The resonance of a damper that bounces, sought by marching in time.

Where most contacts lift off several motions exist at one frequency, few of them are periodic, and
balances of the harmonics that are solved at all end on different ones. A march needs neither: the
blade is driven harder than it is for a while and then left to come down, which leads it to the
highest motion that it keeps there. From that the frequency is moved uphill step by step, the motion
taken along, until the amplitude falls on both sides or the blade jumps to a lower motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import InputError
from ...hbm.envelope import PERIODS_OF_PART, first_amplitudes, way_to_limit
from ...hbm.model import ReducedModel
from ...hbm.peak_ripples import bend_of_mode
from ...hbm.ring_march import (
    INSTANTS_PER_PERIOD,
    Drive,
    RingMarch,
    RingState,
    driven_anew,
    march_ring,
    never_enough,
    state_of_solution,
    steps_are_resolved,
)
from ...hbm.solution import Solution
from ...util.arrays import RealArray
from ...util.curve_extremum import parabola_at_middle
from ..adaptive.family import Family, family_member
from ..adaptive.resonance_choice import LIFTING_POINTS
from ..adaptive.settings import Settings
from .error_in_time import carried_motion
from .kept_band import amplitudes_of_periods
from .verdicts import model_in_time, settings_in_time

# Figures behind these limits: docs/verification.md, "Limits of marches and balances".
# excitation over its own for these periods, before the blade comes down to what it keeps: from
# above it ends on the higher of two motions, from below it creeps up
OVERDRIVE = 2.0
OVERDRIVEN_PERIODS = 50
# the same from below
UNDERDRIVE = 0.8
UNDERDRIVEN_PERIODS = 25
# instants of a period of a climb, where steps of that length are short enough for the bodies on
# their contacts; its end has INSTANTS_PER_PERIOD
CLIMBING_INSTANTS = 128
# with a layer that stiffens, most instants of a period: steps are halved until they are short
# enough for the stiffness that it reaches, and the search is begun anew from what shorter ones keep
# until twice as many instants change its end by less than a share
MOST_INSTANTS = 2048
LARGEST_STEP_CHANGE = 0.05
# after which a motion is taken as it is
MOST_PERIODS = 396
# relative error from which nothing is known: the blade might as well stand still
LARGEST_ERROR = 1.0
# relative change that is none: of the ends of the band of amplitudes, from one part of a march to
# the next, and on the way to the limit of the mean amplitude
SETTLED_CHANGE = 5e-3
# of the width of a band: change of its ends that bouncing alone makes
SETTLED_BAND_SHARE = 0.25
# periods whose amplitudes count
COUNTED_PERIODS = 50
# half width of a band of amplitudes, over its highest, from which the end of a search is marched on
# for CALMING_PERIODS: no two periods are alike there, and whether such a motion has come down is
# not seen in the parts of a short march
WIDE_BAND = 0.03
CALMING_PERIODS = 300
# harmonics of which the amplitude of a period is made
HARMONICS = 7
# step of the frequency, over the half width of the resonance
STEP_SHARE = 0.5
MOST_STEPS = 10
# share of the amplitude before, below which a step has led to another motion: along one it falls by
# some 11 %
JUMP_SHARE = 0.7
# steps towards a jump with more contact points
FINER_STEPS = 2
# relative change by more contact points, above which their resonance may be at another frequency
MOVED_BY_POINTS = 0.1
# relative gain of height by the vertex of a parabola that is marched as well
WORTH_A_MARCH = 0.01
# times the contact points that judge a resonance: twice as many may change it less than all do
MORE_POINTS = 4
# operations of a search, some 40 s
MOST_OPERATIONS = 4e11
# of one march with MOST_PERIODS, of which most need a third
MOST_OF_ONE_MARCH = 8e11
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
        """What was done and found."""
        law = " with the law of the layer" if self.by_law else ""
        return (
            "most contacts lift off, and the harmonic balance does not give the resonance; it was "
            f"sought by integration in time (marching){law}, with {self.points} contact points a "
            f"seat, at {self.frequencies} frequencies for {self.periods} periods: at "
            f"{self.frequency:.5g} Hz the blade keeps between {1e6 * self.lowest:.4g} and "
            f"{1e6 * self.highest:.4g} um"
        )


@dataclass(frozen=True)
class _Settled:
    """What the blade keeps to under a drive."""

    omega: float
    # amplitudes of single periods [m]; bouncing ones scatter, motions are compared by their mean
    lowest: float
    mean: float
    highest: float
    state: RingState
    # steps were short enough for forces that are linear in them
    resolved: bool
    # relative way that the mean seems to have left
    left: float
    # of a blade's dampers in a period, mean of these periods [J]
    friction_work: float

    @property
    def expected(self) -> float:
        """The mean at the lower end of what it seems to come to [m]."""
        return self.mean * (1 - self.left)


@dataclass(frozen=True)
class _Top:
    """Where a climb ended."""

    best: _Settled
    # a lower motion next to it
    neighbour: _Settled
    # second derivative of 1 / height^2 by the circular frequency, of the blade alone
    bend: float
    # circular frequency on the other side, from that of the best motion on, at which the blade has
    # jumped to a lower one; 0 where the amplitude falls smoothly on both sides
    jump: float = 0.0
    # nothing higher is expected next to it
    closed_in: bool = True

    @property
    def rise_ahead(self) -> float:
        """Relative rise that is possible before the jump, by the slope up to here."""
        run = abs(self.best.omega - self.neighbour.omega)
        return (self.best.mean / self.neighbour.mean - 1) * abs(self.jump) / run

    @property
    def rise_behind(self) -> float:
        """Relative rise that is possible towards the neighbour, by a parabola of 1 / height^2
        through both, bent as that of the blade alone: the blade may have come from above.
        """
        run = abs(self.best.omega - self.neighbour.omega)
        higher = self.neighbour.mean**-2 - self.best.mean**-2
        vertex = run / 2 - higher / (self.bend * run)
        return self.bend / 4 * (max(vertex, 0.0) * self.best.mean) ** 2 if self.jump else 0.0

    @property
    def left(self) -> float:
        """Relative rise that may have been missed."""
        return max(self.rise_ahead, self.rise_behind)


@dataclass(frozen=True)
class _Reported:
    """The resonance that is reported, with the contact points of a seat (None: all) that it was
    marched with, and its estimated relative error but for the way that is left to its limit.
    """

    best: _Settled
    points: int | None
    error: float


@dataclass
class _Work:
    """What a search has taken so far, and how it marches."""

    # times MOST_OPERATIONS and MOST_OF_ONE_MARCH that it may take
    allowance: float = 1.0
    instants: int = CLIMBING_INSTANTS
    # of the motion that is reported
    final_instants: int = INSTANTS_PER_PERIOD
    operations: float = 0.0
    periods: int = 0
    frequencies: set[float] = field(default_factory=set)

    def shorten_steps(self, instants: int) -> None:
        """March with so many instants a period at least from now on."""
        self.instants = max(self.instants, instants)
        self.final_instants = max(self.final_instants, instants)

    @property
    def exhausted(self) -> bool:
        """No more may be marched."""
        return self.operations > self.allowance * MOST_OPERATIONS


class _MarchFailedError(Exception):
    """The forces of a step were not found, or the search was not closed in."""


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
        work = _Work(1.0 if model.decay is None else MORE_WITH_LAW)
        top, error = _by_short_steps(model, start, work)
        reported = _with_more_points(
            models, settings_here, decay, _Reported(top.best, points, error), top, work
        )
        finest = _marched_model(models, replace(settings_here, points=reported.points), decay)
        best = _calmed(finest, reported.best, work)
    except (InputError, _MarchFailedError):
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


def _by_short_steps(model: ReducedModel, start: Solution, work: _Work) -> tuple[_Top, float]:
    """The highest motion uphill of a start, and its estimated relative error but for that by the
    contact points, by steps so short that half of them change it little.

    How short they have to be hangs on how stiff the contacts become where they are pressed: a layer
    that stiffens may be some hundred times stiffer in an impact than at rest.

    Raises:
        _MarchFailedError: it was not closed in, or no steps were short enough.
    """
    state = state_of_solution(model, start)
    while True:
        top = _highest(model, state, work)
        above = top.best
        top = replace(top, best=_settled(model, above.state, work, work.final_instants))
        if top.jump:
            # the frequency of a jump hangs on the steps in time
            work.instants = work.final_instants
            top = _refined(model, top, work)
        best = top.best
        if model.decay is None and best.resolved:
            return top, _error(model, top, above, work)
        instants = work.final_instants
        finer = _settled(model, best.state, work, 2 * instants)
        change = abs(finer.mean / best.mean - 1)
        # no two periods are alike in a wide band, which the error contains as well
        tolerated = max(LARGEST_STEP_CHANGE, _half_band(best))
        if model.decay is None or change < tolerated:
            return top, _error(model, top, above, work) + change
        if 4 * instants > MOST_INSTANTS or work.exhausted:
            raise _MarchFailedError
        state = finer.state
        work.shorten_steps(2 * instants)


def _highest(model: ReducedModel, state: RingState, work: _Work) -> _Top:
    """The highest motion uphill of a start; driven hard once more where that has led far away.

    Raises:
        _MarchFailedError: it was not closed in.
    """
    omega = state.drive.omega
    bend = bend_of_mode(model, omega)
    if bend <= 0:
        raise _MarchFailedError
    here = _overdriven(model, state, omega, work)
    width = np.sqrt(2 / bend)
    top = _climbed(model, here, bend, work)
    if abs(top.best.omega - here.omega) * here.mean < width:
        return top
    again = _overdriven(model, top.best.state, top.best.omega, work)
    if JUMP_SHARE * again.mean < top.best.mean:
        return top
    return _climbed(model, again, bend, work)


def _overdriven(model: ReducedModel, state: RingState, omega: float, work: _Work) -> _Settled:
    """What the blade keeps to after it was driven harder."""
    state = driven_anew(model, state, Drive(omega, OVERDRIVE))
    state = _march(model, state, OVERDRIVEN_PERIODS, work).end
    return _settled(model, driven_anew(model, state, Drive(omega)), work)


def _climbed(
    model: ReducedModel, start: _Settled, bend: float, work: _Work, upwards: bool = True
) -> _Top:
    """The highest motion uphill of a start, by steps of the circular frequency.

    Args:
        upwards: higher frequencies are tried first; uphill there, lower ones are not.

    Raises:
        _MarchFailedError: it was not closed in.
    """
    step = STEP_SHARE * np.sqrt(2 / bend) / start.mean
    known = {0: start}
    for side in (1, -1) if upwards else (-1, 1):
        place = side
        while abs(place) <= MOST_STEPS and not work.exhausted:
            omega = start.omega + place * step
            known[place] = _moved(model, known[place - side], omega, work)
            if known[place].mean < known[place - side].mean:
                break
            place += side
        if abs(place) > 1:
            # uphill on this side: the other one is known
            break
    place = max(known, key=lambda k: known[k].mean)
    if place - 1 not in known or place + 1 not in known:
        raise _MarchFailedError
    best = known[place]
    lower, neighbour = sorted((known[place - 1], known[place + 1]), key=lambda one: one.mean)
    if lower.expected > JUMP_SHARE * best.mean:
        return _with_vertex(model, best, (lower, neighbour), bend, work)
    return _refined(model, _Top(best, neighbour, bend, lower.omega - best.omega), work)


def _with_vertex(
    model: ReducedModel,
    best: _Settled,
    beside: tuple[_Settled, _Settled],
    bend: float,
    work: _Work,
) -> _Top:
    """The top where the amplitude falls smoothly from the best motion on both sides."""
    low, high = sorted(beside, key=lambda one: one.omega)
    found = _at_vertex(model, best, low, high, work)
    top = max(best, found, key=lambda one: one.mean)
    neighbour = max(beside, key=lambda one: one.mean)
    # one that is far higher than its neighbours has a resonance of its own
    return _Top(top, neighbour, bend, closed_in=neighbour.mean > JUMP_SHARE * top.mean)


def _at_vertex(
    model: ReducedModel, best: _Settled, low: _Settled, high: _Settled, work: _Work
) -> _Settled:
    """The motion at the vertex of 1 / height^2 through three; the best of these where that is not
    expected to be higher.
    """
    left, right = best.omega - low.omega, high.omega - best.omega
    level = best.mean**-2
    slope, half = parabola_at_middle(left, right, low.mean**-2 - level, high.mean**-2 - level)
    if half <= 0 or slope**2 / (4 * half) < 2 * WORTH_A_MARCH * level or work.exhausted:
        return best
    return _moved(model, best, best.omega - slope / (2 * half), work)


def _refined(model: ReducedModel, top: _Top, work: _Work, most: int = MOST_STEPS) -> _Top:
    """The highest motion before the blade jumps to a lower one: the ways to the jump and to the
    neighbour are halved, the one that promises more, until neither promises much.

    A blade that has jumped after a large step may follow in a small one: in the end the frequency
    of the jump is marched again, and what is beyond it where the blade follows.
    """
    for _ in range(most):
        best = top.best
        if work.exhausted:
            return replace(top, closed_in=False)
        if top.left < WORTH_A_MARCH:
            found = _moved(model, best, best.omega + top.jump, work)
            if found.mean <= best.mean:
                return replace(top, closed_in=True)
            top = _Top(found, best, top.bend, 2 * top.jump)
            continue
        ahead = top.rise_ahead >= top.rise_behind
        way = top.jump if ahead else top.neighbour.omega - best.omega
        found = _moved(model, best, best.omega + way / 2, work)
        if found.mean > best.mean:
            # the one left behind becomes the end of the other way
            jump, beside = (way / 2, best) if ahead else (-way / 2, top.neighbour)
            top = _Top(found, beside, top.bend, jump)
        elif not ahead:
            top = replace(top, neighbour=found)
        elif found.expected > JUMP_SHARE * best.mean:
            # what fell far below was a steep flank
            return _with_vertex(model, best, (found, top.neighbour), top.bend, work)
        else:
            top = replace(top, jump=way / 2)
    return replace(top, closed_in=False)


def _error(model: ReducedModel, top: _Top, above: _Settled, work: _Work) -> float:
    """Estimated relative error of the highest amplitude, but for those by the contact points, by
    the steps in time, and by the way that is left to the limit.

    Args:
        above: what the climb ended on, with longer steps in time, on its way down.
    """
    if not top.closed_in:
        return float(np.inf)
    best = top.best
    below = driven_anew(model, best.state, Drive(best.omega, UNDERDRIVE))
    below = _march(model, below, UNDERDRIVEN_PERIODS, work).end
    from_below = _settled(model, driven_anew(model, below, Drive(best.omega)), work)
    # a motion at another frequency, or another one to which the blade fell, says nothing
    others = [one for one in (above, from_below) if one.omega == best.omega]
    changes = [abs(one.mean / best.mean - 1) for one in others if one.mean > JUMP_SHARE * best.mean]
    error = max([SETTLED_CHANGE, *changes])
    # single periods that are higher may come
    return error + _half_band(best) + top.left


def _half_band(found: _Settled) -> float:
    """Half width of the band of amplitudes, over its highest."""
    return (found.highest - found.lowest) / (2 * found.highest)


def _with_more_points(
    models: Family,
    settings: Settings,
    decay: RealArray | None,
    few: _Reported,
    top: _Top,
    work: _Work,
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
    found = _moved(model, best, best.omega, work)
    if found.mean > JUMP_SHARE * best.mean:
        if not top.jump and abs(found.mean / best.mean - 1) > MOVED_BY_POINTS:
            return _sought_anew(model, few, found, finer, top, work)
        if top.jump:
            found = _refined(model, replace(top, best=found), work, FINER_STEPS).best
        return _Reported(found, finer, few.error + abs(found.mean / best.mean - 1))
    found = _moved(model, neighbour, neighbour.omega, work)
    if found.mean < JUMP_SHARE * neighbour.mean:
        return replace(few, error=float(np.inf))
    beside = 1 - neighbour.mean / best.mean
    change = abs(found.mean / neighbour.mean - 1)
    if decay is None:
        return replace(few, error=few.error + 2 * change + beside)
    # few points of a layer that stiffens as it is pressed are too few for its resonance itself
    away = neighbour.omega - best.omega
    found = _followed_uphill(model, found, away, work)
    return _Reported(found, finer, few.error + change + beside)


def _sought_anew(
    model: ReducedModel,
    few: _Reported,
    found: _Settled,
    points: int | None,
    top: _Top,
    work: _Work,
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
        again = _climbed(model, found, top.bend, work, top.neighbour.omega > before.omega)
    except _MarchFailedError:
        return _Reported(found, points, few.error + abs(found.mean / before.mean - 1))
    change = abs(again.best.mean / before.mean - 1)
    return _Reported(again.best, points, _error(model, again, again.best, work) + change)


def _followed_uphill(
    model: ReducedModel, start: _Settled, step: float, work: _Work, most: int = FINER_STEPS
) -> _Settled:
    """The highest motion of a few steps of the circular frequency, up to the first that falls."""
    best = start
    for _ in range(most):
        found = _moved(model, best, best.omega + step, work)
        if found.mean <= best.mean:
            break
        best = found
    return best


def _calmed(model: ReducedModel, found: _Settled, work: _Work) -> _Settled:
    """What the blade keeps to after many more periods, where no period is like another.

    Raises:
        _MarchFailedError: the forces of a step were not found, or the march takes too long.
    """
    if _half_band(found) < WIDE_BAND:
        return found
    return _end_of(_march(model, found.state, CALMING_PERIODS, work))


def _most_points(models: Family, settings: Settings) -> int:
    """Contact points of a seat of the richest model; there are two seats."""
    return -(-len(family_member(models, replace(settings, points=None)).groups) // 2)


def _moved(model: ReducedModel, before: _Settled, omega: float, work: _Work) -> _Settled:
    """What the blade keeps to when the frequency is moved."""
    return _settled(model, driven_anew(model, before.state, Drive(omega)), work)


def _settled(
    model: ReducedModel,
    state: RingState,
    work: _Work,
    instants: int | None = None,
) -> _Settled:
    """What the blade keeps to from a state on.

    Raises:
        _MarchFailedError: the forces of a step were not found, or the march takes too long.
    """
    work.frequencies.add(state.drive.omega)
    return _end_of(_march(model, state, MOST_PERIODS, work, instants, _has_settled))


def _end_of(march: RingMarch) -> _Settled:
    """What the last periods of a march keep to."""
    heights = amplitudes_of_periods(march.motion, HARMONICS)
    counted = min(COUNTED_PERIODS, len(heights) // 2)
    last = heights[-counted:]
    ends = float(last.min()), float(last.mean()), float(last.max())
    left = _left_to_limit(march.motion)
    spent = float(march.friction_work[-counted:].mean())
    return _Settled(march.end.drive.omega, *ends, march.end, march.resolved, left, spent)


def _march(
    model: ReducedModel,
    state: RingState,
    periods: int,
    work: _Work,
    instants: int | None = None,
    enough: Callable[[RealArray], bool] = never_enough,
) -> RingMarch:
    """A march with the instants that were asked for, those of the search when None, or with those
    of the motion that is reported where these are too few for the bodies on their contacts; with
    more where a layer becomes too stiff for them.

    Raises:
        _MarchFailedError: the forces of a step were not found, or the march takes too long.
    """
    instants = instants or work.instants
    if not steps_are_resolved(model, state.drive.omega, instants):
        instants = max(instants, work.final_instants)
    leaps = enough is not never_enough
    most = work.allowance * MOST_OF_ONE_MARCH
    while True:
        march = march_ring(model, state, periods, instants, enough, most, leaps)
        work.operations += march.operations * march.periods / periods
        work.periods += march.periods
        found = march.settled and bool(np.isfinite(march.motion).all())
        if march.operations > most:
            raise _MarchFailedError
        if found and (model.decay is None or march.resolved):
            return march
        if model.decay is None or 2 * instants > MOST_INSTANTS:
            raise _MarchFailedError
        instants *= 2
        work.shorten_steps(instants)


def _has_settled(motion: RealArray) -> bool:
    """The last two thirds of a march keep to one band, and the means of all thirds have come to
    their limit.
    """
    if len(motion) < 3 * PERIODS_OF_PART:
        return False
    third = len(motion) // 3
    heights = amplitudes_of_periods(motion[-2 * third :], HARMONICS).reshape(2, -1)
    if not np.isfinite(heights).all():
        return False
    ends = np.column_stack([heights.min(axis=1), heights.max(axis=1)])
    width = float(ends[1, 1] - ends[1, 0])
    steady = max(SETTLED_CHANGE * ends.max(), SETTLED_BAND_SHARE * width)
    moved = float(abs(np.diff(ends, axis=0)).max())
    return moved <= steady and _left_to_limit(motion) <= SETTLED_CHANGE


def _left_to_limit(motion: RealArray) -> float:
    """Relative way from the mean amplitude of the last third of a march to its limit."""
    third = len(motion) // 3
    if third == 0:
        return 0.0
    means = [complex(first_amplitudes(motion[-k * third :][:third]).mean()) for k in (3, 2, 1)]
    return abs(way_to_limit(means) / means[-1])

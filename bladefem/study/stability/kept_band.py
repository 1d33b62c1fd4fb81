"""What the blade does where its motion is unstable: marched in time from there, and the amplitudes
between which it keeps.

Contacts with one tangential direction and blades in phase are marched exactly between changes of
contact state (`bladefem.time.event_integrator`), others by steps (`bladefem.hbm.ring_march`), both
on the same reduced model as the balance. Of a travelling wave all blades are marched, after which
it repeats.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...damper.branch import state_of
from ...errors import InputError, NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.ring_march import (
    PERIODS_AT_ONCE,
    march_operations,
    march_ring,
    state_of_solution,
    steps_are_resolved,
)
from ...hbm.solution import Solution, lifts_off, size
from ...hbm.time_model import time_system
from ...time.event_integrator import State, Trajectory, integrate_periods
from ...util.durations import core_time
from ..adaptive.family import Family
from ..adaptive.indicators import moved_solution
from ..adaptive.settings import Settings
from .verdicts import JUDGED_OPTIONS, in_one_body, model_in_time, settings_in_time

# disturbance of the unstable motion at the start, relative
DISTURBANCE_SHARE = 1e-3
# periods before the amplitudes are taken, and those in which they are
LEFT_PERIODS = 300
KEPT_PERIODS = 100
# instants of a period
SAMPLES_PER_PERIOD = 256
# steps of the whole march above which it is not begun: some 20 s
MAX_STEPS = 4e6
SECONDS_PER_STEP = 5e-6

# Marches by steps. Figures behind their limits: docs/verification.md, "Limits of marches and
# balances".
# operations, as estimated, above which a march is not begun: fewer contact points are tried
MAX_MARCH = 1.5e11
# operations that the first period shows to be needed above which it is given up, some 30 s; the
# second where no fewer contact points are left to march with
MAX_COUNTED = 3e11
SECONDS_PER_OPERATION = 30.0 / MAX_COUNTED
MAX_COUNTED_LAST = 6e11
# periods before the amplitudes are taken, and those in which they are
LEFT_BY_STEPS = 150
KEPT_BY_STEPS = 50
# contact points of a patch below which a march is given up rather than made coarser
FEWEST_POINTS = 4
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
# relative change of the ends of a band, from one PERIODS_AT_ONCE to the next, that is none
SETTLED_BAND = 2e-3
# of a march, each of PERIODS_AT_ONCE, that tell whether its band stays
PARTS = 3
# growth of the width of a band, in two parts of a march, from which it goes on: slow ripples grow
# by a few per cent a period
GROWING_RATIO = 1.1
# of the amplitude: a width that is none, whatever it was before
NO_WIDTH = 1e-6
# periods of a march whose band widens, at most, over those that it has otherwise
LONGER_WHILE_WIDENING = 4
# the same of one that has not settled and is above what is known
LONGER_WHILE_UNSETTLED = 2
# relative width of a band that is one periodic motion
ONE_MOTION = 2e-3


@dataclass(frozen=True)
class KeptBand:
    """Amplitudes of single periods, as root of the sum of squares of the harmonics at the probe of
    each blade.
    """

    # [Hz]
    frequency: float
    # [m]
    lowest: float
    highest: float
    # periods marched
    periods: int
    # why nothing was marched; else ""
    reason: str = ""
    # on each patch, where a model with fewer of them was marched
    points: int | None = None
    # nothing was marched because it takes too long
    too_long: bool = False
    # it went on widening to the end of the march
    widens: bool = False
    # its ends did not stay to the end of the march: a way down from an unstable motion, which may
    # bounce without a period for hundreds of periods, or a motion that never settles
    unsettled: bool = False
    # times its own excitation by which the blade was driven before, and the amplitude that it keeps
    # at most without that [m]
    drive: float = 1.0
    without_drive: float = np.nan
    # of a blade's dampers in a period, mean of the periods whose amplitudes count [J]
    friction_work: float = np.nan

    def farthest(self, amplitude: float) -> float:
        """Relative distance of the farther end from an amplitude; NaN where it is not known."""
        return max(abs(end / amplitude - 1) for end in (self.lowest, self.highest))

    def holds(self, amplitude: float, accuracy: float) -> bool:
        """It is known, and within a relative accuracy of an amplitude."""
        return not self.reason and self.farthest(amplitude) <= accuracy

    @property
    def sentence(self) -> str:
        """What is known."""
        if self.reason:
            return f"what the blade does there is not known: {self.reason}"
        coarse = "" if self.points is None else f" with {self.points} contact points a seat"
        more = ", and the band still widens" if self.widens else ""
        if self.drive > 1:
            coarse += f" after {self.drive:g} times its excitation"
            more += f", without such a start {1e6 * self.without_drive:.4g} um at most"
        if self.highest <= (1 + ONE_MOTION) * self.lowest:
            return (
                f"marched in time{coarse}, it ends on a motion of {1e6 * self.highest:.4g} um there"
                f"{more}"
            )
        return (
            f"marched in time{coarse} over {self.periods} periods, it keeps between "
            f"{1e6 * self.lowest:.4g} and {1e6 * self.highest:.4g} um there{more}"
        )


def kept_of_family(models: Family, settings: Settings, point: Solution) -> KeptBand:
    """``kept_band``, with fewer contact points where a march with all of them takes too long.

    The amplitudes of the coarser model are multiplied by what the finer one has more of them at the
    unstable motion. Where that motion is not solved with fewer points, the march with the last ones
    with which it was gets as many operations as one with the fewest points.
    """
    fewer = settings
    too_long: tuple[Settings, Solution] | None = None
    while True:
        most = _has_fewest_points(fewer)
        model = model_in_time(models, settings_in_time(models, fewer))
        if most or affordable_march(model):
            moved = _with_points(models, settings, point, fewer)
            if moved is None:
                break
            counted = MAX_COUNTED_LAST if most else MAX_COUNTED
            band = _kept_with(models, settings, point, fewer, moved, counted)
            if most or not band.too_long:
                return band
            too_long = (fewer, moved)
        fewer = replace(fewer, points=max(FEWEST_POINTS, (fewer.points or 0) // 2))
    if too_long is None:
        return _unknown_band(point, "its motion with fewer contact points was not solved")
    return _kept_with(models, settings, point, *too_long, MAX_COUNTED_LAST)


def _has_fewest_points(settings: Settings) -> bool:
    """A march with fewer contact points is not tried."""
    return settings.points is None or settings.points <= FEWEST_POINTS


def _with_points(
    models: Family, settings: Settings, point: Solution, fewer: Settings
) -> Solution | None:
    """The motion with other contact points, which is only where a march starts: None where it is
    not solved in a few steps from there. All ways to it would take longer than the march.
    """
    if fewer == settings:
        return point
    moved = moved_solution(models, settings, point, fewer, JUDGED_OPTIONS)
    return moved if moved.converged else None


def _kept_with(
    models: Family,
    settings: Settings,
    point: Solution,
    fewer: Settings,
    moved: Solution,
    counted: float,
) -> KeptBand:
    """What the blade keeps to after an unstable motion, marched with other contact points.

    Args:
        moved: the motion with these.
        counted: operations that a march by steps may need, as its first periods show.
    """
    model = model_in_time(models, settings_in_time(models, fewer))
    band = kept_band(model, moved, counted)
    if fewer == settings:
        return band
    ratio = size(point) / size(moved)
    return replace(scaled_band(band, ratio), points=fewer.points)


def affordable_march(model: ReducedModel) -> bool:
    """A march by steps is not too long, or not possible at all."""
    try:
        return march_operations(model, LEFT_BY_STEPS + KEPT_BY_STEPS) <= MAX_MARCH
    except InputError:
        return True


def kept_band(model: ReducedModel, point: Solution, counted: float = MAX_COUNTED) -> KeptBand:
    """The band of amplitudes that the model keeps to after an unstable motion.

    Args:
        counted: operations that a march by steps may need, as its first periods show.
    """
    return exact_band(model, point) or band_by_steps(model, point, counted)


def exact_band(model: ReducedModel, point: Solution) -> KeptBand | None:
    """Band of amplitudes by event-exact integration; None where contacts have two tangents, or
    waves travel.
    """
    try:
        system = time_system(in_one_body(model), point.harmonics)
    except InputError:
        return None
    periods = LEFT_PERIODS + KEPT_PERIODS
    steps = periods * max(SAMPLES_PER_PERIOD, 2 * np.pi * system.fastest / point.omega)
    if steps > MAX_STEPS:
        return _unknown_band(point, _too_long(steps * SECONDS_PER_STEP))
    start = state_of(point, system)
    state = State((1 + DISTURBANCE_SHARE) * start.q, start.v, start.z)
    left = integrate_periods(system, point.omega, state, SAMPLES_PER_PERIOD, LEFT_PERIODS)
    state, marched, per_period = left.state, LEFT_PERIODS, steps / periods
    while True:
        kept = integrate_periods(system, point.omega, state, SAMPLES_PER_PERIOD, KEPT_PERIODS)
        if kept.reason != "done":
            return _unknown_band(point, kept.reason)
        state, marched = kept.state, marched + KEPT_PERIODS
        motion = (kept.q @ system.probe[0]).reshape(KEPT_PERIODS, SAMPLES_PER_PERIOD)
        most = min(LONGER_WHILE_WIDENING * periods, MAX_STEPS / per_period)
        widens = _widens(motion[:, None], point)
        if not widens or marched + KEPT_PERIODS > most:
            spent = float(_work_of_friction(kept) / KEPT_PERIODS)
            return replace(_band_of(point, motion, marched, spent), widens=widens)


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
        known: amplitude above which the blade is marched on until its band has settled [m].
    """
    band = before = _unknown_band(point, "nothing was marched")
    left = False
    try:
        tried = _instants_to_try(model, point.omega)
    except InputError as error:
        return _unknown_band(point, str(error))
    for instants in tried:
        usual = instants == INSTANTS_BY_STEPS[0]
        periods = (LEFT_BY_STEPS, KEPT_BY_STEPS) if usual else REFINED_PERIODS
        try:
            found, resolved = _band_with(model, point, instants, *periods, counted, known)
        except (InputError, NotSolvedError) as error:
            return _unknown_band(point, str(error))
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


def _too_long(seconds: float) -> str:
    """Why a march was not made, in what a user can judge and change."""
    return (
        f"a march takes {core_time(seconds)} of one core, longer than is spent on it; fewer "
        "contact.points or model.modes shorten it"
    )


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


def _band_with(
    model: ReducedModel,
    point: Solution,
    instants: int,
    left: int,
    kept: int,
    counted: float,
    known: float,
) -> tuple[KeptBand, bool]:
    """The band by so many instants a period, and whether steps were short enough for forces that
    are linear in them.

    Args:
        known: as that of `band_by_steps`.
    """
    enough = partial(_known_enough, point, instants)
    start = state_of_solution(model, point, DISTURBANCE_SHARE)
    march = march_ring(model, start, left + kept, instants, enough, counted)
    if march.operations > counted:
        reason = _too_long(march.operations * SECONDS_PER_OPERATION)
        return replace(_unknown_band(point, reason), too_long=True), march.resolved
    motion, spent = march.motion, march.friction_work
    affordable = (left + kept) * counted / march.operations
    ended = len(motion) < left + kept
    while not ended and march.settled and len(motion) + kept <= affordable:
        periods = _worthwhile_periods(motion, point, known)
        if len(motion) + kept > periods or _grown_too_far(motion, point, instants):
            break
        march = march_ring(model, march.end, kept, instants)
        motion = np.concatenate([motion, march.motion])
        spent = np.concatenate([spent, march.friction_work])
    if not (march.settled and np.isfinite(motion).all()):
        reason = "the contact forces of a step of the march were not found"
        return _unknown_band(point, reason), march.resolved
    widens = not ended and _widens(motion, point)
    unsettled = not _has_settled(motion, point)
    if unsettled and not widens and np.isfinite(known):
        # what has no period is not known by a few of them
        kept = PARTS * PERIODS_AT_ONCE
    first = len(motion) - (PERIODS_AT_ONCE if ended else kept)
    band = _band_of(point, motion[first:], len(motion), float(spent[first:].mean()))
    return replace(band, widens=widens, unsettled=unsettled), march.resolved


def _worthwhile_periods(motion: np.ndarray, point: Solution, known: float) -> int:
    """How long a march is worth to be at most: its band widens, or is above what is known and has
    not settled; 0 where it is at its end.
    """
    usual = LEFT_BY_STEPS + KEPT_BY_STEPS
    if _widens(motion, point):
        return LONGER_WHILE_WIDENING * usual
    above = _ends_of_parts(motion, point).max() > known
    return LONGER_WHILE_UNSETTLED * usual if above and not _has_settled(motion, point) else 0


def _known_enough(point: Solution, instants: int, motion: np.ndarray) -> bool:
    """A march by steps may end: it has settled, or has grown so far that it is repeated with more
    instants.
    """
    return _grown_too_far(motion, point, instants) or _has_settled(motion, point)


def _has_settled(motion: np.ndarray, point: Solution) -> bool:
    """The last parts of a march keep to one band that they drift to no faster than before and that
    does not widen.
    """
    ends = _ends_of_parts(motion, point)
    if len(ends) < PARTS or not np.isfinite(ends).all():
        return False
    before, now = abs(np.diff(ends, axis=0)).max(axis=1)
    return bool(now <= min(before, SETTLED_BAND * ends.max())) and not _widens(motion, point)


def _grown_too_far(motion: np.ndarray, point: Solution, instants: int) -> bool:
    """It is repeated with more instants."""
    again = instants < INSTANTS_BY_STEPS[-1] and lifts_off(point)
    return again and bool(
        amplitudes_of_periods(motion, point.harmonics).max() > GROWN_RATIO * size(point)
    )


def _widens(motion: np.ndarray, point: Solution) -> bool:
    """The band of the last part of a march is wider than two parts before: a ripple that is seen at
    different phases of it need not widen from each part to the next.
    """
    ends = _ends_of_parts(motion, point)
    widths = np.diff(ends, axis=1).ravel()
    grows = widths[-1] > max(GROWING_RATIO * widths[0], NO_WIDTH * ends.max())
    return len(ends) == PARTS and bool(grows)


def _ends_of_parts(motion: np.ndarray, point: Solution) -> np.ndarray:
    """Lowest and highest amplitude [m] in each of the last PARTS of a march at most."""
    amplitudes = amplitudes_of_periods(motion[-PARTS * PERIODS_AT_ONCE :], point.harmonics)
    parts = amplitudes.reshape(-1, PERIODS_AT_ONCE * amplitudes.shape[-1])
    return np.column_stack([parts.min(axis=1), parts.max(axis=1)])


def amplitudes_of_periods(motion: np.ndarray, harmonics: int) -> np.ndarray:
    """Root of the sum of squares of harmonics 1..H, from motion (..., samples of a period) [m]."""
    lines = 2 / motion.shape[-1] * np.fft.rfft(motion, axis=-1)[..., 1 : harmonics + 1]
    return np.asarray(np.linalg.norm(lines, axis=-1))


def scaled_band(band: KeptBand, ratio: float) -> KeptBand:
    """The band of a model whose amplitudes are larger by a ratio.

    Friction work is in proportion to the amplitude, as is the work of the excitation at a
    resonance.
    """
    return replace(
        band,
        lowest=ratio * band.lowest,
        highest=ratio * band.highest,
        friction_work=ratio * band.friction_work,
    )


def _band_of(point: Solution, motion: np.ndarray, periods: int, friction_work: float) -> KeptBand:
    """From motion (..., samples of a period) at the probe."""
    amplitudes = amplitudes_of_periods(motion, point.harmonics)
    ends = float(amplitudes.min()), float(amplitudes.max())
    return KeptBand(point.frequency, *ends, periods, friction_work=friction_work)


def _work_of_friction(path: Trajectory) -> float:
    """Work of the friction forces along a trajectory, by the trapezoidal rule [J]."""
    means = (path.force[1:] + path.force[:-1]) / 2
    return float(np.sum(means * np.diff(path.w, axis=0)))


def _unknown_band(point: Solution, reason: str) -> KeptBand:
    return KeptBand(point.frequency, np.nan, np.nan, 0, reason)

"""Motions that a blade keeps only where it was driven hard before.

A damper that bounces can have a second, higher motion beside the one that the blade comes to from
rest. Under 8 N plane blades keep 5.1 um at 1028 Hz, and 7.1 um where an excitation 16 times as
strong, for 25 periods, has gone before: no balance that is followed from the lower motion, and no
march from it, leads there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.peak_ripples import bend_of_mode
from ...hbm.ring_march import (
    INSTANTS_PER_PERIOD,
    Drive,
    RingState,
    driven_anew,
    march_operations,
    march_ring,
    state_of_solution,
)
from ...hbm.solution import Solution, lifts_off
from ..adaptive.check_points import heights_of
from ..adaptive.checked_curve import CheckedCurve
from ..adaptive.resonance_choice import LIFTING_POINTS
from .error_in_time import Marches, carried_motion
from .kept_band import KeptBand, amplitudes_of_periods
from .verdicts import model_in_time, settings_in_time

# Figures behind these limits: docs/verification.md, "Limits of marches and balances".
# excitation over its own, and periods of it: weaker, stronger or longer drives lead to the higher
# motion at fewer frequencies
STRONG_DRIVE = 16.0
DRIVEN_PERIODS = 25
# share of the highest motion of a curve from which another is driven from, and how many of them,
# evenly over their frequencies
NEARLY_AS_HIGH = 0.9
MOST_FREQUENCIES = 8
# periods marched at once, after which it is asked whether the blade is back on the motion known
PERIODS_OF_LOOK = 150
# what the blade does at first is its way down; after FEWEST_LOOKS it may be back. What is still
# above it is marched to the end: bursts may die out only after a thousand periods
FEWEST_LOOKS = 2
MOST_LOOKS = 12
# that count at the end: without a period single looks have amplitudes three times apart
COUNTED_LOOKS = 6
# relative rise above what is known that is none
NO_RISE = 0.02
# step of the frequency uphill, over the half width of the resonance, and how many of them
STEP_SHARE = 0.25
MOST_STEPS = 10
# what is given has to last these with short steps as well: beats may last with long ones that die
# out with these
FINE_INSTANTS = 1024
FINE_LOOKS = 4
# operations of all marches of a curve that end at once, some 7 s of plane blades with eight points
# a seat; the shipped wedge would need more
MOST_OPERATIONS = 1.5e10


@dataclass(frozen=True)
class StrongDrives:
    """What strong drives near the top of a curve lead to."""

    # a point of the curve, and what the blade keeps to at its frequency; None where that is no
    # higher than the resonance
    point: Solution | None = None
    kept: KeptBand | None = None
    # contacts lift off, and nothing was marched because it takes too long
    too_long: bool = False


@dataclass(frozen=True)
class KeptMotion:
    """What a march came to."""

    band: KeptBand
    # amplitude of the periods that count [m]
    mean: float
    # at its end
    state: RingState


def strong_drives(
    marches: Marches,
    curve: CheckedCurve,
    given: float,
) -> StrongDrives:
    """The highest motion that strong drives near the top of a curve lead to, where contacts lift
    off there.

    Args:
        given: amplitude of the resonance [m].
    """
    heights = heights_of(curve.points)
    lifts = [lifts_off(p) for p in curve.points]
    high = np.flatnonzero((heights >= NEARLY_AS_HIGH * heights.max()) & np.array(lifts))
    if not len(high):
        return StrongDrives()
    settings = settings_in_time(marches.models, curve.settings)
    if "points" in settings.chosen and settings.points is not None:
        # four keep 10.8 um under 20 N at 1023 Hz, where eight and a march of other code end on 10.4
        settings = replace(settings, points=max(settings.points, LIFTING_POINTS))
    try:
        model = model_in_time(marches.models, settings)
        of_look = march_operations(model, PERIODS_OF_LOOK)
    except InputError:
        return StrongDrives()
    # those that come back to what is known take FEWEST_LOOKS
    affordable = min(MOST_FREQUENCIES, int(MOST_OPERATIONS / (FEWEST_LOOKS * of_look)))
    if affordable == 0:
        return StrongDrives(too_long=True)
    best: tuple[Solution, KeptMotion] | None = None
    for point in _evenly([curve.points[i] for i in high], affordable):
        known = (1 + NO_RISE) * (given if best is None else best[1].band.highest)
        start = carried_motion(marches.models, curve.settings, point, settings)
        kept = after_strong_drive(model, start, known)
        if kept is not None:
            best = point, kept
    if best is None:
        return StrongDrives()
    point, kept = _uphill(model, [p for p in curve.points if p.converged], *best, given)
    if not _lasts_with_short_steps(model, point, kept.state, (1 + NO_RISE) * given):
        return StrongDrives()
    return StrongDrives(point, replace(kept.band, without_drive=given))


def _evenly(points: list[Solution], count: int) -> list[Solution]:
    """So many of the points at most, evenly over their frequencies, ascending."""
    omega = np.array([point.omega for point in points])
    wanted = np.linspace(omega.min(), omega.max(), count)
    chosen = {int(abs(omega - place).argmin()) for place in wanted}
    return sorted((points[i] for i in chosen), key=lambda point: point.omega)


def after_strong_drive(
    model: ReducedModel,
    point: Solution,
    known: float,
) -> KeptMotion | None:
    """What the blade keeps to at the frequency of a motion after it was driven hard; None where
    that is no higher than what is known, or where the forces of a step are not found. The
    last COUNTED_LOOKS count.

    Args:
        known: amplitude above which a motion counts [m].

    Raises:
        InputError: the model cannot be marched.
    """
    start = driven_anew(model, state_of_solution(model, point), Drive(point.omega, STRONG_DRIVE))
    march = march_ring(model, start, DRIVEN_PERIODS, INSTANTS_PER_PERIOD)
    return _kept_from(model, point, march.end, known) if march.settled else None


def _kept_from(
    model: ReducedModel, point: Solution, state: RingState, known: float
) -> KeptMotion | None:
    """What the blade keeps to at the frequency of a point from a state on, under its own drive;
    None where that is no higher than what is known.
    """
    state = driven_anew(model, state, Drive(point.omega))
    ends: list[tuple[float, float]] = []
    means: list[float] = []
    spent: list[float] = []
    for look in range(MOST_LOOKS):
        march = march_ring(model, state, PERIODS_OF_LOOK, INSTANTS_PER_PERIOD)
        if not march.settled:
            return None
        state = march.end
        heights = amplitudes_of_periods(march.motion, point.harmonics)
        ends.append((float(heights.min()), float(heights.max())))
        means.append(float(heights.mean()))
        spent.append(float(march.friction_work.mean()))
        if look + 1 >= FEWEST_LOOKS and ends[-1][1] <= known:
            return None
    lowest, highest = zip(*ends[-COUNTED_LOOKS:], strict=True)
    periods = MOST_LOOKS * PERIODS_OF_LOOK
    band = KeptBand(
        point.frequency,
        min(lowest),
        max(highest),
        periods,
        drive=STRONG_DRIVE,
        friction_work=float(np.mean(spent[-COUNTED_LOOKS:])),
    )
    return KeptMotion(band, float(np.mean(means[-COUNTED_LOOKS:])), state)


def _uphill(
    model: ReducedModel,
    points: Sequence[Solution],
    point: Solution,
    kept: KeptMotion,
    given: float,
) -> tuple[Solution, KeptMotion]:
    """The highest motion on the way from frequency to frequency, the motion taken along: where the
    damper bounces it may be kept from points that a strong drive leads elsewhere from.

    Args:
        points: of the curve, whose frequencies are taken.
        given: amplitude of the resonance that is known without a strong drive [m].
    """
    bend = bend_of_mode(model, point.omega)
    if bend <= 0:
        return point, kept
    step = STEP_SHARE * np.sqrt(2 / bend) / kept.mean
    for side in (1, -1):
        start, moved = point, 0
        while moved < MOST_STEPS:
            ahead = [p for p in points if side * (p.omega - point.omega) > 0]
            if not ahead:
                break
            near = _at(ahead, point.omega + side * step)
            found = _kept_from(model, near, kept.state, (1 + NO_RISE) * given)
            if found is None or found.band.highest <= kept.band.highest:
                break
            point, kept, moved = near, found, moved + 1
        if point is not start:
            break
    return point, kept


def _lasts_with_short_steps(
    model: ReducedModel, point: Solution, state: RingState, known: float
) -> bool:
    """The blade stays above what is known from a state on."""
    march = march_ring(model, state, FINE_LOOKS * PERIODS_OF_LOOK, FINE_INSTANTS)
    last = amplitudes_of_periods(march.motion[-PERIODS_OF_LOOK:], point.harmonics)
    return march.settled and bool(last.max() > known)


def _at(points: Sequence[Solution], omega: float) -> Solution:
    """The point nearest to a circular frequency."""
    return min(points, key=lambda point: abs(point.omega - omega))

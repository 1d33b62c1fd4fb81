"""Motions that a blade keeps only where it was driven hard before.

A damper that bounces can have a second, higher motion beside the one that the blade comes to from
rest. Under 8 N plane blades keep 5.1 um at 1028 Hz, and 7.1 um where an excitation 16 times as
strong, for 25 periods, has gone before: no balance that is followed from the lower motion, and no
march from it, leads there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.ring_march import (
    INSTANTS_PER_PERIOD,
    Drive,
    driven_anew,
    march_operations,
    march_ring,
    state_of_solution,
)
from ...hbm.solution import Solution
from ..adaptive.check_points import heights_of
from ..adaptive.choice import Checked
from ..adaptive.resonance_choice import LIFTING_POINTS
from .error_in_time import Marches, carried_motion
from .kept_band import KeptBand, amplitudes_of_periods
from .stability import model_in_time, settings_in_time

# excitation over its own, and periods of it: of plane blades under 8 N, at eight frequencies from
# 1025 to 1032 Hz, 2 and 4 times lead to the higher motion never, 8 times at one, 16 times at seven,
# 32 times at six, and over 50 periods 16 and 32 times at four and three
STRONG_DRIVE = 16.0
DRIVEN_PERIODS = 25
# share of the highest motion of a curve from which another is driven from, and how many of them,
# evenly over their frequencies
NEARLY_AS_HIGH = 0.9
MOST_FREQUENCIES = 8
# periods marched at once, after which it is asked whether the blade is back on the motion known
PERIODS_OF_LOOK = 150
# what the blade does at first is its way down; what is still higher after the last look is kept.
# Bursts under 3 N end only after a thousand periods
FEWEST_LOOKS = 2
MOST_LOOKS = 12
# the same with short steps, which what was found has to last: in an explicit march of plane blades
# under 20 N beats last with 500 steps a period that die out with 1000
FINE_INSTANTS = 1024
FINE_LOOKS = 4
# relative rise over the resonance that counts
WORTHWHILE_RISE = 0.02
# operations of all marches of a curve, some 8 s of plane blades with eight points a seat. The
# shipped wedge would need more: under 18, 36, 73 and 121 N, 8 times its excitation led to no
# other motion at two to seven frequencies
MOST_OPERATIONS = 1.5e10


def band_of_strong_drives(
    marches: Marches,
    curve: Checked,
    given: float,
) -> tuple[Solution, KeptBand] | None:
    """The highest motion that strong drives near the top of a curve lead to, and the point of the
    curve at its frequency; None where contacts stay closed, or nothing is higher, or marches take
    too long.

    Args:
        given: amplitude of the resonance [m].
    """
    heights = heights_of(curve.points)
    lifts = [p.states["lift"] > 0 for p in curve.points]
    high = np.flatnonzero((heights >= NEARLY_AS_HIGH * heights.max()) & np.array(lifts))
    if not len(high):
        return None
    settings = curve.settings
    if "points" in settings.chosen and settings.points is not None:
        settings = replace(settings, points=max(settings.points, LIFTING_POINTS))
    settings = settings_in_time(marches.models, settings)
    try:
        model = model_in_time(marches.models, settings)
        of_look = march_operations(model, PERIODS_OF_LOOK)
    except InputError:
        return None
    # those that come back to what is known take FEWEST_LOOKS
    affordable = min(MOST_FREQUENCIES, int(MOST_OPERATIONS / (FEWEST_LOOKS * of_look)))
    if affordable == 0:
        return None
    best: tuple[Solution, KeptBand] | None = None
    for point in _evenly([curve.points[i] for i in high], affordable):
        known = (1 + WORTHWHILE_RISE) * (given if best is None else best[1].highest)
        start = carried_motion(marches.models, curve.settings, point, settings)
        band = band_after_strong_drive(model, start, known)
        if band is not None:
            best = point, replace(band, without_drive=given)
    return best


def _evenly(points: list[Solution], count: int) -> list[Solution]:
    """So many of the points at most, evenly over their frequencies, ascending."""
    omega = np.array([point.omega for point in points])
    wanted = np.linspace(omega.min(), omega.max(), count)
    chosen = {int(abs(omega - place).argmin()) for place in wanted}
    return sorted((points[i] for i in chosen), key=lambda point: point.omega)


def band_after_strong_drive(
    model: ReducedModel,
    point: Solution,
    known: float,
) -> KeptBand | None:
    """What the blade keeps to at the frequency of a motion after it was driven hard; None where
    that is no higher than what is known, or where the forces of a step are not found.

    Args:
        known: amplitude above which a motion counts [m].

    Raises:
        InputError: the model cannot be marched.
    """
    start = driven_anew(model, state_of_solution(model, point), Drive(point.omega, STRONG_DRIVE))
    march = march_ring(model, start, DRIVEN_PERIODS, INSTANTS_PER_PERIOD)
    state = driven_anew(model, march.end, Drive(point.omega))
    for instants, looks in ((INSTANTS_PER_PERIOD, MOST_LOOKS), (FINE_INSTANTS, FINE_LOOKS)):
        for look in range(1, looks + 1):
            if not march.settled:
                return None
            march = march_ring(model, state, PERIODS_OF_LOOK, instants)
            state = march.end
            heights = amplitudes_of_periods(march.motion, point.harmonics)
            if look >= FEWEST_LOOKS and heights.max() <= known:
                return None
    lowest, highest = float(heights.min()), float(heights.max())
    periods = (MOST_LOOKS + FINE_LOOKS) * PERIODS_OF_LOOK
    return KeptBand(point.frequency, lowest, highest, periods, drive=STRONG_DRIVE)

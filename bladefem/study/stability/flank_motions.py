"""What the blade keeps to beside a resonance: marches from unstable motions nearly as high.

A ripple that is weak at the resonance may grow far from a flank of it, and lead to more than the
resonance. Where every motion along a flat top is unstable, the blade may keep most of another local
maximum of it than of the highest (docs/stability.md, F38 and F40).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...hbm.solution import Solution
from ...hbm.stability import UNSTABLE
from ...util.arrays import RealArray
from ..adaptive.check_points import heights_of
from ..adaptive.checked_curve import CheckedCurve
from .error_in_time import Marches
from .kept_band import KeptBand
from .march_by_steps import band_by_steps
from .verdicts import Stability, model_in_time, settings_in_time

# share of the resonance amplitude from which an unstable motion is marched from
NEARLY_AS_HIGH = 0.9
# local maxima of a curve that are marched from
MAX_MAXIMA = 4
# steps to better neighbours: where the blade bounces the ends of bands scatter, and one of some
# neighbours is always a little higher
MAX_STEPS_BESIDE = 3
# operations that one march may need: 0.7 s of the shipped wedge, up to 2 s with stiff layers
MAX_COUNTED = 3e10


@dataclass(frozen=True)
class FlankMotions:
    """The highest band of amplitudes beside a resonance."""

    # an unstable motion of the curve, and what the blade keeps to after it; None where no march is
    # known
    point: Solution | None = None
    kept: KeptBand | None = None
    # why marches from such motions are not known; "" where they are, or there are none
    reason: str = ""

    @property
    def highest(self) -> float:
        """Highest amplitude of a period [m]; 0 where none is known."""
        return 0.0 if self.kept is None else self.kept.highest


def flank_motions(
    marches: Marches,
    curve: CheckedCurve,
    marks: Stability,
    given: float,
    known: Solution | None = None,
) -> FlankMotions:
    """March from unstable motions that are NEARLY_AS_HIGH as the resonance: the highest, each local
    maximum, the one with the largest multiplier, both ends of their range, and the neighbours of
    one that was marched from already. Where the best of them is beyond the resonance, then from its
    neighbours, as long as one of these is better.

    Args:
        given: amplitude of the resonance [m].
        known: a point of the curve that was marched from already.
    """
    heights = heights_of(curve.points)
    high = (marks.verdict == UNSTABLE) & (heights >= NEARLY_AS_HIGH * given)
    places = [int(i) for i in np.flatnonzero(high) if curve.points[i] is not known]
    if not places:
        return FlankMotions()
    try:
        model = model_in_time(marches.models, settings_in_time(marches.models, curve.settings))
    except InputError:
        return FlankMotions()
    first = [
        max(places, key=lambda i: heights[i]),
        *_local_maxima(heights, places),
        max(places, key=lambda i: marks.multiplier[i]),
        places[0],
        places[-1],
    ]
    if len(places) < np.count_nonzero(high):
        at = next(k for k, i in enumerate(np.flatnonzero(high)) if curve.points[i] is known)
        first += places[max(0, at - 1) : at + 1]
    bands: dict[int, KeptBand] = {}

    def march(numbers: list[int]) -> None:
        for i in dict.fromkeys(numbers):
            # what is above is no way down: it has settled, or lasts
            above = max([given, *(band.highest for band in bands.values() if not band.reason)])
            bands[i] = band_by_steps(model, curve.points[i], MAX_COUNTED, above)
            if bands[i].too_long:
                return

    march(first)
    best = _highest(bands)
    for _ in range(MAX_STEPS_BESIDE):
        if best is None or bands[best].highest <= given:
            break
        at = places.index(best)
        beside = [i for i in places[max(0, at - 1) : at + 2] if i not in bands]
        if not beside or any(band.too_long for band in bands.values()):
            break
        march(beside)
        best = _highest(bands)
    reason = next((band.reason for band in bands.values() if band.reason), "")
    if best is None:
        return FlankMotions(reason=reason)
    return FlankMotions(curve.points[best], bands[best], reason)


def _local_maxima(heights: RealArray, places: list[int]) -> list[int]:
    """The MAX_MAXIMA highest of the places that are higher than the points on both sides."""
    around = np.concatenate([[0.0], heights, [0.0]])
    maxima = [i for i in places if heights[i] > max(around[i], around[i + 2])]
    return sorted(maxima, key=lambda i: -heights[i])[:MAX_MAXIMA]


def _highest(bands: dict[int, KeptBand]) -> int | None:
    """The number with the highest amplitude of those that are known."""
    known = [i for i, band in bands.items() if not band.reason]
    return max(known, key=lambda i: bands[i].highest) if known else None

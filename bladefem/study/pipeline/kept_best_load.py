"""The best load of the motions that the blade keeps, where the search compared others.

The search (`bladefem.study.pipeline.best_load`) follows balances along the load. Where the one
under its load is unstable, the blade keeps to another amplitude, and the load at which that is the
lowest may be another one: the lowest balance of the shipped wedge is 150 um, under 79.7 N, where
the blade keeps 148 um; it keeps 140 um under 73 N.

Two branches mostly cross there, so that the lowest point is a corner, and the parabola through the
loads studied may miss it by several percent. What bounds it is that the resonance is convex around
its minimum, in logarithms of load and amplitude: between two loads it lies above the lines through
the pairs of loads on either side, and where these lines meet is the next load to study.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...util.arrays import RealArray
from .assemble_model import LoadCase
from .best_load import BestLoad, KeptLoad, ends_of_range, studied_load
from .curve import Curve
from .loads import Search, StudiedLoads, in_order, lower_studied

# of the accuracy: what a further load may gain in amplitude for it not to be studied
TOLERANCE_SHARE = 0.5
# of the accuracy: estimated error up to which resonances are compared. Of plane blades with several
# motions, whose errors are 70 to 90 %, the lowest of twelve loads was one where the highest motion
# had not been found
COMPARED_ERROR_SHARE = 2.0
# rounds in which loads are studied in addition
MAX_ROUNDS = 4
# digits of such a load: more of them depend on the last digits of resonances that bounce
DIGITS = 3
# relative distance from a load studied within which they have one digit more
TOO_NEAR = 0.01
# ratio of two neighbours, one of them the lowest, from which the load between them is studied as
# well. Lines through loads so far apart bound nothing: of the shipped wedge, from 36 to 69.7 N, the
# bound was 2.4 or 2.6 % by the last digits, and the chart's line 40 % above the resonance
WIDE_GAP = 1.7
# of a load at the end of those studied: how much farther the next one lies
OUTWARD_FACTOR = 1.5
# of the range between two loads, from each of them, in which none is studied
MARGIN = 0.05
# relative distance from a load whose resonance is not known well enough, within which another load
# tells as little. A run proposed 21 N three times over: its error of 21 % took no part in a
# comparison at an accuracy of 10 %
UNKNOWN_NEARBY = 0.02


class _Proposal(NamedTuple):
    """Where a lower resonance may lie."""

    # [N]
    load: float
    # by how much it may be lower there, relative; infinite where nothing tells
    gain: float


def study_kept_loads(
    studied: StudiedLoads,
    searches: Sequence[Search],
    curves_of: Callable[[list[LoadCase]], list[Curve]],
    accuracy: float,
) -> StudiedLoads:
    """The studied loads with as many more as tell which of the motions that the blade keeps is the
    lowest, and the best loads with that one; unchanged where the blade keeps to the balances of the
    search.

    Args:
        searches: one a best load, for the cases of their masses.
        curves_of: the responses of load cases.
        accuracy: of the amplitude, relative.
    """
    for _ in range(MAX_ROUNDS):
        cases = [
            search.case_at(load)
            for search, best in zip(searches, studied.best, strict=True)
            for load in _next_loads(best, studied.curves, accuracy)
        ]
        if not cases:
            break
        studied = in_order(studied, list(zip(cases, curves_of(cases), strict=True)))
    found = [_with_kept_load(best, studied.curves, accuracy) for best in studied.best]
    return studied._replace(best=found)


def _next_loads(best: BestLoad, curves: Sequence[Curve], accuracy: float) -> list[float]:
    """Loads [N] to study in addition: where the resonance may be the lowest, and in the middle of a
    wide gap beside the lowest known; none where that is not worth its time.
    """
    own = _comparable(best, curves, accuracy)
    if not own:
        return []
    loads, heights = _loads_and_heights(own)
    proposal = _proposal(loads, heights)
    load = _rounded(proposal.load)
    if any(abs(load / one - 1) < TOO_NEAR for one in loads):
        # beside a load studied fewer digits may lead to its other side
        load = float(f"{proposal.load:.4g}")
    if load in loads or not best.searched[0] <= load <= best.searched[1]:
        return []
    every = [c.load for c in curves if c.mass == best.mass]
    unknown = [one for one in every if one not in loads]
    if any(abs(load / one - 1) <= UNKNOWN_NEARBY for one in unknown):
        return []
    if proposal.gain <= TOLERANCE_SHARE * accuracy:
        return []
    lowest = float(loads[heights.argmin()])
    middles = _middles_of_gaps(sorted(every), lowest, load)
    low, high = best.searched
    return [load, *(middle for middle in middles if low <= middle <= high)]


def _middles_of_gaps(known: Sequence[float], lowest: float, added: float) -> list[float]:
    """Loads [N] in the middle of wide gaps between the neighbours of the lowest resonance; none
    where it is at an end of those studied.

    Args:
        known: ascending, the loads studied.
        lowest: that of the lowest resonance.
        added: the load that is studied next.
    """
    k = known.index(lowest)
    if not 0 < k < len(known) - 1:
        return []
    first, last = known[k - 1], known[k + 1]
    here = [load for load in sorted([*known, added]) if first <= load <= last]
    return [
        _rounded(float(np.sqrt(low * high)))
        for low, high in pairwise(here)
        if high > WIDE_GAP * low
    ]


def _rounded(load: float) -> float:
    return float(f"{load:.{DIGITS}g}")


def _with_kept_load(best: BestLoad, curves: Sequence[Curve], accuracy: float) -> BestLoad:
    """The best load with the one of the lowest motion that the blade keeps, where that is not the
    balance of the search and lies between others.
    """
    own = _comparable(best, curves, accuracy)
    if not own:
        return best
    loads, heights = _loads_and_heights(own)
    lowest = int(heights.argmin())
    gain = _proposal(loads, heights).gain
    if np.isinf(gain):
        return best
    kept = KeptLoad(float(loads[lowest]), gain, _tolerated_loads(loads, heights, accuracy))
    return replace(best, kept=kept)


def _comparable(best: BestLoad, curves: Sequence[Curve], accuracy: float) -> list[Curve]:
    """The curves of the same damper whose resonances are known well enough, by ascending load; none
    where that under the load of the search is not, or where the blade keeps to its balance and no
    other load keeps it lower.
    """
    own = sorted((c for c in curves if c.mass == best.mass), key=lambda c: c.load)
    there = next((c for c in own if c.load == studied_load(best)), None)
    if best.reason or there is None:
        return []
    if there.unstable_peak is None and lower_studied(there, own) is None:
        return []
    known = [c for c in own if c.error is not None and c.error <= COMPARED_ERROR_SHARE * accuracy]
    return known if there in known and len(known) > 1 else []


def _loads_and_heights(curves: Sequence[Curve]) -> tuple[RealArray, RealArray]:
    return np.array([c.load for c in curves]), np.array([c.peak_amplitude for c in curves])


def _proposal(loads: RealArray, heights: RealArray) -> _Proposal:
    """Where the resonance may be lowest; outside the loads studied where the lowest one of them has
    a neighbour on one side only.
    """
    k = int(heights.argmin())
    if k == 0:
        return _Proposal(loads[0] / OUTWARD_FACTOR, np.inf)
    if k == len(loads) - 1:
        return _Proposal(loads[-1] * OUTWARD_FACTOR, np.inf)
    x, y = np.log(loads), np.log(heights)
    right, right_gain = _lowest_on_the_right(x[k - 1 :], y[k - 1 :])
    left, left_gain = _lowest_on_the_right(-x[k + 1 :: -1], y[k + 1 :: -1])
    distance = right if right_gain > left_gain else -left
    gain = -np.expm1(-max(left_gain, right_gain))
    return _Proposal(float(loads[k] * np.exp(distance)), float(gain))


def _lowest_on_the_right(x: RealArray, y: RealArray) -> tuple[float, float]:
    """Where a convex function may be lowest between the second and the third of its points, as a
    distance from the second, which is the lowest one; and by how much it may be lower there.

    Args:
        x: ascending.
        y: values there.
    """
    falls = (y[0] - y[1]) / (x[1] - x[0])
    width = x[2] - x[1]
    rises = (y[3] - y[2]) / (x[3] - x[2]) if len(x) > 3 else np.inf
    # not convex, or nothing beyond: the line through the first two is the only bound
    if y[2] - rises * width > y[1] or np.isinf(rises):
        middle = _minimum_of_parabola(x[:3], y[:3]) - x[1]
        inside = MARGIN * width <= middle <= (1 - MARGIN) * width
        return (middle if inside else width / 2), falls * width
    distance = float((y[1] - y[2] + rises * width) / (falls + rises))
    return float(np.clip(distance, MARGIN * width, (1 - MARGIN) * width)), falls * distance


def _minimum_of_parabola(x: RealArray, y: RealArray) -> float:
    """Where the parabola through three points is lowest, of which the middle one is."""
    slopes = np.diff(y) / np.diff(x)
    curvature = (slopes[1] - slopes[0]) / ((x[2] - x[0]) / 2)
    return float((x[0] + x[1]) / 2 - slopes[0] / curvature) if curvature > 0 else float(x[1])


def _tolerated_loads(loads: RealArray, heights: RealArray, accuracy: float) -> tuple[float, float]:
    """Loads [N] on either side of the lowest resonance at which it has grown by the accuracy, on
    chords between those studied in logarithms: the range of a curve with one minimum is no
    narrower. NaN on a side where none is that high.
    """
    x, y = np.log(loads), np.log(heights / heights.min())

    def crossing(last: int, j: int) -> float:
        share = (np.log1p(accuracy) - y[last]) / (y[j] - y[last])
        return float(np.exp(x[last] + share * (x[j] - x[last])))

    return ends_of_range(heights, accuracy, crossing)

"""The best load of a seat: what a search for it found, which loads do as well, and which are
studied round it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from ...hbm.peak import Peak
from ..adaptive.settings import Settings

# loads of a design chart over the best one: the branch where the damper slides, the optimum, and
# the branch where it sticks
CHART_LOAD_FACTORS = (1 / 8, 1 / 4, 1 / 2, 1.0, 2.0, 4.0, 8.0, 15.0, 30.0)


@dataclass(frozen=True)
class KeptLoad:
    """The load with the lowest resonance of those that the blade keeps."""

    # of a seat [N], one of those studied
    load: float
    # relative, of the amplitude: by how much another load may be lower
    tolerance: float
    # loads between which the amplitude is within the scene's accuracy of the lowest [N]; NaN where
    # none of those studied is as high
    between: tuple[float, float]


@dataclass(frozen=True)
class BestLoad:
    """What the search found; where it failed, ``reason`` says why and the numbers are NaN."""

    # of the damper [kg]; as meshed when None
    mass: float | None
    # mean normal force on each seat [N]
    load: float
    # resonance there [Hz]
    frequency: float
    # [m]
    amplitude: float
    # friction work a period there [J]
    dissipated: float
    # work that the excitation puts in a period there [J]
    input_work: float
    # relative, of the amplitude: how far the search may have stopped above the minimum
    tolerance: float
    # loads between which the amplitude is within the scene's accuracy of the lowest [N]; NaN where
    # the search did not get that far
    between: tuple[float, float]
    # with the estimated error of the amplitude
    settings: Settings
    # (k,) loads that were tried, ascending [N], and the resonance amplitude of each [m]
    tried: np.ndarray
    heights: np.ndarray
    # range of loads that was searched [N]
    searched: tuple[float, float]
    # solved altogether; 0 where the search failed
    points: int
    # empty where the search succeeded
    reason: str = ""
    # what is lowest of the motions that the blade keeps, where it does not keep to the balances
    # that the search compares
    kept: KeptLoad | None = None


def tolerated_loads(tried: Sequence[Peak], accuracy: float) -> tuple[float, float]:
    """Loads [N] on either side of the best one at which the amplitude has grown by the accuracy.

    On the curve through heights and slopes of the peaks that were tried; NaN on a side where none
    of them is that high.

    Args:
        tried: peaks with their loads ascending.
    """
    logs = np.log([peak.value for peak in tried])
    heights = np.array([peak.height for peak in tried])
    slopes = np.array([peak.slope for peak in tried])
    if len(tried) < 2:
        return np.nan, np.nan
    lowest = heights.min()
    curve = CubicHermiteSpline(logs, heights / lowest - 1 - accuracy, slopes / lowest)
    return ends_of_range(
        heights, accuracy, lambda last, j: np.exp(brentq(curve, logs[last], logs[j]))
    )


def ends_of_range(
    heights: np.ndarray,
    accuracy: float,
    crossing: Callable[[int, int], float],
) -> tuple[float, float]:
    """Loads [N] on either side of the lowest resonance at which it has grown by the accuracy; NaN
    on a side where none is that high.

    Args:
        heights: (k,) of ascending loads.
        crossing: of two neighbours, one within the accuracy and one above it, the load between.
    """
    best = int(np.argmin(heights))
    ends = [np.nan, np.nan]
    for i, side in enumerate((range(best - 1, -1, -1), range(best + 1, len(heights)))):
        last = best
        for j in side:
            if heights[j] > (1 + accuracy) * heights[best]:
                ends[i] = float(crossing(last, j))
                break
            last = j
    return ends[0], ends[1]


def chart_loads(bests: Sequence[BestLoad]) -> tuple[float, ...]:
    """Loads of a design chart [N], from an eighth of the best one to thirty times it.

    With several best loads, of several masses, from an eighth of the smallest to thirty times the
    largest, each of them included.
    """
    loads = {
        float(f"{factor * best.load:.2g}")
        for best in bests
        for factor in CHART_LOAD_FACTORS
        if factor != 1.0
    }
    return tuple(sorted(loads | {studied_load(best) for best in bests}))


def studied_load(best: BestLoad) -> float:
    """The best load [N] with the digits with which its response is studied and shown: of the
    motions that the blade keeps, else of the balances of the search.
    """
    return float(f"{best.load:.4g}") if best.kept is None else best.kept.load

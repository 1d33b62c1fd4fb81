"""The highest blade of one pattern, with held mean displacements and with free ones, and the peaks
of many patterns over that of the tuned wheel, like with like.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..util.arrays import BooleanArray, RealArray
from .local_peak import LocalPeak
from .resonance import WheelPeak


@dataclass(frozen=True)
class PatternPeak:
    """The highest blade of a pattern, as a search found it."""

    # over the band, with held means where these may be free
    held: WheelPeak
    # searched again round it with free means; None where they were not asked for, or no balance was
    # found
    free: LocalPeak | None = None
    # free means were asked for
    asked: bool = False

    @property
    def peak(self) -> WheelPeak:
        """The highest point, with free means where these are known."""
        return self.held if self.free is None else self.free.peak


@dataclass(frozen=True)
class ComparedPeaks:
    """Peaks of W patterns next to the tuned wheel's; free means only where both have them."""

    # of the tuned wheel [m]
    tuned: float
    # (W,) [m]
    height: RealArray
    # of the tuned wheel with held means [m]; NaN where free ones were not asked for
    tuned_held: float
    # (W,) amplification with held means [1]
    held_factor: RealArray
    # (W,) True where that with free ones is known
    mean_released: BooleanArray


def compared_peaks(heights: np.ndarray) -> ComparedPeaks:
    """Like over like: with free means where the tuned wheel and the pattern have them. A pattern
    whose balance with free means was not found keeps its amplification with held ones, of both.

    Args:
        heights: (3, 1 + W) of `peak_heights`, the tuned wheel first.
    """
    tuned_held, tuned_free, asked = map(float, heights[:, 0])
    held, free = heights[:2, 1:]
    factor = held / tuned_held
    against = tuned_held if asked else float("nan")
    if np.isnan(tuned_free):
        nowhere = np.zeros(len(held), dtype=bool)
        return ComparedPeaks(tuned_held, held, against, factor, nowhere)
    known = np.isfinite(free)
    height = np.where(known, free, factor * tuned_free)
    return ComparedPeaks(tuned_free, height, against, factor, known)


def peak_heights(found: PatternPeak) -> np.ndarray:
    """(3,) heights with held means and with free ones [m], NaN where these are not known, and
    whether these were asked for.
    """
    free = float("nan") if found.free is None else found.free.peak.height
    return np.array([found.held.height, free, float(found.asked)])

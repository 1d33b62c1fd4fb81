"""The highest amplitude of any blade over a band of frequencies, closed in to a tolerance.

Near a resonance 1/amplitude^2 is a parabola of the frequency: three points predict a maximum, which
is then solved. The search ends when no blade is predicted to gain more than the tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..util.curve_extremum import parabola_at_middle

# points added to the first grid before the search is given up
MAX_ADDED_POINTS = 40
# points closer than this are not distinguished, relative
SAME_POINT = 1e-7

# next to a point that was not solved, where the curve may end in a fold: relative gain of height
# that is not looked for, up to that point and at least over this share of the frequency
LOST_GAIN = 0.01
LEAST_LOOK = 5e-4

# amplitudes (N,) of the blades at a circular frequency, NaN where it was not solved
Respond = Callable[[float], np.ndarray]


@dataclass(frozen=True)
class WheelPeak:
    """The highest point of the response of all blades."""

    # [rad/s]
    omega: float
    # [m]
    height: float
    # number of the blade
    blade: int
    # (N,) highest amplitude of each blade over the points that were solved [m]
    by_blade: np.ndarray
    # (k,) circular frequencies and (k, N) amplitudes of all points, ascending
    omegas: np.ndarray
    sizes: np.ndarray
    # points that were not solved, which the peak leaves out
    unsolved: int

    @property
    def closed_in(self) -> bool:
        """The maximum lies between two points next to it that were solved, or next to one that was
        not, towards which hardly more is to be gained.
        """
        return lost_gain(self.omegas, self.sizes.max(axis=1)) <= LOST_GAIN


def lost_gain(omegas: np.ndarray, heights: np.ndarray) -> float:
    """Relative gain of height from the highest point of a curve towards a point next to it that was
    not solved, on the line that comes from its other side. Zero where both points next to it are
    solved, infinite at an end of the curve or where none is.

    Args:
        omegas: (k,) ascending circular frequencies [rad/s].
        heights: (k,) [m], NaN where a point was not solved.
    """
    top = int(np.nanargmax(heights))
    gain = 0.0
    for side in (-1, 1):
        beside, behind = top + side, top - side
        if not (0 <= beside < len(omegas) and 0 <= behind < len(omegas)):
            return float("inf")
        if np.isfinite(heights[beside]):
            continue
        if not np.isfinite(heights[behind]):
            return float("inf")
        slope = (heights[top] - heights[behind]) / (omegas[top] - omegas[behind])
        ahead = side * max(abs(omegas[beside] - omegas[top]), LEAST_LOOK * omegas[top])
        gain = max(gain, slope * ahead / heights[top])
    return float(gain)


def find_wheel_peak(
    respond: Respond,
    grid: np.ndarray,
    tolerance: float = 5e-3,
) -> WheelPeak:
    """The highest amplitude over a band.

    Args:
        grid: (k,) first circular frequencies, ascending, at least three.
        tolerance: relative gain of height that is not looked for.

    Raises:
        InputError: too few frequencies.
    """
    if len(grid) < 3 or np.any(np.diff(grid) <= 0):
        raise InputError(f"grid of {len(grid)} frequencies: expected at least 3, ascending")
    omegas = [float(w) for w in grid]
    sizes = [respond(w) for w in omegas]
    for _ in range(MAX_ADDED_POINTS + 1):
        order = np.argsort(omegas)
        w = np.array(omegas)[order]
        a = np.array(sizes)[order]
        solved = np.isfinite(a).all(axis=1)
        target, gain = _next_frequency(w[solved], a[solved])
        if target is None or gain <= tolerance or len(omegas) >= len(grid) + MAX_ADDED_POINTS:
            break
        omegas.append(target)
        sizes.append(respond(target))
    heights = np.where(solved[:, None], a, -np.inf)
    point, blade = np.unravel_index(int(np.argmax(heights)), heights.shape)
    return WheelPeak(
        float(w[point]),
        float(heights[point, blade]),
        int(blade),
        heights.max(axis=0),
        w,
        a,
        int((~solved).sum()),
    )


def _next_frequency(w: np.ndarray, a: np.ndarray) -> tuple[float | None, float]:
    """Circular frequency [rad/s] at which the highest maximum of any blade is predicted, and its
    relative gain over the highest point.
    """
    if len(w) < 3:
        return None, 0.0
    y = 1 / np.maximum(a, np.finfo(float).tiny) ** 2
    middle = slice(1, -1)
    is_peak = (a[middle] >= a[:-2]) & (a[middle] >= a[2:])
    left = (w[middle] - w[:-2])[:, None]
    right = (w[2:] - w[middle])[:, None]
    slope, bend = parabola_at_middle(left, right, y[:-2] - y[middle], y[2:] - y[middle])
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.where(bend > 0, -slope / (2 * bend), 0.0)
        # half-way at most: the parabola is the three points' only
        step = np.clip(step, -0.5 * left, 0.5 * right)
        bottom = y[middle] + slope * step + bend * step**2
        predicted = np.where(is_peak & (bottom > 0), bottom, np.inf) ** -0.5
    far = abs(step) > SAME_POINT * w[middle, None]
    predicted = np.where(far, predicted, 0.0)
    i, blade = np.unravel_index(int(np.argmax(predicted)), predicted.shape)
    gain = predicted[i, blade] / a.max() - 1
    if not np.isfinite(gain):
        # a parabola without positive bottom: look at it
        gain = 1.0
    return float(w[1 + i] + step[i, blade]), float(gain)

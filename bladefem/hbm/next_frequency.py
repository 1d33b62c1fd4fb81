"""Where a sweep solves next: a coarse first look, then maxima that are not closed in yet, then
corners of the curve.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np

from ..util.curve_extremum import find_maxima, parabola_at_middle
from .linear_resonances import free_resonances, stuck_resonances
from .model import ReducedModel
from .solution import Solution, size

# height of the response at a solved circular frequency, and its slope with it
Height = Callable[[float], float]
Slope = Callable[[float], float]
# the same for the first look at a model without damping, whose flexibility stuck is all rounding
# there
OFF_RESONANCE_UNDAMPED = 1e-5
# shares of the band, over the accuracy of maxima and of the curve: where two points are nearer,
# what is between them is a jump
FINEST_PEAK_STEP = 1e-4
FINEST_CORNER_STEP = 5e-4
# intervals of the first look at a band
FIRST_LOOK_INTERVALS = 12


def local_maxima(points: list[Solution], probe: int = 0) -> list[Solution]:
    """Those points, sorted by frequency, that are above both neighbours."""
    heights = np.array([size(point, probe) for point in points])
    return [points[i] for i in find_maxima(heights)]


def first_look(model: ReducedModel, band: tuple[float, float]) -> np.ndarray:
    """Circular frequencies of a coarse look at a band: even steps and the resonances of both linear
    limits [rad/s].
    """
    guesses = np.concatenate(
        [
            # a model at rest has none
            np.zeros(0),
            *(
                resonances(model, h)
                for resonances in (free_resonances, stuck_resonances)
                for h in model.excitation
                if h > 0
            ),
        ]
    )
    inside = guesses[(guesses > band[0]) & (guesses < band[1])]
    if not model.damped:
        inside = inside * (1 + OFF_RESONANCE_UNDAMPED)
    grid = np.linspace(*band, FIRST_LOOK_INTERVALS + 1)
    keep = [x for x in grid[1:-1] if not np.any(abs(inside - x) < 0.2 * (grid[1] - grid[0]))]
    return np.unique(np.concatenate([grid[[0, -1]], keep, inside]))


def next_frequency(
    solved: dict[float, Solution],
    height: Height,
    slope: Slope,
    accuracy: tuple[float, float],
) -> float | None:
    """The next frequency to solve: a maximum that is not closed in yet, else the worst corner; None
    when done.
    """
    tried = np.array(sorted(solved))
    curve = accuracy[1]
    omegas = np.array([w for w in tried if solved[w].converged])
    if len(omegas) < 3:
        return None
    finest = FINEST_PEAK_STEP * accuracy[0] * (tried[-1] - tried[0])
    heights = np.array([height(w) for w in omegas.tolist()])
    if not heights.any():
        # a probe that does not move has no curve
        return None
    for target in chain(
        _peak_targets(omegas, heights, slope, accuracy), _corner_targets(omegas, heights, curve)
    ):
        if abs(tried - target).min() > finest:
            return float(target)
    return None


def _peak_targets(
    omegas: np.ndarray,
    heights: np.ndarray,
    slope: Slope,
    accuracy: tuple[float, float],
) -> Iterator[float]:
    peak, curve = accuracy
    for i in find_maxima(heights):
        if heights[i] > curve * heights.max():
            target = _next_to_peak(
                omegas[i - 1 : i + 2], heights[i - 1 : i + 2], slope(float(omegas[i])), peak
            )
            if target is not None:
                yield target


def _next_to_peak(
    omegas: np.ndarray,
    heights: np.ndarray,
    slope: float,
    tolerance: float,
) -> float | None:
    """Where to look next for the maximum enclosed by three points, the middle one with its slope;
    None when known.
    """
    (left, _, right), (up, _, down) = (
        abs(omegas**2 - omegas[1] ** 2),
        (heights[1] / heights) ** 2 - 1,
    )
    # of 1/height^2 over that of the middle, with omega^2
    exact = -slope / heights[1] / omegas[1]
    through, _ = parabola_at_middle(left, right, up, down)
    # sampled friction ripples: the three heights are asked as well
    for tilt in (exact, through):
        bends = (up + tilt * left) / left**2, (down - tilt * right) / right**2
        # not negative; the flatter parabola promises the larger gain
        uphill = bends[int(tilt < 0)]
        if uphill > 0 and tilt**2 / 4 >= tolerance * min(b for b in bends if b > 0):
            if tilt**2 / 4 >= tolerance * uphill:
                return float(np.sqrt(omegas[1] ** 2 - tilt / (2 * uphill)))
            # a jump down next to the maximum, whose parabola leads there in hundreds of steps: the
            # gap is halved, as long as the slope may gain enough in it
            side, gap = (2, right) if tilt < 0 else (0, left)
            if abs(tilt) * gap / 2 >= tolerance:
                return float((omegas[1] + omegas[side]) / 2)
    return None


def _corner_targets(
    omegas: np.ndarray,
    heights: np.ndarray,
    curve: float,
) -> Iterator[float]:
    """Middles of the wider neighbours of points that lie off the line through their neighbours,
    worst first.
    """
    line = heights[:-2] + (heights[2:] - heights[:-2]) * (omegas[1:-1] - omegas[:-2]) / (
        omegas[2:] - omegas[:-2]
    )
    off = abs(heights[1:-1] - line) / heights.max()
    for i in np.argsort(-off):
        if off[i] <= curve:
            return
        left = omegas[i + 1] - omegas[i]
        right = omegas[i + 2] - omegas[i + 1]
        if max(left, right) > FINEST_CORNER_STEP * curve * (omegas[-1] - omegas[0]):
            yield omegas[i + 1] + (right / 2 if right > left else -left / 2)

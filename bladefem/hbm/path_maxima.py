"""Local maxima of a path, closed in on the path itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..errors import NotSolvedError
from .band_path import BandPath, lies_between
from .continuation import PathPoint, follow
from .model import ReducedModel
from .peak import find_peak
from .solution import Solution, size
from .solver.newton import Options

# steps with which a local maximum is closed in
PEAK_STEP = 1e-4
# refinements of one local maximum
MAX_REFINEMENTS = 12
# height of a local maximum over the highest of its path below which it is not closed in
SMALL_MAXIMUM = 0.02
# local maxima of a path that are closed in, the highest ones: a maze of folds has dozens
MAX_CLOSED_IN = 8


def close_in_maxima(
    model: ReducedModel,
    path: BandPath,
    band: tuple[float, float],
    peak: float,
    options: Options,
) -> None:
    """Further points round the highest local maxima, put into the path where they belong."""
    heights = [size(p.solution, options.probe) for p in path.points]
    found = maxima_to_close_in(heights, peak)
    highest = sorted(found, key=lambda i: -heights[i])[:MAX_CLOSED_IN]
    # from the end on: points that are put in move those behind them
    for i in sorted(highest, reverse=True):
        three = path.points[i - 1 : i + 2]
        path.points[i - 1 : i + 2] = _by_slope(model, three, peak, options) or _finer(
            model, three, band, peak, options
        )


def maxima_to_close_in(heights: Sequence[float], peak: float) -> list[int]:
    """Numbers of the local maxima that are not small, and from which the path falls by more than
    the relative accuracy of a peak.
    """
    top = max(heights, default=0.0)
    found = []
    for i in range(1, len(heights) - 1):
        before, here, after = heights[i - 1 : i + 2]
        if here < max(before, after) or here < SMALL_MAXIMUM * top:
            continue
        if here - min(before, after) >= peak * here:
            found.append(i)
    return found


def _by_slope(
    model: ReducedModel,
    three: Sequence[PathPoint],
    peak: float,
    options: Options,
) -> list[PathPoint] | None:
    """Three points with the maximum between them found by its slope, which takes fewer points than
    short steps; None where that leaves the path, or where the frequency turns back in between.
    """
    first, middle, last = three
    turns = (middle.value - first.value) * (last.value - middle.value) <= 0
    if turns or not first.forward == middle.forward == last.forward:
        return None
    point = middle.solution
    simply = replace(options, fallbacks=False, frugal=False)
    try:
        found = find_peak(
            model,
            point.omega,
            point.harmonics,
            point.samples,
            near=point,
            tolerance=peak,
            options=simply,
        )
    except NotSolvedError:
        return None
    before, after = (
        (first, middle)
        if (found.omega - middle.value) * (last.value - middle.value) < 0
        else (middle, last)
    )
    low, high = sorted((before.value, after.value))
    inside = low <= found.omega <= high
    if not inside or not lies_between(before.solution, after.solution, found.solution):
        return None
    top = replace(middle, value=found.omega, solution=found.solution, fold=False)
    if found.omega == middle.value or found.height <= size(point, options.probe):
        return list(three)
    return [first, top, middle, last] if before is first else [first, middle, top, last]


def _finer(
    model: ReducedModel,
    three: Sequence[PathPoint],
    band: tuple[float, float],
    peak: float,
    options: Options,
) -> list[PathPoint]:
    """Three points with a maximum inside, and what lies between them by shorter steps."""
    probe = options.probe
    first, _, last = three
    length = abs(three[1].value - first.value) + abs(last.value - three[1].value)
    step = max(length / (band[1] - band[0]) / 8, PEAK_STEP)
    options = replace(options, frugal=False)
    found = [first]
    try:
        for point in follow(
            model,
            "omega",
            first.solution,
            (0.99 * band[0], 1.01 * band[1]),
            forward=first.forward,
            steps=(step, step),
            options=options,
            crossings=False,
        ):
            if len(found) > 4 * MAX_REFINEMENTS:
                break
            if point.value != first.value:
                found.append(point)
            beyond = (point.value - last.value) * (1 if last.forward else -1) >= 0
            falls = len(found) > 2 and size(point.solution, probe) < size(
                found[-2].solution, probe
            ) * (1 - peak)
            if point.forward == last.forward and beyond and falls:
                break
    except NotSolvedError:
        return list(three)
    if max(size(p.solution, probe) for p in found) < size(three[1].solution, probe):
        return list(three)
    return [*found, last]


def path_maxima(path: BandPath, probe: int) -> list[Solution]:
    """Points of a path that are higher than the one before and not lower than the one after."""
    heights = [size(p.solution, probe) for p in path.points]
    return [
        path.points[i].solution
        for i in range(1, len(heights) - 1)
        if heights[i] > heights[i - 1] and heights[i] >= heights[i + 1]
    ]

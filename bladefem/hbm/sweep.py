"""Frequency responses: a given list of frequencies, or a band with the points put where the curve needs them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ..errors import InputError
from .api import solve
from .check import check_probe
from .fallback import match_harmonics
from .model import ReducedModel
from .newton import DEFAULTS, Options
from .resonance import free_resonances, stuck_resonances
from .solution import Solution

__all__ = ["first_look", "local_maxima", "response", "size", "sweep"]

Keep = Callable[[float, Callable[[], Solution]], Solution]
COARSE = 12     # intervals of the first look at a band
BAND_LIMIT = 400    # points after which a sweep gives up refining


def size(solution: Solution, probe: int = 0) -> float:
    """Root of the sum of squares of the moving harmonics' amplitudes at a probe: what a peak is measured by [m]."""
    return float(np.linalg.norm(solution.probe[1:, probe]))


def response(model: ReducedModel, omegas: Iterable[float], H: int = 3, samples: int = 128, *,
             options: Options = DEFAULTS, keep: Keep = lambda omega, compute: compute()) -> Iterator[Solution]:
    """Solve one point after the other, each started from the line through the last two.

    Args:
        keep: is given each frequency and what solves it; see `bladefem.hbm.record`.
    """
    last: list[Solution] = []
    for omega in omegas:
        start = _line(last, omega, H)
        solution = keep(omega, partial(solve, model, omega, H, samples, start=start, options=options))
        yield solution
        if solution.converged:
            last = [*last[-1:], solution]


def sweep(model: ReducedModel, band: tuple[float, float], H: int = 3, samples: int = 128, *, peak: float = 1e-3,
          curve: float = 0.02, options: Options = DEFAULTS) -> Iterator[Solution]:
    """Solve a band of circular frequencies [rad/s]; points come in the order of need, to be sorted by `omega`.

    A first look takes even steps and the resonances of both linear limits. Then every local maximum is closed in,
    with 1/amplitude^2 a parabola in omega^2 as it is for one mode, until parabola and solution agree.

    Args:
        peak: relative accuracy of each maximum.
        curve: how far, as a share of the highest maximum, a point may lie off the line through its neighbours.

    Raises:
        InputError: the band is empty or not positive.
    """
    if not 0 < band[0] < band[1] < np.inf:
        raise InputError(f"band {band}: expected 0 < low < high")
    check_probe(model, options.probe)
    solved: dict[float, Solution] = {}
    for solution in response(model, first_look(model, band), H, samples, options=options):
        solved[solution.omega] = solution
        yield solution
    while len(solved) < BAND_LIMIT:
        wanted = _wanted(solved, peak, curve, options.probe)
        if wanted is None:
            return
        near = sorted((s for s in solved.values() if s.converged), key=lambda s: abs(s.omega - wanted))[:1]
        solution = solve(model, wanted, H, samples, start=near[0] if near else None, options=options)
        solved[wanted] = solution
        yield solution


def local_maxima(points: list[Solution], probe: int = 0) -> list[Solution]:
    """Those of the points, sorted by frequency, that stand above both neighbours."""
    heights = [size(point, probe) for point in points]
    return [points[i] for i in range(1, len(points) - 1) if heights[i] >= max(heights[i - 1], heights[i + 1])]


def first_look(model: ReducedModel, band: tuple[float, float]) -> np.ndarray:
    """Circular frequencies of a coarse look at a band: even steps and the resonances of both linear limits [rad/s]."""
    seeds = np.concatenate([resonances(model, h) for resonances in (free_resonances, stuck_resonances)
                            for h in model.excitation if h > 0])
    inside = seeds[(seeds > band[0]) & (seeds < band[1])]
    grid = np.linspace(*band, COARSE + 1)
    keep = [x for x in grid[1:-1] if not np.any(abs(inside - x) < 0.2 * (grid[1] - grid[0]))]
    return np.unique(np.concatenate([grid[[0, -1]], keep, inside]))


def _wanted(solved: dict[float, Solution], peak: float, curve: float, probe: int) -> float | None:
    """The next frequency to solve: a maximum that is not closed in yet, else the worst corner; None when done."""
    tried = np.array(sorted(solved))
    omegas = np.array([w for w in tried if solved[w].converged])
    if len(omegas) < 3:
        return None
    finest = 1e-7 * (tried[-1] - tried[0])
    heights = np.array([size(solved[w], probe) for w in omegas])
    for target in (*_peak_targets(omegas, heights, peak, curve), *_corner_targets(omegas, heights, curve)):
        if abs(tried - target).min() > finest:
            return float(target)
    return None


def _peak_targets(omegas: np.ndarray, heights: np.ndarray, peak: float, curve: float) -> Iterator[float]:
    for i in range(1, len(omegas) - 1):
        if heights[i] >= max(heights[i - 1], heights[i + 1]) and heights[i] > curve * heights.max():
            target = _next_to_peak(omegas[i - 1:i + 2], heights[i - 1:i + 2], peak)
            if target is not None:
                yield target


def _next_to_peak(omegas: np.ndarray, heights: np.ndarray, tolerance: float) -> float | None:
    """Where to look next for the maximum bracketed by three points; None when it is known to the tolerance."""
    x, y = (omegas**2 - omegas[1]**2) / (omegas[2]**2 - omegas[0]**2), (heights[1] / heights)**2
    (left, right), (up, down) = (-x[0], x[2]), (y[0] - 1, y[2] - 1)
    a = (up / left + down / right) / (left + right)
    if a <= 0:      # three equal heights: nothing to gain
        return None
    slope = down / right - a * right
    vertex, rise = -slope / (2 * a), slope**2 / (4 * a)
    steep = max(up, down) > 6 * np.sqrt(tolerance)      # too far apart for a parabola to be trusted
    if rise < tolerance / 2 and not steep:
        return None
    if max(left, right) > 8 * min(left, right):         # a lopsided bracket tells little: cut its long side
        vertex = -2 * right if left > right else 2 * left
    elif abs(vertex) < 0.05 * min(left, right):         # the middle is the vertex already: narrow the steeper side
        vertex = -0.3 * left if up > down else 0.3 * right
    return float(np.sqrt(omegas[1]**2 + vertex * (omegas[2]**2 - omegas[0]**2)))


def _corner_targets(omegas: np.ndarray, heights: np.ndarray, curve: float) -> Iterator[float]:
    """Middles of the wider neighbours of points that lie off the line through their neighbours, worst first."""
    line = heights[:-2] + (heights[2:] - heights[:-2]) * (omegas[1:-1] - omegas[:-2]) / (omegas[2:] - omegas[:-2])
    off = abs(heights[1:-1] - line) / heights.max()
    for i in np.argsort(-off):
        if off[i] <= curve:
            return
        left, right = omegas[i + 1] - omegas[i], omegas[i + 2] - omegas[i + 1]
        if max(left, right) > 1e-5 * (omegas[-1] - omegas[0]):
            yield omegas[i + 1] + (right / 2 if right > left else -left / 2)


def _line(last: list[Solution], omega: float, H: int) -> Solution | None:
    """A start: the last solution, moved along the line through the last two."""
    if not last:
        return None
    if len(last) == 1:
        return last[0]
    old, new = last
    share = (omega - new.omega) / (new.omega - old.omega)
    if abs(share) > 2:
        return new
    return replace(new, w=new.w + share * (match_harmonics(new.w, H) - match_harmonics(old.w, H)))

"""The parameter that makes the highest peak of a band lowest, by following peaks along their exact derivatives.

The height of a peak changes with the parameter as at a fixed frequency, since its slope with the frequency is zero: one
linear solve gives the derivative. A bracket between falling and rising heights closes in by the minimum of the cubic
through heights and slopes, or where the tangents meet, which is exact when two peaks exchange their order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError, NotSolvedError
from .model import ReducedModel
from .peak import Peak, cubic_minimum, find_peak, with_slope
from .resonance import free_resonances, stuck_resonances
from .sweep import first_look, local_maxima, response, size
from .vary import check_parameter, inner, outer, vary

__all__ = ["Optimum", "optimum"]

LEVELS = 30             # values of the parameter tried before giving up
WORTH = 0.7             # share of the highest peak below which the others are not solved again
FIRST = 0.1             # first step, as a share of the range (of a factor: of its logarithm)
NEARLY = 0.9            # share of the highest peak from which a point of the coarse look is climbed
SAME = 0.02             # dip of the height between two peaks, or distance where it is unknown: below it they are one


@dataclass(frozen=True)
class Optimum:
    """The parameter that makes the highest peak of a band lowest."""

    value: float
    peak: Peak
    tried: tuple[Peak, ...]     # highest peak at every value on the way
    points: int                 # solved altogether


@dataclass(frozen=True)
class _Search:
    """What does not change on the way."""

    model: ReducedModel
    band: tuple[float, float]
    H: int
    samples: int
    name: str
    bounds: tuple[float, float]
    tolerance: float

    def width(self, low: float, high: float) -> float:
        """Between two values of the parameter, in its own coordinate: the logarithm of a factor, the gap itself."""
        return inner(self.name, high) - inner(self.name, low)

    def moved(self, value: float, by: float) -> float:
        """The value farther along the coordinate, inside the bounds."""
        return float(np.clip(outer(self.name, inner(self.name, value) + by), *self.bounds))

    @property
    def finest(self) -> float:
        """Width of a bracket that is closed in."""
        return self.tolerance * (self.width(*self.bounds) if self.name == "gap" else 1.0)


def optimum(model: ReducedModel, band: tuple[float, float], bounds: tuple[float, float], H: int = 3,
            samples: int = 128, *, name: str = "load", tolerance: float = 1e-3) -> Optimum:
    """The value of a parameter, between two bounds, that makes the highest peak in a band [rad/s] lowest.

    Peaks are sought uphill of the resonances of both linear limits, or of the middle; at the end a coarse look over the
    whole band must find nothing higher, or the search goes on with what it found.

    Args:
        bounds: of a parameter of `bladefem.hbm.vary`: factors above zero, or for "gap" added openings [m].
        tolerance: of the height, relative.

    Raises:
        InputError: an empty band or range, or an unknown parameter.
        NotSolvedError: a peak could not be solved, or the band has none.
    """
    check_parameter(name)
    for what, (low, high), least in (("band", band, 0.0), ("bounds", bounds, -np.inf if name == "gap" else 0.0)):
        if not least < low < high < np.inf:
            raise InputError(f"{what} ({low}, {high}): expected {least:g} < low < high")
    search = _Search(model, band, H, samples, name, bounds, tolerance)
    middle = outer(name, (inner(name, bounds[0]) + inner(name, bounds[1])) / 2)
    seeds = np.concatenate([f(vary(model, name, middle)) for f in (stuck_resonances, free_resonances)])
    seeds = seeds[(seeds > band[0]) & (seeds < band[1])]
    known, points = _first(search, middle, seeds if seeds.size else np.array([np.sqrt(band[0] * band[1])]))
    tried = [_top(known, middle)]
    for _ in range(LEVELS):
        known, tried, points = _close_in(search, known, tried, points)
        best = min(tried, key=lambda peak: peak.height)
        missed, count = _look(search, best.value, best)
        points += count
        if missed is None:
            return Optimum(best.value, best, tuple(tried), points)
        known, tried = [*known, missed], [missed]
    raise NotSolvedError(f"optimum of {name} between {bounds}: every look over the band found a higher peak")


def _first(search: _Search, value: float, seeds: np.ndarray) -> tuple[list[Peak], int]:
    """Peaks uphill of the seeds, and the points spent."""
    model, known, points, reason = vary(search.model, search.name, value), [], 0, "the climb leaves it"
    for omega in seeds:
        try:
            peak = find_peak(model, omega, search.H, search.samples, tolerance=search.tolerance)
        except NotSolvedError as error:
            reason = str(error)
            continue
        points += peak.points
        if _new(search, peak, known):
            known.append(with_slope(model, peak, search.name, value))
    if not known:
        raise NotSolvedError(f"no peak in the band {search.band} with {search.name} at {value:.4g}: {reason}")
    return known, points


def _new(search: _Search, peak: Peak, known: list[Peak]) -> bool:
    inside = search.band[0] < peak.omega < search.band[1]
    return inside and not any(_same(peak, other.omega) and _same(other, peak.omega) for other in known)


def _same(peak: Peak, omega: float) -> bool:
    """Too close for a dip between them: the parabola of the peak loses less than SAME of its height up to omega."""
    if peak.bend == 0:
        return abs(peak.omega - omega) < SAME * peak.omega
    return peak.bend * peak.height**2 / 4 * (peak.omega - omega)**2 < SAME


def _close_in(search: _Search, known: list[Peak], tried: list[Peak],
              points: int) -> tuple[list[Peak], list[Peak], int]:
    """Go downhill until falling and rising heights enclose the minimum to the tolerance, or a bound is reached."""
    step, narrow = FIRST * search.width(*search.bounds), False
    for _ in range(LEVELS):
        low = max((p for p in tried if p.slope < 0), key=lambda p: p.value, default=None)
        high = min((p for p in tried if p.slope >= 0), key=lambda p: p.value, default=None)
        if low is None or high is None:
            end, sign = (low, 1.0) if high is None else (high, -1.0)
            value = search.moved(end.value, sign * step)
            if value == end.value:
                return known, tried, points
            step *= 2
        else:
            value, gain = _between(search, low, high, narrow)
            if gain < search.tolerance or search.width(low.value, high.value) < search.finest:
                return known, tried, points
            narrow = not narrow
        peaks, count = _level(search, value, known)
        points += count
        known, tried = peaks, [*tried, _top(peaks, value)]
    raise NotSolvedError(f"optimum of {search.name} not closed in with {LEVELS} values, last at {value:.4g}")


def _between(search: _Search, low: Peak, high: Peak, tangents: bool) -> tuple[float, float]:
    """The next value inside a bracket, and the most that could still be gained, relative to the lower end."""
    width = search.width(low.value, high.value)
    down, up, rise = low.slope * width, high.slope * width, high.height - low.height
    meet = (rise - up) / (down - up) if down != up else 0.5
    floor = low.height + meet * down
    gain = 1 - floor / min(low.height, high.height)
    share = meet if tangents else cubic_minimum(down, up, rise)
    return search.moved(low.value, float(np.clip(share, 0.05, 0.95)) * width), float(gain)


def _level(search: _Search, value: float, known: list[Peak]) -> tuple[list[Peak], int]:
    """The known peaks at another value: solved where they may be the highest, estimated where they cannot."""
    model, found, points = vary(search.model, search.name, value), [], 0
    ordered = sorted(known, key=lambda peak: -_estimate(search, peak, value))
    for old in ordered:
        if found and _estimate(search, old, value) < WORTH * max(peak.height for peak in found if peak.value == value):
            found.append(old)
            continue
        peak = find_peak(model, old.omega, search.H, search.samples, near=old, tolerance=search.tolerance)
        points += peak.points
        if _new(search, peak, [p for p in found if p.value == value]):
            found.append(with_slope(model, peak, search.name, value))
    if any(peak.value == value for peak in found):
        return found, points
    met, count = _look(search, value)       # the known peaks left the band, or became one with another
    if met is None:
        raise NotSolvedError(f"the peaks leave the band {search.band} with {search.name} at {value:.4g}")
    return [met], points + count


def _estimate(search: _Search, peak: Peak, value: float) -> float:
    return peak.height * float(np.exp(peak.slope / peak.height * search.width(peak.value, value)))


def _top(peaks: list[Peak], value: float) -> Peak:
    return max((peak for peak in peaks if peak.value == value), key=lambda peak: peak.height)


def _look(search: _Search, value: float, best: Peak | None = None) -> tuple[Peak | None, int]:
    """The highest peak that a coarse look over the band meets, if it is higher than the best; points spent."""
    model = vary(search.model, search.name, value)
    found = response(model, first_look(model, search.band), search.H, search.samples)
    points = [point for point in found if point.converged]
    met, spent = best, len(points)
    for top in sorted(local_maxima(points), key=lambda point: -size(point))[:2]:
        if met and (size(top) < NEARLY * met.height or _same(met, top.omega)):
            continue
        peak = find_peak(model, top.omega, search.H, search.samples, near=top, tolerance=search.tolerance)
        spent += peak.points
        if _new(search, peak, []) and (met is None or peak.height > met.height * (1 + search.tolerance)):
            met = peak
    return (None if met is best else with_slope(model, met, search.name, value)), spent

"""The parameter that makes the highest peak of a band lowest, by following peaks along their exact
derivatives.

The height of a peak changes with the parameter as at a fixed frequency, since its slope with the
frequency is zero: one linear solve gives the derivative. A bracket between falling and rising
heights closes in by the minimum of the cubic through heights and slopes, or where the tangents
meet, which is exact when two peaks exchange their order.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError, NotSolvedError
from ..util.curve_extremum import cubic_minimum, tangents_meet
from .linear_resonances import free_resonances, stuck_resonances
from .model import ReducedModel
from .next_frequency import first_look, local_maxima
from .parameters import check_parameter, parameter_value, path_coordinate, vary
from .peak import Peak, find_peak, with_slope
from .solution import Solution, size
from .solver.newton import DEFAULT_OPTIONS, Options
from .sweep import response

# values of the parameter tried before giving up
MOST_LEVELS = 30
# factor by which a step is shortened where no peak was solved at its end, and how often at most
SHORTENING_FACTOR = 3.0
MOST_SHORTENED = 3
# share of the highest peak below which the others are not solved again
SOLVED_HEIGHT_SHARE = 0.7
# first step, as a share of the range (of a factor: of its logarithm)
FIRST_STEP_SHARE = 0.1
# share of the highest peak from which a point of the coarse look is climbed
NEARLY_HIGHEST = 0.9
# first step on from the outermost values, in the parameter's coordinate, where the range is wanted
# that keeps near the lowest height
FIRST_WIDENING_STEP = 0.1
# dip of the height between two peaks, or distance where it is unknown: below it they are one
SAME_PEAK_LOSS = 0.02


@dataclass(frozen=True)
class Optimum:
    """The parameter that makes the highest peak of a band lowest."""

    value: float
    peak: Peak
    # highest peak at every value on the way
    tried: tuple[Peak, ...]
    # solved altogether
    points: int


@dataclass(frozen=True)
class Variation:
    """Models along one parameter, and how the height of a peak changes with it."""

    # value of the parameter -> model
    model_at: Callable[[float], ReducedModel]
    # model, peak, value -> the peak with its value and the derivative of its height by the
    # coordinate of that value: its logarithm, or for "gap" the value itself
    with_slope: Callable[[ReducedModel, Peak, float], Peak]
    # decides the coordinate, and is named in messages
    name: str = "load"


@dataclass(frozen=True)
class _Search:
    """What does not change on the way."""

    along: Variation
    band: tuple[float, float]
    H: int
    samples: int
    bounds: tuple[float, float]
    tolerance: float
    options: Options

    @property
    def name(self) -> str:
        """Of the parameter."""
        return self.along.name

    def peak(
        self,
        model: ReducedModel,
        omega: float,
        near: Peak | Solution | None = None,
    ) -> Peak:
        """The peak uphill of a circular frequency [rad/s], without its slope."""
        return find_peak(
            model,
            omega,
            self.H,
            self.samples,
            near=near,
            tolerance=self.tolerance,
            options=self.options,
        )

    def width(
        self,
        low: float,
        high: float,
    ) -> float:
        """Between two values of the parameter, in its own coordinate: the logarithm of a factor,
        the gap itself.
        """
        return path_coordinate(self.name, high) - path_coordinate(self.name, low)

    def moved(
        self,
        value: float,
        by: float,
    ) -> float:
        """The value farther along the coordinate, inside the bounds."""
        return float(
            np.clip(
                parameter_value(self.name, path_coordinate(self.name, value) + by), *self.bounds
            )
        )

    def inside(self, peak: Peak) -> bool:
        """Whether the peak lies in the band."""
        return self.band[0] < peak.omega < self.band[1]

    @property
    def finest(self) -> float:
        """Width of a bracket that is closed in."""
        return self.tolerance * (self.width(*self.bounds) if self.name == "gap" else 1.0)


def optimum(
    model: ReducedModel,
    band: tuple[float, float],
    bounds: tuple[float, float],
    H: int = 3,
    samples: int = 128,
    *,
    name: str = "load",
    tolerance: float = 1e-3,
) -> Optimum:
    """The value of a parameter, between two bounds, that makes the highest peak in a band [rad/s]
    lowest.

    Of several minima it is the one downhill from the middle of the bounds; others are found with
    narrower bounds. Peaks are sought uphill of the resonances of both linear limits, or of the
    middle of the band; at the end a coarse look over the whole band must find nothing higher, or
    the search goes on with what it found.

    Args:
        bounds: of a parameter of `bladefem.hbm.parameters`: factors above zero, or for "gap" added
            openings [m].
        tolerance: of the height, relative.

    Raises:
        InputError: an empty band or range, or an unknown parameter.
        NotSolvedError: a peak could not be solved, or the band has none.
    """
    check_parameter(name)
    along = Variation(
        lambda value: vary(model, name, value),
        lambda changed, peak, value: with_slope(changed, peak, name, value),
        name,
    )
    return lowest_peak(along, band, bounds, H, samples, tolerance=tolerance)


def _check_range(what: str, ends: tuple[float, float], least: float) -> None:
    """Refuse ends that are not ascending above the least value."""
    low, high = ends
    if not least < low < high < np.inf:
        raise InputError(f"{what} ({low}, {high}): expected {least:g} < low < high")


def lowest_peak(
    along: Variation,
    band: tuple[float, float],
    bounds: tuple[float, float],
    H: int = 3,
    samples: int = 128,
    *,
    start: float | None = None,
    near: Peak | None = None,
    tolerance: float = 1e-3,
    rise: float = 0.0,
    options: Options = DEFAULT_OPTIONS,
) -> Optimum:
    """``optimum`` along any variation of a model, for example with the seating solved for each
    load.

    Args:
        start: value where the search begins; the middle of the bounds when left out.
        near: the highest peak there where that is known, of these models or similar ones.
        rise: relative; values are tried on both sides until the height has grown by it, or a bound
            is reached, or a peak is not solved.

    Raises:
        InputError: an empty band or range.
        NotSolvedError: a peak could not be solved, or the band has none.
    """
    name = along.name
    _check_range("band", band, 0.0)
    # a gap may be an interference, all other parameters are factors
    _check_range("bounds", bounds, -np.inf if name == "gap" else 0.0)
    search = _Search(along, band, H, samples, bounds, tolerance, options)
    middle = parameter_value(
        name, (path_coordinate(name, bounds[0]) + path_coordinate(name, bounds[1])) / 2
    )
    if start is not None:
        middle = float(np.clip(start, *bounds))
    first, points = _first_level(search, middle, near)
    levels = {middle: first}
    # paths know the peaks that they started from: only a look over the band shows others
    for _ in range(MOST_LEVELS):
        points += _close_in(search, levels)
        tried = _highest_peaks(levels)
        best = min(tried, key=lambda peak: peak.height)
        missed, count = _look_over_band(search, best.value, best)
        points += count
        if missed is not None:
            levels, count = _add_missed_peak(search, levels, missed)
            points += count
            continue
        points += _widen(search, levels, (1 + rise) * best.height)
        tried = _highest_peaks(levels)
        # unless another minimum lies farther out
        if best.height <= (1 + tolerance) * min(peak.height for peak in tried):
            return Optimum(best.value, best, tuple(tried), points)
    raise NotSolvedError(
        f"optimum of {name} between {bounds}: every look over the band found a higher peak"
    )


def _first_level(
    search: _Search,
    value: float,
    near: Peak | None,
) -> tuple[list[Peak], int]:
    """The peak next to a known one, else those uphill of the resonances of both limits at the first
    value, and the points spent.
    """
    model = search.along.model_at(value)
    known: list[Peak] = []
    points = 0
    reason = "the climb leaves it"
    if near is not None:
        with suppress(NotSolvedError):
            return _solve_level(search, value, [replace(near, value=value)])
    guesses = np.concatenate(
        [resonances(model) for resonances in (stuck_resonances, free_resonances)]
    )
    guesses = guesses[(guesses > search.band[0]) & (guesses < search.band[1])]
    for omega in guesses if guesses.size else [float(np.sqrt(search.band[0] * search.band[1]))]:
        try:
            peak = search.peak(model, omega)
        except NotSolvedError as error:
            reason = str(error)
            continue
        points += peak.points
        if search.inside(peak):
            known = _add_peak(search, search.along.with_slope(model, peak, value), known)
    if not known:
        raise NotSolvedError(
            f"no peak in the band {search.band} with {search.name} at {value:.4g}: {reason}"
        )
    return known, points


def _add_peak(
    search: _Search,
    peak: Peak,
    known: list[Peak],
) -> list[Peak]:
    """The known peaks and this one; of those without a dip between them the highest."""
    same = [
        other
        for other in known
        if other.value == peak.value and _same_peak(peak, other) and _same_peak(other, peak)
    ]
    if any(other.height >= peak.height for other in same):
        return known
    return [*(other for other in known if not any(other is one for one in same)), peak]


def _same_peak(peak: Peak, other: Peak) -> bool:
    """No dip before the other: the parabola of the peak loses less than SAME of its height on the
    way.
    """
    if peak.bend == 0:
        return abs(peak.omega - other.omega) < SAME_PEAK_LOSS * peak.omega
    return peak.bend * peak.height**2 / 4 * (peak.omega - other.omega) ** 2 < SAME_PEAK_LOSS


def _close_in(search: _Search, levels: dict[float, list[Peak]]) -> int:
    """Go downhill from the lowest level until the minimum is enclosed to the tolerance, or a bound
    is reached.

    Adds to the levels; returns the points spent.
    """
    step = FIRST_STEP_SHARE * search.width(*search.bounds)
    narrow = False
    points = 0
    shortened = 0
    for _ in range(MOST_LEVELS):
        low, high = _bracket_minimum(_highest_peaks(levels))
        enclosed = low is not None and high is not None
        if low is not None and high is not None:
            value, gain = _next_value(search, low, high, narrow)
            if gain < search.tolerance or search.width(low.value, high.value) < search.finest:
                return points
            narrow = not narrow
        else:
            end, sign = (low, 1.0) if high is None else (high, -1.0)
            # the lowest peak itself is one of the two
            assert end is not None
            value = search.moved(end.value, sign * step)
            if value == end.value:
                return points
        try:
            levels[value], count = _solve_level(search, value, _nearby_peaks(levels, value))
        except NotSolvedError:
            shortened += 1
            if enclosed or shortened > MOST_SHORTENED:
                raise
            step /= SHORTENING_FACTOR
            continue
        step *= 2
        points += count
    raise NotSolvedError(
        f"optimum of {search.name} not closed in with {MOST_LEVELS} values, last at {value:.4g}"
    )


def _widen(search: _Search, levels: dict[float, list[Peak]], height: float) -> int:
    """Add levels on both sides until the highest peak of the outermost ones is as high as wanted, a
    bound is reached, or a peak is not solved.

    Returns:
        The points spent.
    """
    points = 0
    for end, sign in ((min, -1.0), (max, 1.0)):
        step = FIRST_WIDENING_STEP
        while True:
            outer = end(_highest_peaks(levels), key=lambda peak: peak.value)
            value = search.moved(outer.value, sign * step)
            if outer.height >= height or value == outer.value:
                break
            try:
                levels[value], count = _solve_level(search, value, levels[outer.value])
                points += count
                highest = max(levels[value], key=lambda peak: peak.height)
                missed, count = _look_over_band(search, value, highest)
            except NotSolvedError:
                levels.pop(value, None)
                break
            points += count
            if missed is not None:
                levels[value] = _add_peak(search, missed, levels[value])
            step *= 2
    return points


def _highest_peaks(levels: dict[float, list[Peak]]) -> list[Peak]:
    """The highest peak of each level."""
    return [
        max((peak for peak in peaks if peak.value == value), key=lambda peak: peak.height)
        for value, peaks in levels.items()
    ]


def _nearby_peaks(levels: dict[float, list[Peak]], value: float) -> list[Peak]:
    """The peaks of the next levels below and above a value, without those of one that lie where
    the other's do.
    """
    below, above = (
        [] if near is None else levels[near] for near in _neighbour_values(levels, value)
    )
    return below + [
        p for p in above if not any(_same_peak(p, other) or _same_peak(other, p) for other in below)
    ]


def _neighbour_values(
    levels: dict[float, list[Peak]], value: float
) -> tuple[float | None, float | None]:
    """The next values below and above."""
    return max((v for v in levels if v < value), default=None), min(
        (v for v in levels if v > value), default=None
    )


def _add_missed_peak(
    search: _Search,
    levels: dict[float, list[Peak]],
    missed: Peak,
) -> tuple[dict[float, list[Peak]], int]:
    """The level where a peak was missed and its neighbours, with that peak; and the points
    spent.
    """
    kept = {missed.value: _add_peak(search, missed, levels[missed.value])}
    points = 0
    for value in _neighbour_values(levels, missed.value):
        if value is not None:
            found, count = _solve_level(search, value, [missed])
            kept[value], points = _add_peak(search, found[0], levels[value]), points + count
    return kept, points


def _bracket_minimum(tried: list[Peak]) -> tuple[Peak | None, Peak | None]:
    """The lowest height tried and its neighbour downhill, which is no lower: a minimum lies
    between; None at an end.
    """
    best = min(tried, key=lambda peak: peak.height)
    if best.slope < 0:
        return best, min(
            (p for p in tried if p.value > best.value), key=lambda p: p.value, default=None
        )
    return max(
        (p for p in tried if p.value < best.value), key=lambda p: p.value, default=None
    ), best


def _next_value(
    search: _Search,
    low: Peak,
    high: Peak,
    tangents: bool,
) -> tuple[float, float]:
    """The next value inside a bracket, and the most that could still be gained, relative to its
    lower end.

    The cubic sees smooth minima, the tangents corners, where two peaks exchange their order; of two
    minima in a bracket neither can be trusted, and it is halved.
    """
    width = search.width(low.value, high.value)
    down = low.slope * width
    up = high.slope * width
    rise = high.height - low.height
    if not down < 0 <= up:
        return search.moved(low.value, width / 2), np.inf
    meet, corner = tangents_meet(down, up, rise)
    smooth, bottom = cubic_minimum(down, up, rise)
    floor = low.height + bottom
    if 0 < meet < 1:
        floor = min(floor, low.height + corner)
    share = meet if tangents and 0 < meet < 1 else smooth
    return (
        search.moved(low.value, float(np.clip(share, 0.05, 0.95)) * width),
        float(1 - floor / min(low.height, high.height)),
    )


def _solve_level(
    search: _Search,
    value: float,
    known: list[Peak],
) -> tuple[list[Peak], int]:
    """The known peaks at another value: solved where they may be the highest, estimated where they
    cannot.
    """
    model = search.along.model_at(value)
    found: list[Peak] = []
    points = 0
    for old in sorted(known, key=lambda peak: -_estimated_height(search, peak, value)):
        if found and _estimated_height(search, old, value) < SOLVED_HEIGHT_SHARE * max(
            peak.height for peak in found if peak.value == value
        ):
            found.append(old)
            continue
        if any(peak.value == value and _same_peak(peak, old) for peak in found):
            continue
        peak = search.peak(model, old.omega, old)
        points += peak.points
        if search.inside(peak):
            found = _add_peak(search, search.along.with_slope(model, peak, value), found)
    if any(peak.value == value for peak in found):
        return found, points
    # the known peaks left the band, or became one with another
    met, count = _look_over_band(search, value)
    if met is None:
        raise NotSolvedError(
            f"the peaks leave the band {search.band} with {search.name} at {value:.4g}"
        )
    return [met], points + count


def _estimated_height(
    search: _Search,
    peak: Peak,
    value: float,
) -> float:
    return peak.height * float(np.exp(peak.slope / peak.height * search.width(peak.value, value)))


def _look_over_band(
    search: _Search,
    value: float,
    best: Peak | None = None,
) -> tuple[Peak | None, int]:
    """The highest peak that a coarse look over the band meets, if it is higher than the best;
    points spent.
    """
    model = search.along.model_at(value)
    met = best
    looked = first_look(model, search.band)
    found = response(model, looked, search.H, search.samples, options=search.options)
    points = [point for point in found if point.converged]
    spent = len(points)
    for top in sorted(local_maxima(points), key=lambda point: -size(point))[:2]:
        if met and (
            size(top) < NEARLY_HIGHEST * met.height
            or abs(top.omega / met.omega - 1) < SAME_PEAK_LOSS
        ):
            continue
        peak = search.peak(model, top.omega, top)
        spent += peak.points
        if search.inside(peak) and (
            met is None or peak.height > met.height * (1 + search.tolerance)
        ):
            met = peak
    if met is None or met is best:
        return None, spent
    return search.along.with_slope(model, met, value), spent

"""The parameter that makes the highest peak of a band lowest, by following peaks along their exact
derivatives.

The height of a peak changes with the parameter as at a fixed frequency, since its slope with the
frequency is zero: one linear solve gives the derivative. A bracket between falling and rising
heights closes in by the minimum of the cubic through heights and slopes, or where the tangents
meet, which is exact when two peaks exchange their order.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError, NotSolvedError
from .linear_resonances import free_resonances, stuck_resonances
from .model import ReducedModel
from .next_parameter import bracket_minimum, next_value
from .parameters import check_parameter, parameter_value, path_coordinate, vary
from .peak import Peak, with_slope
from .peak_levels import (
    SAME_PEAK_LOSS,
    PeakSearch,
    Variation,
    add_peak,
    estimated_height,
    highest_peaks,
    look_over_band,
    nearby_peaks,
    neighbour_values,
    solve_level,
)
from .solver.newton import DEFAULT_OPTIONS, Options

# values of the parameter tried before giving up
MOST_LEVELS = 30
# factor by which a step is shortened where no peak was solved at its end, also inside a bracket,
# and how often in a row at most
SHORTENING_FACTOR = 3.0
MOST_SHORTENED = 3
# first step, as a share of the range (of a factor: of its logarithm)
FIRST_STEP_SHARE = 0.1
# first step on from the outermost values, in the parameter's coordinate, where the range is wanted
# that keeps near the lowest height
FIRST_WIDENING_STEP = 0.1


@dataclass(frozen=True)
class Optimum:
    """The parameter that makes the highest peak of a band lowest."""

    value: float
    peak: Peak
    # highest peak at every value on the way
    tried: tuple[Peak, ...]
    # solved altogether
    points: int


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
        "m" if name == "gap" else "",
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
    search = PeakSearch(along, band, H, samples, bounds, tolerance, options)
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
        tried = highest_peaks(levels)
        best = min(tried, key=lambda peak: peak.height)
        missed, count = look_over_band(search, best.value, best)
        points += count
        if missed is not None:
            levels, count = _add_missed_peak(search, levels, missed)
            points += count
            continue
        points += _widen(search, levels, (1 + rise) * best.height)
        tried = highest_peaks(levels)
        # unless another minimum lies farther out
        if best.height <= (1 + tolerance) * min(peak.height for peak in tried):
            return Optimum(best.value, best, tuple(tried), points)
    raise NotSolvedError(
        f"optimum of {name} between {bounds}: every look over the band found a higher peak"
    )


def _first_level(
    search: PeakSearch,
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
            return solve_level(search, value, [replace(near, value=value)])
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
            known = add_peak(search.along.with_slope(model, peak, value), known)
    if not known:
        raise NotSolvedError(
            f"no peak in the band of {search.band_in_words} with "
            f"{search.value_in_words(value)}: {reason}"
        )
    return known, points


def _close_in(search: PeakSearch, levels: dict[float, list[Peak]]) -> int:
    """Go downhill from the lowest level until the minimum is enclosed to the tolerance, or a bound
    is reached.

    Adds to the levels; returns the points spent.
    """
    step = FIRST_STEP_SHARE * search.width(*search.bounds)
    narrow = False
    points = 0
    shortened = 0
    for _ in range(MOST_LEVELS):
        low, high = bracket_minimum(highest_peaks(levels))
        if low is not None and high is not None:
            value, gain = next_value(search, low, high, narrow)
            if gain < search.tolerance or search.width(low.value, high.value) < search.finest:
                higher, count = higher_from_neighbours(search, levels)
                points += count
                if not higher:
                    return points
                continue
            narrow = not narrow
            # nearer to the lower end where a load inside was not solved
            best = min((low, high), key=lambda peak: peak.height)
            share = SHORTENING_FACTOR**-shortened
            value = search.moved(best.value, share * search.width(best.value, value))
        else:
            end, sign = (low, 1.0) if high is None else (high, -1.0)
            # the lowest peak itself is one of the two
            assert end is not None
            value = search.moved(end.value, sign * step)
            if value == end.value:
                return points
        try:
            levels[value], count = solve_level(search, value, nearby_peaks(levels, value))
        except NotSolvedError:
            shortened += 1
            if shortened > MOST_SHORTENED:
                raise
            step /= SHORTENING_FACTOR
            continue
        # else every later step would be as short, and no bracket would close
        shortened = 0
        step *= 2
        points += count
    raise NotSolvedError(_not_converged(search, levels))


def _not_converged(search: PeakSearch, levels: dict[float, list[Peak]]) -> str:
    """What a search that ran out of values found."""
    tried = highest_peaks(levels)
    best = min(tried, key=lambda peak: peak.height)
    low, high = bracket_minimum(tried)
    ends = [search.bounds[i] if one is None else one.value for i, one in enumerate((low, high))]
    return (
        f"the search did not converge within {MOST_LEVELS} values; the lowest resonance that it "
        f"found is at {search.value_in_words(best.value)}, a minimum lies between {ends[0]:.4g} "
        f"and {ends[1]:.4g} {search.along.unit}".rstrip()
    )


def higher_from_neighbours(
    search: PeakSearch,
    levels: dict[float, list[Peak]],
) -> tuple[bool, int]:
    """Whether the lowest level misses a peak that its neighbours have, which is added to it; and
    the points spent.

    Where peaks of a band are many, 78 um under 50 N and 129 um under 49.9 N are two of them. Where
    the higher one ends between the two loads, at a fold, following it meets none.
    """
    tops = {peak.value: peak for peak in highest_peaks(levels)}
    best = min(tops.values(), key=lambda peak: peak.height)
    spent = 0
    for value in neighbour_values(levels, best.value):
        if value is None:
            continue
        top = tops[value]
        if estimated_height(search, top, best.value) < (1 + SAME_PEAK_LOSS) * best.height:
            continue
        model = search.along.model_at(best.value)
        with suppress(NotSolvedError):
            peak = search.peak(model, top.omega, top)
            spent += peak.points
            if search.inside(peak) and peak.height > (1 + SAME_PEAK_LOSS) * best.height:
                found = search.along.with_slope(model, peak, best.value)
                levels[best.value] = add_peak(found, levels[best.value])
                return True, spent
    return False, spent


def _widen(search: PeakSearch, levels: dict[float, list[Peak]], height: float) -> int:
    """Add levels on both sides until the highest peak of the outermost ones is as high as wanted, a
    bound is reached, or a peak is not solved.

    Returns:
        The points spent.
    """
    points = 0
    for end, sign in ((min, -1.0), (max, 1.0)):
        step = FIRST_WIDENING_STEP
        while True:
            outer = end(highest_peaks(levels), key=lambda peak: peak.value)
            value = search.moved(outer.value, sign * step)
            if outer.height >= height or value == outer.value:
                break
            try:
                levels[value], count = solve_level(search, value, levels[outer.value])
                points += count
                highest = max(levels[value], key=lambda peak: peak.height)
                missed, count = look_over_band(search, value, highest)
            except NotSolvedError:
                levels.pop(value, None)
                break
            points += count
            if missed is not None:
                levels[value] = add_peak(missed, levels[value])
            step *= 2
    return points


def _add_missed_peak(
    search: PeakSearch,
    levels: dict[float, list[Peak]],
    missed: Peak,
) -> tuple[dict[float, list[Peak]], int]:
    """The level where a peak was missed and its neighbours, with that peak; and the points
    spent.
    """
    kept = {missed.value: add_peak(missed, levels[missed.value])}
    points = 0
    for value in neighbour_values(levels, missed.value):
        if value is not None:
            found, count = solve_level(search, value, [missed])
            kept[value], points = add_peak(found[0], levels[value]), points + count
    return kept, points

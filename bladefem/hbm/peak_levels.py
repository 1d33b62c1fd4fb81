"""Peaks at one value of a parameter: solved from those of another value, told apart, and looked for
over the band. A dictionary from each value tried to its peaks is the search so far.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import NotSolvedError
from .model import ReducedModel
from .next_frequency import first_look, local_maxima
from .parameters import parameter_value, path_coordinate
from .peak import Peak, find_peak
from .response import response
from .solution import Solution, size
from .solver.newton import Options

# share of the highest peak below which the others are not solved again
SOLVED_HEIGHT_SHARE = 0.7
# share of the highest peak from which a point of the coarse look is climbed
NEARLY_HIGHEST = 0.9
# dip of the height between two peaks, or distance where it is unknown: below it they are one
SAME_PEAK_LOSS = 0.02


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
    # of the parameter, for messages; "" of a factor
    unit: str = "N"


@dataclass(frozen=True)
class PeakSearch:
    """What stays the same from one value of the parameter to the next."""

    along: Variation
    # of circular frequencies [rad/s]
    band: tuple[float, float]
    # harmonics
    H: int
    # of a period
    samples: int
    # of the parameter
    bounds: tuple[float, float]
    # relative, of a height
    tolerance: float
    options: Options

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return self.along.name

    def value_in_words(self, value: float) -> str:
        """A value of the parameter in words: "load 78.9 N"."""
        return f"{self.name} {value:.4g} {self.along.unit}".rstrip()

    @property
    def band_in_words(self) -> str:
        """The band: "360 to 400 Hz"."""
        low, high = (omega / (2 * np.pi) for omega in self.band)
        return f"{low:.6g} to {high:.6g} Hz"

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


def add_peak(peak: Peak, known: list[Peak]) -> list[Peak]:
    """The known peaks and this one; of those without a dip between them the highest."""
    same = [
        other
        for other in known
        if other.value == peak.value and same_peak(peak, other) and same_peak(other, peak)
    ]
    if any(other.height >= peak.height for other in same):
        return known
    return [*(other for other in known if not any(other is one for one in same)), peak]


def same_peak(peak: Peak, other: Peak) -> bool:
    """No dip before the other: the parabola of the peak loses less than SAME_PEAK_LOSS of its
    height on the way.
    """
    if peak.bend == 0:
        return abs(peak.omega - other.omega) < SAME_PEAK_LOSS * peak.omega
    return peak.bend * peak.height**2 / 4 * (peak.omega - other.omega) ** 2 < SAME_PEAK_LOSS


def highest_peaks(levels: dict[float, list[Peak]]) -> list[Peak]:
    """The highest peak at each value."""
    return [
        max((peak for peak in peaks if peak.value == value), key=lambda peak: peak.height)
        for value, peaks in levels.items()
    ]


def nearby_peaks(levels: dict[float, list[Peak]], value: float) -> list[Peak]:
    """The peaks at the next values below and above one, without those above that lie where one
    below does.
    """
    below, above = (
        [] if near is None else levels[near] for near in neighbour_values(levels, value)
    )
    return below + [
        p for p in above if not any(same_peak(p, other) or same_peak(other, p) for other in below)
    ]


def neighbour_values(
    levels: dict[float, list[Peak]], value: float
) -> tuple[float | None, float | None]:
    """The next values below and above."""
    return max((v for v in levels if v < value), default=None), min(
        (v for v in levels if v > value), default=None
    )


def solve_level(
    search: PeakSearch,
    value: float,
    known: list[Peak],
) -> tuple[list[Peak], int]:
    """The known peaks at another value: solved where they may be the highest, as they were where
    they cannot; and the points spent.

    Raises:
        NotSolvedError: a peak could not be solved, or none is left in the band.
    """
    model = search.along.model_at(value)
    found: list[Peak] = []
    points = 0
    for old in sorted(known, key=lambda peak: -estimated_height(search, peak, value)):
        if found and estimated_height(search, old, value) < SOLVED_HEIGHT_SHARE * max(
            peak.height for peak in found if peak.value == value
        ):
            found.append(old)
            continue
        if any(peak.value == value and same_peak(peak, old) for peak in found):
            continue
        peak = search.peak(model, old.omega, old)
        points += peak.points
        if search.inside(peak):
            found = add_peak(search.along.with_slope(model, peak, value), found)
    if any(peak.value == value for peak in found):
        return found, points
    # the known peaks left the band, or became one with another
    met, count = look_over_band(search, value)
    if met is None:
        raise NotSolvedError(
            f"the peaks leave the band of {search.band_in_words} with "
            f"{search.value_in_words(value)}"
        )
    return [met], points + count


def estimated_height(
    search: PeakSearch,
    peak: Peak,
    value: float,
) -> float:
    """Height of a peak at another value, by its relative slope."""
    return peak.height * float(np.exp(peak.slope / peak.height * search.width(peak.value, value)))


def look_over_band(
    search: PeakSearch,
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
    probe = search.options.probe
    for top in sorted(local_maxima(points, probe), key=lambda point: -size(point, probe))[:2]:
        if met and (
            size(top, probe) < NEARLY_HIGHEST * met.height
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

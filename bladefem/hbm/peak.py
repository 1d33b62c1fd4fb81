"""The resonance peak itself: found by the slope of the response, followed against a parameter, made as low as possible.

The slope with the frequency is exact (`bladefem.hbm.sensitivity`). For one mode 1/size^2 is a parabola in omega, so its
derivative is a straight line, and the secant finds its zero in a few points.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import NotSolvedError
from .api import solve
from .model import ReducedModel
from .newton import DEFAULTS, Options
from .sensitivity import sensitivities
from .solution import Solution
from .sweep import local_maxima, size, sweep
from .vary import vary

__all__ = ["Optimum", "Peak", "find_peak", "optimum", "track_peak"]

STEPS = 40              # points spent on one peak before giving up
FIRST_STEP = 1e-3       # first step, as a share of the frequency
FARTHEST = 0.05         # longest step, as a share of the frequency


@dataclass(frozen=True)
class Peak:
    """A local maximum of the response."""

    solution: Solution
    height: float           # root of the sum of squares of the moving harmonics at the probe [m]
    points: int             # solved on the way
    value: float = 1.0      # of the parameter that is followed
    slope: float = 0.0      # of the height with the parameter, at this peak [m per unit of `bladefem.hbm.rates`]

    @property
    def omega(self) -> float:
        """[rad/s]"""
        return self.solution.omega


@dataclass(frozen=True)
class Optimum:
    """The parameter that makes the highest peak of a band lowest."""

    value: float
    peak: Peak
    tried: tuple[Peak, ...]     # highest peak at every value on the way


def find_peak(model: ReducedModel, omega: float, H: int = 3, samples: int = 128, *, start: Solution | None = None,
              tolerance: float = 1e-4, options: Options = DEFAULTS) -> Peak:
    """The local maximum uphill of omega [rad/s].

    Args:
        tolerance: relative accuracy of the height; the frequency follows with its square root.

    Raises:
        NotSolvedError: a point was not solved, or no maximum was closed in.
    """
    low = high = None
    last: tuple[float, float] | None = None
    reach = FIRST_STEP * omega
    for count in range(1, STEPS + 1):
        start = solve(model, omega, H, samples, start=start, options=options)
        if not start.converged:
            raise NotSolvedError(f"peak search stopped at {start.frequency:.6g} Hz: {start.reason}")
        height = size(start, options.probe)
        uphill = sensitivities(model, start, ["omega"])["omega"].size[options.probe]
        line = -2 * uphill / height**3
        low, high = (omega, high) if uphill > 0 else (low, omega)
        target = omega + np.sign(uphill) * reach
        if last is not None and line != last[1]:
            secant = omega - line * (omega - last[0]) / (line - last[1])
            if (secant - omega) * uphill > 0:
                target = float(np.clip(secant, omega - FARTHEST * omega, omega + FARTHEST * omega))
        if low is not None and high is not None and not low < target < high:
            target = (low + high) / 2
        if _known(uphill, target - omega, height, tolerance, low, high):
            return Peak(start, height, count)
        last, reach, omega = (omega, line), 2 * reach, target
    raise NotSolvedError(f"peak search found no maximum in {STEPS} points, last at {start.frequency:.6g} Hz")


def track_peak(model: ReducedModel, name: str, values: Iterable[float], omega: float, H: int = 3, samples: int = 128, *,
               options: Options = DEFAULTS) -> Iterator[Peak]:
    """Follow one peak while a parameter of `bladefem.hbm.vary` takes the given values: no frequency sweeps.

    Args:
        omega: where to look for the first peak [rad/s].
    """
    path: list[Peak] = []
    for value in values:
        guess = omega
        if path:
            guess = path[-1].omega
        if len(path) > 1 and path[-1].value != path[-2].value:
            ahead = (value - path[-1].value) / (path[-1].value - path[-2].value)
            guess += float(np.clip(ahead * (guess - path[-2].omega), -FARTHEST * guess, FARTHEST * guess))
        changed = vary(model, name, value)
        peak = find_peak(changed, guess, H, samples, start=path[-1].solution if path else None, options=options)
        slope = sensitivities(changed, peak.solution, [name])[name].size[options.probe]
        path = [*path[-1:], Peak(peak.solution, peak.height, peak.points, value, float(slope))]
        yield path[-1]


def optimum(model: ReducedModel, band: tuple[float, float], bounds: tuple[float, float], H: int = 3,
            samples: int = 128, *, name: str = "load", tolerance: float = 1e-3) -> Optimum:
    """The factor of a parameter, between two bounds, that makes the highest peak in a band [rad/s] lowest.

    Looks at five factors by sweeps, then closes in by the sign of the peak's exact derivative; where two peaks exchange
    their order the derivative jumps and the same search ends at equal heights.

    Raises:
        NotSolvedError: a peak could not be solved.
    """
    def highest(value: float) -> Peak:
        return _highest(vary(model, name, value), band, H, samples, name, value)

    tried = [highest(value) for value in np.geomspace(*bounds, 5)]
    best = int(np.argmin([peak.height for peak in tried]))
    low, high = tried[max(best - 1, 0)].value, tried[min(best + 1, 4)].value
    middle = tried[best]
    while high / low > 1 + tolerance:
        low, high = (low, middle.value) if middle.slope > 0 else (middle.value, high)
        middle = highest(np.sqrt(low * high))
        tried.append(middle)
    best_peak = min(tried, key=lambda peak: peak.height)
    return Optimum(best_peak.value, best_peak, tuple(tried))


def _highest(model: ReducedModel, band: tuple[float, float], H: int, samples: int, name: str,
             value: float) -> Peak:
    points = sorted(sweep(model, band, H, samples, peak=0.02, curve=0.2), key=lambda s: s.omega)
    tops = sorted(local_maxima([s for s in points if s.converged]), key=lambda s: -size(s))
    peaks = [find_peak(model, top.omega, H, samples, start=top)
             for top in tops if size(top) > 0.9 * size(tops[0])]
    if not peaks:
        raise NotSolvedError(f"no peak between {band[0]:.6g} and {band[1]:.6g} rad/s with {name} at {value:.4g}")
    top = max(peaks, key=lambda peak: peak.height)
    slope = sensitivities(model, top.solution, [name])[name].size[0]
    return Peak(top.solution, top.height, len(points) + sum(peak.points for peak in peaks), value, float(slope))


def _known(uphill: float, step: float, height: float, tolerance: float, low: float | None, high: float | None) -> bool:
    """The height still to be gained by the next step is within tolerance, or the bracket has no width."""
    if low is not None and high is not None and high - low < 1e-9 * high:
        return True
    return (abs(uphill * step) < tolerance * height and low is not None and high is not None) or uphill == 0

"""The highest amplitude of some blades, searched again round the peaks that a first search found.

Held means are quick to solve and near: free ones, by which dampers walk, change a resonance by a
few per cent. So a search over the band holds them, and a few frequencies round its peaks are solved
with free ones, each started from the nearest motion that is known. In the same way the peak of a
blade that is not the highest is closed in.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..hbm.solver.newton import DEFAULT_OPTIONS, Options
from .model import Pattern, Wheel
from .resonance import Respond, WheelPeak, find_wheel_peak
from .solve import WheelSolution, solve_wheel

# times that a bracket is widened, each time to twice its width, until it encloses a maximum
MOST_WIDENINGS = 6
# of the frequency: from the peak of held means to the first points on both sides, at most. On the
# shipped wheel points 0.07 % apart take 2 s each, and one 0.4 % away is not reached from the peak
FIRST_REACH = 1e-3
# of that: where a point at it is not solved
NEARER_REACH = 0.5
# over the largest relative change by free means that was seen: the change at other peaks
CHANGE_MARGIN = 2.0


@dataclass(frozen=True)
class LocalPeak:
    """The highest point of some blades by other balances than those of a first search."""

    # of these blades, with the points of the first search outside of what was searched again
    peak: WheelPeak
    solution: WheelSolution
    # relative change of the height against the first search
    change: float
    # points that were solved
    points: int


@dataclass
class LocalBalances:
    """Balances of a wheel at the frequencies that were asked for, each from the nearest one."""

    wheel: Wheel
    pattern: Pattern
    harmonics: int
    samples: int
    # fallbacks may take many times as long as the point is worth
    options: Options = DEFAULT_OPTIONS
    # the first point's start; the tuned wheel when None
    start: WheelSolution | None = None
    # by circular frequency of the common period [rad/s]
    points: dict[float, WheelSolution] = field(default_factory=dict)

    def __call__(self, omega: float) -> np.ndarray:
        """(N,) amplitudes of the blades [m], NaN where the point is not solved."""
        if omega not in self.points:
            known = [point for point in self.points.values() if point.converged]
            nearest = min(known, key=lambda point: abs(point.omega - omega), default=self.start)
            self.points[omega] = solve_wheel(
                self.wheel,
                omega,
                self.harmonics,
                self.samples,
                pattern=self.pattern,
                start=nearest,
                options=self.options,
            )
        point = self.points[omega]
        return point.size() if point.converged else np.full(self.wheel.count, np.nan)


def find_local_peak(
    balances: LocalBalances,
    first: WheelPeak,
    tolerance: float,
    blades: np.ndarray | None = None,
) -> LocalPeak | None:
    """The highest point of some blades round their peaks of a first search; None where the balance
    is not found at the highest of these.

    Args:
        first: in circular frequencies of the common period.
        tolerance: relative gain of height that is not looked for.
        blades: (b,) their numbers, ascending; all when None.
    """
    every = np.arange(first.sizes.shape[1])
    own = every if blades is None else np.asarray(blades)

    def respond(omega: float) -> np.ndarray:
        return balances(omega)[own]

    solved = np.isfinite(first.sizes).all(axis=1)
    omegas, heights = first.omegas[solved], first.sizes[solved][:, own].max(axis=1)
    found: list[WheelPeak] = []
    change = tolerance / CHANGE_MARGIN
    for i in _maxima(heights):
        best = max((peak.height for peak in found), default=0.0)
        if heights[i] * (1 + CHANGE_MARGIN * change) <= best:
            break
        grid = _bracket(respond, omegas, i)
        if grid is None:
            if not found:
                return None
            continue
        found.append(find_wheel_peak(respond, grid, tolerance))
        change = max(change, abs(found[-1].height / heights[i] - 1))
    best_one = max(found, key=lambda peak: peak.height)
    searched = [(peak.omegas[0], peak.omegas[-1]) for peak in found]
    peak = _joined(first, balances, searched, replace(best_one, blade=int(own[best_one.blade])))
    return LocalPeak(
        peak, balances.points[peak.omega], peak.height / heights.max() - 1, len(balances.points)
    )


def _maxima(heights: np.ndarray) -> np.ndarray:
    """Numbers of the local maxima of a curve, its ends among them, the highest first."""
    padded = np.concatenate([[-np.inf], heights, [-np.inf]])
    is_peak = (heights >= padded[:-2]) & (heights >= padded[2:])
    numbers = np.flatnonzero(is_peak)
    return numbers[np.argsort(-heights[numbers], kind="stable")]


def _bracket(respond: Respond, omegas: np.ndarray, i: int) -> np.ndarray | None:
    """(k,) ascending circular frequencies round point i of a curve, of which an inner one has the
    highest amplitude where widening leads to one; None where the balance at the point itself is not
    found.
    """
    if not np.isfinite(respond(omegas[i])).all():
        return None
    reach = FIRST_REACH * omegas[i]
    below = min(reach, omegas[i] - omegas[i - 1]) if i > 0 else reach
    above = min(reach, omegas[i + 1] - omegas[i]) if i + 1 < len(omegas) else reach
    sides = [_solved_beside(respond, omegas[i], reach) for reach in (-below, above)]
    grid = [sides[0], omegas[i], sides[1]]
    for _ in range(MOST_WIDENINGS):
        sizes = np.array([respond(w) for w in grid])
        heights = np.where(np.isfinite(sizes), sizes, 0.0).max(axis=1)
        top = int(np.argmax(heights))
        width = grid[-1] - grid[0]
        if top == 0:
            grid.insert(0, grid[0] - width)
        elif top == len(grid) - 1:
            grid.append(grid[-1] + width)
        else:
            break
    return np.array(grid)


def _solved_beside(respond: Respond, omega: float, reach: float) -> float:
    """The circular frequency that far from another, or nearer where only that one is solved."""
    far, near = omega + reach, omega + NEARER_REACH * reach
    if not np.isfinite(respond(far)).all() and np.isfinite(respond(near)).all():
        return near
    return far


def _joined(
    first: WheelPeak,
    balances: LocalBalances,
    searched: list[tuple[float, float]],
    best: WheelPeak,
) -> WheelPeak:
    """The best peak with all blades at all points of the balances, and at those of the first search
    outside of what was searched again.
    """
    outside = np.ones(len(first.omegas), dtype=bool)
    for low, high in searched:
        outside &= (first.omegas < low) | (first.omegas > high)
    own = np.array(list(balances.points))
    omegas = np.concatenate([first.omegas[outside], own])
    sizes = np.concatenate([first.sizes[outside], [balances(omega) for omega in own]])
    order = np.argsort(omegas)
    solved = np.isfinite(sizes).all(axis=1)
    return replace(
        best,
        by_blade=sizes[solved].max(axis=0),
        omegas=omegas[order],
        sizes=sizes[order],
        unsolved=int((~solved).sum()),
    )

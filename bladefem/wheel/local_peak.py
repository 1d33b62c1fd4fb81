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
from .resonance import LOST_GAIN, Respond, WheelPeak, find_wheel_peak, lost_gain
from .solution import WheelSolution
from .solve import solve_wheel

# of the frequency: from the peak of held means to the first points on both sides, at most. On the
# shipped wheel points 0.07 % apart take 2 s each
FIRST_REACH = 1e-3
# of that: the shortest step from a solved point to a next one
SHORTEST_STEP = 1 / 16
# steps to the higher side until a maximum is enclosed, each up to twice as long as the one before
MOST_STEPS = 24
# of a step that was halved: the next one, so that it passes a point that was lost from farther away
NEXT_STEP = 0.8
# of the distance of two solved points: how far from them their secant predicts
LONGEST_PREDICTION = 4.0
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
    # flexibility products of one attempt; None: as many as it takes
    most_products: int | None = None
    # by circular frequency of the common period [rad/s]
    points: dict[float, WheelSolution] = field(default_factory=dict)

    def __call__(self, omega: float) -> np.ndarray:
        """(N,) amplitudes of the blades [m], NaN where the point is not solved."""
        if omega not in self.points:
            self.points[omega] = solve_wheel(
                self.wheel,
                omega,
                self.harmonics,
                self.samples,
                pattern=self.pattern,
                start=self._start(omega),
                options=self.options,
                most_products=self.most_products,
            )
        point = self.points[omega]
        return point.size() if point.converged else np.full(self.wheel.count, np.nan)

    def _start(self, omega: float) -> WheelSolution | None:
        """The nearest point, or the secant through the two nearest where the same dampers walk: a
        curve is then followed over a fold's shoulder, where its slope is large.
        """
        known = [point for point in self.points.values() if point.converged]
        near = sorted(known, key=lambda point: abs(point.omega - omega))[:2]
        if len(near) < 2:
            return near[0] if near else self.start
        first, second = near
        share = (omega - first.omega) / (first.omega - second.omega)
        if not _walk_alike(first, second) or abs(share) > LONGEST_PREDICTION:
            return first
        return replace(first, w=first.w + share * (first.w - second.w))


def _walk_alike(one: WheelSolution, other: WheelSolution) -> bool:
    """True where some dampers walk, and the same ones in both solutions."""
    if one.walk is None or other.walk is None:
        return False
    return bool((one.walk.dampers == other.walk.dampers).all())


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
    highest amplitude where the curve can be followed to one; None where the balance at the point
    itself is not found.
    """
    curve = _Followed(respond, omegas[i])
    if not curve.solved:
        return None
    reach = FIRST_REACH * omegas[i]
    below = min(reach, omegas[i] - omegas[i - 1]) if i > 0 else reach
    above = min(reach, omegas[i + 1] - omegas[i]) if i + 1 < len(omegas) else reach
    curve.steps = {-1: below, 1: above}
    curve.extend(-1)
    curve.extend(1)
    for _ in range(MOST_STEPS):
        side = curve.higher_side()
        if side == 0 or not curve.extend(side):
            break
    return np.array(sorted(curve.heights))


class _Followed:
    """A curve that is followed from one frequency to both sides, by steps that get longer until a
    point is not solved, and shorter from then on.
    """

    def __init__(self, respond: Respond, first: float) -> None:
        self.respond = respond
        # highest amplitude by circular frequency; NaN: not solved
        self.heights: dict[float, float] = {}
        # length of the next step downwards (-1) and upwards (1) [rad/s]
        self.steps: dict[int, float] = {}
        self.solved = self.add(first)

    def add(self, omega: float) -> bool:
        """Ask for a point; False where it is not solved."""
        height = float(self.respond(omega).max())
        self.heights[omega] = height
        return bool(np.isfinite(height))

    def end(self, side: int) -> float:
        """The outermost frequency that is solved."""
        solved = (omega for omega, height in self.heights.items() if np.isfinite(height))
        return max(solved, key=lambda omega: side * omega)

    def higher_side(self) -> int:
        """The end that has the highest amplitude, -1 or 1, where beyond it there may be more than
        what a search leaves; else 0.
        """
        omegas = np.array(sorted(self.heights))
        heights = np.array([self.heights[omega] for omega in omegas])
        top = omegas[np.nanargmax(heights)]
        side = next((side for side in (-1, 1) if top == self.end(side)), 0)
        return side if lost_gain(omegas, heights) > LOST_GAIN else 0

    def extend(self, side: int) -> bool:
        """Go one step on; False where no point is solved at the end of a shortest one."""
        end = self.end(side)
        step = self.steps[side]
        shortest = min(step, SHORTEST_STEP * FIRST_REACH * end)
        longer = 2.0
        while step >= shortest:
            if self.add(end + side * step):
                self.steps[side] = longer * step
                return True
            step /= 2
            longer = NEXT_STEP
        return False


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

"""The response of all blades of a scene's wheel with one pattern, under each damper load."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...hbm.linear_resonances import free_resonances
from ...wheel.linear_motion import free_wheel, stuck_wheel
from ...wheel.local_peak import LocalBalances
from ...wheel.model import Pattern, Wheel
from ...wheel.resonance import WheelPeak, find_wheel_peak
from ...wheel.solution import WheelSolution
from ...wheel.statistics import wheel_respond
from ...wheel.tuned import tuned_sector
from ..pipeline.curve import Curve
from .deciding_blades import BladeStress, DecidingBlade, deciding_blades
from .other_blades import OtherBlades
from .peak_choice import (
    SEARCH_TOLERANCE,
    ChosenPeak,
    SearchedWheel,
    chosen_peak,
    first_balance,
    in_common_period,
    local_peak,
)
from .sector_comparison import SectorComparison, compared_with_sector

# points of the first look at a band
FIRST_LOOK_POINTS = 15
# of the linear wheel in the half-power width of its resonances, and over the band at least and at
# most; the search closes in on what they find
LINEAR_POINTS_PER_WIDTH = 4
LINEAR_POINTS = 60, 300
# resonances with sticking dampers that are looked at
MAX_RESONANCES = 8


@dataclass(frozen=True)
class FreeMeans:
    """What free mean displacements of the dampers change at the wheel's highest point."""

    # the highest blade with held ones [m]
    held: float
    # relative change of it; NaN: no balance with free ones was found, and means are held
    change: float
    # dampers that walk, and the fastest of them [m/s]
    walking: int = 0
    speed: float = 0.0
    # points that were solved with free means
    points: int = 0


@dataclass(frozen=True)
class PatternResponse:
    """One load; N blades, q families."""

    # [N], and of the damper [kg]
    load: float
    mass: float | None
    # (N, q) relative deviations of the blade-alone frequencies
    deviation: np.ndarray
    # of the scene's engine order, among those of the common period of all orders
    harmonic: int
    # peak of the tuned wheel [m]
    tuned: float
    # the mistuned wheel with friction
    peak: WheelPeak
    # its solution at the peak, in harmonics of the common period
    solution: WheelSolution
    # amplification of the same pattern without dampers
    free_factor: float
    # relative change of the peak's height by `judging_balances`; NaN: not solved
    truncation: float
    # relative difference of the tuned peak from that of the sector's own curve, whose means are
    # free; NaN where that curve knows fewer engine orders
    sector_difference: float
    # the highest blade of each shape at its resonance, that of the peak first
    blades: tuple[DecidingBlade, ...]
    # the tuned peak against the resonance that the run gives
    compared: SectorComparison
    # None where the scene holds means, or no damper has a motion that friction alone resists
    free_means: FreeMeans | None = None
    # blades of another shape
    others: OtherBlades | None = None
    # numbers of the blades of a shape whose own peak was not found
    lost_blades: tuple[int, ...] = ()

    @property
    def highest(self) -> DecidingBlade:
        """The blade of the peak."""
        return self.blades[0]

    @property
    def factor(self) -> float:
        """Highest blade over the tuned wheel."""
        return self.peak.height / self.tuned

    @property
    def frequency(self) -> float:
        """Frequency of the scene's engine order at the peak [Hz]."""
        return self.harmonic * self.solution.frequency

    @property
    def phase(self) -> np.ndarray:
        """(N,) of the blades in the scene's engine order, at the peak [rad]."""
        return np.angle(self.solution.probe[:, self.harmonic, 0])


def frequency_grid(
    wheel: Wheel,
    curve: Curve,
    pattern: Pattern,
    spread: float,
    harmonic: int = 1,
) -> np.ndarray:
    """(k,) circular frequencies of the scene's engine order to look at first, as far as deviations
    reach [rad/s].

    Even steps find the broad resonances of sliding dampers; where dampers stick a blade resonates
    as sharply as its own damping lets it, at resonances of the linear wheel, which are added.

    Args:
        spread: largest relative deviation of frequency.
        harmonic: of that engine order.
    """
    model = tuned_sector(wheel, harmonic)
    own = curve.peak.omega
    ends = [own]
    if model is not None:
        free = harmonic * free_resonances(model, harmonic)
        ends.append(float(free[np.argmin(abs(free - own))]))
    low = min(ends) * (1 - spread)
    high = max(ends) * (1 + spread)
    return np.union1d(
        np.linspace(low, high, FIRST_LOOK_POINTS), _stuck_peaks(wheel, pattern, low, high, harmonic)
    )


def _stuck_peaks(
    wheel: Wheel,
    pattern: Pattern,
    low: float,
    high: float,
    harmonic: int,
) -> np.ndarray:
    """Circular frequencies of the highest resonances with all contacts sticking."""
    fine = linear_grid(wheel, low, high)
    highest = max(wheel.excitation)
    sizes = [stuck_wheel(wheel, w / harmonic, highest, pattern)[:, 1:, 0] for w in fine]
    height = np.linalg.norm(np.array(sizes), axis=2).max(axis=1)
    inner = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])) + 1
    return fine[inner[np.argsort(-height[inner])[:MAX_RESONANCES]]]


def linear_grid(wheel: Wheel, low: float, high: float) -> np.ndarray:
    """(k,) circular frequencies of a band, as dense as the resonances of the linear wheel are wide
    by the damping of its modes.
    """
    fewest, most = LINEAR_POINTS
    if wheel.influence is not None:
        # the flow may narrow some of them
        return np.linspace(low, high, most)
    middle = 0.5 * (low + high)
    damping = wheel.damping
    loss = np.min(damping.viscous(np.array(middle)) / middle + damping.structural)
    wanted = LINEAR_POINTS_PER_WIDTH * (high / low - 1) / max(loss, np.finfo(float).tiny)
    return np.linspace(low, high, int(np.clip(wanted, fewest, most)))


def pattern_response(
    searched: SearchedWheel,
    deviation: np.ndarray,
    curve: Curve,
    stress: BladeStress,
    others: OtherBlades | None,
    wanted: float | None,
    accuracy: float,
) -> PatternResponse:
    """The wheel with one pattern, under the load of a curve.

    Args:
        searched: the wheel under that load.
        deviation: (N, q) relative deviations of the blade-alone frequencies.
        stress: of a blade, by the pattern, the solution and the blade's number; of one of another
            shape also that on its own mesh.
        others: the blades of another shape in the pattern.
        wanted: estimated error by harmonics and samples above which there are more of them; None:
            those of the curve.
        accuracy: relative, of the comparison with the curve beyond its own error.
    """
    wheel, pattern, harmonic = searched.wheel, searched.pattern, searched.harmonic
    grid = frequency_grid(wheel, curve, pattern, abs(deviation).max() + 0.005, harmonic)
    found = chosen_peak(searched, grid, first_balance(wheel, curve, harmonic), wanted)
    found, tuned = _with_tuned(searched, found, curve)
    blades, lost = deciding_blades(searched, found, others, stress)
    return PatternResponse(
        curve.load,
        curve.mass,
        deviation,
        harmonic,
        tuned.height,
        found.peak,
        found.solution,
        free_factor(wheel, pattern, grid, harmonic),
        found.truncation,
        _over_sector(wheel, tuned, curve),
        blades,
        compared_with_sector(wheel, curve, tuned.height, accuracy),
        None if searched.free is None else _free_means(found),
        others,
        lost,
    )


def _with_tuned(
    searched: SearchedWheel, found: ChosenPeak, curve: Curve
) -> tuple[ChosenPeak, WheelPeak]:
    """The peak of a pattern and that of the tuned wheel, the same way, so that their ratio compares
    like with like: with free means where both are found with these.
    """
    H, samples = found.harmonics, found.samples
    harmonic, free = searched.harmonic, searched.free
    respond = wheel_respond(searched.wheel, Pattern(), H, samples, searched.options)
    held = find_wheel_peak(
        in_common_period(respond, harmonic),
        curve.peak.omega * np.array([0.998, 1.0, 1.002]),
        SEARCH_TOLERANCE,
    )
    if free is None or found.free is None:
        return found, held
    balances = LocalBalances(free, Pattern(), H, samples, searched.without_fallbacks)
    tuned = local_peak(balances, held, harmonic)
    return (replace(found, free=None), held) if tuned is None else (found, tuned.peak)


def _over_sector(wheel: Wheel, tuned: WheelPeak, curve: Curve) -> float:
    """Relative rise of the tuned wheel's peak above the sector's balance; NaN where several engine
    orders excite it.
    """
    return tuned.height / curve.balance_amplitude - 1 if len(wheel.excitation) == 1 else np.nan


def _free_means(found: ChosenPeak) -> FreeMeans:
    """What free means changed at a peak."""
    free = found.free
    if free is None:
        return FreeMeans(found.held.height, float("nan"))
    drift = free.solution.drift
    return FreeMeans(
        found.held.height,
        free.change,
        int(np.count_nonzero(drift)),
        float(drift.max(initial=0.0)),
        free.points,
    )


def free_factor(
    wheel: Wheel,
    pattern: Pattern,
    grid: np.ndarray,
    harmonic: int,
) -> float:
    """Amplification without dampers over the same band."""
    fine = linear_grid(wheel, grid[0], grid[-1])
    highest = max(wheel.excitation)

    def respond(pattern: Pattern) -> float:
        def sizes(w: float) -> np.ndarray:
            moving = free_wheel(wheel, w / harmonic, highest, pattern)[:, 1:, 0]
            return np.linalg.norm(moving, axis=1)

        return find_wheel_peak(sizes, fine, SEARCH_TOLERANCE).height

    return respond(pattern) / respond(replace(pattern, stiffness=None, mass=None))

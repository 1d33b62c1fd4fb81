"""What scatter does to a wheel with dampers: amplification of the highest blade over the tuned
wheel, for each damper load, with intervals of confidence, and the load that is best for a share of
all wheels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from ..errors import InputError
from ..hbm.linear.bodies import modal_flexibility
from ..hbm.model import ReducedModel
from ..hbm.solution import Solution
from ..hbm.solve import solve
from ..hbm.solver.newton import DEFAULT_OPTIONS, Options
from ..scene.units import newtons
from ..util.arrays import BooleanArray, IntegerArray, RealArray
from ..util.communicator import Communicator
from ..util.curve_extremum import parabola_minimum
from ..util.progress import Progress, without_progress
from .model import TUNED_PATTERN, Pattern, Wheel
from .one_body import one_body_model
from .pattern_peak import PatternPeak, compared_peaks, peak_heights
from .resonance import Respond, find_wheel_peak
from .solution import WheelSolution
from .solve import solve_wheel

CONFIDENCE_LEVEL = 0.95
# of the wheels that stay below what a design is made for
WHEEL_SHARE = 0.95
# of the bootstrap: its intervals then move by a few per cent of their width
BOOTSTRAP_RESAMPLES = 1000
# relative error of the height of a wheel's peak by its search
PEAK_TOLERANCE = 5e-3

# looks for the highest blade of a pattern under a damper load [N]
Search = Callable[[float, Pattern], PatternPeak]


@dataclass(frozen=True)
class Quantile:
    """A quantile of a sample with its interval of confidence."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class RobustOptimum:
    """The load under which a share of all wheels stays lowest, with intervals by the bootstrap."""

    # of the wheels
    share: float
    # [N]
    load: Quantile
    # quantile of the highest blade there [m]; its upper end is infinite with too few wheels
    height: Quantile
    # share of the resamples whose optimum is an end of the loads: they leave it open there
    at_end: float


@dataclass(frozen=True)
class Amplification:
    """Peaks of many wheels under several damper loads; L loads, W wheels."""

    # (L,) [N]
    loads: RealArray
    # (L,) peak of the tuned wheel [m], and where [rad/s]
    tuned: RealArray
    tuned_omega: RealArray
    # (L, W) peak of the highest blade [m], its number, and where [rad/s]
    peak: RealArray
    blade: IntegerArray
    omega: RealArray
    # (L, W) points that were not solved, and points altogether
    unsolved: IntegerArray
    points: IntegerArray
    # (L, C) numbers of the wheels that were checked by the whole wheel, their amplification by it
    # and by the damper law, which the checks calibrate; C = 0 where all wheels are whole
    checked: IntegerArray
    whole: RealArray
    law: RealArray
    # (L,) harmonics of the balance of whole wheels, and the relative error that they and the
    # samples leave in a peak's height; empty where nothing chose them
    harmonics: IntegerArray = field(default_factory=lambda: np.zeros(0, dtype=int))
    truncation: RealArray = field(default_factory=lambda: np.zeros(0))
    # (L,) harmonics of the damper law; empty where all wheels are whole
    law_harmonics: IntegerArray = field(default_factory=lambda: np.zeros(0, dtype=int))
    # (L,) peak of the tuned wheel with held mean displacements [m], where free ones were asked for:
    # NaN elsewhere; empty where no whole wheel was solved
    tuned_held: RealArray = field(default_factory=lambda: np.zeros(0))
    # (L,) peak of the tuned wheel by the balance of all blades and by the sector's own response,
    # whose errors are judged and which counts where both do not agree [m], NaN where that is the
    # response to other forces; empty where they were not compared
    tuned_balance: RealArray = field(default_factory=lambda: np.zeros(0))
    tuned_sector: RealArray = field(default_factory=lambda: np.zeros(0))
    # (L,) both agree within the error of the latter; where they do not amplifications are those of
    # a balance that does not describe the wheel
    agrees: BooleanArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    # (L, C) of the wheels that were checked, (L, W) where all are whole: amplification with held
    # means of both, and whether the one with free means is known, which then counts
    held_factor: RealArray = field(default_factory=lambda: np.zeros((0, 0)))
    mean_released: BooleanArray = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))

    @property
    def check_errors(self) -> np.ndarray:
        """(L, C) relative difference of the law's amplification from the whole wheel's."""
        return self.law / self.whole - 1

    @property
    def calibration(self) -> np.ndarray:
        """(L,) amplification over that by the law: the mean of the checked wheels."""
        if not self.law.shape[1]:
            return np.ones(len(self.loads))
        return np.asarray((self.whole / self.law).mean(axis=1))

    @property
    def calibration_bounds(self) -> np.ndarray:
        """(L, 2) lowest and highest amplification of a checked wheel over the calibrated law's; 1
        lies between them. Both are 1 where every wheel is whole.
        """
        bounds = np.ones((len(self.loads), 2))
        if self.checked.shape[1] < self.factor.shape[1]:
            off = self.whole / self.law / self.calibration[:, None]
            bounds[:, 0] = off.min(axis=1, initial=1.0)
            bounds[:, 1] = off.max(axis=1, initial=1.0)
        return bounds

    @property
    def is_known(self) -> BooleanArray:
        """(L,) False where the balance does not describe the wheel: see `agrees`."""
        return self.agrees if len(self.agrees) else np.ones(len(self.loads), dtype=bool)

    @property
    def factor(self) -> np.ndarray:
        """(L, W) amplification over the tuned wheel under the same load [1]."""
        return self.peak / self.tuned[:, None]

    @property
    def released_change(self) -> np.ndarray:
        """Relative change of the amplification by free means, in the shape of `held_factor` [1]."""
        whole = self.whole if self.checked.shape[1] else self.factor
        return whole / self.held_factor - 1

    @property
    def released_effect(self) -> np.ndarray:
        """(L,) largest relative change of an amplitude by free means, of the tuned wheel and of
        those solved in full; zero where means are held.
        """
        tuned = (self.tuned / self.tuned_held)[:, None]
        others = tuned * np.where(self.mean_released, 1 + self.released_change, 1.0)
        changes = abs(np.hstack([tuned, others]) - 1).max(axis=1)
        return np.where(np.isnan(self.tuned_held), 0.0, changes)

    def quantile(
        self,
        load: int,
        share: float,
        confidence: float = CONFIDENCE_LEVEL,
    ) -> Quantile:
        """Quantile of the amplification under the load with a number [1]; its interval is that of
        the sample, widened by what checked wheels are off the calibrated law.
        """
        found = quantile_interval(self.factor[load], share, confidence)
        low, high = self.calibration_bounds[load]
        return Quantile(found.value, float(low * found.low), float(high * found.high))

    def quantiles(self, share: float) -> list[Quantile]:
        """Quantile of the amplification under each load [1]."""
        return [self.quantile(i, share) for i in range(len(self.loads))]


def quantile_interval(
    sample: np.ndarray,
    share: float,
    confidence: float = CONFIDENCE_LEVEL,
) -> Quantile:
    """A quantile, with the distribution-free interval of order statistics.

    Between order statistics i and j lies the quantile with the probability that a binomial count
    falls between them (David and Nagaraja, Order Statistics, 2003, Sect. 7.1). Where the sample is
    too small for the wanted confidence the interval ends are the extremes, or infinite.
    """
    # slow to load, and all commands load this module
    from scipy.stats import binom

    ordered = np.sort(np.asarray(sample, dtype=float))
    n = len(ordered)
    tail = (1 - confidence) / 2
    low = int(binom.ppf(tail, n, share))
    high = int(binom.ppf(1 - tail, n, share)) + 1
    value = float(np.quantile(ordered, share))
    return Quantile(
        value,
        float(ordered[low - 1]) if low >= 1 else -np.inf,
        float(ordered[high - 1]) if high <= n else np.inf,
    )


def scatter_statistics(
    patterns: Mapping[float, Sequence[Pattern]],
    search: Search,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> Amplification:
    """Peaks of all patterns under all loads; wheels are dealt out over the ranks.

    Args:
        patterns: damper load [N] to the patterns, as many for each.
        search: looks for the highest blade, of the tuned wheel too.
        progress: wraps the list of wheels of this rank.
    """
    loads = list(patterns)
    sizes = {len(patterns[load]) for load in loads}
    if len(sizes) != 1 or not loads:
        raise InputError(f"patterns: {sorted(sizes)} for the loads, expected the same number")
    return joined_loads(
        [_statistics_of_load(load, patterns[load], search, comm, progress) for load in loads]
    )


def _statistics_of_load(
    load: float,
    patterns: Sequence[Pattern],
    search: Search,
    comm: Communicator | None,
    progress: Progress,
) -> Amplification:
    """Peaks of all patterns under one load."""
    rank, ranks = (comm.rank, comm.size) if comm is not None else (0, 1)
    mine = range(rank, len(patterns), ranks)
    tuned = search(load, TUNED_PATTERN)
    rows = np.zeros((7, len(patterns)))
    for j in progress(list(mine), f"wheels under {newtons(load)}", len(mine)):
        found = search(load, patterns[j])
        # where the tuned wheel has no free means, the others' do not count
        peak = found.held if tuned.free is None else found.peak
        rows[:3, j] = peak_heights(found)
        rows[3:, j] = peak.blade, peak.omega, peak.unsolved, len(peak.omegas)
    if comm is not None:
        rows = comm.allreduce(rows)
    compared = compared_peaks(np.column_stack([peak_heights(tuned), rows[:3]]))
    blade, omega, unsolved, points = rows[3:]
    return Amplification(
        np.array([load]),
        np.array([compared.tuned]),
        np.array([tuned.peak.omega]),
        compared.height[None],
        blade.astype(int)[None],
        omega[None],
        unsolved.astype(int)[None],
        points.astype(int)[None],
        *no_checks(1),
        tuned_held=np.array([compared.tuned_held]),
        held_factor=compared.held_factor[None],
        mean_released=compared.mean_released[None],
    )


def unknown_statistics(load: float, tuned: PatternPeak, wheels: int, checks: int) -> Amplification:
    """Statistics of one load whose wheels were not solved: each counts as high as the tuned one,
    below which the highest blade does not stay.

    Args:
        checks: wheels that are checked under other loads.
    """
    none = np.zeros((1, wheels), dtype=int)
    alike = np.ones((1, checks))
    omega = np.array([tuned.peak.omega])
    asked = tuned.held.height if tuned.asked else float("nan")
    return Amplification(
        np.array([load]),
        np.array([tuned.peak.height]),
        omega,
        np.full((1, wheels), tuned.peak.height),
        none,
        np.broadcast_to(omega, (1, wheels)).copy(),
        none,
        none,
        np.arange(checks)[None],
        alike,
        alike,
        law_harmonics=np.zeros(1 if checks else 0, dtype=int),
        tuned_held=np.array([asked]),
        held_factor=np.ones((1, checks or wheels)),
        mean_released=np.zeros((1, checks or wheels), dtype=bool),
    )


def band_search(
    wheels: Mapping[float, Wheel],
    grid: Callable[[float, Pattern], np.ndarray],
    respond: Callable[[Wheel, Pattern], Respond],
) -> Search:
    """A search over a band, with the means as the wheels have them.

    Args:
        wheels: damper load [N] to the tuned wheel under it.
        grid: damper load and pattern to the first circular frequencies of the search.
        respond: what solves one pattern at one frequency.
    """
    return lambda load, pattern: PatternPeak(
        find_wheel_peak(respond(wheels[load], pattern), grid(load, pattern), PEAK_TOLERANCE)
    )


def no_checks(loads: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`Amplification.checked`, `whole` and `law` of statistics whose wheels are whole."""
    return np.zeros((loads, 0), dtype=int), np.zeros((loads, 0)), np.zeros((loads, 0))


def joined_loads(parts: Sequence[Amplification]) -> Amplification:
    """The statistics of the same wheels under several loads."""
    return Amplification(
        **{
            one.name: np.concatenate([getattr(part, one.name) for part in parts])
            for one in fields(Amplification)
        }
    )


def best_load(loads: np.ndarray, heights: np.ndarray) -> tuple[float, float]:
    """The load with the smallest height, between the loads by a parabola in the logarithms."""
    i = int(np.argmin(heights))
    if i in (0, len(loads) - 1):
        return float(loads[i]), float(heights[i])
    x = np.log(loads[i - 1 : i + 2])
    y = np.log(heights[i - 1 : i + 2])
    vertex = parabola_minimum(x, y)
    if vertex is None:
        return float(loads[i]), float(heights[i])
    return float(np.exp(vertex[0])), float(np.exp(vertex[1]))


def robust_optimum(
    found: Amplification,
    share: float = WHEEL_SHARE,
    confidence: float = CONFIDENCE_LEVEL,
) -> RobustOptimum:
    """The load with the smallest quantile of the highest blade, between the loads.

    The interval is the bootstrap's: wheels are drawn again with replacement, each with its peaks
    under all loads, as the same patterns are under each of them (Efron and Tibshirani, An
    Introduction to the Bootstrap, 1993, Sect. 13.3). Under each load apart all peaks of a resample
    are taken at one or the other of `calibration_bounds`. It knows the scatter of the sample and of
    the law, not what lies between the loads.

    No resample is higher than the highest wheel drawn, which more than one sample in five has below
    its true 95 % quantile where it has 30 wheels. So the height ends no lower than the quantile at
    the best load studied does by order statistics: infinite with too few wheels.

    Args:
        share: of the wheels that stay below.
        confidence: of the intervals.
    """
    rng = np.random.default_rng(0)
    loads, wheels = found.peak.shape
    drawn = rng.integers(wheels, size=(BOOTSTRAP_RESAMPLES, wheels))
    heights = np.quantile(found.peak[:, drawn], share, axis=2).T
    side = rng.integers(2, size=heights.shape)
    heights *= found.calibration_bounds[np.arange(loads), side]
    ends = np.array([best_load(found.loads, row) for row in heights])
    tail = 100 * (1 - confidence) / 2
    low, high = np.percentile(ends, [tail, 100 - tail], axis=0)
    load, height = best_load(found.loads, np.quantile(found.peak, share, axis=1))
    lowest = heights.argmin(axis=1)
    sample = found.quantile(int(np.quantile(found.peak, share, axis=1).argmin()), share, confidence)
    highest = max(float(high[1]), height * sample.high / sample.value)
    return RobustOptimum(
        share,
        Quantile(load, float(low[0]), float(high[0])),
        Quantile(height, float(low[1]), highest),
        float(np.mean((lowest == 0) | (lowest == loads - 1))),
    )


def wheel_respond(
    wheel: Wheel,
    pattern: Pattern,
    H: int,
    samples: int,
    options: Options = DEFAULT_OPTIONS,
) -> Respond:
    """Amplitudes by the matrix-free balance, each point from the nearest one solved."""
    known: list[WheelSolution] = []

    def respond(omega: float) -> np.ndarray:
        start = min(known, key=lambda s: abs(s.omega - omega), default=None)
        point = solve_wheel(wheel, omega, H, samples, pattern=pattern, start=start, options=options)
        if not point.converged:
            return np.full(wheel.count, np.nan)
        known.append(point)
        return point.size()

    return respond


def one_body_respond(
    wheel: Wheel,
    pattern: Pattern,
    H: int,
    samples: int,
) -> Respond:
    """Amplitudes by the balance of `bladefem.hbm` on one body: small wheels, thousands of
    points.
    """
    model = one_body_model(wheel, pattern)
    known: list[Solution] = []

    def respond(omega: float) -> np.ndarray:
        start = min(known, key=lambda s: abs(s.omega - omega), default=None)
        point = solve(model, omega, H, samples, start=start)
        if not point.converged:
            return np.full(wheel.count, np.nan)
        known.append(point)
        return _blade_sizes(point.probe, wheel.count)

    return respond


def free_respond(wheel: Wheel, pattern: Pattern) -> Respond:
    """Amplitudes without contact forces, by the modes of the mistuned wheel."""
    model: ReducedModel = one_body_model(wheel, pattern)
    H = max((1, *model.excitation))
    blades = model.blades(H)
    force = blades.shapes[0, blades.load].T @ model.loads(H).T

    def respond(omega: float) -> np.ndarray:
        modal = modal_flexibility(blades, omega * np.arange(H + 1)).T * force
        return _blade_sizes((blades.shapes[0, blades.probe] @ modal).T, wheel.count)

    return respond


def _blade_sizes(probe: np.ndarray, count: int) -> np.ndarray:
    """(N,) sizes of the first probe of each blade from amplitudes (H+1, N probes)."""
    moving = probe[1:].reshape(len(probe) - 1, count, -1)[:, :, 0]
    return np.linalg.norm(moving, axis=0)

"""The response of all blades of a scene's wheel with one pattern, under each damper load."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...hbm.linear_resonances import free_resonances
from ...hbm.solver.newton import DEFAULT_OPTIONS, Options
from ...scene.tables import Scene
from ...wheel.model import Pattern, Wheel
from ...wheel.resonance import Respond, WheelPeak, find_wheel_peak
from ...wheel.solve import WheelSolution, free_wheel, solve_wheel, stuck_wheel
from ...wheel.statistics import wheel_respond
from ...wheel.tuned import tuned_sector
from ...wheel.walking import walking_motions
from ..pipeline.damped_motion import DampedStress
from ..pipeline.loads import Curve
from .other_blades import OtherBlades, other_blade_sentences
from .own_stress import OwnStress

# points of the first look at a band
FIRST_LOOK_POINTS = 15
# of the linear wheel, which costs little
LINEAR_POINTS = 300
# resonances with sticking dampers that are looked at
MAX_RESONANCES = 8
# harmonics of the engine order beyond which the indicator asks for no more
MOST_HARMONICS = 15
# harmonics that judge the error at least where one is excited: a higher one may meet a lightly
# damped mode, of which the next one alone knows nothing
JUDGING_HARMONICS = 7
# flexibility products of one point up to which all points of a search may be solved like it
MOST_SEARCH_PRODUCTS = 400
# relative error of a peak's height by the search over frequencies
SEARCH_TOLERANCE = 0.01


@dataclass(frozen=True)
class FreeMeans:
    """What the wheel does at its highest point where the dampers' mean displacements are free."""

    # relative change of the highest blade; NaN: not solved
    change: float
    # dampers that walk, and the fastest of them [m/s]
    walking: int
    speed: float


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
    # peak of the tuned wheel [m] and where [Hz]
    tuned: float
    tuned_frequency: float
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
    # of the blade that moves most, at its resonance
    stress: DampedStress
    # None where the scene holds means, or no damper has a motion that friction alone resists
    free_means: FreeMeans | None = None
    # blades of another shape
    others: OtherBlades | None = None
    # of that blade on its own mesh, where it has another shape
    own_stress: OwnStress | None = None

    @property
    def worst(self) -> DampedStress | OwnStress:
        """The stress of the highest blade on the mesh of its own shape."""
        return self.stress if self.own_stress is None else self.own_stress

    @property
    def factor(self) -> float:
        """Highest blade over the tuned wheel."""
        return self.peak.height / self.tuned

    @property
    def frequency(self) -> float:
        """Of the scene's engine order, at the peak [Hz]."""
        return self.harmonic * self.solution.frequency

    @property
    def phase(self) -> np.ndarray:
        """(N,) of the blades in the scene's engine order, at the peak [rad]."""
        return np.angle(self.solution.probe[:, self.harmonic, 0])


def in_common_period(respond: Respond, harmonic: int) -> Respond:
    """What a wheel answers at a circular frequency of its own engine order, from what it answers at
    that of the common period of all orders.
    """
    return lambda omega: respond(omega / harmonic)


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
    fine = np.linspace(low, high, LINEAR_POINTS)
    highest = max(wheel.excitation)
    sizes = [stuck_wheel(wheel, w / harmonic, highest, pattern)[:, 1:, 0] for w in fine]
    height = np.linalg.norm(np.array(sizes), axis=2).max(axis=1)
    inner = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])) + 1
    return fine[inner[np.argsort(-height[inner])[:MAX_RESONANCES]]]


def pattern_response(
    wheel: Wheel,
    pattern: Pattern,
    deviation: np.ndarray,
    curve: Curve,
    stress: Callable[[Pattern, WheelSolution, int], tuple[DampedStress, OwnStress | None]],
    others: OtherBlades | None = None,
    options: Options = DEFAULT_OPTIONS,
    harmonic: int = 1,
    wanted: float | None = None,
    held_means: bool = True,
) -> PatternResponse:
    """The wheel with one pattern, under the load of a curve.

    Args:
        wheel: the tuned wheel under that load.
        pattern: what differs from blade to blade.
        deviation: (N, q) relative deviations of the blade-alone frequencies.
        stress: of a blade, by the pattern, the solution and the blade's number; of one of another
            shape also that on its own mesh.
        others: the blades of another shape in the pattern.
        options: when a point is accepted.
        harmonic: of the scene's engine order.
        wanted: estimated error by harmonics and samples above which there are more of them; None:
            those of the curve.
        held_means: the scene holds them, and nobody asks what free ones do.
    """
    H, samples = first_balance(wheel, curve, harmonic)
    grid = frequency_grid(wheel, curve, pattern, abs(deviation).max() + 0.005, harmonic)
    found = chosen_peak(wheel, pattern, grid, (H, samples), harmonic, options, wanted)
    peak, solution = found.peak, found.solution
    H, samples = found.harmonics, found.samples
    # the same way to the tuned one, so that the factor compares like with like
    tuned = find_wheel_peak(
        in_common_period(wheel_respond(wheel, Pattern(), H, samples, options), harmonic),
        curve.peak.omega * np.array([0.998, 1.0, 1.002]),
        SEARCH_TOLERANCE,
    )
    one_order = len(wheel.excitation) == 1
    alternating, own = stress(pattern, solution, peak.blade)
    return PatternResponse(
        curve.load,
        curve.mass,
        deviation,
        harmonic,
        tuned.height,
        tuned.omega / (2 * pi),
        peak,
        solution,
        _free_factor(wheel, pattern, grid, harmonic),
        found.truncation,
        tuned.height / curve.balance_amplitude - 1 if one_order else float("nan"),
        alternating,
        None if held_means else _free_means(wheel, pattern, solution, options),
        others,
        own,
    )


def _free_means(
    wheel: Wheel, pattern: Pattern, solution: WheelSolution, options: Options
) -> FreeMeans | None:
    """The point of a held wheel with free means, in which dampers may walk."""
    free = replace(wheel, coupled=True)
    if not walking_motions(free).shape[2]:
        return None
    point = solve_wheel(
        free,
        solution.omega,
        solution.probe.shape[1] - 1,
        solution.samples,
        pattern=pattern,
        start=solution,
        options=replace(options, fallbacks=False),
    )
    change = float(point.size().max() / solution.size().max() - 1)
    walks = int(np.count_nonzero(point.drift))
    return FreeMeans(
        change if point.converged else float("nan"), walks, float(point.drift.max(initial=0.0))
    )


@dataclass(frozen=True)
class ChosenPeak:
    """A peak with the harmonics and samples that were taken for it."""

    peak: WheelPeak
    # there, in harmonics of the common period
    solution: WheelSolution
    harmonics: int
    samples: int
    # relative change of the height by `judging_balances`; NaN: not solved
    truncation: float


def first_balance(wheel: Wheel, curve: Curve, harmonic: int) -> tuple[int, int]:
    """Harmonics and samples of the common period that the settings of a curve mean."""
    settings = curve.settings
    H = max(harmonic * settings.harmonics, *wheel.excitation)
    return H, max(harmonic * settings.samples, 8 * (H + 1))


def wanted_truncation(scene: Scene) -> float | None:
    """Estimated error by harmonics and samples above which a wheel takes more of them; None: those
    that the scene gives are kept.
    """
    return scene.accuracy / 2 if scene.model.harmonics is None else None


def chosen_peak(
    wheel: Wheel,
    pattern: Pattern,
    grid: np.ndarray,
    first: tuple[int, int],
    harmonic: int,
    options: Options,
    wanted: float | None,
    most: int = MOST_HARMONICS,
) -> ChosenPeak:
    """The peak with as many harmonics and samples as its error asks for; the arguments are those of
    `pattern_response`, `first` the harmonics and samples to begin with, `most` harmonics of the
    engine order.
    """
    H, samples = first
    while True:
        peak, solution = _peak_of_pattern(wheel, pattern, grid, H, samples, harmonic, options)
        judged = _judged(wheel, pattern, solution, (H, samples), options, wanted, most * harmonic)
        # of NaN nothing says that richer settings are solved
        if not _asks_for_more(judged, wanted, most * harmonic):
            return ChosenPeak(peak, solution, H, samples, judged.change)
        H, samples = judged.harmonics, judged.samples


@dataclass(frozen=True)
class Judged:
    """What a richer balance changes at a peak."""

    harmonics: int
    samples: int
    # relative, of the highest blade; NaN: not solved
    change: float
    # flexibility products of its point
    products: int


def _asks_for_more(judged: Judged, wanted: float | None, most: int) -> bool:
    """A search with the richer balance is wanted, and affordable."""
    return (
        wanted is not None
        and judged.change > wanted
        and judged.harmonics <= most
        and judged.products <= MOST_SEARCH_PRODUCTS
    )


def richer_balance(wheel: Wheel, H: int, samples: int) -> tuple[int, int]:
    """Harmonics and samples that tell what the present ones leave: at least twice as many, and with
    the next odd multiple of the highest excited harmonic, which friction excites most.
    """
    top = max(wheel.excitation)
    more = max(2 * H + 1, top * (2 * (H // top) + 1))
    return more, max(2 * samples, 8 * (more + 1))


def _peak_of_pattern(
    wheel: Wheel,
    pattern: Pattern,
    grid: np.ndarray,
    H: int,
    samples: int,
    harmonic: int,
    options: Options,
) -> tuple[WheelPeak, WheelSolution]:
    """The peak and its solution."""
    solved = in_common_period(wheel_respond(wheel, pattern, H, samples, options), harmonic)
    peak = find_wheel_peak(solved, grid, SEARCH_TOLERANCE)
    omega = peak.omega / harmonic
    return peak, solve_wheel(wheel, omega, H, samples, pattern=pattern, options=options)


def _judged(
    wheel: Wheel,
    pattern: Pattern,
    solution: WheelSolution,
    present: tuple[int, int],
    options: Options,
    wanted: float | None,
    most: int,
) -> Judged:
    """What the last one of `judging_balances` of the present harmonics and samples changes at a
    peak, or the first one that asks for a search of its own; NaN where one before it is not solved.
    """
    found = Judged(*present, 0.0, 0)
    point = solution
    for number, more in enumerate(judging_balances(wheel, *present)):
        products = 0
        if point.converged:
            # where the poorer balance is no start for the richer one nothing else is likely to be
            own = options if number == 0 else replace(options, fallbacks=False)
            point = solve_wheel(
                wheel, solution.omega, *more, pattern=pattern, start=point, options=own
            )
            products = point.products
        change = abs(point.size().max() / solution.size().max() - 1)
        found = Judged(*more, float(change) if point.converged else float("nan"), products)
        if _asks_for_more(found, wanted, most):
            break
    return found


def judging_balances(wheel: Wheel, H: int, samples: int) -> list[tuple[int, int]]:
    """Harmonics and samples that judge the present ones, each started from the one before: the next
    richer ones, and JUDGING_HARMONICS where harmonic 1 alone is excited and these are more.
    """
    found = [richer_balance(wheel, H, samples)]
    if set(wheel.excitation) == {1} and found[0][0] < JUDGING_HARMONICS:
        found.append((JUDGING_HARMONICS, max(found[0][1], 32 * (JUDGING_HARMONICS + 1))))
    return found


def pattern_sentences(found: Sequence[PatternResponse], held_means: bool) -> list[str]:
    """What a reader has to know.

    Args:
        held_means: of the sector's own curves too, which then say nothing about free ones.
    """
    sentences = []
    for r in found:
        error = "unknown" if np.isnan(r.truncation) else f"{100 * r.truncation:.2g} %"
        place = ", ".join(f"{1e3 * x:.1f}" for x in r.worst.place)
        text = (
            f"whole wheel under {r.load:g} N: blade {r.peak.blade + 1} moves "
            f"{1e6 * r.peak.height:.4g} um, {r.factor:.3g} times the tuned wheel (without dampers "
            f"{r.free_factor:.3g} times); estimated error by harmonics and samples {error}; "
            f"{r.peak.unsolved} of {len(r.peak.omegas)} frequencies not solved; its alternating "
            f"stress is {1e-6 * r.worst.largest:.4g} MPa at ({place}) mm, estimated error of the "
            f"mesh there {100 * r.worst.mesh_error:.2g} %"
        )
        if not r.peak.closed_in:
            text += "; the highest point is an end of the band, the resonance may be higher"
        if r.own_stress is not None:
            text += (
                "; that blade has another shape, and its stress is that of its own mesh, where "
                f"{1e-6 * r.stress.largest:.4g} MPa is that of the same motion on the others'; "
                "wheel and blade disagree about its own motion by "
                f"{100 * r.own_stress.mismatch:.2g} % of its inertia"
            )
        sentences.append(text)
    if found[0].others is not None:
        sentences.extend(other_blade_sentences(found[0].others))
    far = max(abs(r.sector_difference) for r in found)
    if np.isnan(far):
        moved = "where engine orders beyond the tuned sector's excite as well"
    elif held_means:
        moved = "as the tuned curves do (model.static): what free ones change is not known"
    else:
        moved = f"which moves the tuned resonance by {100 * far:.2g} % at most"
    sentences.append(f"the whole wheel holds mean displacements in the preload state, {moved}")
    for r in found:
        free = r.free_means
        if free is None:
            continue
        if np.isnan(free.change):
            said = "no balance was found"
        elif free.walking:
            said = (
                f"{free.walking} of {len(r.deviation)} dampers walk, by up to "
                f"{1e3 * free.speed:.2g} mm/s, and the highest blade changes by "
                f"{100 * free.change:+.2g} %"
            )
        else:
            said = f"no damper walks, and the highest blade changes by {100 * free.change:+.2g} %"
        sentences.append(f"with free mean displacements at the wheel's resonance {said}")
    return sentences


def _free_factor(
    wheel: Wheel,
    pattern: Pattern,
    grid: np.ndarray,
    harmonic: int,
) -> float:
    """Amplification without dampers over the same band."""
    fine = np.linspace(grid[0], grid[-1], LINEAR_POINTS)
    highest = max(wheel.excitation)

    def respond(pattern: Pattern) -> float:
        def sizes(w: float) -> np.ndarray:
            moving = free_wheel(wheel, w / harmonic, highest, pattern)[:, 1:, 0]
            return np.linalg.norm(moving, axis=1)

        return find_wheel_peak(sizes, fine, SEARCH_TOLERANCE).height

    return respond(pattern) / respond(replace(pattern, stiffness=None, mass=None))

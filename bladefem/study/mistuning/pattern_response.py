"""The response of all blades of a scene's wheel with one pattern, under each damper load."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...errors import InputError
from ...hbm.linear_resonances import free_resonances
from ...scene.tables import Scene
from ...util.progress import Progress, unwatched
from ...wheel.model import Pattern, Wheel, frequency_pattern
from ...wheel.resonance import WheelPeak, find_wheel_peak
from ...wheel.scatter import Scatter, drawn_deviations, read_pattern
from ...wheel.solve import WheelSolution, free_wheel, solve_wheel, stuck_wheel
from ...wheel.statistics import wheel_respond
from ...wheel.tuned import tuned_sector
from ..pipeline.loads import Curve
from .whole_wheel import WheelSector

# points of the first look at a band
GRID = 15
# of the linear wheel, which costs little
LINEAR_POINTS = 300
# resonances with sticking dampers that are looked at
SHARPEST = 8
# relative error of a peak's height by the search over frequencies
SEARCH = 0.01


@dataclass(frozen=True)
class PatternResponse:
    """One load; N blades, q families."""

    # [N], and of the damper [kg]
    load: float
    mass: float | None
    # (N, q) relative deviations of the blade-alone frequencies
    deviation: np.ndarray
    # peak of the tuned wheel [m] and where [Hz]
    tuned: float
    tuned_frequency: float
    # the mistuned wheel with friction
    peak: WheelPeak
    # its solution at the peak
    solution: WheelSolution
    # amplification of the same pattern without dampers
    free_factor: float
    # relative change of the peak's height with twice the harmonics and samples; NaN: not solved
    truncation: float
    # relative difference of the tuned peak from that of the sector's own curve, whose means are
    # free
    sector_difference: float

    @property
    def factor(self) -> float:
        """Highest blade over the tuned wheel."""
        return self.peak.height / self.tuned


def scene_deviations(
    scene: Scene,
    count: int,
    families: int,
) -> np.ndarray:
    """(N, q) relative deviations of frequency: of the file, or the first ones drawn.

    Raises:
        InputError: neither is given, or the file does not fit.
    """
    given = scene.mistuning
    if given.pattern:
        _, values = read_pattern(given.pattern, count)
        if values.shape[1] not in (1, families):
            raise InputError(
                f"mistuning.pattern: {values.shape[1]} families, expected 1 for all or "
                f"mistuning.families = {families}"
            )
        return np.broadcast_to(values, (count, families)).copy()
    if given.scatter is None:
        raise InputError("mistuning: expected a pattern file or a scatter")
    # the same first wheel as the statistics draw
    scatter = Scatter(given.scatter, seed=given.seed)
    deviation = scatter.blades * drawn_deviations(count, scatter, 1)[0, 0]
    return np.repeat(deviation[:, None], families, axis=1)


def scene_scatter(scene: Scene) -> Scatter:
    """The scene's standard deviations."""
    m = scene.mistuning
    return Scatter(m.scatter or 0.0, m.friction, m.stiffness, m.load, m.seed)


def frequency_grid(
    wheel: Wheel,
    curve: Curve,
    pattern: Pattern,
    spread: float,
) -> np.ndarray:
    """(k,) circular frequencies to look at first, as far as deviations reach [rad/s].

    Even steps find the broad resonances of sliding dampers; where dampers stick a blade resonates
    as sharply as its own damping lets it, at resonances of the linear wheel, which are added.

    Args:
        spread: largest relative deviation of frequency.
    """
    model = tuned_sector(wheel, 1)
    own = curve.peak.omega
    ends = [own]
    if model is not None:
        free = free_resonances(model)
        ends.append(float(free[np.argmin(abs(free - own))]))
    low = min(ends) * (1 - spread)
    high = max(ends) * (1 + spread)
    return np.union1d(np.linspace(low, high, GRID), _stuck_peaks(wheel, pattern, low, high))


def _stuck_peaks(
    wheel: Wheel,
    pattern: Pattern,
    low: float,
    high: float,
) -> np.ndarray:
    """Circular frequencies of the highest resonances with all contacts sticking."""
    fine = np.linspace(low, high, LINEAR_POINTS)
    sizes = [stuck_wheel(wheel, w, max(wheel.excitation), pattern)[:, 1:, 0] for w in fine]
    height = np.linalg.norm(np.array(sizes), axis=2).max(axis=1)
    inner = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] >= height[2:])) + 1
    return fine[inner[np.argsort(-height[inner])[:SHARPEST]]]


def pattern_responses(
    scene: Scene,
    sector: WheelSector,
    wheels: list[Wheel],
    curves: list[Curve],
    progress: Progress = unwatched,
) -> list[PatternResponse]:
    """The wheel with the scene's pattern, under the load of each curve.

    Args:
        wheels: of each curve, the tuned wheel.
    """
    count = wheels[0].count
    deviation = scene_deviations(scene, count, len(sector.families))
    pattern = frequency_pattern(sector.families, deviation)
    pairs = list(zip(wheels, curves, strict=True))
    return [
        _one_load(wheel, pattern, deviation, curve)
        for wheel, curve in progress(pairs, "whole wheel", len(pairs))
    ]


def _one_load(
    wheel: Wheel,
    pattern: Pattern,
    deviation: np.ndarray,
    curve: Curve,
) -> PatternResponse:
    settings = curve.settings
    H = max(settings.harmonics, *wheel.excitation)
    samples = max(settings.samples, 8 * (H + 1))
    spread = abs(deviation).max() + 0.005
    grid = frequency_grid(wheel, curve, pattern, spread)
    solved = wheel_respond(wheel, pattern, H, samples)
    peak = find_wheel_peak(solved, grid, SEARCH)
    # the same way to the tuned one, so that the factor compares like with like
    tuned = find_wheel_peak(
        wheel_respond(wheel, Pattern(), H, samples),
        curve.peak.omega * np.array([0.998, 1.0, 1.002]),
        SEARCH,
    )
    solution = solve_wheel(wheel, peak.omega, H, samples, pattern=pattern)
    richer = solve_wheel(wheel, peak.omega, 2 * H + 1, 2 * samples, pattern=pattern, start=solution)
    change = abs(richer.size().max() / solution.size().max() - 1)
    return PatternResponse(
        curve.load,
        curve.mass,
        deviation,
        tuned.height,
        tuned.omega / (2 * pi),
        peak,
        solution,
        _free_factor(wheel, pattern, grid),
        float(change) if richer.converged and solution.converged else float("nan"),
        tuned.height / curve.peak_amplitude - 1,
    )


def _free_factor(
    wheel: Wheel,
    pattern: Pattern,
    grid: np.ndarray,
) -> float:
    """Amplification without dampers over the same band."""
    fine = np.linspace(grid[0], grid[-1], LINEAR_POINTS)

    def respond(pattern: Pattern) -> float:
        def sizes(w: float) -> np.ndarray:
            return np.linalg.norm(free_wheel(wheel, w, 1, pattern)[:, 1:, 0], axis=1)

        return find_wheel_peak(sizes, fine, SEARCH).height

    return respond(pattern) / respond(replace(pattern, stiffness=None, mass=None))

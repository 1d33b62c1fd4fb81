"""Many drawn wheels under the load of one curve: what all of them take, and their statistics, by
whole wheels or by the damper law.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ...io.stage_cache import cached_stage, key_of, on_root
from ...scene.tables import Scene
from ...util.communicator import Communicator
from ...util.progress import Progress
from ...wheel.model import TUNED_PATTERN, Pattern, Wheel, frequency_pattern
from ...wheel.pattern_peak import PatternPeak
from ...wheel.scatter import MAX_DEVIATIONS, drawn_patterns
from ...wheel.statistics import Amplification, scatter_statistics, unknown_statistics
from ...wheel.walking import with_free_means
from ..adaptive.band_sweep import solver_options
from ..pipeline.curve import Curve
from ..pipeline.stage_runner import Folder
from .engine_orders import own_harmonic
from .law_level import law_level, with_checks
from .other_blades import OtherBlades
from .pattern_response import frequency_grid
from .peak_choice import (
    SearchedWheel,
    chosen_peak,
    first_balance,
    pattern_peak,
    wanted_truncation,
    with_free_change,
)
from .sector_comparison import SectorComparison, compared_with_sector, with_comparison
from .validate import LAW_LEVEL, scene_scatter

# harmonics of the engine order that many wheels take at most: what these leave is reported, and
# most of it is the tuned wheel's too, over which amplifications are counted
SCATTER_HARMONICS = 3
Result = TypeVar("Result")


@dataclass(frozen=True)
class KeptWheels:
    """Finished wheels of an interrupted scatter: each is a file of its own, named by what it
    depends on, so that ranks write and find them without each other.
    """

    # run folder; None keeps nothing
    folder: Folder
    # of the folder of these files, among the stages
    name: str
    # `stage_key` of the statistics
    key: str

    def __call__(self, compute: Callable[[], Result], *more: Any) -> Result:
        """A result, computed or found.

        Args:
            more: what it depends on besides the key.
        """
        key = key_of(self.key, *more)
        return cached_stage(self.folder, f"{self.name}/{key}", key, compute)[0]

    def remove(self) -> None:
        """Once the statistics of all wheels are kept, the wheels are not needed any more."""
        if self.folder is not None:
            shutil.rmtree(Path(self.folder) / "stages" / self.name, ignore_errors=True)


NOTHING_KEPT = KeptWheels(None, "", "")


@dataclass(frozen=True)
class DrawnWheels:
    """Patterns of a scene's scatter, on the wheel under the load of a curve."""

    scene: Scene
    wheel: Wheel
    curve: Curve
    patterns: list[Pattern]
    # largest relative deviation of a blade's frequency, roughly
    spread: float
    # the same wheel with free means, by which peaks are searched again; None where the scene holds
    # them, or no damper has a motion that friction alone resists
    free: Wheel | None = None
    # those finished
    kept: KeptWheels = NOTHING_KEPT

    @property
    def harmonic(self) -> int:
        """Harmonic of the common period that is the scene's engine order."""
        return own_harmonic(self.scene)

    def grid(self, pattern: Pattern) -> np.ndarray:
        """Circular frequencies at which the resonance with a pattern is looked for [rad/s]."""
        return frequency_grid(self.wheel, self.curve, pattern, self.spread, self.harmonic)

    def searched(self, pattern: Pattern, free: bool) -> SearchedWheel:
        """The wheel with a pattern; with free means too, if asked for and where the scene has
        these.
        """
        options = solver_options(self.scene.accuracy)
        means = self.free if free else None
        return SearchedWheel(self.wheel, means, pattern, self.harmonic, options)

    @property
    def by_damper_law(self) -> bool:
        """The scene asks for the cheap level, with some wheels checked."""
        return self.scene.mistuning.level == LAW_LEVEL

    def peak(self, pattern: Pattern, balance: tuple[int, int], free: bool = True) -> PatternPeak:
        """The highest blade with a pattern, solved or found among those kept.

        Args:
            balance: harmonics and samples of the common period.
            free: look for it with free means too, where the scene has these.
        """

        def solve() -> PatternPeak:
            return pattern_peak(self.searched(pattern, free), self.grid(pattern), balance)

        found = self.kept(solve, "peak", pattern, balance, free)
        return replace(found, asked=self.free is not None)


def drawn_wheels(
    scene: Scene,
    families: np.ndarray,
    wheel: Wheel,
    curve: Curve,
    others: OtherBlades | None,
    kept: KeptWheels = NOTHING_KEPT,
) -> DrawnWheels:
    """The wheels that a scene draws.

    Args:
        families: (families,) frequencies of the blade alone [rad/s].
        others: blades of another shape, which all of the wheels have.
        kept: where finished wheels are kept.
    """
    spread = MAX_DEVIATIONS * (scene.mistuning.scatter or 0.0) + 0.005
    if others is not None:
        spread += abs(others.frequencies(wheel.count, len(families))).max()

    def made(deviation: np.ndarray) -> Pattern:
        pattern = frequency_pattern(families, deviation)
        return pattern if others is None else others.added(pattern, wheel.count)

    patterns = drawn_patterns(wheel, scene_scatter(scene), scene.mistuning.wheels, made)
    held = scene.model.static == "uncoupled"
    free = None if held else with_free_means(wheel)
    return DrawnWheels(scene, wheel, curve, patterns, spread, free, kept)


def drawn_statistics(
    drawn: DrawnWheels,
    comm: Communicator | None,
    progress: Progress,
) -> Amplification:
    """Statistics of the highest blade, at the level that the scene asks for."""
    balance = scatter_balance(drawn.scene, drawn.wheel, drawn.curve)
    truncation = float("nan")
    tuned, compared = on_root(comm, lambda: _compared(drawn, balance))
    if compared.agrees:
        harmonics, samples, truncation = on_root(
            comm, lambda: drawn.kept(lambda: _chosen_balance(drawn), "balance", balance)
        )
        if (harmonics, samples) != balance:
            balance = harmonics, samples
            tuned, compared = on_root(comm, lambda: _compared(drawn, balance))
    if not compared.agrees:
        wheels = len(drawn.patterns)
        checks = min(drawn.scene.mistuning.checks, wheels) if drawn.by_damper_law else 0
        found = unknown_statistics(drawn.curve.load, tuned, wheels, checks)
    elif drawn.by_damper_law:
        found = _by_damper_law(drawn, balance, tuned, comm, progress)
    else:
        # one by one, dealt out over the ranks
        patterns = {drawn.curve.load: drawn.patterns}
        search = _search(drawn, balance, tuned)
        found = scatter_statistics(patterns, lambda _, pattern: search(pattern), comm, progress)
    error = with_free_change(truncation, found.released_effect[0])
    found = replace(found, harmonics=np.array([balance[0]]), truncation=np.array([error]))
    return with_comparison(found, compared)


def _compared(drawn: DrawnWheels, balance: tuple[int, int]) -> tuple[PatternPeak, SectorComparison]:
    """The tuned wheel by harmonics and samples of the common period, and next to the sector."""
    tuned = drawn.peak(TUNED_PATTERN, balance)
    height, accuracy = tuned.peak.height, drawn.scene.accuracy
    return tuned, compared_with_sector(drawn.wheel, drawn.curve, height, accuracy)


def _search(
    drawn: DrawnWheels, balance: tuple[int, int], tuned: PatternPeak
) -> Callable[[Pattern], PatternPeak]:
    """What looks for a pattern's highest blade, as the tuned wheel's was found."""
    free = tuned.free is not None
    return lambda pattern: tuned if pattern is TUNED_PATTERN else drawn.peak(pattern, balance, free)


def _chosen_balance(drawn: DrawnWheels) -> tuple[int, int, float]:
    """Harmonics and samples that the first wheel needs, and the error that they leave: all have the
    same contacts. With held means, since a richer balance with free ones takes longer than all that
    follows.
    """
    pattern = drawn.patterns[0]
    found = chosen_peak(
        drawn.searched(pattern, free=False),
        drawn.grid(pattern),
        scatter_balance(drawn.scene, drawn.wheel, drawn.curve),
        wanted_truncation(drawn.scene),
        SCATTER_HARMONICS,
    )
    return found.harmonics, found.samples, found.truncation


def _by_damper_law(
    drawn: DrawnWheels,
    balance: tuple[int, int],
    tuned: PatternPeak,
    comm: Communicator | None,
    progress: Progress,
) -> Amplification:
    """All wheels by the damper law, some of them checked as whole wheels."""
    scene, wheel, curve = drawn.scene, drawn.wheel, drawn.curve
    grid = frequency_grid(wheel, curve, TUNED_PATTERN, drawn.spread)
    band = float(grid[0]), float(grid[-1])
    scatter = scene_scatter(scene)
    mode = scene.excitation.mode - 1
    cheap = on_root(
        comm, lambda: law_level(wheel, drawn.patterns, scatter, curve, mode, balance[0], band)
    )
    search = _search(drawn, balance, tuned)
    return with_checks(cheap, drawn.patterns, search, scene.mistuning.checks, comm, progress)


def scatter_balance(scene: Scene, wheel: Wheel, curve: Curve) -> tuple[int, int]:
    """Harmonics and samples that whole wheels of the statistics begin with: those of the curve, at
    most SCATTER_HARMONICS of the engine order unless the scene gives more.
    """
    harmonic = own_harmonic(scene)
    H, samples = first_balance(wheel, curve, harmonic)
    if scene.model.harmonics is None:
        H = min(H, max(SCATTER_HARMONICS * harmonic, *wheel.excitation))
    return H, samples

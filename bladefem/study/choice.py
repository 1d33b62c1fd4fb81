"""Model no more than the scene needs: enrich what the indicators find worst until half the tolerance is met."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import NotSolvedError
from ..hbm.api import solve
from ..hbm.model import ReducedModel
from ..hbm.resonance import free_resonances, stuck_resonances
from ..hbm.solution import Solution
from ..hbm.sweep import size, sweep
from .indicators import Indicators, indicate
from .settings import Settings, enriched

__all__ = ["Join", "choose", "covered", "default_band", "peak_of", "response_points"]

# Settings to the model to solve and, where that one is not elastic, the same with the elastic damper.
Join = Callable[[Settings], tuple[ReducedModel, ReducedModel | None]]
ROUNDS = 12
WIDENINGS = 4


def choose(join: Join, settings: Settings, peak: Solution, accuracy: float,
           fixed: tuple[str, ...] = ()) -> tuple[Settings, Solution, Indicators]:
    """Settings whose estimated error at a resonance is below half the accuracy, or the best that may be chosen.

    Args:
        join: makes the models of some settings.
        peak: the resonance, solved with `settings`; its frequency is kept.
        fixed: names that may not be changed here although they are not the user's.
    """
    for _ in range(ROUNDS):
        model, elastic = join(settings)
        peak = solve(model, peak.omega, settings.harmonics, settings.samples, start=peak)
        found = indicate(model, peak, elastic)
        settings = replace(settings, error=found.total)
        if found.total <= accuracy / 2:
            break
        richer = _next(settings, found, accuracy, fixed)
        if richer is None:
            break
        settings = richer
    return settings, peak, found


def _next(settings: Settings, found: Indicators, accuracy: float, fixed: tuple[str, ...]) -> Settings | None:
    """The settings enriched in the worst respect that is open; None when nothing open would help."""
    open_names = [name for name in settings.chosen if name not in fixed]
    for name in sorted(open_names, key=lambda n: -getattr(found, n)):
        if getattr(found, name) < accuracy / 20:
            return None
        richer = enriched(settings, name)
        if richer is not None:
            return richer
    return None


def covered(model: ReducedModel, settings: Settings, band: tuple[float, float] | None, mode: int,
            accuracy: float) -> list[Solution]:
    """A sweep of the given band [Hz], or of one that is widened until its highest point lies inside.

    Raises:
        NotSolvedError: no point converged.
    """
    if band is not None:
        return response_points(model, settings, band, accuracy)
    low, high = default_band(model, mode)
    for _ in range(WIDENINGS):
        points = response_points(model, settings, (low, high), accuracy)
        good = [p.omega for p in points if p.converged]
        top = peak_of(points).omega
        if good[0] < top < good[-1]:
            break
        low, high = (low - (high - low), high) if top == good[0] else (low, high + (high - low))
        low = max(low, 0.1 * high)
    return points


def response_points(model: ReducedModel, settings: Settings, band: tuple[float, float],
                    accuracy: float) -> list[Solution]:
    """A sweep of a band [Hz], sorted by frequency.

    Raises:
        NotSolvedError: no point converged.
    """
    circular = (2 * np.pi * band[0], 2 * np.pi * band[1])
    points = sorted(sweep(model, circular, settings.harmonics, settings.samples, peak=min(accuracy / 10, 1e-2)),
                    key=lambda s: s.omega)
    if not any(p.converged for p in points):
        raise NotSolvedError(f"no point between {band[0]:.5g} and {band[1]:.5g} Hz was solved; "
                             f"the first stopped because: {points[0].reason}")
    return points


def peak_of(points: list[Solution]) -> Solution:
    """The highest converged point."""
    return max((p for p in points if p.converged), key=size)


def default_band(model: ReducedModel, mode: int) -> tuple[float, float]:
    """From a little below to a little above the resonances [Hz] of a mode with free and with sticking contacts."""
    pair = np.array([free_resonances(model)[mode - 1], stuck_resonances(model)[mode - 1]]) / (2 * np.pi)
    margin = max(0.01 * pair.mean(), 0.15 * np.ptp(pair))
    return pair.min() - margin, pair.max() + margin

"""The sweep of a band with given settings, and the band round the resonances of a mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...errors import NotSolvedError
from ...hbm.band_path import USUAL_LIMITS, PathLimits
from ...hbm.linear_resonances import free_resonances, stuck_partners
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution
from ...hbm.solver.newton import Options
from ...hbm.sweep import sweep
from .check_points import peak_of
from .settings import Settings

MAX_BAND_WIDENINGS = 4


def covered_band(
    model: ReducedModel,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
    widen: bool = False,
    paths: bool | None = None,
    notes: list[str] | None = None,
    known: Sequence[Solution] = (),
    limits: PathLimits = USUAL_LIMITS,
    similar: Sequence[Solution] = (),
) -> list[Solution]:
    """A sweep of a band [Hz], or of one round the resonances; that one is widened until its highest
    point lies inside.

    Args:
        widen: a given band may be widened as well.
        paths: whether the response is followed round folds; where accuracy is below 1 if left out.
        notes: takes what the last sweep could not do, in sentences.
        known: points of this model with these settings and solver options, not to be solved again.
        limits: of the paths on which the response is followed.
        similar: points of a poorer model, to start from where neighbours do not lead to a point.

    Raises:
        NotSolvedError: no point converged.
    """
    swept = band or default_band(model, mode)
    fixed = band is not None and not widen
    for _ in range(MAX_BAND_WIDENINGS):
        left_open: list[str] = []
        points = response_points(
            model, settings, swept, accuracy, paths, left_open, known, limits, similar
        )
        good = [p.omega for p in points if p.converged]
        top = peak_of(points).omega
        if fixed or good[0] < top < good[-1] or limits.given_up(points):
            break
        swept = _doubled_band(swept, top == good[0], _halfway(model, mode))
    if notes is not None:
        notes[:] = left_open
    return points


def response_points(
    model: ReducedModel,
    settings: Settings,
    band: tuple[float, float],
    accuracy: float,
    paths: bool | None = None,
    notes: list[str] | None = None,
    known: Sequence[Solution] = (),
    limits: PathLimits = USUAL_LIMITS,
    similar: Sequence[Solution] = (),
) -> list[Solution]:
    """A sweep of a band [Hz], sorted by frequency; an accuracy of 1 asks for no more than the place
    of the peak.

    Where several motions were followed, their points have a `branch`, and replace those
    that the sweep solved before.

    Args:
        known: points of this model with these settings and solver options, not to be solved again.
        limits: of the paths on which the response is followed.
        similar: points of a poorer model, to start from where neighbours do not lead to a point.

    Raises:
        NotSolvedError: no point converged.
    """
    rough = accuracy >= 1
    ends = 2 * np.pi * band[0], 2 * np.pi * band[1]
    swept = partial(
        sweep,
        model,
        ends,
        settings.harmonics,
        settings.samples,
        peak=min(accuracy / 10, 1e-2),
        curve=0.2 if rough else 0.02,
        notes=notes,
        paths=not rough if paths is None else paths,
        known=[p for p in known if p.converged and ends[0] <= p.omega <= ends[1]],
        limits=limits,
        similar=similar,
    )
    options = solver_options(accuracy)
    points = list(swept(options=replace(options, fallbacks=not rough)))
    if rough and 2 * sum(p.converged for p in points) < len(points):
        if notes is not None:
            notes.clear()
        points = list(swept(options=options))
    points.sort(key=lambda s: s.omega)
    if any(p.branch for p in points):
        points = [p for p in points if p.branch or not p.converged]
    if not any(p.converged for p in points):
        raise NotSolvedError(
            f"no point between {band[0]:.5g} and {band[1]:.5g} Hz was solved; the first stopped "
            f"because: {points[0].reason}"
        )
    return points


def solver_options(accuracy: float) -> Options:
    """When a point is accepted whose model may be wrong by the accuracy anyway."""
    return Options(tolerance=float(np.clip(1e-3 * accuracy, 1e-10, 1e-6)), frugal=True)


def default_band(model: ReducedModel, mode: int) -> tuple[float, float]:
    """From a little below to a little above the resonances [Hz] of a mode with free and with
    sticking contacts.
    """
    pair = np.array([free_resonances(model)[mode - 1], stuck_partners(model)[mode - 1]]) / (
        2 * np.pi
    )
    margin = max(0.01 * pair.mean(), 0.15 * np.ptp(pair))
    return pair.min() - margin, pair.max() + margin


def _doubled_band(
    band: tuple[float, float],
    downwards: bool,
    limits: tuple[float, float],
) -> tuple[float, float]:
    """Twice the band [Hz] on the side of its highest point, inside the limits."""
    low, high = band
    width = high - low
    if downwards:
        low -= width
    else:
        high += width
    return max(low, limits[0]), min(high, limits[1])


def _halfway(model: ReducedModel, mode: int) -> tuple[float, float]:
    """Frequencies [Hz] half way to the neighbouring modes: beyond them the flank of another
    resonance may be higher.
    """
    ends = np.sort([free_resonances(model), stuck_partners(model)], axis=0) / (2 * np.pi)
    low = 0.1 * ends[0, 0] if mode == 1 else (ends[1, mode - 2] + ends[0, mode - 1]) / 2
    high = 3 * ends[1, -1] if mode == ends.shape[1] else (ends[1, mode - 1] + ends[0, mode]) / 2
    return min(low, 0.99 * ends[0, mode - 1]), max(high, 1.01 * ends[1, mode - 1])

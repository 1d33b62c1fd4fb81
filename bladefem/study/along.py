"""The automatic choice along given frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..errors import NotSolvedError
from ..hbm.api import solve
from ..hbm.newton import Options
from ..hbm.solution import Solution
from ..hbm.sticking import grips
from ..hbm.sweep import response, size
from .choice import Checked, choose, peak_of, sufficient, watched
from .family import Family, member
from .indicators import judge
from .settings import Settings

__all__ = ["along"]

STRIDE = 8          # frequencies from one of the first look to the next
PASSES = 3          # with ever richer settings


def along(family: Family, omegas: Sequence[float], settings: Settings, accuracy: float) -> Checked:
    """Response at ascending circular frequencies [rad/s], everywhere within the accuracy of its highest point.

    The choice is made at the highest point of a first look, and made again where a check of the curve finds too much.

    Args:
        settings: to start the choice from.

    Raises:
        NotSolvedError: no point converged.
    """
    options = sufficient(accuracy)
    rough = list(response(member(family, settings).model, omegas[::STRIDE], settings.harmonics, settings.samples,
                          options=options))
    if not any(p.converged for p in rough):
        raise NotSolvedError(f"none of {len(rough)} first frequencies was solved; the first stopped because: "
                             f"{rough[0].reason}")
    settings, judged, found = choose(family, settings, peak_of(rough), accuracy)
    points: list[Solution] = []
    for last in [False] * (PASSES - 1) + [True]:
        points = _solved(family, omegas, settings, points, options)
        top, errors, used = peak_of(points), {}, settings
        for point in watched(points):
            tolerated = accuracy * size(top) / size(point)
            told = found.total if point.omega == judged.omega else judge(family, settings, point).total
            errors[point.omega] = told
            if told > tolerated / 2 and not last:
                used, judged, found = choose(family, settings, point, tolerated)
                used = replace(used, error=settings.error)
            if used != settings:
                break
        if used == settings:
            break
        if not _alike(used, settings):
            points = []
        settings = used
    return Checked(replace(settings, error=errors[top.omega]), points, errors)


def _alike(one: Settings, other: Settings) -> bool:
    """Whether they differ in harmonics and samples at most, so that what sticks with one sticks with the other."""
    return (one.modes, one.points, one.damper) == (other.modes, other.points, other.damper)


def _solved(family: Family, omegas: Sequence[float], settings: Settings, old: list[Solution],
            options: Options) -> list[Solution]:
    """All frequencies; those that stick in an old sweep with the same contacts stay, the others start from there."""
    model, H, samples = member(family, settings).model, settings.harmonics, settings.samples
    if not old:
        return list(response(model, omegas, H, samples, options=options))
    return [p if p.converged and grips(model, p)
            else solve(model, p.omega, H, samples, start=p, options=options) for p in old]

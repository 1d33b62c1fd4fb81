"""Is a motion that lasts with few contact points unstable with more of them?

Ripples live in the order in which contacts begin to slip and to lift: plane blades under 8 N are
stable with four points a seat; with eight, sixteen and all 41 a disturbance grows by 3 % a period,
and the blade keeps between 0.93 and 1.11 of the amplitude.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ...hbm.solution import Solution, moving_contacts, size
from ...hbm.stability import STABLE, UNIQUE, UNSTABLE, Verdict, stability_verdict
from ..adaptive.family import Family
from ..adaptive.indicators import moved_solution, richer_settings
from ..adaptive.settings import Settings
from .verdicts import (
    CURVE_OPERATIONS,
    JUDGED_HARMONICS,
    JUDGED_OPTIONS,
    JUDGED_SAMPLES,
    SAME_MOTION,
    judged_again,
    model_in_time,
    richer_models,
    settings_in_time,
)


@dataclass(frozen=True)
class FinerMotion:
    """A motion found with more contact points, and its verdict."""

    settings: Settings
    motion: Solution
    verdict: Verdict


def unstable_with_more_points(
    models: Family,
    settings: Settings,
    point: Solution,
    verdict: str,
) -> FinerMotion | None:
    """The motion with the fewest contact points with which it is unstable, where it is with all of
    them, or with as many as a verdict is affordable for; None where it is not, or not known to be.

    Args:
        point: a motion with these settings that is not unstable.
        verdict: on that one.
    """
    if verdict == UNIQUE or not moving_contacts(point) or settings.points is None:
        return None
    counts = list(_more_points(models, settings))
    judged = next(filter(None, (_judged(models, settings, point, some) for some in counts)), None)
    if judged is None or judged.verdict.verdict != UNSTABLE:
        return None
    fewer = (_judged(models, settings, point, some) for some in counts[:0:-1])
    return next((some for some in fewer if some and some.verdict.verdict == UNSTABLE), judged)


def _more_points(models: Family, settings: Settings) -> Iterator[Settings]:
    """All contact points, then fewer and fewer, each twice as many as the next, with harmonics that
    a verdict needs.
    """
    every = richer_settings(models, settings, "points")
    if every is None or settings.points is None:
        return
    judged = replace(
        every,
        harmonics=max(settings.harmonics, min(JUDGED_HARMONICS, models.harmonics)),
        samples=settings.samples and max(settings.samples, JUDGED_SAMPLES),
    )
    yield judged
    counts = []
    points = 2 * settings.points
    while True:
        some = replace(judged, points=points)
        if richer_settings(models, some, "points") is None:
            break
        counts.append(some)
        points *= 2
    yield from reversed(counts)


def _judged(
    models: Family,
    settings: Settings,
    point: Solution,
    finer: Settings,
) -> FinerMotion | None:
    """The motion with more contact points, judged; None where it was not found or is another one,
    or where its verdict is not known.
    """
    motion = moved_solution(models, settings, point, finer, JUDGED_OPTIONS)
    if not motion.converged or abs(size(motion) / size(point) - 1) > SAME_MOTION:
        return None
    model = model_in_time(models, settings_in_time(models, finer))
    judged = stability_verdict(model, motion, CURVE_OPERATIONS)
    if judged.verdict == UNSTABLE:
        judged, _ = judged_again(judged, motion, richer_models(models, finer))
    known = judged.verdict in (STABLE, UNIQUE, UNSTABLE)
    return FinerMotion(finer, motion, judged) if known else None

"""Settings of a curve that is followed round folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...errors import NotSolvedError
from ...hbm.peak import Peak
from ...hbm.solution import Solution, lifts_off, mostly_lifts_off
from ...hbm.sweep import MAX_PATH_UNKNOWNS
from .cheaper_settings import PYTHON_OPERATIONS
from .family import Family, family_member
from .peak_errors import peak_from
from .settings import Settings

# folds or points of a curve from which it is given up: many folds are mostly those of few samples
# and contact points, and it is followed with more of both (docs/verification.md, "Limits of marches
# and balances")
MANY_FOLDS = 6
MANY_POINTS = 100
FOLDED_SAMPLES = 256
FOLDED_POINTS = 16
# samples at most of a curve that is followed round folds, where they take no longer than Python
# does: each of them may make a fold (seed 67 of benchmarks/choice_random.py: 780 points with 96
# samples, 251 with 512, each in less time)
FREE_SAMPLES = 512
# unknowns of a curve with a softened layer up to which it is followed: with 720 it takes 417 points
# and three times as long as the sweep, to the same resonance
MAX_SOFTENED_UNKNOWNS = 700


def too_large_to_follow(family: Family, settings: Settings) -> bool:
    """The balance has too many unknowns for following its motions round folds in a curve of many
    points.
    """
    most = MAX_SOFTENED_UNKNOWNS if settings.softened else MAX_PATH_UNKNOWNS
    return family_member(family, settings).model.unknowns(settings.harmonics) > most


def with_free_samples(
    family: Family,
    settings: Settings,
    peak: Peak | None,
    points: Sequence[Solution],
    accuracy: float,
) -> tuple[Settings, Peak | None]:
    """`free_samples`, and the peak with them; the same as before where that peak is not found."""
    samples = free_samples(family, settings, points)
    if peak is None or samples == settings.samples:
        return settings, peak
    finer = replace(settings, samples=samples)
    try:
        return finer, peak_from(family, settings, peak, finer, accuracy)
    except NotSolvedError:
        return settings, peak


def free_samples(family: Family, settings: Settings, points: Sequence[Solution]) -> int:
    """More samples where the curve will be followed round folds and they take no longer than Python
    does; as many as before elsewhere.
    """
    lifts = any(lifts_off(p) for p in points if p.converged)
    open_samples = "samples" in settings.chosen and settings.samples > 0
    if not (lifts and open_samples) or too_large_to_follow(family, settings):
        return settings.samples
    model = family_member(family, settings).model
    each = model.unknowns(settings.harmonics) * model.directions
    samples = settings.samples
    while 2 * samples <= FREE_SAMPLES and 2 * samples * each <= PYTHON_OPERATIONS:
        samples *= 2
    return samples


def with_fewer_folds(settings: Settings, peak: Peak | None) -> Settings | None:
    """Settings with more samples and contact points, where folds of a curve may be of too few of
    them; None where they are the user's, no fewer, or most contacts lift off, whose folds are real.
    """
    if peak is None or mostly_lifts_off(peak.solution):
        return None
    finer = settings
    if "samples" in settings.chosen and settings.samples:
        finer = replace(finer, samples=max(settings.samples, FOLDED_SAMPLES))
    if "points" in settings.chosen and settings.points is not None:
        finer = replace(finer, points=max(settings.points, FOLDED_POINTS))
    return None if finer == settings else finer


def refined_top(
    family: Family,
    settings: Settings,
    top: Solution,
    finer: Settings,
    accuracy: float,
) -> tuple[Settings, Solution]:
    """Finer settings and the peak with them; the same as before where it is not found."""
    try:
        peak = peak_from(family, settings, top, finer, accuracy, fallbacks=False)
    except NotSolvedError:
        return settings, top
    return finer, peak.solution

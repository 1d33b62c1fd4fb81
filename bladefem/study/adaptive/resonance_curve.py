"""A response curve whose settings hold at its resonance, and what its other points are wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import NotSolvedError
from ...hbm.peak import Peak
from ...hbm.solution import Solution
from ...hbm.sweep import MAX_PATH_UNKNOWNS, size
from .cheaper_settings import cheaper_settings
from .check_points import (
    CHECKED_HEIGHT_SHARES,
    MAX_CHECKED_PEAKS,
    MIN_SHARE_OF_ACCURACY,
    heights_of,
    left_out_motion,
    peak_of,
)
from .choice import Checked, covered_band, solver_options
from .family import Family, family_member, with_excited_harmonics
from .indicators import moved_solution, richer_settings
from .resonance_choice import (
    FAR_BEYOND,
    JUDGE_STEPS,
    PeakErrors,
    choose_at_peak,
    compared_settings,
    judge_settings,
    lifts_off_widely,
    peak_from,
    settings_of_lift_off,
)
from .settings import Settings, enriched_settings

# sweeps of one curve with ever richer settings
MAX_SWEEPS = 3


def resonance_curve(
    family: Family,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
) -> Checked:
    """A swept curve with settings that hold the height of its peak to half the accuracy.

    A rough sweep finds the peak, the settings are chosen there, and the curve is swept with them.
    It is swept again where that shows a higher peak, or points where harmonics that were left out
    move more than the accuracy allows.

    Args:
        settings: where the choice begins, for example those of a neighbouring load.
        band: [Hz]; round the resonances when None.

    Raises:
        NotSolvedError: no point converged.
    """
    settings = with_excited_harmonics(family, replace(settings, error=None))
    widen = band is None
    points = covered_band(family_member(family, settings).model, settings, band, mode, 1.0)
    if lifts_off_widely(settings, peak_of(points)):
        settings = settings_of_lift_off(settings)
        points = covered_band(family_member(family, settings).model, settings, band, mode, 1.0)
    used = settings
    swept = settings, 1.0
    notes: list[str] = []
    for _ in range(MAX_SWEEPS):
        used, peak, errors = _chosen(family, used, peak_of(points), accuracy)
        span = band or (points[0].frequency, points[-1].frequency)
        paths = not too_large_to_follow(family, used)
        # paths are followed anew
        again = any(p.branch for p in points) or not _same_points(swept, (used, accuracy))
        known = [] if again else points
        model = family_member(family, used).model
        points = covered_band(model, used, span, mode, accuracy, widen, paths, notes, known)
        swept = used, accuracy
        points = _with_peak(points, peak)
        if used.error is not None and used.error > FAR_BEYOND * accuracy:
            # the flanks of a peak that is far from right need no look of their own
            found = {peak_of(points).omega: used.error}
            break
        found = _checked_flanks(family, used, points, errors)
        significant = _checked_significant(family, used, points, accuracy)
        found = significant | found
        richer_harmonics = _harmonics_missed(used, points, significant, accuracy)
        if richer_harmonics is not None:
            used = richer_harmonics
        elif size(peak_of(points)) <= (1 + accuracy / 2) * _height(peak, points):
            break
    return Checked(used, points, found, tuple(notes))


def _same_points(one: tuple[Settings, float], other: tuple[Settings, float]) -> bool:
    """Sweeps with two settings and accuracies solve the same points, and equally well."""
    same = replace(one[0], error=None) == replace(other[0], error=None)
    return same and solver_options(one[1]) == solver_options(other[1])


def too_large_to_follow(family: Family, settings: Settings) -> bool:
    """The balance has too many unknowns for following its motions round folds in a curve of many
    points.
    """
    return (
        family_member(family, settings).model.springs.size * (2 * settings.harmonics + 1)
        > MAX_PATH_UNKNOWNS
    )


def _chosen(
    family: Family,
    settings: Settings,
    top: Solution,
    accuracy: float,
) -> tuple[Settings, Peak | None, PeakErrors | None]:
    """Settings that hold at the peak next to a point; the same with an unknown error where that
    peak was not closed in.
    """
    try:
        peak = peak_from(family, settings, top, settings, accuracy)
        enough = choose_at_peak(family, settings, peak, accuracy, fixed=("modes",))
        return cheaper_settings(family, *enough, accuracy)
    except NotSolvedError:
        return replace(settings, error=np.inf), None, None


def _height(peak: Peak | None, points: Sequence[Solution]) -> float:
    return size(peak_of(points)) if peak is None else peak.height


def _with_peak(points: list[Solution], peak: Peak | None) -> list[Solution]:
    """The points with the peak that was found by its slope, if it is none of them."""
    if peak is None or any(p.omega == peak.omega for p in points):
        return points
    return sorted([*points, peak.solution], key=lambda p: p.omega)


def _checked_flanks(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    errors: PeakErrors | None,
) -> dict[float, float]:
    """Circular frequency -> estimated relative error: of the peak, and of one point on each flank
    for each of CHECKED_HEIGHT_SHARES of its height.

    A flank is judged in the respect that is worst at the peak, as far from the peak of the richer
    present model from its own.
    """
    top = peak_of(points)
    found = {top.omega: np.inf if settings.error is None else settings.error}
    if errors is None or not errors.better:
        return found
    worst = max(errors.better, key=lambda name: errors.needs[name])
    other = judge_settings(family, settings, worst, top)
    if other is None:
        return found
    shift = errors.better[worst].omega / top.omega
    for point in _flanks(points, heights_of(points), top):
        found[point.omega] = _change(family, settings, point, other, worst, shift)
    return found


def _checked_significant(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    accuracy: float,
) -> dict[float, float]:
    """Circular frequency -> estimated relative error by more harmonics, of the MAX_CHECKED_PEAKS
    points where harmonics that were left out move the contacts.
    """
    share = heights_of(points) / size(peak_of(points))
    significant = left_out_motion(family, [settings] * len(points), points) * share
    order = np.argsort(-significant)[:MAX_CHECKED_PEAKS]
    chosen = [
        points[i]
        for i in order[significant[order] > MIN_SHARE_OF_ACCURACY * accuracy]
        if points[i].converged
    ]
    other = richer_settings(family, settings, "harmonics")
    if other is None:
        return {}
    return {p.omega: _change(family, settings, p, other, "harmonics", 1.0) for p in chosen}


def _flanks(
    points: Sequence[Solution],
    heights: np.ndarray,
    top: Solution,
) -> list[Solution]:
    """Of each side of the peak, the points whose heights are nearest to CHECKED_HEIGHT_SHARES of
    it.
    """
    omegas = np.array([p.omega for p in points])
    chosen = []
    for side in (omegas < top.omega, omegas > top.omega):
        good = np.flatnonzero(side & (heights > 0))
        for share in CHECKED_HEIGHT_SHARES if len(good) else ():
            chosen.append(good[np.argmin(abs(heights[good] - share * size(top)))])
    return [points[i] for i in dict.fromkeys(chosen)]


def _change(
    family: Family,
    settings: Settings,
    point: Solution,
    other: Settings,
    name: str,
    shift: float,
) -> float:
    """Relative change of the amplitude in a model that is richer in the respect of this name, at a
    frequency shifted by a factor; infinite where that is not solved, or too large to be.
    """
    pair = compared_settings(family, settings, other, name, point)
    if pair is None:
        return np.inf
    own, judge, factor = pair
    options = replace(solver_options(1e-2), fallbacks=False, iterations=JUDGE_STEPS)
    base = point if own == settings else moved_solution(family, settings, point, own, options)
    if not base.converged:
        return np.inf
    better = moved_solution(family, own, replace(base, omega=base.omega * shift), judge, options)
    return factor * abs(size(base) / size(better) - 1) if better.converged else np.inf


def _harmonics_missed(
    settings: Settings,
    points: Sequence[Solution],
    significant: dict[float, float],
    accuracy: float,
) -> Settings | None:
    """Settings with more harmonics where a significant point away from the peak is wrong beyond its
    tolerance; None where all hold, or harmonics are not to be chosen.
    """
    top = peak_of(points)
    if "harmonics" not in settings.chosen:
        return None
    for point in points:
        error = significant.get(point.omega, 0.0)
        tolerated = accuracy * size(top) / max(size(point), 1e-6 * size(top))
        if point is not top and np.isfinite(error) and error > tolerated:
            return enriched_settings(settings, "harmonics")
    return None

"""Points of a curve beside its resonance: how wrong they are, and which harmonics they ask for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...hbm.peak import Peak
from ...hbm.solution import Solution, size
from .band_sweep import solver_options
from .check_points import (
    CHECKED_HEIGHT_SHARES,
    MAX_CHECKED_PEAKS,
    MIN_SHARE_OF_ACCURACY,
    heights_of,
    left_out_motion,
)
from .family import Family, family_member
from .indicators import moved_solution, richer_settings
from .peak_errors import (
    JUDGE_STEPS,
    LIFTING_JUDGE,
    OVERTONES,
    PeakErrors,
    compared_settings,
    judge_settings,
)
from .settings import Settings, enriched_settings


def checked_flanks(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
    peak: Peak | None,
    errors: PeakErrors | None,
) -> dict[float, float]:
    """Circular frequency -> estimated relative error: of the peak, and of one point on each flank
    for each of CHECKED_HEIGHT_SHARES of its height.

    A flank is judged in the respect that is worst at the peak, as far from the peak of the richer
    model as it is from its own.

    Args:
        top: the highest point.
        peak: the one that was judged, and its errors.
    """
    found = {top.omega: np.inf if settings.error is None else settings.error}
    if peak is None or errors is None or not errors.better:
        return found
    worst = max(errors.better, key=lambda name: errors.needs[name])
    other = judge_settings(family, settings, worst, top)
    if other is None:
        return found
    shift = errors.better[worst].vertex / peak.vertex
    for point in _flanks(points, heights_of(points), top):
        found[point.omega] = _change(family, settings, point, other, worst, shift, top)
    return found


def checked_significant(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
    accuracy: float,
) -> dict[float, float]:
    """Circular frequency -> estimated relative error by more harmonics, among the MAX_CHECKED_PEAKS
    points where harmonics that were left out move the contacts most; where there is one motion, of
    those that are no neighbours of each other, and not at the resonance, which was judged.
    """
    alike = family_member(family, settings).model.loads_prescribed
    share = heights_of(points) / size(top)
    significant = left_out_motion(family, [settings] * len(points), points) * share
    order = np.argsort(-significant)
    kept: list[int] = []
    for i in order[significant[order] > MIN_SHARE_OF_ACCURACY * accuracy].tolist():
        known = alike and (points[i] is top or any(abs(i - j) == 1 for j in kept))
        if not known:
            kept.append(i)
        if len(kept) == MAX_CHECKED_PEAKS:
            break
    chosen = [points[i] for i in kept if points[i].converged]
    other = richer_settings(family, settings, "harmonics")
    if other is None:
        return {}
    return {p.omega: _change(family, settings, p, other, "harmonics", 1.0, p) for p in chosen}


def _flanks(
    points: Sequence[Solution],
    heights: np.ndarray,
    top: Solution,
) -> list[Solution]:
    """The points on each side of the peak whose heights are nearest to CHECKED_HEIGHT_SHARES of
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
    largest: Solution,
) -> float:
    """Relative change of the amplitude in a model that is richer in the respect of this name, at a
    frequency shifted by a factor; infinite where that is not solved, or too large to be.

    Args:
        largest: whose contacts tell how large a model may be; of a flank those of the resonance,
            which that model judged (11 900 unknowns in place of 6000 took half of a curve's time
            under 190 N on an imported wedge).
    """
    pair = compared_settings(family, settings, other, name, largest, LIFTING_JUDGE)
    if pair is None:
        return np.inf
    own, judge, factor = pair
    options = replace(solver_options(1e-2), fallbacks=False, iterations=JUDGE_STEPS)
    base = point if own == settings else moved_solution(family, settings, point, own, options)
    if not base.converged:
        return np.inf
    better = moved_solution(family, own, replace(base, omega=base.omega * shift), judge, options)
    return factor * abs(size(base) / size(better) - 1) if better.converged else np.inf


def harmonics_missed(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
    significant: Mapping[float, float],
    accuracy: float,
    most: int,
    followed: bool = False,
) -> Settings | None:
    """Settings with more harmonics where significant points away from the peak are wrong beyond
    their tolerance, with as many as these points ask for; None where all hold, or harmonics are not
    to be chosen.

    Args:
        most: steps of the harmonics that are taken at once.
        followed: the curve will be followed round folds.
    """
    if "harmonics" not in settings.chosen:
        return None
    wrong = [
        point
        for point in points
        if point is not top
        and np.isfinite(significant.get(point.omega, np.inf))
        and significant[point.omega] > _tolerated(point, top, accuracy)
    ]
    followed = followed or any(point.branch for point in points)
    # where there may be several motions, more are asked for by the points of the next curve only
    most = most if family_member(family, settings).model.loads_prescribed else min(most, 1)
    richer = _next_for_flanks(settings, followed) if wrong and most > 0 else None
    for _ in range(most - 1):
        more = None if richer is None else _next_for_flanks(richer, followed)
        if richer is None or more is None:
            break
        if _all_hold(family, settings, richer, wrong, top, accuracy):
            break
        richer = more
    return richer


def _next_for_flanks(settings: Settings, followed: bool) -> Settings | None:
    """One step of the harmonics, to OVERTONES before any more; None where there is none.

    Args:
        followed: the curve is followed round folds, which beyond OVERTONES takes longer than all
            else: 42 s in place of 10 for one flank (seed 105 of benchmarks/choice_random.py).
    """
    richer = enriched_settings(settings, "harmonics")
    if richer is None or richer.harmonics <= OVERTONES:
        return richer
    if settings.harmonics < OVERTONES:
        return replace(richer, harmonics=OVERTONES)
    return None if followed else richer


def steps_of_harmonics(poorer: Settings, richer: Settings) -> int:
    """How many steps of `_next_for_flanks` lie between two numbers of harmonics."""
    steps = 0
    while poorer.harmonics < richer.harmonics:
        poorer = _next_for_flanks(poorer, False) or richer
        steps += 1
    return steps


def _tolerated(point: Solution, top: Solution, accuracy: float) -> float:
    """Relative error of a point that is the accuracy of the peak."""
    return accuracy * size(top) / max(size(point), 1e-6 * size(top))


def _all_hold(
    family: Family,
    settings: Settings,
    richer: Settings,
    points: Sequence[Solution],
    top: Solution,
    accuracy: float,
) -> bool:
    """None of the points is known to be wrong beyond its tolerance with richer settings: a sweep
    with these costs far more than the points.
    """
    other = richer_settings(family, richer, "harmonics")
    if other is None:
        return True
    options = replace(solver_options(1e-2), fallbacks=False, iterations=JUDGE_STEPS)
    for point in points:
        moved = moved_solution(family, settings, point, richer, options)
        if not moved.converged:
            continue
        error = _change(family, richer, moved, other, "harmonics", 1.0, moved)
        if np.isfinite(error) and error > _tolerated(moved, top, accuracy):
            return False
    return True

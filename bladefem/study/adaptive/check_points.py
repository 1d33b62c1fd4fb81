"""Which points of a curve are checked: where experience says that it may be wrong, and where a
cheap look does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...hbm.model import ReducedModel
from ...hbm.solution import Solution, size
from ...hbm.stability import AFFORDABLE_OPERATIONS, STABLE, UNIQUE, UNSTABLE, stability_verdict
from ...hbm.truncation_indicator import truncation_indicator
from .family import Family, family_member
from .indicators import richer_settings
from .settings import Settings

# of the peak's height: where a curve is checked on each side in addition to the peak itself
CHECKED_HEIGHT_SHARES = (0.7, 0.25)
# points that are checked because left-out harmonics move much there,
MAX_CHECKED_PEAKS = 3
# from this share of the accuracy on
MIN_SHARE_OF_ACCURACY = 0.1
# highest points among which one that is not unstable is looked for
MAX_JUDGED_POINTS = 100


def points_to_check(
    points: Sequence[Solution],
    heights: np.ndarray,
    moved: np.ndarray,
    accuracy: float,
) -> list[Solution]:
    """The points that a curve is checked at.

    The peak, one on each flank for each of CHECKED_HEIGHT_SHARES of its height, the highest of the
    others at which contacts begin to slip or to lift, since a short slip needs more samples than a
    long one, the highest at which more of them do, where the curve has a kink, and the
    MAX_CHECKED_PEAKS highest maxima of the motion by harmonics that were left out: internal
    resonances of higher harmonics keep to no height.

    Args:
        heights: (points,) what `heights_of` gives.
        moved: (points,) what `left_out_motion` gives.
        accuracy: relative, of the peak.
    """
    places = [i for i, p in enumerate(points) if p.converged]
    good = [points[i] for i in places]
    motion = moved[places]
    heights = heights[places]
    top = int(heights.argmax())
    chosen = [top]
    for share in CHECKED_HEIGHT_SHARES:
        for side in (range(top), range(top + 1, len(good))):
            if len(side):
                chosen.append(min(side, key=lambda i: abs(heights[i] - share * heights[top])))
    kinds = [(p.states["lift"] + p.states["open"], p.states["slip"]) for p in good]
    for part in ([(a > 0, b > 0) for a, b in kinds], kinds):
        begin = {
            max(i, i + 1, key=part.__getitem__)
            for i in range(len(good) - 1)
            if part[i] != part[i + 1]
        }
        chosen += sorted(begin - set(chosen), key=heights.__getitem__)[-1:]
    motion = motion * heights / heights[top]
    padded = np.concatenate([[0.0], motion, [0.0]])
    maxima = np.flatnonzero(
        (motion > MIN_SHARE_OF_ACCURACY * accuracy)
        & (motion >= padded[:-2])
        & (motion >= padded[2:])
    )
    chosen += sorted(maxima, key=lambda i: -motion[i])[:MAX_CHECKED_PEAKS]
    return [good[i] for i in dict.fromkeys(chosen)]


def left_out_motion(
    family: Family,
    used: Sequence[Settings],
    points: Sequence[Solution],
) -> np.ndarray:
    """(points,) motion of the contacts by harmonics that were left out, over the first one; 0 where
    all of them stick.

    Args:
        used: settings of each point.
    """
    moved = np.zeros(len(points))
    groups: dict[tuple[Settings, int], list[int]] = {}
    for i, (settings, point) in enumerate(zip(used, points, strict=True)):
        if point.converged and point.states["stick"] < len(point.w):
            groups.setdefault((settings, point.harmonics), []).append(i)
    for (settings, harmonics), found in groups.items():
        more = richer_settings(family, settings, "harmonics")
        if more is not None and more.harmonics > harmonics:
            model = family_member(
                family, replace(more, modes=max(settings.modes, family.modes))
            ).model
            moved[found] = truncation_indicator(model, [points[i] for i in found], more.harmonics)
    return moved


def heights_of(points: Sequence[Solution]) -> np.ndarray:
    """(points,) what a peak is measured by [m]; 0 at points that were not solved."""
    return np.array([size(p) if p.converged else 0.0 for p in points])


def peak_of(points: Sequence[Solution]) -> Solution:
    """The highest converged point."""
    return max((p for p in points if p.converged), key=size)


def lasting_peak(model: ReducedModel, points: Sequence[Solution]) -> Solution:
    """The highest converged point above which all are unstable; the highest of all where that is
    not known to be otherwise.
    """
    good = sorted((p for p in points if p.converged), key=size, reverse=True)
    if model.loads_prescribed:
        return good[0]
    for point in good[:MAX_JUDGED_POINTS]:
        verdict = stability_verdict(model, point, AFFORDABLE_OPERATIONS).verdict
        if verdict != UNSTABLE:
            return point if verdict in (STABLE, UNIQUE) else good[0]
    return good[0]

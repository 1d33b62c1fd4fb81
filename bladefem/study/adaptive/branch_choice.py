"""Settings for a response with several motions at one frequency, whose peak may lie on a fold.

At the frequency of such a peak a richer model may have no motion of that kind at all, so that the
error of a point says nothing. Settings are chosen at a point lower on the same piece, and the peak
is judged by the peak of a richer model, followed from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from ...errors import NotSolvedError
from ...hbm.branches import PATH_TOLERANCE
from ...hbm.continuation import follow
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution, size
from .family import Family, family_member
from .indicators import ESTIMATE_OPTIONS, moved_solution, richest_settings
from .settings import Settings

# shares of the peak's height at which a point of the same piece is looked for
ANCHOR_HEIGHT_SHARE = 0.6
START_HEIGHT_SHARES = (0.9, 0.75, 0.5)
# arc-length steps of the path to the richer model's peak, as shares of the band
ARC_STEPS = (0.003, 0.015)
# points of that path
MAX_PATH_POINTS = 150
# unknowns up to which the richer model's peak is followed; of larger ones points right below the
# peak are compared
MAX_FOLLOWED_UNKNOWNS = 1200
FREQUENCY_SHARES_BELOW = (0.99, 0.95, 0.9, 0.75)
# fall of the height by which its peak has been passed
PASSED_HEIGHT_DROP = 2e-3


def anchor_of(
    points: Sequence[Solution],
    top: Solution,
    share: float = ANCHOR_HEIGHT_SHARE,
) -> Solution:
    """The point on the piece of the peak that has about a share of its height."""
    piece = [p for p in points if p.converged and p.branch == top.branch]
    return min(piece, key=lambda p: abs(size(p) - share * size(top)))


def peak_error(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
) -> float:
    """Relative error of a peak's height: against that of a model richer in every respect.

    Large richer models are compared at the highest point below the peak at which they have the
    same motion.

    Returns:
        infinite where the richer model's peak was not found.
    """
    rich = richest_settings(family, settings)
    if rich == settings:
        return 0.0
    model = family_member(family, rich).model
    if model.unknowns(rich.harmonics) > MAX_FOLLOWED_UNKNOWNS:
        return _error_below(family, settings, points, top, rich)
    omegas = [p.omega for p in points]
    bounds = 0.9 * min(omegas), 1.1 * max(omegas)
    for share in START_HEIGHT_SHARES:
        anchor = anchor_of(points, top, share)
        if anchor is top:
            continue
        start = moved_solution(family, settings, anchor, rich, ESTIMATE_OPTIONS)
        if not start.converged:
            continue
        height = _peak_along_path(model, start, bounds, top.omega > anchor.omega)
        if height is not None:
            return float(abs(height - size(top)) / height)
    return float(np.inf)


def _peak_along_path(
    model: ReducedModel,
    start: Solution,
    bounds: tuple[float, float],
    forward: bool,
) -> float | None:
    """Height [m] of the first maximum of the path in frequency from a point; None where the path
    ends before it.
    """
    options = replace(ESTIMATE_OPTIONS, tolerance=PATH_TOLERANCE, frugal=False)
    path = follow(model, "omega", start, bounds, forward=forward, steps=ARC_STEPS, options=options)
    height = 0.0
    now = 0.0
    try:
        for point in islice(path, MAX_PATH_POINTS + 1):
            now = size(point.solution)
            height = max(height, now)
            # small dips are rounding or a corner, not the far side of the peak
            if now < (1 - PASSED_HEIGHT_DROP) * height:
                break
    except NotSolvedError:
        return None
    return height if now < height else None


def _error_below(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
    rich: Settings,
) -> float:
    """Relative error of the height of a point right below the peak."""
    for share in FREQUENCY_SHARES_BELOW:
        point = anchor_of(points, top, share)
        better = moved_solution(family, settings, point, rich, ESTIMATE_OPTIONS)
        if better.converged:
            return float(abs(size(better) - size(point)) / size(better))
    return float(np.inf)

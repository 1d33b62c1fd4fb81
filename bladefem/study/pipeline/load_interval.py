"""How sure the resonance of one load is: its range over the friction forces that the loading
history may have left in contact points that never slip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...errors import NotSolvedError
from ...hbm.history_interval import MONOTONE, POINT, HistoryInterval, history_interval
from ...hbm.model import ReducedModel
from ...hbm.peak import find_peak
from ...hbm.solution import Solution, size
from ...scene.units import newtons
from ..adaptive.settings import Settings

# tolerance of heights, over the accuracy wanted
HEIGHT_TOLERANCE_SHARE = 0.02
# points of the balance, over those of the curve, after which no further move begins
MAX_COST_RATIO = 4
UNKNOWN = "unknown"


@dataclass(frozen=True)
class LoadInterval:
    """Range of a resonance over all loading histories."""

    # [m]
    lowest: float
    highest: float
    # "point", "monotone", "sampled" (`bladefem.hbm.history_interval`), or "unknown"
    certificate: str
    # contact points that never slip at the resonance
    sticking: int
    # of the balance that were solved
    points: int
    # what could not be solved; "" when nothing
    reason: str


def load_interval(
    model: ReducedModel,
    settings: Settings,
    top: Solution,
    accuracy: float,
    points: int = 40,
) -> LoadInterval:
    """The interval of the resonance near the highest point of a curve, with the curve's settings.

    Args:
        points: of the curve; the interval takes at most some MAX_COST_RATIO times as many.
    """
    tolerance = HEIGHT_TOLERANCE_SHARE * accuracy
    try:
        peak = find_peak(
            model,
            top.omega,
            settings.harmonics,
            settings.samples,
            near=top,
            tolerance=tolerance,
        )
        found = history_interval(model, peak, tolerance=tolerance, most=MAX_COST_RATIO * points)
    except NotSolvedError as error:
        return LoadInterval(size(top), size(top), UNKNOWN, 0, 0, str(error))
    return _record(found, peak.points)


def _record(found: HistoryInterval, before: int) -> LoadInterval:
    return LoadInterval(
        found.lowest.height,
        found.highest.height,
        found.certificate,
        found.sticking,
        found.points + before,
        found.reason,
    )


def interval_sentence(loads: Sequence[float], found: Sequence[LoadInterval]) -> str:
    """What the intervals of several loads [N] say."""
    points = [load for load, one in zip(loads, found, strict=True) if one.certificate == POINT]
    parts = []
    if points:
        named = ", ".join(newtons(load, 4) for load in points)
        parts.append(
            f"at {named} the resonance does not depend on the loading history: the interval is a "
            "point"
        )
    for load, one in zip(loads, found, strict=True):
        if one.certificate == POINT:
            continue
        if one.certificate == UNKNOWN:
            parts.append(f"at {newtons(load, 4)} the interval was not found: {one.reason}")
            continue
        how = "certified monotone" if one.certificate == MONOTONE else "sampled, it may be wider"
        parts.append(
            f"at {newtons(load, 4)} {one.sticking} contact points never slip, and what the loading "
            f"history left in them puts the resonance between {1e6 * one.lowest:.4g} and "
            f"{1e6 * one.highest:.4g} um ({how})"
        )
    return "loading history: " + "; ".join(parts)

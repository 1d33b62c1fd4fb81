"""What the blade does where its motion is unstable: marched in time from there.

Contacts with one tangential direction and blades in phase are marched exactly between changes of
contact state (``exact_march``), others by steps (``march_by_steps``), both on the same reduced
model as the balance. Of a travelling wave all blades are marched, after which it repeats.
"""

from __future__ import annotations

from dataclasses import replace

from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.ring_march import march_operations
from ...hbm.solution import Solution, size
from ..adaptive.family import Family
from ..adaptive.indicators import moved_solution
from ..adaptive.settings import Settings
from .exact_march import exact_band
from .kept_band import KeptBand, scaled_band, unknown_band
from .march_by_steps import (
    KEPT_BY_STEPS,
    LEFT_BY_STEPS,
    MAX_COUNTED,
    MAX_COUNTED_LAST,
    band_by_steps,
)
from .verdicts import JUDGED_OPTIONS, model_in_time, settings_in_time

# operations of a march by steps, as estimated, above which it is not begun: fewer contact points
# are tried
MAX_MARCH = 1.5e11
# contact points of a patch below which a march is given up rather than made coarser
FEWEST_POINTS = 4


def kept_of_family(models: Family, settings: Settings, point: Solution) -> KeptBand:
    """``kept_band``, with fewer contact points where a march with all of them takes too long.

    The amplitudes of the coarser model are multiplied by what the finer one has more of them at the
    unstable motion. Where that motion is not solved with fewer points, the march with the last ones
    with which it was gets as many operations as one with the fewest points.
    """
    fewer = settings
    too_long: tuple[Settings, Solution] | None = None
    while True:
        most = _has_fewest_points(fewer)
        model = model_in_time(models, settings_in_time(models, fewer))
        if most or affordable_march(model):
            moved = _with_points(models, settings, point, fewer)
            if moved is None:
                break
            counted = MAX_COUNTED_LAST if most else MAX_COUNTED
            band = _kept_with(models, settings, point, fewer, moved, counted)
            if most or not band.too_long:
                return band
            too_long = (fewer, moved)
        fewer = replace(fewer, points=max(FEWEST_POINTS, (fewer.points or 0) // 2))
    if too_long is None:
        return unknown_band(point, "its motion with fewer contact points was not solved")
    return _kept_with(models, settings, point, *too_long, MAX_COUNTED_LAST)


def _has_fewest_points(settings: Settings) -> bool:
    """A march with fewer contact points is not tried."""
    return settings.points is None or settings.points <= FEWEST_POINTS


def _with_points(
    models: Family, settings: Settings, point: Solution, fewer: Settings
) -> Solution | None:
    """The motion with other contact points, which is only where a march starts: None where it is
    not solved in a few steps from there. All ways to it would take longer than the march.
    """
    if fewer == settings:
        return point
    moved = moved_solution(models, settings, point, fewer, JUDGED_OPTIONS)
    return moved if moved.converged else None


def _kept_with(
    models: Family,
    settings: Settings,
    point: Solution,
    fewer: Settings,
    moved: Solution,
    counted: float,
) -> KeptBand:
    """What the blade keeps to after an unstable motion, marched with other contact points.

    Args:
        moved: the motion with these.
        counted: operations that a march by steps may need, as its first periods show.
    """
    model = model_in_time(models, settings_in_time(models, fewer))
    band = kept_band(model, moved, counted)
    if fewer == settings:
        return band
    ratio = size(point) / size(moved)
    return replace(scaled_band(band, ratio), points=fewer.points)


def affordable_march(model: ReducedModel) -> bool:
    """A march by steps is not too long, or not possible at all."""
    try:
        return march_operations(model, LEFT_BY_STEPS + KEPT_BY_STEPS) <= MAX_MARCH
    except InputError:
        return True


def kept_band(model: ReducedModel, point: Solution, counted: float = MAX_COUNTED) -> KeptBand:
    """The band of amplitudes that the model keeps to after an unstable motion.

    Args:
        counted: operations that a march by steps may need, as its first periods show.
    """
    return exact_band(model, point) or band_by_steps(model, point, counted)

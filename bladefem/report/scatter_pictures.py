"""Pictures of drawn wheels: bands over the load, and a histogram."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ..scene.units import newtons
from ..view import wheel as view
from ..wheel.statistics import (
    Amplification,
)
from .scatter_tables import SCATTER_QUANTILES, lowest_known, optima_of_scatter, optimum_is_known


def marked_optima(
    found: Amplification, searched: float | None
) -> list[tuple[str, float, float, float]]:
    """Name, load and interval of the optima, for the chart."""
    (load, _), robust = optima_of_scatter(found, searched)
    name = f"robust optimum ({100 * robust.share:g} %)"
    own = robust.load
    return [("tuned optimum", load, load, load), (name, own.value, own.low, own.high)]


def scatter_drawings(
    found: Amplification, searched: float | None = None
) -> dict[str, Callable[[Path], object]]:
    """Bands against the load, and the histogram under the load with the lowest tuned wheel, where
    amplifications are known.

    Args:
        searched: as that of `optima_of_scatter`.
    """
    drawings: dict[str, Callable[[Path], object]] = {}
    i = lowest_known(found)
    if i is not None:
        marks = {f"{100 * s:g} %": found.quantile(i, s).value for s in SCATTER_QUANTILES[:2]}
        drawings["wheel/scatter_histogram"] = partial(
            view.draw_histogram, found.factor[i], marks, newtons(found.loads[i])
        )
    if len(found.loads) > 1:
        optima = marked_optima(found, searched) if optimum_is_known(found) else []
        drawings["wheel/scatter_chart"] = partial(
            view.draw_bands, found.loads, found.tuned, _known_bands(found), optima
        )
    return drawings


def _known_bands(found: Amplification) -> dict[str, np.ndarray]:
    """(L, 3) quantiles of the highest blade with their intervals [m], NaN where not known."""
    bands = {}
    for share in SCATTER_QUANTILES[:2]:
        rows = np.array([[q.value, q.low, q.high] for q in found.quantiles(share)])
        rows[~found.is_known] = np.nan
        bands[f"{100 * share:g} % of wheels"] = found.tuned[:, None] * rows
    return bands

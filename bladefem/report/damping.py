"""The equivalent damping ratio of a resonance with friction, where there is one, and how sure it
is.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..study.pipeline.design_table import equivalent_damping
from ..util.arrays import RealArray
from ..util.percent import percent
from ..view.optimum import at_band_end
from .best_load import error_words, of_same_damper

# relative error up to which its parts may be added: the ratio is one over the amplitude
LARGEST_TOLD = 0.5


def damping_column(table: pd.DataFrame, points: pd.DataFrame, own: float) -> RealArray:
    """(rows,) equivalent damping ratios of a design table; NaN where no resonance was seen, in all
    rows where that is the one without damper.

    Args:
        table: the design table, the row without damper first.
        points: response table.
        own: damping ratio of the blade without damper.
    """
    frequency, height = (
        table[name].to_numpy(float) for name in ("peak_frequency", "peak_amplitude")
    )
    cut = at_band_end(table, points)
    if cut[0]:
        return np.full(len(table), np.nan)
    ratio = equivalent_damping(own, frequency, height, (frequency[0], height[0]))
    return np.where(cut, np.nan, ratio)


def damping_there(
    summary: pd.DataFrame,
    best: pd.Series,
    points: pd.DataFrame | None = None,
) -> list[tuple[str, str, str]]:
    """The damping ratio of a linear blade with the amplitude of the damped one: what, value,
    remark; nothing where it is not known.
    """
    free = _without_damper(summary)
    if free is None or _is_cut(best, points):
        return []
    ratio = float(
        equivalent_damping(
            free["equivalent_damping"],
            best["peak_frequency"],
            best["peak_amplitude"],
            (free["peak_frequency"], free["peak_amplitude"]),
        )
    )
    if np.isnan(ratio):
        return []
    return [
        (
            "equivalent damping ratio there",
            f"{100 * ratio:.3g} %",
            f"Q = {1 / (2 * ratio):.3g}: a linear blade with this damping would have the same "
            f"amplitude; {100 * free['equivalent_damping']:.3g} % without damper",
        )
    ]


def damping_error_words(summary: pd.DataFrame, best: pd.Series, frequency: float) -> str:
    """How sure the ratio is: it has the error of the amplitude, twice that of the frequency, and
    what the changed shape of the mode does, at most as much as in full stick, which adds no
    damping.

    Args:
        frequency: relative error of the resonance frequency; NaN where it is not known.
    """
    error = best.get("error", np.nan)
    if not np.isfinite(error):
        return error_words(best)
    square = 2 * np.nan_to_num(frequency)
    total = error + square
    parts = [f"{percent(square)} by the frequency"] if square > 0 else []
    if np.isnan(frequency):
        parts.append("the frequency apart")
    free = _without_damper(summary)
    stuck = of_same_damper(summary[np.isinf(summary["load"])], best)
    shape = np.nan
    if free is not None and len(stuck):
        shape = abs(stuck["equivalent_damping"].iloc[0] / free["equivalent_damping"] - 1)
    if np.isfinite(shape):
        total += shape
        parts.append(f"{percent(shape)} by the mode's shape, as in full stick")
    else:
        parts.append("the mode's changed shape apart")
    if total > LARGEST_TOLD:
        return f"error not told, above {percent(LARGEST_TOLD)}"
    return f"± {percent(max(total, 1e-4))} ({', '.join(parts)})"


def _without_damper(summary: pd.DataFrame) -> pd.Series | None:
    """The row without damper, where its damping ratio is given."""
    free = summary[summary["load"] == 0]
    known = not free.empty and free.iloc[0].get("equivalent_damping", np.nan) > 0
    return free.iloc[0] if known else None


def _is_cut(best: pd.Series, points: pd.DataFrame | None) -> bool:
    """Whether the highest motion is at the end of the band."""
    if points is None or points.empty:
        return False
    known = [name for name in ("load", "mass", "peak_frequency") if name in best]
    row = pd.DataFrame({name: [float(best[name])] for name in known})
    return bool(at_band_end(row, points)[0])

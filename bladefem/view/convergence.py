"""Mesh refinement: frequencies against the size of the elements, with the fit that gives limit and
order.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from .style import COLOURS, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_convergence(
    points: pd.DataFrame,
    summary: pd.DataFrame,
    file: str | Path | None = None,
) -> object:
    """Each mode's frequency against its finest one over element size; returns the figure.

    A mode whose order is believed has its fit drawn down to the limit at size 0; the others are
    joined by dots.

    Args:
        points: columns size [m], mode, frequency [Hz], optionally nodal_diameter.
        summary: columns mode, frequency, limit [Hz], order [1], reason, optionally nodal_diameter.
        file: PNG to write.
    """
    keys = [key for key in ("nodal_diameter", "mode") if key in summary]
    with canvas(file, size=(7.6, 4.6)) as ax:
        # rigid modes have no frequency to change
        for i, row in enumerate(summary[summary["frequency"] > 0].itertuples()):
            line = points[np.logical_and.reduce([points[key] == getattr(row, key) for key in keys])]
            _draw_mode(ax, line.sort_values("size"), row, COLOURS[i % len(COLOURS)])
        ax.axhline(0.0, color="#999999", lw=0.8, zorder=1)
        ax.set(
            xlabel="mean size of the elements [mm]",
            ylabel="frequency over that of the finest mesh, less 1 [%]",
            xlim=(0, None),
            title="mesh refinement",
        )
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        return ax.figure


def _draw_mode(
    ax: Axes,
    line: pd.DataFrame,
    row: Any,
    colour: str,
) -> None:
    """Points, and the fit or dots."""
    h = 1e3 * line["size"].to_numpy()
    change = 100 * (line["frequency"].to_numpy() / row.frequency - 1)
    name = f"mode {row.mode}" + (
        f", n = {row.nodal_diameter}" if hasattr(row, "nodal_diameter") else ""
    )
    if row.reason:
        ax.plot(h, change, "o:", ms=4.5, color=colour, lw=0.9, label=f"{name}: no order")
        return
    limit = 100 * (row.limit / row.frequency - 1)
    t = np.linspace(0.0, h.max(), 80)
    shape = h**row.order
    slope = shape @ (change - limit) / (shape @ shape)
    ax.plot(t, limit + slope * t**row.order, "-", color=colour, lw=1.2)
    ax.plot(
        h,
        change,
        "o",
        ms=4.5,
        color=colour,
        label=f"{name}: order {row.order:.1f}, limit {row.limit:.5g} Hz",
    )
    ax.plot(0.0, limit, "D", ms=6, mfc="white", mec=colour, clip_on=False, zorder=5)

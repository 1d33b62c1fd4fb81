"""The chart of speed against accuracy: methods above, models below."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from .response import draw_accuracy
from .style import canvas

__all__ = ["draw_chart"]


def draw_chart(methods: pd.DataFrame, models: pd.DataFrame, file: str | Path | None = None, *,
               tolerance: float | None = None, title: str = "") -> object:
    """Error of the resonance amplitude over time for each frequency; returns the figure.

    Args:
        methods, models: the tables of ``bladefem.study.chart.Chart``; rows that were left out are not drawn, errors
            below the reference's own (grey) are drawn at it.
        file: PNG to write.
        tolerance: wanted relative accuracy.
        title: headline.
    """
    with canvas(file, None, (9.5, 9.0), (2, 1)) as axes:
        for ax, table, what in zip(axes, (methods, models), ("methods", "models"), strict=True):
            floor = max(np.nan_to_num(table["reference_error"].iloc[0]), 1e-12)
            shown = table[~table["left_out"]].assign(error=lambda t, floor=floor: t["error"].clip(lower=floor))
            draw_accuracy(shown, ax=ax, tolerance=tolerance, title=f"{title}: {what}" if title else what)
            ax.set_ylim(bottom=floor / 2)
            ax.axhspan(floor / 2, floor, color="#bbbbbb", alpha=0.5, zorder=0)
            ax.set(xlabel="time for each frequency [s]", ylabel="relative error of the resonance amplitude [1]")
        return axes[0].figure

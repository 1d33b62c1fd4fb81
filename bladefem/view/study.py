"""A study of one field: the best load of each value, and amplitude against load for each of
them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from .style import COLOURS, MICRO, canvas, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_study(
    table: pd.DataFrame,
    loads: pd.DataFrame,
    file: str | Path | None = None,
    *,
    label: str = "value",
    title: str = "",
) -> object:
    """Resonance amplitude and frequency at the best load over the value, and next to it all loads;
    returns the figure.

    Args:
        table: one row a value: axis (number or text), value (text), peak_amplitude [m],
            peak_frequency [Hz], free_amplitude [m], free_frequency [Hz], load [N].
        loads: one row a load of each value: value, load [N], peak_amplitude [m].
        file: PNG to write.
        label: of the axis of values.
        title: headline.
    """
    with canvas(file, None, (10.4, 5.6), (2, 2)) as axes:
        table = table if table["axis"].dtype == object else table.sort_values("axis")
        for axis, column, scale in (
            (axes[0, 0], "amplitude", MICRO),
            (axes[1, 0], "frequency", 1.0),
        ):
            axis.plot(
                table["axis"],
                scale * table[f"free_{column}"],
                "--",
                color="#777777",
                label="no damper",
            )
            axis.plot(
                table["axis"],
                scale * table[f"peak_{column}"],
                "o-",
                color=COLOURS[0],
                label="best load",
            )
        axes[0, 0].set(ylabel="resonance amplitude [µm]", title=title)
        axes[1, 0].set(ylabel="resonance frequency [Hz]", xlabel=label)
        log_axis(axes[0, 0], "y")
        axes[1, 0].legend()
        grid = axes[0, 1].get_gridspec()
        for axis in axes[:, 1]:
            axis.remove()
        _draw_loads(axes[0, 0].figure.add_subplot(grid[:, 1]), loads)
        return axes[0, 0].figure


def _draw_loads(axis: Axes, loads: pd.DataFrame) -> None:
    """Amplitude against load, a line a value."""
    damped = loads[(loads["load"] > 0) & (loads["load"] < float("inf"))]
    for (value, part), colour in zip(
        damped.groupby("value", sort=False), COLOURS * 9, strict=False
    ):
        part = part.sort_values("load")
        axis.plot(part["load"], MICRO * part["peak_amplitude"], "o-", color=colour, label=value)
    axis.set(
        xlabel="normal load per seat [N]", ylabel="resonance amplitude [µm]", title="all loads"
    )
    log_axis(axis, "x")
    log_axis(axis, "y")
    axis.legend()

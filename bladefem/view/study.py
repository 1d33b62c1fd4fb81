"""A study of one field: the best load of each value, and amplitude against load for each of
them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from .optimum import LONGEST_BAR
from .style import COLOURS, FAILED_COLOUR, MICRO, canvas, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# what gives a resonance: the words of the column "given_by"
LINEAR, BALANCE = "linear response", "balance"
MARCH, STIFF_LAYER, UNSTABLE = "march in time", "stiff layer", "unstable balance"
# marks of those that no stable balance gives, as in pictures of responses
MARKS = {MARCH: "D", STIFF_LAYER: "D", UNSTABLE: "s"}
# curves over the values by the beginning of their columns: line, colour, words of the legend
CURVES = {
    "free": ("--", "#777777", "no damper"),
    "peak": ("o-", COLOURS[0], "best load"),
    "own": ("^-.", COLOURS[1], "damper's own load"),
}


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
            peak_frequency [Hz], free_amplitude [m], free_frequency [Hz], load [N], error (NaN: not
            estimated, inf: unknown), given_by (words of this file); own_amplitude [m] and
            own_frequency [Hz] under the damper's own load where that was studied.
        loads: one row a load of each value: value, load [N], peak_amplitude [m], error, given_by.
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
            for name, (style, colour, words) in CURVES.items():
                if f"{name}_{column}" in table:
                    heights = scale * table[f"{name}_{column}"]
                    axis.plot(table["axis"], heights, style, color=colour, label=words)
        amplitude = MICRO * table["peak_amplitude"]
        draw_certainty(axes[0, 0], table["axis"], amplitude, table, COLOURS[0])
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
        amplitude = MICRO * part["peak_amplitude"]
        axis.plot(part["load"], amplitude, "o-", color=colour, label=value)
        draw_certainty(axis, part["load"], amplitude, part, colour)
    # the marks once, after all values
    for words, mark, face in _marks_in(damped):
        axis.plot([], [], mark, color="none", mfc=face, mec=FAILED_COLOUR, ms=7, label=words)
    axis.set(
        xlabel="normal load per seat [N]", ylabel="resonance amplitude [µm]", title="all loads"
    )
    log_axis(axis, "x")
    log_axis(axis, "y")
    axis.legend()


def draw_certainty(
    axis: Axes, x: pd.Series, amplitude: pd.Series, rows: pd.DataFrame, colour: str
) -> None:
    """Bars of the estimated errors that are known, hollow marks where they are not, and marks of
    resonances that no stable balance gives.

    Args:
        x: of each row.
        amplitude: of each row, in the unit of the axis.
        rows: columns error and given_by.
        colour: of the bars.
    """
    error = rows["error"].to_numpy(float)
    known = np.where(np.isfinite(error), error, 0.0)
    # a logarithmic axis has no zero
    bars = np.stack([np.minimum(known, LONGEST_BAR), known]) * amplitude.to_numpy(float)
    axis.errorbar(x, amplitude, bars, fmt="none", ecolor=colour, elinewidth=1, capsize=2)
    for given, unknown in sorted({*zip(rows["given_by"], np.isinf(error), strict=True)}):
        if given not in MARKS and not unknown:
            continue
        here = ((rows["given_by"] == given) & (np.isinf(error) == unknown)).to_numpy()
        axis.plot(
            x[here],
            amplitude[here],
            MARKS.get(given, "o"),
            mfc="white" if unknown else colour,
            mec=FAILED_COLOUR,
            mew=1.5,
            ms=7,
            ls="none",
            zorder=5,
        )


def _marks_in(rows: pd.DataFrame) -> list[tuple[str, str, str]]:
    """(words, mark, face) of the marks that are drawn, for the legend."""
    found = [
        (words, mark, "#999999")
        for words, mark in MARKS.items()
        if (rows["given_by"] == words).any()
    ]
    if np.isinf(rows["error"]).any():
        found.append(("error unknown (hollow)", "o", "white"))
    return found

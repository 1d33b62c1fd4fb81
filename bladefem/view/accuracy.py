"""Speed against accuracy: error over computing time of each method, and their Pareto front."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from .labels import names_apart
from .style import COLOURS, FAILED_COLOUR, canvas, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def pareto_front(time: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Indices of the points that no other beats in both time and error, by increasing time."""
    order = np.lexsort((error, time))
    best = np.minimum.accumulate(np.append(np.inf, error[order]))[:-1]
    return order[error[order] < best]


def draw_accuracy(
    table: pd.DataFrame,
    file: str | Path | None = None,
    *,
    ax: Axes | None = None,
    tolerance: float | None = None,
    title: str = "",
) -> object:
    """Error over time of each setting, the Pareto front, and a star on the automatic choice;
    returns the figure.

    Args:
        table: one row a setting: name, time [s], error [1]; optional bool columns "chosen" and
            "converged", optional text column "family" for the colour.
        file: PNG to write.
        ax: axes to draw into; names are to be moved apart (names_apart) when its limits are set.
        tolerance: wanted relative accuracy, drawn as a line.
        title: headline.
    """
    alone = ax is None
    with canvas(file, ax, (7.2, 4.6)) as ax:
        good = (
            table["converged"].astype(bool)
            if "converged" in table
            else pd.Series(True, index=table.index)
        )
        families = table["family"] if "family" in table else pd.Series("setting", index=table.index)
        marked = (
            table["chosen"].astype(bool)
            if "chosen" in table
            else pd.Series(False, index=table.index)
        )
        for name, colour in zip(families.unique(), COLOURS * 9, strict=False):
            part = table[(families == name) & good & ~marked]
            if part.empty:
                continue
            ax.plot(part["time"], part["error"], "o", color=colour, ms=5, alpha=0.8, label=name)
        _draw_failed_settings(ax, table[~good])
        draw_front(ax, table[good])
        if tolerance is not None:
            ax.axhline(
                tolerance,
                color="#555555",
                ls="--",
                lw=1,
                label=f"wanted accuracy {100 * tolerance:.3g} %",
            )
        ax.set(xlabel="time [s]", ylabel="error [%]", title=title or "speed against accuracy")
        log_axis(ax, "x")
        log_axis(ax, "y", 100.0)
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        if alone:
            names_apart(ax)
        return ax.figure


def _draw_failed_settings(ax: Axes, failed: pd.DataFrame) -> None:
    """Crosses at the top, with names, for settings without an error to show."""
    if failed.empty:
        return
    ax.plot(
        failed["time"],
        np.full(len(failed), 0.98),
        "x",
        color=FAILED_COLOUR,
        ms=7,
        mew=1.8,
        transform=ax.get_xaxis_transform(),
        label=f"not converged ({len(failed)})",
    )
    for _, row in failed[failed["time"].notna()].iterrows():
        ax.annotate(
            str(row["name"]),
            (row["time"], 0.98),
            (6, -13),
            xycoords=ax.get_xaxis_transform(),
            textcoords="offset points",
            fontsize=7.5,
            color=FAILED_COLOUR,
        )


def draw_front(ax: Axes, table: pd.DataFrame) -> None:
    """The Pareto front as stairs, with names where there is room, and the chosen setting."""
    front = table.iloc[pareto_front(table["time"].to_numpy(float), table["error"].to_numpy(float))]
    ax.step(
        front["time"],
        front["error"],
        where="post",
        color="#888888",
        lw=1,
        zorder=1,
        label="Pareto front",
    )
    for _, row in (
        front.sort_values("chosen", ascending=False) if "chosen" in front else front
    ).iterrows():
        ax.annotate(
            str(row["name"]),
            (row["time"], row["error"]),
            (6, 8),
            textcoords="offset points",
            fontsize=7.5,
        )
    if "chosen" in table and table["chosen"].any():
        chosen = table[table["chosen"].astype(bool)]
        ax.plot(
            chosen["time"],
            chosen["error"],
            "*",
            color=COLOURS[4],
            mec="black",
            ms=15,
            mew=0.8,
            zorder=5,
            label="automatic choice",
        )

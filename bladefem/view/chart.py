"""The chart of speed against accuracy: methods, models, and meshes where they were compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from .accuracy import draw_accuracy
from .labels import names_apart
from .style import canvas, log_axis

ERROR_LABELS = {
    "error": "resonance amplitude",
    "error_frequency": "resonance frequency",
    "error_phasor": "worst phasor over the highest one",
}


def draw_chart(
    tables: Mapping[str, pd.DataFrame],
    file: str | Path | None = None,
    *,
    tolerance: float | None = None,
    title: str = "",
) -> object:
    """Error of the resonance amplitude over time, one panel a table; returns the figure.

    Args:
        tables: name to table of ``bladefem.study.chart.chart.Chart``, "methods" and "models" timed
            by frequency, "meshes" from drawing to resonance; rows that were left out are not drawn,
            errors below the reference's own (grey) are drawn at it.
        file: PNG to write.
        tolerance: wanted relative accuracy.
        title: headline.
    """
    with canvas(
        file, None, (9.5, 4.3 * len(tables) + 0.4), (len(tables), 1), squeeze=False
    ) as axes:
        for ax, (what, table) in zip(axes[:, 0], tables.items(), strict=True):
            floor = max(np.nan_to_num(table["reference_error"].iloc[0]), 1e-12)
            error = (
                table["error"]
                if what != "meshes"
                else table[["error", "error_frequency"]].max(axis=1)
            )
            shown = table.assign(error=error.clip(lower=floor))[~table["left_out"]]
            draw_accuracy(
                shown, ax=ax, tolerance=tolerance, title=f"{title}: {what}" if title else what
            )
            if np.isfinite(table["reference_error"].iloc[0]):
                _shade_below(ax, floor)
            ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
            _name_star(ax, what)
            _name_time(ax, what)
            of = "amplitude or frequency, the larger" if what == "meshes" else ERROR_LABELS["error"]
            ax.set(ylabel=f"error of the {of} [%]")
        names_apart(*axes[:, 0])
        return axes[0, 0].figure


def _shade_below(ax: Axes, floor: float) -> None:
    """The errors that are smaller than the reference's own."""
    top = ax.get_ylim()[1]
    margin = max(1.3, (top / floor) ** 0.08)
    bottom = floor / margin
    ax.set_ylim(bottom, top * margin)
    ax.axhspan(
        bottom,
        floor,
        color="#bbbbbb",
        alpha=0.5,
        zorder=0,
        label="below the reference's own error",
    )


def draw_errors(
    tables: Mapping[str, pd.DataFrame],
    file: str | Path | None = None,
    *,
    tolerance: float | None = None,
    title: str = "",
) -> object:
    """The three errors of the tables side by side over time, a row a table; returns the figure.

    Args:
        tables, file, tolerance, title: as for ``draw_chart``; what a table does not know leaves its
            place empty.
    """
    size = (5.2 * len(ERROR_LABELS) + 1.6, 4.0 * len(tables) + 0.4)
    with canvas(file, None, size, (len(tables), len(ERROR_LABELS)), squeeze=False) as axes:
        for row, (what, table) in zip(axes, tables.items(), strict=True):
            for ax, (column, of) in zip(row, ERROR_LABELS.items(), strict=True):
                if column not in table or not (table[column] > 0).any():
                    ax.set_axis_off()
                    continue
                least = table.loc[table[column] > 0, column].min()
                kept = table.assign(error=table[column].clip(lower=least))[~table["left_out"]]
                draw_accuracy(
                    kept,
                    ax=ax,
                    tolerance=tolerance if column != "error_frequency" else None,
                    title=of,
                )
                _name_star(ax, what)
                _name_time(ax, what)
                ax.set(ylabel=f"{what}: error [%]")
            _one_legend(row)
        axes[0, 0].figure.suptitle(title or None)
        names_apart(*(ax for ax in axes.flat if ax.axison))
        return axes[0, 0].figure


def _one_legend(row: Sequence[Axes]) -> None:
    """At the right of the row, or in the place that it leaves empty: a legend between two charts
    pushes them apart.
    """
    shown = [ax for ax in row if ax.axison]
    for ax in shown[:-1]:
        ax.get_legend().remove()
    if shown and shown[-1] is not row[-1]:
        legend = shown[-1].get_legend()
        row[-1].legend(
            legend.legend_handles,
            [text.get_text() for text in legend.get_texts()],
            loc="center left",
        )
        legend.remove()


def _name_time(ax: Axes, what: str) -> None:
    """Meshes take seconds, the other variants milliseconds a frequency."""
    if what == "meshes":
        ax.set(xlabel="CPU time from drawing the mesh to the resonance [s]")
    else:
        log_axis(ax, "x", 1e3)
        ax.set(xlabel="CPU time for each frequency [ms]")


def _name_star(ax: Axes, what: str) -> None:
    """The mesh is the scene's, no indicator chooses it."""
    for text in ax.get_legend().get_texts():
        if what == "meshes" and text.get_text() == "automatic choice":
            text.set_text("mesh of the scene")

"""What the best load depends on: bars of each parameter over its range."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from .style import COLOURS, canvas, headline

PANELS = (
    ("load", "best load [N]", 1.0),
    ("amplitude", "resonance amplitude [µm]", 1e6),
    ("frequency", "resonance frequency [Hz]", 1.0),
)


def draw_influences(table: pd.DataFrame, file: str | Path | None = None) -> object:
    """A row of bars a parameter: by the exact derivatives from the low to the high end of its
    range, with marks where the search was repeated; returns the figure.

    Args:
        table: ``report.influences.influence_table``: parameter, low, high, and for each of load,
            amplitude and frequency the value now (_now), at both ends by the derivatives (_low,
            _high) and solved again (_low_solved, _high_solved, NaN where not).
        file: PNG to write.
    """
    rows = np.arange(len(table))[::-1]
    names = [
        f"{name}\n× {low:.3g} … {high:.3g}"
        for name, low, high in zip(table["parameter"], table["low"], table["high"], strict=True)
    ]
    with canvas(file, None, (9.6, 0.62 * len(table) + 1.5), (1, 3), sharey=True) as axes:
        for ax, (name, title, factor) in zip(axes, PANELS, strict=True):
            now = factor * table[f"{name}_now"].iloc[0]
            for end, colour in (("low", COLOURS[0]), ("high", COLOURS[1])):
                value = factor * table[f"{name}_{end}"].to_numpy(float)
                label = f"{end} end, by derivatives"
                ax.barh(rows, value - now, left=now, height=0.55, color=colour, label=label)
                again = factor * table[f"{name}_{end}_solved"].to_numpy(float)
                ax.plot(
                    again,
                    rows,
                    "D",
                    # seen on bars of either colour
                    mfc=colour,
                    mec="white",
                    ms=9,
                    mew=1.5,
                    label=f"{end} end, solved again",
                )
            ax.axvline(now, color="#333333", lw=1)
            ax.set(xlabel=title)
            ax.margins(x=0.08)
            ax.tick_params(axis="x", labelsize=9)
        axes[0].set_yticks(rows, names)
        figure = axes[0].figure
        headline(figure, "what the best load depends on")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
        return figure

"""Lower motions that the blade may keep to at the frequency of a resonance: open marks below it.

Tables have them in a column "lower_amplitude" [m], empty where there is none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from .style import MICRO

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMN = "lower_amplitude"
# what the legend says of them
LOWER = "lower motion there, from rest"
# of the entry of the legend, which stands for all loads
LEGEND_COLOUR = "#777777"


def with_lower_motion(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table that have a lower motion; none where it has no such column."""
    return table[table[COLUMN].notna()] if COLUMN in table else table.iloc[:0]


def mark_lower(ax: Axes, at: Any, rows: pd.DataFrame, colour: Any) -> None:
    """Open marks of one colour at the lower motions of some rows.

    Args:
        at: place of each row on the axis of the figure.
    """
    ax.plot(
        at, MICRO * rows[COLUMN], "v", mfc="white", mec=colour, ms=6, mew=1.4, zorder=6, ls="none"
    )


def explain_lower(ax: Axes, table: pd.DataFrame) -> None:
    """A line of the legend, where a table has lower motions."""
    if len(with_lower_motion(table)):
        ax.plot([], [], "v", mfc="white", mec=LEGEND_COLOUR, ms=6, mew=1.4, label=LOWER)

"""Heat maps over two parameters: which method solved a point, how many iterations it took, how
large the answer is.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch as Swatch

from .style import COLOURS, FAILED_COLOUR, SEQUENTIAL_COLOURS, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_map(
    table: pd.DataFrame,
    x: str,
    y: str,
    value: str,
    file: str | Path | None = None,
    *,
    labels: tuple[str, str, str] | None = None,
    title: str = "",
) -> object:
    """A rectangle a point, coloured by a number or by a word; unconverged points are crossed;
    returns the figure.

    Args:
        table: one row a point of a grid, columns ``x``, ``y``, ``value``, optionally ``converged``.
        x, y: numeric columns.
        value: column to colour by; words get a legend, numbers a colour bar.
        file: PNG to write.
        labels: with units, for the two axes and the colour; the column names when left out.
        title: headline.
    """
    labels = labels or (x, y, value)
    words = not pd.api.types.is_numeric_dtype(table[value])
    codes, names = (
        pd.factorize(table[value], sort=True) if words else (table[value].to_numpy(float), ())
    )
    cells = table.assign(_code=codes).pivot_table(
        index=y, columns=x, values="_code", aggfunc="last"
    )
    columns = np.arange(len(cells.columns))
    rows = np.arange(len(cells.index))
    with canvas(file, None, (7.2, 4.6)) as ax:
        colours = matplotlib.colormaps[SEQUENTIAL_COLOURS]
        norm = None
        if words:
            colours = ListedColormap(word_colours(codes, len(names)))
        if words and len(names) > 1:
            norm = BoundaryNorm(np.arange(len(names) + 1) - 0.5, len(names))
        image = ax.pcolormesh(
            columns,
            rows,
            cells.to_numpy(float),
            cmap=colours,
            norm=norm,
            edgecolors="white",
            lw=0.3,
        )
        ax.grid(False)
        handles = [Swatch(color=colours(i), label=str(name)) for i, name in enumerate(names)]
        handles += cross_failed(ax, table, cells, x, y)
        if not words:
            ax.figure.colorbar(image, ax=ax, label=labels[2], aspect=25)
        label_ticks(ax.xaxis, cells.columns)
        label_ticks(ax.yaxis, cells.index)
        ax.set(xlabel=labels[0], ylabel=labels[1], title=title or labels[2])
        if handles:
            ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=4)
        return ax.figure


def word_colours(codes: np.ndarray, count: int) -> list[str]:
    """The commonest word in pale grey, so that the others stand out."""
    commonest = np.bincount(codes[codes >= 0], minlength=max(count, 1)).argmax()
    strong = iter(COLOURS * (count // len(COLOURS) + 1))
    return ["#dbe2e8" if i == commonest else next(strong) for i in range(count)]


def cross_failed(
    ax: Axes,
    table: pd.DataFrame,
    cells: pd.DataFrame,
    x: str,
    y: str,
) -> list[Any]:
    """Crosses on points without convergence; the legend entry for them."""
    if "converged" not in table or table["converged"].astype(bool).all():
        return []
    failed = table[~table["converged"].astype(bool)]
    place = cells.columns.get_indexer(failed[x]), cells.index.get_indexer(failed[y])
    ax.plot(*place, "x", color="white", ms=8, mew=3.2)
    return ax.plot(
        *place, "x", color=FAILED_COLOUR, ms=6, mew=1.6, label=f"not converged ({len(failed)})"
    )


def label_ticks(axis: Axes, values: pd.Index) -> None:
    """At most ten labels, the values themselves: the grid need not be even."""
    chosen = np.unique(np.linspace(0, len(values) - 1, min(len(values), 10)).astype(int))
    axis.set_ticks(chosen, [f"{values[i]:.4g}" for i in chosen])

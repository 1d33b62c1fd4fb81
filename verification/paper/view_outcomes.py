"""Where methods fail: a small map a method, over two planes of parameters, coloured by outcome and
iterations.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch as Swatch
from matplotlib.ticker import MaxNLocator

from bladefem.view.style import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOST = {"false": "#D55E00", "no convergence": "#222222", "diverged": "#CC79A7"}
SHADES = "Blues"
# of small maps
COLUMNS = 5


def draw_outcomes(
    table: pd.DataFrame,
    planes: dict[str, tuple[str, str, float]],
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """One small map a method and plane; returns the figure.

    Args:
        table: one row a point and method: load, stiffness, frequency, method, outcome, iterations,
            residual, as ``verification.paper.method_maps.method_map`` gives them, with a column
            "plane".
        planes: name of a plane to the column on its vertical axis, its label and the factor to its
            unit.
        file: PNG to write.
        title: headline.
    """
    methods = list(dict.fromkeys(table["method"]))
    rows = -(-len(methods) // COLUMNS)
    with canvas(
        file, None, (2.25 * COLUMNS, 2.2 * rows * len(planes) + 0.9), (rows * len(planes), COLUMNS)
    ) as axes:
        norm = LogNorm(1, max(float(table["iterations"].max()), 10.0))
        for p, (plane, (y, label, factor)) in enumerate(planes.items()):
            for k, ax in enumerate(axes[p * rows : (p + 1) * rows].ravel()):
                if k >= len(methods):
                    ax.axis("off")
                    continue
                part = table[(table["plane"] == plane) & (table["method"] == methods[k])]
                _draw(ax, part.assign(**{y: part[y] * factor}), y, norm)
                good = int((part["outcome"] == "converged").sum())
                false = int((part["outcome"] == "false").sum())
                ax.set_title(f"{methods[k]}\n{good} of {len(part)}, {false} false", fontsize=8.5)
                ax.set_ylabel(label if k % COLUMNS == 0 else "", fontsize=8.5)
                ax.set_xlabel("load [N]" if k >= len(methods) - COLUMNS else "", fontsize=8.5)
        figure = axes[0, 0].figure
        figure.colorbar(
            matplotlib.cm.ScalarMappable(norm, SHADES),
            ax=axes,
            label="iterations",
            aspect=40,
            shrink=0.6,
        )
        figure.legend(
            handles=[Swatch(color=colour, label=word) for word, colour in LOST.items()],
            ncols=3,
            loc="outside lower center",
        )
        if title:
            figure.suptitle(title, fontsize=11, fontweight="bold")
        return figure


def _draw(ax: Axes, part: pd.DataFrame, y: str, norm: LogNorm) -> None:
    """Cells shaded by iterations, or in the colour of their failure."""
    cells = part.pivot_table(index=y, columns="load", values="iterations", aggfunc="last")
    words = part.pivot(index=y, columns="load", values="outcome").to_numpy()
    colours = matplotlib.colormaps[SHADES](norm(np.maximum(cells.to_numpy(float), 1.0)))
    for word, colour in LOST.items():
        colours[words == word] = matplotlib.colors.to_rgba(colour)
    ax.imshow(colours, origin="lower", aspect="auto", interpolation="nearest")
    ax.grid(False)
    for axis, values in ((ax.xaxis, cells.columns), (ax.yaxis, cells.index)):
        ticks, places = _round_ticks(np.asarray(values, float))
        axis.set_ticks(places, [f"{tick:g}" for tick in ticks])
    ax.tick_params(labelsize=7)


def _round_ticks(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Round numbers within a grid, decades where it spans two of them, and where they fall among
    its cells.
    """
    cells = np.arange(len(values))
    if len(values) < 2 or values[0] <= 0 or values[-1] < 50 * values[0]:
        ticks = np.array(
            [
                t
                for t in MaxNLocator(4, steps=(1, 2, 5, 10)).tick_values(values[0], values[-1])
                if values[0] <= t <= values[-1]
            ]
        )
        return ticks, np.interp(ticks, values, cells)
    ticks = 10.0 ** np.arange(
        np.ceil(np.log10(values[0]) - 1e-9), np.floor(np.log10(values[-1]) + 1e-9) + 1
    )
    return ticks, np.interp(np.log(ticks), np.log(values), cells)

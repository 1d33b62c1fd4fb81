"""Hysteresis loops: friction force over relative displacement, of nodes and of whole seats."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from .style import COLOURS, MICRO, canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# columns of panels, the first of those that leave as few places empty
WIDTHS = (4, 5, 3)


def loop_energy(displacement: np.ndarray, force: np.ndarray) -> float:
    """Energy dissipated in one closed loop [J], the area enclosed by (displacement [m], force
    [N]).
    """
    return float(
        abs(0.5 * np.sum(displacement * np.roll(force, -1) - np.roll(displacement, -1) * force))
    )


def draw_loops(
    loops: Mapping[str, tuple[np.ndarray, np.ndarray]],
    file: str | Path | None = None,
    *,
    ax: Axes | None = None,
    title: str = "",
) -> object:
    """Friction force over relative displacement, one closed loop a name, with its energy; returns
    the figure.

    Args:
        loops: name -> (displacement (k,) [m], force (k,) [N]) over one period.
        file: PNG to write.
        ax: axes to draw into; the legend is then inside them.
        title: headline.
    """
    right_of_axes = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)}
    place = right_of_axes if ax is None else {"loc": "lower right", "fontsize": 7.5}
    with canvas(file, ax, (6.4, 4.4)) as ax:
        shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.92, max(len(loops), 1)))
        colours = COLOURS if len(loops) <= 6 else shades
        for (name, (x, force)), colour in zip(loops.items(), colours, strict=False):
            closed = np.append(np.arange(len(x)), 0)
            energy = 1e3 * loop_energy(x, force)
            # a stuck node's loop is a line
            energy *= energy > 1e-9 * np.ptp(x) * np.ptp(force)
            ax.plot(
                MICRO * np.asarray(x)[closed],
                np.asarray(force)[closed],
                color=colour,
                label=f"{name}: {energy:.3g} mJ a cycle",
            )
        ax.set(
            xlabel="relative displacement [µm]",
            ylabel="friction force [N]",
            title=title or "hysteresis loops",
        )
        ax.legend(**place)
        return ax.figure


def draw_seat_loops(
    cases: Mapping[str, Mapping[str, tuple[np.ndarray, np.ndarray]]],
    file: str | Path | None = None,
) -> object:
    """``draw_loops`` of all seats, a panel a load, each on its own scale; returns the figure.

    Args:
        cases: name of the load -> name of the seat -> (displacement (k,) [m], force (k,) [N]).
    """
    across = _columns_of(len(cases))
    down = -(-len(cases) // across)
    with canvas(
        file, None, (3.3 * across + 0.6, 2.9 * down + 0.3), (down, across), squeeze=False
    ) as axes:
        for number, (ax, (name, seats)) in enumerate(zip(axes.flat, cases.items(), strict=False)):
            draw_loops(seats, ax=ax, title=name)
            # the lowest panel of a column and the first of a row name the axes
            if number + across < len(cases):
                ax.set_xlabel("")
            if number % across:
                ax.set_ylabel("")
            low, high = ax.get_ylim()
            # room for the legend
            ax.set_ylim(low - 0.2 * (high - low), high)
        for ax in axes.flat[len(cases) :]:
            ax.set_axis_off()
        return axes[0, 0].figure


def _columns_of(panels: int) -> int:
    """Columns of so many panels."""
    if panels <= WIDTHS[0]:
        return panels
    return min(WIDTHS, key=lambda across: -panels % across)

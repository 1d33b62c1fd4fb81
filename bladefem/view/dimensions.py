"""Dimension lines and angles for drawings of parts; lengths in the units of the axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .style import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DIMENSION_COLOUR = COLOURS[0]
Point: TypeAlias = Sequence[float] | np.ndarray


def draw_outline(ax: Axes, corners: np.ndarray, colour: str = "#d5dbe1", **style: Any) -> None:
    """A filled outline, (n, 2) corners."""
    ax.fill(
        *np.asarray(corners).T,
        **{"facecolor": colour, "edgecolor": "#333333", "lw": 1.2, "zorder": 2, **style},
    )


def draw_length(
    ax: Axes,
    start: Point,
    end: Point,
    text: str,
    away: float = 0.0,
) -> None:
    """A dimension line from ``start`` to ``end``, moved to its left by ``away``, with the text on
    its outer side.

    Args:
        ax: axes of equal aspect.
        start, end: measured points.
        text: label.
        away: distance of the line from the measured points, to the left of the way from start to
            end.
    """
    first = np.asarray(start, float)
    last = np.asarray(end, float)
    way = (last - first) / np.linalg.norm(last - first)
    left = np.array([-way[1], way[0]])
    side = np.sign(away) or 1.0
    a = first + away * left
    b = last + away * left
    for point, moved in ((first, a), (last, b)):
        ax.plot(
            *np.stack([point, moved + 0.08 * (moved - point)]).T,
            color=DIMENSION_COLOUR,
            lw=0.6,
            alpha=0.7,
            zorder=3,
        )
    _draw_arrow(ax, a, b)
    turn = np.degrees(np.arctan2(way[1], way[0]))
    turn = turn - 180 if turn > 90 else turn + 180 if turn <= -90 else turn
    ax.annotate(
        text,
        (a + b) / 2,
        7 * side * left,
        textcoords="offset points",
        rotation=turn,
        rotation_mode="anchor",
        ha="center",
        va="center",
        color=DIMENSION_COLOUR,
        fontsize=8,
        zorder=5,
        bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.75},
    )


def _draw_arrow(ax: Axes, start: np.ndarray, end: np.ndarray) -> None:
    """A line with a head at both ends."""
    ax.annotate(
        "",
        start,
        end,
        arrowprops={
            "arrowstyle": "<|-|>",
            "color": DIMENSION_COLOUR,
            "lw": 0.9,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 8,
        },
        zorder=4,
    )


def draw_angle(
    ax: Axes,
    centre: Point,
    start: float,
    end: float,
    radius: float,
    text: str,
    rays: bool = True,
) -> None:
    """An arc between two directions [rad] with a label outside of its middle."""
    turn = np.linspace(start, end, 40)
    hub = np.asarray(centre, float)
    arc = hub + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ax.plot(*arc.T, color=DIMENSION_COLOUR, lw=1.0, zorder=4)
    if rays:
        for end_point in (arc[0], arc[-1]):
            ax.plot(
                *np.stack([hub, hub + 1.15 * (end_point - hub)]).T,
                color=DIMENSION_COLOUR,
                lw=0.7,
                ls="--",
                zorder=3,
            )
    middle = 0.5 * (start + end)
    ax.annotate(
        text,
        arc[len(arc) // 2],
        (10 * np.cos(middle), 10 * np.sin(middle)),
        textcoords="offset points",
        color=DIMENSION_COLOUR,
        fontsize=8,
        ha="left" if np.cos(middle) > 0.3 else "right" if np.cos(middle) < -0.3 else "center",
        va="center",
        zorder=5,
        bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.75},
    )


def draw_note(
    ax: Axes,
    point: Point,
    text: str,
    offset: tuple[float, float],
) -> None:
    """A label with a thin pointer to a point; the offset is in points."""
    ax.annotate(
        text,
        point,
        offset,
        textcoords="offset points",
        fontsize=8,
        color="#333333",
        ha="left" if offset[0] > 0 else "right" if offset[0] < 0 else "center",
        va="center",
        arrowprops={"arrowstyle": "-", "color": "#777777", "lw": 0.7},
        # readable across a line of the drawing
        bbox={"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75},
        zorder=6,
    )

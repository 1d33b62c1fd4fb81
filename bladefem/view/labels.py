"""Names next to points that cover neither one another nor the points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# offsets [points] and which end is held
LABEL_PLACES = (
    (6, 7, "left"),
    (6, -13, "left"),
    (-6, 7, "right"),
    (-6, -13, "right"),
    (9, 11, "left"),
    (9, -17, "left"),
    (-9, 11, "right"),
    (-9, -17, "right"),
    (11, -3, "left"),
)


# farther ones, with a line to the point: distances [points] and directions
FAR_DISTANCES = (22, 34, 46, 60, 76)
FAR_DIRECTIONS = 12


def names_apart(*axes: Any, keep: bool = False) -> None:
    """Give each annotation of finished axes a free place next to its point, first come first
    served, and an outline that keeps curves from striking it through.

    Args:
        axes: of one figure; it is laid out once for all of them, which is what takes time.
        keep: names without room get a place farther away, with a thin line to their point; else
            they are dropped.
    """
    axes[0].figure.draw_without_rendering()
    for ax in axes:
        _move_apart(ax, keep)


def _move_apart(ax: Axes, keep: bool) -> None:
    taken = [
        box
        for line in ax.lines
        if line.get_marker() not in ("None", "", None)
        for box in _marker_boxes(line)
    ]
    crowded = []
    for text in list(ax.texts):
        # an outline, not a box: that would cover the curves
        text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
        box = _first_free(ax, text, LABEL_PLACES, taken)
        if box is not None:
            taken.append(box)
        elif keep:
            crowded.append(text)
        else:
            text.remove()
    for text in crowded:
        box = _first_free(ax, text, _far_places(), taken)
        if box is None:
            text.remove()
            continue
        taken.append(box)
        _join_to_point(ax, text)


def _first_free(
    ax: Axes,
    text: Any,
    places: Sequence[tuple[float, float, str]],
    taken: list[Bbox],
) -> Bbox | None:
    """Move a name to the first place within the axes where nothing is; None without one."""
    inside = ax.get_window_extent()
    for x, y, side in places:
        text.xyann = (x, y)
        text.set_ha(side)
        box = text.get_window_extent()
        fits = (
            inside.x0 <= box.x0
            and box.x1 <= inside.x1
            and inside.y0 <= box.y0
            and box.y1 <= inside.y1 + 2
        )
        if fits and not box.count_overlaps(taken):
            return box
    return None


def _far_places() -> list[tuple[float, float, str]]:
    """Offsets all round, near ones first."""
    angles = 2 * np.pi * (np.arange(FAR_DIRECTIONS) + 0.5) / FAR_DIRECTIONS
    return [
        (d * np.cos(angle), d * np.sin(angle), "left" if np.cos(angle) > 0 else "right")
        for d in FAR_DISTANCES
        for angle in angles
    ]


def _join_to_point(ax: Axes, text: Any) -> None:
    """A thin line from a name to what it names."""
    ax.annotate(
        "",
        text.xy,
        text.xyann,
        textcoords="offset points",
        arrowprops={
            "arrowstyle": "-",
            "linewidth": 0.6,
            "color": text.get_color(),
            "shrinkA": 0,
            "shrinkB": 2,
        },
    )


def _marker_boxes(line: Any) -> list[Bbox]:
    """Positions of the markers of a line on the page [pixels]."""
    half = line.get_markersize() / 2 * line.figure.dpi / 72
    places = line.get_transform().transform(np.asarray(line.get_xydata(), float))
    return [Bbox([p - half, p + half]) for p in places if np.isfinite(p).all()]

"""Names next to points that cover neither one another nor the points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
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


def names_apart(*axes: Any) -> None:
    """Give each annotation of finished axes a free place next to its point, first come first
    served; drop the others.

    Args:
        axes: of one figure; it is laid out once for all of them, which is what takes time.
    """
    axes[0].figure.draw_without_rendering()
    for ax in axes:
        _move_apart(ax)


def _move_apart(ax: Axes) -> None:
    taken = [
        box
        for line in ax.lines
        if line.get_marker() not in ("None", "", None)
        for box in _marker_boxes(line)
    ]
    inside = ax.get_window_extent()
    for text in list(ax.texts):
        for x, y, side in LABEL_PLACES:
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
                taken.append(box)
                break
        else:
            text.remove()


def _marker_boxes(line: Any) -> list[Bbox]:
    """Positions of the markers of a line on the page [pixels]."""
    half = line.get_markersize() / 2 * line.figure.dpi / 72
    places = line.get_transform().transform(np.asarray(line.get_xydata(), float))
    return [Bbox([p - half, p + half]) for p in places if np.isfinite(p).all()]

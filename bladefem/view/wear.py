"""Friction work on the contact faces: where a period at the resonance wears them, and which nodes
stick.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.tri import Triangulation

from bladefem.data import Patch

from .contact import add_colourbar, arrangement, common_legend, label_outer, seat_name, unfold
from .skin import split_faces
from .style import COLOURS, SEAT_COLOURS, canvas, headline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STATE_MARKERS = {
    0: ("o", "separated"),
    1: ("s", "stuck"),
    2: ("^", "slips up to half of its contact time"),
    3: ("D", "slips longer"),
}


def draw_work(
    patches: Sequence[Patch],
    work: np.ndarray,
    state: np.ndarray,
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """Friction work a period and area on each face, unfolded, with the state of its nodes; returns
    the figure.

    Args:
        work: (nodes,) of all patches, one after the other [J/m^2].
        state: (nodes,) SEPARATED, STICK, PARTIAL_SLIP or GROSS_SLIP of friction.aft.
        file: PNG to write.
    """
    cuts = np.cumsum([len(p.area) for p in patches])[:-1]
    parts = list(zip(patches, np.split(work, cuts), np.split(state, cuts), strict=True))
    line = patches[0].faces.shape[1] == 2
    most = max(float(work.max(initial=0.0)), 1e-300)
    shape, size = arrangement(patches)
    stacked = shape[0] > 1
    with canvas(file, size=size, grid=shape, squeeze=False, sharex=stacked, sharey=True) as axes:
        for ax, (patch, w, s) in zip(axes.flat, parts, strict=True):
            (_draw_line if line else _draw_face)(ax, patch, w, s, most)
            total = 1e3 * float(w @ patch.area)
            ax.set_title(
                f"{seat_name(patch)}: {total:.3g} mJ a period", fontsize=9, fontweight="normal"
            )
        figure = axes[0, 0].figure
        if not line:
            add_colourbar(axes, most, SEAT_COLOURS, "friction work [J/m²]")
        label_outer(axes, line)
        common_legend(axes, ncols=2)
        headline(figure, title or "friction work of a period")
        return figure


def _draw_face(
    ax: Axes,
    patch: Patch,
    work: np.ndarray,
    state: np.ndarray,
    most: float,
) -> None:
    xy = 1e3 * unfold(patch)
    triangles = split_faces(patch.faces, patch.faces.shape[1]).reshape(-1, 3)
    ax.tripcolor(
        Triangulation(xy[:, 0], xy[:, 1], triangles),
        work,
        shading="gouraud",
        cmap=SEAT_COLOURS,
        vmin=0,
        vmax=most,
        rasterized=True,
    )
    for code, (mark, label) in STATE_MARKERS.items():
        if (state == code).any():
            ax.plot(
                *xy[state == code].T,
                mark,
                mfc="white",
                mec=COLOURS[code],
                ms=4,
                mew=1,
                ls="",
                label=label,
                clip_on=False,
            )
    ax.set(ylabel="outwards [mm]", aspect="equal")
    ax.grid(False)


def _draw_line(
    ax: Axes,
    patch: Patch,
    work: np.ndarray,
    state: np.ndarray,
    most: float,
) -> None:
    xy = 1e3 * unfold(patch)
    place = xy[:, np.argmax(np.ptp(xy, axis=0))]
    order = np.argsort(place)
    ax.plot(place[order], work[order], "-", color="#999999", lw=1)
    for code, (mark, label) in STATE_MARKERS.items():
        if (state == code).any():
            ax.plot(
                place[state == code],
                work[state == code],
                mark,
                color=COLOURS[code],
                ms=5,
                ls="",
                label=label,
            )
    ax.set(ylabel="friction work [J/m²]", ylim=(-0.03 * most, 1.08 * most))

"""Where a blade uses most of what its material lasts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.colors import Normalize

from geometry.mesh import Mesh

from .mesh import RADIAL_DIRECTION, edge_lines, polydata, view_of
from .modes import add_colour_bar
from .skin import skin
from .style import SEQUENTIAL_COLOURS, canvas, headline, photograph, show_photograph, size_for

PICTURE_PIXELS = (1100, 1200)


def draw_utilisation(
    mesh: Mesh,
    used: np.ndarray,
    title: str,
    file: str | Path | None = None,
) -> object:
    """The blade coloured by its utilisation; returns the figure.

    Args:
        used: (n_points,) alternating stress over the allowed one [1].
        title: above the picture.
    """
    blade = replace(mesh, bodies={n: cells for n, cells in mesh.bodies.items() if n != "damper"})
    surface = skin(blade)
    finite = np.nan_to_num(used, nan=0.0, posinf=0.0)
    highest = max(float(finite.max()), 1e-12)
    body = polydata(surface)
    body.point_data["utilisation"] = np.clip(used[surface.nodes], 0, highest)
    direction = view_of(blade)
    parts = [
        {"mesh": body, "scalars": "utilisation", "cmap": SEQUENTIAL_COLOURS, "clim": (0, highest)},
        {
            "mesh": edge_lines(surface, surface.points, direction),
            "color": "black",
            "line_width": 0.5,
            "opacity": 0.25,
            "lighting": False,
        },
    ]
    image = photograph(parts, direction, RADIAL_DIRECTION, PICTURE_PIXELS)
    with canvas(file, size=size_for(image, margin=1.6)) as ax:
        show_photograph(ax, image, direction, RADIAL_DIRECTION)
        headline(ax.figure, title)
        label = "alternating stress over the allowed one [1]"
        add_colour_bar(ax, Normalize(0, highest), SEQUENTIAL_COLOURS, label)
        return ax.figure

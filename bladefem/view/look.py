"""A mesh file at a glance: its faces in colours, numbered, from four sides, with a legend."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.look import AXES, Look

from .style import RENDER_OPTIONS, aim_camera, canvas, open_plotter, trim_border

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# from the object to the eye, in the frame of x radial, z along the engine
VIEW_DIRECTIONS = {
    "": (0.45, -0.75, 0.5),
    "from the other side": (0.45, 0.75, -0.5),
    "from below": (-0.5, -0.75, 0.45),
    "from below, the other side": (-0.5, 0.75, -0.45),
}
COLOURS = (
    "#8fb8de", "#e3a587", "#a9d18e", "#f2d16b", "#b9a3d6", "#7fc7bf",
    "#d98fb0", "#c2b280", "#9aa5b1", "#e08a8a", "#8ecae6", "#b5d99c",
)  # fmt: skip
# faces in the legend and with a number on the picture
MAX_NUMBERED_FACES = 24
# of the model's size, so that a number floats over its face
LABEL_OFFSET_SHARE = 0.01


def draw_look(look: Look, file: str | Path) -> None:
    """Write the picture."""
    images = {title: _photograph_side(look, side) for title, side in VIEW_DIRECTIONS.items()}
    widths = [image.shape[1] / image.shape[0] for image in images.values()]
    # the legend is as wide as its words, the pictures share the rest
    share = 0.3 * sum(widths)
    with canvas(file, size=(15.0, 5.6), grid=(1, 5), width_ratios=(*widths, share)) as axes:
        for ax, (title, image) in zip(axes, images.items(), strict=False):
            ax.imshow(image, interpolation="lanczos")
            ax.set_axis_off()
            ax.set_title(title or look.file.name, fontsize=10)
        _draw_legend(axes[4], look)


def _photograph_side(look: Look, side: tuple[float, float, float]) -> np.ndarray:
    """(rows, columns, 3) the faces from one side."""
    import pyvista

    frame = _model_axes(look)
    points = look.raw.points @ frame.T
    plotter = open_plotter((1300, 1150))
    for i, face in enumerate(look.faces):
        corners = look.outside.corners[look.outside.number == i]
        triangles = corners[:, 3] < 0
        rows = [np.insert(corners[triangles][:, :3], 0, 3, axis=1).ravel()]
        rows.append(np.insert(corners[~triangles], 0, 4, axis=1).ravel())
        surface = pyvista.PolyData(points, np.concatenate(rows)).clean()
        plotter.add_mesh(
            surface,
            color=COLOURS[i % len(COLOURS)],
            show_edges=len(look.outside.corners) < 4000,
            edge_color="#55606a",
            line_width=0.6,
            name=face.name,
            **{**RENDER_OPTIONS, "ambient": 0.45, "diffuse": 0.6},
        )
    _number_faces(plotter, look, frame, np.asarray(side))
    used = np.unique(look.outside.corners[look.outside.corners >= 0])
    aim_camera(plotter, side, (1.0, 0.0, 0.0), points[used])
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    return trim_border(image)


def _model_axes(look: Look) -> np.ndarray:
    """(3, 3) rows: radial through the model's middle, across, along the engine's axis."""
    z = np.array(AXES[look.cut.axis if look.cut else "z"])
    middle = look.box.mean(axis=0)
    radial = middle - (middle @ z) * z
    if np.linalg.norm(radial) < 0.05 * np.ptp(look.box, axis=0).max():
        radial = np.linalg.svd(z[None])[2][1]
    radial = radial / np.linalg.norm(radial)
    return np.stack([radial, np.cross(z, radial), z])


def _number_faces(
    plotter: Any,
    look: Look,
    frame: np.ndarray,
    side: np.ndarray,
) -> None:
    """The number of each large face on a facet of it that looks at the eye."""
    eye = side / np.linalg.norm(side)
    lift = LABEL_OFFSET_SHARE * np.ptp(look.box, axis=0).max()
    places = []
    numbers = []
    for i, face in enumerate(look.faces[:MAX_NUMBERED_FACES]):
        mine = np.flatnonzero(look.outside.number == i)
        normals = look.outside.normals[mine] @ frame.T
        towards = mine[normals @ eye > 0.1 * np.linalg.norm(normals, axis=1)]
        if not len(towards):
            continue
        middle = np.linalg.norm(look.outside.centres[towards] - face.centre, axis=1).argmin()
        places.append(look.outside.centres[towards[middle]] @ frame.T + lift * eye)
        numbers.append(face.name.removeprefix("outer_").removeprefix("face_"))
    if places:
        plotter.add_point_labels(
            np.array(places),
            numbers,
            font_size=26,
            bold=True,
            shape_color="white",
            shape_opacity=0.75,
            show_points=False,
            margin=2,
        )


def _draw_legend(ax: Axes, look: Look) -> None:
    """Number, what is guessed, area of the largest faces."""
    ax.set_axis_off()
    said = _face_roles(look)
    total = sum(face.area for face in look.faces)
    shown = look.faces[:MAX_NUMBERED_FACES]
    step = 1.0 / (max(len(shown), 8) + 2)
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    ax.text(0.0, 1 - 0.6 * step, "face, share of the surface, guess", weight="bold", va="center")
    for i, face in enumerate(shown):
        y = 1 - (i + 1.6) * step
        ax.scatter([0.03], [y], s=90, marker="s", color=COLOURS[i % len(COLOURS)])
        words = f"{face.name}   {100 * face.area / total:.1f} %   {said.get(face.name, '')}"
        ax.text(0.09, y, words, va="center", fontsize=9)
    if len(look.faces) > MAX_NUMBERED_FACES:
        ax.text(
            0.0, 0.2 * step, f"and {len(look.faces) - MAX_NUMBERED_FACES} smaller ones", fontsize=9
        )


def _face_roles(look: Look) -> dict[str, str]:
    """Face name -> what it looks like."""
    said = dict.fromkeys(look.cut.low, "cut face") if look.cut else {}
    said |= dict.fromkeys(look.cut.high, "cut face, next") if look.cut else {}
    return said | dict.fromkeys(look.bore, "nearest to the axis")

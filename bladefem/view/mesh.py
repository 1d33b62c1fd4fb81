"""Meshes as pictures and as VTU files for ParaView."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Patch as Swatch

from bladefem.errors import InputError
from geometry.mesh import Mesh
from geometry.topology import CORNERS

from .skin import Skin, family, sector_motion, skin, wheel_count, wheel_skin
from .style import canvas, headline, photograph, show_photograph

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pyvista import PolyData, UnstructuredGrid

VTK_NUMBERS = {
    "triangle": 5,
    "triangle6": 22,
    "quad": 9,
    "quad8": 23,
    "quad9": 28,
    "tetra": 10,
    "tetra10": 24,
    "hexahedron": 12,
    "hexahedron20": 25,
    "hexahedron27": 29,
}
# gmsh's node order to VTK's, where they differ.
VTK_ORDER = {
    "tetra10": (0, 1, 2, 3, 4, 5, 6, 7, 9, 8),
    "hexahedron20": (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15),
    "hexahedron27": (
        0,
        1,
        2,
        3,
        4,
        5,
        6,
        7,
        8,
        11,
        13,
        9,
        16,
        18,
        19,
        17,
        10,
        12,
        14,
        15,
        22,
        23,
        21,
        24,
        20,
        25,
        26,
    ),
}
BODY_COLOURS = ("#c9d1d9", "#e3cfa4", "#b7cfc0", "#d5c3d8")
FACE_COLOURS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#7a5195",
    "#b5bd00",
    "#8c564b",
    "#17a2a2",
    "#c23b5a",
)
# The large faces of a blade in pale shades, so that the small ones that matter stand out.
PALE_FACE_COLOURS = {
    "pressure_side": "#a9d3cf",
    "suction_side": "#c4bedd",
    "trailing_edge": "#8d9aa5",
    "tip": "#e8d66c",
}
# of the height of a drawn damper, by which it is moved inwards
DAMPER_SHIFT = 0.07
FRONT_VIEW = (0.35, -0.85, 0.62)
VIEW_FROM_BELOW = (-0.45, 0.8, 0.65)
RADIAL_DIRECTION = (1.0, 0.0, 0.0)


def pyvista_grid(
    mesh: Mesh,
    fields: dict[str, np.ndarray] | None = None,
    inside: dict[str, np.ndarray] | None = None,
) -> UnstructuredGrid:
    """The whole mesh for pyvista, nodes in VTK's order, with the body's number on each cell.

    Args:
        mesh: plane or solid.
        fields: name with unit -> (n_points, ...) values at the nodes; complex ones become two
            fields.
        inside: name with unit -> (nc, ...) values in the cells of all bodies, in their order.
    """
    import pyvista

    cells = np.concatenate(list(mesh.bodies.values()))[:, list(vtk_order(mesh))]
    kinds = np.full(len(cells), VTK_NUMBERS[mesh.cell_type], dtype=np.uint8)
    table = np.insert(cells, 0, cells.shape[1], axis=1).ravel()
    result = pyvista.UnstructuredGrid(table, kinds, np.asarray(mesh.points, dtype=float))
    result.cell_data["body"] = np.repeat(
        np.arange(len(mesh.bodies)), [len(c) for c in mesh.bodies.values()]
    )
    for name, values in split_complex(fields or {}).items():
        result.point_data[name] = values
    for name, values in (inside or {}).items():
        result.cell_data[name] = values
    return result


def vtk_order(mesh: Mesh) -> tuple[int, ...]:
    """Columns of a gmsh cell in VTK's order."""
    cells = next(iter(mesh.bodies.values()))
    return VTK_ORDER.get(mesh.cell_type, tuple(range(cells.shape[1])))


def split_complex(fields: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """VTK knows no complex numbers: "u [m]" becomes "u, real [m]" and "u, imaginary [m]"."""
    parts: dict[str, np.ndarray] = {}
    for name, values in fields.items():
        if np.iscomplexobj(values):
            what, bracket, unit = name.partition(" [")
            parts[f"{what}, real{bracket}{unit}"] = values.real.copy()
            parts[f"{what}, imaginary{bracket}{unit}"] = values.imag.copy()
        else:
            parts[name] = np.ascontiguousarray(values)
    return parts


def save_vtu(
    mesh: Mesh,
    file: str | Path,
    fields: dict[str, np.ndarray] | None = None,
    inside: dict[str, np.ndarray] | None = None,
) -> Path:
    """Write the mesh and its fields, see ``pyvista_grid``, as a compressed VTU file."""
    return write_vtu(pyvista_grid(mesh, fields, inside), file)


def write_vtu(grid: UnstructuredGrid, file: str | Path) -> Path:
    """Write what pyvista holds: compressed numbers as they are, which takes a third less time and a
    quarter less room than pyvista's own text.

    LZ4 would be quicker (0.02 in place of 0.25 s for ten shapes of a wheel of 30 000 points), but
    meshio does not read it.
    """
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    Path(file).parent.mkdir(parents=True, exist_ok=True)
    writer = vtkXMLUnstructuredGridWriter()
    # the name as the system has it: VTK would write it in UTF-8 whatever the locale
    writer.SetFileName(os.fsencode(file))
    writer.SetInputData(grid)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetCompressionLevel(1)
    if not writer.Write():
        raise InputError(f"{file}: cannot be written (VTK; is the disk full?)")
    return Path(file)


def save_wheel_vtu(
    mesh: Mesh,
    file: str | Path,
    fields: dict[str, np.ndarray],
    nodal_diameter: int = 0,
    volume: bool = False,
) -> Path:
    """Write the full wheel with vector fields carried round by e^{j n theta} R.

    Args:
        mesh: one sector.
        file: to write, ``.vtu``.
        fields: name -> (n_points, 3) real or complex, or (n_points,).
        nodal_diameter: n of the fields.
        volume: all cells, without mid-side nodes; otherwise the outer triangles only, a much
            smaller file.
    """
    import pyvista

    count = wheel_count(mesh)
    if volume:
        result = volume_wheel(mesh, count)
        nodes = np.arange(len(mesh.points))
    else:
        wheel = wheel_skin(mesh)
        result = polydata(wheel).cast_to_unstructured_grid()
        nodes = wheel.nodes[: len(wheel.nodes) // count]
    around = {
        name: carry_round(mesh, values[nodes], nodal_diameter) for name, values in fields.items()
    }
    for name, values in split_complex(around).items():
        result.point_data[name] = values.astype(np.float32)
    grid = pyvista.UnstructuredGrid(result)
    return write_vtu(grid.clean(tolerance=0.0) if volume else grid, file)


def volume_wheel(mesh: Mesh, count: int) -> UnstructuredGrid:
    """All cells of all sectors, first order."""
    import pyvista

    shape = family(mesh.cell_type)
    cells = np.concatenate(list(mesh.bodies.values()))[:, : CORNERS[shape]]
    cells = (cells + (np.arange(count) * len(mesh.points))[:, None, None]).reshape(
        -1, CORNERS[shape]
    )
    motions = [sector_motion(mesh, k) for k in range(count)]
    points = np.concatenate([mesh.points @ rotation.T + shift for rotation, shift in motions])
    kinds = np.full(len(cells), VTK_NUMBERS[shape], dtype=np.uint8)
    return pyvista.UnstructuredGrid(
        np.insert(cells, 0, cells.shape[1], axis=1).ravel(), kinds, points
    )


def carry_round(
    mesh: Mesh,
    values: np.ndarray,
    nodal_diameter: int,
) -> np.ndarray:
    """(count * n, ...) a field on every sector: e^{j n theta k} R^k u, R acting on vectors only.

    A real field of nodal diameter 0 stays real; so does N/2.
    """
    count = wheel_count(mesh)
    angle = 2 * np.pi * nodal_diameter / (mesh.sector.count or count) if mesh.sector else 0.0
    copies = []
    for k in range(count):
        turned = values @ sector_motion(mesh, k)[0].T if values.ndim == 2 else values
        phase = np.exp(1j * angle * k)
        copies.append(turned * (phase.real if abs(phase.imag) < 1e-12 else phase))
    return np.concatenate(copies)


def polydata(
    surface: Skin,
    points: np.ndarray | None = None,
    label: int | None = None,
) -> PolyData:
    """Triangles for pyvista; only those of one label when given."""
    import pyvista

    triangles = surface.triangles if label is None else surface.triangles[surface.labels == label]
    return pyvista.PolyData(
        surface.points if points is None else points, np.insert(triangles, 0, 3, axis=1).ravel()
    )


def edge_lines(
    surface: Skin,
    points: np.ndarray,
    direction: tuple[float, float, float],
) -> PolyData:
    """Element edges, drawn a hair nearer to the eye than the faces so that they are not
    swallowed.
    """
    import pyvista

    eye = np.asarray(direction) / np.linalg.norm(direction)
    lift = 1.5e-3 * np.linalg.norm(np.ptp(points, axis=0))
    return pyvista.PolyData(
        points + lift * eye, lines=np.insert(surface.edges, 0, 2, axis=1).ravel()
    )


def boundary_lines(mesh: Mesh, face: np.ndarray) -> PolyData:
    """A named edge of a plane mesh, lifted over the cells."""
    import pyvista

    ends = face[:, :2] if face.shape[1] < 3 else np.concatenate([face[:, [0, 2]], face[:, [2, 1]]])
    lift = np.array([0.0, 0.0, 3e-3 * np.linalg.norm(np.ptp(mesh.points, axis=0))])
    return pyvista.PolyData(mesh.points + lift, lines=np.insert(ends, 0, 2, axis=1).ravel())


def is_numbered(name: str) -> bool:
    """Whether a face has the number of a drawing in place of a name."""
    return re.fullmatch(r"face_\d+", name) is not None


def label_colours(mesh: Mesh) -> list[str]:
    """Light colours for bodies, strong ones for named faces; numbered faces are like the first
    body.
    """
    bodies = [BODY_COLOURS[i % len(BODY_COLOURS)] for i in range(len(mesh.bodies))]
    strong = cycle(FACE_COLOURS)

    def colour(name: str) -> str:
        if is_numbered(name):
            return BODY_COLOURS[0]
        return PALE_FACE_COLOURS.get(name) or next(strong)

    return bodies + [colour(name) for name in mesh.faces]


def view_of(
    mesh: Mesh, direction: tuple[float, float, float] = FRONT_VIEW
) -> tuple[float, float, float]:
    """Plane meshes are seen along their normal (x upwards, y to the left as the wheel turns)."""
    return (0.0, 0.0, 1.0) if mesh.dimension == 2 else direction


def photograph_mesh(
    mesh: Mesh,
    direction: tuple[float, float, float],
) -> np.ndarray:
    """One view of the skin, a colour a body and a named face."""
    surface = skin(mesh)
    parts = [
        {"mesh": polydata(surface, label=i), "color": colour}
        for i, colour in enumerate(label_colours(mesh))
        if np.any(surface.labels == i)
    ]
    if mesh.dimension == 2:
        parts += [
            {
                "mesh": boundary_lines(mesh, face),
                "color": colour,
                "line_width": 6,
                "lighting": False,
            }
            for face, colour in zip(
                mesh.faces.values(), label_colours(mesh)[len(mesh.bodies) :], strict=True
            )
        ]
    parts.append(
        {
            "mesh": edge_lines(surface, surface.points, direction),
            "color": "#30363d",
            "line_width": 0.6,
            "lighting": False,
            "opacity": 0.6,
        }
    )
    return photograph(parts, direction, RADIAL_DIRECTION)


def damper_pulled_inwards(mesh: Mesh) -> Mesh:
    """The mesh with the damper moved inwards by a share of the height, so that the contact
    faces can be seen.
    """
    nodes = [cells.ravel() for name, cells in mesh.bodies.items() if name.startswith("damper")]
    points = np.array(mesh.points, dtype=float)
    if nodes:
        points[np.unique(np.concatenate(nodes)), 0] -= DAMPER_SHIFT * np.ptp(points[:, 0])
    return replace(mesh, points=points)


def draw_mesh(
    mesh: Mesh,
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """Bodies and named faces in colour, as built and with the damper pulled away; returns the
    figure.
    """
    views = (view_of(mesh),) if mesh.dimension == 2 else (FRONT_VIEW, VIEW_FROM_BELOW)
    apart = damper_pulled_inwards(mesh)
    shown = (apart,) if mesh.dimension == 2 else (mesh, apart)
    with canvas(
        file,
        size=(2.4 + 3.4 * len(views), 5.6),
        grid=(1, len(views) + 1),
        width_ratios=[1] * len(views) + [0.6],
    ) as axes:
        for ax, one, direction in zip(axes, shown, views, strict=False):
            show_photograph(ax, photograph_mesh(one, direction), direction, RADIAL_DIRECTION)
            if one is apart and "damper" in mesh.bodies:
                ax.set_title(
                    "damper drawn away from its seats",
                    fontsize=8.5,
                    fontweight="normal",
                    loc="center",
                )
        headline(axes[0].figure, title or f"mesh of {' and '.join(mesh.bodies)}")
        draw_legend(axes[-1], mesh)
        return axes[0].figure


# names next to a picture in ordinary size; CAD files have more
MAX_NAMES_IN_LEGEND = 20


def draw_legend(ax: Axes, mesh: Mesh) -> None:
    """Names and sizes next to the picture."""
    colours = label_colours(mesh)
    counts = [len(c) for c in (*mesh.bodies.values(), *mesh.faces.values())]
    names = (*mesh.bodies, *mesh.faces)
    swatches = [
        Swatch(facecolor=c, edgecolor="#555555", lw=0.5, label=f"{name} ({count})")
        for c, name, count in zip(colours, names, counts, strict=True)
        if not is_numbered(name)
    ]
    many = len(swatches) > MAX_NAMES_IN_LEGEND
    ax.legend(
        handles=swatches,
        loc="center left",
        bbox_to_anchor=(0.0, 0.57),
        fontsize=6 if many else 8.5,
        labelspacing=0.25 if many else 0.5,
        title="body or face (elements)",
        alignment="left",
        borderaxespad=0.0,
    )
    cells = sum(len(c) for c in mesh.bodies.values())
    ax.text(
        0.02,
        0.02,
        f"{cells} {mesh.cell_type} cells\n{len(mesh.points)} nodes\n"
        f"{mesh.dimension * len(mesh.points)} degrees of freedom",
        transform=ax.transAxes,
        fontsize=8.5,
    )
    ax.set_axis_off()

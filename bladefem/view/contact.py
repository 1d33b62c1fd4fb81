"""Contact pressure: both faces unfolded onto the paper with one colour scale, and the same numbers
as tables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.tri import Triangulation

from bladefem.contact.resultants import resultant
from bladefem.data import Patch, PressureMap

from ..scene.units import newtons
from .mesh import write_vtu
from .skin import split_faces
from .style import COLOURS, SEAT_COLOURS, canvas, headline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# faces that nothing presses
OPEN_FACE_COLOUR = "#e6e6e6"
# corners of a face: VTK's number for line, triangle, quadrilateral
VTK_FACES = {2: 3, 3: 5, 4: 9}


def pressure_summary(seats: Sequence[PressureMap]) -> pd.DataFrame:
    """One row a patch: resultant, peak and mean pressure, pressed share of the area, contact
    centre, moment, proof.

    Force (vector) and moment about the engine's origin are those on the damper, in the blade's axes
    [N, N m].
    """
    rows = []
    for seat in seats:
        pressed = seat.force > 1e-9 * max(seat.force.max(initial=0.0), 1e-300)
        area = float(seat.patch.area[pressed].sum())
        total = resultant(seat)
        (x, y, z), (fx, fy, fz), moment = total.centre, total.force, total.moment
        rows.append(
            {
                "patch": seat.patch.seat,
                "nodes": len(seat.force),
                "force": float(seat.force.sum()),
                "peak_pressure": float(seat.pressure.max(initial=0.0)),
                "mean_pressure": float(seat.force.sum()) / area if area > 0 else 0.0,
                "area": float(seat.patch.area.sum()),
                "contact_share": area / float(seat.patch.area.sum()),
                "centre_x": x,
                "centre_y": y,
                "centre_z": z,
                "force_x": fx,
                "force_y": fy,
                "force_z": fz,
                "moment_x": moment[0],
                "moment_y": moment[1],
                "moment_z": moment[2],
                "complementarity": seat.complementarity,
            }
        )
    return pd.DataFrame(rows)


def pressure_points(seats: Sequence[PressureMap]) -> pd.DataFrame:
    """One row a contact node: patch, position, area, force, pressure, gap (SI)."""
    frames = [
        pd.DataFrame(
            {
                "patch": seat.patch.seat,
                "x": seat.patch.points[:, 0],
                "y": seat.patch.points[:, 1],
                "z": seat.patch.points[:, 2],
                "area": seat.patch.area,
                "force": seat.force,
                "pressure": seat.pressure,
                "gap": seat.gap,
            }
        )
        for seat in seats
    ]
    return pd.concat(frames, ignore_index=True)


def save_pressure_vtu(states: Mapping[float, Sequence[PressureMap]], file: str | Path) -> Path:
    """Write all faces with pressure, gap and normal force of each load [N] at their nodes as a VTU
    file for ParaView.

    Args:
        states: mean normal load to the maps of the same patches.
        file: to write, ``.vtu``.
    """
    fields = {}
    for load, seats in states.items():
        for name, values in (
            ("pressure [Pa]", "pressure"),
            ("gap [m]", "gap"),
            ("normal force [N]", "force"),
        ):
            fields[f"{name} at {newtons(load)}"] = np.concatenate(
                [getattr(seat, values) for seat in seats]
            )
    return save_faces_vtu([seat.patch for seat in next(iter(states.values()))], fields, file)


def save_faces_vtu(
    patches: Sequence[Patch],
    fields: Mapping[str, np.ndarray],
    file: str | Path,
) -> Path:
    """Write fields (nodes of all patches,) on the faces, with areas and normals, as a VTU file for
    ParaView.
    """
    import pyvista

    first = np.cumsum([0, *(len(p.area) for p in patches)])
    cells = np.concatenate([p.faces + start for p, start in zip(patches, first[:-1], strict=True)])
    kinds = np.full(len(cells), VTK_FACES[cells.shape[1]], dtype=np.uint8)
    table = np.insert(cells, 0, cells.shape[1], axis=1).ravel()
    grid = pyvista.UnstructuredGrid(
        table, kinds, np.concatenate([p.points for p in patches]).astype(float)
    )
    grid.point_data["area [m^2]"] = np.concatenate([p.area for p in patches])
    grid.point_data["normal"] = np.concatenate([p.frame[:, 0] for p in patches])
    for name, values in fields.items():
        grid.point_data[name] = np.asarray(values)
    return write_vtu(grid, file)


def unfold(patch: Patch, points: np.ndarray | None = None) -> np.ndarray:
    """(n, 2) coordinates in the patch's mean plane [m]: along the engine axis, and outwards along
    the slope.
    """
    normal = patch.frame[:, 0].mean(axis=0)
    normal = normal / np.linalg.norm(normal)
    along = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    if np.linalg.norm(along) < 0.1:
        along = patch.frame[0, 1]
    along = along / np.linalg.norm(along)
    across = np.cross(normal, along)
    across = across * (1.0 if across[0] >= 0 else -1.0)
    offset = (patch.points if points is None else points) - patch.points.mean(axis=0)
    return np.stack([offset @ along, offset @ across], axis=-1)


def draw_pressure(
    seats: Sequence[PressureMap],
    file: str | Path | None = None,
    *,
    title: str = "",
) -> object:
    """The pressure on each face, unfolded, with a common colour scale; a curve for plane models;
    returns the figure.

    Args:
        seats: the pressure maps, usually "this" and "next".
        file: PNG to write.
        title: headline.
    """
    peak = max([float(seat.pressure.max(initial=0.0)) for seat in seats] + [1e-6]) / 1e6
    line = seats[0].patch.faces.shape[1] == 2
    shape, size = arrangement([seat.patch for seat in seats])
    stacked = shape[0] > 1
    with canvas(file, size=size, grid=shape, squeeze=False, sharex=stacked, sharey=True) as axes:
        for ax, seat in zip(axes.flat, seats, strict=True):
            (draw_line if line else draw_face)(ax, seat, peak)
            ax.set_title(caption(seat, ", " if stacked else ",\n"), fontsize=9, fontweight="normal")
        figure = axes[0, 0].figure
        if not line:
            add_colourbar(axes, peak, SEAT_COLOURS, "contact pressure [MPa]")
        label_outer(axes, line)
        common_legend(axes, ncols=3)
        headline(figure, title or "contact pressure" + ("" if line else ", faces unfolded"))
        return figure


def add_colourbar(axes: np.ndarray, largest: float, colours: str, label: str) -> None:
    """One colour bar from 0 to the largest value, for all faces."""
    axes.flat[0].figure.colorbar(
        ScalarMappable(Normalize(0, largest), colours),
        ax=list(axes.flat),
        aspect=25,
        pad=0.02,
        label=label,
    )


def common_legend(axes: np.ndarray, ncols: int) -> None:
    """One legend below all axes, with entries that only one of them has as well."""
    entries = {
        label: handle
        for ax in axes.flat
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    axes[0, 0].figure.legend(
        entries.values(), entries.keys(), loc="outside lower center", ncols=ncols
    )


def label_outer(axes: np.ndarray, line: bool) -> None:
    """Directions named on the outer axes (rows, columns) only."""
    for ax in axes[-1]:
        ax.set_xlabel("along the face [mm]" if line else "along the engine axis [mm]")
    for ax in axes[:, 1:].flat:
        ax.set_ylabel("")


def arrangement(patches: Sequence[Patch]) -> tuple[tuple[int, int], tuple[float, float]]:
    """Rows and columns of a picture of faces, and its size [inch]: long faces one below the other,
    others abreast.
    """
    width, height = np.ptp(unfold(patches[0]), axis=0)
    count = len(patches)
    line = patches[0].faces.shape[1] == 2
    if line or width <= 1.3 * height:
        return (1, count), (4.0 * count + 0.8, 4.2)
    return (count, 1), (7.4, 1.1 + count * (0.75 + 5.4 * height / width))


def seat_name(patch: Patch) -> str:
    """What an engineer calls the seat of a patch."""
    names = {"right": "right seat", "left": "left seat of the next blade"}
    return names.get(patch.seat, f'seat "{patch.name}"')


def caption(seat: PressureMap, between: str = ",\n") -> str:
    """Resultant, peak and pressed share of one face."""
    row = pressure_summary([seat]).iloc[0]
    return (
        f"{seat_name(seat.patch)}: {newtons(row.force, 4)}, peak {row.peak_pressure / 1e6:.3g} "
        f"MPa{between}{100 * row.contact_share:.0f} % of {1e6 * row.area:.3g} mm² pressed"
    )


def draw_face(
    ax: Axes,
    seat: PressureMap,
    peak: float,
) -> None:
    """One face in its plane: pressure in colour, nodes as dots, peak and centre marked."""
    xy = 1e3 * unfold(seat.patch)
    pressure = seat.pressure / 1e6
    colour_pressure(ax, xy, seat, Normalize(0, peak))
    open_nodes = seat.force <= 0
    ax.plot(*xy[~open_nodes].T, ".", color="#ffffff", ms=1.5, alpha=0.5)
    if open_nodes.any():
        ax.plot(
            *xy[open_nodes].T, "o", mfc="none", mec="#888888", ms=2.5, mew=0.5, label="open node"
        )
    centre = 1e3 * unfold(seat.patch, resultant(seat).centre[None])[0]
    ax.plot(
        *xy[np.argmax(pressure)], "^", mfc="white", mec="black", ms=7, label="peak", clip_on=False
    )
    ax.plot(*centre, "P", mfc=COLOURS[5], mec="black", ms=8, label="centre of the force")
    ax.set(ylabel="outwards [mm]", aspect="equal")
    ax.grid(False)


def colour_pressure(
    ax: Axes,
    xy: np.ndarray,
    seat: PressureMap,
    norm: Normalize,
) -> bool:
    """Pressure [MPa] in colour over xy (n, 2); grey where no corner of a face is pressed, which is
    returned.
    """
    triangles = split_faces(seat.patch.faces, seat.patch.faces.shape[1]).reshape(-1, 3)
    closed = (seat.force[triangles] > 0).any(axis=1)
    flat = Triangulation(*xy.T, triangles)
    ax.tripcolor(
        flat, np.zeros(len(triangles)), cmap=ListedColormap([OPEN_FACE_COLOUR]), rasterized=True
    )
    if closed.any():
        flat.set_mask(~closed)
        ax.tripcolor(
            flat,
            seat.pressure / 1e6,
            shading="gouraud",
            cmap=SEAT_COLOURS,
            norm=norm,
            rasterized=True,
        )
    return not closed.all()


def draw_line(
    ax: Axes,
    seat: PressureMap,
    peak: float,
) -> None:
    """The face of a plane model: pressure over arc length."""
    xy = 1e3 * unfold(seat.patch)
    # The face of a plane model lies along t1 or the slope, whichever is the longer in the picture.
    place = xy[:, np.argmax(np.ptp(xy, axis=0))]
    order = np.argsort(place)
    ax.fill_between(place[order], seat.pressure[order] / 1e6, color=COLOURS[0], alpha=0.2)
    ax.plot(place[order], seat.pressure[order] / 1e6, "o-", color=COLOURS[0], ms=3)
    ax.axvline(
        np.average(place, weights=np.maximum(seat.force, 1e-300)),
        color=COLOURS[1],
        ls="--",
        lw=1,
        label="centre of the force",
    )
    ax.set(ylabel="contact pressure [MPa]", ylim=(0, 1.08 * peak))

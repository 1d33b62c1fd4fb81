"""Plane blades with flat dampers under their platforms, in the plane x (radial), y
(circumferential).
"""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.limits import unless_at_most
from bladefem.scene.units import show

from .draw import draw_polygon, tie_meshes
from .extract_arrays import Groups
from .finalise_mesh import complete_mesh, mesh_model
from .matching import FaceMotion
from .mesh import Mesh, Sector
from .parameters import MeshSize, Plane
from .session import gmsh_session, gmsh_step
from .size_fields import threshold_field

# on each seat: half of it lifts off, and with 10 a resonance between stick and slip is 30 % low
SEAT_ELEMENTS = 40


def plane_blades(plane: Plane, size: MeshSize) -> Mesh:
    """Bodies "blade" and "damper" of triangles; the damper bridges this blade's right and the next
    one's left platform.

    Faces (edges): clamp, tip, seat_left, seat_right, damper_left, damper_right, pressure_side (y <
    0), suction_side. Node sets: tip_leading (y < 0), tip_mid, tip_trailing (y > 0).

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    check_plane(plane)
    base = size.size or min(
        plane.thickness / 2, plane.platform_thickness / 3, plane.damper_height / 2
    )
    contact = size.contact_size or min(base, plane.seat_width / SEAT_ELEMENTS)
    motions = plane_motions(plane)
    with gmsh_session() as gmsh:
        groups = _draw_plane(gmsh, plane)
        for motion in motions.values():
            tie_meshes(gmsh, 1, groups.faces, motion)
        _set_sizes(gmsh, groups, base, contact)
        with gmsh_step("mesh.size", "mesh this geometry"):
            mesh = mesh_model(gmsh, groups, 2, size)
    sector = Sector(0, np.eye(3), np.array([0.0, plane.pitch, 0.0]))
    return replace(complete_mesh(mesh, motions, size.scale * base, sector), depth=plane.depth)


def check_plane(plane: Plane) -> None:
    """Refuse proportions that overlap.

    Raises:
        InputError: the first rule that is broken.
    """
    rules = [
        ("platform_width", plane.platform_width, "pitch", plane.pitch, "smaller than"),
        ("thickness", plane.thickness, "platform_width", plane.platform_width, "smaller than"),
        (
            "damper_height",
            plane.damper_height,
            "platform_height",
            plane.platform_height,
            "smaller than",
        ),
    ]
    for name, value, other, limit, words in rules:
        if not value < limit:
            raise InputError(
                f"plane.{name} = {show(value, 'm')}: expected {words} plane.{other} = "
                f"{show(limit, 'm')}"
            )
    top = plane.platform_height + plane.platform_thickness
    if not top < plane.length:
        raise InputError(
            f"plane.platform_height = {show(plane.platform_height, 'm')}: the platform's top at "
            f"{show(top, 'm')} is not below the tip, expected less than plane.length = "
            f"{show(plane.length, 'm')}"
        )
    room = 0.98 * (plane.platform_width - plane.thickness) / 2
    if expected := unless_at_most(plane.seat_width, room):
        raise InputError(
            f"plane.seat_width = {show(plane.seat_width, 'm')}: expected {expected} (98 % of the "
            "platform's overhang next to the blade)"
        )


def plane_motions(plane: Plane) -> dict[str, FaceMotion]:
    """Edges that match, by the name of the pair."""
    pitch = np.array([0.0, plane.pitch, 0.0])
    return {
        "this": FaceMotion("seat_right", "damper_left"),
        "next": FaceMotion("seat_left", "damper_right", shift=pitch),
    }


def blade_corners(plane: Plane) -> np.ndarray:
    """Corners (15, 2) [m] of blade and platform, anticlockwise from the root at y < 0, with the
    ends of both seats.
    """
    half = plane.thickness / 2
    wide = plane.platform_width / 2
    low = plane.platform_height
    high = low + plane.platform_thickness
    seat = wide - plane.seat_width
    left = [
        [0, -half],
        [low, -half],
        [low, -seat],
        [low, -wide],
        [high, -wide],
        [high, -half],
        [plane.length, -half],
    ]
    right = [[x, -y] for x, y in reversed(left)]
    return np.array([*left, [plane.length, 0], *right])


def damper_corners(plane: Plane) -> np.ndarray:
    """Corners (6, 2) [m] of the flat damper, anticlockwise: top from this seat to the next last."""
    top = plane.platform_height
    low = plane.platform_height - plane.damper_height
    wide = plane.platform_width / 2
    a = wide - plane.seat_width
    b = wide
    c = plane.pitch - wide
    d = plane.pitch - wide + plane.seat_width
    return np.array([[low, a], [top, a], [top, b], [top, c], [top, d], [low, d]])


def _draw_plane(gmsh: ModuleType, plane: Plane) -> Groups:
    blade, b, p = draw_polygon(gmsh, blade_corners(plane))
    damper, d, _ = draw_polygon(gmsh, damper_corners(plane))
    gmsh.model.occ.synchronize()
    faces = {
        "clamp": [b[14]],
        "tip": [b[6], b[7]],
        "seat_left": [b[2]],
        "seat_right": [b[11]],
        "pressure_side": [b[5]],
        "suction_side": [b[8]],
        "damper_left": [d[1]],
        "damper_right": [d[3]],
    }
    points = {"tip_leading": [p[6]], "tip_mid": [p[7]], "tip_trailing": [p[8]]}
    return Groups({"blade": [blade], "damper": [damper]}, faces, points)


def _set_sizes(
    gmsh: ModuleType,
    groups: Groups,
    base: float,
    contact: float,
) -> None:
    field = gmsh.model.mesh.field
    names = ("seat_left", "seat_right", "damper_left", "damper_right")
    threshold = threshold_field(
        field,
        "CurvesList",
        [c for name in names for c in groups.faces[name]],
        (contact, base),
        (contact, 5 * base),
        samples=100,
    )
    field.setAsBackgroundMesh(threshold)
    gmsh.option.setNumber("Mesh.MeshSizeMin", contact / 2)


def count_plane_cells(plane: Plane, mesh: MeshSize) -> float:
    """A lower bound of the number of triangles."""
    thinnest = min(plane.thickness / 2, plane.platform_thickness / 3, plane.damper_height / 2)
    base = mesh.size or thinnest
    area = plane.length * plane.thickness + plane.platform_width * plane.platform_thickness
    cells = area / (0.43 * (mesh.scale * base) ** 2)
    if mesh.contact_size is None:
        return cells
    return cells + 4 * plane.seat_width / (mesh.scale * mesh.contact_size)

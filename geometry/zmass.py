"""The Z-shaped mass: two bars along x and a diagonal between them, one plate standing on a block or
on the plane z = 0.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.limits import unless_at_most
from bladefem.scene.units import show

from .draw import (
    boundary_centres,
    draw_polygon,
    draw_prism,
    imprint_marks,
    tie_meshes,
)
from .extract_arrays import Groups
from .finalise_mesh import complete_mesh, mesh_model
from .matching import FaceMotion
from .mesh import Mesh
from .parameters import MeshSize, ZMass
from .session import gmsh_session, gmsh_step
from .size_fields import set_size_formula

# side of the foundation block over the larger side of the Z
FOUNDATION_RATIO = 2.0
SEAT_TO_FOOTPRINT = FaceMotion("seat", "footprint")


def z_corners(z: ZMass) -> np.ndarray:
    """Corners (10, 2) [m] of the Z round its centre, anticlockwise; the diagonal is ``bar`` wide
    along x.
    """
    w = z.width / 2
    h = z.height / 2
    b = z.bar
    half = np.array([[-w, -h], [w, -h], [w, b - h], [b - w, b - h], [w, h - b]])
    return np.vstack([half, -half])


def z_section(z: ZMass) -> tuple[float, float]:
    """Area [m^2] and polar second moment of area about the centre [m^4] of the Z."""
    here = z_corners(z)
    there = np.roll(here, -1, axis=0)
    cross = here[:, 0] * there[:, 1] - there[:, 0] * here[:, 1]
    return float(cross.sum() / 2), float(
        cross @ (here**2 + here * there + there**2).sum(axis=1) / 12
    )


def z_mass(
    z: ZMass,
    size: MeshSize,
    depth: float = 0.0,
) -> Mesh:
    """Body "damper" with the faces "footprint" (z = 0) and "top".

    Args:
        depth: of an elastic block under it [m]: body "blade" with the faces "seat" (below the Z,
            its nodes matched with the footprint's: pair "this") and "clamp"; 0 for none.

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    check_z_mass(z)
    base = size.size or min(z.thickness / 2, z.bar / 3)
    contact = size.contact_size or base
    with gmsh_session() as gmsh:
        body = draw_prism(gmsh, z_corners(z), 0.0, z.thickness)
        block = _draw_foundation(gmsh, z, depth) if depth else None
        gmsh.model.occ.synchronize()
        groups = _name_faces(gmsh, z, depth, body, block)
        if block is not None:
            tie_meshes(gmsh, 2, groups.faces, SEAT_TO_FOOTPRINT)
        set_size_formula(
            gmsh,
            f"{contact} + {base - contact} * Max(0, z) / {z.thickness} - 0.6 * Min(0, z)",
            min(base, contact) / 2,
        )
        with gmsh_step("mesh.size", "mesh this geometry"):
            mesh = mesh_model(gmsh, groups, 3, size)
    pairs = {"this": SEAT_TO_FOOTPRINT} if depth else {}
    return complete_mesh(
        mesh, pairs, size.scale * base, flat=("seat", "footprint") if depth else ()
    )


def check_z_mass(z: ZMass) -> None:
    """Refuse bars that leave no room between them.

    Raises:
        InputError: the bar is too wide.
    """
    limit = 0.95 * min(z.height / 2, z.width)
    if expected := unless_at_most(z.bar, limit):
        raise InputError(
            f"z_mass.bar = {show(z.bar, 'm')}: expected {expected} (95 % of z_mass.width and of "
            "half of z_mass.height)"
        )


def _draw_foundation(
    gmsh: ModuleType,
    z: ZMass,
    depth: float,
) -> int:
    """The foundation with the Z cut into its top."""
    w = FOUNDATION_RATIO / 2 * max(z.width, z.height)
    square = np.array([[-w, -w], [w, -w], [w, w], [-w, w]])
    mark, _, _ = draw_polygon(gmsh, z_corners(z))
    return imprint_marks(gmsh, draw_prism(gmsh, square, -depth, 0.0), [(2, mark)])


def _name_faces(
    gmsh: ModuleType,
    z: ZMass,
    depth: float,
    body: int,
    block: int | None,
) -> Groups:
    """Faces by the heights of their centres; the seat is the inner one of the two faces on top of
    the block.
    """
    found = {tag: centre[2] for tag, centre in boundary_centres(gmsh, body).items()}
    faces = {
        "footprint": [min(found, key=lambda tag: found[tag])],
        "top": [max(found, key=lambda tag: found[tag])],
    }
    if block is None:
        return Groups({"damper": [body]}, faces)
    found = {tag: centre[2] for tag, centre in boundary_centres(gmsh, block).items()}
    area = z_section(z)[0]
    level = [tag for tag, height in found.items() if abs(height) < 1e-6 * depth]
    faces["seat"] = [min(level, key=lambda tag: abs(gmsh.model.occ.getMass(2, tag) - area))]
    faces["clamp"] = [tag for tag, height in found.items() if abs(height + depth) < 1e-6 * depth]
    return Groups({"blade": [block], "damper": [body]}, faces)


def count_z_mass_cells(z: ZMass, mesh: MeshSize) -> float:
    """A lower bound of the number of tetrahedra."""
    base = mesh.size or min(z.thickness / 2, z.bar / 3)
    solid = z.thickness * z.bar * (z.height + 2 * z.width)
    cells = 0.5 * solid / (0.12 * (mesh.scale * base) ** 3)
    contact = mesh.contact_size or base
    surface = 0.5 * z.bar * (z.height + 2 * z.width)
    return cells + surface / (0.43 * (mesh.scale * contact) ** 2)

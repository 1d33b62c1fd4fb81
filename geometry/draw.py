"""Small OpenCASCADE drawings that several builders share: polygons, prisms, imprints, faces found
by their centre.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np

from .matching import FaceMotion


def draw_polygon(gmsh: ModuleType, corners: np.ndarray) -> tuple[int, list[int], list[int]]:
    """Surface, lines and points of a plane polygon (n, 2 or 3) [m]; line i runs from corner i to i
    + 1.
    """
    occ = gmsh.model.occ
    points = [occ.addPoint(*corner, *[0.0] * (3 - len(corner))) for corner in corners]
    lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    return occ.addPlaneSurface([occ.addCurveLoop(lines)]), lines, points


def draw_prism(
    gmsh: ModuleType,
    corners: np.ndarray,
    low: float,
    high: float,
) -> int:
    """Volume over a polygon (n, 2) [m] from z = low to z = high."""
    face, _, _ = draw_polygon(gmsh, np.column_stack([corners, np.full(len(corners), low)]))
    return next(
        tag for dim, tag in gmsh.model.occ.extrude([(2, face)], 0, 0, high - low) if dim == 3
    )


def imprint_marks(
    gmsh: ModuleType,
    volume: int,
    marks: list[tuple[int, int]],
) -> int:
    """The volume with plane faces and points (dimension, tag) cut into its skin."""
    result, _ = gmsh.model.occ.fragment([(3, volume)], marks)
    return next(tag for dim, tag in result if dim == 3)


def clear_leftovers(gmsh: ModuleType) -> None:
    """Delete the construction surfaces, curves and points that bound no volume; they would be
    meshed, too.
    """
    for dimension in (2, 1, 0):
        # leaves what bounds something else
        gmsh.model.occ.remove(gmsh.model.occ.getEntities(dimension))


def boundary_centres(
    gmsh: ModuleType,
    body: int,
    dimension: int = 3,
) -> dict[int, np.ndarray]:
    """Centre (3,) [m] of each boundary entity of a body."""
    faces = gmsh.model.getBoundary([(dimension, body)], oriented=False)
    return {tag: np.array(gmsh.model.occ.getCenterOfMass(dim, tag)) for dim, tag in faces}


def face_at(
    found: dict[int, np.ndarray],
    where: np.ndarray,
    tolerance: float,
    name: str,
) -> list[int]:
    """The one entity with its centre there.

    Raises:
        ValueError: none or several.
    """
    tags = [tag for tag, centre in found.items() if np.linalg.norm(centre - where) < tolerance]
    if len(tags) != 1:
        raise ValueError(f"face {name}: {len(tags)} entities at its place, expected one")
    return tags


def tie_meshes(
    gmsh: ModuleType,
    dimension: int,
    tags: dict[str, list[int]],
    motion: FaceMotion,
) -> None:
    """Have gmsh copy the mesh of the master's curves or surfaces onto the slave's under a rigid
    motion.

    Args:
        tags: of the curves or surfaces, by name.
    """
    affine = np.eye(4)
    affine[:3, :3] = motion.rotation
    affine[:3, 3] = motion.shift
    gmsh.model.mesh.setPeriodic(
        dimension, tags[motion.slave], tags[motion.master], affine.ravel().tolist()
    )

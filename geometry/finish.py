"""The last steps of every build: raise the order, extract, pair, snap, check and straighten, report."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np

from .curving import second_order
from .extract import Groups, extract
from .matching import match, snap
from .mesh import Mesh, Sector
from .parameters import MeshSize
from .quality import edge_of_middle, report, straighten

__all__ = ["Motion", "complete", "mesh_model"]

Motion = tuple[str, str, np.ndarray, np.ndarray]        # master, slave, rotation (3, 3), shift (3,) [m]


def mesh_model(gmsh: ModuleType, groups: Groups, dimension: int, size: MeshSize) -> Mesh:
    """Generate the mesh of the current model, raise its order, and extract it."""
    gmsh.model.mesh.generate(dimension)
    if size.order == 2:
        second_order(gmsh, size.curved)
    return extract(gmsh, groups, dimension)


def complete(mesh: Mesh, motions: dict[str, Motion], size: float, sector: Sector | None = None,
             flat: tuple[str, ...] = ()) -> Mesh:
    """Pair the faces, make the pairs exact, straighten doubtful cells, and write the report.

    Args:
        motions: pair name -> (master, slave, rotation, shift).
        size: element size [m], for the report.
        flat: plane faces, whose mid-side nodes go to the middle of their edges exactly (contact needs it).
    """
    mesh = replace(mesh, points=_flatten(mesh, flat))
    pairs = {name: match(mesh.points, mesh.faces, (m, s), mesh.dimension, r, t)
             for name, (m, s, r, t) in motions.items()}
    mesh = replace(mesh, points=snap(mesh.points, pairs), pairs=pairs, sector=sector)
    points, straightened = straighten(mesh)
    mesh = replace(mesh, points=snap(points, pairs))
    return replace(mesh, report=report(mesh, straightened, size))


def _flatten(mesh: Mesh, names: tuple[str, ...]) -> np.ndarray:
    points, ends = mesh.points.copy(), edge_of_middle(mesh)
    for name in names:
        nodes = np.unique(mesh.faces[name])
        middle = nodes[ends[nodes, 0] >= 0]
        points[middle] = points[ends[middle]].mean(axis=1)
    return points

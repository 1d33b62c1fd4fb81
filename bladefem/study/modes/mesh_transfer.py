"""Fields from one mesh to the points of another."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from geometry.mesh import Mesh

# nearest cells that are looked into for each point
CANDIDATE_CELLS = 24
# Six tetrahedra of a hexahedron round its diagonal 0-6, two triangles of a quadrilateral.
SIMPLICES_OF = {
    "hexahedron": (
        (0, 1, 2, 6),
        (0, 2, 3, 6),
        (0, 3, 7, 6),
        (0, 7, 4, 6),
        (0, 4, 5, 6),
        (0, 5, 1, 6),
    ),
    "quad": ((0, 1, 2), (0, 2, 3)),
    "tetra": ((0, 1, 2, 3),),
    "triangle": ((0, 1, 2),),
}
# Edges of gmsh's mid-side nodes.
MID_SIDE_EDGES = {
    "tetra10": ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)),
    "triangle6": ((0, 1), (1, 2), (2, 0)),
}


def simplices(mesh: Mesh, cells: np.ndarray) -> np.ndarray:
    """(nc, pieces, corners) straight simplices of each cell."""
    return cells[:, list(SIMPLICES_OF[mesh.cell_type.rstrip("0123456789")])]


def nodal_volumes(mesh: Mesh) -> np.ndarray:
    """(n,) each node's equal share of the cells round it [m^3; m^2 for plane meshes]; 0 for nodes
    of no cell.
    """
    volumes = np.zeros(len(mesh.points))
    for cells in mesh.bodies.values():
        corners = mesh.points[simplices(mesh, cells)][..., : mesh.dimension]
        sides = corners[:, :, 1:] - corners[:, :, :1]
        size = np.abs(np.linalg.det(sides)).sum(axis=1) / (6 if mesh.dimension == 3 else 2)
        np.add.at(volumes, cells, (size / cells.shape[1])[:, None])
    return volumes


def transfer_fields(
    mesh: Mesh,
    fields: np.ndarray,
    points: np.ndarray,
) -> np.ndarray:
    """(m, k, 3) fields of a mesh at other points, by the shape functions of the nearest cell.

    Quadratic in second-order triangles and tetrahedra, linear in all others; a point outside the
    mesh takes the continuation of the cell that it is least outside of.

    Args:
        mesh: where the fields live.
        fields: (m, n, 3), real or complex.
        points: (k, 3) [m].
    """
    cells = np.concatenate(list(mesh.bodies.values()))
    pieces = simplices(mesh, cells)
    owner = np.repeat(np.arange(len(cells)), pieces.shape[1])
    pieces = pieces.reshape(-1, pieces.shape[2])
    piece, weights = locate_points(
        mesh.points[pieces][..., : mesh.dimension], points[:, : mesh.dimension], CANDIDATE_CELLS
    )
    if mesh.cell_type in MID_SIDE_EDGES:
        nodes = cells[owner[piece]]
        weights = quadratic(weights, MID_SIDE_EDGES[mesh.cell_type])
    else:
        nodes = pieces[piece]
    return np.einsum("kc,mkci->mki", weights, fields[:, nodes])


def locate_points(
    corners: np.ndarray,
    points: np.ndarray,
    candidates: int,
) -> tuple[np.ndarray, np.ndarray]:
    """The simplex (k,) that holds each point, and its barycentric coordinates (k, corners)."""
    tree = cKDTree(corners.mean(axis=1))
    _, near = tree.query(points, k=min(candidates, len(corners)))
    near = near.reshape(len(points), -1)
    origin = corners[near][:, :, 0]
    sides = np.swapaxes(corners[near][:, :, 1:] - origin[:, :, None], 2, 3)
    inner = np.linalg.solve(sides, (points[:, None] - origin)[..., None])[..., 0]
    weights = np.concatenate([1 - inner.sum(axis=2, keepdims=True), inner], axis=2)
    best = weights.min(axis=2).argmax(axis=1)
    rows = np.arange(len(points))
    return near[rows, best], weights[rows, best]


def quadratic(weights: np.ndarray, middles: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Second-order shape functions from barycentric coordinates: corners, then mid-side nodes."""
    corner = weights * (2 * weights - 1)
    return np.concatenate(
        [corner, *(4 * weights[:, [a]] * weights[:, [b]] for a, b in middles)], axis=1
    )

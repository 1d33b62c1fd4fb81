"""Hexahedra, wedges and pyramids split into tetrahedra that conform across all faces, and
quadrilaterals of plane meshes into triangles.

Contacts and pictures know meshes of one cell shape; for them a mixed mesh is one of tetrahedra, or
of triangles.
Each cell is a cone from its first vertex in a global order over the faces that do not touch that
vertex, and each quadrilateral is split through its own first vertex (Dompierre et al., How to
subdivide pyramids, prisms and hexahedra into tetrahedra, 8th Int. Meshing Roundtable 1999). The
order is by radius, then by place along the engine axis, then by angle, so that both cut faces of a
sector are split alike. The mid-side nodes of the tetrahedra are the nodes of the complete
second-order cells: no node is added or moved.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .topology import CORNERS, EDGES, FACETS, FAMILY, NODES, QUADS

# of the model's size: coordinates that differ by less count as equal in the order of vertices
SAME_COORDINATE = 1e-5


def vertex_order(points: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """(n,) rank of each point: by radius about the axis, place along it, angle."""
    z = axis / np.linalg.norm(axis)
    x = np.linalg.svd(z[None])[2][1]
    y = np.cross(z, x)
    across = np.stack([points @ x, points @ y])
    unit = SAME_COORDINATE * np.ptp(points, axis=0).max()
    radius = np.rint(np.hypot(*across) / unit)
    along = np.rint(points @ z / unit)
    angle = np.arctan2(across[1], across[0])
    rank = np.empty(len(points), dtype=int)
    rank[np.lexsort([angle, along, radius])] = np.arange(len(points))
    return rank


def split_cells(
    word: str,
    cells: np.ndarray,
    rank: np.ndarray,
    points: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Tetrahedra (nt, 4 or 10) with positive volume, of plane cells triangles (nt, 3 or 6) that
    turn as they do, and the row of the cell that each came from.

    Args:
        word: a first-order cell type or a complete second-order one.
        rank: (n,) order of the vertices, see :func:`vertex_order`.
        points: (n, 3).
    """
    family = FAMILY[word]
    k = CORNERS[family]
    quadratic = NODES[word] > k
    if family in ("triangle", "tetra"):
        return cells, np.arange(len(cells))
    corner_rank = rank[cells[:, :k]]
    if family == "quad":
        return _quad_triangles(cells, corner_rank, quadratic)
    first = corner_rank.argmin(axis=1)
    found = []
    owner = []
    for apex in range(k):
        rows = np.flatnonzero(first == apex)
        for facet in FACETS[family]:
            if apex in facet or not len(rows):
                continue
            for triangle, some in _facet_triangles(facet, corner_rank[rows]):
                local = np.column_stack([np.full(len(some), apex), triangle])
                found.append(_cell_tetrahedra(family, cells[rows[some]], local, points, quadratic))
                owner.append(rows[some])
    owner = np.concatenate(owner)
    order = np.argsort(owner, kind="stable")
    return np.vstack(found)[order], owner[order]


def _quad_triangles(
    cells: np.ndarray, corner_rank: np.ndarray, quadratic: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (2 nc, 3 or 6) of quadrilaterals, and the row of each one's cell."""
    parts = _facet_triangles((0, 1, 2, 3), corner_rank)
    owner = np.concatenate([some for _, some in parts])
    local = np.vstack([triangle for triangle, _ in parts])
    row = owner[:, None]
    found = cells[row, local]
    if quadratic:
        ends = np.array(EDGES["triangle"])
        between = _middle_nodes("quad")[local[:, ends[:, 0]], local[:, ends[:, 1]]]
        found = np.hstack([found, cells[row, between]])
    order = np.argsort(owner, kind="stable")
    return found[order], owner[order]


def _facet_triangles(
    facet: tuple[int, ...], corner_rank: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Local triangles (m, 3) of a facet and the rows that they are for."""
    every = np.arange(len(corner_rank))
    if len(facet) == 3:
        return [(np.tile(facet, (len(every), 1)), every)]
    start = corner_rank[:, facet].argmin(axis=1)
    turned = np.array(facet)[(start[:, None] + np.arange(4)) % 4]
    return [(turned[:, [0, 1, 2]], every), (turned[:, [0, 2, 3]], every)]


def _cell_tetrahedra(
    family: str,
    cells: np.ndarray,
    local: np.ndarray,
    points: np.ndarray,
    quadratic: bool,
) -> np.ndarray:
    """Node numbers (m, 4 or 10) of tetrahedra given by local corners (m, 4), turned to positive
    volume.
    """
    row = np.arange(len(cells))[:, None]
    x = points[cells[row, local]]
    negative = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    local[negative] = local[negative][:, [0, 2, 1, 3]]
    corner = cells[row, local]
    if not quadratic:
        return corner
    ends = np.array(EDGES["tetra"])
    between = _middle_nodes(family)[local[:, ends[:, 0]], local[:, ends[:, 1]]]
    return np.hstack([corner, cells[row, between]])


@cache
def _middle_nodes(family: str) -> np.ndarray:
    """(corners, corners) local number of the node half-way between two corners."""
    k = CORNERS[family]
    edges = EDGES[family]
    quads = QUADS.get(family, [])
    table = np.full((k, k), k + len(edges) + len(quads))
    for i, (a, b) in enumerate(edges):
        table[a, b] = table[b, a] = k + i
    for i, (a, b, c, d) in enumerate(quads):
        for one, other in ((a, c), (b, d)):
            table[one, other] = table[other, one] = k + len(edges) + i
    return table

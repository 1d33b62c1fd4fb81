"""Cells of any shape and order made complete second-order cells: a node on each edge, on each
quadrilateral face, in each hexahedron.

Nodes that the file has stay. Missing centres of faces and cells lie where the serendipity shape
functions put them (on a face: middles of edges 1/2, corners -1/4; in a hexahedron: middles 1/4,
corners -1/4), so the shape of the cell stays and its displacements get richer. Missing mid-side
nodes of first-order cells lie half-way; a neighbour of second order lends its own.
"""

from __future__ import annotations

import numpy as np

from .topology import CORNERS, EDGES, FAMILY, NODES, QUADS

# family -> the word of its complete second-order cell
COMPLETE_CELL = {
    "triangle": "triangle6",
    "quad": "quad9",
    "tetra": "tetra10",
    "hexahedron": "hexahedron27",
    "wedge": "wedge18",
    "pyramid": "pyramid14",
}
Blocks = list[tuple[str, np.ndarray]]


def completed_cells(points: np.ndarray, blocks: Blocks) -> tuple[np.ndarray, Blocks]:
    """Points (n, 3) with the new ones appended, and the blocks as complete second-order cells."""
    points, middles = _with_middles(points, blocks)
    points, centres = _with_face_centres(points, blocks, middles)
    whole = []
    for (word, cells), middle, centre in zip(blocks, middles, centres, strict=True):
        family = FAMILY[word]
        corners = cells[:, : CORNERS[family]]
        parts = [corners, middle, centre]
        if family == "hexahedron":
            points, inside = _with_cell_centres(points, word, cells, middle)
            parts.append(inside)
        whole.append((COMPLETE_CELL[family], np.hstack(parts)))
    return points, whole


def _with_middles(points: np.ndarray, blocks: Blocks) -> tuple[np.ndarray, list[np.ndarray]]:
    """Points, and the (nc, edges) mid-side nodes of each block."""
    ends = []
    given = []
    for word, cells in blocks:
        family = FAMILY[word]
        k = CORNERS[family]
        count = len(EDGES[family])
        ends.append(np.sort(cells[:, np.array(EDGES[family])].reshape(-1, 2), axis=1))
        has_middles = NODES[word] > k
        middle = cells[:, k : k + count] if has_middles else np.full((len(cells), count), -1)
        given.append(middle.ravel())
    edges, number = _shared_rows(np.vstack(ends))
    return _fill_nodes(
        points,
        number,
        np.concatenate(given),
        points[edges].mean(axis=1),
        blocks,
        EDGES,
    )


def _with_face_centres(
    points: np.ndarray,
    blocks: Blocks,
    middles: list[np.ndarray],
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Points, and the (nc, quadrilaterals) centre nodes of each block's faces."""
    if not any(FAMILY[word] in QUADS for word, _ in blocks):
        return points, [np.empty((len(cells), 0), dtype=int) for _, cells in blocks]
    keys = [np.empty((0, 4), dtype=int)]
    given = [np.empty(0, dtype=int)]
    places = [np.empty((0, 3))]
    for (word, cells), middle in zip(blocks, middles, strict=True):
        family = FAMILY[word]
        if family not in QUADS:
            continue
        first = CORNERS[family] + len(EDGES[family])
        count = len(QUADS[family])
        corner = cells[:, np.array(QUADS[family])]
        around = middle[:, np.array(edges_of_quads(family))]
        keys.append(np.sort(corner.reshape(-1, 4), axis=1))
        places.append((points[around].sum(2) / 2 - points[corner].sum(2) / 4).reshape(-1, 3))
        has_centres = NODES[word] >= first + count
        centre = cells[:, first : first + count] if has_centres else -np.ones_like(corner[..., 0])
        given.append(centre.ravel())
    _, first_row, number = np.unique(
        np.vstack(keys), axis=0, return_index=True, return_inverse=True
    )
    place = np.vstack(places)[first_row]
    return _fill_nodes(
        points,
        number.ravel(),
        np.concatenate(given),
        place,
        blocks,
        QUADS,
    )


def _with_cell_centres(
    points: np.ndarray,
    word: str,
    cells: np.ndarray,
    middle: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Points, and the (nc, 1) centre node of each hexahedron."""
    if NODES[word] == NODES["hexahedron27"]:
        return points, cells[:, -1:]
    place = points[middle].sum(axis=1) / 4 - points[cells[:, :8]].sum(axis=1) / 4
    number = len(points) + np.arange(len(cells))
    return np.vstack([points, place]), number[:, None]


def edges_of_quads(family: str) -> list[list[int]]:
    """Rows of EDGES round each quadrilateral face."""
    row = {frozenset(pair): i for i, pair in enumerate(EDGES[family])}
    return [[row[frozenset((quad[i - 1], quad[i]))] for i in range(4)] for quad in QUADS[family]]


def _shared_rows(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct rows, and the number of each row's own."""
    distinct, number = np.unique(keys, axis=0, return_inverse=True)
    return distinct, number.ravel()


def _fill_nodes(
    points: np.ndarray,
    number: np.ndarray,
    given: np.ndarray,
    places: np.ndarray,
    blocks: Blocks,
    table: dict[str, list[tuple[int, ...]]],
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Nodes of edges or faces, those that no cell has appended to the points at ``places``.

    Args:
        number: shared edge or face of each row.
        given: node of each row, -1 where the cell has none.
        places: (shared, 3).

    Returns:
        Points, and (nc, edges or faces) nodes of each block.
    """
    known = np.full(len(places), -1)
    np.maximum.at(known, number, given)
    new = np.flatnonzero(known < 0)
    known[new] = len(points) + np.arange(len(new))
    nodes = np.where(given < 0, known[number], given)
    counts = [len(cells) * len(table.get(FAMILY[word], [])) for word, cells in blocks]
    parts = np.split(nodes, np.cumsum(counts)[:-1])
    shaped = [part.reshape(len(cells), -1) for part, (_, cells) in zip(parts, blocks, strict=True)]
    return np.vstack([points, places[new]]), shaped

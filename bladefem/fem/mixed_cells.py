"""Meshes of mixed cell shapes: each shape as a mesh of its own, and how their matrices add up.

dolfinx 0.5 to 0.11 assembles meshes of one cell shape; ffcx 0.5 has no pyramids and refuses prisms
of second order, whose faces carry different numbers of nodes. Here a wedge is a hexahedron of 27
nodes with an edge of each triangle drawn together to a point, a pyramid one with its top drawn
together. Their 27 displacements follow from their own 18 or 14 (of first order, the 8 from 6 or 5),

    u_27 = T u_own,     x_27 = T x_own,     K_own = T^T K_27 T,

with T such that a triangular face holds the complete quadratic polynomials of its six nodes and a
quadrilateral one those of its nine. (Nine nodes of a side with an edge drawn together, of which
seven places are left, hold one rational function more; T leaves it out.) Cells of all shapes
therefore conform, quadratic displacements are exact in straight cells, and the wedge is the usual
one of 18 nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Mesh
from geometry.topology import CORNERS, EDGES, NODES
from geometry.whole_cells import own_cells

from ..util.arrays import IntegerArray, RealArray
from . import shape_functions as shape
from .compat import PETSc

# pairs of nodes of the cells of one piece: its stiffness takes some 200 MB
ENTRIES_AT_ONCE = 2_000_000
# the hexahedron whose nodes are drawn together
HEXAHEDRON_OF = {
    "wedge": "hexahedron",
    "pyramid": "hexahedron",
    "wedge18": "hexahedron27",
    "pyramid14": "hexahedron27",
}


def pieces_of_one_shape(mesh: Mesh, names: tuple[str, ...]) -> Iterator[tuple[Mesh, sp.csr_matrix]]:
    """The bodies as meshes that dolfinx assembles, whose cells have nodes of their own.

    Cells of one shape need not share faces, only edges or corners, which dolfinx 0.5 does not
    number rightly on several ranks; without shared nodes there is nothing to number.

    Yields:
        A mesh of some cells of one shape of one body, and the matrix (its points, points of the
        given mesh) that interpolates fields onto its nodes.
    """
    plain = replace(mesh, whole={}, faces={}, nodes={}, pairs={}, parts={}, numbers=None)
    for own in own_cells(mesh, names):
        entries = len(drawn_nodes(own.word)) ** 2
        blocks = -(-len(own.cells) * entries // ENTRIES_AT_ONCE)
        for some in np.array_split(own.cells, blocks):
            yield _with_own_nodes(plain, own.word, some, own.name)


def _with_own_nodes(
    mesh: Mesh,
    word: str,
    cells: IntegerArray,
    name: str,
) -> tuple[Mesh, sp.csr_matrix]:
    """Cells (nc, k), each as a tetrahedron or a hexahedron of m nodes of its own, and the matrix
    (m nc, points) of their places in those of the mesh.
    """
    T = drawn_nodes(word)
    node, own = np.nonzero(T)
    count = len(cells)
    rows = np.arange(count)[:, None] * len(T) + node
    values = np.broadcast_to(T[node, own], rows.shape)
    spread = sp.csr_matrix(
        (values.ravel(), (rows.ravel(), cells[:, own].ravel())),
        shape=(count * len(T), len(mesh.points)),
    )
    alone = replace(
        mesh,
        points=np.asarray(spread @ mesh.points),
        cell_type=HEXAHEDRON_OF.get(word, word),
        bodies={name: np.arange(count * len(T)).reshape(count, len(T))},
    )
    return alone, spread


@cache
def drawn_nodes(word: str) -> RealArray:
    """(m, k) matrix T of nodes from those of a cell: those of a hexahedron drawn together for a
    wedge or a pyramid, of hexahedra and tetrahedra their own.
    """
    if word in ("wedge", "wedge18"):
        return _wedge_nodes(word)
    if word == "pyramid":
        # the four upper corners are the apex
        return np.eye(NODES[word])[[0, 1, 2, 3, 4, 4, 4, 4]]
    return _pyramid_nodes() if word == "pyramid14" else np.eye(NODES[word])


def _wedge_nodes(word: str) -> RealArray:
    """Triangles of three or six nodes times lines of two or three; the sides y = 1 of the square
    layers are the third corners.
    """
    flat_word, high_word = ("triangle", "line") if word == "wedge" else ("triangle6", "line3")
    x, y, z = shape.reference_nodes(HEXAHEDRON_OF[word]).T
    triangle, _ = shape.tabulate(flat_word, np.column_stack([x * (1 - y), y]))
    line, _ = shape.tabulate(high_word, z[:, None])
    own = _wedge_places()[: NODES[word]]
    flat = _numbers_of(own[:, :2], shape.reference_nodes(flat_word))
    high = _numbers_of(own[:, 2:], shape.reference_nodes(high_word))
    return np.asarray(triangle[:, flat] * line[:, high])


def _wedge_places() -> RealArray:
    """(18, 3) nodes of a wedge in its unit cell: corners, edges, middles of its quadrilaterals."""
    corner = np.array(
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)], dtype=float
    )
    edges = corner[np.array(EDGES["wedge"])].mean(axis=1)
    sides = corner[[(0, 1, 4, 3), (0, 3, 5, 2), (1, 2, 5, 4)]].mean(axis=1)
    return np.vstack([corner, edges, sides])


def _numbers_of(places: RealArray, nodes: RealArray) -> IntegerArray:
    """Which of the nodes lies at each place."""
    distance = np.abs(places[:, None, :] - nodes[None]).max(axis=2)
    return np.asarray(distance.argmin(axis=1))


def _pyramid_nodes() -> RealArray:
    """The base is a quadrilateral of nine nodes, the top the apex. Half-way up, at the corners the
    middles of the rising edges; between them what quadratic polynomials have there: with B and L
    the base's value by nine nodes and by its four corners, the bilinear mean of the middles and
    (B - L) / 4.
    """
    x, y, z = shape.reference_nodes(HEXAHEDRON_OF["pyramid14"]).T
    level = np.column_stack([x, y])
    nine, _ = shape.tabulate("quad9", level)
    four, _ = shape.tabulate("quad", level)
    edges = {frozenset(pair): CORNERS["pyramid"] + i for i, pair in enumerate(EDGES["pyramid"])}
    around = [edges[frozenset(pair)] for pair in EDGES["quad"]]
    base = [0, 1, 2, 3, *around, NODES["pyramid14"] - 1]
    rising = [edges[frozenset((corner, 4))] for corner in range(4)]
    T = np.zeros((len(x), NODES["pyramid14"]))
    low, middle = z == 0, z == 0.5
    T[np.ix_(low, base)] = nine[low]
    T[np.ix_(middle, rising)] = four[middle]
    T[np.ix_(middle, base)] = nine[middle] / 4
    T[np.ix_(middle, base[:4])] -= four[middle] / 4
    T[z == 1, 4] = 1.0
    return T


def spread_matrix(
    spread: sp.csr_matrix,
    from_rows: IntegerArray,
    to_rows: IntegerArray,
    piece: PETSc.Mat,
    columns: tuple[int, int],
) -> PETSc.Mat:
    """The interpolation of displacements onto a piece as a distributed matrix.

    Args:
        spread: (points of the piece, points of the mesh), the same on every rank.
        from_rows, to_rows: block row of each point of the mesh and of the piece, -1 outside.
        piece: a matrix of the piece, whose rows are distributed as those of the result.
        columns: of the result, on this rank and in all.
    """
    dim = piece.getBlockSize()
    first, last = (end // dim for end in piece.getOwnershipRange())
    inside = np.flatnonzero(to_rows >= 0)
    node = np.empty(len(inside), np.int64)
    node[to_rows[inside]] = inside
    own = spread[node[first:last]]
    own.sort_indices()
    entries = np.diff(own.indptr)
    blocks = np.repeat(np.arange(len(entries)), entries)
    # each component has the entries of its node
    component = np.arange(dim)
    rows = (dim * blocks[:, None] + component).ravel()
    column = (dim * from_rows[own.indices][:, None] + component).ravel()
    order = np.lexsort([column, rows])
    starts = np.concatenate([[0], np.cumsum(np.repeat(entries, dim))])
    out = PETSc.Mat().createAIJ(
        (piece.getSizes()[0], columns),
        csr=(
            starts.astype(PETSc.IntType),
            column[order].astype(PETSc.IntType),
            np.repeat(own.data, dim)[order],
        ),
        comm=piece.comm,
    )
    out.assemble()
    return out

"""Uniform refinement of a mesh: each cell in 2^d of half its size, on the same geometry.

New nodes lie where the parent's own shape functions put them, so the refined mesh fills the very
volume of the given one: curved boundaries stay as curved, and as faceted, as they were drawn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from geometry.matching import FaceMotion, match_faces
from geometry.mesh import Mesh, Pair
from geometry.second_order_cells import COMPLETE_CELL as SECOND_ORDER
from geometry.split_cells import split_cells, vertex_order
from geometry.topology import CORNERS, FAMILY, NODES, boundary_facets
from geometry.whole_cells import (
    OwnCells,
    own_cells,
    own_facets,
    padded_cells,
    quads_of_halves,
    without_halves,
)

from ..util.arrays import IntegerArray, RealArray
from . import shape_functions as shape
from .cell_functions import order_of, reference_nodes, straight_nodes, tabulate

HashArray: TypeAlias = NDArray[np.uint64]
Corners: TypeAlias = tuple[tuple[int, ...], ...]
# corners of the children in the unit cell, in halves; the octahedron left in a tetrahedron is cut
# along one of its diagonals
TRIANGLES: tuple[Corners, ...] = (
    ((0, 0), (1, 0), (0, 1)),
    ((1, 0), (2, 0), (1, 1)),
    ((0, 1), (1, 1), (0, 2)),
    ((1, 1), (0, 1), (1, 0)),
)
TETRAHEDRA: tuple[Corners, ...] = (
    ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((1, 0, 0), (2, 0, 0), (1, 1, 0), (1, 0, 1)),
    ((0, 1, 0), (1, 1, 0), (0, 2, 0), (0, 1, 1)),
    ((0, 0, 1), (1, 0, 1), (0, 1, 1), (0, 0, 2)),
    ((0, 1, 0), (1, 0, 1), (1, 0, 0), (1, 1, 0)),
    ((0, 1, 0), (1, 0, 1), (1, 1, 0), (0, 1, 1)),
    ((0, 1, 0), (1, 0, 1), (0, 1, 1), (0, 0, 1)),
    ((0, 1, 0), (1, 0, 1), (0, 0, 1), (1, 0, 0)),
)
# four on the base, one on top, one upside down between them
PYRAMIDS: tuple[Corners, ...] = (
    ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)),
    ((1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 0, 1)),
    ((1, 1, 0), (2, 1, 0), (2, 2, 0), (1, 2, 0), (1, 1, 1)),
    ((0, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0), (0, 1, 1)),
    ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (0, 0, 2)),
    ((0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1), (1, 1, 0)),
)
# and what is left on the sides
PYRAMIDS_TETRAHEDRA: tuple[Corners, ...] = (
    ((1, 0, 0), (1, 0, 1), (0, 0, 1), (1, 1, 0)),
    ((2, 1, 0), (1, 1, 1), (1, 0, 1), (1, 1, 0)),
    ((1, 2, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)),
    ((0, 1, 0), (0, 0, 1), (0, 1, 1), (1, 1, 0)),
)
# new nodes whose places are worked out at a time
NODES_AT_ONCE = 200_000
# of all weights of corners at places in quarters: 64ths in a hexahedron, 48ths in a pyramid
WHOLE_WEIGHTS = 192
# partners of refined faces, as a share of the face's size
MATCH_TOLERANCE = 1e-6
# of the wheel, in whose direction both cut faces are split alike
AXIS = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class _Children:
    """The children of all cells of one shape of a body."""

    name: str
    word: str
    # (nc, k) nodes
    cells: IntegerArray
    # (nc,) number of the parent in the body's cells
    parent: IntegerArray


def refine_uniformly(mesh: Mesh) -> Mesh:
    """The mesh with all cells halved; named faces, node sets, volumes and pairs go along.

    A node set takes the new nodes of the outer facets whose nodes it holds. A pyramid becomes six
    pyramids and four tetrahedra, a cell of any other shape eight of its own.
    """
    own = own_cells(mesh, tuple(mesh.bodies))
    hashes = np.random.default_rng(0).integers(0, 2**64, len(mesh.points), dtype=np.uint64)
    keys, points, children = _halved(mesh, own, hashes)
    # the parents' nodes are corners of children or in the middle of their edges
    kept = np.full(len(mesh.points), -1)
    for some in own:
        at = reference_nodes(some.word)
        kept[some.cells] = np.searchsorted(keys, _keys(some.word, some.cells, hashes, at))
    rank = _order_to_split(points, own, kept) if mesh.whole else np.empty(0, int)
    bodies, whole, parent = _bodies(mesh, points, children, rank)

    def children_nodes(word: str, own: IntegerArray) -> IntegerArray:
        at = _child_nodes(word, FAMILY[word])
        return np.searchsorted(keys, _keys(word, own, hashes, at)).reshape(-1, own.shape[1])

    def facets(some: IntegerArray) -> IntegerArray:
        by_shape, halves = own_facets(mesh, tuple(mesh.bodies), some)
        found = []
        for word, own in by_shape.items():
            new = children_nodes(word, own)
            found.append(_triangles(new, rank) if FAMILY[word] == "quad" and mesh.whole else new)
        if len(halves):
            quads = quads_of_halves(mesh, tuple(mesh.bodies), halves)
            word = "quad" if quads.shape[1] == 4 else "quad9"
            found.append(_half_triangles(children_nodes(word, quads), rank))
        return np.vstack(found) if found else some

    refined = replace(
        mesh,
        points=points,
        # most nodes are new ones
        numbers=None,
        whole=whole,
        bodies=bodies,
        faces={name: facets(some) for name, some in mesh.faces.items()},
        nodes={
            name: np.union1d(kept[nodes], np.unique(facets(_facets_inside(mesh, nodes))))
            for name, nodes in mesh.nodes.items()
        },
        parts={name: _part_rows(mesh, rows, parent) for name, rows in mesh.parts.items()},
    )
    return replace(
        refined, pairs={name: _matched(refined, pair) for name, pair in mesh.pairs.items()}
    )


def _halved(
    mesh: Mesh,
    own: list[OwnCells],
    hashes: HashArray,
) -> tuple[HashArray, RealArray, list[_Children]]:
    """Sorted keys of the new nodes, their places (n, 3) [m], and the new cells."""
    made = []
    start = dict.fromkeys(mesh.bodies, 0)
    for some in own:
        for kind in _children_of(FAMILY[some.word]):
            at = _child_nodes(some.word, kind)
            own_keys = _keys(some.word, some.cells, hashes, at)
            made.append((some, kind, at, own_keys, start[some.name]))
        start[some.name] += len(some.cells)
    keys, first, number = np.unique(
        np.concatenate([own_keys.ravel() for *_, own_keys, _ in made]),
        return_index=True,
        return_inverse=True,
    )
    points = np.empty((len(keys), 3))
    children = []
    begin = 0
    for some, kind, at, own_keys, before in made:
        count = own_keys.size
        word = _same_order(kind, some.word)
        cells = number.ravel()[begin : begin + count].reshape(-1, NODES[word])
        parent = before + np.repeat(np.arange(len(some.cells)), len(cells) // len(some.cells))
        children.append(_Children(some.name, word, cells, parent))
        new = np.flatnonzero((first >= begin) & (first < begin + count))
        cell, place = np.divmod(first[new] - begin, len(at))
        values, _ = tabulate(some.word, at)
        for part in np.array_split(np.arange(len(new)), len(new) // NODES_AT_ONCE + 1):
            corners = mesh.points[some.cells[cell[part]]]
            points[new[part]] = np.einsum("nk,nkd->nd", values[place[part]], corners)
        begin += count
    return keys, points, children


def _bodies(
    mesh: Mesh,
    points: RealArray,
    children: list[_Children],
    rank: IntegerArray,
) -> tuple[dict[str, IntegerArray], dict[str, IntegerArray], dict[str, IntegerArray]]:
    """Cells of each body's mesh, what `Mesh.whole` is of them, and (np,) which of the body's parent
    cells, in the order of `own_cells`, each is in.
    """
    bodies = {}
    whole = {}
    parent = {}
    for name in mesh.bodies:
        own = [some for some in children if some.name == name]
        if name not in mesh.whole:
            (only,) = own
            bodies[name], parent[name] = only.cells, only.parent
            continue
        parts = [split_cells(some.word, some.cells, rank, points) for some in own]
        bodies[name] = np.vstack([cells for cells, _ in parts])
        pairs = list(zip(own, parts, strict=True))
        whole[name] = padded_cells([(some.cells, rows) for some, (_, rows) in pairs])
        parent[name] = np.concatenate([some.parent[rows] for some, (_, rows) in pairs])
    return bodies, whole, parent


def _order_to_split(points: RealArray, own: list[OwnCells], kept: IntegerArray) -> IntegerArray:
    """(n,) rank of the new nodes by which quadrilaterals are split: corners of the parents first,
    so that the children on a diagonal of their parent are split along it.

    Args:
        kept: new number of each of the parents' nodes.
    """
    corner = np.zeros(len(points), bool)
    for some in own:
        corner[kept[some.cells[:, : CORNERS[FAMILY[some.word]]]]] = True
    rank = np.empty(len(points), int)
    rank[np.lexsort([vertex_order(points, AXIS), ~corner])] = np.arange(len(points))
    return rank


def _part_rows(mesh: Mesh, rows: IntegerArray, parent: dict[str, IntegerArray]) -> IntegerArray:
    """Rows of the new blade that are in a volume, of which ``rows`` were the old blade's."""
    chosen = []
    before = 0
    for some in own_cells(mesh, ("blade",)):
        inside = np.isin(some.pieces, rows)
        chosen.append(before + np.unique(some.owner[inside]))
        before += len(some.cells)
    return np.flatnonzero(np.isin(parent["blade"], np.concatenate(chosen)))


def _triangles(quads: IntegerArray, rank: IntegerArray) -> IntegerArray:
    """Quadrilaterals (nf, 4 or 9) as the triangles (2 nf, 3 or 6) of the tetrahedra behind them:
    each is split through its first vertex.
    """
    ring = (rank[quads[:, :4]].argmin(axis=1)[:, None] + np.arange(4)) % 4
    corner = np.take_along_axis(quads[:, :4], ring, axis=1)
    if quads.shape[1] == 4:
        return np.vstack([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    middle = np.take_along_axis(quads[:, 4:8], ring, axis=1)
    centre = quads[:, 8:]
    first = [corner[:, [0, 1, 2]], middle[:, [0, 1]], centre]
    second = [corner[:, [0, 2, 3]], centre, middle[:, [2, 3]]]
    return np.vstack([np.hstack(first), np.hstack(second)])


def _half_triangles(quads: IntegerArray, rank: IntegerArray) -> IntegerArray:
    """The children (4 nf, 4 or 9) of quadrilaterals of which the half at the first three corners is
    meant, as its triangles (4 nf, 3 or 6): those at the ends of the diagonal are cut by it.
    """
    # at the corners (0, 0), (0, 1), (1, 0), (1, 1): first, fourth, second, third
    first, _, second, third = (quads[i::4] for i in range(4))
    columns = [0, 1, 2, 4, 5, 8] if quads.shape[1] == 9 else [0, 1, 2]
    return np.vstack([_triangles(second, rank), first[:, columns], third[:, columns]])


def _same_order(family: str, word: str) -> str:
    """meshio's word of a cell of a family and of the order of another one."""
    if order_of(word) == 1:
        return family
    return {**SECOND_ORDER, "line": "line3"}[family]


@cache
def _children_of(family: str) -> dict[str, tuple[Corners, ...]]:
    """Corners of the children in a unit cell, in halves, in the order of the cell's own, by
    shape.
    """
    if family in ("line", "quad", "hexahedron"):
        corners = shape.reference_nodes(family).astype(int)
        steps = product((0, 1), repeat=corners.shape[1])
        return {family: tuple(tuple(tuple(c + step) for c in corners) for step in steps)}
    if family == "wedge":
        sides = [[(*a, z) for z in (low, low + 1) for a in t] for t in TRIANGLES for low in (0, 1)]
        return {family: tuple(map(tuple, sides))}
    if family == "pyramid":
        return {"pyramid": PYRAMIDS, "tetra": PYRAMIDS_TETRAHEDRA}
    return {family: TRIANGLES if family == "triangle" else TETRAHEDRA}


@cache
def _child_nodes(word: str, kind: str) -> RealArray:
    """(children * k, d) nodes of the children of one shape in the unit cell."""
    child = _same_order(kind, word)
    parts = [
        straight_nodes(child, np.array(corners) / 2) for corners in _children_of(FAMILY[word])[kind]
    ]
    return np.concatenate(parts)


def _keys(
    word: str,
    cells: IntegerArray,
    hashes: HashArray,
    at: RealArray,
) -> HashArray:
    """(nc, q) sums of the corners' hashes with their whole-number weights at places (q, d) of the
    unit cell; a place on a facet knows its corners alone.
    """
    weights, _ = tabulate(FAMILY[word], at)
    whole = np.rint(WHOLE_WEIGHTS * weights).astype(np.uint64)
    corner = hashes[cells[:, : weights.shape[1]]]
    total = np.zeros((len(cells), len(at)), np.uint64)
    for i in range(weights.shape[1]):
        total += corner[:, i, None] * whole[:, i]
    return total


def _facets_inside(mesh: Mesh, nodes: IntegerArray) -> IntegerArray:
    """Outer facets (m, k) all of whose nodes are in a set; of quadrilaterals whole ones alone."""
    cells = np.concatenate(list(mesh.bodies.values()))
    outer = boundary_facets(cells, mesh.cell_type)
    inside = np.asarray(outer[np.isin(outer, nodes).all(axis=1)])
    return without_halves(mesh, inside)


def _matched(mesh: Mesh, pair: Pair) -> Pair:
    """The pair with its new nodes; none where they were none."""
    if not pair.nodes.size:
        return pair
    motion = FaceMotion(pair.master, pair.slave, pair.rotation, pair.shift)
    return match_faces(mesh.points, mesh.faces, motion, mesh.dimension, MATCH_TOLERANCE)

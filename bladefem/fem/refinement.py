"""Uniform refinement of a mesh: each cell in 2^d of half its size, on the same geometry.

New nodes lie where the parent's own shape functions put them, so the refined mesh fills the very
volume of the given one: curved boundaries stay as curved, and as faceted, as they were drawn.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from geometry.matching import match_faces
from geometry.mesh import Mesh, Pair
from geometry.topology import boundary_facets

from ..util.arrays import IntegerArray, RealArray
from . import shape_functions as shape

HashArray: TypeAlias = NDArray[np.uint64]
# corners of the children in the unit cell, in halves; the octahedron left in a tetrahedron is cut
# along one of its diagonals
TRIANGLES: list[list[tuple[int, ...]]] = [
    [(0, 0), (1, 0), (0, 1)],
    [(1, 0), (2, 0), (1, 1)],
    [(0, 1), (1, 1), (0, 2)],
    [(1, 1), (0, 1), (1, 0)],
]
TETRAHEDRA: list[list[tuple[int, ...]]] = [
    [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    [(1, 0, 0), (2, 0, 0), (1, 1, 0), (1, 0, 1)],
    [(0, 1, 0), (1, 1, 0), (0, 2, 0), (0, 1, 1)],
    [(0, 0, 1), (1, 0, 1), (0, 1, 1), (0, 0, 2)],
    [(0, 1, 0), (1, 0, 1), (1, 0, 0), (1, 1, 0)],
    [(0, 1, 0), (1, 0, 1), (1, 1, 0), (0, 1, 1)],
    [(0, 1, 0), (1, 0, 1), (0, 1, 1), (0, 0, 1)],
    [(0, 1, 0), (1, 0, 1), (0, 0, 1), (1, 0, 0)],
]
# partners of refined faces, as a share of the face's size
MATCH_TOLERANCE = 1e-6


def refine_uniformly(mesh: Mesh) -> Mesh:
    """The mesh with all cells halved; named faces, node sets, volumes and pairs go along.

    A node set takes the new nodes of the outer facets whose nodes it holds. Of cells of mixed
    shapes their tetrahedra are refined, and nothing but these is left.
    """
    cells = np.concatenate(list(mesh.bodies.values()))
    hashes = np.random.default_rng(0).integers(0, 2**64, len(mesh.points), dtype=np.uint64)
    sets = {name: _facets_inside(mesh, cells, nodes) for name, nodes in mesh.nodes.items()}
    own = _child_keys(mesh.cell_type, cells, hashes)
    keys, first, number = np.unique(own, return_index=True, return_inverse=True)
    points = _child_points(mesh, cells, first)
    children = shape.reference_nodes(mesh.cell_type).shape[0]
    new_cells = number.reshape(-1, children)
    # the parent's nodes are corners of children or in the middle of their edges
    old = np.searchsorted(keys, _node_keys(mesh.cell_type, cells, hashes))
    kept = np.full(len(mesh.points), -1)
    kept[cells] = old
    facet_type = shape.FACET_OF[mesh.cell_type]

    def facets(some: IntegerArray) -> IntegerArray:
        found = np.searchsorted(keys, _child_keys(facet_type, some, hashes))
        return found.reshape(-1, some.shape[1])

    per_cell = len(_child_corners(shape.SHAPES[mesh.cell_type][0]))
    ends = per_cell * np.cumsum([len(some) for some in mesh.bodies.values()])[:-1]
    refined = replace(
        mesh,
        points=points,
        # most nodes are new ones
        numbers=None,
        whole={},
        bodies=dict(zip(mesh.bodies, np.split(new_cells, ends), strict=True)),
        faces={name: facets(some) for name, some in mesh.faces.items()},
        nodes={
            name: np.union1d(kept[nodes], np.unique(facets(sets[name])))
            for name, nodes in mesh.nodes.items()
        },
        parts={
            name: (per_cell * rows[:, None] + np.arange(per_cell)).ravel()
            for name, rows in mesh.parts.items()
        },
    )
    return replace(
        refined, pairs={name: _matched(refined, pair) for name, pair in mesh.pairs.items()}
    )


@cache
def _child_corners(kind: str) -> list[list[tuple[int, ...]]]:
    """Corners of the children in a unit cell, in halves, in the order of the cell's own."""
    if kind in ("line", "quad", "hexahedron"):
        corners = shape.reference_nodes(kind).astype(int)
        steps = product((0, 1), repeat=corners.shape[1])
        return [[tuple(corner + step) for corner in corners] for step in steps]
    return TRIANGLES if kind == "triangle" else TETRAHEDRA


@cache
def _child_nodes(cell_type: str) -> RealArray:
    """(children * k, d) nodes of the children in the unit cell."""
    kind = shape.SHAPES[cell_type][0]
    linear, _ = shape.tabulate(kind, shape.reference_nodes(cell_type))
    parts = [linear @ (np.array(corners) / 2) for corners in _child_corners(kind)]
    return np.concatenate(parts)


def _child_keys(cell_type: str, cells: IntegerArray, hashes: HashArray) -> HashArray:
    """(nc * children * k,) keys of the children's nodes: the same for all cells that share one."""
    return _keys(cell_type, cells, hashes, _child_nodes(cell_type)).ravel()


def _node_keys(cell_type: str, cells: IntegerArray, hashes: HashArray) -> HashArray:
    """(nc, k) keys of the cells' own nodes."""
    return _keys(cell_type, cells, hashes, shape.reference_nodes(cell_type))


def _keys(
    cell_type: str,
    cells: IntegerArray,
    hashes: HashArray,
    at: RealArray,
) -> HashArray:
    """(nc, q) sums of the corners' hashes with their whole-number weights at places (q, d) of the
    unit cell; a place on a facet knows its corners alone.
    """
    kind = shape.SHAPES[cell_type][0]
    weights, _ = shape.tabulate(kind, at)
    # weights of places in quarters are 64ths at most
    whole = np.rint(64 * weights).astype(np.uint64)
    corner = hashes[cells[:, : weights.shape[1]]]
    total = np.zeros((len(cells), len(at)), np.uint64)
    for i in range(weights.shape[1]):
        total += corner[:, i, None] * whole[:, i]
    return total


def _child_points(mesh: Mesh, cells: IntegerArray, first: IntegerArray) -> RealArray:
    """(n, 3) places of new nodes [m], of which ``first`` are numbers among the children's nodes of
    all cells.
    """
    values, _ = shape.tabulate(mesh.cell_type, _child_nodes(mesh.cell_type))
    cell, place = np.divmod(first, len(values))
    return np.asarray(np.einsum("nk,nkd->nd", values[place], mesh.points[cells[cell]]))


def _facets_inside(mesh: Mesh, cells: IntegerArray, nodes: IntegerArray) -> IntegerArray:
    """Outer facets (m, k) all of whose nodes are in a set."""
    outer = boundary_facets(cells, mesh.cell_type)
    return np.asarray(outer[np.isin(outer, nodes).all(axis=1)])


def _matched(mesh: Mesh, pair: Pair) -> Pair:
    """The pair with its new nodes; none where they were none."""
    if not pair.nodes.size:
        return pair
    names = (pair.master, pair.slave)
    return match_faces(
        mesh.points,
        mesh.faces,
        names,
        mesh.dimension,
        pair.rotation,
        pair.shift,
        MATCH_TOLERANCE,
    )

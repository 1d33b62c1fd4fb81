"""The cells of a body as they are solved, where its mesh is of tetrahedra, or of triangles in a
plane, that are pieces of cells of other shapes; and their facets, of which named triangles are
pieces too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bladefem.util.arrays import IntegerArray

from .mesh import Mesh
from .topology import CORNERS, FACETS, FAMILY, NODES, facet_nodes

# meshio's words of cells that may be mixed, by the dimension of the mesh; told apart by their
# numbers of nodes
WORDS = {
    2: ("triangle", "quad", "triangle6", "quad9"),
    3: (
        "tetra",
        "pyramid",
        "wedge",
        "hexahedron",
        "tetra10",
        "pyramid14",
        "wedge18",
        "hexahedron27",
    ),
}
# of a facet, by the number of its corners and its order
FACET_WORDS = {(3, 1): "triangle", (3, 2): "triangle6", (4, 1): "quad", (4, 2): "quad9"}


@dataclass(frozen=True)
class OwnCells:
    """Cells of one shape of one body."""

    # of the body
    name: str
    # meshio's
    word: str
    # (nc, k) nodes, gmsh's order
    cells: IntegerArray
    # (np,) rows of `Mesh.bodies` that are pieces of them, and (np,) of which one
    pieces: IntegerArray
    owner: IntegerArray


def padded_cells(blocks: Sequence[tuple[IntegerArray, IntegerArray]]) -> IntegerArray:
    """What `Mesh.whole` is of cells (nc, k) and their rows (np,), one a piece: (sum of all pieces,
    27) nodes, -1 beyond a cell's own.
    """
    width = NODES["hexahedron27"]
    padded = [
        np.pad(cells, [(0, 0), (0, width - cells.shape[1])], constant_values=-1)[rows]
        for cells, rows in blocks
    ]
    return np.vstack(padded)


def own_cells(mesh: Mesh, names: tuple[str, ...]) -> list[OwnCells]:
    """The cells of bodies by their shapes; those of the mesh itself where they are no pieces."""
    found = []
    for name in names:
        if name not in mesh.whole:
            rows = np.arange(len(mesh.bodies[name]))
            found.append(OwnCells(name, mesh.cell_type, mesh.bodies[name], rows, rows))
            continue
        first, owner = _distinct(mesh.whole[name])
        distinct = mesh.whole[name][first]
        count = (distinct >= 0).sum(axis=1)
        for word in WORDS[mesh.dimension]:
            nodes = NODES[word]
            some = count == nodes
            if not some.any():
                continue
            row = np.cumsum(some) - 1
            pieces = np.flatnonzero(some[owner])
            found.append(OwnCells(name, word, distinct[some, :nodes], pieces, row[owner[pieces]]))
    return found


def _distinct(rows: IntegerArray) -> tuple[IntegerArray, IntegerArray]:
    """(m,) the first of equal rows, ascending, and (n,) which of these each row is.

    By sums of the rows' numbers with random weights: sorting rows of 27 takes ten times as
    long, and 2^64 sums do not meet by chance.
    """
    weights = np.random.default_rng(0).integers(0, 2**64, rows.shape[1], dtype=np.uint64)
    keys = (rows.astype(np.uint64) * weights).sum(axis=1, dtype=np.uint64)
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    return first[order], place[number.ravel()]


def own_facets(
    mesh: Mesh,
    names: tuple[str, ...],
    facets: IntegerArray,
) -> tuple[dict[str, IntegerArray], IntegerArray]:
    """Facets of the cells as they are solved that facets (nf, k) of the mesh make up.

    Returns:
        word -> (m, k) nodes, each once; and (h, k) given facets that are half of a quadrilateral
        whose other half was not given.
    """
    word, order = _facet_word(mesh)
    if mesh.dimension == 2 or not any(name in mesh.whole for name in names):
        return {word: facets}, facets[:0]
    given = np.sort(facets[:, :3], axis=1)
    known: dict[str, IntegerArray] = {}
    used = np.zeros(len(facets), bool)
    for corners in (4, 3):
        own = _facets_with(mesh, names, corners)
        if not len(own):
            continue
        # each triangle of three corners, and which facet it is a part of
        left_out = range(corners) if corners == 4 else [None]
        keep = [[i for i in range(corners) if i != out] for out in left_out]
        parts = np.vstack([np.sort(own[:, some], axis=1) for some in keep])
        place = _found_rows(parts, given)
        hit = place >= 0
        number = np.where(hit, place % len(own), -1)
        halves = np.bincount(number[hit], minlength=len(own))
        full = halves == (2 if corners == 4 else 1)
        used |= hit & full[number]
        if full.any():
            known[FACET_WORDS[corners, order]] = own[full]
    return known, facets[~used]


def without_halves(mesh: Mesh, facets: IntegerArray) -> IntegerArray:
    """The facets (nf, k) but for those that are half of a quadrilateral whose other half is not
    among them.
    """
    if not mesh.whole:
        return facets
    _, halves = own_facets(mesh, tuple(mesh.bodies), facets)
    half = set(map(tuple, np.sort(halves, axis=1).tolist()))
    kept = [tuple(row) not in half for row in np.sort(facets, axis=1).tolist()]
    return facets[np.array(kept, bool)]


def quads_of_halves(mesh: Mesh, names: tuple[str, ...], halves: IntegerArray) -> IntegerArray:
    """(h, 4 or 9) the quadrilaterals of which triangles (h, k) are halves, the corners of each
    turned so that the half has the first three; looking the way they look from their first cell.
    """
    quads = _facets_with(mesh, names, 4)
    given = np.sort(halves[:, :3], axis=1)
    turned = np.empty((len(halves), quads.shape[1]), int)
    for out in range(4):
        # first the corner after the one that the half leaves out
        ring = (out + 1 + np.arange(4)) % 4
        place = _found_rows(np.sort(np.delete(quads[:, :4], out, axis=1), axis=1), given)
        hit = place >= 0
        columns = [*ring, *(4 + ring), 8] if quads.shape[1] > 4 else [*ring]
        turned[hit] = quads[place[hit]][:, columns]
    return turned


def _facet_word(mesh: Mesh) -> tuple[str, int]:
    """meshio's word of the facets of the mesh's own cells, and their order."""
    family = FAMILY[mesh.cell_type]
    order = 1 if NODES[mesh.cell_type] == CORNERS[family] else 2
    corners = len(FACETS[family][0])
    line = "line" if order == 1 else "line3"
    return (line if corners == 2 else FACET_WORDS[corners, order]), order


def _facets_with(mesh: Mesh, names: tuple[str, ...], corners: int) -> IntegerArray:
    """Facets (m, k) with so many corners of all cells, each once, with all their nodes."""
    found = []
    for own in own_cells(mesh, names):
        table = [
            nodes
            for facet, nodes in zip(FACETS[FAMILY[own.word]], facet_nodes(own.word), strict=True)
            if len(facet) == corners
        ]
        found += [own.cells[:, nodes] for nodes in table]
    if not found:
        return np.empty((0, corners), int)
    every = np.vstack(found)
    _, first = np.unique(np.sort(every[:, :corners], axis=1), axis=0, return_index=True)
    return np.asarray(every[first])


def _found_rows(rows: IntegerArray, wanted: IntegerArray) -> IntegerArray:
    """(m,) which of the distinct rows each wanted one is, -1 where it is none."""
    _, number = np.unique(np.vstack([rows, wanted]), axis=0, return_inverse=True)
    number = number.ravel()
    place = np.full(number.max() + 1, -1)
    place[number[: len(rows)]] = np.arange(len(rows))
    return np.asarray(place[number[len(rows) :]])

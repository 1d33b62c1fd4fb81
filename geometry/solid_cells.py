"""The solid cells of a file as cells of one type that the finite elements know.

Second order is the rule here: linear solids are far too stiff in bending (a blade of linear
tetrahedra vibrates at more than twice its frequency). Serendipity cells get the nodes in the middle
of their faces. Mixed shapes become tetrahedra, those of a plane triangles, of which each knows the
cell that it is a piece of.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bladefem.errors import InputError
from bladefem.util.arrays import IntegerArray, RealArray

from .raw_mesh import RawMesh
from .second_order_cells import COMPLETE_CELL, completed_cells
from .split_cells import split_cells, vertex_order
from .topology import CORNERS, DIMENSION, EDGES, FACETS, FAMILY, NODES
from .whole_cells import padded_cells


@dataclass(frozen=True)
class SolidCells:
    """All solid cells of a file (plane cells of a plane model), of one type."""

    # (n, 3) the file's points, new ones appended
    points: RealArray
    cell_type: str
    # (nc, k)
    cells: IntegerArray
    # (nc,) block of the file, and row of it, that each cell comes from
    block: IntegerArray
    row: IntegerArray
    # what was done to the cells, one sentence each
    notes: tuple[str, ...]
    # (nc, 27) nodes of the cell that each one is a piece of, -1 beyond its own; None where cells
    # are what they were
    whole: IntegerArray | None = None


def solid_cells(
    raw: RawMesh,
    source: str,
    linear: str,
    axis: np.ndarray,
) -> SolidCells:
    """The cells of the highest dimension.

    Args:
        linear: "refuse", "promote" to second order, or "keep".
        axis: engine axis; cells that are split are split alike on both cut faces.

    Raises:
        InputError: no cells, linear ones that are to be refused, mixtures that cannot be kept.
    """
    top = max((_dimension(word) for word, _ in raw.blocks), default=0)
    chosen = [
        b for b, (word, cells) in enumerate(raw.blocks) if _dimension(word) == top and len(cells)
    ]
    blocks = [raw.blocks[b] for b in chosen]
    if top < 2 or not blocks:
        raise InputError(
            f"imported.file = '{source}': cells are missing, expected tetrahedra, hexahedra, "
            "wedges or pyramids (triangles or quadrilaterals in a plane)"
        )
    points, blocks, notes = _of_wanted_order(raw.points, blocks, linear, source)
    words = {word for word, _ in blocks}
    whole: IntegerArray | None = None
    owner = [np.repeat(b, len(cells)) for b, (_, cells) in zip(chosen, blocks, strict=True)]
    row = [np.arange(len(cells)) for _, cells in blocks]
    if len(words) > 1 or (top == 3 and not words <= {"tetra", "tetra10", *_HEXAHEDRA}):
        simplex = "tetra" if top == 3 else "triangle"
        word, parts, whole = _as_simplices(simplex, points, blocks, vertex_order(points, axis))
        notes += (
            f"{_count_text(blocks)} are solved as they are; contacts and pictures see them split "
            f"into {_PLURALS.get(simplex, simplex + 's')}",
        )
        if word == "tetra":
            _check_facets(points, blocks, source)
        owner = [some[rows] for some, (_, rows) in zip(owner, parts, strict=True)]
        row = [rows for _, rows in parts]
        cells = np.vstack([cells for cells, _ in parts])
    else:
        word = words.pop()
        cells = np.vstack([cells for _, cells in blocks])
    _check_middles(points, word, cells, source)
    return SolidCells(
        points,
        word,
        cells,
        np.concatenate(owner),
        np.concatenate(row),
        notes,
        whole,
    )


def _dimension(word: str) -> int:
    """Of the cells of a block; 0 where they are none that can be solved."""
    return DIMENSION[FAMILY[word]] if word in FAMILY else 0


def _as_simplices(
    simplex: str,
    points: np.ndarray,
    blocks: list[tuple[str, np.ndarray]],
    rank: np.ndarray,
) -> tuple[str, list[tuple[np.ndarray, np.ndarray]], np.ndarray]:
    """What the cells of several kinds are split into.

    Args:
        simplex: "tetra" or "triangle".
        rank: of the points; of a quadrilateral the diagonal at its lowest one is taken.

    Returns:
        Type of the parts, for each block their nodes and the row of the cell that each comes from,
        and for each part the nodes of its whole cell.
    """
    parts = [split_cells(word, cells, rank, points) for word, cells in blocks]
    whole = padded_cells(
        [(cells, rows) for (_, cells), (_, rows) in zip(blocks, parts, strict=True)]
    )
    quadratic = any(NODES[word] > CORNERS[FAMILY[word]] for word, _ in blocks)
    return COMPLETE_CELL[simplex] if quadratic else simplex, parts, whole


_PLURALS = {"hexahedron": "hexahedra", "tetra": "tetrahedra", "quad": "quadrilaterals"}
_HEXAHEDRA = ("hexahedron", "hexahedron27")


def _of_wanted_order(
    points: np.ndarray,
    blocks: list[tuple[str, np.ndarray]],
    linear: str,
    source: str,
) -> tuple[np.ndarray, list[tuple[str, np.ndarray]], tuple[str, ...]]:
    """Points and blocks as they are to be solved with, and what was done."""
    first_order = [(word, cells) for word, cells in blocks if NODES[word] == CORNERS[FAMILY[word]]]
    if first_order and linear == "keep":
        if len(first_order) < len(blocks):
            raise InputError(
                f"imported.linear = 'keep': '{source}' mixes first and second order, expected "
                "'promote'"
            )
        return (
            points,
            blocks,
            (f"{_count_text(first_order)} are solved as they are: far too stiff",),
        )
    if first_order and linear != "promote":
        raise InputError(
            f"imported.file = '{source}': {_count_text(first_order)} of first order are far too "
            "stiff in bending, expected second-order cells; imported.linear = 'promote' adds nodes "
            "in the middle of their edges, 'keep' solves them as they are"
        )
    notes: tuple[str, ...] = ()
    if first_order:
        notes = (f"{_count_text(first_order)} were promoted to second order, edges straight",)
    return *completed_cells(points, blocks), notes


def _check_middles(
    points: np.ndarray,
    word: str,
    cells: np.ndarray,
    source: str,
) -> None:
    """Refuse two nodes in the middle of one edge, and one node in the middle of two edges or at a
    corner too: dolfinx crashes on them.

    They come from cells that share corners but not mid-side nodes, or from a quadrilateral that
    faces two triangles; the others from a wrong number in a file.
    """
    family = FAMILY[word]
    k = CORNERS[family]
    if NODES[word] == k:
        return
    ends = np.sort(cells[:, np.array(EDGES[family])].reshape(-1, 2), axis=1)
    middle = cells[:, k : k + len(EDGES[family])].ravel()
    _, first, number = np.unique(ends, axis=0, return_index=True, return_inverse=True)
    bad = np.flatnonzero(middle != middle[first[number.ravel()]])
    if len(bad):
        x, y, z = points[ends[bad[0]]].mean(axis=0)
        raise InputError(
            f"imported.file = '{source}': cells meet near {x:.6g}, {y:.6g}, {z:.6g} that do not "
            "fit (their edge has two nodes in its middle, or a quadrilateral faces two "
            "triangles), expected a conforming mesh with merged nodes"
        )
    pairs = np.unique(np.column_stack([middle, ends]), axis=0)
    nodes, edges = np.unique(pairs[:, 0], return_counts=True)
    twice = np.union1d(nodes[edges > 1], np.intersect1d(nodes, cells[:, :k]))
    if len(twice):
        x, y, z = points[twice[0]]
        raise InputError(
            f"imported.file = '{source}': the node at {x:.6g}, {y:.6g}, {z:.6g} is in the middle "
            "of two edges, or at a corner too, expected a node of its own for each edge"
        )


def _check_facets(points: np.ndarray, blocks: list[tuple[str, np.ndarray]], source: str) -> None:
    """Refuse a quadrilateral that faces triangles, of cells that have no nodes in their middles."""
    triangles = []
    halves = []
    for word, cells in blocks:
        for facet in FACETS[FAMILY[word]]:
            corners = np.sort(cells[:, facet], axis=1)
            if len(facet) == 3:
                triangles.append(corners)
            else:
                halves += [np.delete(corners, out, axis=1) for out in range(4)]
    if not triangles or not halves:
        return
    first, second = (np.unique(np.vstack(rows), axis=0) for rows in (triangles, halves))
    both, count = np.unique(np.vstack([first, second]), axis=0, return_counts=True)
    bad = both[count == 2]
    if len(bad):
        x, y, z = points[bad[0]].mean(axis=0)
        raise InputError(
            f"imported.file = '{source}': a quadrilateral faces triangles near {x:.6g}, {y:.6g}, "
            f"{z:.6g}, expected a conforming mesh"
        )


def _count_text(blocks: list[tuple[str, np.ndarray]]) -> str:
    """Such as "120 hexahedra and 4 wedges"."""
    count: dict[str, int] = {}
    for word, cells in blocks:
        family = FAMILY[word]
        count[family] = count.get(family, 0) + len(cells)
    return " and ".join(f"{n} {_PLURALS.get(name, name + 's')}" for name, n in count.items())

"""Displacements of third order that a mesh leaves out: functions that are zero at all its nodes.

Together with the shape functions of the cells they span the complete cubic polynomials of
triangles and tetrahedra, and the tensor products of these with lines for the other shapes. Each is
a product of the linear shape functions L of the corners of an edge, a facet or a cell, such as
La Lb (La - Lb) of an edge. On a facet these do not depend on the shape of the cell behind it, so
that cells of all shapes conform; only signs depend on the order in which a cell lists its corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from geometry.topology import CORNERS, EDGES, FACETS, FAMILY
from geometry.whole_cells import OwnCells

from ..util.arrays import BooleanArray, IntegerArray, RealArray
from .cell_functions import order_of, tabulate

# kinds of functions: on an edge, a triangle, a quadrilateral, where "cubic" tells along which of
# its two axes, and inside a cell
EDGE_SQUARE, EDGE_CUBIC, TRIANGLE, SQUARE, FIRST_CUBIC, SECOND_CUBIC, BOTH_CUBIC, INSIDE = range(8)
SQUARES = (EDGE_SQUARE, SQUARE)


@dataclass(frozen=True)
class _Product:
    """A function at some points."""

    # (q,)
    value: RealArray
    # (q, d) in the unit cell
    slope: RealArray

    def __mul__(self, other: _Product) -> _Product:
        slope = self.value[:, None] * other.slope + other.value[:, None] * self.slope
        return _Product(self.value * other.value, slope)

    def __add__(self, other: _Product) -> _Product:
        return _Product(self.value + other.value, self.slope + other.slope)

    def __sub__(self, other: _Product) -> _Product:
        return _Product(self.value - other.value, self.slope - other.slope)


# kind, corners, values
_Function: TypeAlias = "tuple[int, tuple[int, ...], _Product]"


@dataclass(frozen=True)
class CubicNumbers:
    """The functions of a body, each once."""

    # (nf, 4) corners that each belongs to, -1 beyond their number and for functions inside cells
    corners: IntegerArray
    # for each shape of cells: (nc * functions of a cell, nf) signs
    of_cells: list[sp.csr_matrix]


def cubic_functions(word: str, at: RealArray) -> tuple[RealArray, RealArray]:
    """Values (q, f) and gradients (q, f, d) at places (q, d) of the unit cell."""
    found = [function for *_, function in _functions(word, at)]
    values = np.stack([function.value for function in found], axis=1)
    return values, np.stack([function.slope for function in found], axis=1)


def number_functions(cells_by_shape: Sequence[OwnCells]) -> CubicNumbers:
    """Which functions the cells have in common."""
    keys = []
    signs = []
    first = 0
    for own in cells_by_shape:
        key, sign = _keys_of_cells(own, first)
        keys.append(key.reshape(-1, key.shape[2]))
        signs.append(sign.ravel())
        first += len(own.cells)
    every, number = np.unique(np.vstack(keys), axis=0, return_inverse=True)
    parts = np.split(number.ravel(), np.cumsum([len(key) for key in keys])[:-1])
    of_cells = [
        sp.csr_matrix((sign, (np.arange(len(part)), part)), shape=(len(part), len(every)))
        for sign, part in zip(signs, parts, strict=True)
    ]
    return CubicNumbers(np.where(every[:, :1] == INSIDE, -1, every[:, 1:]), of_cells)


def functions_on(corners: IntegerArray, nodes: BooleanArray) -> BooleanArray:
    """(nf,) whether all corners that functions belong to are among some nodes.

    Args:
        corners: of `CubicNumbers`.
        nodes: (n_points,).
    """
    inside = np.append(nodes, True)[corners].all(axis=1)
    return np.asarray(inside & (corners >= 0).any(axis=1))


def _functions(word: str, at: RealArray) -> list[_Function]:
    """Kind, corners and values of the functions that a cell's own do not contain."""
    family = FAMILY[word]
    values, slopes = tabulate(family, at)
    linear = [_Product(values[:, i], slopes[:, i]) for i in range(values.shape[1])]
    found: list[_Function] = []
    for a, b, *_ in EDGES[family]:
        bubble = linear[a] * linear[b]
        found.append((EDGE_SQUARE, (a, b), bubble))
        found.append((EDGE_CUBIC, (a, b), bubble * (linear[a] - linear[b])))
    for facet in _faces_of(family):
        found += _on_face(facet, [linear[corner] for corner in facet])
    found += [(INSIDE, (), function) for function in _inside(family, linear, at)]
    if order_of(word) == 1:
        return found
    # cells of second order have the squares, of which a hexahedron has one inside
    without = [function for function in found if function[0] not in SQUARES]
    inside = [function for function in without if function[0] == INSIDE]
    return [f for f in without if f[0] != INSIDE] + inside[1 if family == "hexahedron" else 0 :]


def _faces_of(family: str) -> Sequence[tuple[int, ...]]:
    """Corners of the faces of a cell; a plane cell is one."""
    flat = family in ("triangle", "quad")
    return [tuple(range(CORNERS[family]))] if flat else FACETS[family]


def _on_face(facet: tuple[int, ...], linear: list[_Product]) -> list[_Function]:
    """Functions of a triangle or a quadrilateral, of the linear functions of its corners."""
    if len(facet) == 3:
        return [(TRIANGLE, facet, linear[0] * linear[1] * linear[2])]
    a, b, c, d = linear
    bubble = a * c
    return [
        (SQUARE, facet, bubble),
        (FIRST_CUBIC, facet, bubble * (a + d - b - c)),
        (SECOND_CUBIC, facet, bubble * (a + b - c - d)),
        (BOTH_CUBIC, facet, bubble * (a + c - b - d)),
    ]


def _inside(family: str, linear: list[_Product], at: RealArray) -> list[_Product]:
    """Functions that are zero on all facets; of a hexahedron first the square one."""
    one = _Product(np.ones(len(at)), np.zeros_like(at))
    if family == "hexahedron":
        bubble = linear[0] * linear[6]
        x, y, z = (_falling(at, axis) for axis in range(3))
        return [bubble * factor for factor in (one, x, y, z, x * y, y * z, z * x, x * y * z)]
    if family == "wedge":
        a, b, c = (linear[i] + linear[i + 3] for i in range(3))
        height = _falling(at, 2)
        bubble = a * b * c * (one - height * height)
        return [bubble, bubble * height]
    if family == "pyramid":
        return [linear[0] * linear[2] * linear[4]]
    return []


def _falling(at: RealArray, axis: int) -> _Product:
    """From 1 to -1 along an axis of the unit cell."""
    slope = np.zeros_like(at)
    slope[:, axis] = -2.0
    return _Product(1 - 2 * at[:, axis], slope)


@cache
def _kinds(word: str) -> list[tuple[int, tuple[int, ...]]]:
    """Kind and corners of the functions of a cell."""
    centre = np.full((1, 2 if FAMILY[word] in ("triangle", "quad") else 3), 0.2)
    return [(kind, corners) for kind, corners, _ in _functions(word, centre)]


def _keys_of_cells(own: OwnCells, first: int) -> tuple[IntegerArray, RealArray]:
    """(nc, f, 5) kind and corners, the same in all cells that share a function, and (nc, f) signs.

    Args:
        first: number of the first cell.
    """
    kinds = _kinds(own.word)
    key = np.full((len(own.cells), len(kinds), 5), -1)
    sign = np.ones(key.shape[:2])
    for i, (kind, corners) in enumerate(kinds):
        key[:, i, 0] = kind
        nodes = own.cells[:, list(corners)]
        if kind == INSIDE:
            # no other cell has it
            key[:, i, 1] = first + np.arange(len(own.cells))
            key[:, i, 2] = i
            continue
        key[:, i, 1 : 1 + nodes.shape[1]] = np.sort(nodes, axis=1)
        if kind == EDGE_CUBIC:
            sign[:, i] = np.where(nodes[:, 0] < nodes[:, 1], 1.0, -1.0)
        if kind in (FIRST_CUBIC, SECOND_CUBIC, BOTH_CUBIC):
            key[:, i, 0], sign[:, i] = _turned(kind, nodes)
    return key, sign


def _turned(kind: int, nodes: IntegerArray) -> tuple[IntegerArray, RealArray]:
    """Kind and sign of a function of quadrilaterals (nc, 4) whose axes begin at the corner of the
    smallest number, the first towards the smaller of its neighbours.
    """
    start = nodes.argmin(axis=1)
    rows = np.arange(len(nodes))
    after = nodes[rows, (start + 1) % 4]
    before = nodes[rows, start - 1]
    first_sign = np.where((start == 1) | (start == 2), -1.0, 1.0)
    second_sign = np.where(start >= 2, -1.0, 1.0)
    if kind == BOTH_CUBIC:
        return np.full(len(nodes), kind), first_sign * second_sign
    # sides 0-1 and 2-3 run along the cell's first axis
    kept = (after < before) == (start % 2 == 0)
    other = SECOND_CUBIC if kind == FIRST_CUBIC else FIRST_CUBIC
    return np.where(kept, kind, other), first_sign if kind == FIRST_CUBIC else second_sign

"""Shape functions and quadrature of the cells as they are solved: `shape_functions`, and those of
wedges and pyramids, which are hexahedra with nodes drawn together (`mixed_cells`).

Unit cells: a wedge is the triangle x, y >= 0, x + y <= 1 times 0 <= z <= 1, a pyramid 0 <= x, y <=
1 - z. The hexahedron whose nodes are drawn together has the coordinates x / (1 - y), y, z and
x / (1 - z), y / (1 - z), z.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from geometry.topology import CORNERS, FAMILY, NODES

from ..util.arrays import RealArray
from . import shape_functions as shape
from .mixed_cells import HEXAHEDRON_OF, drawn_nodes

UNIT_CORNERS: dict[str, list[tuple[int, int, int]]] = {
    "wedge": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)],
}


def is_drawn(word: str) -> bool:
    """Whether a cell's nodes are those of a hexahedron drawn together."""
    return word in HEXAHEDRON_OF


def order_of(word: str) -> int:
    """1 or 2, of a cell given by meshio's word."""
    return 1 if NODES[word] == CORNERS[FAMILY[word]] else 2


@cache
def reference_nodes(word: str) -> RealArray:
    """(k, d) nodes in the unit cell."""
    if not is_drawn(word):
        return np.asarray(shape.reference_nodes(word))
    family = FAMILY[word]
    return straight_nodes(word, np.array(UNIT_CORNERS[family], float))


def straight_nodes(word: str, corner: RealArray) -> RealArray:
    """(k, d) nodes of a straight cell by its corners; quadrilaterals are parallelograms."""
    return corner if order_of(word) == 1 else shape.second_order_nodes(FAMILY[word], corner)


def tabulate(word: str, at: RealArray) -> tuple[RealArray, RealArray]:
    """Values (q, k) and gradients (q, k, d) of the shape functions at places (q, d) of the unit
    cell; gradients where nodes are drawn together are not defined.
    """
    if not is_drawn(word):
        return shape.tabulate(word, at)
    x, y, z = at.T
    # the coordinate that shrinks the others; at its end these are zero as well
    shrinking = 1 if FAMILY[word] == "wedge" else 2
    left = 1 - at[:, shrinking]
    safe = np.where(left > 0, left, 1.0)
    drawn = [x / safe, y, z] if shrinking == 1 else [x / safe, y / safe, z]
    cube, slope = shape.tabulate(HEXAHEDRON_OF[word], np.column_stack(drawn))
    # (q, 3, 3) of the hexahedron's coordinates by the unit cell's
    change = np.tile(np.eye(3), (len(at), 1, 1))
    for i in range(shrinking):
        change[:, i, i] = 1 / safe
        change[:, i, shrinking] = drawn[i] / safe
    T = drawn_nodes(word)
    return cube @ T, np.einsum("qmi,mk,qij->qkj", slope, T, change, optimize=True)


@cache
def quadrature(family: str, degree: int) -> tuple[RealArray, RealArray]:
    """Places (q, d) and weights (q,) exact for polynomials of the degree on the unit cell."""
    if family == "wedge":
        return product_rule(shape.quadrature("triangle", degree), shape.quadrature("line", degree))
    if family == "pyramid":
        return pyramid_rule(degree // 2 + 1)
    return shape.quadrature(family, degree)


def product_rule(
    flat: tuple[RealArray, RealArray], line: tuple[RealArray, RealArray]
) -> tuple[RealArray, RealArray]:
    """Places and weights on the unit wedge, of those on its triangle and along its height."""
    at = np.array([(*a, *z) for a, z in product(flat[0], line[0])])
    return at, (flat[1][:, None] * line[1]).ravel()


def few_points(family: str) -> tuple[RealArray, RealArray]:
    """Places and weights exact to degree 5 on simplices, to 6 on other shapes; in a tetrahedron 14
    (Walkington 2000, CMU Center for Nonlinear Analysis, 00-CNA-023) in place of 27.
    """
    if family != "tetra":
        return quadrature(family, 5 if family == "triangle" else 6)
    corners = np.eye(4)
    near = [0.31088591926330060980, 0.092735250310891226402]
    places = [share + (1 - 4 * share) * corners for share in near]
    edges = np.array([corners[i] + corners[j] for i in range(4) for j in range(i)])
    places.append(0.045503704125649649492 + (0.5 - 2 * 0.045503704125649649492) * edges)
    weights = [0.11268792571801585080, 0.073493043116361949544, 0.042546020777081466438]
    return np.vstack(places)[:, 1:], np.repeat(weights, [4, 4, 6]) / 6


def pyramid_rule(n: int) -> tuple[RealArray, RealArray]:
    """n**3 places and weights exact for polynomials of degree 2 n - 1 on the unit pyramid."""
    side, width = shape.gauss_rule(n, 0)
    high, height = shape.gauss_rule(n, 2)
    at = np.array([(x * (1 - z), y * (1 - z), z) for z, y, x in product(high, side, side)])
    return at, np.array([np.prod(w) for w in product(height, width, width)])


def geometry(word: str, x: RealArray, degree: int) -> tuple[RealArray, RealArray, RealArray]:
    """Quadrature on curved cells, see `shape_functions.geometry`.

    Args:
        x: (nc, k, g) node coordinates.

    Returns:
        values (q, k), tangents (nc, q, g, d), reference weights (q,).
    """
    at, w = quadrature(FAMILY[word], degree)
    values, gradients = tabulate(word, at)
    # (nc, g, q, d)
    tangents = np.asarray(np.tensordot(x, gradients, axes=([1], [1])), float)
    return values, tangents.transpose(0, 2, 1, 3), w

"""Lagrange shape functions and quadrature in NumPy, nodes in gmsh's order: loads, volumes, checks
and stresses.

Shape functions come from the nodes alone: monomials at the nodes, inverted. Simplices use rules
collapsed from the cube (Gauss-Jacobi, Stroud and Secrest 1966), so any degree is at hand.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
from scipy.special import roots_jacobi

from geometry.topology import EDGES, QUADS

# meshio's word: (shape, degree). quad8 and hexahedron20 are read but have no dolfinx twin.
SHAPES = {
    "line": ("line", 1),
    "line3": ("line", 2),
    "triangle": ("triangle", 1),
    "triangle6": ("triangle", 2),
    "quad": ("quad", 1),
    "quad9": ("quad", 2),
    "tetra": ("tetra", 1),
    "tetra10": ("tetra", 2),
    "hexahedron": ("hexahedron", 1),
    "hexahedron27": ("hexahedron", 2),
}
FACET_OF = {
    "triangle": "line",
    "triangle6": "line3",
    "quad": "line",
    "quad9": "line3",
    "tetra": "triangle",
    "tetra10": "triangle6",
    "hexahedron": "quad",
    "hexahedron27": "quad9",
}

_CORNERS: dict[str, list[tuple[int, ...]]] = {
    "line": [(0,), (1,)],
    "triangle": [(0, 0), (1, 0), (0, 1)],
    "quad": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "tetra": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "hexahedron": [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (0, 0, 1),
        (1, 0, 1),
        (1, 1, 1),
        (0, 1, 1),
    ],
}


def corner_count(cell_type: str) -> int:
    """Number of corner nodes of an element type; they come first."""
    return len(_CORNERS[SHAPES[cell_type][0]])


@cache
def reference_nodes(cell_type: str) -> np.ndarray:
    """(k, d) reference coordinates of the nodes, unit cell from 0 to 1."""
    shape, degree = SHAPES[cell_type]
    corner = np.array(_CORNERS[shape], float)
    return corner if degree == 1 else second_order_nodes(shape, corner)


def second_order_nodes(family: str, corner: np.ndarray) -> np.ndarray:
    """(k, d) nodes of a straight second-order cell by its corners (c, d): these, then the middles
    of edges, of quadrilaterals and of a hexahedron.
    """
    groups = [*EDGES[family], *QUADS.get(family, [])]
    middle = [corner[list(group)].mean(axis=0) for group in groups]
    centre = [corner.mean(axis=0)] if family == "hexahedron" else []
    return np.array([*corner, *middle, *centre])


@cache
def _polynomial_basis(cell_type: str) -> tuple[np.ndarray, np.ndarray]:
    """Exponents (k, d) of the monomials and their coefficients (k, k) in each shape function's
    column.
    """
    shape, degree = SHAPES[cell_type]
    at = reference_nodes(cell_type)
    exponents = np.array(
        [
            e
            for e in product(range(degree + 1), repeat=at.shape[1])
            if shape in ("line", "quad", "hexahedron") or sum(e) <= degree
        ]
    )
    return exponents, np.linalg.inv(np.prod(at[:, None, :] ** exponents, axis=2))


def tabulate(cell_type: str, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (q, k) and reference gradients (q, k, d) of the shape functions at x (q, d)."""
    exponents, coefficients = _polynomial_basis(cell_type)
    d = x.shape[1]
    values = np.prod(x[:, None, :] ** exponents, axis=2) @ coefficients
    gradients = np.empty((*values.shape, d))
    for i in range(d):
        lowered = exponents - np.eye(d, dtype=int)[i]
        terms = np.prod(x[:, None, :] ** np.maximum(lowered, 0), axis=2) * exponents[:, i]
        gradients[:, :, i] = terms @ coefficients
    return values, gradients


@cache
def quadrature(shape: str, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (q, d) and weights (q,) exact for polynomials of the degree on the unit cell."""
    d = len(_CORNERS[shape][0])
    n = degree // 2 + 1
    simplex = shape in ("triangle", "tetra")
    lines = [gauss_rule(n, d - 1 - i if simplex else 0) for i in range(d)]
    x = np.array(list(product(*[line[0] for line in lines])))
    w = np.array([np.prod(c) for c in product(*[line[1] for line in lines])])
    if simplex:
        left = np.ones(len(x))
        for i in range(d):
            x[:, i] *= left
            left = left - x[:, i]
    return x, w


def gauss_rule(n: int, power: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss rule on (0, 1) for the weight (1 - x)^power."""
    x, w = roots_jacobi(n, power, 0)
    return (x + 1) / 2, w / 2 ** (power + 1)


def geometry(
    cell_type: str,
    x: np.ndarray,
    degree: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quadrature on curved elements or faces.

    Args:
        x: (nc, k, g) node coordinates; g may exceed the element's own dimension (faces).

    Returns:
        values (q, k) of the shape functions, tangents (nc, q, g, d) dx/dxi, reference weights (q,).
    """
    at, w = quadrature(SHAPES[cell_type][0], degree)
    values, gradients = tabulate(cell_type, at)
    # (nc, g, q, d)
    tangents = np.tensordot(x, gradients, axes=([1], [1]))
    return values, tangents.transpose(0, 2, 1, 3), w

"""Jacobian determinants of cells: proven bounds for second-order simplices by Bernstein
coefficients.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from math import factorial

import numpy as np

from .topology import EDGES


def straight_jacobian(
    points: np.ndarray,
    cells: np.ndarray,
    cell_type: str,
) -> np.ndarray:
    """Jacobian determinant (nc,) of the cell spanned by its corners; the smallest corner value for
    quads and hexes.
    """
    if cell_type.startswith(("tetra", "triangle")):
        return _simplex_volume(points[cells])
    by_family: dict[str, list[tuple[int, ...]]] = {
        "q": [(0, 1, 3), (1, 2, 0), (2, 3, 1), (3, 0, 2)],
        "h": [
            (0, 1, 3, 4),
            (1, 2, 0, 5),
            (2, 3, 1, 6),
            (3, 0, 2, 7),
            (4, 7, 5, 0),
            (5, 4, 6, 1),
            (6, 5, 7, 2),
            (7, 6, 4, 3),
        ],
    }
    corners = by_family[cell_type[0]]
    return np.min([_simplex_volume(points[cells[:, c]]) for c in corners], axis=0)


def _simplex_volume(x: np.ndarray) -> np.ndarray:
    """Determinant of the edges at the first corner; x is (nc, >= 3, 3) for triangles, (nc, >= 4, 3)
    for tetrahedra.
    """
    if x.shape[1] in (3, 6):
        a = x[:, 1] - x[:, 0]
        b = x[:, 2] - x[:, 0]
        return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.linalg.det(x[:, 1:4] - x[:, :1])


def scaled_jacobian(
    points: np.ndarray,
    cells: np.ndarray,
    cell_type: str,
) -> np.ndarray:
    """Lower bound (nc,) of the Jacobian determinant over that of the straight cell: 1 when
    straight, <= 0 unsafe.

    For second-order triangles and tetrahedra the determinant is a polynomial of degree 2 and 3; its
    smallest Bernstein coefficient bounds it from below (Johnen et al.,
    doi:10.1016/j.jcp.2012.08.051). For quads and hexes the smallest corner value over the mean of
    the corners is returned.
    """
    straight = straight_jacobian(points, cells, cell_type)
    if cell_type in ("tetra", "triangle"):
        return np.sign(straight)
    if cell_type in ("tetra10", "triangle6"):
        dim = 3 if cell_type == "tetra10" else 2
        gradients, transform = _bernstein_basis(dim)
        x = points[cells][:, :, :dim]
        edges = np.einsum("qkd,nki->nqid", gradients, x, optimize=True)
        return (np.linalg.det(edges) @ transform.T).min(axis=1) / np.abs(straight)
    size = np.abs(points[cells[:, : 8 if cell_type[0] == "h" else 4]] - points[cells[:, :1]]).max(
        axis=(1, 2)
    )
    return straight / size ** (3 if cell_type[0] == "h" else 2)


@cache
def _bernstein_basis(dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Gradients of the second-order shape functions (q, k, dim) at q points, and values ->
    coefficients (q, q).
    """
    degree = dim
    exponents = np.array(
        [e for e in product(range(degree + 1), repeat=dim + 1) if sum(e) == degree]
    )
    barycentric = exponents / degree
    multinomial = factorial(degree) / np.prod(np.vectorize(factorial)(exponents), axis=1)
    values = multinomial * np.prod(barycentric[:, None, :] ** exponents[None], axis=2)
    # gradients of the barycentric coordinates
    slope = np.vstack([-np.ones(dim), np.eye(dim)])
    corner = (4 * barycentric - 1)[:, :, None] * slope
    middle = [
        4 * (barycentric[:, [a]] * slope[b] + barycentric[:, [b]] * slope[a])
        for a, b in EDGES["tetra" if dim == 3 else "triangle"]
    ]
    return np.concatenate([corner, np.stack(middle, axis=1)], axis=1), np.linalg.inv(values)

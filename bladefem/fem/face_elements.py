"""Shape functions and quadrature of face elements, lines to quadrilaterals, in gmsh's node
order.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# (dimension, nodes): corners
CORNERS = {(2, 2): 2, (2, 3): 2, (3, 3): 3, (3, 6): 3, (3, 4): 4, (3, 8): 4, (3, 9): 4}


def corner_count(dimension: int, nodes: int) -> int:
    """Corners of a face with so many nodes, in a plane (2) or solid (3) mesh."""
    return CORNERS[dimension, nodes]


def face_quadrature(corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Reference points (q, d) and weights (q,), exact to degree 5: lines and squares on (-1, 1),
    unit triangle.
    """
    x, w = np.polynomial.legendre.leggauss(3)
    if corners == 2:
        return x[:, None], w
    if corners == 4:
        return np.array([(a, b) for a in x for b in x]), np.outer(w, w).ravel()
    # seven points of Radon 1948
    s = np.sqrt(15.0)
    a = (6 - s) / 21
    b = (6 + s) / 21
    points = [
        (1 / 3, 1 / 3),
        (a, a),
        (1 - 2 * a, a),
        (a, 1 - 2 * a),
        (b, b),
        (1 - 2 * b, b),
        (b, 1 - 2 * b),
    ]
    return np.array(points), np.array([9 / 80] + [(155 - s) / 2400] * 3 + [(155 + s) / 2400] * 3)


def traction_shape(corners: int, points: np.ndarray) -> np.ndarray:
    """Values (q, k) of the functions that carry the traction of the corners: they sum to 1 and have
    the hats' areas.

    They are a third hat function and two thirds its dual (biorthogonal) function.
    """
    if corners == 4:
        a = traction_shape(2, points[:, :1])
        b = traction_shape(2, points[:, 1:])
        i, j = ((SQUARE[:4] + 1) // 2).T
        return a[:, i] * b[:, j]
    hats = LINEAR[corners](points)[0]
    dual = corners * hats - (1 - hats)
    return (hats + 2 * dual) / 3


def face_shape_functions(
    nodes: int,
    corners: int,
    points: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Values (q, k) and gradients (q, k, d) of the face's own shape functions, order 1 or 2."""
    if nodes == corners:
        return LINEAR[corners](points)
    return QUADRATIC[nodes](points)


def _line_2(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    s = x[:, 0]
    return np.stack([(1 - s) / 2, (1 + s) / 2], 1), np.tile([[[-0.5], [0.5]]], (len(x), 1, 1))


def _line_3(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    s = x[:, 0]
    return (
        np.stack([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s * s], 1),
        np.stack([s - 0.5, s + 0.5, -2 * s], 1)[:, :, None],
    )


def _triangle_3(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r, s = x.T
    return np.stack([1 - r - s, r, s], 1), np.tile(
        [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]], (len(x), 1, 1)
    )


def _triangle_6(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    L, dL = _triangle_3(x)
    N = [L[:, i] * (2 * L[:, i] - 1) for i in range(3)]
    dN = [(4 * L[:, i : i + 1] - 1) * dL[:, i] for i in range(3)]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        N.append(4 * L[:, i] * L[:, j])
        dN.append(4 * (L[:, i : i + 1] * dL[:, j] + L[:, j : j + 1] * dL[:, i]))
    return np.stack(N, 1), np.stack(dN, 1)


SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)])


def _tensor_product(
    values: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    order: np.ndarray,
    x: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Products of one-dimensional functions; order (k, 2) is the pair that each node takes."""
    (A, dA), (B, dB) = values(x[:, :1]), values(x[:, 1:])
    i, j = order.T
    N = A[:, i] * B[:, j]
    return N, np.stack([dA[:, i, 0] * B[:, j], A[:, i] * dB[:, j, 0]], 2)


def _square_4(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return _tensor_product(_line_2, (SQUARE[:4] + 1) // 2, x)


def _square_9(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # -1, 0, 1 -> nodes 0, 2, 1 of the line
    return _tensor_product(_line_3, np.array([0, 2, 1])[SQUARE + 1], x)


def _square_8(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Serendipity: the nine-node functions with the centre spread so that quadratics survive."""
    N, dN = _square_9(x)
    spread = np.array([-0.25] * 4 + [0.5] * 4)
    return N[:, :8] + N[:, 8:] * spread, dN[:, :8] + dN[:, 8:] * spread[:, None]


LINEAR = {2: _line_2, 3: _triangle_3, 4: _square_4}
QUADRATIC = {3: _line_3, 6: _triangle_6, 8: _square_8, 9: _square_9}

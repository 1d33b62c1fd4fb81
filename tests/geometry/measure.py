"""Integrals over meshes by plain quadrature, independent of the Bernstein code."""

import numpy as np

from geometry.topology import EDGES

KEAST = [
    (np.array([[0.25] * 4]), -4 / 5),  # degree 3
    (np.full((4, 4), 1 / 6) + np.eye(4) / 3, 9 / 20),
]


def jacobians(points, cells, barycentric):
    """Determinants (nc, q) of second-order tetrahedra at barycentric points, by differences along
    the axes.
    """
    slope = np.vstack([-np.ones(3), np.eye(3)])
    result = []
    for L in barycentric:
        gradient = [(4 * L[i] - 1) * slope[i] for i in range(4)]
        gradient += [4 * (L[a] * slope[b] + L[b] * slope[a]) for a, b in EDGES["tetra"]]
        result.append(np.linalg.det(np.einsum("kd,nki->nid", np.array(gradient), points[cells])))
    return np.array(result).T


def volume(points, cells):
    """Volume [m^3] of second-order tetrahedra, exact for them (their Jacobian is of degree 3)."""
    return sum(weight * jacobians(points, cells, where).sum() for where, weight in KEAST) / 6

"""One real residual flexibility for all harmonics, and what each harmonic adds to it in one real
basis.

Sectors have other flexibilities in each nodal diameter. What the disc and the neighbours add to a
contact differs with the diameter, what the platform yields under the contact itself does not: the
differences are smooth, and of low rank however fine the contact mesh is (70 of 378 at 1e-10 on the
shipped wedge, whose modes are among them). With a real matrix R (m, m), a real basis V (m, q), the
differences E_h (q, q) and the modes' shapes P_h (q, M) in it,

    G_h = R + V (E_h + P_h D_h P_h^H) V^T.

Bodies that are the same for all harmonics are the case E_h = 0. The basis comes from products with
random vectors (Halko, Martinsson and Tropp 2011, DOI 10.1137/090771806, Alg. 4.2), here in blocks
until nothing is left.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ...util.arrays import ComplexArray, RealArray
from .. import policy

# what is left out of the differences, over the largest entry of the residual flexibility
DIFFERENCES_LEFT_OUT = 1e-11
# the same of shapes, over their own size: modes near their resonance magnify it
SHAPES_LEFT_OUT = 1e-13
# random vectors of a block
PROBES = 16


@dataclass(frozen=True)
class CommonBasis:
    """m contact degrees of freedom, q vectors, M modes; S = H+1, or 1 for all harmonics."""

    # (m, m) residual flexibility for all harmonics [m/N]
    residual: RealArray
    # (m, q) V
    vectors: RealArray
    # (S, q, q) E
    differences: ComplexArray
    # (S, q, M) P
    shapes: ComplexArray


def common_basis(residual: np.ndarray, shapes: np.ndarray) -> CommonBasis | None:
    """From the residual flexibilities (1 or S, m, m) and shapes (1 or S, m, M) of the harmonics;
    None where there are few degrees of freedom, or where they are not many for the basis.
    """
    dofs = residual.shape[1]
    most = policy.shared_basis_size(dofs)
    if not most or shapes.shape[2] > most:
        return None
    common = np.ascontiguousarray(residual[min(1, len(residual) - 1)].real)
    differences = [matrix - common for matrix in residual]
    scale = abs(common).max()
    generator = np.random.default_rng(0)

    def seen(matrices: Iterable[np.ndarray]) -> RealArray:
        probes = generator.standard_normal((dofs, PROBES))
        return np.hstack([part for matrix in matrices for part in _parts(matrix @ probes)])

    vectors = np.zeros((dofs, 0))
    for one in shapes:
        vectors = _added(vectors, np.hstack(_parts(one)), SHAPES_LEFT_OUT)
    distinct = [matrix for matrix in differences[1:] or differences if matrix.any()]
    while distinct and vectors.shape[1] <= most:
        more = _added(vectors, seen(distinct), DIFFERENCES_LEFT_OUT, scale)
        if more.shape[1] == vectors.shape[1]:
            break
        vectors = more
    if vectors.shape[1] > most:
        return None
    across = np.ascontiguousarray(vectors.T)
    return CommonBasis(
        common,
        np.ascontiguousarray(vectors),
        _for_all([across @ matrix @ vectors for matrix in differences], len(shapes)),
        _for_all([across @ one for one in shapes], len(residual)),
    )


def _for_all(parts: list[np.ndarray], count: int) -> ComplexArray:
    """One for each of as many harmonics as there are in all."""
    stack = np.array(parts, dtype=complex)
    return np.repeat(stack, max(len(stack), count) // len(stack), axis=0)


def _parts(matrix: np.ndarray) -> list[RealArray]:
    """The real part, and the imaginary one where there is one."""
    if np.iscomplexobj(matrix) and matrix.imag.any():
        return [matrix.real, matrix.imag]
    return [matrix.real]


def _added(
    vectors: RealArray,
    columns: RealArray,
    left_out: float,
    scale: float | None = None,
) -> RealArray:
    """The orthonormal vectors (m, q) with those that further columns (m, k) need: what is left of
    the columns is below a share of a scale, by default of their own size.
    """
    size = abs(columns).max(initial=0.0) if scale is None else scale
    # twice: the first time leaves rounding of the size of the columns
    for _ in range(2):
        columns = columns - vectors @ (vectors.T @ columns)
    found, sizes, _ = linalg.svd(columns, full_matrices=False)
    new = found[:, sizes > left_out * size * np.sqrt(len(columns))]
    for _ in range(2):
        new = new - vectors @ (vectors.T @ new)
    return np.hstack([vectors, linalg.qr(new, mode="economic")[0]])

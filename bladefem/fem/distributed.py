"""Sparse matrices between SciPy and PETSc, row by row as the ranks own them."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from .body import Body
from .compat import PETSc


def rows_of_rank(body: Body) -> np.ndarray:
    """Displacements in mesh numbering that this rank owns, in PETSc's order of rows."""
    first, last = body.K.owner_range
    outside = np.count_nonzero(body.scalar_rows < 0)
    return np.asarray(np.argsort(body.scalar_rows, kind="stable")[outside:][first:last])


def to_petsc(
    body: Body,
    T: sp.csr_matrix,
    start: np.ndarray,
) -> PETSc.Mat:
    """Rows of T (n_points*dim, n) that this rank owns, in PETSc's row order.

    Args:
        start: (ranks+1,) first column of each rank.
    """
    rank = body.comm.rank
    mine = T[rows_of_rank(body)]
    mine.sum_duplicates()
    size = (
        (mine.shape[0], body.K.size[0]),
        (int(start[rank + 1] - start[rank]), T.shape[1]),
    )
    matrix = PETSc.Mat().createAIJ(
        size,
        csr=(mine.indptr.astype(PETSc.IntType), mine.indices.astype(PETSc.IntType), mine.data),
        comm=body.comm,
    )
    matrix.assemble()
    return matrix


def local_rows(A: PETSc.Mat) -> sp.csr_matrix:
    """This rank's rows."""
    indptr, indices, data = A.getValuesCSR()
    return sp.csr_matrix((data, indices, indptr), shape=(len(indptr) - 1, A.size[1]))

"""Sparse matrices between SciPy and PETSc, row by row as the ranks own them."""

from __future__ import annotations

import ctypes

import numpy as np
import scipy.sparse as sp

from .body import Body
from .compat import PETSc
from .mumps import petsc_call


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


def shared_rows(A: PETSc.Mat) -> sp.csr_matrix | None:
    """The matrix of one rank on PETSc's own memory, not to be written to, valid as long as it is;
    None where PETSc keeps it in another form.
    """
    if A.getType() != "seqaij":
        return None
    n, done = ctypes.c_int64(), ctypes.c_int()
    number = ctypes.c_int64 if np.dtype(PETSc.IntType).itemsize == 8 else ctypes.c_int32
    starts, columns = ctypes.POINTER(number)(), ctypes.POINTER(number)()
    values = ctypes.POINTER(ctypes.c_double)()
    by = ctypes.byref
    petsc_call("MatGetRowIJ", A.handle, 0, 0, 0, by(n), by(starts), by(columns), by(done))
    if not done.value:
        return None
    petsc_call("MatSeqAIJGetArrayRead", A.handle, by(values))
    indptr = np.ctypeslib.as_array(starts, (A.size[0] + 1,))
    count = int(indptr[-1])
    parts = (
        np.ctypeslib.as_array(values, (count,)),
        np.ctypeslib.as_array(columns, (count,)),
        indptr,
    )
    for part in parts:
        part.flags.writeable = False
    # forgets the pointers, not the memory
    petsc_call("MatSeqAIJRestoreArrayRead", A.handle, by(values))
    petsc_call("MatRestoreRowIJ", A.handle, 0, 0, 0, by(n), by(starts), by(columns), by(done))
    return sp.csr_matrix(parts, shape=A.size)

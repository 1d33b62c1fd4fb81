"""LU factors for compiled loops, small and large; LAPACK's calls take longer than a tiny matrix."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL

# columns of a block
BLOCK_COLUMNS = 32


@njit(**KERNEL)
def factorise_small(M, pivots):
    """LU factors in place with partial pivoting; False where a pivot is zero."""
    return _eliminate_columns(M, pivots, 0, M.shape[0])


@njit(**INNER_KERNEL)
def _eliminate_columns(M, pivots, low, high):
    """Columns low to high of such factors, rows exchanged as a whole; False where a pivot is
    zero.
    """
    size = M.shape[0]
    for k in range(low, high):
        best = k
        for i in range(k + 1, size):
            if abs(M[i, k]) > abs(M[best, k]):
                best = i
        pivots[k] = best
        if not abs(M[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(size):
                M[k, j], M[best, j] = M[best, j], M[k, j]
        for i in range(k + 1, size):
            factor = M[i, k] / M[k, k]
            M[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, high):
                    M[i, j] -= factor * M[k, j]
    return True


@njit(**KERNEL)
def factorise_large(M, pivots):
    """The same for a contiguous real matrix, in blocks of columns: most of the work is one matrix
    product a block.
    """
    size = M.shape[0]
    for low in range(0, size, BLOCK_COLUMNS):
        high = min(low + BLOCK_COLUMNS, size)
        if not _eliminate_columns(M, pivots, low, high):
            return False
        for k in range(low, high if high < size else low):
            for i in range(k + 1, high):
                factor = M[i, k]
                for j in range(high, size):
                    M[i, j] -= factor * M[k, j]
        if high < size:
            left = np.ascontiguousarray(M[high:, low:high])
            right = np.ascontiguousarray(M[low:high, high:])
            _subtract_matrix(np.dot(left, right), M[high:, high:])
    return True


@njit(cache=True, error_model="numpy", inline="always")
def _subtract_matrix(part, target):
    """target (n, k) loses part (n, k); by loops, see `bladefem.hbm.linear.array_copy`."""
    for i in range(part.shape[0]):
        for j in range(part.shape[1]):
            target[i, j] -= part[i, j]


# the order of the sums is free, so that they are vectorised: in order, each product waits for the
# one before
@njit(fastmath={"reassoc", "contract"}, **KERNEL)
def back_substitute(M, pivots, x):
    """x becomes M^-1 x."""
    size = M.shape[0]
    for k in range(size):
        if pivots[k] != k:
            x[k], x[pivots[k]] = x[pivots[k]], x[k]
    for i in range(size):
        total = 0.0
        for j in range(i):
            total += M[i, j] * x[j]
        x[i] -= total
    for i in range(size - 1, -1, -1):
        total = 0.0
        for j in range(i + 1, size):
            total += M[i, j] * x[j]
        x[i] = (x[i] - total) / M[i, i]

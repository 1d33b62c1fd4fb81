"""LU factors for compiled loops, small and large; LAPACK's calls take longer than a tiny matrix.

Inner loops run over slices from 0 on, see `bladefem.hbm.linear.row_products`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.row_products import ROWS_AT_ONCE, four_products, row_product, subtract_row

# columns of a block
BLOCK_COLUMNS = 32


@njit(_nrt=False, **KERNEL)
def factorise_small(M, pivots):
    """LU factors in place with partial pivoting; False where a pivot is zero."""
    return _eliminate_columns(M, pivots, 0, M.shape[0])


@njit(_nrt=False, **INNER_KERNEL)
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
                subtract_row(M[k, k + 1 : high], factor, M[i, k + 1 : high])
    return True


@njit(_nrt=False, **INNER_KERNEL)
def _eliminate_rows(M, low, high):
    """Right of the factors of columns low to high, their rows."""
    for k in range(low, high):
        for i in range(k + 1, high):
            subtract_row(M[k, high:], M[i, k], M[i, high:])


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
        if high < size:
            _eliminate_rows(M, low, high)
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


@njit(_nrt=False, fastmath={"contract"}, **KERNEL)
def back_substitute(M, pivots, x):
    """x becomes M^-1 x."""
    size = M.shape[0]
    for k in range(size):
        if pivots[k] != k:
            x[k], x[pivots[k]] = x[pivots[k]], x[k]
    for low in range(0, size, ROWS_AT_ONCE):
        high = min(low + ROWS_AT_ONCE, size)
        _subtract_products(M[low:high], 0, x[:low], x[low:high])
        for i in range(low, high):
            for j in range(low, i):
                x[i] -= M[i, j] * x[j]
    for high in range(size, 0, -ROWS_AT_ONCE):
        low = max(high - ROWS_AT_ONCE, 0)
        _subtract_products(M[low:high], high, x[high:], x[low:high])
        for i in range(high - 1, low - 1, -1):
            for j in range(i + 1, high):
                x[i] -= M[i, j] * x[j]
            x[i] /= M[i, i]


@njit(_nrt=False, **INNER_KERNEL)
def _subtract_products(rows, start, y, target):
    """target (n,) loses the products of rows (n, size) with y (k,), k of their columns from a first
    one on; n up to ROWS_AT_ONCE.
    """
    if target.size < ROWS_AT_ONCE:
        for i in range(target.size):
            target[i] -= row_product(rows[i, start : start + y.size], y)
        return
    first, second, third, fourth = four_products(rows, start, y)
    target[0] -= first
    target[1] -= second
    target[2] -= third
    target[3] -= fourth

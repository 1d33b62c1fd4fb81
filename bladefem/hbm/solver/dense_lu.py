"""LU factors for compiled loops, small and large; LAPACK's calls take longer than a tiny matrix.

Inner loops run over slices from 0 on: a loop that begins elsewhere asks of each index whether it is
counted from the end, and is not vectorised. Both factors and substitutions took two to four times
as long with it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL

# columns of a block
BLOCK_COLUMNS = 32
# rows that a substitution reads at once
ROWS_AT_ONCE = 4


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
                _subtract_row(M[k, k + 1 : high], factor, M[i, k + 1 : high])
    return True


@njit(_nrt=False, fastmath={"contract"}, **INNER_KERNEL)
def _subtract_row(row, factor, target):
    """target (n,) loses row (n,) times a factor."""
    for j in range(target.size):
        target[j] -= factor * row[j]


@njit(_nrt=False, **INNER_KERNEL)
def _eliminate_rows(M, low, high):
    """Right of the factors of columns low to high, their rows."""
    for k in range(low, high):
        for i in range(k + 1, high):
            _subtract_row(M[k, high:], M[i, k], M[i, high:])


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


# the order of the sums is free, so that they are vectorised: in order, each product waits for the
# one before
@njit(_nrt=False, fastmath={"reassoc", "contract"}, **KERNEL)
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


@njit(_nrt=False, fastmath={"reassoc", "contract"}, **INNER_KERNEL)
def _subtract_products(rows, start, y, target):
    """target (n,) loses the product of y (k,) with k columns of rows (n, size) from a first one on;
    n up to ROWS_AT_ONCE, which share what they read of y.
    """
    end = start + y.size
    if target.size < ROWS_AT_ONCE:
        for i in range(target.size):
            row = rows[i, start:end]
            total = 0.0
            for j in range(y.size):
                total += row[j] * y[j]
            target[i] -= total
        return
    one = rows[0, start:end]
    two = rows[1, start:end]
    three = rows[2, start:end]
    four = rows[3, start:end]
    first = second = third = fourth = 0.0
    for j in range(y.size):
        first += one[j] * y[j]
        second += two[j] * y[j]
        third += three[j] * y[j]
        fourth += four[j] * y[j]
    target[0] -= first
    target[1] -= second
    target[2] -= third
    target[3] -= fourth

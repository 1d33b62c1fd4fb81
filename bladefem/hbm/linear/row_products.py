"""Products and differences of rows in compiled loops.

Their loops run over slices from 0 on: a loop that begins elsewhere asks of each index whether it is
counted from the end, and is not vectorised. LU factors and substitutions took two to four times as
long with it. Four rows at once share what they read of a vector; BLAS takes a third longer for a
matrix of 93 columns.
"""

from __future__ import annotations

from numba import njit

from ...util.numba_options import INNER_KERNEL

# rows that share a vector
ROWS_AT_ONCE = 4


# the order of the sums is free, so that they are vectorised: in order, each product waits for the
# one before
@njit(_nrt=False, fastmath={"reassoc", "contract"}, **INNER_KERNEL)
def row_product(row, y):
    """Product of a row (k,) with y (k,)."""
    total = 0.0
    for j in range(y.size):
        total += row[j] * y[j]
    return total


@njit(_nrt=False, fastmath={"reassoc", "contract"}, **INNER_KERNEL)
def four_products(rows, start, y):
    """Products of four rows (4, size) with y (k,), k of their columns from a first one on."""
    # slices of single rows are known to be contiguous, those of several are not
    one = rows[0, start : start + y.size]
    two = rows[1, start : start + y.size]
    three = rows[2, start : start + y.size]
    four = rows[3, start : start + y.size]
    first = second = third = fourth = 0.0
    for j in range(y.size):
        first += one[j] * y[j]
        second += two[j] * y[j]
        third += three[j] * y[j]
        fourth += four[j] * y[j]
    return first, second, third, fourth


@njit(_nrt=False, fastmath={"contract"}, **INNER_KERNEL)
def subtract_row(row, factor, target):
    """target (n,) loses row (n,) times a factor."""
    for j in range(target.size):
        target[j] -= factor * row[j]


@njit(_nrt=False, **INNER_KERNEL)
def multiply_blocks(C, x, out):
    """out (n k,) becomes C (n, k, k) times x (n k,), block by block."""
    size = C.shape[1]
    whole = size - size % ROWS_AT_ONCE
    for node in range(C.shape[0]):
        block = C[node]
        y = x[node * size : (node + 1) * size]
        forces = out[node * size : (node + 1) * size]
        for i in range(0, whole, ROWS_AT_ONCE):
            found = four_products(block[i : i + ROWS_AT_ONCE], 0, y)
            forces[i], forces[i + 1], forces[i + 2], forces[i + 3] = found
        for i in range(whole, size):
            forces[i] = row_product(block[i], y)

"""Copies in compiled code by plain loops.

Assigning an array to a slice compiles NumPy's rules of broadcasting and the text of its errors
anew for each kind of arrays, half a second each.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, error_model="numpy", inline="always")
def copy_vector(source, target):
    """target (n,) becomes source (n,)."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@njit(cache=True, error_model="numpy", inline="always")
def copy_matrix(source, target):
    """The first columns of target (n, ..) become source (n, k)."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@njit(cache=True, error_model="numpy", inline="always")
def clear_vector(target):
    """target (n,) becomes zero."""
    for i in range(target.shape[0]):
        target[i] = 0

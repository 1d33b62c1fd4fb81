"""Generalised conjugate residuals on  x + A (C x + f (l . x)) = r: A couples contacts harmonic by
harmonic, C harmonics node by node, and a few vectors f and l couple everything (a damper that
walks).

Eisenstat, Elman and Schultz, SIAM J. Numer. Anal. 20 (1983), doi:10.1137/0720023. The springs of
full stick inside A are the preconditioner already: where contacts move alike, a few directions are
enough; what many of them do in common a second level solves for, see
`bladefem.hbm.solver.deflation`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.array_copy import copy_vector
from ..linear.contact_flexibility import apply_flexibility
from ..linear.row_products import multiply_blocks, row_product, subtract_row
from .deflation import apply_deflation

# after which it is given up
MOST_DIRECTIONS = 60
# in place of their number, where they did not find the solution
NOT_FOUND = -1


@njit(**KERNEL)
def conjugate_residuals(flex, C, ramp, r, accuracy, level, x):
    """Fill x (N,) with the solution for r (N,), to a relative residual; the number of directions
    that took, or NOT_FOUND.

    A as `flex` gives it, C (nodes, N/nodes, N/nodes) real, f and l (z, N) in ``ramp``, none of them
    mostly; level as `bladefem.hbm.solver.deflation` gives it.
    """
    N = r.size
    m = max(flex[0].shape[1], flex[3].shape[0])
    # directions and an orthonormal basis of their products with the system, product k = sum over i
    # of R[k, i] Q[i]: combining directions once at the end spares one pass in three of each
    P = np.empty((MOST_DIRECTIONS, N))
    Q = np.empty((MOST_DIRECTIONS, N))
    R = np.empty((MOST_DIRECTIONS, MOST_DIRECTIONS))
    steps = np.empty(MOST_DIRECTIONS)
    forces = np.empty(N)
    rest = r.copy()
    goal = accuracy * np.sqrt(row_product(r, r))
    count = 0
    while np.sqrt(row_product(rest, rest)) > goal and count < MOST_DIRECTIONS:
        apply_deflation(level, rest, P[count])
        copy_vector(P[count], Q[count])
        multiply_blocks(C, P[count], forces)
        for z in range(ramp[0].shape[0]):
            subtract_row(ramp[0][z], -row_product(ramp[1][z], P[count]), forces)
        apply_flexibility(flex, forces.reshape(m, N // m), Q[count].reshape(m, N // m))
        if not _orthonormalise(Q, count, R):
            break
        steps[count] = row_product(Q[count], rest)
        subtract_row(Q[count], steps[count], rest)
        count += 1
    _combine_directions(P, R, steps, count, x)
    return count if np.sqrt(row_product(rest, rest)) <= goal else NOT_FOUND


@njit(_nrt=False, **INNER_KERNEL)
def _orthonormalise(Q, count, R):
    """Row ``count`` of Q (.., N) becomes orthonormal to those before it; its shares and its length
    go to that row of R. False where nothing is left.
    """
    product = Q[count]
    for i in range(count):
        R[count, i] = row_product(Q[i], product)
        subtract_row(Q[i], R[count, i], product)
    length = np.sqrt(row_product(product, product))
    R[count, count] = length
    if not length > 0.0:
        return False
    for j in range(product.size):
        product[j] /= length
    return True


@njit(_nrt=False, **INNER_KERNEL)
def _combine_directions(P, R, steps, count, x):
    """x (N,) becomes the sum of the first directions P (.., N) whose products with the system are
    the steps along Q; the steps are lost.
    """
    x[:] = 0.0
    for k in range(count - 1, -1, -1):
        steps[k] /= R[k, k]
        for i in range(k):
            steps[i] -= R[k, i] * steps[k]
        subtract_row(P[k], -steps[k], x)

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

from ...util.numba_options import KERNEL
from ..linear.array_copy import copy_vector
from ..linear.contact_flexibility import apply_flexibility
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
    block = C.shape[1]
    m = max(flex[0].shape[1], flex[3].shape[0])
    P = np.empty((MOST_DIRECTIONS, N))
    Q = np.empty((MOST_DIRECTIONS, N))
    forces = np.empty(N)
    rest = r.copy()
    goal = accuracy * np.sqrt(np.dot(r, r))
    x[:] = 0.0
    for k in range(MOST_DIRECTIONS):
        if np.sqrt(np.dot(rest, rest)) <= goal:
            return k
        apply_deflation(level, rest, P[k])
        copy_vector(P[k], Q[k])
        for i in range(0, N, block):
            np.dot(C[i // block], P[k, i : i + block], forces[i : i + block])
        for z in range(ramp[0].shape[0]):
            forces += np.dot(ramp[1][z], P[k]) * ramp[0][z]
        apply_flexibility(flex, forces.reshape(m, N // m), Q[k].reshape(m, N // m))
        for i in range(k):
            share = np.dot(Q[i], Q[k])
            for j in range(N):
                P[k, j] -= share * P[i, j]
                Q[k, j] -= share * Q[i, j]
        length = np.sqrt(np.dot(Q[k], Q[k]))
        if not length > 0.0:
            return NOT_FOUND
        step = np.dot(Q[k], rest) / length**2
        for j in range(N):
            x[j] += step * P[k, j]
            rest[j] -= step * Q[k, j]
            P[k, j] /= length
            Q[k, j] /= length
    return NOT_FOUND

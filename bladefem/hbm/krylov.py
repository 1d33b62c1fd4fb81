"""Generalised conjugate residuals on  x + A C x = r: A couples contacts harmonic by harmonic, C harmonics node by node.

Eisenstat, Elman and Schultz, SIAM J. Numer. Anal. 20 (1983), doi:10.1137/0720023. The springs of full stick inside A
are the preconditioner already: where contacts move alike, a few directions are enough.
"""

from __future__ import annotations

import numpy as np
from numba import njit

__all__ = ["apply", "apply_modes", "conjugate_residuals"]

DIRECTIONS = 60     # after which it is given up


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc"})
def apply(A, x, out):
    """out (m, K) += A (H+1, m, m) times x (m, K), both as real coefficients."""
    m, along = x.shape[0], np.ascontiguousarray(x.T)
    for h in range(A.shape[0]):
        c, s, turn = max(2 * h - 1, 0), 2 * h, 1.0 if h else 0.0
        by_cos, by_sin = along[c], along[s]
        for i in range(m):
            row, cos, sin = A[h, i], 0.0, 0.0
            for j in range(m):
                re, im = row[j].real, turn * row[j].imag
                cos += re * by_cos[j] + im * by_sin[j]
                sin += re * by_sin[j] - im * by_cos[j]
            out[i, c] += cos
            if h:
                out[i, s] += sin


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc"})
def apply_modes(C, R, D, x, out):
    """out (m, K) += (R + C D C^H) x for x (m, K) but for the mean, from C (S, m, M), R (S', m, m) and D (H+1, M)."""
    m, M, along = x.shape[0], C.shape[2], np.ascontiguousarray(x.T)
    q = np.empty(M, np.complex128)
    for h in range(1, D.shape[0]):
        shapes, rest, c, s = C[min(h, C.shape[0] - 1)], R[min(h, R.shape[0] - 1)], 2 * h - 1, 2 * h
        q[:] = 0.0
        for i in range(m):
            force = complex(along[c, i], -along[s, i])
            for k in range(M):
                q[k] += shapes[i, k].conjugate() * force
        q *= D[h]
        for i in range(m):
            moved = 0.0j
            for k in range(M):
                moved += shapes[i, k] * q[k]
            for j in range(m):
                moved += rest[i, j] * complex(along[c, j], -along[s, j])
            out[i, c] += moved.real
            out[i, s] -= moved.imag


@njit(cache=True, error_model="numpy")
def conjugate_residuals(A, C, r, accuracy, x):
    """Fill x (N,) with the solution for r (N,), to a relative residual; False where it is not found.

    A (H+1, m, m) complex, C (nodes, N/nodes, N/nodes) real.
    """
    N, m, block = r.size, A.shape[1], C.shape[1]
    P, Q, forces, rest = np.empty((DIRECTIONS, N)), np.empty((DIRECTIONS, N)), np.empty(N), r.copy()
    goal = accuracy * np.sqrt(np.dot(r, r))
    x[:] = 0.0
    for k in range(DIRECTIONS):
        if np.sqrt(np.dot(rest, rest)) <= goal:
            return True
        P[k], Q[k] = rest, rest
        for i in range(0, N, block):
            np.dot(C[i // block], rest[i:i + block], forces[i:i + block])
        apply(A, forces.reshape(m, N // m), Q[k].reshape(m, N // m))
        for i in range(k):
            share = np.dot(Q[i], Q[k])
            for j in range(N):
                P[k, j] -= share * P[i, j]
                Q[k, j] -= share * Q[i, j]
        length = np.sqrt(np.dot(Q[k], Q[k]))
        if not length > 0.0:
            return False
        step = np.dot(Q[k], rest) / length**2
        for j in range(N):
            x[j] += step * P[k, j]
            rest[j] -= step * Q[k, j]
            P[k, j] /= length
            Q[k, j] /= length
    return False

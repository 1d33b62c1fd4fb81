"""The linear bodies of a small model at one frequency, compiled: flexibilities without and with contact springs.

`bladefem.hbm.linear` does the same in NumPy. Where there are few modes for the contact freedoms, neither flexibility
without springs, G = R + C D C^H, is formed, nor is a system as large as the contact solved: see `woodbury`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .compiled import norm

__all__ = ["linear_part"]


@njit(cache=True, error_model="numpy")
def linear_part(omega, body, held, springs, H):
    """Modal flexibilities D (H+1, M), what the compiled Newton needs, G of the mean (m, m), free (H+1, m)."""
    own, contact, residual, m = body[0], body[3], body[4], springs.size
    D, free, A, stuck = _modal(omega, body, H), np.empty((H + 1, m), np.complex128), np.empty(
        (H + 1, m, m), np.complex128), np.empty((H + 1, m), np.complex128)
    few = body[10].shape[0] > 0
    G = np.empty((1 if few else H + 1, m, m), np.complex128)
    for h in range(H + 1):
        s = min(h, own.shape[0] - 1)
        pushed = contact[s] * D[h]
        free[h] = body[8][h] + np.dot(pushed, body[7][h])
        if few and h:
            _spring_by_modes(omega, h, body, springs, A[h], stuck[h])
            continue
        G[h] = residual[min(h, residual.shape[0] - 1)] + np.dot(pushed, contact[s].conj().T)
        if h == 0:
            free[0], G[0] = free[0].real, G[0].real
        _spring(G[h], free[h], springs, held, held[0].shape[1] if h == 0 else 0, A[h], stuck[h])
    mean = G[0].real.copy()
    G[0] = 0.0
    still, motion = _coefficients(free), _coefficients(stuck)
    return D, (A, G, motion, springs, max(max(norm(still), norm(motion)), 1e-300), contact, residual, D), mean, free


@njit(cache=True, error_model="numpy")
def _impedance(omega, h, k, body):
    """Impedance of mode k at harmonic h [1/s^2]."""
    s, w = min(h, body[0].shape[0] - 1), h * omega
    return complex(body[0][s, k]**2 - w**2, w * body[1][s, k] + (body[2][s, k] if h else 0.0))


@njit(cache=True, error_model="numpy")
def _modal(omega, body, H):
    """(H+1, M) flexibilities of the modes; 0 for rigid ones in the mean."""
    D = np.zeros((H + 1, body[0].shape[1]), np.complex128)
    for h in range(H + 1):
        for k in range(D.shape[1]):
            if h > 0 or body[0][0, k] > 0.0:
                D[h, k] = 1.0 / _impedance(omega, h, k, body)
    return D


@njit(cache=True, error_model="numpy")
def _spring_by_modes(omega, h, body, springs, A, stuck):
    """Fill A (m, m) and stuck (m,) of harmonic h, from the parts of `woodbury.staying` at the end of body."""
    s = min(h, body[10].shape[0] - 1)
    fixed, U, UH, N, direct = body[10][s], body[11][s], body[12][s], body[13][s], body[8][h]
    m, M = U.shape
    system, right = N.copy(), np.empty((M, m + 1), np.complex128)
    for k in range(M):
        system[k, k] += _impedance(omega, h, k, body)
    right[:, :m], right[:, m] = UH, body[7][h]
    solved = np.dot(U, np.linalg.solve(system, right))
    A[:] = fixed + solved[:, :m]
    stuck[:] = direct + solved[:, m] - np.dot(A, springs * direct)


@njit(cache=True, error_model="numpy")
def _spring(G, free, springs, held, r, A, stuck):
    """Fill A (m, m) = (1 + G K)^-1 G and stuck (m,), with r motions without stiffness eliminated."""
    m = springs.size
    system, right = np.eye(m + r, dtype=np.complex128), np.empty((m + r, m + 1), np.complex128)
    system[:m, :m] += G * springs
    right[:m, :m], right[:m, m] = G, free
    for a in range(r):
        system[:m, m + a], system[m + a, :m], system[m + a, m + a] = -held[0][:, a], held[0][:, a] * springs, held[4]
        right[m + a, :m], right[m + a, m] = held[0][:, a], held[1][a]
    solved = np.linalg.solve(system, right)
    A[:], stuck[:] = solved[:m, :m], solved[:m, m]


@njit(cache=True, error_model="numpy")
def _coefficients(q):
    """(m, K) real coefficients of the amplitudes q (H+1, m)."""
    out = np.empty((q.shape[1], 2 * q.shape[0] - 1))
    for i in range(q.shape[1]):
        out[i, 0] = q[0, i].real
        for h in range(1, q.shape[0]):
            out[i, 2 * h - 1], out[i, 2 * h] = q[h, i].real, -q[h, i].imag
    return out

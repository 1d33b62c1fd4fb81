"""The linear bodies of a small model at one frequency, compiled: flexibilities without and with contact springs.

`bladefem.hbm.linear` does the same in NumPy. Where there are few modes for the contact freedoms, neither flexibility
without springs, G = R + C D C^H, is formed, nor is a system as large as the contact solved: see `woodbury`. Where they
are the same for all harmonics as well, not even the flexibility with springs is formed: see `flex`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .compiled import norm
from .flex import by_harmonic

__all__ = ["linear_part"]


@njit(cache=True, error_model="numpy")
def linear_part(omega, body, springs, H):
    """Modal flexibilities D (H+1, M), what the compiled Newton needs, free (H+1, m).

    Args:
        body: what `small` has prepared.
    """
    contact, residual, push, direct, m = body[3], body[4], body[7], body[8], springs.size
    D, free, stuck = _modal(omega, body, H), np.empty((H + 1, m), np.complex128), np.empty((H + 1, m), np.complex128)
    for h in range(H + 1):
        s = min(h, contact.shape[0] - 1)
        for i in range(m):
            free[h, i] = direct[h, i]
            for k in range(D.shape[1]):
                free[h, i] += contact[s, i, k] * D[h, k] * push[h, k]
    mean, stuck[0] = body[15][0], body[15][1]
    few, one = body[10].shape[0] > 0, body[16][0].shape[0] > 0
    G = np.zeros((1 if few else H + 1, m, m), np.complex128)
    if one:
        T = np.zeros((H + 1, D.shape[1], D.shape[1]), np.complex128)
        for h in range(1, H + 1):
            T[h] = np.linalg.inv(_loaded(omega, h, body))
        R, U = body[16]
        flex = (np.empty((0, 0, 0), np.complex128), mean, R, U, T)
        _stick_by_modes(T, body, stuck)
    else:
        A = np.empty((H + 1, m, m), np.complex128)
        A[0] = mean
        for h in range(1, H + 1):
            if few:
                _spring_by_modes(omega, h, body, A[h], stuck[h])
                continue
            shapes = contact[min(h, contact.shape[0] - 1)]
            G[h] = residual[min(h, residual.shape[0] - 1)] + np.dot(shapes * D[h], shapes.conj().T)
            _spring(G[h], free[h], springs, A[h], stuck[h])
        flex = by_harmonic(A)
    still, motion = _coefficients(free), _coefficients(stuck)
    scale = max(max(norm(still), norm(motion)), 1e-300)
    return D, (flex, G, motion, springs, scale, contact, residual, D, body[14]), free


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
def _loaded(omega, h, body):
    """(M, M) impedances of the modes with the contact springs: the inverse of `woodbury`'s T."""
    system = body[13][min(h, body[13].shape[0] - 1)].copy()
    for k in range(system.shape[0]):
        system[k, k] += _impedance(omega, h, k, body)
    return system


@njit(cache=True, error_model="numpy")
def _stick_by_modes(T, body, stuck):
    """Fill stuck (H+1, m) but for the mean from T (H+1, M, M)."""
    U, still, push = body[11][0], body[17], body[18]
    for h in range(1, T.shape[0]):
        modal = np.dot(T[h], push[h])
        for i in range(U.shape[0]):
            stuck[h, i] = still[h, i]
            for k in range(U.shape[1]):
                stuck[h, i] += U[i, k] * modal[k]


@njit(cache=True, error_model="numpy")
def _spring_by_modes(omega, h, body, A, stuck):
    """Fill A (m, m) and stuck (m,) of harmonic h, from the parts of `woodbury.staying` in body."""
    s = min(h, body[10].shape[0] - 1)
    fixed, U, UH = body[10][s], body[11][s], body[12][s]
    m, M = U.shape
    right = np.empty((M, m + 1), np.complex128)
    right[:, :m], right[:, m] = UH, body[18][h]
    solved = np.dot(U, np.linalg.solve(_loaded(omega, h, body), right))
    A[:] = fixed + solved[:, :m]
    stuck[:] = body[17][h] + solved[:, m]


@njit(cache=True, error_model="numpy")
def _spring(G, free, springs, A, stuck):
    """Fill A (m, m) = (1 + G K)^-1 G and stuck (m,)."""
    m = springs.size
    right = np.empty((m, m + 1), np.complex128)
    right[:, :m], right[:, m] = G, free
    solved = np.linalg.solve(np.eye(m) + G * springs, right)
    A[:], stuck[:] = solved[:, :m], solved[:, m]


@njit(cache=True, error_model="numpy")
def _coefficients(q):
    """(m, K) real coefficients of the amplitudes q (H+1, m)."""
    out = np.empty((q.shape[1], 2 * q.shape[0] - 1))
    for i in range(q.shape[1]):
        out[i, 0] = q[0, i].real
        for h in range(1, q.shape[0]):
            out[i, 2 * h - 1], out[i, 2 * h] = q[h, i].real, -q[h, i].imag
    return out

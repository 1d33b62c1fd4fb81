"""The linear bodies of a small model at one frequency, compiled: flexibilities without and with
contact springs.

`bladefem.hbm.linear.condensation` does the same in NumPy. Where there are few modes for the contact
degrees of freedom, neither flexibility without springs, G = R + C D C^H, is formed, nor is a system
as large as the contact solved: see `woodbury`. Where they are the same for all harmonics as well,
not even the flexibility with springs is formed: see `bladefem.hbm.linear.contact_flexibility`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..solver.newton_compiled import Condensed, frobenius_norm
from .contact_flexibility import by_harmonic


@njit(cache=True, error_model="numpy")
def linear_part(omega, bodies, springs, H):
    """Modal flexibilities D (H+1, M), the `Condensed` bodies, free (H+1, m)."""
    contact = bodies.contact
    residual = bodies.residual
    m = springs.size
    Z = _modal_impedances(omega, H, bodies.own, bodies.viscous, bodies.hysteretic)
    D = _modal_flexibilities(Z, bodies.own)
    free = np.empty((H + 1, m), np.complex128)
    stuck = np.empty((H + 1, m), np.complex128)
    for h in range(H + 1):
        free[h] = bodies.direct[h] + np.dot(
            contact[min(h, contact.shape[0] - 1)], D[h] * bodies.push[h]
        )
    stuck[0], few = bodies.mean_stuck, bodies.A.shape[0] > 0
    G = np.zeros((1 if few else H + 1, m, m), np.complex128)
    if bodies.R.shape[0]:
        T = np.zeros((H + 1, D.shape[1], D.shape[1]), np.complex128)
        for h in range(1, H + 1):
            T[h] = np.linalg.inv(_stuck_impedances(Z[h], bodies.N[0]))
        flex = (np.empty((0, 0, 0), np.complex128), bodies.mean_A, bodies.R, bodies.shared, T)
        _stick_by_modes(T, bodies.shared, bodies.stuck, bodies.sprung, stuck)
    else:
        A = np.empty((H + 1, m, m), np.complex128)
        A[0] = bodies.mean_A
        for h in range(1, H + 1):
            if few:
                _spring_by_modes(Z[h], h, bodies, A[h], stuck[h])
                continue
            shapes = contact[min(h, contact.shape[0] - 1)]
            G[h] = residual[min(h, residual.shape[0] - 1)] + np.dot(shapes * D[h], shapes.conj().T)
            _add_springs(G[h], free[h], springs, A[h], stuck[h])
        flex = by_harmonic(A)
    still = _real_coefficients(free)
    motion = _real_coefficients(stuck)
    scale = max(max(frobenius_norm(still), frobenius_norm(motion)), 1e-300)
    return D, Condensed(flex, G, motion, springs, scale, contact, residual, D, bodies.motions), free


@njit(cache=True, error_model="numpy")
def _modal_impedances(omega, H, own, viscous, hysteretic):
    """(H+1, M) impedances of the modes [1/s^2]."""
    Z = np.empty((H + 1, own.shape[1]), np.complex128)
    for h in range(H + 1):
        s = min(h, own.shape[0] - 1)
        w = h * omega
        for k in range(Z.shape[1]):
            Z[h, k] = complex(
                own[s, k] ** 2 - w**2, w * viscous[s, k] + (hysteretic[s, k] if h else 0.0)
            )
    return Z


@njit(cache=True, error_model="numpy")
def _modal_flexibilities(Z, own):
    """(H+1, M) flexibilities of the modes; 0 for rigid ones in the mean."""
    D = np.zeros(Z.shape, np.complex128)
    for h in range(Z.shape[0]):
        for k in range(Z.shape[1]):
            if h > 0 or own[0, k] > 0.0:
                D[h, k] = 1.0 / Z[h, k]
    return D


@njit(cache=True, error_model="numpy")
def _stuck_impedances(Z, N):
    """(M, M) impedances (M,) of the modes with the contact springs: the inverse of `woodbury`'s
    T.
    """
    system = N.copy()
    for k in range(Z.size):
        system[k, k] += Z[k]
    return system


@njit(cache=True, error_model="numpy")
def _stick_by_modes(T, U, still, push, stuck):
    """Fill stuck (H+1, m) but for the mean from T (H+1, M, M)."""
    for h in range(1, T.shape[0]):
        modal = np.dot(T[h], push[h])
        for i in range(U.shape[0]):
            stuck[h, i] = still[h, i]
            for k in range(U.shape[1]):
                stuck[h, i] += U[i, k] * modal[k]


@njit(cache=True, error_model="numpy")
def _spring_by_modes(Z, h, bodies, A, stuck):
    """Fill A (m, m) and stuck (m,) of harmonic h, from impedances (M,) and the parts of
    `woodbury.frequency_independent_parts`.
    """
    s = min(h, bodies.A.shape[0] - 1)
    fixed = bodies.A[s]
    U = bodies.U[s]
    UH = bodies.UH[s]
    m, M = U.shape
    right = np.empty((M, m + 1), np.complex128)
    right[:, :m], right[:, m] = UH, bodies.sprung[h]
    solved = np.dot(U, np.linalg.solve(_stuck_impedances(Z, bodies.N[s]), right))
    A[:] = fixed + solved[:, :m]
    stuck[:] = bodies.stuck[h] + solved[:, m]


@njit(cache=True, error_model="numpy")
def _add_springs(G, free, springs, A, stuck):
    """Fill A (m, m) = (1 + G K)^-1 G and stuck (m,)."""
    m = springs.size
    right = np.empty((m, m + 1), np.complex128)
    right[:, :m] = G
    right[:, m] = free
    solved = np.linalg.solve(np.eye(m) + G * springs, right)
    A[:], stuck[:] = solved[:, :m], solved[:, m]


@njit(cache=True, error_model="numpy")
def _real_coefficients(q):
    """(m, K) real coefficients of the amplitudes q (H+1, m)."""
    out = np.empty((q.shape[1], 2 * q.shape[0] - 1))
    for i in range(q.shape[1]):
        out[i, 0] = q[0, i].real
        for h in range(1, q.shape[0]):
            out[i, 2 * h - 1], out[i, 2 * h] = q[h, i].real, -q[h, i].imag
    return out

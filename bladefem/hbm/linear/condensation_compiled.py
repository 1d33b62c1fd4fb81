"""The linear bodies of a model at one frequency: flexibilities without and with contact springs.

Where there are few modes for the contact degrees of freedom, neither flexibility without springs,
G = R + C D C^H, is formed, nor is a system as large as the contact solved: see `woodbury`. Where
there are many contact degrees of freedom, not even the flexibility with springs is formed: see
`common_basis`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import INNER_KERNEL, KERNEL
from ..solver.balance_residual import Condensed, motion_scale
from .array_copy import copy_matrix, copy_vector
from .contact_flexibility import by_harmonic, form_matrices

# condition number of the coupled modes without contact from which a resonance without damping is
# hit: a free damper has one at twice the speed of the frame. Of the contacts' flexibility three
# digits are left
RESONANCE_CONDITION = 1e13


@njit(**KERNEL)
def linear_part(omega, bodies, springs, H):
    """The bodies at one frequency.

    Returns:
        (D, full) modal flexibilities: D (H+1, M) of modes that damping does not couple, full (H+1,
        M, M) of those that it does, else (0, M, M); the `Condensed` bodies; free (H+1, m) and stuck
        (H+1, m), displacements without contact forces and in full stick.
    """
    contact = bodies.contact
    residual = bodies.residual
    m = springs.size
    Z = _modal_impedances(omega, H, bodies.own, bodies.viscous, bodies.hysteretic)
    D = _modal_flexibilities(Z, bodies.own, bodies.coupled.shape[0] > 0)
    full = _coupled_flexibilities(omega, Z, D, bodies.coupled)
    free = np.empty((H + 1, m), np.complex128)
    stuck = np.empty((H + 1, m), np.complex128)
    for h in range(H + 1):
        moved = np.dot(
            contact[min(h, contact.shape[0] - 1)], modal_motion(D, full, h, bodies.push[h])
        )
        for i in range(m):
            free[h, i] = bodies.direct[h, i] + moved[i]
    copy_vector(bodies.mean_stuck, stuck[0])
    few = bodies.A.shape[0] > 0
    shared = bodies.R.shape[0] > 0
    formed = not shared and (not few or full.shape[0] > 0)
    X = _flexibilities_in_basis(bodies, D, full)
    bare = (np.empty((0, 0, 0), np.complex128), bodies.mean_G, bodies.rest, bodies.basis, X)
    G = np.zeros((H + 1, m, m) if formed else (1, 0, 0), np.complex128)
    for h in range(1, G.shape[0]):
        _receptance(bodies, D, full, h, G[h])
    if shared:
        T = _sprung_in_basis(omega, Z, bodies)
        flex = (np.empty((0, 0, 0), np.complex128), bodies.mean_A, bodies.R, bodies.shared, T)
        _stick_in_basis(bodies.R, bodies.shared, T, springs, free, stuck)
    else:
        A = np.empty((H + 1, m, m), np.complex128)
        copy_matrix(bodies.mean_A, A[0])
        for h in range(1, H + 1):
            if few:
                _spring_by_modes(omega * h, Z[h], h, bodies, A[h], stuck[h])
            else:
                _add_springs(G[h], free[h], springs, A[h], stuck[h])
        flex = by_harmonic(A)
    still = _real_coefficients(free)
    motion = _real_coefficients(stuck)
    scale, least = motion_scale(still, motion, bodies.compression)
    condensed = Condensed(
        flex, bare, G, motion, springs, scale, least, contact, residual, D, bodies.motions
    )
    return (D, full), condensed, free, stuck


@njit(**KERNEL)
def unsprung_flexibility(bodies, D, full):
    """(H+1, m, m) flexibility without contact springs, from the modal ones of `linear_part`."""
    m = bodies.contact.shape[1]
    if bodies.R.shape[0]:
        X = _flexibilities_in_basis(bodies, D, full)
        none = np.empty((0, 0, 0), np.complex128)
        return form_matrices((none, bodies.mean_G, bodies.rest, bodies.basis, X))
    G = np.empty((D.shape[0], m, m), np.complex128)
    copy_matrix(bodies.mean_G, G[0])
    for h in range(1, D.shape[0]):
        _receptance(bodies, D, full, h, G[h])
    return G


@njit(**INNER_KERNEL)
def modal_motion(D, full, h, push):
    """(M,) amplitudes of the modes of harmonic h under modal forces (M,)."""
    if full.shape[0]:
        return np.dot(full[h], push)
    return D[h] * push


@njit(**INNER_KERNEL)
def _receptance(bodies, D, full, h, G):
    """Fill G (m, m) = R + C D C^H of harmonic h > 0."""
    shapes = bodies.contact[min(h, bodies.contact.shape[0] - 1)]
    residual = bodies.residual[min(h, bodies.residual.shape[0] - 1)]
    m = G.shape[0]
    real = _real_part(shapes)
    if full.shape[0] == 0 and real.shape[0]:
        # two real products: half the work of a complex one
        across = np.ascontiguousarray(real.T)
        stiff = np.dot(real * D[h].real, across)
        loss = np.dot(real * D[h].imag, across)
        for i in range(m):
            for j in range(m):
                G[i, j] = residual[i, j] + complex(stiff[i, j], loss[i, j])
        return
    left = np.dot(shapes, full[h]) if full.shape[0] else shapes * D[h]
    moved = np.dot(left, np.ascontiguousarray(shapes.conj().T))
    for i in range(m):
        for j in range(m):
            G[i, j] = residual[i, j] + moved[i, j]


@njit(**INNER_KERNEL)
def _real_part(shapes):
    """(m, M) of real shapes; (0, 0) where some are complex."""
    out = np.empty(shapes.shape)
    for i in range(shapes.shape[0]):
        for k in range(shapes.shape[1]):
            if shapes[i, k].imag != 0.0:
                return np.empty((0, 0))
            out[i, k] = shapes[i, k].real
    return out


@njit(**INNER_KERNEL)
def _identity(size):
    """(size, size) complex."""
    out = np.zeros((size, size), np.complex128)
    for i in range(size):
        out[i, i] = 1.0
    return out


@njit(**INNER_KERNEL)
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


@njit(**INNER_KERNEL)
def _modal_flexibilities(Z, own, coupled):
    """(H+1, M) flexibilities of the modes; 0 for rigid ones in the mean, and where a mode whose
    damping couples it to others is excited at exactly its own frequency.
    """
    D = np.zeros(Z.shape, np.complex128)
    for h in range(Z.shape[0]):
        for k in range(Z.shape[1]):
            rigid = h == 0 and own[0, k] == 0.0
            # damping may have off-diagonal terms only: `_coupled_flexibilities` has it all
            if not rigid and not (coupled and Z[h, k] == 0.0):
                D[h, k] = 1.0 / Z[h, k]
    return D


@njit(**INNER_KERNEL)
def _coupled_flexibilities(omega, Z, D, coupled):
    """(H+1, M, M) flexibilities of modes that the viscous damping (S, M, M) couples; (0, M, M)
    where there is none. The mean does not know of damping.
    """
    M = D.shape[1]
    out = np.zeros((D.shape[0] if coupled.shape[0] else 0, M, M), np.complex128)
    for h in range(out.shape[0]):
        if h == 0:
            for k in range(M):
                out[h, k, k] = D[h, k]
            continue
        system = _stuck_impedances(h * omega, Z[h], out[h], coupled, h)
        copy_matrix(np.linalg.solve(system, _identity(M)), out[h])
        if _lost_digits(system, out[h]) > RESONANCE_CONDITION:
            raise ZeroDivisionError("a resonance without damping")
    return out


@njit(**INNER_KERNEL)
def _lost_digits(system, inverse):
    """Skeel's condition number of a system (M, M), which does not depend on how rows are scaled."""
    most = 0.0
    rows = np.abs(system).sum(axis=1)
    for i in range(system.shape[0]):
        total = 0.0
        for k in range(system.shape[0]):
            total += abs(inverse[i, k]) * rows[k]
        most = max(most, total)
    return most


@njit(**INNER_KERNEL)
def _stuck_impedances(w, Z, N, coupled, h):
    """(M, M) impedances (M,) of the modes with the contact springs: the inverse of `woodbury`'s
    T.
    """
    system = N.copy()
    for k in range(Z.size):
        system[k, k] += Z[k]
    if coupled.shape[0]:
        C = coupled[min(h, coupled.shape[0] - 1)]
        for k in range(Z.size):
            for l in range(Z.size):
                system[k, l] += 1j * w * C[k, l]
    return system


@njit(**INNER_KERNEL)
def _flexibilities_in_basis(bodies, D, full):
    """(H+1, q, q) what each harmonic adds to the shared residual flexibility in the basis, but for
    the mean; (0, 0, 0) in the first form.
    """
    q = bodies.basis.shape[1]
    out = np.zeros((D.shape[0] if bodies.R.shape[0] else 0, q, q), np.complex128)
    for h in range(1, out.shape[0]):
        shapes = bodies.coordinates[min(h, bodies.coordinates.shape[0] - 1)]
        left = np.dot(shapes, full[h]) if full.shape[0] else shapes * D[h]
        moved = np.dot(left, np.ascontiguousarray(shapes.conj().T))
        own = bodies.differences[min(h, bodies.differences.shape[0] - 1)]
        for i in range(q):
            for j in range(q):
                out[h, i, j] = own[i, j] + moved[i, j]
    return out


@njit(**INNER_KERNEL)
def _sprung_in_basis(omega, Z, bodies):
    """(H+1, q, q) T of the second form, but for the mean."""
    fixed = bodies.sprung_differences
    q = bodies.basis.shape[1]
    T = np.zeros((Z.shape[0], q, q), np.complex128)
    for h in range(1, T.shape[0]):
        s = min(h, fixed.shape[0] - 1)
        shapes = bodies.sprung_coordinates[s]
        system = _stuck_impedances(omega * h, Z[h], bodies.N[s], bodies.coupled, h)
        across = np.ascontiguousarray(shapes.conj().T)
        moved = np.dot(shapes, np.linalg.solve(system, across))
        for i in range(q):
            for j in range(q):
                T[h, i, j] = fixed[s, i, j] + moved[i, j]
    return T


@njit(**INNER_KERNEL)
def _stick_in_basis(R, U, T, springs, free, stuck):
    """Fill stuck (H+1, m) but for the mean: (1 - R K - U T U^T K) free."""
    m = springs.size
    H = T.shape[0] - 1
    sprung = np.empty((m, 2 * H))
    for h in range(1, H + 1):
        for i in range(m):
            sprung[i, 2 * h - 2] = springs[i] * free[h, i].real
            sprung[i, 2 * h - 1] = springs[i] * free[h, i].imag
    moved = np.dot(R, sprung)
    pushed = np.dot(np.ascontiguousarray(U.T), sprung)
    shapes = U.astype(np.complex128)
    for h in range(1, H + 1):
        by_basis = np.dot(shapes, np.dot(T[h], pushed[:, 2 * h - 2] + 1j * pushed[:, 2 * h - 1]))
        for i in range(m):
            own = complex(moved[i, 2 * h - 2], moved[i, 2 * h - 1])
            stuck[h, i] = free[h, i] - own - by_basis[i]


@njit(**INNER_KERNEL)
def _spring_by_modes(w, Z, h, bodies, A, stuck):
    """Fill A (m, m) and stuck (m,) of harmonic h, from impedances (M,) and the parts of
    `woodbury.frequency_independent_parts`.
    """
    s = min(h, bodies.A.shape[0] - 1)
    fixed = bodies.A[s]
    U = bodies.U[s]
    m, M = U.shape
    right = np.empty((M, m + 1), np.complex128)
    copy_matrix(bodies.UH[s], right)
    copy_vector(bodies.sprung[h], right[:, m])
    system = _stuck_impedances(w, Z, bodies.N[s], bodies.coupled, h)
    solved = np.dot(U, np.linalg.solve(system, right))
    for i in range(m):
        stuck[i] = bodies.stuck[h, i] + solved[i, m]
        for j in range(m):
            A[i, j] = fixed[i, j] + solved[i, j]


@njit(**INNER_KERNEL)
def _add_springs(G, free, springs, A, stuck):
    """Fill A (m, m) = (1 + G K)^-1 G and stuck (m,)."""
    m = springs.size
    right = np.empty((m, m + 1), np.complex128)
    system = np.empty((m, m), np.complex128)
    copy_matrix(G, right)
    copy_vector(free, right[:, m])
    for i in range(m):
        for j in range(m):
            system[i, j] = G[i, j] * springs[j]
        system[i, i] += 1.0
    solved = np.linalg.solve(system, right)
    copy_vector(solved[:, m], stuck)
    copy_matrix(solved[:, :m], A)


@njit(**INNER_KERNEL)
def _real_coefficients(q):
    """(m, K) real coefficients of the amplitudes q (H+1, m)."""
    out = np.empty((q.shape[1], 2 * q.shape[0] - 1))
    for i in range(q.shape[1]):
        out[i, 0] = q[0, i].real
        for h in range(1, q.shape[0]):
            out[i, 2 * h - 1], out[i, 2 * h] = q[h, i].real, -q[h, i].imag
    return out

"""A second level for the iterations of large patches: the motions in which the contacts of a seat
move together.

What takes iterations many steps is not how contacts differ but what they do in common, because the
bodies are soft there. With Q these motions and Z the same for every coefficient, the preconditioner

    M^-1 = 1 + Z (E^-1 - 1) Z^T,    E = Z^T (1 + A C) Z

(with the vectors of `bladefem.hbm.solver.krylov` in E where a damper walks)
solves for them at once (Nicolaides, SIAM J. Numer. Anal. 24 (1987), doi:10.1137/0724027). On plane
blades with 82 nodes that lift off, 15 harmonics, it takes 5 steps in place of 46.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import linalg

from ...util.numba_options import INNER_KERNEL, KERNEL
from ..linear.array_copy import copy_vector
from ..linear.contact_flexibility import seen_by
from ..linear.row_products import subtract_row
from ..linear.woodbury import bodies_of
from ..model import ReducedModel
from ..policy import DEFLATION_UNKNOWNS
from .dense_lu import back_substitute, factorise_large

# common motions of two rigid seats in space; more cost more than they save
MOST_COMMON_MOTIONS = 12
# contact degrees of freedom for each of them at least
DOFS_PER_MOTION = 4
# motions whose compliance is below the square of this, over the largest one, are left out
SMALLEST_COMPLIANCE_ROOT = 1e-2
# part of a motion that has to be independent of the others where some contacts stick
DEPENDENT_SHARE = 1e-3


def common_motions(model: ReducedModel, harmonics: int) -> np.ndarray:
    """(m, q) orthonormal motions of the contact that the modes have in common; (m, 0) where there
    are few unknowns.
    """
    m = model.springs.size
    if m * (2 * harmonics + 1) < DEFLATION_UNKNOWNS:
        return np.zeros((m, 0))
    return model.once(("common motions", harmonics), lambda: _softest_motions(model, harmonics))


def _softest_motions(model: ReducedModel, harmonics: int) -> np.ndarray:
    """Those that the modes give way to most under static loads, rigid bodies as much as the softest
    mode.
    """
    bodies = bodies_of(model, harmonics)
    softest = min(
        (body.omega[body.omega > 0].min() for body in bodies if np.any(body.omega > 0)), default=1.0
    )
    modes = [
        shapes / np.maximum(omega, softest)
        for body in bodies
        for shapes, omega in zip(body.shapes[:, body.contact], body.omega, strict=True)
    ]
    soft = np.concatenate([part for mode in modes for part in (mode.real, mode.imag)], axis=1)
    return _leading_directions(soft, min(MOST_COMMON_MOTIONS, len(soft) // DOFS_PER_MOTION))


def _leading_directions(soft: np.ndarray, most: int) -> np.ndarray:
    """(m, q) left singular vectors of soft (m, k) with the largest singular values, by the smaller
    one of its two Gram matrices: with few modes a system of m would take longer than many points.
    """
    if most < 1 or not np.any(soft):
        return np.zeros((len(soft), 0))
    wide = soft.shape[1] > len(soft)
    gram = soft @ soft.T if wide else soft.T @ soft
    squares, vectors = linalg.eigh(gram, subset_by_index=[max(0, len(gram) - most), len(gram) - 1])
    kept = squares >= SMALLEST_COMPLIANCE_ROOT**2 * squares[-1]
    leading = vectors if wide else soft @ (vectors / np.sqrt(np.where(kept, squares, 1.0)))
    return np.ascontiguousarray(leading[:, kept][:, ::-1])


@njit(**KERNEL)
def no_level():
    """In place of the second level where there is none."""
    return np.empty((0, 0)), np.empty((0, 0)), np.empty(0, np.int64)


@njit(**KERNEL)
def no_ramp():
    """In place of the vectors of a walk where nothing walks."""
    return np.empty((0, 0)), np.empty((0, 0))


@njit(**KERNEL)
def second_level(flex, C, ramp, Q, active, d):
    """Motions Z (a, q) of the active nodes, LU factors of E and their pivots; nothing where E is
    singular.

    Args:
        flex: flexibility among the active nodes, see `bladefem.hbm.linear.contact_flexibility`.
        C: (nodes, dK, dK) their derivatives.
        ramp: f and l (z, a K) of a walk, see `bladefem.hbm.solver.krylov`.
        Q: (m, q) common motions of all nodes.
        active: (nodes,) their numbers.
    """
    Z = _orthonormal_rows(Q, active, d)
    along = seen_by(flex, Z)
    E = _galerkin_matrix(along, C, Z)
    for z in range(ramp[0].shape[0]):
        _add_ramp(E, along, Z, ramp[0][z], ramp[1][z])
    pivots = np.empty(E.shape[0], np.int64)
    return (Z, E, pivots) if factorise_large(E, pivots) else no_level()


@njit(**INNER_KERNEL)
def _orthonormal_rows(Q, active, d):
    """The rows of the active nodes, their columns made orthonormal; dependent ones are left out."""
    Z = np.empty((Q.shape[1], active.size * d))
    count = 0
    for j in range(Q.shape[1]):
        z = Z[count]
        for y in range(active.size):
            for b in range(d):
                z[y * d + b] = Q[active[y] * d + b, j]
        before = np.sqrt(np.dot(z, z))
        for _ in range(2):
            for i in range(count):
                share = np.dot(Z[i], z)
                for l in range(z.size):
                    z[l] -= share * Z[i, l]
        left = np.sqrt(np.dot(z, z))
        if left > DEPENDENT_SHARE * before:
            for l in range(z.size):
                z[l] /= left
            count += 1
    return np.ascontiguousarray(Z[:count].T)


@njit(**INNER_KERNEL)
def _galerkin_matrix(along, C, Z):
    """E (qK, qK) = Z^T (1 + A C) Z from Z^T A (H+1, q, a), one matrix product a harmonic."""
    a, q = Z.shape
    K = 2 * along.shape[0] - 1
    E = np.eye(q * K)
    # cosines of a harmonic, then its sines
    forces = np.empty((2 * a, q * K))
    # rows of zeros up to a multiple of four, or BLAS takes a third longer
    left = np.zeros((-(-2 * q // 4) * 4, 2 * a))
    for h in range(along.shape[0]):
        c = max(2 * h - 1, 0)
        _forces_of_motions(C, Z, c, forces[:a])
        _forces_of_motions(C, Z, 2 * h, forces[a:])
        for i in range(q):
            for row in range(a):
                re = along[h, i, row].real
                im = along[h, i, row].imag if h else 0.0
                left[i, row] = re
                left[i, a + row] = im
                left[q + i, row] = -im
                left[q + i, a + row] = re
        moved = np.dot(left, forces)
        for i in range(q):
            for l in range(q * K):
                E[i * K + c, l] += moved[i, l]
                if h:
                    E[i * K + 2 * h, l] += moved[q + i, l]
    return E


@njit(_nrt=False, **INNER_KERNEL)
def _forces_of_motions(C, Z, k, out):
    """out (a, qK) becomes coefficient k of the forces C (nodes, dK, dK) by each coefficient of the
    motions Z (a, q).
    """
    q = Z.shape[1]
    K = out.shape[1] // q
    d = C.shape[1] // K
    for node in range(C.shape[0]):
        for b in range(d):
            rates = C[node, b * K + k]
            for j in range(q):
                force = out[node * d + b, j * K : (j + 1) * K]
                if d == 3:
                    _combine_rates(rates, Z[3 * node : 3 * node + 3, j], force)
                else:
                    force[:] = 0.0
                    for e in range(d):
                        subtract_row(rates[e * K : (e + 1) * K], -Z[node * d + e, j], force)


@njit(_nrt=False, fastmath={"contract", "reassoc"}, **INNER_KERNEL)
def _combine_rates(rates, motion, force):
    """force (K,) by the motion (3,) of a node, from its rates (3K,): in one pass, which takes half
    of the time of three.
    """
    K = force.size
    normal = motion[0]
    first = motion[1]
    second = motion[2]
    by_normal = rates[:K]
    by_first = rates[K : 2 * K]
    by_second = rates[2 * K :]
    for l in range(K):
        force[l] = normal * by_normal[l] + first * by_first[l] + second * by_second[l]


@njit(**INNER_KERNEL)
def _add_ramp(E, along, Z, force, reading):
    """E (qK, qK) becomes E + (Z^T A f) (l^T Z) for f and l (a K,)."""
    a, q = Z.shape
    K = force.size // a
    by_row = force.reshape(a, K)
    read = np.dot(Z.T, reading.reshape(a, K)).ravel()
    moved = np.zeros((q, K))
    for h in range(along.shape[0]):
        c = max(2 * h - 1, 0)
        s = 2 * h
        for i in range(q):
            for b in range(a):
                re = along[h, i, b].real
                im = along[h, i, b].imag
                moved[i, c] += re * by_row[b, c]
                if h:
                    moved[i, c] += im * by_row[b, s]
                    moved[i, s] += re * by_row[b, s] - im * by_row[b, c]
    flat = moved.ravel()
    for row in range(q * K):
        for column in range(q * K):
            E[row, column] += flat[row] * read[column]


@njit(**INNER_KERNEL)
def apply_deflation(level, y, out):
    """out (a K,) becomes M^-1 y."""
    copy_vector(y, out)
    Z, E, pivots = level
    if pivots.size == 0:
        return
    rest = y.reshape(Z.shape[0], y.size // Z.shape[0])
    moved = out.reshape(Z.shape[0], y.size // Z.shape[0])
    common = np.dot(Z.T, rest)
    solved = common.copy().reshape(common.size)
    back_substitute(E, pivots, solved)
    change = np.dot(Z, solved.reshape(common.shape) - common)
    for i in range(moved.shape[0]):
        for k in range(moved.shape[1]):
            moved[i, k] += change[i, k]

"""The flexibility of the contact in compiled loops: a matrix for each harmonic, or what modes add
to one for all.

With harmonics 0..H, m contact degrees of freedom and M modes it is a tuple (A, mean, R, U, T) in
one of two forms:

- A (H+1, m, m) complex, the others empty;
- A empty, A_0 = mean (m, m), A_h = R + U T_h U^T from R (m, m) and U (m, M), real, and T (H+1, M,
  M), for M vectors of a basis: see `common_basis`. Neither does a point of many contacts form its
  matrices, nor do iterations read them: with 1024 nodes and H = 5 they would take 0.9 GB, R takes
  75 MB.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.arrays import RealArray
from ...util.numba_options import INNER_KERNEL, KERNEL
from .array_copy import copy_matrix, copy_vector

# (A, mean, R, U, T) as above
Flexibility = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@njit(**KERNEL)
def by_harmonic(A):
    """The first form."""
    none = np.empty((0, 0))
    return A, none, none, none, np.empty((0, 0, 0), np.complex128)


@njit(**KERNEL)
def apply_matrices(A, x, out):
    """out (m, K) += A (H+1, m, m) times x (m, K), both as real coefficients."""
    _add_products(A, 0, np.ascontiguousarray(x.T), out)


# the order of the sums is free, so that they are vectorised: in order each product waits for the
# one before
@njit(fastmath={"reassoc", "contract"}, _nrt=False, **INNER_KERNEL)
def _add_products(A, first, along, out):
    """As `apply_matrices` from a first harmonic on, for the transpose of x (K, m)."""
    m = A.shape[1]
    for h in range(first, A.shape[0]):
        c = max(2 * h - 1, 0)
        s = 2 * h
        turn = 1.0 if h else 0.0
        by_cos = along[c]
        by_sin = along[s]
        for i in range(m):
            cos = 0.0
            sin = 0.0
            for j in range(m):
                re = A[h, i, j].real
                im = turn * A[h, i, j].imag
                cos += re * by_cos[j] + im * by_sin[j]
                sin += re * by_sin[j] - im * by_cos[j]
            out[i, c] += cos
            if h:
                out[i, s] += sin


@njit(**KERNEL)
def apply_flexibility(flex, x, out):
    """out (m, K) += A x, for either form."""
    A, mean, R, U, T = flex
    if A.shape[0]:
        apply_matrices(A, x, out)
        return
    moved = np.dot(R, x)
    copy_vector(np.dot(mean, np.ascontiguousarray(x[:, 0])), moved[:, 0])
    by_modes = np.dot(U, _apply_modal_matrix(T, np.dot(U.T, x)))
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            out[i, k] += moved[i, k] + by_modes[i, k]


@njit(**INNER_KERNEL)
def _apply_modal_matrix(T, q):
    """T (H+1, M, M) times q (M, K) but for the mean, which becomes 0."""
    out = np.zeros(q.shape)
    _add_products(T, 1, np.ascontiguousarray(q.T), out)
    return out


@njit(**KERNEL)
def select_nodes(flex, active, d):
    """The flexibility among the degrees of freedom of some nodes, d of each."""
    A, mean, R, U, T = flex
    if active.size * d == max(A.shape[1], U.shape[0]):
        return flex
    rows = np.empty(active.size * d, np.int64)
    for i in range(rows.size):
        rows[i] = active[i // d] * d + i % d
    part = np.empty((A.shape[0], rows.size, rows.size), A.dtype)
    for h in range(A.shape[0]):
        for i in range(rows.size):
            for j in range(rows.size):
                part[h, i, j] = A[h, rows[i], rows[j]]
    if A.shape[0]:
        return part, mean, R, U, T
    some = np.empty((rows.size, rows.size))
    rest = np.empty((rows.size, rows.size))
    shapes = np.empty((rows.size, U.shape[1]))
    for i in range(rows.size):
        for j in range(rows.size):
            some[i, j], rest[i, j] = mean[rows[i], rows[j]], R[rows[i], rows[j]]
        copy_vector(U[rows[i]], shapes[i])
    return A, some, rest, shapes, T


def sizes(flex: Flexibility) -> tuple[int, int]:
    """Harmonics H+1 and degrees of freedom m of either form."""
    A, mean, _, _, T = flex
    return (len(A), A.shape[1]) if len(A) else (len(T), len(mean))


def flexibility_product(flex: Flexibility, x: np.ndarray) -> RealArray:
    """A times real coefficients x (..., K), whose first axes together are the m degrees of
    freedom.
    """
    flat = np.ascontiguousarray(x, dtype=float).reshape(-1, x.shape[-1])
    out = np.zeros(flat.shape)
    apply_flexibility(flex, flat, out)
    return out.reshape(x.shape)


def transposed_flexibility(flex: Flexibility) -> Flexibility:
    """The flexibility whose product is A^T x, for real coefficients x."""
    A, mean, R, U, T = flex
    return (
        _conjugate_transposed(A),
        np.ascontiguousarray(mean.T),
        np.ascontiguousarray(R.T),
        U,
        _conjugate_transposed(T),
    )


def _conjugate_transposed(matrices: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(matrices.conj().swapaxes(1, 2))


def flexibility_of_mean(flex: Flexibility) -> RealArray:
    """(m, m) real A of harmonic 0."""
    A, mean, _, _, _ = flex
    return np.ascontiguousarray(A[0].real) if len(A) else mean


@njit(**KERNEL)
def form_matrices(flex):
    """The first form of either: (H+1, m, m)."""
    A, mean, R, U, T = flex
    if A.shape[0]:
        return A
    out = np.empty((T.shape[0], *R.shape), np.complex128)
    shapes = U.astype(np.complex128)
    copy_matrix(mean, out[0])
    for h in range(1, T.shape[0]):
        by_modes = np.dot(np.dot(shapes, T[h]), shapes.T)
        for i in range(R.shape[0]):
            for j in range(R.shape[1]):
                out[h, i, j] = R[i, j] + by_modes[i, j]
    return out


@njit(**KERNEL)
def seen_by(flex, Z):
    """(H+1, q, m) Z^T A for real motions Z (m, q)."""
    A, mean, R, U, T = flex
    harmonics = max(A.shape[0], T.shape[0])
    turned = np.ascontiguousarray(Z.T)
    out = np.empty((harmonics, Z.shape[1], Z.shape[0]), np.complex128)
    if A.shape[0]:
        motions = turned.astype(np.complex128)
        for h in range(harmonics):
            copy_matrix(np.dot(motions, A[h]), out[h])
        return out
    fixed = np.dot(turned, R)
    push = np.dot(turned, U).astype(np.complex128)
    shapes = U.T.astype(np.complex128)
    copy_matrix(np.dot(turned, mean), out[0])
    for h in range(1, harmonics):
        by_modes = np.dot(np.dot(push, T[h]), shapes)
        for i in range(fixed.shape[0]):
            for j in range(fixed.shape[1]):
                out[h, i, j] = fixed[i, j] + by_modes[i, j]
    return out


@njit(**INNER_KERNEL, fastmath={"contract", "reassoc"})
def apply_modes(C, R, D, x, out):
    """out (m, K) += (R + C D C^H) x for x (m, K) but for the mean, from C (S, m, M), R (S', m, m)
    and D (H+1, M).
    """
    m = x.shape[0]
    M = C.shape[2]
    along = np.ascontiguousarray(x.T)
    q = np.empty(M, np.complex128)
    for h in range(1, D.shape[0]):
        shapes = C[min(h, C.shape[0] - 1)]
        own = R[min(h, R.shape[0] - 1)]
        c = 2 * h - 1
        s = 2 * h
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
                moved += own[i, j] * complex(along[c, j], -along[s, j])
            out[i, c] += moved.real
            out[i, s] -= moved.imag

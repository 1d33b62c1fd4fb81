"""Shift-inverted block Lanczos iteration on real or complex vectors, with full reorthogonalisation.

Parlett, The Symmetric Eigenvalue Problem (1998), chapter 13; blocks catch multiple eigenvalues, and complex arithmetic
leaves no doubled eigenvalues to sort out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import eigh

from ..errors import NotSolvedError
from .constraint import Constrained
from .linalg import apply, dot, minus, mix

__all__ = ["lowest", "orthonormal"]

STEPS = 200
CLEAN = 1e-8    # share of old directions in a new one below which its image under M is corrected, not computed again
ROOM = 20       # blocks


def lowest(con: Constrained, inverse: Callable[[np.ndarray], np.ndarray], start: np.ndarray, count: int,
           tolerance: float, guard: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The lowest eigenpairs of K x = lambda M x.

    Args:
        inverse: K^-1 (or what stands for it) on blocks (n_own, k).
        start: (n_own, k) first block.
        tolerance: largest |K^-1 M x - x / lambda| lambda in the M-norm: the direction's error times a gap.

        guard: pairs returned beyond count as far as they have come.

    The vectors returned are K^-1 M x lambda, one free step of inverse iteration beyond the Ritz vectors x: it wipes out
    what rounding and the iteration leave in stiff directions.

    Returns:
        lam (count + guard,) [rad^2/s^2] and this rank's (n_own, count + guard) M-orthonormal vectors.

    Raises:
        NotSolvedError: fewer than ``count`` pairs exist, or the iteration does not converge.
    """
    comm = con.body.comm
    V, MV = (np.empty((start.shape[0], 0), con.dtype, order="F") for _ in range(2))
    H = np.zeros((0, 0), con.dtype)
    block, Mblock, _ = orthonormal(con, V, MV, start.astype(con.dtype))
    for _ in range(STEPS):
        V, MV = (_joined(A, len(H), new) for A, new in ((V, block), (MV, Mblock)))
        W = inverse(Mblock)
        done = slice(0, len(H) + block.shape[1])
        column = dot(comm, MV[:, done], W)
        H = _grown(H, column)
        block, Mblock, tail = orthonormal(con, V[:, done], MV[:, done], minus(W, V[:, done], column))
        theta, S = eigh(H)
        theta, S = theta[::-1], S[:, ::-1]
        k = min(count + guard, len(theta))
        rest = tail @ S[len(S) - tail.shape[1]:, :k] / theta[:k]
        error = np.linalg.norm(rest[:, :count], axis=0).max(initial=0.0)
        if not block.shape[1] and k < count:
            raise NotSolvedError(f"{count} modes were asked of a body that has {k} elastic ones")
        if (k >= count and error < tolerance) or not block.shape[1]:
            return 1 / theta[:k], mix(V[:, done], S[:, :k], block, rest)
    raise NotSolvedError(f"the modes did not converge in {STEPS} steps (error {error:.1e}, expected {tolerance:.1e})")


def orthonormal(con: Constrained, V: np.ndarray, MV: np.ndarray,
                W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """W made M-orthonormal and, once more, M-orthogonal to V: basis Q, M Q, and R with W = V (...) + Q R.

    Directions that are rounding only are dropped, so Q may have fewer columns than W.
    """
    comm = con.body.comm
    W, MW, R = _scaled(comm, W, apply(con.M, W), 1e-26)
    if V.shape[1]:
        left = dot(comm, MV, W)
        W = minus(W, V, left)
        MW = minus(MW, MV, left) if abs(left).max(initial=0.0) < CLEAN else apply(con.M, W)
    W, MW, S = _scaled(comm, W, MW, 0.25)
    return W, MW, S @ R


def _joined(V: np.ndarray, used: int, new: np.ndarray) -> np.ndarray:
    """V with new columns after those used; memory for many more is reserved, it costs nothing until written."""
    total = used + new.shape[1]
    if total > V.shape[1]:
        room = np.empty((V.shape[0], max(2 * used, ROOM * new.shape[1])), V.dtype, order="F")
        room[:, :used] = V[:, :used]
        V = room
    V[:, used:total] = new
    return V


def _scaled(comm: object, W: np.ndarray, MW: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """W Z, M W Z and R with W = (W Z) R; directions whose square is below ``least`` of the largest are dropped."""
    gram = dot(comm, W, MW)
    size, Z = np.linalg.eigh((gram + gram.conj().T) / 2)
    good = size > least * max(size[-1], np.finfo(float).tiny) if len(size) else size > 0
    root = np.sqrt(size[good])
    W, MW = (mix(A, Z[:, good] / root) for A in (W, MW))
    return W, MW, (Z[:, good] * root).conj().T


def _grown(H: np.ndarray, column: np.ndarray) -> np.ndarray:
    """The projected operator with one more block."""
    old = len(H)
    corner = (column[old:] + column[old:].conj().T) / 2
    return np.block([[H, column[:old]], [column[:old].conj().T, corner]])

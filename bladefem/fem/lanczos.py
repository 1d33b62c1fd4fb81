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


def lowest(con: Constrained, inverse: Callable[[np.ndarray], np.ndarray], start: np.ndarray, count: int,
           tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """The lowest eigenpairs of K x = lambda M x.

    Args:
        inverse: K^-1 (or what stands for it) on blocks (n_own, k).
        start: (n_own, k) first block.
        tolerance: largest |K^-1 M x - x / lambda| lambda in the M-norm: the direction's error times a gap.

    The vectors returned are K^-1 M x lambda, one free step of inverse iteration beyond the Ritz vectors x: it wipes out
    what rounding and the iteration leave in stiff directions.

    Returns:
        lam (count,) [rad^2/s^2] and this rank's (n_own, count) M-orthonormal vectors.

    Raises:
        NotSolvedError: fewer than ``count`` pairs exist, or the iteration does not converge.
    """
    comm = con.body.comm
    V = np.empty((start.shape[0], 0), con.dtype, order="F")
    H = np.zeros((0, 0), con.dtype)
    block, Mblock, _ = orthonormal(con, V, start.astype(con.dtype))
    for _ in range(STEPS):
        V = np.asfortranarray(np.concatenate([V, block], axis=1))
        W = inverse(Mblock)
        column = dot(comm, V, apply(con.M, W))
        H = _grown(H, column)
        block, Mblock, tail = orthonormal(con, V, minus(W, V, column))
        theta, S = eigh(H)
        theta, S = theta[::-1], S[:, ::-1]
        k = min(count, len(theta))
        error = np.linalg.norm(tail @ S[len(S) - tail.shape[1]:, :k], axis=0) / theta[:k]
        if not block.shape[1] and k < count:
            raise NotSolvedError(f"{count} modes were asked of a body that has {k} elastic ones")
        if (k == count and error.max() < tolerance) or not block.shape[1]:
            return 1 / theta[:k], mix(V, S[:, :k], block, tail @ S[len(S) - tail.shape[1]:, :k] / theta[:k])
    raise NotSolvedError(f"the modes did not converge in {STEPS} steps (error {error.max():.1e}, "
                         f"expected {tolerance:.1e})")


def orthonormal(con: Constrained, V: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """W made M-orthogonal to V (twice is enough) and M-orthonormal: basis Q, M Q, and R with W = V (...) + Q R.

    Directions that are rounding only are dropped, so Q may have fewer columns than W.
    """
    comm = con.body.comm
    R = np.eye(W.shape[1], dtype=con.dtype)
    for sweep in range(2):
        MW = apply(con.M, W)
        if V.shape[1]:
            W = minus(W, V, dot(comm, V, MW))
            MW = apply(con.M, W)
        gram = dot(comm, W, MW)
        size, Z = np.linalg.eigh((gram + gram.conj().T) / 2)
        good = size > (1e-26 * size[-1] if sweep == 0 else 0.25)
        root = np.sqrt(size[good])
        W, MW = (mix(A, Z[:, good] / root) for A in (W, MW))
        R = (Z[:, good] * root).conj().T @ R
    return W, MW, R


def _grown(H: np.ndarray, column: np.ndarray) -> np.ndarray:
    """The projected operator with one more block."""
    old = len(H)
    corner = (column[old:] + column[old:].conj().T) / 2
    return np.block([[H, column[:old]], [column[:old].conj().T, corner]])

"""Shift-inverted block Lanczos iteration on real or complex vectors, with full reorthogonalisation.

Parlett, The Symmetric Eigenvalue Problem (1998), chapter 13; blocks catch multiple eigenvalues, and
complex arithmetic leaves no doubled eigenvalues to sort out. Directions of the residual that matter
to no wanted pair wait instead of being solved with: with good first guesses most do. They stay part
of the residual, so its norm remains exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import eigh

from ..errors import InputError, NotSolvedError
from .compat import MPI
from .constraint import Constrained
from .linalg import apply_block, inner_products, linear_combinations, recombine, subtract_product
from .memory import give_back

# error of a vector's direction; that of a frequency is its square
DIRECTION_TOLERANCE = 1e-8
MAX_STEPS = 200
# share of old directions in a new one below which its image under M is corrected, not computed
# again
OLD_DIRECTION_SHARE = 1e-8
# least square of a column, of the largest, up to which one normalisation is enough
SINGLE_NORMALISATION_SHARE = 1e-6
# square of a direction, of the largest, below which it is dropped at once
DROPPED_DIRECTION_SHARE = 1e-26
# square of a direction, normalised once, from which on it was more than rounding
TRUE_DIRECTION = 0.25
# share of the tolerance below which a direction of the residual waits
DEFERRED_SHARE = 0.1


@dataclass(frozen=True)
class WantedPairs:
    """How many of the lowest eigenpairs are wanted, and how exactly."""

    count: int
    # largest |K^-1 M x - x / lambda| lambda in the M-norm: the direction's error times a gap
    tolerance: float = DIRECTION_TOLERANCE
    # pairs returned beyond count, as far as they have come
    guard: int = 0


@dataclass
class _Space:
    """K^-1 M V = V H + P C, with V and P M-orthonormal; V and P are lists of blocks, with their
    products by M.
    """

    V: list[np.ndarray] = field(default_factory=list)
    MV: list[np.ndarray] = field(default_factory=list)
    H: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    # at most two blocks: those that waited, the new ones
    P: list[np.ndarray] = field(default_factory=list)
    MP: list[np.ndarray] = field(default_factory=list)
    C: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


def lowest_eigenpairs(
    con: Constrained,
    inverse: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    wanted: WantedPairs,
) -> tuple[np.ndarray, np.ndarray]:
    """The lowest eigenpairs of K x = lambda M x.

    Args:
        inverse: K^-1 (or its replacement) on blocks (n_own, k).
        start: (n_own, k) first block.

    The vectors returned are K^-1 M x lambda, one free step of inverse iteration beyond the Ritz
    vectors x: it wipes out what rounding and the iteration leave in stiff directions.

    Returns:
        lam (count + guard,) [rad^2/s^2] and this rank's (n_own, count + guard) M-orthonormal
        vectors.

    Raises:
        InputError: fewer pairs exist than are wanted.
        NotSolvedError: the iteration does not converge.
    """
    count, tolerance = wanted.count, wanted.tolerance
    space = _Space()
    block, Mblock, _ = orthonormal(con, [], [], start.astype(con.dtype))
    for _ in range(MAX_STEPS):
        # pieces that are left behind, into which no block fits
        give_back()
        image = inverse(Mblock)
        give_back()
        _extend_basis(con, space, block, Mblock, image)
        del image
        theta, S = eigh(space.H)
        theta = theta[::-1]
        S = S[:, ::-1]
        k = min(count + wanted.guard, len(theta))
        rest = space.C @ S[:, :k] / theta[:k]
        error = np.linalg.norm(rest[:, :count], axis=0).max(initial=0.0)
        if (k >= count and error < tolerance) or not len(rest):
            _require_modes(count, k)
            # of no more use where memory is at its peak
            del block, Mblock
            space.MV.clear()
            space.MP.clear()
            give_back()
            return 1 / theta[:k], linear_combinations(
                [*space.V, *space.P], np.concatenate([S[:, :k], rest])
            )
        block, Mblock = _next_block(
            space, rest[:, :count], DEFERRED_SHARE * tolerance if k >= count else 0.0
        )
    raise NotSolvedError(
        f"the modes did not converge in {MAX_STEPS} steps (error {error:.1e}, "
        f"expected {tolerance:.1e})"
    )


def _require_modes(count: int, there: int) -> None:
    """The body has as many elastic modes as were asked for."""
    if there < count:
        raise InputError(
            f"{count} elastic modes were asked of a body that has {there}: expected fewer modes, "
            "or a mesh with more degrees of freedom"
        )


def orthonormal(
    con: Constrained,
    V: list[np.ndarray],
    MV: list[np.ndarray],
    W: np.ndarray,
    size: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """W made M-orthonormal and, once more, M-orthogonal to V: basis Q, M Q, and R with W = V (...)
    + Q R. Q takes the memory of W.

    Args:
        size: M-norm of what W was taken from. Directions that are rounding compared with it are
            dropped, so that Q may have fewer columns than W.
    """
    comm = con.body.comm
    W, MW, R, spread = _orthogonal_factor(
        comm, W, apply_block(con.M, W), DROPPED_DIRECTION_SHARE, DROPPED_DIRECTION_SHARE * size**2
    )
    left = inner_products(comm, MV, W)
    W = subtract_product(W, V, left)
    clean = abs(left).max(initial=0.0) < OLD_DIRECTION_SHARE
    if clean:
        MW = subtract_product(MW, MV, left)
    else:
        # both products at once would be the peak of memory
        del MW
        MW = apply_block(con.M, W)
    if clean and spread > SINGLE_NORMALISATION_SHARE:
        return W, MW, R
    # what is much longer than 1 now came from a direction that was rounding in the first product:
    # the others are no less true for that
    W, MW, S, _ = _orthogonal_factor(comm, W, MW, 0.0, TRUE_DIRECTION)
    return W, MW, S @ R


def _extend_basis(
    con: Constrained,
    space: _Space,
    block: np.ndarray,
    Mblock: np.ndarray,
    W: np.ndarray,
) -> None:
    """One more block of V, with its image W = K^-1 M block; what is left of that becomes a block of
    P.
    """
    comm = con.body.comm
    old = len(space.H)
    space.V.append(block)
    space.MV.append(Mblock)
    known = [*space.V, *space.P]
    Mknown = [*space.MV, *space.MP]
    column = inner_products(comm, Mknown, W)
    Q, MQ, tail = orthonormal(
        con, known, Mknown, subtract_product(W, known, column), float(np.linalg.norm(column))
    )
    total = old + block.shape[1]
    corner = (column[old:total] + column[old:total].conj().T) / 2
    space.H = np.block([[space.H, column[:old]], [column[:old].conj().T, corner]])
    space.C = np.block([[space.C, column[total:]], [np.zeros((Q.shape[1], old)), tail]])
    space.P.append(Q)
    space.MP.append(MQ)


def _next_block(
    space: _Space,
    rest: np.ndarray,
    rounding: float,
) -> tuple[np.ndarray, np.ndarray]:
    """The next block and its product by M, taken out of P: the directions that carry the residuals
    ``rest``.
    """
    U, s, _ = np.linalg.svd(rest)
    strong = np.count_nonzero(s > rounding) if rounding else len(U)
    P = space.P
    MP = space.MP
    weak = U[:, strong:]
    space.P, space.MP = (
        ([linear_combinations(P, weak)], [linear_combinations(MP, weak)]) if weak.size else ([], [])
    )
    space.C = weak.conj().T @ space.C
    return (
        (P[0], MP[0])
        if len(P) == 1 and not weak.size
        else (linear_combinations(P, U[:, :strong]), linear_combinations(MP, U[:, :strong]))
    )


def _orthogonal_factor(
    comm: MPI.Comm,
    W: np.ndarray,
    MW: np.ndarray,
    share: float,
    least: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """W Z, M W Z and R with W = (W Z) R, and the least square of a column, of the largest one's.

    Directions whose square is below ``least``, or below a share of the largest, are dropped.
    """
    gram = inner_products(comm, W, MW)
    size, Z = np.linalg.eigh((gram + gram.conj().T) / 2)
    tiny = float(np.finfo(float).tiny)
    good = size > max(share * size[-1], least, tiny) if len(size) else size > 0
    root = np.sqrt(size[good])
    Z = Z[:, good]
    W, MW = (recombine(A, Z / root) for A in (W, MW))
    return W, MW, (Z * root).conj().T, float((root[0] / root[-1]) ** 2) if len(root) else 1.0

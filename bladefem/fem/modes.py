"""Normal modes: SLEPc's Krylov-Schur iteration, or block Lanczos where there are good guesses.

SLEPc computes from scratch (eigensolver.py). Good guesses of many vectors at once, from other nodal
diameters, are finished by a block Lanczos iteration (lanczos.py): Krylov-Schur starts from one
vector only. An iteration from one vector may return one of a double eigenvalue, as a square beam
has; so the inertia of K - s M counts the eigenvalues, and what was missed is found by blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..data import ModeSet
from ..errors import InputError, NotSolvedError
from ..util.lockstep import run_together
from .compat import pages_kept
from .constraint import Constrained, expand_to_mesh, restrict_load
from .cyclic_schur import count_negative
from .eigensolver import Eigensolver, basis_size, krylov_schur
from .flexibility import Flexibility, compliance, compliances, flexible
from .lanczos import DIRECTION_TOLERANCE, WantedPairs, lowest_eigenpairs
from .linalg import (
    Folded,
    apply_block,
    column_norms,
    combined,
    inertia,
    inner_products,
    mean_diagonal,
    release,
)
from .memory import give_back
from .open_matrix import entries_of_sum

# error of a vector's direction where modes are looked at, not reduced with
SHOWN_DIRECTION_TOLERANCE = 1e-6
# of a gap between eigenvalues: where the inertia is counted
GAP_SHARE = 0.9
# relative gap of squared frequencies in which they can be counted
MIN_GAP = 1e-4
SLEPC = Eigensolver()
BLOCKS = Eigensolver("lanczos")
# bodies with fewer unknowns than this many times the basis are left to blocks, which end cleanly
# when the space is exhausted
MIN_SPARE_MODES = 3


def modes(
    con: Constrained,
    count: int,
    flex: Flexibility | None = None,
    tolerance: float = SHOWN_DIRECTION_TOLERANCE,
    solver: Eigensolver = SLEPC,
    prove: bool = True,
) -> ModeSet:
    """The lowest modes, rigid ones included, mass-normalised over the body (one sector of a wheel).

    Args:
        flex: factorisation to use, and to keep.
        tolerance: largest error of an eigenvector's direction in the M-norm.
        prove: count the eigenvalues by the inertia of one more factorisation.

    Raises:
        InputError: count is not positive, or more than the body has.
        NotSolvedError: no convergence; a mode that stays lost.
    """
    if count < 1:
        raise InputError(f"count is {count}, expected at least 1 mode")
    if not prove:
        wanted = WantedPairs(count, tolerance)
        return mode_set(con, *lowest_pairs(flex or flexible(con), wanted, solver=solver))
    if flex is not None:
        return mode_set(con, *proven_pairs(flex, count, tolerance, solver))
    # these factors make room for those of the count
    with pages_kept(large=True):
        own = flexible(con)
    give_back()
    return mode_set(con, *proven_pairs(own, count, tolerance, solver, keep=False))


def proven_pairs(
    flex: Flexibility,
    count: int,
    tolerance: float = DIRECTION_TOLERANCE,
    solver: Eigensolver = SLEPC,
    keep: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """``lowest_pairs`` whose number the inertia confirms; those that were missed are found by
    blocks.

    Args:
        keep: keep the factors while the eigenvalues are counted, which takes memory for both.

    Raises:
        NotSolvedError: the numbers differ even so.
    """
    lam, X = lowest_pairs(flex, WantedPairs(count, tolerance), solver=solver)
    if not lam[-1] > 0:
        # rigid motions alone, which geometry counts
        return lam, X
    upper, expected = _counting_shift(lam)
    if not keep:
        # the count takes their place: not given back in between
        release(flex.con.K, flex.factor)
    try:
        exact = count_below(flex.con, upper)
    finally:
        give_back()
    if exact == expected:
        return lam, X
    flex = flex if keep else flexible(flex.con)
    lam, X = lowest_pairs(flex, WantedPairs(max(count, exact), tolerance), solver=BLOCKS)
    found = np.count_nonzero(lam < upper)
    if found != exact:
        raise NotSolvedError(
            f"{found} modes were found below {np.sqrt(upper) / (2 * np.pi):.6g} Hz, the inertia "
            f"counts {exact}"
        )
    return lam[:count], X[:, :count]


def lowest_pairs(
    flex: Flexibility,
    wanted: WantedPairs,
    start: np.ndarray | None = None,
    solver: Eigensolver = SLEPC,
    inverse: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """(m,) eigenvalues [rad^2/s^2] and this rank's (n_own, m) M-orthonormal vectors, rigid motions
    first.

    Args:
        start: (n_own, k) good guesses of the vectors.
        inverse: computes K^+ B in place of ``flexibility.compliance``.
    """
    r = min(flex.R.shape[1], wanted.count)
    if r == wanted.count:
        return np.zeros(r), flex.R[:, :r]
    elastic = replace(wanted, count=wanted.count - r)
    lam, X = elastic_pairs(flex, elastic, inverse, start, solver)
    return np.concatenate([np.zeros(r), lam]), np.concatenate([flex.R[:, :r], X], axis=1)


def pairs_together(
    bodies: Sequence[Flexibility],
    wanted: WantedPairs,
    solver: Eigensolver = SLEPC,
) -> list[tuple[np.ndarray, np.ndarray]]:
    """``lowest_pairs`` of several nodal diameters from scratch, with iterations that advance
    together.

    A solve with one vector takes as long as the factors take to come from memory; the iterations
    share them, and each stays what it is alone but for rounding.
    """

    def iteration(flex: Flexibility) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
        own = existing_pairs(flex, wanted)
        return lambda ask: lowest_pairs(flex, own, None, solver, ask)

    def answer(asked: list[tuple[int, np.ndarray]]) -> list[np.ndarray]:
        return compliances([(bodies[i], B) for i, B in asked])

    return run_together([iteration(flex) for flex in bodies], answer)


def existing_pairs(flex: Flexibility, wanted: WantedPairs) -> WantedPairs:
    """The pairs wanted, with no more guards than the body has modes for."""
    return replace(wanted, guard=min(wanted.guard, flex.con.T.shape[1] - wanted.count))


def mode_set(
    con: Constrained,
    lam: np.ndarray,
    X: np.ndarray,
) -> ModeSet:
    """Modes with a certificate, in mesh numbering, in a basis and phase that do not depend on the
    ranks.
    """
    shapes = expand_to_mesh(con, X)
    images = shapes.reshape(-1, shapes.shape[2]).conj().T @ _rotation_probe(con, len(lam))
    turn = _basis_rotation(lam, images)
    residuals = certificate(con, lam, X @ turn)
    shapes = (shapes @ turn).transpose(2, 0, 1)
    if con.body.dim == 2:
        shapes = np.concatenate([shapes, np.zeros_like(shapes[:, :, :1])], axis=2)
    return ModeSet(np.sqrt(np.maximum(lam, 0)) / (2 * np.pi), shapes, con.nodal_diameter, residuals)


def certificate(
    con: Constrained,
    lam: np.ndarray,
    X: np.ndarray,
) -> np.ndarray:
    """(m,) |K x - lambda M x| / |K x|; for rigid motions |K x| over the largest |K x| of the
    set.
    """
    if not X.shape[1]:
        return np.zeros(0)
    KX = apply_block(con.K, X)
    comm = con.body.comm
    size = column_norms(comm, KX)
    scale = size.max() if (lam > 0).any() else _stiffness_scale(con, X)
    KX -= apply_block(con.M, X) * lam
    return column_norms(comm, KX) / np.where(lam > 0, size, scale)


def _stiffness_scale(con: Constrained, X: np.ndarray) -> float:
    """A force to measure |K x| of rigid motions by."""
    return mean_diagonal(con.K) * column_norms(con.body.comm, X).max()


def elastic_pairs(
    flex: Flexibility,
    wanted: WantedPairs,
    inverse: Callable[[np.ndarray], np.ndarray] | None = None,
    start: np.ndarray | None = None,
    solver: Eigensolver = SLEPC,
) -> tuple[np.ndarray, np.ndarray]:
    """The lowest elastic eigenpairs of K x = lambda M x.

    Args:
        inverse: its replacement for K^+ (fixed interfaces).
        start: (n_own, k) good guesses, finished by blocks; random loads, the same for any number of
            ranks, when left out.

    Raises:
        InputError: there are fewer.
        NotSolvedError: no convergence.
    """
    inverse = inverse or (lambda B: compliance(flex, B))
    few = flex.con.T.shape[1] < MIN_SPARE_MODES * basis_size(wanted.count)
    if start is None and solver.method == "slepc" and not few:
        # SLEPc begins with its image under K^-1 M
        first = restrict_load(flex.con, _rotation_probe(flex.con, 1))
        return krylov_schur(flex.con, inverse, first, wanted, solver)
    if start is None:
        width = min(max(8 if flex.con.dtype is float else 6, wanted.count // 3), 16)
        start = inverse(restrict_load(flex.con, _rotation_probe(flex.con, width)))
    elif flex.R.shape[1]:
        start = start - flex.R @ inner_products(flex.con.body.comm, flex.MR, start)
    return lowest_eigenpairs(flex.con, inverse, start, wanted)


def _rotation_probe(con: Constrained, width: int) -> np.ndarray:
    return _random_vectors(con.T.shape[0], width)


@lru_cache(maxsize=1)
def _random_vectors(rows: int, width: int) -> np.ndarray:
    """(rows, width) normally distributed numbers, kept for the nodal diameters that follow; not to
    be written to.
    """
    found = np.random.default_rng(20).standard_normal((rows, width))
    found.flags.writeable = False
    return found


def canonical(
    con: Constrained,
    lam: np.ndarray,
    X: np.ndarray,
) -> np.ndarray:
    """Bases of (nearly) multiple eigenvalues and phases of single ones, fixed by projecting given
    vectors.
    """
    return X @ _basis_rotation(
        lam, inner_products(con.body.comm, X, restrict_load(con, _rotation_probe(con, len(lam))))
    )


def _basis_rotation(lam: np.ndarray, images: np.ndarray) -> np.ndarray:
    """(m, m) the same as a rotation of the given basis, from its products X^H W (m, m) with given
    vectors.
    """
    out = np.zeros(images.shape, images.dtype)
    breaks = np.flatnonzero(np.diff(lam) > 1e-7 * lam[1:]) + 1
    for group in np.split(np.arange(len(lam)), breaks) if len(lam) else []:
        Q, R = np.linalg.qr(images[group, : len(group)])
        out[np.ix_(group, group)] = Q * (R.diagonal() / np.abs(R.diagonal()))
    return out


def count_below(con: Constrained, lam: float) -> int:
    """Number of eigenvalues below lam [rad^2/s^2], by Sylvester's law of inertia."""
    if isinstance(con.K, Folded) and isinstance(con.M, Folded) and con.K.core is not None:
        # the interior in the order that serves the stiffness too
        shifted = entries_of_sum(con.K.A, -lam, con.M.A)
        return count_negative(con.K.core.shifted(shifted), con.K.faces)
    return inertia(combined(con.K, -lam, con.M))


def highest_gap(lam: np.ndarray) -> int | None:
    """Number of the eigenvalue above the highest gap of ascending lam (m,) that is wide enough to
    count below it: what is missing anywhere under the gap shows. None where no gap is.
    """
    gaps = np.diff(lam) / np.maximum(lam[1:], np.finfo(float).tiny)
    wide = np.flatnonzero(gaps > MIN_GAP)
    return 1 + int(wide[-1]) if len(wide) else None


def _counting_shift(lam: np.ndarray) -> tuple[float, int]:
    """A shift [rad^2/s^2] near the upper end of the highest gap, and how many are below it: a gap
    may be wide because of what is missing in it. Above all of them where they are one multiple
    eigenvalue: between its copies there is rounding alone.
    """
    gap = highest_gap(lam)
    if gap is None:
        return lam[-1] * (1 + MIN_GAP), len(lam)
    return lam[gap - 1] + GAP_SHARE * (lam[gap] - lam[gap - 1]), gap

"""The boundary between ranks' parts of an open sector, eliminated: what is left are the cut faces.

Each rank has eliminated the interior of its part and holds a share of the Schur complement of the
boundary (s between parts, r on the cut faces). Summed, S_ss is eliminated once, densely, so that
nodal diameters cost as much as they do on one rank: a factorisation as large as a cut face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, lapack

from ..errors import IndefiniteError, NotSolvedError
from .compat import MPI
from .subdomains import Cut


@dataclass(frozen=True)
class Separators:
    """The unknowns between the parts of several ranks, eliminated."""

    cut: Cut
    # (ns, ns) lower Cholesky factor of S_ss; None where only the count is wanted
    factor: np.ndarray | None
    # (ns, nr) S_ss^-1 S_sr
    W: np.ndarray
    # negative eigenvalues of S_ss
    negative: int


def eliminate_separators(
    cut: Cut,
    share: np.ndarray,
    definite: bool,
) -> tuple[np.ndarray, Separators]:
    """The Schur complement of the cut faces (nr, nr), and what solves need.

    Args:
        share: (nt, nt) Schur complement of the part's boundary.

    Raises:
        NotSolvedError: S_ss is not positive definite (definite), or singular.
    """
    between = _summed_block(cut, share, cut.separator, cut.separator)
    across = _summed_block(cut, share, cut.separator, ~cut.separator)
    left = _summed_block(cut, share, ~cut.separator, ~cut.separator)
    del share
    # columns are shared out, for the products cost more than the factors
    mine = np.array_split(np.arange(len(left)), cut.comm.size)[cut.comm.rank]
    solved, factor, negative = _solve_between(between, across[:, mine], definite)
    W = _joined_columns(cut, solved, mine, len(left))
    product = _joined_columns(cut, across.T @ solved, mine, len(left))
    product *= 0.5
    left -= product
    left -= product.T
    return left, Separators(cut, factor, W, negative)


def _joined_columns(
    cut: Cut,
    piece: np.ndarray,
    mine: np.ndarray,
    columns: int,
) -> np.ndarray:
    """The columns of all ranks, of which this one has those numbered ``mine``."""
    out = np.zeros((len(piece), columns))
    out[:, mine] = piece
    cut.comm.Allreduce(MPI.IN_PLACE, out)
    return out


def _summed_block(
    cut: Cut,
    share: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
) -> np.ndarray:
    """Rows and columns (both (nb,) true or false) of the sum of all shares."""
    out = np.zeros((np.count_nonzero(rows), np.count_nonzero(columns)))
    # where those that the part touches are among the rows and the columns
    to_row, to_column = (np.cumsum(chosen)[cut.touched] - 1 for chosen in (rows, columns))
    i = np.flatnonzero(rows[cut.touched])
    j = np.flatnonzero(columns[cut.touched])
    out[np.ix_(to_row[i], to_column[j])] = share[np.ix_(i, j)]
    cut.comm.Allreduce(MPI.IN_PLACE, out)
    return out


def reduce_load(separators: Separators, load: np.ndarray) -> np.ndarray:
    """(nr, k) load of the boundary (nb, k) as the cut faces feel it."""
    between = separators.cut.separator
    return np.asarray(load[~between] - separators.W.T @ load[between])


def expand_faces(
    separators: Separators,
    load: np.ndarray,
    faces: np.ndarray,
) -> np.ndarray:
    """(nb, k) displacements of the boundary under its load, from those of the cut faces (nr, k)."""
    between = separators.cut.separator
    out = np.empty(load.shape, order="F")
    out[~between] = faces
    out[between] = separator_solve(separators, load[between]) - separators.W @ faces
    return out


def separator_solve(separators: Separators, load: np.ndarray) -> np.ndarray:
    """S_ss^-1 load (ns, k)."""
    assert separators.factor is not None
    return np.asarray(cho_solve((separators.factor, True), load))


def _solve_between(
    between: np.ndarray,
    across: np.ndarray,
    definite: bool,
) -> tuple[np.ndarray, np.ndarray | None, int]:
    """S_ss^-1 S_sr (ns, k), the Cholesky factor, and the number of negative eigenvalues."""
    if definite:
        try:
            factor, _ = cho_factor(between, lower=True)
        except np.linalg.LinAlgError as error:
            raise IndefiniteError(
                "the sector's stiffness is not positive definite: it has buckled"
            ) from error
        return cho_solve((factor, True), across), factor, 0
    ldu, pivots, solved, info = lapack.dsysv(between, across, lower=1)
    if info:
        raise NotSolvedError("the shift is an eigenvalue, expected a shift between two")
    return solved, None, negative_pivots(ldu, pivots)


def negative_pivots(ldu: np.ndarray, pivots: np.ndarray) -> int:
    """Number of negative eigenvalues from Bunch and Kaufman's factorisation: one in each pair."""
    single = pivots > 0
    return int((ldu.diagonal().real[single] < 0).sum()) + int((~single).sum()) // 2

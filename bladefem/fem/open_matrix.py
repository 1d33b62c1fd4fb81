"""Matrices of open sectors, kept as what they are made of: another copy of the stiffness would take
a tenth of the memory of a modal solve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True)
class Selected:
    """Rows and columns of a larger matrix, picked where they are used."""

    # (n, n) real, symmetric
    whole: sp.csr_matrix
    # (n_open,) rows and columns
    chosen: np.ndarray
    # whose memory the numbers are in, which must not change
    owner: object

    @property
    def shape(self) -> tuple[int, int]:
        """(n_open, n_open)"""
        return len(self.chosen), len(self.chosen)


@dataclass(frozen=True)
class Repeated:
    """The Kronecker product with the identity: the same for each direction, a third of the numbers
    to read.
    """

    # (n_open/dim,)*2
    nodal: sp.csr_matrix
    dim: int

    @property
    def shape(self) -> tuple[int, int]:
        """(n_open, n_open)"""
        n = self.dim * self.nodal.shape[0]
        return n, n


# share of rows up to which leaving some out one by one is cheaper than copying the others
FEW_DROPPED_ROWS = 0.05

OpenMatrix: TypeAlias = sp.csr_matrix | Selected | Repeated


def entries(A: OpenMatrix) -> sp.csr_matrix:
    """The matrix (n_open, n_open) with entries of its own, where it has none yet."""
    if isinstance(A, Selected):
        return picked(A.whole, A.chosen, A.chosen)
    if isinstance(A, Repeated):
        return chosen_rows(A, np.arange(A.shape[0]))
    return A


def entries_of_sum(
    A: OpenMatrix,
    factor: float,
    B: OpenMatrix,
) -> sp.csr_matrix:
    """A + factor B."""
    if isinstance(A, Selected) and isinstance(B, Repeated):
        total = entries(A)
        if _added_to_blocks(total, factor, B):
            return total
        return (total + factor * entries(B)).tocsr()
    return (entries(A) + factor * entries(B)).tocsr()


def _added_to_blocks(A: sp.csr_matrix, factor: float, B: Repeated) -> bool:
    """Whether factor B could be added in the place of A: a block of dim by dim numbers for each of
    B's nodal ones, as stiffness and mass of the same nodes have. A third of the time of a sum.
    """
    nodal, dim = B.nodal, B.dim
    if A.nnz != dim**2 * nodal.nnz:
        return False
    A.sort_indices()
    nodal.sort_indices()
    within = np.arange(nodal.nnz) - np.repeat(nodal.indptr[:-1], np.diff(nodal.indptr))
    places = []
    for i in range(dim):
        start = np.repeat(A.indptr[:-1][i::dim], np.diff(nodal.indptr))
        place = start + dim * within + i
        if place.max(initial=-1) >= A.nnz or (A.indices[place] != dim * nodal.indices + i).any():
            return False
        places.append(place)
    for place in places:
        A.data[place] += factor * nodal.data
    return True


def chosen_rows(A: OpenMatrix, places: np.ndarray) -> sp.csr_matrix:
    """(k, n_open) some rows."""
    if isinstance(A, Selected):
        return picked(A.whole, A.chosen[places], A.chosen)
    if isinstance(A, Repeated):
        node, direction = np.divmod(places, A.dim)
        rows = A.nodal[node]
        columns = A.dim * rows.indices + np.repeat(direction, np.diff(rows.indptr))
        return sp.csr_matrix((rows.data, columns, rows.indptr), (len(places), A.shape[1]))
    return A[places].tocsr()


def picked(A: sp.csr_matrix, rows: np.ndarray, columns: np.ndarray) -> sp.csr_matrix:
    """(k, l) some rows and columns of A (m, n), no column twice.

    The same as A[rows][:, columns] in a third of the time.
    """
    place = np.full(A.shape[1], -1, A.indices.dtype)
    place[columns] = np.arange(len(columns))
    dropped = np.setdiff1d(np.arange(A.shape[0]), rows)
    ascending = bool((np.diff(rows) > 0).all())
    if not ascending or len(dropped) > FEW_DROPPED_ROWS * A.shape[0]:
        A = A[rows]
        dropped = np.empty(0, int)
        rows = np.arange(A.shape[0])
    number = np.take(place, A.indices, mode="clip")
    kept = number >= 0
    for row in dropped:
        kept[A.indptr[row] : A.indptr[row + 1]] = False
    lengths = np.zeros(A.shape[0], A.indptr.dtype)
    filled = np.flatnonzero(np.diff(A.indptr))
    if len(filled):
        lengths[filled] = np.add.reduceat(kept, A.indptr[filled], dtype=lengths.dtype)
    starts = np.zeros(len(rows) + 1, A.indptr.dtype)
    np.cumsum(lengths[rows], out=starts[1:])
    return sp.csr_matrix((A.data[kept], number[kept], starts), (len(rows), len(columns)))


def diagonal(A: OpenMatrix) -> np.ndarray:
    """(n_open,)"""
    if isinstance(A, Selected):
        return np.asarray(A.whole.diagonal()[A.chosen])
    if isinstance(A, Repeated):
        return np.repeat(A.nodal.diagonal(), A.dim)
    return np.asarray(A.diagonal())


def times(A: OpenMatrix, X: np.ndarray) -> np.ndarray:
    """A X for real or complex X (n_open, k)."""
    if isinstance(A, Selected):
        moved = np.zeros((A.whole.shape[0], X.shape[1]), X.dtype)
        moved[A.chosen] = X
        return _real_times_complex(A.whole, moved)[A.chosen]
    if isinstance(A, Repeated):
        by_node = X.reshape(A.nodal.shape[0], -1)
        return _real_times_complex(A.nodal, by_node).reshape(X.shape)
    return _real_times_complex(A, X)


def _real_times_complex(A: sp.csr_matrix, X: np.ndarray) -> np.ndarray:
    """Real sparse matrix times a complex block, without a complex copy of the matrix."""
    if not np.iscomplexobj(X):
        return np.asarray(A @ X)
    X = np.ascontiguousarray(X)
    return np.asarray((A @ X.view(float)).view(complex))

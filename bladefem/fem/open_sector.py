"""A sector whose cut faces are free of each other: one factorisation of its interior serves all
nodal diameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.sparse as sp

from . import cyclic_schur as core
from .body import Body
from .compat import PETSc
from .distributed import local_rows, rows_of_rank, shared_rows, to_petsc
from .memory import give_back
from .open_matrix import OpenMatrix, Repeated, Selected, picked
from .ordering import interior_first
from .subdomains import Part, SharedBoundary, divide, matrix_share, share_boundary

# largest difference of masses of two directions, of the largest mass: rounding
SAME_MASS = 1e-14


@dataclass(frozen=True)
class Opened:
    """An open sector; of several ranks each has its part (subdomains.py), whose open unknowns these
    are.
    """

    # (n_points*dim, n_open) mesh displacements from open unknowns; of those on the boundary of
    # parts one rank only has the column
    T: sp.csr_matrix
    # (n_open,) the displacement in mesh numbering that each open unknown is
    places: np.ndarray
    # (n_open, n_open) [N/m]; the parts' add up
    K: OpenMatrix
    # [kg]
    M: OpenMatrix
    elimination: core.Elimination
    # (nb,) places of the boundary of all parts; empty on one rank
    boundary: np.ndarray
    # K of a body with the same nodes and constraints (collective)
    stiffness_of: Callable[[Body], OpenMatrix]

    @property
    def shared(self) -> SharedBoundary | None:
        """The boundary that joins the parts of several ranks; None on one rank."""
        return self.elimination.shared

    @property
    def core(self) -> core.Core:
        """K with its interior eliminated."""
        return self.elimination.core()


def open_sector(
    body: Body,
    T: sp.csr_matrix,
    start: np.ndarray,
    pattern: sp.csr_matrix,
    own: slice,
) -> Opened | None:
    """Matrices of the open sector (collective).

    Args:
        T: (n_points*dim, n_open) mesh displacements from open unknowns.
        start: (ranks+1,) first open unknown of each rank.
        pattern: (n_points*dim, n_free) which unknowns of nodal diameters a displacement has.
        own: unknowns of this rank.

    Returns:
        None where the sector is all cut face or its cut faces are all held, or where ranks cannot
        be parted.
    """
    rows = T.tocoo()
    unit = (rows.data == 1) & (np.diff(T.indptr)[rows.row] == 1)
    places = np.empty(T.shape[1], int)
    places[rows.col[unit]] = rows.row[unit]
    rim = core.rim_of(pattern[places])
    if len(rim) in (0, len(places)):
        return None
    if body.comm.size == 1:
        stiffness_of = partial(_open_stiffness, T=T, start=start)
        both = stiffness_of(body), _picked_mass(body, T) or _open_mass(body, T, start)
        return _opened(body, T, places, both, rim, None, np.empty(0, int), stiffness_of)
    part = shared = None
    shares = []
    for A in _open_matrices(body, T, start):
        part = part or divide(body, A, start, places, rim)
        if part is None:
            return None
        shared = shared or share_boundary(part, pattern[places], own)
        if shared is None:
            return None
        shares.append(matrix_share(part, A))
        del A
        give_back()
    assert part is not None and shared is not None
    K, M = shares
    members = part.members
    mine = (members >= part.owned[0]) & (members < part.owned[1])
    T_part = (T[:, members] @ sp.diags(mine.astype(float))).tocsr()
    T_part.eliminate_zeros()
    local_rim = np.arange(len(part.inside), len(members))
    stiffness_of = partial(_share_of_stiffness, part, T=T, start=start)
    on_boundary = places[part.boundary]
    return _opened(
        body, T_part, places[members], (K, M), local_rim, shared, on_boundary, stiffness_of
    )


def with_stiffness(opened: Opened, body: Body) -> Opened:
    """The open sector of a body of the same nodes and constraints with another stiffness, as
    rotation gives it (collective): the mass and the order of the elimination serve both.
    """
    K = opened.stiffness_of(body)
    return replace(opened, K=K, elimination=replace(opened.elimination, A=K, done=None))


def columns_of_part(opened: Opened, A: sp.csr_matrix) -> sp.csr_matrix:
    """(k, n) columns of A (k, n_free) that belong to the unknowns of this rank's part."""
    return A if opened.shared is None else A[:, opened.shared.columns].tocsr()


def boundary_map(opened: Opened, low: sp.csr_matrix, high: sp.csr_matrix) -> core.FaceMap:
    """How open unknowns depend on those of nodal diameters, but for the phase, which is 1 here.

    Args:
        low: (n_points*dim, n_free) the transformation T0 of nodal diameters.
        high: the part T1 that the phase belongs to.
    """
    shared = opened.shared
    pattern = abs(low) + abs(high)
    if shared is None:
        places, rim = opened.places, opened.elimination.rim
        inside = np.setdiff1d(np.arange(len(places)), rim)
        faces = places[rim]
        masters = np.unique(pattern[faces].indices)
        known = pattern[places[inside]].indices, masters, np.empty(0, int)
        return core.FaceMap(*known, low[faces][:, masters], high[faces][:, masters], 1.0)
    inner = len(shared.inside)
    pattern, low, high = (
        A[opened.boundary][:, shared.columns[inner:]].tocsr() for A in (pattern, low, high)
    )
    between = shared.cut.separator
    masters = np.unique(pattern[~between].indices)
    known = np.arange(inner), inner + masters, inner + pattern[between].indices
    return core.FaceMap(*known, low[~between][:, masters], high[~between][:, masters], 1.0)


def _opened(
    body: Body,
    T: sp.csr_matrix,
    places: np.ndarray,
    matrices: tuple[OpenMatrix, OpenMatrix],
    rim: np.ndarray,
    shared: SharedBoundary | None,
    boundary: np.ndarray,
    stiffness_of: Callable[[Body], OpenMatrix],
) -> Opened:
    """The record, with the order of the elimination."""
    K, mass = matrices
    M = mass if isinstance(mass, Repeated) else _of_one_direction(mass, places, body.dim)
    # the mass joins the same nodes as the stiffness, and has a ninth of its entries
    order = interior_first(M if isinstance(M, Repeated) else K, rim, places // body.dim)
    # what building the matrices took is of no more use
    give_back()
    elimination = core.Elimination(K, rim, order, shared, body.plan.on_disk)
    return Opened(T, places, K, M, elimination, boundary, stiffness_of)


def _open_matrices(
    body: Body,
    T: sp.csr_matrix,
    start: np.ndarray,
) -> Iterator[sp.csr_matrix]:
    """This rank's rows (n_own, n_open) of stiffness and mass, one after the other."""
    yield _open_matrix(body, body.K, T, start)
    yield _open_mass(body, T, start)


def _open_mass(body: Body, T: sp.csr_matrix, start: np.ndarray) -> sp.csr_matrix:
    """This rank's rows of the mass, without the zeros between its directions."""
    out = _open_matrix(body, body.M, T, start)
    out.eliminate_zeros()
    return out


def _picked_mass(body: Body, T: sp.csr_matrix) -> Repeated | None:
    """The mass of an open sector that one rank holds, picked from that of one direction; None where
    that is not there, or where nodes are held or tied in some directions only.
    """
    one = body.mass.of_one_direction
    if one is None or not _merely_selects(T):
        return None
    # open unknowns are numbered as the rows are
    chosen = body.scalar_rows[T.tocsc().indices]
    nodes = chosen[:: body.dim] // body.dim
    if not np.array_equal(chosen, (body.dim * nodes[:, None] + np.arange(body.dim)).ravel()):
        return None
    rows = shared_rows(one)
    nodal = picked(local_rows(one) if rows is None else rows, nodes, nodes)
    nodal.eliminate_zeros()
    nodal.sort_indices()
    return Repeated(nodal, body.dim)


def _open_matrix(
    body: Body,
    A: PETSc.Mat,
    T: sp.csr_matrix,
    start: np.ndarray,
) -> sp.csr_matrix:
    """This rank's rows (n_own, n_open) of T^T A T."""
    if _merely_selects(T):
        out = _selected(body, A, T, start)
    elif body.comm.size == 1:
        local = T[rows_of_rank(body)]
        out = (local.T @ local_rows(A) @ local).tocsr()
    else:
        out = local_rows(A.ptap(to_petsc(body, T, start)))
    out.sum_duplicates()
    return out


def _merely_selects(T: sp.csr_matrix) -> bool:
    """Each open unknown is a displacement, and none is two."""
    return T.nnz == T.shape[1] and bool((T.data == 1).all())


def _open_stiffness(body: Body, T: sp.csr_matrix, start: np.ndarray) -> OpenMatrix:
    """The stiffness of an open sector that one rank holds, on the body's own memory if it can
    be.
    """
    whole = shared_rows(body.K) if _merely_selects(T) else None
    if whole is None:
        return _open_matrix(body, body.K, T, start)
    # open unknowns are numbered as the rows are
    return Selected(whole, body.scalar_rows[T.tocsc().indices], body.K)


def _share_of_stiffness(
    part: Part, body: Body, T: sp.csr_matrix, start: np.ndarray
) -> sp.csr_matrix:
    """This rank's share of the stiffness of an open sector that several ranks hold."""
    return matrix_share(part, _open_matrix(body, body.K, T, start))


def _selected(
    body: Body,
    A: PETSc.Mat,
    T: sp.csr_matrix,
    start: np.ndarray,
) -> sp.csr_matrix:
    """T^T A T where T merely selects unknowns, by indexing."""
    first, last = A.owner_range
    # open unknowns are numbered as the rows are
    chosen = body.scalar_rows[T.tocsc().indices]
    rank = body.comm.rank
    own = chosen[start[rank] : start[rank + 1]] - first
    assert not len(own) or (own.min() >= 0 and own.max() < last - first)
    return local_rows(A)[own][:, chosen].tocsr()


def _of_one_direction(
    M: sp.csr_matrix,
    places: np.ndarray,
    dim: int,
) -> OpenMatrix:
    """A mass matrix that is the same in all directions by its nodes' part; others as they are."""
    if len(places) % dim or M.nnz % dim:
        return M
    whole = places.reshape(-1, dim) - np.arange(dim)
    if (whole % dim).any() or (whole != whole[:, :1]).any():
        return M
    M.sort_indices()
    nodal = M[::dim, ::dim].tocsr()
    nodal.sort_indices()
    again = sp.kron(nodal, sp.identity(dim), "csr")
    again.sort_indices()
    same = np.array_equal(again.indptr, M.indptr) and np.array_equal(again.indices, M.indices)
    if not same or abs(again.data - M.data).max(initial=0.0) > SAME_MASS * abs(M.data).max():
        return M
    return Repeated(nodal, dim)

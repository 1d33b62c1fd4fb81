"""An open sector cut apart for ranks: each holds the unknowns inside of its own part, all hold
those on the boundaries.

The mesh is distributed already. Nodes that belong to cells of several ranks separate the parts;
with those on the cut faces of the sector they are the boundary. A rank's share of a matrix couples
what is inside of its part with itself and with the boundary; the shares add up to the matrix. So
products and eliminations of the interior run on each rank alone, and only values on the boundary
are exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .body import Body
from .compat import MPI, cell_dofs


@dataclass(frozen=True)
class Cut:
    """The boundary of all parts, as the rank sees it that holds one of them."""

    comm: MPI.Comm
    # (nb,) true for unknowns between parts, false for those on the cut faces of the sector
    separator: np.ndarray
    # (nt,) those of the nb that this rank's part touches, ascending
    touched: np.ndarray


@dataclass(frozen=True)
class SharedBoundary:
    """From this rank's unknowns x (n_own, k) to those of its part z (ni + nf, k): inside, then all
    on the boundary.
    """

    cut: Cut
    # open unknowns of all ranks
    open_size: int
    # (ni + nf,) number of each unknown of the part among those of all ranks
    columns: np.ndarray
    # (ni,) places in x of those inside
    inside: np.ndarray
    # (no,) places in x of those on the boundary
    outside: np.ndarray
    # (no,) and their places among the nf
    position: np.ndarray

    @property
    def size(self) -> int:
        """Unknowns of this rank."""
        return len(self.inside) + len(self.outside)


@dataclass(frozen=True)
class Part:
    """A rank's part of the open unknowns: those inside, then those of the boundary that it
    touches.
    """

    cut: Cut
    # (nb,) numbers of the boundary's open unknowns, ascending
    boundary: np.ndarray
    # (ni,) open unknowns inside, ascending
    inside: np.ndarray
    # first open unknown of this rank, and the first one beyond
    owned: tuple[int, int]

    @property
    def members(self) -> np.ndarray:
        """(ni + nt,) numbers of its open unknowns."""
        return np.concatenate([self.inside, self.boundary[self.cut.touched]])


def shared_nodes(body: Body) -> np.ndarray:
    """(n_points,) true for nodes that belong to cells of several ranks."""
    space = body.space
    cells = space.mesh.topology.index_map(space.mesh.topology.dim).size_local
    blocks = np.unique(cell_dofs(space)[:cells]).astype(np.int32)
    ranks = np.zeros(int(body.rows.max()) + 1, np.int32)
    ranks[space.dofmap.index_map.local_to_global(blocks)] = 1
    body.comm.Allreduce(MPI.IN_PLACE, ranks)
    return (body.rows >= 0) & (ranks[body.rows] > 1)


def divide(
    body: Body,
    rows: sp.csr_matrix,
    start: np.ndarray,
    places: np.ndarray,
    rim: np.ndarray,
) -> Part | None:
    """Cut an open sector along the ranks' parts of the mesh (collective).

    Args:
        rows: (n_own, n_open) this rank's rows of a matrix that couples all that is coupled.
        start: (ranks+1,) first open unknown of each rank.
        places: (n_open,) the displacement in mesh numbering that each open unknown is.
        rim: open unknowns on the cut faces of the sector.

    Returns:
        None on all ranks where one of them has nothing inside, or no boundary.
    """
    comm = body.comm
    first, last = int(start[comm.rank]), int(start[comm.rank + 1])
    outer = shared_nodes(body)[places // body.dim]
    outer[rim] = True
    own = np.arange(first, last)
    # constraints may couple what the mesh does not: that joins the boundary, too
    inner = rows[np.flatnonzero(~outer[own])]
    foreign = ((inner.indices < first) | (inner.indices >= last)) & ~outer[inner.indices]
    strange = inner.indices[foreign]
    for more in comm.allgather(np.unique(strange)):
        outer[np.isin(places // body.dim, places[more] // body.dim)] = True
    boundary = np.flatnonzero(outer)
    inside = own[~outer[own]]
    # all that rows of this rank have entries for, its own unknowns included
    touched = np.zeros(len(places), bool)
    touched[rows.indices] = True
    touched = np.flatnonzero(touched[boundary])
    if comm.allreduce(not len(inside) or not len(touched), MPI.LOR):
        return None
    on_rim = np.isin(boundary, rim)
    return Part(Cut(comm, ~on_rim, touched), boundary, inside, (first, last))


def matrix_share(part: Part, rows: sp.csr_matrix) -> sp.csr_matrix:
    """(ni + nt,)*2 this rank's share of a symmetric matrix, of which it has the rows (n_own,
    n_open): symmetric, too.
    """
    first, last = part.owned
    boundary = part.boundary[part.cut.touched]
    inner = rows[part.inside - first]
    # all columns of these rows are the part's
    place = np.full(rows.shape[1], -1, np.int32)
    place[part.members] = np.arange(len(part.members), dtype=np.int32)
    top = sp.csr_matrix(
        (inner.data, place[inner.indices], inner.indptr), (len(part.inside), len(part.members))
    )
    turned = inner[:, boundary].T.tocsr()
    mine = np.flatnonzero((boundary >= first) & (boundary < last))
    put = sp.csr_matrix(
        (np.ones(len(mine)), (mine, np.arange(len(mine)))), shape=(len(boundary), len(mine))
    )
    half = 0.5 * (put @ rows[boundary[mine] - first][:, boundary])
    # shares the memory of ``inner``, which must be of no more use
    top.sort_indices()
    bottom = sp.hstack([turned, half + half.T], format="csr")
    out = sp.vstack([top, bottom], format="csr")
    out.sort_indices()
    return out


def share_boundary(
    part: Part,
    pattern: sp.csr_matrix,
    own: slice,
) -> SharedBoundary | None:
    """How a rank's unknowns become those of its part (collective).

    Args:
        pattern: (n_open, n_free) without zeros where open unknowns depend on the unknowns of nodal
            diameters.
        own: unknowns of this rank.

    Returns:
        None on all ranks where an unknown inside is not an unknown of the same rank.
    """
    inside = pattern[part.inside].indices
    boundary = np.unique(pattern[part.boundary].indices)
    outside = boundary[(boundary >= own.start) & (boundary < own.stop)]
    together = np.sort(np.concatenate([inside, outside]))
    fits = np.array_equal(together, np.arange(own.start, own.stop))
    if not part.cut.comm.allreduce(fits, MPI.LAND):
        return None
    return SharedBoundary(
        part.cut,
        pattern.shape[0],
        np.concatenate([inside, boundary]),
        inside - own.start,
        outside - own.start,
        np.searchsorted(boundary, outside),
    )


def own_part(shared: SharedBoundary, X: np.ndarray) -> np.ndarray:
    """(ni + nf, k) with what this rank owns of the boundary, zero elsewhere on it."""
    out = np.empty((len(shared.columns), X.shape[1]), X.dtype, order="F")
    inner = len(shared.inside)
    # column by column: numpy picks rows of a whole block several times slower
    for x, z in zip(X.T, out.T, strict=True):
        np.take(x, shared.inside, out=z[:inner], mode="clip")
        z[inner:] = 0
        z[inner + shared.position] = x[shared.outside]
    return out


def whole_part(shared: SharedBoundary, X: np.ndarray) -> np.ndarray:
    """(ni + nf, k) with all values on the boundary (collective)."""
    out = own_part(shared, X)
    _add_boundaries(shared, out)
    return out


def back_to_ranks(shared: SharedBoundary, Z: np.ndarray) -> np.ndarray:
    """(n_own, k) from values (ni + nf, k) that all ranks agree on."""
    out = np.empty((shared.size, Z.shape[1]), Z.dtype, order="F")
    inner = len(shared.inside)
    for x, z in zip(out.T, Z.T, strict=True):
        x[shared.inside] = z[:inner]
        x[shared.outside] = z[inner + shared.position]
    return out


def sum_of_parts(shared: SharedBoundary, Z: np.ndarray) -> np.ndarray:
    """(n_own, k) the same where each rank has a summand only of what is on the boundary
    (collective).
    """
    _add_boundaries(shared, Z)
    return back_to_ranks(shared, Z)


def _add_boundaries(shared: SharedBoundary, Z: np.ndarray) -> None:
    """Sum over the ranks what Z (ni + nf, k) has on the boundary, in place."""
    inner = len(shared.inside)
    summed = np.ascontiguousarray(Z[inner:])
    shared.cut.comm.Allreduce(MPI.IN_PLACE, summed)
    Z[inner:] = summed

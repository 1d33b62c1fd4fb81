"""The space that the vectors of a few nodal diameters span.

Their real and imaginary parts nearly span the vectors of all other nodal diameters. Projected onto
them the three matrices of K(n) are small, and their modes are where others start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from ..data import SectorSpan
from .constraint import (
    Transformation,
    high_part,
)
from .linalg import (
    apply_block,
    inner_products,
    linear_combinations,
    subtract_product,
)
from .open_matrix import chosen_rows, times
from .open_sector import columns_of_part
from .subdomains import whole_part

# columns of a sparse product at a time, to spare memory
COLUMNS_AT_A_TIME = 16


@dataclass(frozen=True)
class DiameterSpace:
    """The space that the vectors of some nodal diameters span, and the matrices on it."""

    # (n_own, at least m) memory of W, with room for more
    store: np.ndarray
    # (n_own, m) nearly orthonormal, real
    W: np.ndarray
    # (m, m) projections of K0, Kc, Ks
    K: list[np.ndarray]
    M: list[np.ndarray]


def sector_span(t: Transformation, blocks: list[np.ndarray], P: sp.spmatrix) -> SectorSpan:
    """The space that vectors of some nodal diameters span, with its matrices and motions of the
    ports, for the reduction of all others (collective).

    Args:
        blocks: (n_own, k) vectors of each of them, as this rank's unknowns.
        P: (n_points*dim, p) port vectors in mesh numbering.
    """
    space = extend_space(t, list(blocks), None)
    rank = t.body.comm.rank
    own = slice(int(t.start[rank]), int(t.start[rank + 1]))
    ports = sp.csc_matrix(P).T

    def moved(T: sp.csr_matrix) -> np.ndarray:
        local = (ports @ T).tocsc()[:, own] @ space.W
        return np.asarray(t.body.comm.allreduce(local) if t.body.comm.size > 1 else local)

    return SectorSpan(np.array(space.K), np.array(space.M), moved(t.low), moved(high_part(t)))


def extend_space(
    t: Transformation,
    blocks: list[np.ndarray],
    known: DiameterSpace | None,
    room: int = 0,
) -> DiameterSpace:
    """The parts of more vectors added to a space; what it has already is projected once.

    Args:
        blocks: (n_own, k) the vectors, which are taken out: both at once would be the peak of
            memory.
        room: columns of a new space that are set aside for later ones.
    """
    new = _span_parts(blocks, t, known)
    blocks.clear()
    if known is not None and not new.shape[1]:
        # it holds every motion of a coarse sector already
        return known
    old = 0 if known is None else known.W.shape[1]
    width = old + new.shape[1]
    store = np.empty((len(new), max(room, width)), order="F") if known is None else known.store
    assert width <= store.shape[1]
    store[:, old:width] = new
    del new
    W = store[:, :width]
    columns = _project_columns(t, W, slice(old, width))
    if known is None:
        return DiameterSpace(store, W, *columns)
    return DiameterSpace(
        store,
        W,
        *(
            [_append_columns(*each) for each in zip(A, B, (1, 1, -1), strict=True)]
            for A, B in zip((known.K, known.M), columns, strict=True)
        ),
    )


def _append_columns(
    A: np.ndarray,
    columns: np.ndarray,
    sign: int,
) -> np.ndarray:
    """A symmetric (sign 1) or skew (-1) matrix with more columns, and the rows that they imply."""
    old = len(A)
    return np.block([[A, columns[:old]], [sign * columns[:old].T, columns[old:]]])


def initial_vectors(
    space: DiameterSpace,
    t: Transformation,
    nodal_diameter: int,
    count: int,
) -> np.ndarray:
    """(n_own, count at most) lowest vectors of the projected pencil, in single precision: the space
    is wrong by more, and those of all nodal diameters wait side by side.
    """
    angle = 2 * np.pi * nodal_diameter / t.sectors
    # a coarse sector has fewer than ``count``
    Z = _projected_modes(space.K, space.M, angle, count)
    if 2 * nodal_diameter % t.sectors == 0:
        return np.asarray(linear_combinations(space.W, Z.real), np.float32)
    out = np.empty((len(space.W), Z.shape[1]), np.complex64, order="F")
    out.real, out.imag = linear_combinations(space.W, Z.real), linear_combinations(space.W, Z.imag)
    return out


def _span_parts(
    blocks: list[np.ndarray],
    t: Transformation,
    known: DiameterSpace | None,
) -> np.ndarray:
    """(n_own, m) nearly orthonormal real basis of what all parts of the vectors add to the space
    known.
    """
    parts = [part for X in blocks for part in ((X.real, X.imag) if np.iscomplexobj(X) else (X,))]
    W = np.empty((len(parts[0]), sum(part.shape[1] for part in parts)), order="F")
    np.concatenate(parts, axis=1, out=W)
    gram = inner_products(t.body.comm, W, W)
    # imaginary parts are zero where nothing joins the sectors
    length = np.maximum(np.sqrt(gram.diagonal()), np.finfo(float).tiny ** 0.25)
    if known is not None:
        W = subtract_product(W, [known.W], inner_products(t.body.comm, known.W, W))
        gram = inner_products(t.body.comm, W, W)
    size, Z = np.linalg.eigh(gram / np.outer(length, length))
    good = size > 1e-13
    return linear_combinations(W, Z[:, good] / np.sqrt(size[good]) / length[:, None])


def _project_columns(
    t: Transformation,
    W: np.ndarray,
    new: slice,
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """(m, new) columns of the projections of K0, Kc, Ks and of M0, Mc, Ms."""
    comm = t.body.comm
    if t.opened is None:
        stiff = [inner_products(comm, W, apply_block(A, W[:, new])) for A in t.K]
        return stiff, [inner_products(comm, W, apply_block(A, W[:, new])) for A in t.M]
    shared = t.opened.shared
    W = W if shared is None else whole_part(shared, W)
    T1 = columns_of_part(t.opened, high_part(t)[t.opened.places])
    faces = np.flatnonzero(np.diff(T1.indptr))
    low = columns_of_part(t.opened, t.low[t.opened.places])
    high = _few_rows_times(T1[faces], W)
    out = []
    both = t.opened.K, t.opened.M
    inner = _project_interior(both, (low, W), high, faces, new)
    for A, (LL, HL) in zip(both, inner, strict=True):
        beside = chosen_rows(A, faces)
        coupling = beside.T.tocsr()
        near = np.flatnonzero(np.diff(coupling.indptr))
        LH = _few_rows_times(low[near], W).T @ (coupling[near] @ high[:, new])
        own = [LL + high.T @ (beside[:, faces] @ high[:, new]), LH + HL, LH - HL]
        out.append([comm.allreduce(part) for part in own] if comm.size > 1 else own)
    K, M = out
    return K, M


def _few_rows_times(A: sp.csr_matrix, W: np.ndarray) -> np.ndarray:
    """A W with the rows of W alone that A needs: SciPy copies what it multiplies."""
    needed = np.unique(A.indices)
    return np.asarray(A[:, needed] @ W[needed])


def _project_interior(
    both: tuple[Any, Any],
    low: tuple[sp.csr_matrix, np.ndarray],
    high: np.ndarray,
    faces: np.ndarray,
    new: slice,
) -> list[tuple[np.ndarray, np.ndarray]]:
    """low^T A low and high^T A low of some columns, for K and for M.

    Args:
        low: its two factors. Their product, as large as the whole space, is made a few columns at
            a time.
    """
    T0, W = low
    turned = T0.T.tocsr()
    pieces: list[list[tuple[np.ndarray, np.ndarray]]] = [[], []]
    for first in range(new.start, W.shape[1], COLUMNS_AT_A_TIME):
        moved = np.ascontiguousarray(T0 @ W[:, first : first + COLUMNS_AT_A_TIME])
        for piece, A in zip(pieces, both, strict=True):
            image = times(A, moved)
            piece.append((W.T @ (turned @ image), high.T @ image[faces]))
    return [
        (
            np.concatenate([own for own, _ in piece], axis=1),
            np.concatenate([x for _, x in piece], axis=1),
        )
        for piece in pieces
    ]


def _projected_modes(
    K: list[np.ndarray],
    M: list[np.ndarray],
    angle: float,
    count: int,
) -> np.ndarray:
    """(m, count) lowest eigenvectors of the projected pencil."""
    sine = 1j * np.sin(angle) if abs(np.sin(angle)) > 1e-12 else 0.0
    pencil = [A[0] + np.cos(angle) * A[1] + sine * A[2] for A in (K, M)]
    return eigh(*[(A + A.conj().T) / 2 for A in pencil])[1][:, :count]

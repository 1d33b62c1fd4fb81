"""Cyclic symmetry with one factorisation for all nodal diameters.

The unknowns of an open sector are its interior (i) and its two cut faces, the rim (b). Only the rim
knows the nodal diameter, so the interior is eliminated once, in real arithmetic, down to the Schur
complement S of the rim; nodal diameter n then costs a dense Cholesky of C_b(n)^H S C_b(n), as large
as one cut face. A solve takes one sweep down and one up over the interior's factors for each of the
real and imaginary parts. Of several ranks each eliminates the interior of its own part
(subdomains.py); what is between the parts is eliminated next (separators.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve, lapack, lu_factor, lu_solve

from ..errors import IndefiniteError, NotSolvedError
from .compat import MPI, shared_matrix
from .memory import give_back
from .mumps import Factorised, factorise_matrix, solve_matrix
from .open_matrix import OpenMatrix, entries, picked
from .schur import (
    Bridge,
    drop_complement,
    replace_dense_solve,
    schur_complement,
    solve_through_boundary,
)
from .separators import (
    Separators,
    eliminate_separators,
    expand_faces,
    negative_pivots,
    reduce_load,
)
from .subdomains import SharedBoundary, back_to_ranks, own_part

# complex columns a solve: from 32 real ones on MUMPS runs at the speed of matrix products, and each
# takes five times its memory
COLUMNS_PER_SOLVE = 16


@dataclass(frozen=True)
class Core:
    """An open sector with its interior eliminated."""

    # of the interior
    factor: Factorised
    # (ni,) open unknowns inside
    inner: np.ndarray
    # (nb,) open unknowns on the cut faces
    rim: np.ndarray
    # (nb, nb) Schur complement of the rim [N/m]
    S: np.ndarray
    # (nb, ni) A_bi; empty where only the count is wanted
    coupling: sp.csr_matrix
    # to the rim's system amid a solve; None: two solves instead
    bridge: Bridge | None
    # (ni+nb,) place of each unknown in the elimination, to use again; None: MUMPS's own
    order: np.ndarray | None
    # negative eigenvalues of all that is eliminated, of all ranks
    negative: int
    # several ranks: A is this rank's share, rim what its part touches of the boundary, S is left
    # after the elimination of the separators
    shared: SharedBoundary | None = None
    separators: Separators | None = None
    # what all nodal diameters make their Schur complement of, once one has asked
    folded: list[_FoldedParts] = field(default_factory=list)


@dataclass(frozen=True)
class FaceMap:
    """How open unknowns depend on the unknowns of one nodal diameter (of this rank's part)."""

    # (ni,) the unknown that each open one inside is
    inner: np.ndarray
    # (nm,) unknowns on the low cut face
    masters: np.ndarray
    # (ns,) between the ranks' parts
    between: np.ndarray
    # (nr, nm) real: open unknowns of the cut faces from masters are low + phase high
    low: sp.csr_matrix
    high: sp.csr_matrix
    phase: complex

    @cached_property
    def C(self) -> sp.csr_matrix:
        """(nr, nm) open unknowns of the cut faces from masters."""
        return (self.low + self.phase * self.high).tocsr()


@dataclass(frozen=True)
class _FoldedParts:
    """C^H S C = own + phase across + conj(phase) across^T, real and imaginary part by part."""

    # of the maps that they were made with
    low: sp.csr_matrix
    high: sp.csr_matrix
    # (nm, nm) low^T S low + high^T S high
    own: np.ndarray
    # (nm, nm) across + across^T and across - across^T of across = low^T S high
    even: np.ndarray
    odd: np.ndarray


@dataclass(frozen=True)
class Rim:
    """One nodal diameter on top of a core."""

    core: Core
    faces: FaceMap
    # Cholesky factor, or LU where indefinite
    dense: tuple[np.ndarray, Any]
    # negative eigenvalues; -1 when Cholesky proved that there are none
    negative: int

    @property
    def bytes(self) -> float:
        """Memory of the factors [bytes]."""
        return self.core.factor.bytes + self.core.S.nbytes + self.dense[0].nbytes


def rim_of(C: sp.csr_matrix) -> np.ndarray:
    """Open unknowns on the cut faces: those not passed through one to one."""
    column = np.bincount(C.indices, minlength=C.shape[1])
    alone = np.diff(C.indptr) == 1
    alone[alone] = column[C.indices[C.indptr[:-1][alone]]] == 1
    return np.flatnonzero(~alone)


def face_map(C: sp.csr_matrix) -> FaceMap:
    """The map of a sector that one rank holds, from its C (n_open, n_free)."""
    rim = rim_of(C)
    inner = np.setdiff1d(np.arange(C.shape[0]), rim)
    on_face = np.unique(C[rim].indices)
    faces = C[rim][:, on_face].tocsr()
    part = C[inner].indices, on_face, np.empty(0, int), faces.real.tocsr()
    if not np.iscomplexobj(faces):
        return FaceMap(*part, sp.csr_matrix(faces.shape), 1.0)
    return FaceMap(*part, faces.imag.tocsr(), 1j)


def eliminate_interior(
    A: sp.csr_matrix,
    rim: np.ndarray,
    *,
    definite: bool = True,
    order: np.ndarray | None = None,
    keep: bool = True,
    shared: SharedBoundary | None = None,
    on_disk: bool = False,
) -> Core:
    """Eliminate the interior (collective where it is shared).

    Args:
        order: see ``ordering.interior_first``.
        keep: keep the factors, for solves; else for :func:`count_negative` alone.
        shared: of the ranks' parts, where A is this rank's share.
        on_disk: see :func:`mumps.factorise_matrix`.

    Raises:
        NotSolvedError: from MUMPS, on any rank.
    """
    A.sort_indices()
    matrix = shared_matrix(A.shape, A.indptr, A.indices, A.data)
    factor = _factorise_together(
        lambda: factorise_matrix(
            matrix, definite=definite, schur=rim, order=order, keep=keep, on_disk=on_disk
        ),
        shared,
    )
    matrix.destroy()
    inner = np.setdiff1d(np.arange(A.shape[0]), rim)
    negative = factor.negative
    separators = None
    S = schur_complement(factor, len(rim))
    bridge = replace_dense_solve(factor, len(rim)) if definite else None
    # with several ranks it can be as large as two cut faces
    drop_complement(factor, len(rim))
    if shared is not None:
        S, separators = eliminate_separators(shared.cut, S, definite)
        give_back()
        negative = shared.cut.comm.allreduce(negative) + separators.negative
    # only solves look at it
    coupling = picked(A, rim, inner) if keep else sp.csr_matrix((len(rim), len(inner)))
    return Core(
        factor,
        inner,
        rim,
        S,
        coupling,
        bridge,
        order,
        negative,
        shared,
        separators,
    )


@dataclass
class Elimination:
    """The elimination of an open sector's interior, done when it is asked for first."""

    # (n_open, n_open) [N/m], see Core
    A: OpenMatrix
    rim: np.ndarray
    order: np.ndarray | None
    shared: SharedBoundary | None
    # where the factors are kept
    on_disk: bool = False
    done: Core | None = None

    def core(self) -> Core:
        """The eliminated interior (collective where it is shared)."""
        if self.done is None:
            self.done = eliminate_interior(
                entries(self.A),
                self.rim,
                order=self.order,
                shared=self.shared,
                on_disk=self.on_disk,
            )
        return self.done

    def release(self) -> None:
        """Give the memory of the factors back; what holds a core must not solve with it again."""
        if self.done is not None:
            # its callback would keep it
            self.done.factor.matrix.destroy()
            self.done = None

    def shifted(self, A: sp.csr_matrix) -> Core:
        """Another matrix of the same pattern with its interior eliminated, for
        ``count_negative``.
        """
        return eliminate_interior(
            A, self.rim, definite=False, order=self.order, keep=False, shared=self.shared
        )


def _factorise_together(
    factorise: Callable[[], Factorised],
    shared: SharedBoundary | None,
) -> Factorised:
    """A factorisation that fails on all ranks where it fails on one."""
    if shared is None:
        return factorise()
    factor = None
    error = None
    try:
        factor = factorise()
    except NotSolvedError as problem:
        error = problem
    for failure in shared.cut.comm.allgather(error):
        if failure is not None:
            raise failure
    assert factor is not None
    return factor


def join_cut_faces(
    core: Core,
    faces: FaceMap,
    definite: bool = True,
    springs: np.ndarray | None = None,
) -> Rim:
    """Join the cut faces for one nodal diameter.

    Args:
        springs: on the diagonal of the unknowns of this rank's part; those on the low cut face
            count.

    Raises:
        NotSolvedError: the sector can still move (definite) or a shift hits an eigenvalue.
    """
    S = _folded_complement(core, faces)
    if springs is not None:
        S = S + np.diag(springs[faces.masters])
    if not definite:
        return Rim(core, faces, lu_factor(S), core.negative + _count_negative(S))
    floats = "the sector's stiffness is not positive definite: it floats, or it has buckled"
    try:
        dense = cho_factor(S, lower=True)
    except np.linalg.LinAlgError as error:
        raise IndefiniteError(floats) from error
    # of a singular matrix rounding leaves a last pivot of either sign
    pivots = dense[0].diagonal().real ** 2
    if (pivots < len(S) * np.finfo(float).eps * S.diagonal().real).any():
        raise IndefiniteError(floats)
    return Rim(core, faces, dense, -1)


def count_negative(core: Core, faces: FaceMap) -> int:
    """Number of negative eigenvalues of C^H A C, by Sylvester's law of inertia.

    Raises:
        NotSolvedError: zero is an eigenvalue.
    """
    return core.negative + _count_negative(_folded_complement(core, faces))


def _folded_complement(core: Core, faces: FaceMap) -> np.ndarray:
    """C^H S C (nm, nm) of the real symmetric S; what of it serves all nodal diameters is kept."""
    parts = core.folded[0] if core.folded else None
    if parts is None or parts.low is not faces.low or parts.high is not faces.high:
        parts = _fold(core.S, faces.low, faces.high)
        core.folded[:] = [parts]
    phase = complex(faces.phase)
    real = phase.real * parts.even
    real += parts.own
    if not np.iscomplexobj(faces.phase):
        return real
    out = np.empty(real.shape, complex)
    out.real = real
    np.multiply(parts.odd, phase.imag, out=out.imag)
    return out


def _fold(S: np.ndarray, low: sp.csr_matrix, high: sp.csr_matrix) -> _FoldedParts:
    """The parts of C^H S C that no phase is in."""
    left, right = low.T.tocsr(), high.T.tocsr()
    # rows of products are those of S, which is symmetric
    beside = np.ascontiguousarray((right @ S).T)
    across = left @ beside
    own = left @ np.ascontiguousarray((left @ S).T) + right @ beside
    return _FoldedParts(low, high, own, across + across.T, across - across.T)


def solve_diameter(rim: Rim, B: np.ndarray) -> np.ndarray:
    """Solve for a block of vectors (n_own, k)."""
    if B.shape[1] <= COLUMNS_PER_SOLVE:
        return _solve_batch([(rim, B)])[0]
    X = np.empty(B.shape, np.result_type(B, rim.faces.C.dtype), order="F")
    for first in range(0, B.shape[1], COLUMNS_PER_SOLVE):
        part = slice(first, first + COLUMNS_PER_SOLVE)
        (X[:, part],) = _solve_batch([(rim, B[:, part])])
    return X


def solve_together(systems: list[tuple[Rim, np.ndarray]]) -> list[np.ndarray]:
    """Solve for a few vectors (n_own, k) in each of several nodal diameters.

    A sweep over the factors of the interior reads them once, whatever the number of vectors: four
    cost hardly more than one.

    Args:
        systems: nodal diameters on the same core, and their loads.
    """
    many = sum(B.shape[1] for _, B in systems) > COLUMNS_PER_SOLVE
    if many or len(systems) == 1:
        return [solve_diameter(rim, B) for rim, B in systems]
    return _solve_batch(systems)


def _solve_batch(systems: list[tuple[Rim, np.ndarray]]) -> list[np.ndarray]:
    """Solutions (n_own, k) of all systems, by one sweep down and one up."""
    core = systems[0][0].core
    shared = core.shared
    loads = [
        (B if shared is None else own_part(shared, B)).astype(
            np.result_type(B, rim.faces.C.dtype), copy=False
        )
        for rim, B in systems
    ]
    wide = [
        _widen_columns(core, B[rim.faces.inner]) for (rim, _), B in zip(systems, loads, strict=True)
    ]
    ends = np.cumsum([W.shape[1] for W in wide]).tolist()
    columns = [slice(*pair) for pair in zip([0, *ends], ends, strict=False)]
    found = [np.zeros(B.shape, B.dtype, order="F") for B in loads]

    def answer(r: np.ndarray) -> np.ndarray:
        return _answer_boundary(systems, loads, columns, found, r)

    inside = _sweep(core, np.hstack(wide) if len(wide) > 1 else wide[0], answer)
    for (rim, _), part, X in zip(systems, columns, found, strict=True):
        _put_parts(X, rim.faces.inner, inside[:, part])
    return found if shared is None else [back_to_ranks(shared, X) for X in found]


def _answer_boundary(
    systems: list[tuple[Rim, np.ndarray]],
    loads: list[np.ndarray],
    columns: list[slice],
    found: list[np.ndarray],
    r: np.ndarray,
) -> np.ndarray:
    """Displacements of the rim (nb, k) under the loads r (nb, k) that the interior hands on.

    Those of each system's unknowns on the boundary are put into ``found``; collective where ranks
    share the boundary.
    """
    core = systems[0][0].core
    on_face = [B[rim.faces.masters] for (rim, _), B in zip(systems, loads, strict=True)]
    whole = r
    if core.shared is not None and core.separators is not None:
        widths = [part.stop - part.start for part in columns]
        direct = np.hstack([_split_parts(B, k) for B, k in zip(on_face, widths, strict=True)])
        whole = np.zeros((len(core.shared.cut.separator), r.shape[1]))
        whole[core.shared.cut.touched] = r
        between = [
            _split_parts(B[rim.faces.between], k)
            for (rim, _), B, k in zip(systems, loads, widths, strict=True)
        ]
        whole[core.shared.cut.separator] += np.hstack(between)
        together = np.concatenate([whole, direct])
        core.shared.cut.comm.Allreduce(MPI.IN_PLACE, together)
        whole, direct = together[: len(whole)], together[len(whole) :]
        on_face = [_join_parts(direct[:, p], B) for p, B in zip(columns, on_face, strict=True)]
    reduced = whole if core.separators is None else reduce_load(core.separators, whole)
    moved = []
    for (rim, _), B, part, X in zip(systems, on_face, columns, found, strict=True):
        faces = rim.faces
        y = face_solve(rim, B + faces.C.conj().T @ _join_parts(reduced[:, part], X))
        X[faces.masters] = y
        moved.append(_split_parts(faces.C @ y, part.stop - part.start))
    out = np.hstack(moved)
    if core.shared is None or core.separators is None:
        return out
    out = expand_faces(core.separators, whole, out)
    for (rim, _), part, X in zip(systems, columns, found, strict=True):
        X[rim.faces.between] = _join_parts(out[core.shared.cut.separator][:, part], X)
    return out[core.shared.cut.touched]


def _sweep(
    core: Core,
    B: np.ndarray,
    answer: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Displacements inside (ni, k) under loads (ni+nb, k): down, the boundary's answer, and up."""
    if core.bridge is not None:
        return solve_through_boundary(core.bridge, B, answer)[core.inner]
    first = solve_matrix(core.factor, B)[core.inner]
    back = np.zeros(B.shape, order="F")
    back[core.inner] = core.coupling.T @ answer(-(core.coupling @ first))
    return first - solve_matrix(core.factor, back)[core.inner]


def face_solve(rim: Rim, g: np.ndarray) -> np.ndarray:
    """Displacements of the low cut face (nm, k) under loads condensed onto it."""
    return cho_solve(rim.dense, g) if rim.negative < 0 else lu_solve(rim.dense, g)


def inner_solve(core: Core, B: np.ndarray) -> np.ndarray:
    """A_ii^-1 B (ni, k), real or complex."""
    return _join_parts(solve_matrix(core.factor, _widen_columns(core, B))[core.inner], B)


def _widen_columns(core: Core, B: np.ndarray) -> np.ndarray:
    """Real and imaginary parts of (ni, k) side by side, with zeros on the rim."""
    parts = [B.real, B.imag] if np.iscomplexobj(B) else [B]
    k = B.shape[1]
    full = np.zeros((len(core.inner) + len(core.rim), k * len(parts)), order="F")
    for i, part in enumerate(parts):
        full[core.inner, i * k : (i + 1) * k] = part
    return full


def _split_parts(X: np.ndarray, k: int) -> np.ndarray:
    """k real columns."""
    return X.real if X.shape[1] == k else np.concatenate([X.real, X.imag], axis=1)


def _put_parts(X: np.ndarray, places: np.ndarray, parts: np.ndarray) -> None:
    """Real columns into rows of X (n_own, k), without a complex copy of them."""
    k = X.shape[1]
    if not np.iscomplexobj(X):
        X[places] = parts
        return
    X.real[places], X.imag[places] = parts[:, :k], parts[:, k:]


def _join_parts(X: np.ndarray, like: np.ndarray) -> np.ndarray:
    """The inverse of ``_split_parts``."""
    k = like.shape[1]
    return X if not np.iscomplexobj(like) else X[:, :k] + 1j * X[:, k:]


def _count_negative(S: np.ndarray) -> int:
    """Number of negative eigenvalues of a Hermitian matrix, by Bunch and Kaufman's
    factorisation.
    """
    factorise = lapack.zhetrf if np.iscomplexobj(S) else lapack.dsytrf
    ldu, pivots, info = factorise(S, lower=1, lwork=64 * len(S))
    if info:
        raise NotSolvedError("the shift is an eigenvalue, expected a shift between two")
    return negative_pivots(ldu, pivots)

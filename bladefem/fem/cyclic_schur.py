"""Cyclic symmetry with one factorisation for all nodal diameters.

The unknowns of an open sector are its interior (i) and its two cut faces, the rim (b). Only the rim
knows the nodal diameter, so the interior is eliminated once, in real arithmetic, down to the Schur
complement S of the rim; nodal diameter n then costs a dense Cholesky of C_b(n)^H S C_b(n), as large
as one cut face. A solve takes one sweep down and one up over the interior's factors for each of the
real and imaginary parts. One rank only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve, lapack, lu_factor, lu_solve

from ..errors import NotSolvedError
from .compat import MPI, PETSc
from .mumps import Factorised, factorise_matrix, solve_matrix
from .schur import Bridge, replace_dense_solve, schur_complement, solve_through_boundary

# complex columns a solve: from 32 real ones on MUMPS runs at the speed of matrix products
COLUMNS_PER_SOLVE = 32


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
    # (nb, ni) A_bi
    coupling: sp.csr_matrix
    # to the rim's system amid a solve; None: two solves instead
    bridge: Bridge | None
    # (ni+nb,) place of each unknown in the elimination, to use again; None: MUMPS's own
    order: np.ndarray | None


@dataclass(frozen=True)
class Rim:
    """One nodal diameter on top of a core."""

    core: Core
    # (ni,) unknowns of the nodal diameter inside
    inner: np.ndarray
    # (nm,) and on the low cut face
    masters: np.ndarray
    # (nb, nm) rim from masters
    C: sp.csr_matrix
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


def masters(C: sp.csr_matrix) -> np.ndarray:
    """Unknowns of a nodal diameter on the cut face."""
    return np.unique(C[rim_of(C)].indices)


def eliminate_interior(
    A: sp.csr_matrix,
    rim: np.ndarray,
    definite: bool = True,
    order: np.ndarray | None = None,
    keep: bool = True,
) -> Core:
    """Eliminate the interior.

    Args:
        order: see ``ordering.interior_first``.
        keep: keep the factors, for solves; else for :func:`count_negative` alone.

    Raises:
        NotSolvedError: from MUMPS.
    """
    matrix = PETSc.Mat().createAIJ(
        A.shape,
        comm=MPI.COMM_SELF,
        csr=(A.indptr.astype(PETSc.IntType), A.indices.astype(PETSc.IntType), A.data),
    )
    matrix.assemble()
    factor = factorise_matrix(matrix, definite, rim, order, keep)
    matrix.destroy()
    inner = np.setdiff1d(np.arange(A.shape[0]), rim)
    S = schur_complement(factor, len(rim))
    return Core(
        factor,
        inner,
        rim,
        S,
        A[rim][:, inner].tocsr(),
        replace_dense_solve(factor, len(rim)) if definite else None,
        order,
    )


def join_cut_faces(
    core: Core,
    C: sp.csr_matrix,
    definite: bool = True,
    springs: np.ndarray | None = None,
) -> Rim:
    """Join the cut faces for one nodal diameter.

    Raises:
        NotSolvedError: the sector can still move (definite) or a shift hits an eigenvalue.
    """
    on_face = masters(C)
    Cb = C[core.rim][:, on_face].tocsr()
    # S is symmetric
    S = Cb.conj().T @ (Cb.T @ core.S).T
    if springs is not None:
        S = S + np.diag(springs[on_face])
    inner = np.asarray(C[core.inner].indices)
    if not definite:
        return Rim(
            core, inner, on_face, Cb, lu_factor(S), core.factor.negative + _count_negative(S)
        )
    floats = "the sector's stiffness is not positive definite: it floats, or it has buckled"
    try:
        dense = cho_factor(S, lower=True)
    except np.linalg.LinAlgError as error:
        raise NotSolvedError(floats) from error
    # of a singular matrix rounding leaves a last pivot of either sign
    pivots = dense[0].diagonal().real ** 2
    if (pivots < len(S) * np.finfo(float).eps * S.diagonal().real).any():
        raise NotSolvedError(floats)
    return Rim(core, inner, on_face, Cb, dense, -1)


def count_negative(core: Core, C: sp.csr_matrix) -> int:
    """Number of negative eigenvalues of C^H A C, by Sylvester's law of inertia.

    Raises:
        NotSolvedError: zero is an eigenvalue.
    """
    Cb = C[core.rim][:, masters(C)].tocsr()
    return core.factor.negative + _count_negative(Cb.conj().T @ (Cb.T @ core.S).T)


def solve_diameter(rim: Rim, B: np.ndarray) -> np.ndarray:
    """Solve for a block of vectors (n_free, k)."""
    X = np.empty(B.shape, np.result_type(B, rim.C.dtype), order="F")
    made = rim.core.bridge
    for first in range(0, B.shape[1], COLUMNS_PER_SOLVE):
        part = slice(first, first + COLUMNS_PER_SOLVE)
        if made is None:
            X[rim.inner, part], X[rim.masters, part] = _solve_two_sweeps(rim, B[:, part])
        else:
            ((inside, on_face),) = _solve_one_sweep(made, [(rim, B[:, part])])
            X[rim.inner, part] = inside
            X[rim.masters, part] = on_face
    return X


def solve_together(systems: list[tuple[Rim, np.ndarray]]) -> list[np.ndarray]:
    """Solve for a few vectors (n_free, k) in each of several nodal diameters.

    A sweep over the factors of the interior reads them once, whatever the number of vectors: four
    cost hardly more than one.

    Args:
        systems: nodal diameters on the same core, and their loads.
    """
    made = systems[0][0].core.bridge
    many = sum(B.shape[1] for _, B in systems) > COLUMNS_PER_SOLVE
    if made is None or many or len(systems) == 1:
        return [solve_diameter(rim, B) for rim, B in systems]
    out = []
    for (rim, B), (inside, on_face) in zip(systems, _solve_one_sweep(made, systems), strict=True):
        X = np.empty(B.shape, np.result_type(B, rim.C.dtype), order="F")
        X[rim.inner] = inside
        X[rim.masters] = on_face
        out.append(X)
    return out


def _solve_one_sweep(
    made: Bridge, systems: list[tuple[Rim, np.ndarray]]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Solutions inside and on the low cut face, by one sweep down and one up for all systems."""
    core = systems[0][0].core
    loads = [B.astype(np.result_type(B, rim.C.dtype), copy=False) for rim, B in systems]
    wide = [_widen_columns(core, B[rim.inner]) for (rim, _), B in zip(systems, loads, strict=True)]
    ends = np.cumsum([W.shape[1] for W in wide]).tolist()
    columns = [slice(*pair) for pair in zip([0, *ends], ends, strict=False)]
    faces: list[np.ndarray] = []

    def answer(r: np.ndarray) -> np.ndarray:
        moved = []
        for (rim, _), B, part in zip(systems, loads, columns, strict=True):
            reduced = rim.C.conj().T @ _join_parts(r[:, part], B)
            faces.append(face_solve(rim, B[rim.masters] + reduced))
            moved.append(_split_parts(rim.C @ faces[-1], part.stop - part.start))
        return np.hstack(moved)

    X = solve_through_boundary(made, np.hstack(wide) if len(wide) > 1 else wide[0], answer)[
        core.inner
    ]
    insides = [_join_parts(X[:, part], B) for B, part in zip(loads, columns, strict=True)]
    return list(zip(insides, faces, strict=True))


def _solve_two_sweeps(rim: Rim, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same by two solves inside."""
    core = rim.core
    inside = inner_solve(core, B[rim.inner])
    on_face = face_solve(
        rim, B[rim.masters] - rim.C.conj().T @ real_times_complex(core.coupling, inside)
    )
    return inside - inner_solve(
        core, real_times_complex(core.coupling.T.tocsr(), rim.C @ on_face)
    ), on_face


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


def _join_parts(X: np.ndarray, like: np.ndarray) -> np.ndarray:
    """The inverse of ``_split_parts``."""
    k = like.shape[1]
    return X if not np.iscomplexobj(like) else X[:, :k] + 1j * X[:, k:]


def real_times_complex(A: sp.csr_matrix, X: np.ndarray) -> np.ndarray:
    """Real sparse matrix times a complex block, without a complex copy of the matrix."""
    if not np.iscomplexobj(X):
        return A @ X
    X = np.ascontiguousarray(X)
    return (A @ X.view(float)).view(complex)


def _count_negative(S: np.ndarray) -> int:
    """Number of negative eigenvalues of a Hermitian matrix, by Bunch and Kaufman's
    factorisation.
    """
    factorise = lapack.zhetrf if np.iscomplexobj(S) else lapack.dsytrf
    ldu, pivots, info = factorise(S, lower=1, lwork=64 * len(S))
    if info:
        raise NotSolvedError("the shift is an eigenvalue, expected a shift between two")
    single = pivots > 0
    return int((ldu.diagonal().real[single] < 0).sum()) + int((~single).sum()) // 2

"""MUMPS through PETSc: Cholesky and L D L^T, blocks of right-hand sides, Schur complements, reasons
in words.

Two details that its interfaces hide. Debian 12's PETSc knows the PORD ordering only and falls back
to it in silence, so the ordering used is kept (INFOG(7)). petsc4py does not wrap all that is
needed: some of PETSc's C functions are called by name.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..errors import IndefiniteError, NotSolvedError
from .compat import PETSc, no_error_messages, pages_kept

# columns a solve: MUMPS works on them by matrix products, 256 are no faster
COLUMNS_PER_SOLVE = 128
# per cent of memory beyond MUMPS's own estimate, tried one after the other
EXTRA_MEMORY_PERCENTS = (40, 200)
# the same where nothing is pivoted and one rank does it all, as MUMPS itself sets it: the estimate
# is nearly exact, and what is beyond is written to for a while; too little for some small matrices
EXACT_MEMORY_PERCENTS = (5, *EXTRA_MEMORY_PERCENTS)
# INFOG(1) where the room that MUMPS took by its own estimate ended, of integers or of numbers
ESTIMATE_EXCEEDED = (-8, -9)
# where Cholesky met a pivot that is not positive
NOT_DEFINITE = -40
# MATOP_LUFACTOR_SYMBOLIC
SYMBOLIC_FACTORISATION = 25
# share of non-zero rows below which a right-hand side counts as sparse
SPARSE_ROW_SHARE = 0.2


@dataclass(frozen=True)
class Factorised:
    """A real matrix factorised by MUMPS."""

    # the factor
    matrix: PETSc.Mat
    # in the factors
    entries: int
    # of the factorisation
    flops: float
    # memory of all ranks
    bytes: float
    # INFOG(7): 4 PORD, 5 METIS, ...
    ordering: int
    # negative pivots
    negative: int


def factorise_matrix(
    A: PETSc.Mat,
    *,
    definite: bool,
    schur: np.ndarray | None = None,
    order: np.ndarray | None = None,
    keep: bool = True,
    on_disk: bool = False,
) -> Factorised:
    """Factorise a symmetric matrix.

    Args:
        definite: Cholesky; else L D L^T with the count of negative pivots.
        schur: rows left out of the factorisation, see ``schur`` (one rank only).
        order: (n,) place of each row in the elimination (one rank only); MUMPS chooses when left
            out.
        keep: keep the factors; without them only the count and the Schur complement are left.
        on_disk: keep them on disk, in the folder MUMPS_OOC_TMPDIR (/tmp where that is not set).

    Raises:
        NotSolvedError: the matrix is singular or not definite, or memory ran out; the message holds
            MUMPS's INFOG.
    """
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    A.setOption(PETSc.Mat.Option.SPD, definite)
    exact = definite and A.comm.size == 1
    for percent in EXACT_MEMORY_PERCENTS if exact else EXTRA_MEMORY_PERCENTS:
        pc = _prepare_solver(A, PETSc.PC.Type.CHOLESKY)
        F = pc.getFactorMatrix()
        _set_controls(F, percent, definite, keep, on_disk)
        if schur is not None:
            index = PETSc.IS().createGeneral(schur.astype(PETSc.IntType), comm=F.comm)
            petsc_call("MatFactorSetSchurIS", F.handle, index.handle)
        in_order = None if order is None else partial(_in_order, F, A, order)
        # factors that stay would leave the others' pages in pieces
        with nullcontext() if keep else pages_kept(large=True):
            failed = _factorise_numeric(in_order or pc.setUp)
        if F.getMumpsInfog(1) not in ESTIMATE_EXCEEDED:
            break
    code = F.getMumpsInfog(1)
    if failed or code < 0:
        kind = IndefiniteError if code == NOT_DEFINITE else NotSolvedError
        raise kind(_failure_reason(code, F.getMumpsInfog(2), A.size[0]))
    # and with it PETSc's hold on A
    pc.destroy()
    negative = F.getMumpsInfog(12)
    # MUMPS goes on in silence
    if definite and negative:
        raise IndefiniteError(
            f"the matrix of {A.size[0]} unknowns is not positive definite, MUMPS met {negative} "
            "negative pivots: a part floats, nothing joins it to the rest, or the state has buckled"
        )
    return Factorised(
        F,
        _large_count(F.getMumpsInfog(29)),
        F.getMumpsRinfog(3),
        1e6 * F.getMumpsInfog(22),
        F.getMumpsInfog(7),
        negative,
    )


def solve_matrix(
    factor: Factorised,
    B: np.ndarray,
    whole: bool = False,
) -> np.ndarray:
    """A^-1 B (n_own, k), in batches; with rows left out, A is the matrix without them and these
    rows of B are 0.

    Args:
        whole: solve for the rows left out too (see ``schur``), all columns in one batch.

    On one rank a block with few non-zero rows is handed over sparse: MUMPS then prunes the first
    sweep.
    """
    F = factor.matrix
    out = np.empty(B.shape, order="F")
    rows = np.flatnonzero(B.any(axis=1)) if F.comm.size == 1 else np.arange(B.shape[0])
    batch = max(B.shape[1], 1) if whole else COLUMNS_PER_SOLVE
    F.setMumpsIcntl(26, -1 if whole else 0)
    for first in range(0, B.shape[1], batch):
        part = slice(first, min(first + batch, B.shape[1]))
        sparse = 0 < len(rows) < SPARSE_ROW_SHARE * len(B)
        right = (
            _sparse_block(F, rows, B[rows, part])
            if sparse
            else dense_matrix(F, np.asfortranarray(B[:, part], dtype=float))
        )
        left = dense_matrix(F, out[:, part])
        F.matSolve(right, left)
        # petsc4py keeps what is not destroyed for a later garbage collection
        for matrix in (right, left):
            matrix.destroy()
    return out


def dense_matrix(A: PETSc.Mat, X: np.ndarray) -> PETSc.Mat:
    """A dense PETSc matrix on the memory of X (n_own, k), columns contiguous."""
    if X.size and not X.flags.f_contiguous:
        raise ValueError("columns are not contiguous")
    out = PETSc.Mat().createDense(
        (A.sizes[1], (None, X.shape[1])), array=X.T.reshape(-1), comm=A.comm
    )
    out.assemble()
    return out


def dense_values(D: PETSc.Mat) -> np.ndarray:
    """(n_own, k) copy of a dense PETSc matrix."""
    rows = D.sizes[0][0]
    columns = D.size[1]
    if not rows * columns:
        return np.zeros((rows, columns), order="F")
    data = ctypes.POINTER(ctypes.c_double)()
    petsc_call("MatDenseGetArrayRead", D.handle, ctypes.byref(data))
    out = np.ctypeslib.as_array(data, (columns, rows)).T.copy(order="F")
    petsc_call("MatDenseRestoreArrayRead", D.handle, ctypes.byref(data))
    return out


def _sparse_block(
    F: PETSc.Mat,
    rows: np.ndarray,
    values: np.ndarray,
) -> PETSc.Mat:
    """The block as the transpose of a sparse matrix, the form that PETSc hands on to MUMPS."""
    k = values.shape[1]
    starts = np.arange(k + 1, dtype=PETSc.IntType) * len(rows)
    turned = PETSc.Mat().createAIJ(
        (k, F.size[0]),
        comm=F.comm,
        csr=(starts, np.tile(rows.astype(PETSc.IntType), k), values.T.ravel()),
    )
    turned.assemble()
    out = PETSc.Mat().createTranspose(turned)
    # out holds it
    turned.destroy()
    return out


def set_operation(
    handle: int,
    place: int,
    function: object,
) -> None:
    """Replace one of a matrix's operations, numbered as in PETSc's enumeration MatOperation."""
    ctypes.CDLL(PETSc.__file__).MatSetOperation(ctypes.c_void_p(handle), place, function)


def petsc_call(name: str, *arguments: object) -> None:
    """Call one of PETSc's C functions; large whole numbers are handles of its objects."""
    function = getattr(ctypes.CDLL(PETSc.__file__), name)
    code = function(
        *[ctypes.c_void_p(a) if isinstance(a, int) and a > 0xFFFF else a for a in arguments]
    )
    if code:
        raise NotSolvedError(f"PETSc's {name} failed with error {code}")


def _prepare_solver(A: PETSc.Mat, kind: str) -> PETSc.PC:
    """A solver with an empty factor of MUMPS's kind."""
    pc = PETSc.PC().create(A.comm)
    pc.setOperators(A)
    pc.setType(kind)
    try:
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
    except PETSc.Error as error:
        raise NotSolvedError(
            "PETSc was built without MUMPS, expected one with it (apt python3-petsc4py-real)"
        ) from error
    return pc


def _in_order(
    F: PETSc.Mat,
    A: PETSc.Mat,
    order: np.ndarray,
) -> None:
    """Factorise with a given ordering, which PETSc hands on to MUMPS in its analysis for LU only:
    that one is borrowed, it does the same but for the ordering.
    """
    unsymmetric = _prepare_solver(A, PETSc.PC.Type.LU)
    analysis = ctypes.c_void_p()
    petsc_call(
        "MatGetOperation",
        unsymmetric.getFactorMatrix().handle,
        SYMBOLIC_FACTORISATION,
        ctypes.byref(analysis),
    )
    set_operation(F.handle, SYMBOLIC_FACTORISATION, analysis)
    places = PETSc.IS().createGeneral(order.astype(PETSc.IntType), comm=F.comm)
    # MatFactorInfo, all defaults
    info = (ctypes.c_double * 16)()
    petsc_call(
        "MatLUFactorSymbolic", F.handle, A.handle, places.handle, places.handle, ctypes.byref(info)
    )
    petsc_call("MatLUFactorNumeric", F.handle, A.handle, ctypes.byref(info))
    for made in (unsymmetric, places):
        made.destroy()


def _set_controls(
    F: PETSc.Mat,
    percent: int,
    definite: bool,
    keep: bool,
    on_disk: bool,
) -> None:
    """MUMPS's settings for one factorisation, see ``factorise_matrix`` (users' guide 5.5, section
    6).
    """
    F.setMumpsIcntl(14, percent)
    if on_disk and keep:
        F.setMumpsIcntl(22, 1)
    if not definite:
        # the last block is counted too
        F.setMumpsIcntl(13, 1)
        F.setMumpsIcntl(24, 1)
    if not keep:
        F.setMumpsIcntl(31, 1)
        # scaling costs as much as a fifth of the elimination, and changes no sign
        F.setMumpsIcntl(8, 0)


def _factorise_numeric(factorise: Callable[[], None]) -> bool:
    """Factorise; whether PETSc complained."""
    try:
        with no_error_messages():
            factorise()
    except (PETSc.Error, NotSolvedError):
        return True
    return False


def _failure_reason(
    code: int,
    detail: int,
    size: int,
) -> str:
    """MUMPS's complaint in words (users' guide 5.5, section 8)."""
    if code in (-5, -7, -8, -9, -11, -13, -19, -20):
        what = "memory ran out; use more ranks on more memory, or fewer unknowns"
    else:
        what = {
            -10: "the matrix is singular: a part floats, or nothing joins it to the rest",
            NOT_DEFINITE: "the matrix is not positive definite: a part floats, or the state has "
            "buckled",
        }.get(code, "the factorisation failed")
    return f"MUMPS stopped on {size} unknowns: {what} (INFOG(1) = {code}, INFOG(2) = {detail})"


def _large_count(infog: int) -> int:
    """MUMPS gives large counts in millions, as a negative number."""
    return -infog * 1_000_000 if infog < 0 else infog

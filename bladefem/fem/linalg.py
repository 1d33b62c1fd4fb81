"""Sparse factorisations by MUMPS through PETSc, and products with blocks of real or complex vectors.

A block of vectors is a NumPy array (n_own, k), this rank's rows; complex blocks go with doubled matrices
(see ``constraint.Constrained``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import NotSolvedError
from .compat import PETSc

__all__ = ["Factor", "apply", "dot", "factorise", "inertia", "solve"]

BATCH = 64      # columns a solve: from 32 on MUMPS runs at the speed of matrix products


@dataclass(frozen=True)
class Factor:
    """A factorised matrix."""

    matrix: PETSc.Mat               # MUMPS factor
    solver: PETSc.PC                # keeps the factor alive
    doubled: bool
    entries: int                    # in the factors, INFOG(29)
    bytes: float                    # memory used by all ranks, INFOG(22)


def factorise(A: PETSc.Mat, definite: bool = True, doubled: bool = False) -> Factor:
    """Factorise a symmetric matrix by MUMPS.

    Args:
        definite: Cholesky; else LDL^T with inertia.

    Raises:
        NotSolvedError: the matrix is singular or not definite, or memory ran out; the message holds MUMPS's INFOG.
    """
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    A.setOption(PETSc.Mat.Option.SPD, definite)
    pc = PETSc.PC().create(A.comm)
    pc.setOperators(A)
    pc.setType(PETSc.PC.Type.CHOLESKY)
    try:
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
    except PETSc.Error as error:
        raise NotSolvedError("PETSc was built without MUMPS, expected a PETSc with it (apt python3-petsc4py-real)") \
            from error
    F = pc.getFactorMatrix()
    _settings(F, definite)
    code, detail = _numeric(pc, F)
    if code < 0:
        raise NotSolvedError(_reason(code, detail, A.size[0]))
    return Factor(F, pc, doubled, _entries(F.getMumpsInfog(29)), 1e6 * F.getMumpsInfog(22))


def solve(factor: Factor, B: np.ndarray) -> np.ndarray:
    """A^-1 B for a block of vectors (n_own, k), in batches."""
    if np.iscomplexobj(B) and not factor.doubled:
        both = solve(factor, np.concatenate([B.real, B.imag], axis=1))
        return both[:, :B.shape[1]] + 1j * both[:, B.shape[1]:]
    out = np.empty(B.shape, complex if factor.doubled else float)
    for first in range(0, B.shape[1], BATCH):
        part = slice(first, first + BATCH)
        right = _dense(factor.matrix, B[:, part], factor.doubled)
        left = right.duplicate()
        factor.matrix.matSolve(right, left)
        out[:, part] = _array(left, factor.doubled)
    return out


def apply(A: PETSc.Mat, X: np.ndarray, doubled: bool) -> np.ndarray:
    """A X for a block of vectors (n_own, k)."""
    if np.iscomplexobj(X) and not doubled:
        both = apply(A, np.concatenate([X.real, X.imag], axis=1), False)
        return both[:, :X.shape[1]] + 1j * both[:, X.shape[1]:]
    if X.shape[1] == 0:
        return X.astype(complex if doubled else float)
    return _array(A.matMult(_dense(A, X, doubled)), doubled)


def dot(comm: object, X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """X^H Y over all ranks, (k, l)."""
    part = np.ascontiguousarray(X.conj().T @ Y)
    return comm.allreduce(part) if comm.size > 1 else part


def inertia(A: PETSc.Mat, doubled: bool) -> int:
    """Number of negative eigenvalues (of the complex matrix where doubled)."""
    factor = factorise(A, definite=False, doubled=doubled)
    negative = factor.matrix.getInertia()[0]
    return negative // 2 if doubled else negative


def _settings(F: PETSc.Mat, definite: bool) -> None:
    F.setMumpsIcntl(4, 0)
    F.setMumpsIcntl(14, 40)                 # per cent of memory beyond the estimate
    if not definite:
        F.setMumpsIcntl(13, 1)              # the last block too is counted
        F.setMumpsIcntl(24, 1)


def _numeric(pc: PETSc.PC, F: PETSc.Mat) -> tuple[int, int]:
    """Factorise; MUMPS's INFOG(1) and INFOG(2)."""
    PETSc.Sys.pushErrorHandler("ignore")
    try:
        pc.setUp()
    except PETSc.Error:
        code = F.getMumpsInfog(1)
        return (code, F.getMumpsInfog(2)) if code < 0 else (-99, 0)
    finally:
        PETSc.Sys.popErrorHandler()
    return F.getMumpsInfog(1), F.getMumpsInfog(2)


def _reason(code: int, detail: int, size: int) -> str:
    """MUMPS's complaint in words (users' guide 5.5, section 8)."""
    words = {-10: "the matrix is singular (a body that floats, or a part without connection)",
             -40: "the matrix is not positive definite (a body that floats, or a buckled state)",
             -13: "memory ran out", -9: "memory ran out", -8: "memory ran out", -19: "memory ran out",
             -5: "memory ran out", -7: "memory ran out", -11: "memory ran out", -20: "memory ran out"}
    what = words.get(code, "the factorisation failed")
    more = "; use more ranks on more memory, or fewer unknowns" if "memory" in what else ""
    return f"MUMPS stopped on {size} unknowns: {what} (INFOG(1) = {code}, INFOG(2) = {detail}){more}"


def _entries(infog: int) -> int:
    """MUMPS gives millions as a negative number when the count is large."""
    return -infog * 1_000_000 if infog < 0 else infog


def _dense(A: PETSc.Mat, X: np.ndarray, doubled: bool) -> PETSc.Mat:
    """A PETSc dense matrix of this block of vectors, rows as A's columns."""
    rows, k = A.sizes[1], X.shape[1]
    out = PETSc.Mat().createDense((rows, (None, k)), comm=A.comm)
    out.setUp()
    view = out.getDenseArray()
    view[...] = _real(X) if doubled else X
    out.assemble()
    return out


def _real(X: np.ndarray) -> np.ndarray:
    """(2 n_own, k) real and imaginary parts interleaved."""
    return np.ascontiguousarray(X.T, dtype=complex).view(float).T


def _array(D: PETSc.Mat, doubled: bool) -> np.ndarray:
    view = D.getDenseArray(readonly=True)
    return np.ascontiguousarray(view.T).view(complex).T.copy() if doubled else np.array(view)

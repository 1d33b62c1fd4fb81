"""MUMPS with rows left out: their Schur complement, and solves whose reduced system the caller
answers.

PETSc sweeps down over the factors, solves with its own dense factors of the Schur complement S and
sweeps up again. The nodal diameters of a wheel want another answer in between, C (C^H S C)^-1 C^H,
so the dense solve of S is replaced by a call back into Python: two sweeps a solve instead of the
four that A_ii^-1 before and after would take. Where PETSc does not call back (the place of the
dense solve in its table of operations moved once), ``replace_dense_solve`` says so.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from ..errors import NotSolvedError
from .compat import PETSc, no_error_messages, shared_matrix
from .memory import drop_values
from .mumps import Factorised, factorise_matrix, petsc_call, set_operation, solve_matrix

# MATOP_MAT_SOLVE: PETSc 3.1 to 3.19, later
MATSOLVE = (109, 100)
# MATOP_LUFACTOR, MATOP_CHOLESKYFACTOR
DENSE_FACTORS = (11, 12)
# MAT_FACTOR_CHOLESKY
CHOLESKY = 2
# of a dense matrix that is copied, to spare memory
ROWS_AT_A_TIME = 256
CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
Answer = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Bridge:
    """The way from MUMPS's reduced system to whoever answers it."""

    factor: Factorised
    # of the Schur complement
    rows: int
    # the one in use; empty between solves
    answers: list[Answer]
    # an exception, Ctrl-C too, cannot pass through C: it waits here
    raised: list[BaseException]
    # keep the C functions alive
    callbacks: tuple[object, ...]


def schur_complement(factor: Factorised, n: int) -> np.ndarray:
    """(n, n) A_bb - A_bi A_ii^-1 A_ib of the rows left out."""
    return _use_complement(factor, lambda handle: _symmetric_copy(_dense_array(handle, (n, n))))


def _symmetric_copy(A: np.ndarray) -> np.ndarray:
    """A matrix (n, n) of which a symmetric factorisation filled one triangle, as a whole."""
    n = len(A)
    # an entry of the lower triangle only is zero where the upper one was filled
    lower = any(np.any(A[i, :i]) for i in range(1, n))
    out = np.empty((n, n))
    for first in range(0, n, ROWS_AT_A_TIME):
        block = slice(first, first + ROWS_AT_A_TIME)
        if lower:
            out[block, : block.stop] = np.tril(A[block, : block.stop], first)
            out[:first, block] = out[block, :first].T
        else:
            out[block, first:] = np.triu(A[block, first:])
            out[block.stop :, block] = out[block, block.stop :].T
        corner = out[block, block]
        corner += (np.tril(corner, -1) if lower else np.triu(corner, 1)).T
    return out


def drop_complement(factor: Factorised, n: int) -> None:
    """Give the memory of PETSc's Schur complement (n, n) back, which nobody reads any more."""
    _use_complement(factor, lambda handle: drop_values(_dense_array(handle, (n, n))))


def replace_dense_solve(factor: Factorised, n: int) -> Bridge | None:
    """Put a call back in place of PETSc's dense solve; None where PETSc does not take it.

    The Schur complement inside PETSc is of no use afterwards: copy it first.
    """
    return _with_call_back(factor, n) if _petsc_calls_back() else None


@lru_cache(maxsize=1)
def _petsc_calls_back() -> bool:
    """Whether a solve comes to the call back: of three unknowns, for it costs a sweep."""
    diagonal = sp.identity(3, format="csr")
    matrix = shared_matrix((3, 3), diagonal.indptr, diagonal.indices, diagonal.data)
    heard: list[int] = []

    def listen(r: np.ndarray) -> np.ndarray:
        heard.append(1)
        return r

    factor = None
    try:
        factor = factorise_matrix(matrix, definite=True, schur=np.array([2]))
        made = _with_call_back(factor, 1)
        with no_error_messages():
            if made is not None:
                solve_through_boundary(made, np.zeros((3, 1)), listen)
    except (PETSc.Error, NotSolvedError):
        return False
    finally:
        matrix.destroy()
        if factor is not None:
            factor.matrix.destroy()
    return bool(heard)


def _with_call_back(factor: Factorised, n: int) -> Bridge | None:
    """The factor with a call back in place of PETSc's dense solve; None where PETSc refuses."""
    answers: list[Answer] = []
    raised: list[BaseException] = []

    def answer(
        _: int,
        right: int,
        left: int,
    ) -> int:
        try:
            rows = ctypes.c_int()
            columns = ctypes.c_int()
            petsc_call("MatGetSize", left, ctypes.byref(rows), ctypes.byref(columns))
            r = _dense_array(left, (columns.value, rows.value)).T
            r[:] = answers[-1](r)
        except BaseException as error:
            raised.append(error)
        return 0

    callback = CALLBACK(answer)
    # PETSc wants factors, which nobody will use; of floating bodies S is singular
    nothing = CALLBACK(lambda *_: 0)

    def leave_factors_out(handle: int) -> None:
        for place in DENSE_FACTORS:
            set_operation(handle, place, nothing)

    def redirect(handle: int) -> None:
        petsc_call("MatSetFactorType", handle, CHOLESKY)
        for place in MATSOLVE:
            set_operation(handle, place, callback)

    try:
        with no_error_messages():
            _use_complement(factor, leave_factors_out)
            petsc_call("MatFactorFactorizeSchurComplement", factor.matrix.handle)
            _use_complement(factor, redirect)
    except (PETSc.Error, NotSolvedError):
        return None
    return Bridge(factor, n, answers, raised, (callback, nothing))


def solve_through_boundary(
    made: Bridge,
    B: np.ndarray,
    answer: Answer,
) -> np.ndarray:
    """Solutions (n, k) for B (n, k), zero on the rows left out, where there x_b = answer(-A_bi
    A_ii^-1 b_i) (nb, k).
    """
    made.answers.append(answer)
    try:
        with _signals_wait():
            X = solve_matrix(made.factor, B, whole=True)
    finally:
        made.answers.clear()
    if made.raised:
        raise made.raised.pop()
    return X


@contextmanager
def _signals_wait() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait for the end of the block.

    What their handlers raise at the entry of a function that C calls is dropped by ctypes, and
    PETSc gets a random error code.
    """
    came: list[int] = []
    before = {}
    # no other one runs handlers
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) not in (None, signal.SIG_IGN):
                before[number] = signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


Result = TypeVar("Result")


def _use_complement(factor: Factorised, use: Callable[[int], Result]) -> Result:
    """Do something with PETSc's Schur complement."""
    matrix = ctypes.c_void_p()
    status = ctypes.c_int()
    petsc_call(
        "MatFactorGetSchurComplement",
        factor.matrix.handle,
        ctypes.byref(matrix),
        ctypes.byref(status),
    )
    if matrix.value is None:
        raise NotSolvedError("PETSc handed out no Schur complement of the cut faces")
    out = use(matrix.value)
    petsc_call(
        "MatFactorRestoreSchurComplement", factor.matrix.handle, ctypes.byref(matrix), status
    )
    return out


def _dense_array(handle: int, shape: tuple[int, int]) -> np.ndarray:
    """The memory of a dense matrix, columns of it as rows."""
    data = ctypes.POINTER(ctypes.c_double)()
    petsc_call("MatDenseGetArray", handle, ctypes.byref(data))
    out = np.ctypeslib.as_array(data, shape)
    # forgets the pointer, not the memory
    petsc_call("MatDenseRestoreArray", handle, ctypes.byref(data))
    return out

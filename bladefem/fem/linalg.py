"""Sparse matrices of bodies in several forms, their products and factorisations (MUMPS
through PETSc).

- a PETSc matrix: real, distributed;
- ``Doubled``: the real twin of a complex Hermitian matrix, distributed; real and imaginary part of
  an unknown are adjacent, so that the memory of a complex vector is that of the doubled one;
- ``Mass``: that of a body without constraints, for products;
- ``Folded``: C^H A C with the real matrix A of an open sector, or the sum of such products of the
  ranks' parts; all nodal diameters share one factorisation of A's interior (``core``).

A block of vectors is a NumPy array (n_own, k), this rank's rows, columns contiguous.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg import blas

from . import cyclic_schur as interior
from .compat import MPI, PETSc
from .mass import Mass
from .mumps import Factorised, dense_matrix, dense_values, factorise_matrix, solve_matrix
from .open_matrix import OpenMatrix, diagonal, entries, entries_of_sum, times
from .subdomains import SharedBoundary, sum_of_parts, whole_part


@dataclass(frozen=True)
class Doubled:
    """Real twin of a complex Hermitian matrix."""

    matrix: PETSc.Mat


@dataclass(frozen=True)
class Folded:
    """C^H A C: an open sector's matrix seen from the unknowns of one nodal diameter; of several
    ranks the sum over their parts.
    """

    # (n_open, n_open) real, symmetric
    A: OpenMatrix
    # (n_open, n_free) real or complex
    C: sp.csr_matrix
    # A with its interior eliminated, shared by all nodal diameters
    core: interior.Elimination | None
    # several ranks: A and C are those of this rank's part
    shared: SharedBoundary | None = None
    # where the boundary's unknowns are; worked out where the rank has all of them
    given_faces: interior.FaceMap | None = None

    @property
    def faces(self) -> interior.FaceMap:
        """How open unknowns depend on those of the nodal diameter."""
        return self.given_faces or interior.face_map(self.C)

    @property
    def rim(self) -> np.ndarray:
        """Open unknowns on the boundary."""
        if self.shared is None:
            return interior.rim_of(self.C)
        return np.arange(len(self.shared.inside), self.A.shape[0])


# of a product with a folded matrix at a time: whole, the blocks on its way would be the peak of
# memory
COLUMNS_AT_A_TIME = 4
# of a block that is replaced in place: its products stay in the cache
ROWS_AT_A_TIME = 4096

Matrix: TypeAlias = PETSc.Mat | Doubled | Folded
Block: TypeAlias = np.ndarray | list[np.ndarray]


@dataclass(frozen=True)
class Factor:
    """A factorised matrix; ``solve_block`` uses it."""

    parts: Factorised | interior.Rim
    doubled: bool

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues (of the complex matrix where doubled); indefinite
        factorisations only.
        """
        return self.parts.negative // 2 if self.doubled else self.parts.negative

    @property
    def bytes(self) -> float:
        """Memory of the factors [bytes], all ranks."""
        return self.parts.bytes


def factorise(
    A: Matrix,
    definite: bool = True,
    springs: np.ndarray | None = None,
    on_disk: bool = False,
) -> Factor:
    """Factorise a symmetric or Hermitian matrix.

    Args:
        definite: Cholesky; else L D L^T with the count of negative eigenvalues.
        springs: (n_own,) added to the diagonal first; of a folded matrix on the cut face only.
        on_disk: keep the factors on disk; those of a folded matrix are where its core wants them.

    Raises:
        NotSolvedError: the matrix is singular or not definite, or memory ran out; the message holds
            MUMPS's INFOG.
    """
    if isinstance(A, Folded):
        core = (
            A.core.core()
            if A.core is not None
            else interior.eliminate_interior(
                entries(A.A), A.rim, definite=definite, shared=A.shared
            )
        )
        if springs is not None and A.shared is not None:
            springs = whole_part(A.shared, springs[:, None])[:, 0]
        return Factor(interior.join_cut_faces(core, A.faces, definite, springs), False)
    doubled = isinstance(A, Doubled)
    matrix = A.matrix if isinstance(A, Doubled) else A
    if springs is not None:
        matrix = matrix.duplicate(copy=True)
        added = matrix.createVecRight()
        added.array = np.repeat(springs, 2) if doubled else springs
        matrix.setDiagonal(added, addv=PETSc.InsertMode.ADD_VALUES)
        matrix.assemble()
    return Factor(factorise_matrix(matrix, definite=definite, on_disk=on_disk), doubled)


def release(A: Matrix, factor: Factor) -> None:
    """Give the memory of a factorisation back, which must not be used again; A can be factorised
    anew.
    """
    if isinstance(A, Folded) and A.core is not None:
        A.core.release()
    elif isinstance(factor.parts, Factorised):
        factor.parts.matrix.destroy()


def solve_block(factor: Factor, B: np.ndarray) -> np.ndarray:
    """A^-1 B for a block of vectors (n_own, k)."""
    if isinstance(factor.parts, interior.Rim):
        return interior.solve_diameter(factor.parts, B)
    if factor.doubled:
        return _complex(solve_matrix(factor.parts, _real(B)))
    if np.iscomplexobj(B):
        return _join_complex(solve_matrix(factor.parts, _split_complex(B)))
    return solve_matrix(factor.parts, B)


def solve_together(systems: list[tuple[Factor, np.ndarray]]) -> list[np.ndarray]:
    """A^-1 B (n_own, k) of several matrices at once: nodal diameters that share a core share its
    sweeps.
    """
    rims = [(f.parts, B) for f, B in systems if isinstance(f.parts, interior.Rim)]
    if len(rims) == len(systems) and all(rim.core is rims[0][0].core for rim, _ in rims):
        return interior.solve_together(rims)
    return [solve_block(factor, B) for factor, B in systems]


def apply_block(A: Matrix | Mass, X: np.ndarray) -> np.ndarray:
    """A X for a block of vectors (n_own, k)."""
    if isinstance(A, Folded):
        if A.shared is not None:
            return sum_of_parts(A.shared, _folded_product(A, whole_part(A.shared, X)))
        return _folded_product(A, X)
    if isinstance(A, Doubled):
        return _complex(_times(A.matrix, _real(X)))
    if isinstance(A, Mass):
        return _mass_product(A, X)
    return _join_complex(_times(A, _split_complex(X))) if np.iscomplexobj(X) else _times(A, X)


def _mass_product(A: Mass, X: np.ndarray) -> np.ndarray:
    """M X for a body's rows (n_own, k), from the mass of one direction where that is all there
    is.
    """
    if A.of_one_direction is None:
        return apply_block(A.matrix(), X)
    directions = X.reshape(-1, A.dim * X.shape[1])
    return np.asfortranarray(apply_block(A.of_one_direction, directions).reshape(X.shape))


def _folded_product(A: Folded, X: np.ndarray) -> np.ndarray:
    """C^H A C X for unknowns (n_free, k) of one rank's part, a few columns at a time: what lies
    between the three factors then stays near the core.
    """
    turned = A.C.conj().T
    if X.shape[1] <= COLUMNS_AT_A_TIME:
        return np.asfortranarray(turned @ times(A.A, A.C @ X))
    out = np.empty(X.shape, np.result_type(X, A.C.dtype), order="F")
    for first in range(0, X.shape[1], COLUMNS_AT_A_TIME):
        part = slice(first, first + COLUMNS_AT_A_TIME)
        out[:, part] = turned @ times(A.A, A.C @ X[:, part])
    return out


def combined(
    A: Matrix,
    factor: float,
    B: Matrix,
) -> Matrix:
    """A + factor B."""
    if isinstance(A, Folded) and isinstance(B, Folded):
        return replace(A, A=entries_of_sum(A.A, factor, B.A), core=None)
    if isinstance(A, Doubled) and isinstance(B, Doubled):
        return Doubled(combined(A.matrix, factor, B.matrix))
    if isinstance(A, Folded | Doubled):
        raise TypeError("the sum of two matrices: expected both of one kind")
    out = A.duplicate(copy=True)
    out.axpy(factor, B, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    return out


def mean_diagonal(A: Matrix) -> float:
    """Mean of the diagonal, a measure of size."""
    if isinstance(A, Folded):
        if A.shared is None:
            return float(diagonal(A.A).mean())
        total = A.shared.cut.comm.allreduce(float(diagonal(A.A).sum()))
        return total / A.shared.open_size
    values = (A.matrix if isinstance(A, Doubled) else A).getDiagonal()
    return values.sum() / values.size


def dense_rows(A: Matrix, n: int) -> np.ndarray:
    """Numbers of the unknowns (0 to n-1) where ``factorise`` takes springs."""
    if not isinstance(A, Folded):
        return np.arange(n)
    return A.faces.masters if A.shared is None else A.shared.columns[A.faces.masters]


def inner_products(
    comm: MPI.Comm,
    X: Block,
    Y: np.ndarray,
) -> np.ndarray:
    """X^H Y over all ranks, (k, l); X may be a list of blocks side by side."""
    if isinstance(X, list):
        parts = [_local_product(block, Y) for block in X]
        part = np.concatenate(parts) if parts else np.zeros((0, Y.shape[1]), Y.dtype)
    else:
        part = _local_product(X, Y)
    return comm.allreduce(np.ascontiguousarray(part)) if comm.size > 1 else part


def column_norms(comm: MPI.Comm, X: np.ndarray) -> np.ndarray:
    """(k,) lengths of the columns (n_own, k) over all ranks."""
    squares = (X.real**2 + X.imag**2).sum(0) if np.iscomplexobj(X) else (X**2).sum(0)
    return np.sqrt(comm.allreduce(squares) if comm.size > 1 else squares)


def subtract_product(
    W: np.ndarray,
    V: list[np.ndarray],
    C: np.ndarray,
) -> np.ndarray:
    """W - V C, in W's own memory where its columns are contiguous; V is a list of blocks side by
    side.
    """
    gemm = blas.zgemm if np.iscomplexobj(W) else blas.dgemm
    for block, part in _paired_blocks(V, C):
        W = gemm(-1.0, block, part, 1.0, W, overwrite_c=1)
    return W


def linear_combinations(V: Block, C: np.ndarray) -> np.ndarray:
    """V C, columns contiguous; V may be a list of blocks side by side."""
    blocks = V if isinstance(V, list) else [V]
    gemm = blas.zgemm if np.iscomplexobj(blocks[0]) else blas.dgemm
    out = None
    for block, part in _paired_blocks(blocks, C):
        out = (
            gemm(1.0, block, part)
            if out is None
            else gemm(1.0, block, part, 1.0, out, overwrite_c=1)
        )
    return (
        np.zeros((len(blocks[0]), C.shape[1]), blocks[0].dtype, order="F") if out is None else out
    )


def recombine(W: np.ndarray, C: np.ndarray) -> np.ndarray:
    """W C (n_own, l) for l <= k, in the memory of W (n_own, k)."""
    few = W[:, : C.shape[1]]
    for first in range(0, len(W), ROWS_AT_A_TIME):
        rows = slice(first, first + ROWS_AT_A_TIME)
        few[rows] = W[rows] @ C
    return few


def hermitian_part(A: np.ndarray) -> np.ndarray:
    """(A + A^H) / 2, (k, k): what rounding leaves of symmetry is removed."""
    return (A + A.conj().T) / 2


def inertia(A: Matrix) -> int:
    """Number of negative eigenvalues, by Sylvester's law; the factors are not kept."""
    if isinstance(A, Folded):
        core = interior.eliminate_interior(
            entries(A.A), A.rim, definite=False, keep=False, shared=A.shared
        )
        return interior.count_negative(core, A.faces)
    doubled = isinstance(A, Doubled)
    parts = factorise_matrix(A.matrix if doubled else A, definite=False, keep=False)
    return parts.negative // 2 if doubled else parts.negative


def _local_product(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """X^H Y on this rank."""
    if not (X.size and Y.size):
        return X.conj().T @ Y
    if np.iscomplexobj(X) or np.iscomplexobj(Y):
        return blas.zgemm(1.0, X, Y, trans_a=2)
    return blas.dgemm(1.0, X, Y, trans_a=1)


def _paired_blocks(
    blocks: list[np.ndarray], C: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Each block with the rows of C that belong to it, empty ones left out."""
    ends = np.cumsum([block.shape[1] for block in blocks]).tolist()
    for block, first, last in zip(blocks, [0, *ends], ends, strict=False):
        if block.size and C.shape[1]:
            yield block, C[first:last]


def _times(A: PETSc.Mat, X: np.ndarray) -> np.ndarray:
    right = dense_matrix(A, np.asfortranarray(X, dtype=float))
    product = A.matMult(right)
    out = dense_values(product)
    # petsc4py keeps what is not destroyed for a later garbage collection
    for matrix in (right, product):
        matrix.destroy()
    return out


def _split_complex(X: np.ndarray) -> np.ndarray:
    return np.concatenate([X.real, X.imag], axis=1)


def _join_complex(both: np.ndarray) -> np.ndarray:
    k = both.shape[1] // 2
    out = np.empty((both.shape[0], k), complex, order="F")
    out.real, out.imag = both[:, :k], both[:, k:]
    return out


def _real(X: np.ndarray) -> np.ndarray:
    """(2 n_own, k) real and imaginary parts interleaved."""
    return np.ascontiguousarray(X.T, dtype=complex).view(float).T


def _complex(X: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(X.T).view(complex).T

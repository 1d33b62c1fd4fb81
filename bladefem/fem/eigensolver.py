"""The lowest eigenpairs of K x = lambda M x by SLEPc: Krylov-Schur iteration, shift-inverted at
zero with the factors that are there already.

SLEPc sees a real symmetric pencil. A complex Hermitian one (nodal diameters between 0 and N/2)
appears as its doubled real twin, whose eigenvalues come in pairs x and j x. In exact arithmetic the
space built on one real vector holds one of each pair: the Lanczos coefficients of a Hermitian
matrix are real. Rounding would let the others grow in; ``_times_inverse`` takes the components
along j times the earlier directions off each new one, so that within a few restarts no pair comes
twice; repeated ones are dropped in the end. What the iteration may miss (the second vector of a
truly double eigenvalue) is for the inertia count to notice.

PETSc options of the user (-eps_ncv 60, -eps_monitor, -eps_type ...) act after the settings here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..errors import InputError, NotSolvedError, suggestion
from .compat import PETSc, SLEPc, option_used, pages_kept
from .constraint import Constrained
from .lanczos import WantedPairs, lowest_eigenpairs, orthonormal
from .linalg import (
    apply_block,
    hermitian_part,
    inner_products,
    linear_combinations,
    subtract_product,
)
from .memory import give_back

# options that belong to SLEPc's solver and its spectral transformation
OWN_PREFIXES = ("-eps_", "-st_")
# some of them, for the sentence that refuses another
KNOWN_OPTIONS = ("-eps_monitor", "-eps_ncv", "-eps_tol", "-eps_type", "-eps_view", "-st_type")
# iterations (restarts) until SLEPc gives up
MAX_RESTARTS = 100
# basis vectors beyond twice the pairs wanted: fewer restart once more, more are not needed
MORE_VECTORS = 2
# share of the basis that a restart keeps: nearly all, so that convergence is looked at every second
# or third vector; with SLEPc's half a run ends only after eight more
KEPT_SHARE = 0.9
# columns that a growing block of vectors has room for at first
FIRST_BASIS_VECTORS = 48
# relative difference up to which a vector is a multiple of another: rounding
PARALLEL_TOLERANCE = 1e-14
# share of earlier directions in a new one that is rounding
ROUNDING_SHARE = 1e-14
# share of a direction beyond which it counts as new, after those that are known
NEW_DIRECTION_SHARE = 1e-6
# largest imaginary part of products with earlier directions, for a direction of the same space
IMAGINARY_PART_TOLERANCE = 1e-4
# words of EPSConvergedReason
REASON_WORDS = {-1: "too many restarts", -2: "breakdown", -3: "the pencil lost its symmetry"}


@dataclass(frozen=True)
class Eigensolver:
    """How eigenpairs are computed."""

    # "slepc", or "lanczos" for the block iteration of lanczos.py
    method: str = "slepc"
    # SLEPc's basis vectors; twice the pairs and MORE_VECTORS when None
    vectors: int | None = None
    # PETSc and SLEPc options as on a command line, such as "-eps_monitor"
    options: str = ""


class _Columns:
    """Vectors side by side in one array, which grows as they come."""

    def __init__(self) -> None:
        self._store: np.ndarray = np.empty((0, 0), order="F")
        self._count = 0

    @property
    def block(self) -> np.ndarray:
        """(n_own, k) all of them, columns contiguous."""
        return self._store[:, : self._count]

    def append(self, column: np.ndarray) -> None:
        """One more (n_own, 1)."""
        if self._count == self._store.shape[1]:
            room = max(2 * self._count, FIRST_BASIS_VECTORS)
            grown = np.empty((len(column), room), column.dtype, order="F")
            if self._count:
                grown[:, : self._count] = self.block
            self._store = grown
        self._store[:, self._count] = column[:, 0]
        self._count += 1

    def clear(self) -> None:
        """None are left."""
        self._count = 0

    def __len__(self) -> int:
        return self._count


@dataclass
class _Pencil:
    """The pencil as SLEPc's vectors see it: real and imaginary parts of an unknown side by side."""

    con: Constrained
    inverse: Callable[[np.ndarray], np.ndarray]
    # the vector that M was applied to last: the one that the inverse acts on next
    last: np.ndarray | None = None
    # keep the directions of real pencils too
    kept: bool = False
    # and its product by M
    image: np.ndarray | None = None
    # directions solved for
    known: _Columns = field(default_factory=lambda: _Columns())
    # the first vector has been multiplied
    started: bool = False
    # what a product or a solve raised, see ``_shielded``
    failure: BaseException | None = None

    @property
    def doubled(self) -> bool:
        """Complex Hermitian matrices become real ones of twice the size."""
        return self.con.dtype is complex

    def column(self, vector: PETSc.Vec) -> np.ndarray:
        """(n_own, 1) this rank's part of a PETSc vector."""
        values = vector.getArray(readonly=True).copy()
        return (values.view(complex) if self.doubled else values).reshape(-1, 1)

    def put(
        self,
        column: np.ndarray,
        vector: PETSc.Vec,
    ) -> None:
        """The inverse of ``column``."""
        values: np.ndarray = np.ascontiguousarray(column[:, 0], dtype=self.con.dtype)
        vector.setArray(values.view(float))


def _shielded(
    pencil: _Pencil,
    x: PETSc.Vec,
    y: PETSc.Vec,
    product: Callable[[np.ndarray], np.ndarray],
) -> None:
    """y = product(x), whose exception waits in the pencil until SLEPc has come to its end.

    On its way through SLEPc it would leave objects behind that cannot be destroyed any more. From
    then on all products are the identity, with which the iteration ends at once.
    """
    if pencil.failure is None:
        try:
            pencil.put(product(pencil.column(x)), y)
            return
        except BaseException as error:
            pencil.failure = error
    x.copy(y)


class _Operator:
    """A product with a column (n_own, 1), as PETSc calls it: a matrix's or a preconditioner's."""

    def __init__(
        self,
        pencil: _Pencil,
        product: Callable[[np.ndarray], np.ndarray],
    ) -> None:
        self.pencil = pencil
        self.product = product

    def mult(
        self,
        _: PETSc.Mat,
        x: PETSc.Vec,
        y: PETSc.Vec,
    ) -> None:
        _shielded(self.pencil, x, y, self.product)

    def apply(
        self,
        _: PETSc.PC,
        x: PETSc.Vec,
        y: PETSc.Vec,
    ) -> None:
        _shielded(self.pencil, x, y, self.product)


def _times_mass(pencil: _Pencil, column: np.ndarray) -> np.ndarray:
    """M x (n_own, 1)."""
    factor = _multiple(pencil.last, column)
    comm = pencil.con.body.comm
    if comm.size > 1:
        # the same real number on all ranks, or none
        factors = comm.allgather(factor)
        factor = factors[0] if _all_equal(factors) else None
    if factor is None or pencil.image is None:
        pencil.image = apply_block(pencil.con.M, column)
    else:
        # SLEPc scales what it has multiplied just now
        pencil.image = factor * pencil.image
    pencil.last = column
    return pencil.image


def _all_equal(factors: list[float | None]) -> bool:
    """Whether all ranks found one number, but for rounding."""
    first = factors[0]
    return first is not None and all(
        f is not None and abs(f - first) <= PARALLEL_TOLERANCE * abs(first) for f in factors
    )


def _multiple(vector: np.ndarray | None, other: np.ndarray) -> float | None:
    """The real number that makes the other vector (n_own, 1) of this one; None: there is none."""
    if vector is None or not len(vector):
        return None
    place = int(np.argmax(abs(vector.real)))
    if vector.real[place, 0] == 0:
        return None
    factor = float(other.real[place, 0] / vector.real[place, 0])
    # one entry tells most vectors apart
    quick = abs(other[0, 0] - factor * vector[0, 0]) <= PARALLEL_TOLERANCE * abs(other).max()
    if not quick:
        return None
    difference = other - factor * vector
    return factor if abs(difference).max() <= PARALLEL_TOLERANCE * abs(other).max() else None


def _times_inverse(pencil: _Pencil, load: np.ndarray) -> np.ndarray:
    """K^-1 b (n_own, 1), without the component along j times the earlier directions."""
    found = pencil.inverse(load)
    # SLEPc multiplies by M before it asks for the inverse
    assert pencil.last is not None
    if pencil.kept and not pencil.doubled:
        pencil.known.append(pencil.last)
    if pencil.doubled:
        _remember_direction(pencil, load)
        if len(pencil.known):
            image = apply_block(pencil.con.M, found)
            # of the products with earlier directions only the imaginary part is rounding
            # always: however small, SLEPc takes off the rest and lets them grow
            product = inner_products(pencil.con.body.comm, pencil.known.block, image)
            found = found - linear_combinations(pencil.known.block, 1j * product.imag)
            # SLEPc multiplies it by M next. What was taken off is orthogonal to the directions
            # in the real products that SLEPc sees, so its image would change none of them
            pencil.last = found
            pencil.image = image
    return found


def _remember_direction(pencil: _Pencil, load: np.ndarray) -> None:
    """Add what is new of the last direction to those that are known, orthonormal.

    All of them lie in one real space, in which inner products are real. The first vector of a space
    is none of them: SLEPc multiplies it by K^-1 M before it starts. A direction outside of the
    space (SLEPc starts again after a breakdown) is such a first vector.
    """
    last = pencil.last
    # SLEPc multiplies by M before it asks for the inverse
    assert last is not None
    comm = pencil.con.body.comm
    size = float(inner_products(comm, load, last).real[0, 0])
    product = np.zeros((0, 1), complex)
    if len(pencil.known):
        # the load is M times the last direction
        product = inner_products(comm, pencil.known.block, load)
    if not pencil.started or abs(product.imag).max(
        initial=0.0
    ) > IMAGINARY_PART_TOLERANCE * np.sqrt(size):
        pencil.started = True
        pencil.known.clear()
        return
    direction = last
    share = product.real
    if abs(share).max(initial=0.0) > ROUNDING_SHARE * np.sqrt(size):
        direction = direction - linear_combinations(pencil.known.block, share.astype(complex))
    rest = size - (share**2).sum()
    if rest > NEW_DIRECTION_SHARE * size:
        pencil.known.append(direction / np.sqrt(rest))


def krylov_schur(
    con: Constrained,
    inverse: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    wanted: WantedPairs,
    settings: Eigensolver | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The lowest eigenpairs; arguments and result as of :func:`lanczos.lowest_eigenpairs`.

    Args:
        start: (n_own, k), the columns' sum is the first vector.

    Raises:
        NotSolvedError: no convergence, with SLEPc's reason.
        InputError: an option for SLEPc's solver that it does not know.
    """
    count, guard = wanted.count, wanted.guard
    pencil = _Pencil(con, inverse, kept=guard > 0)
    settings = settings or Eigensolver()
    eps = _make_solver(pencil, start, wanted, settings)
    try:
        with pages_kept():
            eps.solve()
        if pencil.failure is not None:
            raise pencil.failure
        _refuse_unknown(settings.options)
        reason = int(eps.getConvergedReason())
        # memory of no more use, before the vectors come
        if not pencil.kept:
            pencil.known = _Columns()
        found = _converged_vectors(pencil, eps)
    finally:
        # now: at the end of the program its callbacks would be gone
        eps.destroy()
    most = min(count + guard, found.shape[1])
    directions = orthonormal(con, [], [], found, NEW_DIRECTION_SHARE)[1]
    # the solves that follow are the peak of memory
    del found
    give_back()
    lam, X = _purify_vectors(con, inverse, directions, most)
    if len(lam) < count and reason > 0:
        # some came twice after many restarts of a small basis: blocks find the others
        return lowest_eigenpairs(con, inverse, np.asfortranarray(X), wanted)
    if len(lam) < count:
        raise NotSolvedError(
            f"SLEPc found {len(lam)} of {count} modes: {REASON_WORDS.get(reason, 'no convergence')}"
        )
    if guard and len(lam) < count + guard and len(pencil.known):
        more, rough = _rough_pairs(pencil, X, count + guard - len(lam))
        lam, X = np.concatenate([lam, more]), np.asfortranarray(np.hstack([X, rough]))
    pencil.known = _Columns()
    # iterations that advance together end one after the other
    give_back()
    return lam, X


def _rough_pairs(
    pencil: _Pencil,
    X: np.ndarray,
    count: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues [rad^2/s^2] and vectors that the space of the iteration holds in addition to the
    converged ones, ``count`` at most, by Rayleigh and Ritz.
    """
    con = pencil.con
    MX = apply_block(con.M, X)
    # nobody needs them as they are any more
    basis = pencil.known.block
    basis = subtract_product(basis, [X], inner_products(con.body.comm, MX, basis))
    rest, _, _ = orthonormal(con, [X], [MX], basis, 1.0)
    lam, Z = np.linalg.eigh(
        hermitian_part(inner_products(con.body.comm, rest, apply_block(con.K, rest)))
    )
    return lam[:count], linear_combinations(rest, np.ascontiguousarray(Z[:, :count]))


def basis_size(count: int) -> int:
    """Vectors of the basis when the user gives none."""
    return 2 * count + MORE_VECTORS


def _make_solver(
    pencil: _Pencil,
    start: np.ndarray,
    wanted: WantedPairs,
    settings: Eigensolver,
) -> SLEPc.EPS:
    """SLEPc's solver with everything set."""
    count = wanted.count
    con = pencil.con
    comm = con.body.comm
    parts = 2 if pencil.doubled else 1
    own = parts * (con.own.stop - con.own.start)
    size = ((own, parts * con.T.shape[1]),) * 2
    K = PETSc.Mat().createPython(size, _Operator(pencil, partial(apply_block, con.K)), comm=comm)
    M = PETSc.Mat().createPython(size, _Operator(pencil, partial(_times_mass, pencil)), comm=comm)
    for matrix in (K, M):
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setUp()
    eps = SLEPc.EPS().create(comm)
    eps.setOperators(K, M)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(0.0)
    basis = settings.vectors or basis_size(count)
    eps.setDimensions(count, max(basis, count + 1))
    eps.setKrylovSchurRestart(KEPT_SHARE)
    eps.setTolerances(wanted.tolerance, MAX_RESTARTS)
    # done here, for all vectors in one batch
    eps.setPurify(False)
    transform = eps.getST()
    transform.setType(SLEPc.ST.Type.SINVERT)
    transform.setMatMode(SLEPc.ST.MatMode.SHELL)
    inner = transform.getKSP()
    inner.setType(PETSc.KSP.Type.PREONLY)
    inner.getPC().setType(PETSc.PC.Type.PYTHON)
    inner.getPC().setPythonContext(_Operator(pencil, partial(_times_inverse, pencil)))
    first = K.createVecRight()
    pencil.put(start.sum(axis=1, keepdims=True).astype(con.dtype), first)
    eps.setInitialSpace(first)
    if settings.options:
        _refuse_log_options(settings.options)
        PETSc.Options().insertString(settings.options)
    eps.setFromOptions()
    return eps


def _refuse_log_options(options: str) -> None:
    """Refuse options that PETSc reads as the program starts; it ends in an error at their late
    coming.

    Raises:
        InputError: the first of them.
    """
    for word in options.split():
        if word.startswith("-log_"):
            raise InputError(
                f"solver.petsc: {word} is read when the program starts, expected in the "
                f"environment: PETSC_OPTIONS={word}"
            )


def _refuse_unknown(options: str) -> None:
    """Refuse options with the solver's own prefixes that it did not ask for: misspelt ones.

    After a solve, since some are asked for at its end.

    Raises:
        InputError: the first of them.
    """
    for word in options.split():
        name = word.lstrip("-")
        if word.startswith(OWN_PREFIXES) and not option_used(name):
            raise InputError(
                f"PETSc option {word}: SLEPc's solver knows none of that name, expected one of its "
                f"manual{suggestion(word, KNOWN_OPTIONS)}"
            )


def _converged_vectors(pencil: _Pencil, eps: SLEPc.EPS) -> np.ndarray:
    """(n_own, m) converged vectors."""
    size = pencil.con.own.stop - pencil.con.own.start
    out = np.empty((size, eps.getConverged()), pencil.con.dtype, order="F")
    vector = eps.getOperators()[0].createVecRight()
    for i in range(out.shape[1]):
        eps.getEigenvector(i, vector)
        out[:, i] = pencil.column(vector)[:, 0]
    return out


def _purify_vectors(
    con: Constrained,
    inverse: Callable[[np.ndarray], np.ndarray],
    MQ: np.ndarray,
    wanted: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and M-orthonormal vectors K^-1 M x, which inverse iteration frees from rounding
    in stiff directions.

    Args:
        MQ: (n_own, k) products by M of M-orthonormal vectors.
    """
    if not MQ.shape[1]:
        return np.zeros(0), MQ
    Y = inverse(MQ)
    theta, S = np.linalg.eigh(hermitian_part(inner_products(con.body.comm, MQ, Y)))
    theta = theta[::-1][:wanted]
    good = theta > 0
    del MQ
    V = linear_combinations(Y, np.ascontiguousarray((S[:, ::-1][:, :wanted] / theta)[:, good]))
    del Y
    MV = apply_block(con.M, V)
    gram = hermitian_part(inner_products(con.body.comm, V, MV))
    # nearly the identity: its inverse root keeps each vector where it is
    size, Z = np.linalg.eigh(gram)
    root = (Z / np.sqrt(size)) @ Z.conj().T
    return 1 / theta[good], linear_combinations(V, np.ascontiguousarray(root))

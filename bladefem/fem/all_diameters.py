"""All nodal diameters of a wheel: a few solved from scratch, the others from the space that these
span.

The vectors of a few nodal diameters, real and imaginary parts apart, nearly span those of all
others. Projected onto them the three matrices of K(n) are small; what comes out starts a block
Lanczos iteration, which stops only at the same tolerance as SLEPc's solve from scratch. The inertia
of K(n) - s M(n), one more factorisation for all n, proves the count.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from ..data import ModeSet, SectorSpan
from ..errors import InputError, NotSolvedError
from ..util.progress import Progress, without_progress
from . import cyclic_schur as core
from .body import Body
from .constraint import (
    Constrained,
    Transformation,
    at_diameter,
    checked_diameter,
    high_part,
    transformation,
)
from .eigensolver import Eigensolver
from .flexibility import Flexibility, flexible
from .linalg import (
    Folded,
    apply_block,
    combined,
    inertia,
    inner_products,
    linear_combinations,
    subtract_product,
)
from .memory import give_back
from .modes import (
    BLOCKS,
    DIRECTION_TOLERANCE,
    GAP_SHARE,
    MIN_GAP,
    SLEPC,
    highest_gap,
    lowest_pairs,
    mode_set,
    pairs_together,
)
from .open_matrix import chosen_rows, entries_of_sum, times
from .open_sector import columns_of_part
from .subdomains import whole_part

# modes beyond those asked for, carried along
GUARD_MODES = 2
# rough ones beyond, from which other diameters are guessed
EXTRA_ROUGH_MODES = 12
# places of the diameters solved first: shapes change fastest at low ones
FIRST_DIAMETER_PLACES = (0, 1, 1 / 3, 1 / 6, 2 / 3)
# numbers of solved diameters from which the others are guessed
SOLVED_DIAMETERS_BY_LEVEL = (3, 4, 5)
# diameters solved from scratch at a time: more of them would save little and take memory
DIAMETERS_AT_A_TIME = 3
# columns of a sparse product at a time, to spare memory
COLUMNS_AT_A_TIME = 16
# error of a vector's direction; that of a frequency is its square
VECTOR_TOLERANCE = 5e-6


@dataclass(frozen=True)
class _Space:
    """The space that the vectors of some nodal diameters span, and the matrices on it."""

    # (n_own, at least m) memory of W, with room for more
    store: np.ndarray
    # (n_own, m) nearly orthonormal, real
    W: np.ndarray
    # (m, m) projections of K0, Kc, Ks
    K: list[np.ndarray]
    M: list[np.ndarray]


@dataclass(frozen=True)
class Eigenpairs:
    """Modes of one nodal diameter as this rank's unknowns."""

    t: Transformation
    nodal_diameter: int
    # (m,) [rad^2/s^2], ascending
    lam: np.ndarray
    # (n_own, m) M-orthonormal
    X: np.ndarray
    # the factorisation that they came from; None where nobody needs it again
    flex: Flexibility | None = None

    @property
    def con(self) -> Constrained:
        """The body in this nodal diameter, made anew where the factorisation is gone: the maps of
        all nodal diameters would fill a twentieth of the memory.
        """
        if self.flex is not None:
            return self.flex.con
        return at_diameter(self.t, self.nodal_diameter)


@dataclass(frozen=True)
class KeptPairs:
    """Proven modes that a reduction of the same body needs, too."""

    # modes of each nodal diameter
    count: int
    # nodal diameter to its modes
    pairs: dict[int, Eigenpairs] = field(default_factory=dict)

    def serves(self, diameters: Sequence[int], count: int) -> bool:
        """Whether it has so many modes of all these nodal diameters."""
        return count <= self.count and all(n in self.pairs for n in diameters)


def all_diameters(
    body: Body | Transformation,
    count: int,
    diameters: Sequence[int] | None = None,
    direct: bool = False,
    clamp: str | None = "clamp",
    progress: Progress = without_progress,
    solver: Eigensolver = SLEPC,
    kept: KeptPairs | None = None,
) -> list[ModeSet]:
    """The lowest modes in each nodal diameter, counted by inertia below the highest gap that all of
    them share.

    Args:
        body: a body with cut faces (held at ``clamp``), or its transformation.
        diameters: 0 to N/2 when left out.
        direct: solve every nodal diameter from scratch.
        progress: shows which nodal diameter is at work.
        kept: more modes are solved, more exactly, and kept here for a reduction.

    Raises:
        InputError: a nodal diameter that the wheel does not have, count not positive.
        NotSolvedError: from a factorisation, no convergence, or a mode that is lost even in a solve
            from scratch.
    """
    if count < 1:
        raise InputError(f"count is {count}, expected at least 1 mode")
    t = transformation(body, clamp, True) if isinstance(body, Body) else body
    wanted = list(range(t.sectors // 2 + 1)) if diameters is None else list(diameters)
    solved = count if kept is None else max(count, kept.count)
    tolerance = VECTOR_TOLERANCE if kept is None else DIRECTION_TOLERANCE
    steps = progress(
        eigenpairs(t, solved, wanted, direct, tolerance, solver), "nodal diameters", len(wanted)
    )
    found = {p.nodal_diameter: p if kept is not None else _bare(p, count) for p in steps}
    if isinstance(body, Body) and kept is None and t.opened is not None:
        # nobody else has them: the count takes their memory
        t.opened.elimination.release()
    found = _check_inertia(t, found, solved, tolerance)
    if kept is not None:
        kept.pairs.update(found)
    sets = {}
    # vectors go as shapes come: both at once would be the peak of memory
    for n in sorted(found):
        p = found.pop(n)
        sets[n] = mode_set(p.con, p.lam[:count], p.X[:, :count])
    return [sets[n] for n in wanted]


def eigenpairs(
    t: Transformation,
    count: int,
    diameters: Sequence[int],
    direct: bool = False,
    tolerance: float = VECTOR_TOLERANCE,
    solver: Eigensolver = SLEPC,
) -> Iterator[Eigenpairs]:
    """``count`` pairs and some guards in each nodal diameter, in the order in which they are
    solved.
    """
    order = _diameter_order(sorted(checked_diameter(n, t.sectors) for n in set(diameters)))
    guessed = len(order) > SOLVED_DIAMETERS_BY_LEVEL[0] and not direct
    scratch = order[: SOLVED_DIAMETERS_BY_LEVEL[0]] if guessed else order
    blocks: list[np.ndarray] = []
    guard = EXTRA_ROUGH_MODES if guessed else GUARD_MODES
    for first in range(0, len(scratch), DIAMETERS_AT_A_TIME):
        some = scratch[first : first + DIAMETERS_AT_A_TIME]
        together = _solve_together(t, some, count, tolerance, guard, solver)
        while together:
            found = together.pop(0)
            if guessed:
                blocks.append(found.X)
            yield _first_pairs(found, count, guessed)
            # its factor and vectors are not kept while others are solved
            del found
    yield from _guessed_pairs(t, count, order[len(scratch) :], blocks, tolerance, solver)


def _guessed_pairs(
    t: Transformation,
    count: int,
    diameters: list[int],
    blocks: list[np.ndarray],
    tolerance: float,
    solver: Eigensolver,
) -> Iterator[Eigenpairs]:
    """Nodal diameters from the space that the vectors of those before them span.

    Args:
        blocks: (n_own, k) vectors of the nodal diameters solved from scratch, which are taken out.
    """
    space = None
    # real and imaginary part of each vector
    room = 2 * SOLVED_DIAMETERS_BY_LEVEL[-1] * (count + EXTRA_ROUGH_MODES)
    starts: dict[int, np.ndarray] = {}
    for i, n in enumerate(diameters, SOLVED_DIAMETERS_BY_LEVEL[0]):
        helps = i < SOLVED_DIAMETERS_BY_LEVEL[-1]
        if i in SOLVED_DIAMETERS_BY_LEVEL:
            give_back()
            space = _extend_space(t, blocks, space, room)
            some = [n] if helps else diameters[i - SOLVED_DIAMETERS_BY_LEVEL[0] :]
            # the last ones need a step or two: guards would not pay
            guess = count + (GUARD_MODES if helps else 0)
            starts = {m: _initial_vectors(space, t, m, guess) for m in some}
            # no more guesses: they are smaller than the space
            space = space if helps else None
        # what the last one took would stay with it, in pieces that do not fit
        give_back()
        found = _solve_pairs(
            t,
            n,
            count,
            starts.pop(n),
            solver,
            tolerance,
            EXTRA_ROUGH_MODES if helps else GUARD_MODES,
        )
        if helps:
            blocks.append(found.X)
        yield _first_pairs(found, count, helps)
        del found


def _solve_together(
    t: Transformation,
    diameters: list[int],
    count: int,
    tolerance: float,
    guard: int,
    solver: Eigensolver,
) -> list[Eigenpairs]:
    """A few nodal diameters from scratch."""
    some = [flexible(at_diameter(t, n)) for n in diameters]
    solved = pairs_together(some, count, tolerance, guard, solver)
    return [
        Eigenpairs(t, n, lam, X, flex)
        for n, flex, (lam, X) in zip(diameters, some, solved, strict=True)
    ]


def _bare(found: Eigenpairs, count: int) -> Eigenpairs:
    """The pairs asked for, without guards and factors: of all nodal diameters they would fill a
    tenth of the memory.
    """
    X = found.X[:, :count].copy(order="F")
    return replace(found, lam=found.lam[:count], X=X, flex=None)


def sector_span(t: Transformation, blocks: list[np.ndarray], P: sp.spmatrix) -> SectorSpan:
    """The space that vectors of some nodal diameters span, with its matrices and motions of the
    ports, for the reduction of all others (collective).

    Args:
        blocks: (n_own, k) vectors of each of them, as this rank's unknowns.
        P: (n_points*dim, p) port vectors in mesh numbering.
    """
    space = _extend_space(t, list(blocks), None)
    rank = t.body.comm.rank
    own = slice(int(t.start[rank]), int(t.start[rank + 1]))
    ports = sp.csc_matrix(P).T

    def moved(T: sp.csr_matrix) -> np.ndarray:
        local = (ports @ T).tocsc()[:, own] @ space.W
        return np.asarray(t.body.comm.allreduce(local) if t.body.comm.size > 1 else local)

    return SectorSpan(np.array(space.K), np.array(space.M), moved(t.low), moved(high_part(t)))


def _first_pairs(
    found: Eigenpairs,
    count: int,
    copied: bool,
) -> Eigenpairs:
    """The lowest eigenpairs: ``count`` of them and the guards; a copy where the memory of the
    others is needed for something else.
    """
    few = slice(0, count + GUARD_MODES)
    return replace(
        found, lam=found.lam[few], X=found.X[:, few].copy(order="F") if copied else found.X
    )


def _diameter_order(order: list[int]) -> list[int]:
    """Nodal diameters in the order in which they are solved: first a few, between which the
    vectors of the others are guessed well.
    """
    first = [round(part * (len(order) - 1)) for part in FIRST_DIAMETER_PLACES] if order else []
    return [order[i] for i in dict.fromkeys([*first, *range(len(order))])]


def _solve_pairs(
    t: Transformation,
    nodal_diameter: int,
    count: int,
    start: np.ndarray | None,
    solver: Eigensolver,
    tolerance: float = VECTOR_TOLERANCE,
    guard: int = GUARD_MODES,
) -> Eigenpairs:
    flex = flexible(at_diameter(t, nodal_diameter))
    guard = min(guard, flex.con.T.shape[1] - count)
    lam, X = lowest_pairs(flex, count, tolerance, start, guard, solver)
    return Eigenpairs(t, nodal_diameter, lam, X, flex)


def _extend_space(
    t: Transformation,
    blocks: list[np.ndarray],
    known: _Space | None,
    room: int = 0,
) -> _Space:
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
        return _Space(store, W, *columns)
    return _Space(
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


def _initial_vectors(
    space: _Space,
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
    known: _Space | None,
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


def _check_inertia(
    t: Transformation,
    found: dict[int, Eigenpairs],
    count: int,
    tolerance: float = VECTOR_TOLERANCE,
) -> dict[int, Eigenpairs]:
    """Compare counts with inertia at one shift; a diameter that lost a mode is solved from
    scratch.
    """
    lost = lost_modes(t, _list_eigenvalues(found), count)
    for n in lost:
        found[n] = found_again(t, n, count, lost[n], tolerance)
    return found


def _list_eigenvalues(found: dict[int, Eigenpairs]) -> dict[int, np.ndarray]:
    return {n: p.lam for n, p in found.items()}


@dataclass(frozen=True)
class Count:
    """Number of eigenvalues of one nodal diameter below a shift, by inertia."""

    # [rad^2/s^2]
    shift: float
    # eigenvalues below the shift
    exact: int


def lost_modes(
    t: Transformation,
    lam: dict[int, np.ndarray],
    count: int,
) -> dict[int, Count]:
    """Nodal diameters whose eigenvalues (m,) below a shift are not as many as the inertia
    counts.
    """
    give_back()
    shift = _counting_shift([some[:count] for some in lam.values()])
    if not shift > 0:
        # rigid motions alone, which geometry counts
        return {}
    shared = _shifted_core(t, shift)
    exact = _counts_below(t, list(lam), shift, shared)
    del shared
    give_back()
    # guards beyond the count have not converged, and may be anywhere
    return {
        n: Count(shift, exact[n])
        for n in lam
        if exact[n] != np.count_nonzero(lam[n][:count] < shift)
    }


def found_again(
    t: Transformation,
    nodal_diameter: int,
    count: int,
    truth: Count,
    tolerance: float = VECTOR_TOLERANCE,
) -> Eigenpairs:
    """A nodal diameter solved from scratch by blocks, which do not miss double eigenvalues.

    Raises:
        NotSolvedError: the numbers differ even so.
    """
    enough = max(count, truth.exact + 1)
    p = _solve_pairs(t, nodal_diameter, enough, None, BLOCKS, tolerance)
    found = np.count_nonzero(p.lam[:enough] < truth.shift)
    if found != truth.exact:
        raise NotSolvedError(
            f"nodal diameter {nodal_diameter}: {found} modes were found below "
            f"{np.sqrt(truth.shift) / (2 * np.pi):.6g} Hz, the inertia counts {truth.exact}"
        )
    return p


def _shifted_core(t: Transformation, shift: float) -> core.Core | None:
    """K - shift M of the open sector with its interior eliminated, for all nodal diameters."""
    if t.opened is None:
        return None
    opened = t.opened
    return opened.elimination.shifted(entries_of_sum(opened.K, -shift, opened.M))


def _counts_below(
    t: Transformation,
    diameters: list[int],
    shift: float,
    shared: core.Core | None,
) -> dict[int, int]:
    """Eigenvalues below the shift in each nodal diameter (collective).

    Raises:
        NotSolvedError: the shift is an eigenvalue, on all ranks where it is on one.
    """
    comm = t.body.comm
    if shared is None:
        return {n: _count_below(at_diameter(t, n), shift, None) for n in diameters}
    # all ranks have the whole cut faces: each counts some of the nodal diameters
    found: dict[int, int] = {}
    error = None
    try:
        for n in diameters[comm.rank :: comm.size]:
            found[n] = _count_below(at_diameter(t, n), shift, shared)
    except NotSolvedError as problem:
        error = problem
    counts: dict[int, int] = {}
    for some, failure in comm.allgather((found, error)):
        if failure is not None:
            raise failure
        counts |= some
    return counts


def _count_below(
    con: Constrained,
    shift: float,
    shared: core.Core | None,
) -> int:
    if shared is None or not isinstance(con.K, Folded):
        return inertia(combined(con.K, -shift, con.M))
    return core.count_negative(shared, con.K.faces)


def _counting_shift(lists: list[np.ndarray]) -> float:
    """A shift near the upper end of the highest gap of all eigenvalues, in what every diameter
    covers.
    """
    top = min(lam[-1] for lam in lists)
    below = np.unique(np.concatenate([lam[lam <= top] for lam in lists]))
    below = below[below > 0]
    if len(below) < 2:
        return float(top) * (1 - 1e-6)
    gap = highest_gap(below)
    if gap is None:
        # all are one multiple eigenvalue: between its copies there is rounding alone
        return float(top) * (1 + MIN_GAP)
    return float(below[gap - 1] + GAP_SHARE * (below[gap] - below[gap - 1]))

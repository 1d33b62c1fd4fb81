"""All nodal diameters of a wheel: a few solved from scratch, the others from the space that these
span.

What that space gives (``diameter_space``) starts a block Lanczos iteration, which stops only at the
same tolerance as SLEPc's solve from scratch. The inertia of K(n) - s M(n), one more factorisation
for all n, proves the count (``mode_count``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..data import ModeSet
from ..errors import InputError, NotSolvedError
from ..util.progress import Progress, without_progress
from .body import Body
from .constraint import (
    Constrained,
    Transformation,
    at_diameter,
    checked_diameter,
    transformation,
)
from .diameter_space import extend_space, initial_vectors
from .eigensolver import Eigensolver
from .flexibility import Flexibility, flexible
from .lanczos import DIRECTION_TOLERANCE, WantedPairs
from .memory import give_back
from .mode_count import Count, lost_modes
from .modes import (
    BLOCKS,
    SLEPC,
    existing_pairs,
    lowest_pairs,
    mode_set,
    pairs_together,
)

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
# error of a vector's direction; that of a frequency is its square
VECTOR_TOLERANCE = 5e-6


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
        together = _solve_together(t, some, WantedPairs(count, tolerance, guard), solver)
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
            space = extend_space(t, blocks, space, room)
            some = [n] if helps else diameters[i - SOLVED_DIAMETERS_BY_LEVEL[0] :]
            # the last ones need a step or two: guards would not pay
            guess = count + (GUARD_MODES if helps else 0)
            starts = {m: initial_vectors(space, t, m, guess) for m in some}
            # no more guesses: they are smaller than the space
            space = space if helps else None
        # what the last one took would stay with it, in pieces that do not fit
        give_back()
        found = _solve_pairs(
            t,
            n,
            WantedPairs(count, tolerance, EXTRA_ROUGH_MODES if helps else GUARD_MODES),
            starts.pop(n),
            solver,
        )
        if helps:
            blocks.append(found.X)
        yield _first_pairs(found, count, helps)
        del found


def _solve_together(
    t: Transformation,
    diameters: list[int],
    wanted: WantedPairs,
    solver: Eigensolver,
) -> list[Eigenpairs]:
    """A few nodal diameters from scratch."""
    some = [flexible(at_diameter(t, n)) for n in diameters]
    solved = pairs_together(some, wanted, solver)
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
    wanted: WantedPairs,
    start: np.ndarray | None,
    solver: Eigensolver,
) -> Eigenpairs:
    flex = flexible(at_diameter(t, nodal_diameter))
    lam, X = lowest_pairs(flex, existing_pairs(flex, wanted), start, solver)
    return Eigenpairs(t, nodal_diameter, lam, X, flex)


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
    wanted = WantedPairs(enough, tolerance, GUARD_MODES)
    p = _solve_pairs(t, nodal_diameter, wanted, None, BLOCKS)
    found = np.count_nonzero(p.lam[:enough] < truth.shift)
    if found != truth.exact:
        raise NotSolvedError(
            f"nodal diameter {nodal_diameter}: {found} modes were found below "
            f"{np.sqrt(truth.shift) / (2 * np.pi):.6g} Hz, the inertia counts {truth.exact}"
        )
    return p

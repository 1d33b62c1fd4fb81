"""The number of modes below a frequency in each nodal diameter, by the inertia of K - s M."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import NotSolvedError
from . import cyclic_schur as core
from .constraint import (
    Constrained,
    Transformation,
    at_diameter,
)
from .linalg import (
    Folded,
    combined,
    inertia,
)
from .memory import give_back
from .modes import (
    GAP_SHARE,
    MIN_GAP,
    highest_gap,
)
from .open_matrix import entries_of_sum


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

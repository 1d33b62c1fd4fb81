"""Partial slip of a pressed patch: Coulomb friction on an elastic interface, one small load step
after another.

The normal forces are known; slip is along one tangential direction. A step finds tangential forces
q with

    slip = shift - C (q - q_old) + tie,    |q_i| <= limit_i,
    slip_i (q_i - limit_i) = 0 for slip_i > 0, and so on,

where shift is the rigid displacement of the step, or follows from the total force. Cattaneo 1938,
Mindlin 1949.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ..errors import InputError, NotSolvedError
from ..scene.units import newtons
from .as_array import as_float_array

ROUND_OFF = 1e-12


@dataclass(frozen=True)
class SlipState:
    """State of a patch after a step."""

    # (n,) tangential forces [N]
    force: np.ndarray
    # rigid tangential displacement since the start [m]
    shift: float
    # (n,) slip of the step [m]
    slip: np.ndarray
    # (n,) 0 stick, +1 or -1 slip at +limit or -limit
    state: np.ndarray
    # dissipated in the step [J]
    work: float


def slip_step(
    C: np.ndarray,
    limit: np.ndarray,
    before: SlipState | None = None,
    *,
    shift: float | None = None,
    total: float | None = None,
    max_iterations: int = 100,
) -> SlipState:
    """One load step: prescribe either the rigid shift or the total tangential force reached at its
    end.

    Args:
        C: (n, n) tangential flexibility, symmetric positive definite [m/N].
        limit: (n,) mu times the normal force [N].
        before: the state before; None for an unloaded patch.
        shift: rigid displacement at the end of the step [m].
        total: sum of the tangential forces at the end of the step [N].

    Raises:
        InputError: not exactly one of shift and total, a total beyond the sum of the limits, a
            negative limit, a flexibility that is not positive definite, shapes that do not fit,
            values that are not finite.
        NotSolvedError: the active sets did not settle.
    """
    limit, n = as_float_array("limit", limit, (None,)), len(limit)
    C = as_float_array("C", C, (n, n))
    if (limit < 0).any():
        raise InputError(f"limit of a node is {newtons(limit.min())}, expected at least 0 N")
    for name, value in (("shift", shift), ("total", total)):
        if value is not None:
            as_float_array(name, value, ())
    if (shift is None) == (total is None):
        raise InputError("slip_step needs exactly one of shift and total")
    if total is not None and not abs(total) < limit.sum():
        raise InputError(
            f"total tangential force is {newtons(total)}, expected below the limits' sum "
            f"{newtons(limit.sum())}"
        )
    before = before or SlipState(np.zeros(n), 0.0, np.zeros(n), np.zeros(n, int), 0.0)
    as_float_array("before.force", before.force, (n,))
    state = np.where(limit > 0, before.state, 1)
    seen = set()
    for _ in range(max_iterations):
        q, move = _stuck_forces(C, limit, before, state, shift, total)
        slip = move - C @ (q - before.force)
        new = _update_states(q, slip, limit, state)
        if np.array_equal(new, state):
            slip[state == 0] = 0.0
            return SlipState(
                q, before.shift + move, slip, np.where(limit > 0, state, 0), float(q @ slip)
            )
        state = _change_worst(new, state, q, slip, limit) if new.tobytes() in seen else new
        seen.add(new.tobytes())
    raise NotSolvedError(f"the stick and slip sets did not settle in {max_iterations} steps")


def _stuck_forces(
    C: np.ndarray,
    limit: np.ndarray,
    before: SlipState,
    state: np.ndarray,
    shift: float | None,
    total: float | None,
) -> tuple[np.ndarray, float]:
    """Forces (n,) with the slipping nodes at their limit and no slip elsewhere, and the rigid move
    of the step.
    """
    q = state * limit
    S = np.flatnonzero(state == 0)
    rest = np.flatnonzero(state != 0)
    move = 0.0 if shift is None else shift - before.shift
    if len(S) == 0:
        if shift is None:
            raise NotSolvedError("every node slips, so the total force can't be reached by stick")
        return q, move
    load = C[np.ix_(S, S)] @ before.force[S] - C[np.ix_(S, rest)] @ (q - before.force)[rest]
    try:
        factor = cho_factor(C[np.ix_(S, S)], lower=True)
    except LinAlgError:
        raise InputError(
            "C is not positive definite, expected the flexibility of an elastic body"
        ) from None
    X = cho_solve(factor, np.column_stack([load, np.ones(len(S))]))
    if shift is None:
        move = (total - q[rest].sum() - X[:, 0].sum()) / X[:, 1].sum()
    q[S] = X[:, 0] + move * X[:, 1]
    return q, move


def _update_states(
    q: np.ndarray,
    slip: np.ndarray,
    limit: np.ndarray,
    state: np.ndarray,
) -> np.ndarray:
    """Stuck nodes beyond their limit slip; slipping nodes that move backwards stick."""
    edge = limit * (1 + ROUND_OFF)
    back = state * slip < -ROUND_OFF * np.abs(slip).max(initial=0.0)
    new = np.where(
        state == 0, np.where(q > edge, 1, np.where(q < -edge, -1, 0)), np.where(back, 0, state)
    )
    return np.where(limit > 0, new, state)


def _change_worst(
    new: np.ndarray,
    state: np.ndarray,
    q: np.ndarray,
    slip: np.ndarray,
    limit: np.ndarray,
) -> np.ndarray:
    """After a repeated set, change the node only that breaks its condition most."""
    forced = np.where(
        state == 0, (np.abs(q) - limit) / limit.max(), np.abs(slip) / (np.abs(slip).max() + 1e-300)
    )
    worst = int(np.argmax(np.where(new != state, forced, -1.0)))
    out = state.copy()
    out[worst] = new[worst]
    return out

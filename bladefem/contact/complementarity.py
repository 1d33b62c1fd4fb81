"""Unilateral contact of linear bodies as a dense linear complementarity problem, solved by active
sets.

Find forces f >= 0 and rigid displacements q with

    gap = g0 + C f + R q >= 0,    f . gap = 0,    R^T f = load,

which is the optimality condition of the convex programme min 1/2 f C f + g0 f over f >= 0, R^T f =
load.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import nnls

from ..errors import InputError
from ..util.arrays import BooleanArray, RealArray
from .as_array import as_float_array

# relative size below which a force or gap counts as zero when the active set is updated
ROUND_OFF = 1e-12
# singular value of R, relative to the largest, below which a rigid direction is not held
RIGID_RANK_TOLERANCE = 1e-6
# relative part of the load that may stay unbalanced
UNBALANCED_LOAD_SHARE = 1e-8


INDEFINITE_FLEXIBILITY_MESSAGE = "the contact flexibility is not positive definite"


@dataclass(frozen=True)
class LCPSolution:
    """Forces, gaps and rigid displacements, with the proof that they are optimal."""

    # (n,) [N]
    force: RealArray
    # (n,) [m]
    gap: RealArray
    # (d,) rigid displacement q, smallest norm where directions are not held
    rigid: RealArray
    # (n,) bool, nodes in contact
    active: BooleanArray
    # largest violation of any of the conditions, relative (see complementarity)
    residual: float
    iterations: int
    # "" when solved, else one sentence
    reason: str


def solve_lcp(
    C: np.ndarray,
    g0: np.ndarray,
    R: np.ndarray | None = None,
    load: np.ndarray | None = None,
    start: np.ndarray | None = None,
    tolerance: float = 1e-9,
    max_iterations: int = 60,
) -> LCPSolution:
    """Solve the contact problem by a primal-dual active set, with a finitely convergent primal
    method behind it.

    Args:
        C: (n, n) flexibility, symmetric positive definite [m/N].
        g0: (n,) gap without contact forces [m].
        R: (n, d) gap opened by unit rigid displacements; None when nothing floats.
        load: (d,) required R^T f [N, N m].
        start: (n,) bool, nodes in contact in a neighbouring state (warm start).
        tolerance: accepted `residual`.
        max_iterations: of the primal-dual method before the primal method takes over.

    Returns:
        LCPSolution; `reason` is not empty when the load can't be balanced by pressing forces or the
        loops ran out.

    Raises:
        InputError: shapes that do not fit, values that are not finite, no node at all, or a load
            where nothing floats.

    Source: semismooth Newton form of the active set, Hintermueller, Ito, Kunisch, DOI
    10.1137/S1052623401383558.
    """
    C, g0, R, load = _check_arrays(C, g0, R, load)
    n = len(g0)
    reason = _balance_failure(R, load) if load.size else ""
    if reason:
        return _unsolved_problem(g0, R, np.zeros(n, bool), reason)
    U, S, V = held_directions(R)
    reduced = (V.T @ load) / S
    # closes even gaps, however wide, before round-off could drown the elastic ones in them
    travel = -(U.T @ g0)
    g0 = g0 + U @ travel
    warm = None if start is None else as_float_array("start", start, (n,)) > 0
    active = _winkler_set(C, g0, U, reduced) if warm is None else warm
    try:
        f, y, active, its, settled = _primal_dual(C, g0, U, reduced, active, max_iterations)
        if not settled:
            f, y, active, more, settled = _primal_active_set(C, g0, U, reduced)
            its += more
    except LinAlgError:
        return _unsolved_problem(g0, R, active, INDEFINITE_FLEXIBILITY_MESSAGE)
    gap = g0 + C @ f + U @ y
    residual = complementarity(f, gap, float(np.abs(C @ f).max()))
    residual = max(residual, _unbalanced_part(U.T @ f - reduced, f))
    if residual > tolerance:
        reason = (
            f"the contact iteration stopped after {its} steps with a residual of {residual:.1e}, "
            f"wanted {tolerance:.1e}"
        )
    return LCPSolution(f, gap, V @ ((y + travel) / S), active, residual, its, reason)


def _unbalanced_part(missing: np.ndarray, force: np.ndarray) -> float:
    """Largest force missing in the balance over the largest force [1]."""
    return float(np.abs(missing).max(initial=0.0) / (np.abs(force).max() + 1e-300))


def _unsolved_problem(
    g0: np.ndarray,
    R: np.ndarray,
    active: np.ndarray,
    reason: str,
) -> LCPSolution:
    """No forces, and why."""
    nothing = np.zeros(len(g0))
    return LCPSolution(nothing, g0.copy(), np.zeros(R.shape[1]), active, np.inf, 0, reason)


def _check_arrays(
    C: np.ndarray,
    g0: np.ndarray,
    R: np.ndarray | None,
    load: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """All four as arrays that fit each other, without floating body and load where these are left
    out.
    """
    g0 = as_float_array("g0", g0, (None,))
    if len(g0) == 0:
        raise InputError("g0 is empty, expected the gap of at least one contact node")
    if R is None and load is not None:
        raise InputError(
            "load is given without R, expected the rigid motions of the body that it acts on"
        )
    R = np.zeros((len(g0), 0)) if R is None else as_float_array("R", R, (len(g0), None))
    load = np.zeros(R.shape[1]) if load is None else as_float_array("load", load, (R.shape[1],))
    return as_float_array("C", C, (len(g0), len(g0))), g0, R, load


def complementarity(
    force: np.ndarray,
    gap: np.ndarray,
    scale: float,
) -> float:
    """Largest |min(f / max f, gap / scale)| [1], 0 when optimal; scale is a typical displacement
    [m].
    """
    f = force / max(float(np.abs(force).max(initial=0.0)), 1e-300)
    return float(np.abs(np.minimum(f, gap / max(scale, 1e-300))).max(initial=0.0))


def held_directions(R: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """R = U S V^T over the directions that contact forces can hold; U (n, r) orthonormal."""
    if R.shape[1] == 0:
        return R, np.zeros(0), np.zeros((0, 0))
    U, S, Vt = np.linalg.svd(R, full_matrices=False)
    held = S > RIGID_RANK_TOLERANCE * S[0]
    return U[:, held], S[held], Vt[held].T


def _balance_failure(R: np.ndarray, load: np.ndarray) -> str:
    """Empty when forces >= 0 with R^T f = load exist (found by non-negative least squares), else
    the reason.
    """
    scale = np.abs(R).max(axis=0)
    scale[scale == 0] = 1.0
    size = float(np.linalg.norm(load / scale))
    if size == 0:
        return "the load on the floating body is zero, so nothing presses the faces together"
    _, rest = nnls((R / scale).T, load / scale)
    if rest <= UNBALANCED_LOAD_SHARE * size:
        return ""
    return (
        f"pressing contact forces can't balance the load ({rest / size:.1%} of it stays): it lifts "
        "the body off"
    )


def _winkler_set(
    C: np.ndarray,
    g0: np.ndarray,
    U: np.ndarray,
    load: np.ndarray,
) -> np.ndarray:
    """First guess of the contact: each node on its own spring, soft enough to err towards a small
    set.
    """
    k = 4.0 / C.sum(axis=1).clip(min=C.diagonal().min())
    y = np.zeros(U.shape[1])
    active = g0 <= 0 if U.shape[1] == 0 else np.ones(len(g0), dtype=bool)
    if U.shape[1] == 0:
        return active
    for _ in range(30):
        A = U[active]
        y = np.linalg.lstsq(
            (A.T * k[active]) @ A, -load - (A.T * k[active]) @ g0[active], rcond=1e-12
        )[0]
        new = g0 + U @ y < 0
        if not new.any() or np.array_equal(new, active):
            break
        active = new
    return active if active.any() else np.ones(len(g0), dtype=bool)


def _solve_active(
    C: np.ndarray,
    g0: np.ndarray,
    U: np.ndarray,
    load: np.ndarray,
    active: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Forces and rigid part with zero gap on the active nodes, zero force elsewhere, and U^T f =
    load.
    """
    f = np.zeros(len(g0))
    A = np.flatnonzero(active)
    if len(A) == 0:
        return f, np.zeros(U.shape[1])
    factor = cho_factor(C[np.ix_(A, A)], lower=True, overwrite_a=True, check_finite=False)
    X = cho_solve(factor, np.column_stack([-g0[A], U[A]]), check_finite=False)
    y = np.zeros(U.shape[1])
    if U.shape[1]:
        y = np.linalg.lstsq(U[A].T @ X[:, 1:], U[A].T @ X[:, 0] - load, rcond=1e-13)[0]
    f[A] = X[:, 0] - X[:, 1:] @ y
    return f, y


def _primal_dual(
    C: np.ndarray,
    g0: np.ndarray,
    U: np.ndarray,
    load: np.ndarray,
    active: np.ndarray,
    max_iterations: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, bool]:
    """Semismooth Newton: drop pulling nodes, add penetrating ones, until the set repeats."""
    seen = set()
    for its in range(1, max_iterations + 1):
        f, y = _solve_active(C, g0, U, load, active)
        gap = g0 + C @ f + U @ y
        keep = active & (f > -ROUND_OFF * np.abs(f).max(initial=0.0))
        new = keep | (~active & (gap < -ROUND_OFF * max(np.abs(gap).max(), np.abs(gap - g0).max())))
        balanced = np.abs(U.T @ f - load).max(initial=0.0) <= UNBALANCED_LOAD_SHARE * (
            np.abs(load).max(initial=0.0) + 1e-300
        )
        if np.array_equal(new, active) and balanced:
            return f.clip(min=0.0), y, active, its, True
        if new.tobytes() in seen or (U.shape[1] and not new.any()):
            break
        seen.add(new.tobytes())
        active = new
    return f, y, active, its, False


def _primal_active_set(
    C: np.ndarray,
    g0: np.ndarray,
    U: np.ndarray,
    load: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int, bool]:
    """Primal active set in the manner of Lawson and Hanson: slower, but every step lowers the
    energy.
    """
    n = len(g0)
    f = nnls(U.T, load)[0] if U.shape[1] else np.zeros(n)
    active = f > 0
    for its in range(1, 5 * n + 10):
        target, y = _solve_active(C, g0, U, load, active)
        falling = active & (target < -ROUND_OFF * np.abs(target).max(initial=0.0))
        if falling.any():
            step = f[falling] / np.maximum(f[falling] - target[falling], 1e-300)
            f = f + min(float(step.min()), 1.0) * (target - f)
            stop = np.flatnonzero(falling)[step <= step.min() * (1 + 1e-12)]
            f[stop] = 0.0
            active = active.copy()
            active[stop] = False
            continue
        f = target.clip(min=0.0)
        gap = np.where(active, 0.0, g0 + C @ f + U @ y)
        worst = int(np.argmin(gap))
        if gap[worst] >= -ROUND_OFF * max(np.abs(gap).max(), np.abs(C @ f).max()):
            return f, y, active, its, True
        active = active.copy()
        active[worst] = True
    return f, y, active, its, False

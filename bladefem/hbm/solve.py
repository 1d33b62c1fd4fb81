"""Solve one point, a list of points or a band of frequencies; and the two linear limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..friction.states import NODE_STATES
from .full_stick import INSTANTS_PER_HARMONIC, leading_stuck_points, sticks_safely
from .linear.condensation import Linear, condense, own_flexibility
from .model import ReducedModel
from .point_measures import MEASURES, count_states, measure_point
from .solution import Solution, Work, probe_motion
from .solver.fallback import (
    NEWTON_MERITS,
    Attempt,
    lowers_step_first,
    match_harmonics,
    solve_balance,
)
from .solver.newton import DEFAULT_OPTIONS, Options, newton
from .solver.point_compiled import compiles_points, solve_each, solve_small
from .solver.residual import Balance
from .solver.walking import drift_speed
from .validate_model import check_point

# contact springs over the bodies' stiffness from which a failure is put down to it
STIFF_CONTACT_RATIO = 1e5
LINEAR_POINT = Options(iterations=1, fallbacks=False)


def solve(
    model: ReducedModel,
    omega: float,
    H: int = 3,
    samples: int = 128,
    *,
    start: Solution | None = None,
    options: Options = DEFAULT_OPTIONS,
    from_stick: bool = True,
) -> Solution:
    """The periodic response at circular frequency omega [rad/s] with harmonics 0..H.

    Args:
        samples: time samples a period for the friction forces; 0 locates the transitions of 1-D
            elements exactly.
        start: a solved neighbour; full stick when left out.
        from_stick: also without fallbacks full stick is tried where the neighbour does not lead to
            the point.

    Returns:
        a Solution whose `converged` and `reason` must be read; it is never a silent guess.

    Raises:
        InputError: the frequency, H or samples are out of range, or the start belongs to another
            model.
        NotSolvedError: a resonance without damping is hit exactly.
    """
    check_point(model, omega, H, samples)
    if start is not None and (
        not isinstance(start, Solution) or start.w.shape[:2] != model.springs.shape
    ):
        raise InputError("start: expected a Solution of a model with the same contact nodes")
    lean = _stuck_throughout(model, omega, H, start) if options.frugal else None
    if lean is not None:
        return lean
    near = None if start is None else start.w
    first = solve_small(model, omega, H, samples, near, options, from_stick)
    if first is not None:
        return first
    balance = Balance(model, condense(model, omega, H), samples)
    attempts = solve_balance(
        balance, None if start is None else match_harmonics(start.w, H), options, from_stick
    )
    best = min(attempts, key=lambda a: (not a.end.converged, a.end.state.error))
    reason = best.end.reason if best.end.converged else _failure_reasons(balance, attempts)
    samples = best.samples or best.end.samples or samples
    balance = replace(balance, samples=samples, walk=best.end.walk)
    return as_solution(balance, best, sum(a.end.iterations for a in attempts), reason)


def solve_near(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: Solution,
    options: Options = DEFAULT_OPTIONS,
) -> Solution:
    """The point by Newton from a solved neighbour alone; nothing else is tried where that fails."""
    balance = Balance(model, condense(model, omega, H), samples)
    merit = NEWTON_MERITS[0][1] if lowers_step_first(balance) else NEWTON_MERITS[1][1]
    end = newton(balance, match_harmonics(start.w, H), options, merit)
    method = next(name for name, lowered in NEWTON_MERITS if lowered == merit)
    return as_solution(balance, Attempt(method, end), end.iterations, end.reason)


def free_response(
    model: ReducedModel,
    omega: float,
    H: int = 1,
) -> np.ndarray:
    """(H+1, probes) amplitudes at the probes without contact forces [m]."""
    linear = condense(model, omega, H)
    return probe_motion(model, omega, np.zeros_like(linear.free), np.zeros(len(linear.rigid)))


def stuck_response(
    model: ReducedModel,
    omega: float,
    H: int = 1,
) -> np.ndarray:
    """(H+1, probes) amplitudes at the probes with all contacts closed and sticking [m]."""
    linear = condense(model, omega, H)
    force = linear.springs * linear.stuck
    return probe_motion(model, omega, force, _rigid_motion(linear, linear.stuck[0], force[0]))


def as_solution(
    balance: Balance,
    attempt: Attempt,
    iterations: int,
    reason: str,
) -> Solution:
    """The record of a finished attempt."""
    model = balance.model
    linear = balance.linear
    state = attempt.end.state
    flat = (linear.springs.size, state.w.shape[2])
    f = np.empty(state.w.shape)
    probe = np.empty(linear.bodies.straight.shape, dtype=complex)
    measures = np.empty(MEASURES)
    measure_point(
        linear.omega,
        linear.bodies,
        linear.springs,
        (linear.modal, linear.free),
        np.ascontiguousarray(state.w, dtype=float).reshape(flat),
        model.directions - model.elements.tangents,
        np.ascontiguousarray(state.forces.f),
        model.preload,
        state.residual.reshape(flat),
        f,
        probe,
        measures,
    )
    residual, residual_force, _, fed, lost, friction, _ = measures.tolist()
    # what a law loses in a walk is more than its harmonics tell
    dissipated = float(np.sum(state.forces.dissipated))
    counts = count_states(state.forces.shares).tolist()
    return Solution(
        omega=linear.omega,
        harmonics=state.w.shape[2] // 2,
        samples=balance.samples,
        w=state.w,
        f=f,
        probe=probe,
        converged=attempt.end.converged,
        reason=reason,
        method=attempt.method,
        iterations=iterations,
        residual=state.error,
        residual_displacement=residual,
        residual_force=residual_force,
        drift=drift_speed(balance, state.w),
        states=dict(zip(NODE_STATES, counts, strict=True)),
        work=Work(fed, lost, friction, dissipated),
        route=attempt.end.route,
        walk=balance.walk,
    )


def leading_stuck_solutions(
    model: ReducedModel,
    omegas: Sequence[float],
    H: int,
) -> list[Solution]:
    """The first frequencies [rad/s], as long as all contacts stick, with the excited harmonics
    alone; small models.

    A point is accepted with a little of the friction limit in hand, and with the tolerance of
    rounding: it is linear.
    """
    low = max((1, *model.excitation, *model.normal))
    found = (
        solve_each(model, np.array(omegas), low, INSTANTS_PER_HARMONIC * low, LINEAR_POINT)
        if low < H
        else []
    )
    return leading_stuck_points(model, found)


def _stuck_throughout(
    model: ReducedModel,
    omega: float,
    H: int,
    start: Solution | None,
) -> Solution | None:
    """The linear solution at one frequency if all contacts stick, else None; looked for only where
    the start sticks."""
    low = max((1, *model.excitation, *model.normal))
    if low >= H or not (start is None or start.states["stick"] == len(model.elements.kt)):
        return None
    if compiles_points(model, low):
        return next(iter(leading_stuck_solutions(model, [omega], H)), None)
    found = solve(model, omega, low, INSTANTS_PER_HARMONIC * low, options=LINEAR_POINT)
    return found if found.converged and sticks_safely(model, found) else None


def _failure_reasons(balance: Balance, attempts: list[Attempt]) -> str:
    """Why every attempt failed, and what may help."""
    linear = balance.linear
    ratio = float(np.median(linear.springs * abs(own_flexibility(linear))))
    stiff = (
        [
            f"contacts {ratio:.1g} times as stiff as the bodies: expected less than "
            f"{STIFF_CONTACT_RATIO:.0e} where they slip or lift off"
        ]
        if ratio > STIFF_CONTACT_RATIO
        else []
    )
    return "; ".join([f"{a.method}: {a.end.reason}" for a in attempts] + stiff)


def _rigid_motion(
    linear: Linear,
    mean: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:
    """(r,) motions without stiffness that close  w_0 = free_0 - G_0 f_0 + B q."""
    if linear.B.shape[1] == 0:
        return np.zeros(len(linear.rigid))
    gap = mean - linear.free[0] + linear.bodies.mean_G @ force
    return linear.rigid @ (linear.B.T @ (linear.springs * gap.real))

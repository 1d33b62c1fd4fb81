"""Newton with a line search on the balance; it always says why it stopped."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from numbers import Integral

import numpy as np

from ...errors import InputError
from ...friction.aft import Forces, dissipated_energy
from ...util.newton import NewtonRun, Outcome, halve_step, iterate_newton, outcome_reason
from ..policy import (
    COMPILED_NEWTON,
    DENSE_LU,
    ITERATIONS,
    NUMPY_NEWTON,
    uses_compiled_newton,
)
from .balance_2d import search_residual
from .newton_compiled import (
    BY_ITERATIONS,
    BY_LU,
    RESIDUAL_DECREASE,
    STEP_DECREASE,
    compiled_newton,
)
from .newton_krylov import Memory
from .residual import (
    STICKING_FORCE_SHARE,
    Balance,
    Inverse,
    State,
    arguments_2d,
    contact_table,
    evaluate_balance,
    evaluates_2d,
    linearise_balance,
    state_of_evaluation,
)
from .walking import (
    held_balance,
    may_walk,
    sampled_walk,
    tangential_motions,
    walk_fault,
    walking_motions,
    without_step,
)

# of the largest displacement: starts that are no farther apart are the same
SAME_START = 1e-12
# step share below which the search direction is given up
SHORTEST_STEP_SHARE = 2.0**-8
# of rest and walks that are tried without fallbacks, and without springs on the mean, where the
# loop is not compiled: on the shipped wedge with four layers from 4000 N/mm^3 on and 80 N the third
# one led to none of some 100 points that the others did not lead to, those springs to 6 of them, in
# nearly half of the time of all others; a shorter step does as well
LIKELIEST_KINDS = 2


@dataclass(frozen=True)
class Options:
    """When a point is accepted and when it is given up.

    Raises:
        InputError: a value is out of range.
    """

    # residual of the balance over the size of the motion [1]
    tolerance: float = 1e-10
    # Newton steps of one attempt
    iterations: int = 60
    # whose height sweeps and peaks measure
    probe: int = 0
    # whether more is tried where Newton fails
    fallbacks: bool = True
    # whether harmonics that are not excited are left out where all contacts stick
    frugal: bool = False

    def __post_init__(self) -> None:
        if not 1e-14 <= self.tolerance <= 1e-2:
            raise InputError(f"tolerance {self.tolerance}: expected 1e-14 to 1e-2")
        if not isinstance(self.iterations, Integral) or self.iterations < 1:
            raise InputError(f"iterations {self.iterations}: expected a whole number, at least 1")


DEFAULT_OPTIONS = Options()


@dataclass(frozen=True)
class Newton:
    """Where Newton ended."""

    state: State
    iterations: int
    converged: bool
    reason: str
    # loop and linear solvers of `bladefem.hbm.policy` that ran
    route: str = ""
    # (m, z) motions along which the damper walks at the end, as `Balance` has them
    walk: np.ndarray | None = None
    # a period, where they differ from those asked for
    samples: int | None = None


def solvers_of(code: int) -> tuple[str, ...]:
    """Linear solvers by the code that `compiled_newton` returns."""
    return (ITERATIONS,) * bool(code & BY_ITERATIONS) + (DENSE_LU,) * bool(code & BY_LU)


def route_of(loop: str, solvers: Collection[str]) -> str:
    """The way that ran in words: the loop, then its linear solvers; none where every contact
    sticks.
    """
    return ", ".join(
        [loop, " then ".join(s for s in (ITERATIONS, DENSE_LU) if s in solvers)][
            : 1 + bool(solvers)
        ]
    )


def newton(
    balance: Balance,
    w: np.ndarray,
    options: Options = DEFAULT_OPTIONS,
    merit: str = "step",
    walks: bool = True,
) -> Newton:
    """Solve the balance from the displacements w (n, d, K).

    Args:
        walks: a free damper may walk; where its rest is compiled the walk is looked for by the
            residual whatever the merit, so that once is enough.
        merit: what the line search lowers: "step", the Newton step that the last derivative would
            take next, which does not depend on how the equations are scaled (Deuflhard, Newton
            Methods for Nonlinear Problems, 2004, Sect. 3.3), or "residual".
    """
    if balance.walk is None and may_walk(balance.model):
        return _newton_of_free_damper(balance, w, options, merit, walks)
    end = newton_as_given(balance, w, options, merit)
    fault = walk_fault(balance, end.state) if end.converged else ""
    return replace(end, converged=False, reason=fault) if fault else end


def _newton_of_free_damper(
    balance: Balance,
    w: np.ndarray,
    options: Options,
    merit: str,
    walks: bool,
) -> Newton:
    """Newton for a damper that walks or rests, whichever the solution asks for."""
    iterations = 0
    # rest comes first
    tried = None if walks or not runs_compiled(balance) else 1
    # what a search without fallbacks does not find soon it looks for from nearer by
    alone = not options.fallbacks and not runs_compiled(balance)
    ends = []
    for start in islice(_likely_starts(balance, w), LIKELIEST_KINDS if alone else tried):
        end = _newton_of_one_kind(start, options, merit)
        iterations += end.iterations
        if end.converged:
            return replace(end, iterations=iterations)
        ends.append(end)
    if alone:
        nearest = min(ends, key=lambda end: end.state.error)
        return replace(nearest, iterations=iterations)
    # springs on the mean lead to a start from which the rest is near
    led = newton_as_given(held_balance(balance), w, options, merit)
    iterations += led.iterations
    best = end
    if led.converged:
        for start in islice(_likely_starts(balance, led.state.w), tried):
            end = _newton_of_one_kind(start, options, merit)
            iterations += end.iterations
            if end.converged:
                return replace(end, iterations=iterations)
            best = min(best, end, key=lambda end: end.state.error)
    return replace(best, iterations=iterations)


@dataclass(frozen=True)
class _Start:
    """Where Newton begins on a balance at rest or walking."""

    balance: Balance
    # (n, d, K) [m]
    w: np.ndarray
    # the balance there, where it is known
    state: State | None = None


def _likely_starts(balance: Balance, w: np.ndarray) -> Iterator[_Start]:
    """The balance at rest and walking, with starts; the one that leaves less first, where both
    leave the same the one that the states of the contacts ask for. Rest comes first where its loop
    is compiled: it is found or refused in no time.

    The mean of w along a motion of the walk is either a position or a step a period.
    """
    compiled = runs_compiled(balance)
    if compiled:
        yield _Start(balance, w)
    rest = evaluate_balance(balance, w, "single")
    walking = sampled_walk(balance)
    motions = walking_motions(balance, rest.forces.shares)
    found: list[tuple[float, _Start]] = []
    if motions is not None:
        variant = replace(walking, walk=motions)
        found.append((rest.error, _Start(variant, without_step(variant, w))))
    every = replace(walking, walk=tangential_motions(balance.model))
    going = evaluate_balance(every, w, "single")
    motions = walking_motions(balance, going.forces.shares)
    if motions is not None and np.isfinite(going.error):
        all_walk = np.array_equal(motions, every.walking)
        variant = replace(walking, walk=motions)
        found.append((going.error, _Start(variant, w, going if all_walk else None)))
    if not compiled:
        found.append((rest.error, _Start(balance, w, rest)))
    used: list[_Start] = []
    for _, start in sorted(found, key=lambda part: part[0]):
        if not any(_same_run(start, earlier) for earlier in used):
            used.append(start)
            yield start


def _same_run(one: _Start, other: _Start) -> bool:
    """Newton would take the same steps again: a motion without a step a period to begin with."""
    motions = one.balance.walk
    others = other.balance.walk
    if motions is None or others is None or motions.shape != others.shape:
        return False
    same = np.allclose(one.w, other.w, rtol=0.0, atol=SAME_START * float(abs(one.w).max()))
    return bool(same and np.array_equal(motions, others))


def _newton_of_one_kind(start: _Start, options: Options, merit: str) -> Newton:
    """Newton with the walk of the balance, not converged where its end contradicts it.

    The residual is lowered where the damper walks and its rest is compiled: on 18 random models
    with rigid dampers that led to 112 of 160 walks, all within 15 steps, and lowering the step to
    none of 48, most of which took all their steps, 40 ms each.
    """
    balance = start.balance
    if balance.walk is not None and runs_compiled(replace(balance, walk=None)):
        merit = "residual"
    end = newton_as_given(balance, start.w, options, merit, start.state)
    end = replace(end, walk=balance.walk, samples=balance.samples)
    fault = walk_fault(balance, end.state) if end.converged else ""
    return replace(end, converged=False, reason=fault) if fault else end


def newton_as_given(
    balance: Balance,
    w: np.ndarray,
    options: Options = DEFAULT_OPTIONS,
    merit: str = "step",
    first: State | None = None,
) -> Newton:
    """`newton` for a balance as it is: whether the damper walks is taken from it; `first` is its
    state at w, where it is known.
    """
    if merit == "step" and runs_compiled(balance):
        return _run_compiled(balance, w, options)
    memory = Memory()
    if first is None:
        first = evaluate_balance(balance, w, "single")
    run = _newton_loop(balance, first, options, merit, memory)
    route = route_of(NUMPY_NEWTON, memory.solvers)
    return Newton(run.state, run.iterations, run.converged, run.reason, route)


def _newton_loop(
    balance: Balance,
    first: State,
    options: Options,
    merit: str,
    memory: Memory,
) -> NewtonRun[State]:
    """Newton from a first state with NumPy; memory takes what the linear solvers know."""

    def advance(state: State) -> State | None:
        return _line_search(balance, state, linearise_balance(balance, state, memory), merit)

    return iterate_newton(
        first,
        lambda state: state.error,
        advance,
        options.tolerance,
        options.iterations,
    )


def runs_compiled(balance: Balance) -> bool:
    """True if Newton's loop is compiled for this balance."""
    harmonics, m = balance.linear.stuck.shape
    return balance.walk is None and uses_compiled_newton(balance.model, m * (2 * harmonics - 1))


def _run_compiled(
    balance: Balance,
    w: np.ndarray,
    options: Options,
) -> Newton:
    end = np.ascontiguousarray(w.reshape(-1, w.shape[2]), dtype=float).copy()
    d = balance.model.directions
    shape = w.shape
    contact = contact_table(balance.model, shape[2] // 2, balance.samples)
    steps, code, error, room, solver = compiled_newton(
        end,
        d,
        balance.linear.condensed,
        contact,
        None,
        STICKING_FORCE_SHARE,
        options.tolerance,
        options.iterations,
        SHORTEST_STEP_SHARE,
    )
    outcome = Outcome(code)
    reason = outcome_reason(outcome, error, steps)
    route = route_of(COMPILED_NEWTON, solvers_of(solver))
    if outcome is not Outcome.CONVERGED:
        state = evaluate_balance(balance, end.reshape(shape))
        return Newton(state, steps, False, reason, route)
    full = np.zeros_like(room.F)
    full[:, 2 - d :] = end.reshape(shape)
    forces = Forces(
        room.F[:, 2 - d :],
        room.J[:, 2 - d :, :, 2 - d :],
        room.shares,
        dissipated_energy(room.F, full),
        np.full(len(full), 2),
        True,
        "periodic",
    )
    state = State(
        end.reshape(shape), forces, room.p.reshape(shape), room.residual.reshape(shape), error
    )
    return Newton(state, steps, True, reason, route)


def _line_search(
    balance: Balance,
    state: State,
    inverse: Inverse,
    merit: str,
) -> State | None:
    """The first halving of the step that lowers the merit, or None."""
    step = inverse(state.residual, min(max(0.1 * state.error, 1e-5), 1e-2))
    if not np.isfinite(step).all():
        return None
    if merit == "residual" and evaluates_2d(balance):
        return _search_residual_2d(balance, state, step)
    demand = STEP_DECREASE if merit == "step" else RESIDUAL_DECREASE
    before = np.linalg.norm(step if merit == "step" else state.residual)

    def lowers_merit(trial: State, share: float) -> bool:
        after = inverse(trial.residual, 0.1) if merit == "step" else trial.residual
        return bool(np.linalg.norm(after) <= (1 - demand * share) * before)

    return halve_step(
        lambda share: evaluate_balance(balance, state.w - share * step, "single"),
        lowers_merit,
        SHORTEST_STEP_SHARE,
    )


def _search_residual_2d(balance: Balance, state: State, step: np.ndarray) -> State | None:
    """The first halving of the step that lowers the residual of 2-D elements, or None."""
    flat = (-1, state.w.shape[2])
    found, last = search_residual(
        np.ascontiguousarray(state.w, dtype=float).reshape(flat),
        np.ascontiguousarray(step).reshape(flat),
        float(np.linalg.norm(state.residual)),
        RESIDUAL_DECREASE,
        SHORTEST_STEP_SHARE,
        *arguments_2d(balance),
    )
    return state_of_evaluation(balance, last) if found else None

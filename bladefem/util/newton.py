"""Newton's method for any residual: the loop, the halving of steps, and why it ended.

What differs from problem to problem is how a state is made, measured and advanced by one step;
these are functions of the caller. Every end has an outcome and a sentence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Generic, TypeVar

import numpy as np

State = TypeVar("State")


class Outcome(IntEnum):
    """Why a Newton run ended; compiled loops return the same numbers."""

    CONVERGED = 0
    # iterations exhausted
    EXHAUSTED = 1
    # no share of the step lowers the residual: the step became too small
    STALLED = 2
    # singular Jacobian, or linear solver not converged
    SINGULAR = 3
    # the residual is infinite or not a number
    NOT_FINITE = 4


class StepError(Exception):
    """A step that could not be taken, with the outcome of the run and the reason."""

    def __init__(self, outcome: Outcome, reason: str) -> None:
        super().__init__(reason)
        self.outcome = outcome


@dataclass(frozen=True)
class NewtonRun(Generic[State]):
    """Where a Newton run ended."""

    # the converged one, or the last
    state: State
    # of the state, in the measure of the caller
    error: float
    # steps tried
    iterations: int
    outcome: Outcome
    reason: str

    @property
    def converged(self) -> bool:
        return self.outcome is Outcome.CONVERGED


def outcome_reason(outcome: Outcome, error: float, iterations: int) -> str:
    """The outcome in a sentence, for the error that is left."""
    return {
        Outcome.CONVERGED: "residual within tolerance",
        Outcome.EXHAUSTED: f"residual {error:.1e} after {iterations} iterations",
        Outcome.STALLED: f"line search stalled at residual {error:.1e}",
        Outcome.SINGULAR: "singular Jacobian",
        Outcome.NOT_FINITE: "residual is not finite",
    }[outcome]


def iterate_newton(
    first: State,
    measure: Callable[[State], float],
    advance: Callable[[State], State | None],
    tolerance: float,
    iterations: int,
) -> NewtonRun[State]:
    """Newton's method from a first state.

    Args:
        measure: the error of a state; converged where it is at most the tolerance.
        advance: the state after one step, damped or not; None where the line search stalls.
            `StepError` and `numpy.linalg.LinAlgError` end the run with their reason.
        iterations: the largest number of steps.
    """
    state = first
    for iteration in range(iterations + 1):
        error = measure(state)
        if error <= tolerance:
            return _end_run(state, error, iteration, Outcome.CONVERGED)
        if not np.isfinite(error):
            return _end_run(state, error, iteration, Outcome.NOT_FINITE)
        if iteration == iterations:
            break
        try:
            better = advance(state)
        except StepError as failure:
            return NewtonRun(state, error, iteration + 1, failure.outcome, str(failure))
        except np.linalg.LinAlgError as failure:
            return NewtonRun(state, error, iteration + 1, Outcome.SINGULAR, str(failure))
        if better is None:
            return _end_run(state, error, iteration + 1, Outcome.STALLED)
        state = better
    return _end_run(state, error, iterations, Outcome.EXHAUSTED)


def halve_step(
    take: Callable[[float], State],
    accepts: Callable[[State, float], bool],
    shortest: float,
) -> State | None:
    """The state after the first halving of a step that is accepted, None below the shortest share.

    Args:
        take: the state after a share of the step.
        accepts: whether this state, reached by this share, is good enough.
    """
    share = 1.0
    while share >= shortest:
        trial = take(share)
        if accepts(trial, share):
            return trial
        share /= 2
    return None


def _end_run(
    state: State,
    error: float,
    iterations: int,
    outcome: Outcome,
) -> NewtonRun[State]:
    return NewtonRun(state, error, iterations, outcome, outcome_reason(outcome, error, iterations))

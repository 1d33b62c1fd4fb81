"""Follow solutions in any parameter, round folds: the public side of
`bladefem.hbm.solver.arclength`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, NotSolvedError
from .linear.condensation import condense
from .model import ReducedModel
from .parameters import check_parameter, inner, outer, vary
from .solution import Solution
from .solve import as_solution, solve
from .solver.arclength import Spot, Task, advance, spot_at
from .solver.fallback import Attempt
from .solver.newton import DEFAULTS, Newton, Options
from .solver.residual import Balance, State, evaluate_balance

__all__ = ["PathPoint", "follow"]

# points of a path
LIMIT = 5000


@dataclass(frozen=True)
class PathPoint:
    """A point of a path."""

    # of the parameter: "omega" [rad/s], "gap" [m], else the factor on the model
    value: float
    solution: Solution
    # the parameter rises along the path here
    forward: bool
    # the parameter turned back between the point before and this one
    fold: bool
    # a small gap of the path lies before this point
    leapt: bool = False
    # another path crosses between the point before and this one
    branch: bool = False


def follow(
    model: ReducedModel,
    name: str,
    start: Solution,
    bounds: tuple[float, float],
    *,
    forward: bool = True,
    steps: tuple[float, float] = (0.02, 0.1),
    options: Options = DEFAULTS,
) -> Iterator[PathPoint]:
    """The path from a converged solution, with its harmonics and samples, until the parameter
    leaves its bounds.

    Args:
        name: "omega", or a parameter of `bladefem.hbm.parameters`; the start belongs to its factor
            1, or gap 0.
        bounds: smallest and largest value; `start` lies between.
        steps: first and longest arc-length step, as shares of the range.

    Raises:
        InputError: unknown parameter, or a start outside the bounds.
        NotSolvedError: the path could not be followed further; the message says why.
    """
    task, x, state = _prepare(model, name, start, bounds, options)
    low, high = (inner(name, bound) for bound in bounds)
    spot = spot_at(task, x, task.balance(x), state, 0, 1.0 if forward else -1.0)
    yield _point(task, spot)
    step, longest = steps
    for _ in range(LIMIT):
        before = spot
        spot, step, fold = advance(task, spot, step, longest)
        yield _point(task, spot, fold, spot.branches(before))
        if not low <= spot.x <= high:
            return
    raise NotSolvedError(
        f"path in {name} stopped at {outer(name, spot.x):.6g} after {LIMIT} points"
    )


def _prepare(
    model: ReducedModel, name: str, start: Solution, bounds: tuple[float, float], options: Options
) -> tuple[Task, float, State]:
    check_parameter(name, also=("omega",))
    value = {"omega": start.omega, "gap": 0.0}.get(name, 1.0)
    if (
        not bounds[0] <= value <= bounds[1]
        or bounds[0] >= bounds[1]
        or (name != "gap" and bounds[0] <= 0)
    ):
        raise InputError(
            f"bounds {bounds}: expected a range of {name} with the start {value:.6g} inside"
        )
    near = solve(model, start.omega, start.harmonics, start.samples, start=start, options=options)
    if not near.converged:
        raise NotSolvedError(f"path in {name}: the start is not solved, {near.reason}")

    def balance(x: float) -> Balance:
        changed = model if name == "omega" else vary(model, name, outer(name, x))
        return Balance(
            changed,
            condense(changed, x if name == "omega" else start.omega, near.harmonics),
            near.samples,
        )

    width = inner(name, bounds[1]) - inner(name, bounds[0])
    x = inner(name, value)
    task = Task(balance, name, width, float(np.linalg.norm(near.w)) or 1.0, options)
    return task, x, evaluate_balance(balance(x), near.w)


def _point(task: Task, spot: Spot, fold: bool = False, branch: bool = False) -> PathPoint:
    end = Newton(spot.state, spot.iterations, True, "residual within tolerance")
    solution = as_solution(
        spot.balance, Attempt("path following", end), spot.iterations, end.reason
    )
    return PathPoint(outer(task.name, spot.x), solution, spot.sign > 0, fold, spot.leapt, branch)

"""Follow solutions in any parameter, round folds: the public side of
`bladefem.hbm.solver.arclength`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError, NotSolvedError
from .linear.condensation import condense
from .model import ReducedModel
from .parameters import check_parameter, parameter_value, path_coordinate, vary
from .solution import Solution
from .solve import as_solution, solve
from .solver.arclength import (
    SMALLEST_ARC_STEP,
    Spot,
    Task,
    advance_path,
    path_distance,
    spot_at,
)
from .solver.fallback import Attempt, solve_balance
from .solver.newton import DEFAULT_OPTIONS, Newton, Options
from .solver.path_compiled import PATH_FOLLOWING, compiled_path
from .solver.residual import Balance, State, evaluate_balance

# points of a path
MOST_PATH_POINTS = 5000
# shares of the range beyond a point where the path stops, at which it is begun again
RESTART_DISTANCES = (1e-3, 3e-3, 0.01, 0.03)
# times that a path is begun again
MOST_RESTARTS = 4
# points in which a path has to get farther than that many of its smallest steps: at a jump of
# sampled friction it would otherwise go to and fro until its points are spent
CREEPING_POINTS = 12


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
    # why the path was begun again here, on the motion found next to where it stopped; it may be
    # another branch. "" elsewhere
    restarted: str = ""


def follow(
    model: ReducedModel,
    name: str,
    start: Solution,
    bounds: tuple[float, float],
    *,
    forward: bool = True,
    steps: tuple[float, float] = (0.02, 0.1),
    options: Options = DEFAULT_OPTIONS,
    crossings: bool = True,
) -> Iterator[PathPoint]:
    """The path from a converged solution, with its harmonics and samples, until the parameter
    leaves its bounds.

    Where the corrector fails, steps are halved, then leaps over a small gap and directions beyond
    a corner are tried; where all of these fail the path is begun again a little further on, and
    the point says so.

    Args:
        name: "omega", or a parameter of `bladefem.hbm.parameters`; the start belongs to its factor
            1, or gap 0.
        bounds: smallest and largest value; `start` lies between.
        steps: first and longest arc-length step, as shares of the range.
        crossings: other paths that cross this one are looked for, which takes a tenth of the time.

    Raises:
        InputError: unknown parameter, or a start outside the bounds.
        NotSolvedError: the path could not be followed further; the message says why.
    """
    task, x, balance, state = _prepare_path(model, name, start, bounds, options)
    task = replace(task, crossings=crossings)
    low, high = (path_coordinate(name, bound) for bound in bounds)
    spot = spot_at(task, x, balance, state, 0, 1.0 if forward else -1.0)
    yield _path_point(task, spot)
    step, longest = steps
    restarts = 0
    recent = deque([spot], maxlen=CREEPING_POINTS)
    for _ in range(MOST_PATH_POINTS):
        before = spot
        try:
            _refuse_creeping(task, recent)
            spot, step, fold = advance_path(task, spot, step, longest)
            recent.append(spot)
        except NotSolvedError as error:
            # the direction in which the path came, should it have gone to and fro
            spot = replace(spot, sign=recent[0].sign)
            restarts += 1
            begun = _begun_again(task, spot, (low, high)) if restarts <= MOST_RESTARTS else None
            if begun is None:
                raise
            spot, step = begun, steps[0]
            recent = deque([spot], maxlen=CREEPING_POINTS)
            yield replace(_path_point(task, spot), restarted=str(error))
            continue
        yield _path_point(task, spot, fold, spot.branches(before))
        if not low <= spot.x <= high:
            return
    end = f"{parameter_value(name, spot.x):.6g}"
    raise NotSolvedError(f"path in {name} stopped at {end} after {MOST_PATH_POINTS} points")


def _refuse_creeping(task: Task, recent: deque[Spot]) -> None:
    """Raises NotSolvedError where the last CREEPING_POINTS got no farther than as many of the
    smallest steps.
    """
    if len(recent) < CREEPING_POINTS:
        return
    first, last = recent[0], recent[-1]
    size = max(task.size, float(np.linalg.norm(last.w)))
    moved = path_distance(first.w, last.w) / size
    length = np.hypot(moved, (last.x - first.x) / task.width)
    if length < CREEPING_POINTS * SMALLEST_ARC_STEP:
        raise NotSolvedError(
            f"path in {task.name} does not advance beyond "
            f"{parameter_value(task.name, last.x):.6g}: it goes to and fro at a jump of the "
            "friction forces"
        )


def _begun_again(
    task: Task,
    spot: Spot,
    bounds: tuple[float, float],
) -> Spot | None:
    """A solution a little ahead in the parameter, by all fallbacks at the farthest; None where
    there is none.
    """
    for share in RESTART_DISTANCES:
        x = spot.x + spot.sign * share * task.width
        if not bounds[0] <= x <= bounds[1]:
            return None
        balance = task.balance(x)
        fallbacks = task.options.fallbacks and share == RESTART_DISTANCES[-1]
        options = replace(task.options, fallbacks=fallbacks)
        end = solve_balance(balance, spot.w, options)[-1].end
        if not end.converged:
            continue
        try:
            balance = replace(balance, walk=end.walk)
            return spot_at(task, x, balance, end.state, end.iterations, spot.sign)
        except np.linalg.LinAlgError:
            continue
    return None


def _prepare_path(
    model: ReducedModel,
    name: str,
    start: Solution,
    bounds: tuple[float, float],
    options: Options,
) -> tuple[Task, float, Balance, State]:
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
        changed = model if name == "omega" else vary(model, name, parameter_value(name, x))
        return Balance(
            changed,
            condense(changed, x if name == "omega" else start.omega, near.harmonics),
            near.samples,
        )

    width = path_coordinate(name, bounds[1]) - path_coordinate(name, bounds[0])
    x = path_coordinate(name, value)
    task = Task(
        balance,
        name,
        width,
        float(np.linalg.norm(near.w)) or 1.0,
        options,
        compiled=compiled_path(model, near.harmonics, near.samples) if name == "omega" else None,
    )
    first = replace(balance(x), walk=near.walk)
    return task, x, first, evaluate_balance(first, near.w)


def _path_point(
    task: Task,
    spot: Spot,
    fold: bool = False,
    branch: bool = False,
) -> PathPoint:
    value = parameter_value(task.name, spot.x)
    return PathPoint(value, _solution_at(spot), spot.sign > 0, fold, spot.leapt, branch)


def _solution_at(spot: Spot) -> Solution:
    """The record of a point of a path."""
    if isinstance(spot.found, Solution):
        return spot.found
    balance, state = spot.found
    end = Newton(state, spot.iterations, True, "residual within tolerance")
    return as_solution(balance, Attempt(PATH_FOLLOWING, end), spot.iterations, end.reason)

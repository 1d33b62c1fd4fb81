"""Follow solutions round folds: scaled pseudo-arc-length in any parameter.

The displacements are measured by their own size and the parameter by the width of its range, so that a step means the
same in metres and in rad/s. A corrected point that lies farther from its prediction than half a step, or whose tangent
turns too far, is refused and the step halved: the follower does not jump to another branch. At the limit of stick the
mean of a contact, and sampled 2-D friction, jump a little: such gaps are leapt when they are small, and marked. Exact
derivatives with the parameter come from `bladefem.hbm.rates`. (Keller 1977; Krack and Gross, Harmonic Balance for
Nonlinear Vibration Problems, 2019, Sect. 4.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError, NotSolvedError
from .api import as_solution, solve
from .fallback import Attempt
from .linear import condense
from .model import ReducedModel
from .newton import DEFAULTS, Newton, Options, newton
from .rates import rate
from .residual import Balance, State, evaluate_balance, linearise
from .solution import Solution
from .vary import check_parameter, vary

__all__ = ["PathPoint", "follow"]

LIMIT = 5000            # points of a path
CORRECTIONS = 12        # Newton steps of one corrector
SMALLEST = 1e-5         # arc-length step, as a share of the range, below which only a leap can help
LEAPS = (1e-4, 1e-3, 5e-3)      # shares of the range that are leapt
CLOSE = 0.05            # scaled distance up to which a leap has found the same branch
STRAIGHT = 0.7          # cosine between successive tangents below which a step is halved
GUARD = 0.5             # distance from prediction to solution, in steps, above which it is halved


@dataclass(frozen=True)
class PathPoint:
    """A point of a path."""

    value: float            # of the parameter: "omega" [rad/s], "gap" [m], else the factor on the model
    solution: Solution
    forward: bool           # the parameter rises along the path here
    fold: bool              # the parameter turned back between the point before and this one
    leapt: bool = False     # a small gap of the path lies before this point


@dataclass(frozen=True)
class _Task:
    """What does not change along a path. Inside, factors are followed by their logarithms."""

    model: ReducedModel
    name: str
    omega: float
    harmonics: int
    samples: int
    options: Options
    width: float            # of the range of the parameter: its scale
    size: float             # of the displacements at the start: their least scale [m]

    def balance(self, x: float) -> Balance:
        model = self.model if self.name == "omega" else vary(self.model, self.name, _value(self.name, x))
        omega = x if self.name == "omega" else self.omega
        return Balance(model, condense(model, omega, self.harmonics), self.samples)


@dataclass(frozen=True)
class _Spot:
    """A solved point and the direction of the path there."""

    x: float
    balance: Balance
    state: State
    iterations: int
    slope: np.ndarray       # (n, d, K) dw/dx
    sign: float             # of dx along the path
    leapt: bool = False

    def tangent(self, task: _Task, size: float) -> tuple[np.ndarray, float]:
        """Unit tangent in displacements over their size and the parameter over its width."""
        dw = self.slope * task.width / size
        length = self.sign / np.sqrt(np.sum(dw**2) + 1.0)
        return dw * length, float(length)


def follow(model: ReducedModel, name: str, start: Solution, bounds: tuple[float, float], *, forward: bool = True,
           steps: tuple[float, float] = (0.02, 0.1), options: Options = DEFAULTS) -> Iterator[PathPoint]:
    """The path from a converged solution, with its harmonics and samples, until the parameter leaves its bounds.

    Args:
        name: "omega", or a parameter of `bladefem.hbm.vary`; the start belongs to its factor 1, or gap 0.
        bounds: smallest and largest value; `start` lies between.
        steps: first and longest arc-length step, as shares of the range.

    Raises:
        InputError: unknown parameter, or a start outside the bounds.
        NotSolvedError: the path could not be followed further; the message says why.
    """
    task, x = _prepare(model, name, start, bounds, options)
    low, high = (_inner(name, bound) for bound in bounds)
    spot = _first(task, x, start, 1.0 if forward else -1.0)
    yield _point(task, spot, fold=False)
    step, longest = steps
    for _ in range(LIMIT):
        spot, step, fold = _advance(task, spot, step, longest)
        yield _point(task, spot, fold)
        if not low <= spot.x <= high:
            return
    raise NotSolvedError(f"path in {name} stopped at {_value(name, spot.x):.6g} after {LIMIT} points")


def _prepare(model: ReducedModel, name: str, start: Solution, bounds: tuple[float, float],
             options: Options) -> tuple[_Task, float]:
    check_parameter(name, also=("omega",))
    value = {"omega": start.omega, "gap": 0.0}.get(name, 1.0)
    if not bounds[0] <= value <= bounds[1] or bounds[0] >= bounds[1] or (name != "gap" and bounds[0] <= 0):
        raise InputError(f"bounds {bounds}: expected a range of {name} with the start {value:.6g} inside")
    H = start.harmonics
    solution = solve(model, start.omega, H, start.samples, start=start, options=options)
    if not solution.converged:
        raise NotSolvedError(f"path in {name}: the start is not solved, {solution.reason}")
    width = _inner(name, bounds[1]) - _inner(name, bounds[0])
    size = float(np.linalg.norm(solution.w)) or 1.0
    return _Task(model, name, start.omega, H, solution.samples, options, width, size), _inner(name, value)


def _first(task: _Task, x: float, start: Solution, sign: float) -> _Spot:
    near = solve(task.model, start.omega, task.harmonics, task.samples, start=start, options=task.options)
    balance = task.balance(x)
    return _spot(task, x, balance, evaluate_balance(balance, near.w), 0, sign)


def _advance(task: _Task, spot: _Spot, step: float, longest: float) -> tuple[_Spot, float, bool]:
    """The next point, the next step, and whether the parameter turned back in between."""
    reason = ""
    while step >= SMALLEST:
        found, reason = _correct(task, spot, step)
        if found is not None:
            easy = found.iterations <= 4
            return found, min(1.5 * step, longest) if easy else step, found.sign != spot.sign
        step /= 2
    for share in LEAPS:
        found = _leap(task, spot, share)
        if found is not None:
            return found, share, False
    raise NotSolvedError(f"path in {task.name} stopped at {_value(task.name, spot.x):.6g}: {reason}")


def _correct(task: _Task, spot: _Spot, step: float) -> tuple[_Spot | None, str]:
    """Newton back to the path on the plane across the tangent."""
    size = max(task.size, float(np.linalg.norm(spot.state.w)))
    dw, dx = spot.tangent(task, size)
    guess = spot.state.w + step * size * dw, spot.x + step * task.width * dx
    w, x = guess
    for iteration in range(CORRECTIONS + 1):
        balance = task.balance(x)
        state = evaluate_balance(balance, w)
        if state.error <= task.options.tolerance:
            break
        if iteration == CORRECTIONS or not np.isfinite(state.error):
            return None, f"corrector left a residual of {state.error:.1e}"
        try:
            inverse = linearise(balance, state)
            back, along = inverse(state.residual), inverse(rate(balance, state, task.name))
        except np.linalg.LinAlgError as error:
            return None, str(error)
        off = np.sum(dw * (w - guess[0])) / size + dx * (x - guess[1]) / task.width
        change = (np.sum(dw * back) / size - off) / (dx / task.width - np.sum(dw * along) / size)
        w, x = w - back - change * along, x + change
    if np.hypot(np.linalg.norm(w - guess[0]) / size, (x - guess[1]) / task.width) > GUARD * step:
        return None, "the corrector jumps"
    found = _spot(task, x, balance, state, iteration, spot.sign)
    new_dw, new_dx = found.tangent(task, size)
    turn = np.sum(dw * new_dw) + dx * new_dx
    if abs(turn) < STRAIGHT:
        return None, "the path turns too sharply"
    return (found if turn > 0 else replace(found, sign=-found.sign)), ""


def _leap(task: _Task, spot: _Spot, share: float) -> _Spot | None:
    """A solution across a small gap, if it lies where the path was heading."""
    x = spot.x + spot.sign * share * task.width
    balance = task.balance(x)
    end = newton(balance, spot.state.w, task.options)
    size = max(task.size, float(np.linalg.norm(spot.state.w)))
    if not end.converged or np.linalg.norm(end.state.w - spot.state.w) > CLOSE * size:
        return None
    return replace(_spot(task, x, balance, end.state, end.iterations, spot.sign), leapt=True)


def _spot(task: _Task, x: float, balance: Balance, state: State, iterations: int, sign: float) -> _Spot:
    return _Spot(x, balance, state, iterations, -linearise(balance, state)(rate(balance, state, task.name)), sign)


def _point(task: _Task, spot: _Spot, fold: bool) -> PathPoint:
    end = Newton(spot.state, spot.iterations, True, "residual within tolerance")
    solution = as_solution(spot.balance, Attempt("path following", end), spot.iterations, end.reason)
    return PathPoint(_value(task.name, spot.x), solution, spot.sign > 0, fold, spot.leapt)


def _inner(name: str, value: float) -> float:
    return value if name in ("omega", "gap") else float(np.log(value))


def _value(name: str, x: float) -> float:
    return x if name in ("omega", "gap") else float(np.exp(x))

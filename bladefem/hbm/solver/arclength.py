"""Pseudo-arc-length steps along solutions of the balance: round folds, never onto another branch.

The moving harmonics of the displacements are measured by their own size and the parameter by the
width of its range, so that a step means the same in metres and in rad/s. Mean displacements count
little: where few contacts stick they hold the damper's mean place alone, which moves by far more
than the vibration. A corrected point that lies farther from its
prediction than half a step, or whose tangent turns too far, is refused and the step halved: the
follower does not jump to another branch. At the limit of stick the mean of a contact, and sampled
2-D friction, jump a little: such gaps are leapt when they are small, and marked. Exact derivatives
with the parameter come from `bladefem.hbm.parameter_derivatives`. (Keller 1977; Krack and Gross,
Harmonic Balance for Nonlinear Vibration Problems, 2019, Sect. 4.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import NotSolvedError
from ...util.newton import iterate_newton
from ..parameter_derivatives import residual_rate
from ..parameters import parameter_value
from ..solution import Solution
from .newton import Options, newton
from .newton_krylov import Memory
from .path_compiled import CompiledPath, correct_step
from .residual import Balance, State, determinant_sign, evaluate_balance, linearise_balance
from .walking import walk_fault

# Newton steps of one corrector
MOST_CORRECTIONS = 12
# arc-length step, as a share of the range, below which only a leap can help
SMALLEST_ARC_STEP = 1e-5
# shares of the range that are leapt
LEAP_STEPS = (1e-4, 1e-3, 5e-3)
# scaled distance up to which a leap has found the same branch
LEAP_DISTANCE = 0.05
# arc lengths at which the direction beyond a corner is looked for
CORNER_ARC_LENGTHS = (1e-4, 1e-3, 5e-3)
# arc length up to which the path may turn more sharply than STRAIGHT: a corner, where contacts
# change their state
MAX_CORNER_ARC_LENGTH = 1e-3
# distance from the way back, in steps, from which a direction leads on
MIN_ONWARD_DISTANCE = 0.3
# reason of a step that is not taken
JUMPS = "the corrector jumps"
# cosine between successive tangents below which a step is halved
SMALLEST_COSINE = 0.7
# distance from prediction to solution, in steps, above which it is halved
JUMP_GUARD = 0.5
# Newton steps of a corrector up to which the next step grows, and by which factor
STEP_GROWTH = ((1, 3.0), (4, 1.5))
# weight of mean displacements in lengths and angles of a path
MEAN_WEIGHT = 0.01


@dataclass(frozen=True)
class Task:
    """What does not change along a path in x, the parameter `name` in the units of
    `bladefem.hbm.parameter_derivatives`.
    """

    balance: Callable[[float], Balance]
    name: str
    # of the range of x: its scale
    width: float
    # of the displacements at the start: their least scale [m]
    size: float
    options: Options
    memory: Memory = field(default_factory=Memory)
    # crossings of other paths are looked for, by the sign of a determinant at each point
    crossings: bool = True
    # a path in the frequency whose steps are compiled
    compiled: CompiledPath | None = None


@dataclass(frozen=True)
class Spot:
    """A solved point and the direction of the path there."""

    x: float
    # (n, d, K) displacements [m], and (m, z) motions along which the damper walks
    w: np.ndarray
    walk: np.ndarray | None
    # the equations and their state, or the whole record where the step was one compiled call
    found: tuple[Balance, State] | Solution
    iterations: int
    # (n, d, K) dw/dx
    slope: np.ndarray
    # of dx along the path
    sign: float
    # sign of the determinant of dr/dw; 0 where it is not known
    orientation: float
    leapt: bool = False

    def branches(self, before: Spot) -> bool:
        """Another path crosses this one since the spot before.

        The determinant of the balance bordered by the tangent has the sign of det dr/dw times that
        of dx: at a fold both change, at a crossing one of them (Keller 1977).
        """
        return (
            not self.leapt and self.orientation * self.sign * before.orientation * before.sign < 0
        )

    def tangent(
        self,
        task: Task,
        size: float,
    ) -> tuple[np.ndarray, float]:
        """Unit tangent in displacements over their size and the parameter over its width."""
        dw = self.slope * task.width / size
        length = self.sign / np.sqrt(_product(dw, dw) + 1.0)
        return dw * length, float(length)


def _product(one: np.ndarray, other: np.ndarray) -> float:
    """Scalar product of two displacements (n, d, K) by which lengths and angles are measured."""
    means = np.vdot(one[:, :, 0], other[:, :, 0])
    return float(np.vdot(one, other) - (1 - MEAN_WEIGHT) * means)


def path_distance(one: np.ndarray, other: np.ndarray) -> float:
    """Distance of two displacements (n, d, K) as lengths of a path measure it [m]."""
    change = other - one
    return float(np.sqrt(_product(change, change)))


def advance_path(
    task: Task,
    spot: Spot,
    step: float,
    longest: float,
) -> tuple[Spot, float, bool]:
    """The next point, the next step, and whether the parameter turned back in between.

    Raises:
        NotSolvedError: neither small steps, nor leaps, nor directions beyond a corner find the
            path.
    """
    reason = ""
    while step >= SMALLEST_ARC_STEP:
        found, reason = _correct_point(task, spot, step, _path_direction(task, spot))
        if found is not None:
            growth = next((g for most, g in STEP_GROWTH if found.iterations <= most), 1.0)
            return found, min(growth * step, longest), found.sign != spot.sign
        step /= 2
    for share in LEAP_STEPS:
        found = _leap_gap(task, spot, share)
        if found is not None:
            return found, share, False
    for share in CORNER_ARC_LENGTHS:
        found = _around_corner(task, spot, share)
        if found is not None:
            return found, share, found.sign != spot.sign
    value = parameter_value(task.name, spot.x)
    place = f"{task.name} = {value:.6g}"
    if task.name == "omega":
        place = f"{value / (2 * np.pi):.6g} Hz"
    raise NotSolvedError(f"the path stopped at {place}: {reason}")


# unit direction in displacements over their size, and in the parameter over its width
Direction = tuple[np.ndarray, float]


def _step_size(task: Task, spot: Spot) -> float:
    return max(task.size, float(np.linalg.norm(spot.w)))


def _path_direction(task: Task, spot: Spot) -> Direction:
    return spot.tangent(task, _step_size(task, spot))


def _correct_point(
    task: Task,
    spot: Spot,
    step: float,
    direction: Direction,
    corner: bool = False,
) -> tuple[Spot | None, str]:
    """Newton back to the path on the plane across a direction, a step ahead.

    Args:
        corner: the path may have turned by any angle but back.
    """
    size = _step_size(task, spot)
    dw, dx = direction
    guess = spot.x + step * task.width * dx, spot.w + step * size * dw
    found = _compiled_spot(task, spot, guess, direction, size)
    if found is None:
        found = _plain_spot(task, spot, guess, direction, size, JUMP_GUARD * step)
    if isinstance(found, str):
        return None, found if found == JUMPS else f"corrector: {found}"
    if _distance(task, guess, (found.x, found.w), size) > JUMP_GUARD * step:
        return None, JUMPS
    new_dw, new_dx = found.tangent(task, size)
    turn = _product(dw, new_dw) + dx * new_dx
    if abs(turn) < SMALLEST_COSINE and not corner and step > MAX_CORNER_ARC_LENGTH:
        return None, "the path turns too sharply"
    return (found if turn > 0 else replace(found, sign=-found.sign)), ""


def _distance(
    task: Task,
    guess: tuple[float, np.ndarray],
    end: tuple[float, np.ndarray],
    size: float,
) -> float:
    """Scaled distance between two points, each a parameter and displacements."""
    away = path_distance(guess[1], end[1]) / size
    return float(np.hypot(away, (end[0] - guess[0]) / task.width))


def _compiled_spot(
    task: Task,
    spot: Spot,
    guess: tuple[float, np.ndarray],
    direction: Direction,
    size: float,
) -> Spot | str | None:
    """Where one compiled call comes back to the path; why it does not; None where the plain way has
    to tell.
    """
    if task.compiled is None or spot.walk is not None:
        return None
    end = correct_step(
        task.compiled,
        guess,
        direction,
        (size, task.width),
        MEAN_WEIGHT,
        task.options.tolerance,
        MOST_CORRECTIONS,
        task.crossings,
    )
    if end is None or isinstance(end, str):
        return end
    point = end.point
    return Spot(
        point.omega,
        point.w,
        None,
        point,
        point.iterations,
        end.slope,
        spot.sign,
        end.orientation,
    )


def _plain_spot(
    task: Task,
    spot: Spot,
    guess: tuple[float, np.ndarray],
    direction: Direction,
    size: float,
    farthest: float,
) -> Spot | str:
    """Where Newton comes back to the path, or why it does not.

    Args:
        farthest: scaled distance from the guess.
    """
    begun, start = guess
    dw, dx = direction

    def advance(now: _Guess) -> _Guess:
        inverse = linearise_balance(now.balance, now.state, task.memory)
        back = inverse(now.state.residual)
        along = inverse(residual_rate(now.balance, now.state, task.name))
        w = now.state.w
        off = _product(dw, w - start) / size + dx * (now.x - begun) / task.width
        change = (_product(dw, back) / size - off) / (dx / task.width - _product(dw, along) / size)
        if not np.isfinite(change):
            raise np.linalg.LinAlgError("the step along the path is not finite")
        return _guess_at(task, now.x + change, w - back - change * along, spot.walk)

    run = iterate_newton(
        _guess_at(task, begun, start, spot.walk),
        lambda now: now.state.error,
        advance,
        task.options.tolerance,
        MOST_CORRECTIONS,
    )
    if not run.converged:
        return run.reason
    end = run.state
    if _distance(task, guess, (end.x, end.state.w), size) > farthest:
        return JUMPS
    fault = walk_fault(end.balance, end.state)
    if fault:
        return fault
    try:
        return spot_at(task, end.x, end.balance, end.state, run.iterations, spot.sign)
    except np.linalg.LinAlgError as error:
        return str(error)


@dataclass(frozen=True)
class _Guess:
    """A point on the way back to the path."""

    x: float
    balance: Balance
    state: State


def _guess_at(
    task: Task,
    x: float,
    w: np.ndarray,
    walk: np.ndarray | None,
) -> _Guess:
    balance = replace(task.balance(x), walk=walk)
    return _Guess(x, balance, evaluate_balance(balance, w))


def _around_corner(
    task: Task,
    spot: Spot,
    share: float,
) -> Spot | None:
    """A solution beyond a corner of the path, where contacts change their state at once.

    The direction there is that of the balance linearised a little ahead, on either side; it leads
    on where its solution lies off the way back.
    """
    size = _step_size(task, spot)
    dw, dx = _path_direction(task, spot)
    for ahead in (1.0, -1.0):
        x = spot.x + ahead * share * task.width * dx
        balance = replace(task.balance(x), walk=spot.walk)
        state = evaluate_balance(balance, spot.w + ahead * share * size * dw)
        try:
            inverse = linearise_balance(balance, state, task.memory)
            slope = -inverse(residual_rate(balance, state, task.name)) * task.width / size
        except np.linalg.LinAlgError:
            continue
        if not np.isfinite(slope).all():
            continue
        length = 1.0 / np.sqrt(_product(slope, slope) + 1.0)
        for sign in (1.0, -1.0):
            direction = sign * length * slope, float(sign * length)
            found, _ = _correct_point(task, spot, share, direction, corner=True)
            if found is None:
                continue
            off_w = (found.w - spot.w) / size + share * dw
            off_x = (found.x - spot.x) / task.width + share * dx
            if np.hypot(np.sqrt(_product(off_w, off_w)), off_x) > MIN_ONWARD_DISTANCE * share:
                return found
    return None


def _leap_gap(
    task: Task,
    spot: Spot,
    share: float,
) -> Spot | None:
    """A solution across a small gap, if it lies where the path was heading."""
    x = spot.x + spot.sign * share * task.width
    balance = task.balance(x)
    end = newton(balance, spot.w, task.options)
    size = max(task.size, float(np.linalg.norm(spot.w)))
    change = end.state.w - spot.w
    # the means of a damper that begins or ceases to walk do not compare
    if (end.walk is None) != (spot.walk is None):
        change = change[:, :, 1:]
    if not end.converged or np.linalg.norm(change) > LEAP_DISTANCE * size:
        return None
    balance = replace(balance, walk=end.walk)
    return replace(spot_at(task, x, balance, end.state, end.iterations, spot.sign), leapt=True)


def spot_at(
    task: Task,
    x: float,
    balance: Balance,
    state: State,
    iterations: int,
    sign: float,
) -> Spot:
    """A solved state with the direction of its path, x rising along it for sign 1 and falling for
    -1.
    """
    slope = -linearise_balance(balance, state, task.memory)(
        residual_rate(balance, state, task.name)
    )
    orientation = determinant_sign(balance, state) if task.crossings else 0.0
    return Spot(
        x,
        state.w,
        balance.walk,
        (balance, state),
        iterations,
        slope,
        sign,
        orientation,
    )

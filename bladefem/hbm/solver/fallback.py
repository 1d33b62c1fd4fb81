"""What is tried, in order, when Newton does not reach a point; every attempt leaves its reason.

1. Newton from the given start and from full stick, with two line searches: on the step and on the
   residual. Compiled loops, which small models of 1-D elements have, try both from each start, the
   step first. Other models try the residual from all starts, then the step; without fallbacks and
   with several starts, the residual only. Stiff layers that are split go start by start;
2. twice and four times the samples where Newton came close: sampled 2-D friction jumps a little at
   the limit of stick, and there may be no exact zero; the solution then says how many samples it
   has;
3. harmonics in sequence, 3, 7, 15, ... up to H, each started from the one before;
4. homotopy in the normal load, from a load under which everything sticks down to the true one;
5. the same by path following in the excitation, which goes round the folds that contacts with
lift-off have;
6. shooting in time, where the model has a form in time, and Newton from its harmonics;
7. the path in the excitation again with twice the samples, which coarse ones can interrupt at
lift-off.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from ...errors import InputError, NotSolvedError
from ..linear.condensation import scale_loads, truncate_harmonics
from ..parameters import vary
from ..time_model import shooting_start
from .arclength import Task, advance_path, spot_at
from .newton import Newton, Options, newton, runs_compiled
from .residual import Balance, evaluate_balance, start_in_stick

NEWTON_MERITS = (("newton", "step"), ("newton on the residual", "residual"))
# multiples of the normal load where a homotopy starts
FIRST_LOAD = 100.0
LARGEST_LOAD = 1e8
# residual from which more samples are tried
CLOSE_RESIDUAL = 1e-3
# points of a path in the excitation
LONGEST_PATH = 400
# logarithm of the smallest part of the excitation that its path may visit
FARTHEST_LOGARITHM = 30.0
# step in the logarithm of the load below which a homotopy gives up
SMALLEST_STEP = 1e-3


@dataclass(frozen=True)
class Attempt:
    """The end of one way to solve a point."""

    method: str
    end: Newton
    # where they differ from those asked for
    samples: int | None = None


def solve_balance(
    balance: Balance,
    start: np.ndarray | None,
    options: Options,
    from_stick: bool = True,
) -> list[Attempt]:
    """The attempts made, the last one converged unless every way failed.

    Args:
        from_stick: whether full stick is a start worth trying where one is given and no fallbacks
            are wanted.
    """
    attempts = []
    for attempt in _attempts_in_order(balance, start, options, from_stick):
        attempts.append(attempt)
        if attempt.end.converged:
            break
    return attempts


def match_harmonics(w: np.ndarray, H: int) -> np.ndarray:
    """Coefficients (n, d, *) cut or filled with zeros to 2H+1."""
    matched = np.zeros((*w.shape[:2], 2 * H + 1))
    kept = min(w.shape[2], 2 * H + 1)
    matched[:, :, :kept] = w[:, :, :kept]
    return matched


def _newton_attempts(
    balance: Balance,
    start: np.ndarray | None,
    options: Options,
    from_stick: bool = True,
) -> Iterator[Attempt]:
    """Newton from the given start and from full stick, with each merit function."""
    # Where the loop is not compiled the residual is cheaper, and on 3-D patches that lift off it
    # converges where the step stalls: half the time on a wedge of 96 nodes at 60 and 90 N. The step
    # solved 12 of 300 points after it under 18 and 36 N, and took a third of the time.
    starts = [w for w in (start, start_in_stick(balance)) if w is not None]
    compiled = runs_compiled(balance)
    step_first = lowers_step_first(balance)
    merits: Sequence[tuple[str, str]] = NEWTON_MERITS if step_first else NEWTON_MERITS[::-1]
    split = balance.model.series is not None
    if (split or not from_stick) and not options.fallbacks and start is not None:
        # of 69 points with stiff layers that the start did not lead to, full stick led to one, in
        # a quarter of the time of all, and where most contacts lift off it takes 0.15 s a point for
        # nothing; what one merit does not find is better sought beside it
        starts, merits = starts[:1], merits[:1]
    for w, (method, merit) in _runs_in_order(starts, merits, step_first, options.fallbacks):
        walks = merit == merits[0][1]
        yield Attempt(method, newton(balance, w, options, merit, walks or not compiled))


def lowers_step_first(balance: Balance) -> bool:
    """True if Newton lowers the step before the residual: where its loop is compiled, and with
    stiff layers that are split, whose residual is badly scaled. On the way from a softer layer to
    rigid faces (shipped wedge, 80 N) that takes 0.6 to 2.5 s, with the residual 1.0 to 3.8 s.
    """
    return runs_compiled(balance) or balance.model.series is not None


def _runs_in_order(
    starts: Sequence[np.ndarray],
    merits: Sequence[tuple[str, str]],
    by_start: bool,
    fallbacks: bool,
) -> Iterator[tuple[np.ndarray, tuple[str, str]]]:
    """Start, and method and merit, of each run of Newton alone; without fallbacks and not by start,
    the first merit only where there are several starts.
    """
    if by_start:
        return product(starts, merits)
    wanted = merits if fallbacks or len(starts) == 1 else merits[:1]
    return ((w, merit) for merit, w in product(wanted, starts))


def _attempts_in_order(
    balance: Balance,
    start: np.ndarray | None,
    options: Options,
    from_stick: bool,
) -> Iterator[Attempt]:
    """Every way to the solution, the cheapest first; each is tried when it is asked for."""
    plain = []
    for attempt in _newton_attempts(balance, start, options, from_stick):
        yield attempt
        plain.append(attempt.end)
    if not options.fallbacks:
        return
    near = min(plain, key=lambda end: end.state.error)
    for factor in (2, 4) if near.state.error < CLOSE_RESIDUAL else ():
        denser = replace(balance, samples=factor * balance.samples)
        yield Attempt("more samples", newton(denser, near.state.w, options), denser.samples)
    if len(balance.linear.stuck) > 4:
        yield Attempt("harmonics in sequence", _more_harmonics(balance, options))
    yield Attempt("load homotopy", _from_high_load(balance, options))
    path = _along_excitation(balance, options)
    yield Attempt("path in the excitation", path)
    yield Attempt("shooting", _from_shooting(balance, near, options))
    # it was interrupted, and did not get lost
    if balance.samples and path.iterations < LONGEST_PATH:
        denser = replace(balance, samples=2 * balance.samples)
        yield Attempt(
            "path in the excitation, more samples",
            _along_excitation(denser, options),
            denser.samples,
        )


def _more_harmonics(balance: Balance, options: Options) -> Newton:
    """Solve with 3, 7, 15, ... harmonics, each from the one before."""
    highest = len(balance.linear.stuck) - 1
    iterations = 0
    w = None
    sequence = [H for H in (3, 7, 15, 31, 63) if H < highest] + [highest]
    for H in sequence:
        less = replace(balance, linear=truncate_harmonics(balance.linear, H))
        end = newton(less, start_in_stick(less) if w is None else match_harmonics(w, H), options)
        if not end.converged and w is None:
            second = newton(less, start_in_stick(less), options, "residual")
            end = replace(second, iterations=end.iterations + second.iterations)
        iterations += end.iterations
        if not end.converged:
            return _failed_attempt(
                balance, end.state.w, iterations, f"with {H} harmonics: {end.reason}"
            )
        w = end.state.w
    return replace(end, iterations=iterations)


def _from_high_load(balance: Balance, options: Options) -> Newton:
    """Follow the solution from a multiple of the normal load where it sticks, or is easy, down to
    the load itself.
    """
    level = np.log(FIRST_LOAD)
    iterations = 0
    while True:
        end = newton(_with_normal_load(balance, level), start_in_stick(balance), options)
        iterations += end.iterations
        if end.converged:
            break
        level += np.log(100.0)
        if level > np.log(LARGEST_LOAD):
            return _failed_attempt(
                balance,
                end.state.w,
                iterations,
                f"no solution under {LARGEST_LOAD:.0e} times the load: {end.reason}",
            )
    path = [(level, end.state.w)]
    step = min(level, 1.0)
    while level > 0:
        target = max(level - step, 0.0)
        end = newton(
            _with_normal_load(balance, target),
            _extrapolated_start(path, target),
            replace(options, iterations=15),
        )
        iterations += end.iterations
        if end.converged:
            level = target
            path = [*path[-1:], (target, end.state.w)]
            step *= 2 if end.iterations <= 4 else 1
        else:
            step = (level - target) / 3
            if step < SMALLEST_STEP:
                return _failed_attempt(
                    balance,
                    end.state.w,
                    iterations,
                    f"stopped at {np.exp(level):.3g} times the load: {end.reason}",
                )
    return replace(end, iterations=iterations)


def _along_excitation(balance: Balance, options: Options) -> Newton:
    """Follow the solution round folds from a part of the excitation that is easily solved up to all
    of it.

    The friction law is homogeneous: this is the path in the normal load, seen from the other side.
    """

    def part(x: float) -> Balance:
        if not -FARTHEST_LOGARITHM <= x <= 1.0:
            raise NotSolvedError(
                f"the path left the excitations up to the wanted one, for exp({x:.3g}) times it"
            )
        model = vary(balance.model, "force", float(np.exp(x)))
        linear = scale_loads(balance.linear, float(np.exp(x)))
        return replace(balance, model=model, linear=linear)

    iterations = 0
    for factor in (0.7, 0.5, 0.25, 0.1, 0.01, 1e-4):
        x = float(np.log(factor))
        end = newton(part(x), start_in_stick(part(x)), options)
        iterations += end.iterations
        if end.converged:
            break
    else:
        return _failed_attempt(
            balance,
            end.state.w,
            iterations,
            f"no solution for any part of the excitation: {end.reason}",
        )
    task = Task(part, "force", -x, float(np.linalg.norm(end.state.w)), options)
    reached = end.state.w
    try:
        spot = spot_at(task, x, replace(part(x), walk=end.walk), end.state, 0, 1.0)
        step = 0.05
        for _ in range(LONGEST_PATH):
            spot, step, _ = advance_path(task, spot, step, 0.2)
            iterations = iterations + spot.iterations
            reached = spot.w
            if spot.x >= 0:
                end = newton(balance, spot.w, options)
                return replace(end, iterations=iterations + end.iterations)
    except (NotSolvedError, np.linalg.LinAlgError) as error:
        return _failed_attempt(balance, reached, iterations, str(error))
    return _failed_attempt(balance, reached, iterations, f"not there after {LONGEST_PATH} points")


def _from_shooting(
    balance: Balance,
    near: Newton,
    options: Options,
) -> Newton:
    """Newton from the harmonics of a periodic solution in time."""
    try:
        return newton(balance, shooting_start(balance), options)
    except (InputError, NotSolvedError) as error:
        return Newton(near.state, 0, False, str(error))


def _with_normal_load(balance: Balance, level: float) -> Balance:
    """The balance under exp(level) times the normal load; elements with an initial gap are pressed
    shut.
    """
    elements = balance.model.elements
    unit = np.where(elements.n0 > 0, elements.n0, abs(elements.n0).max())
    raised = replace(elements, n0=elements.n0 + np.expm1(level) * unit)
    return replace(balance, model=replace(balance.model, elements=raised))


def _extrapolated_start(path: list[tuple[float, np.ndarray]], target: float) -> np.ndarray:
    """The line through the last two points of the path, at the target."""
    if len(path) == 1:
        return path[0][1]
    (old, before), (new, now) = path
    return now + (target - new) / (new - old) * (now - before)


def _failed_attempt(
    balance: Balance,
    w: np.ndarray,
    iterations: int,
    reason: str,
) -> Newton:
    """An attempt that failed at displacements (n, d, *) as a state of the true balance."""
    w = match_harmonics(w, len(balance.linear.stuck) - 1)
    return Newton(evaluate_balance(balance, w), iterations, False, reason)

"""Which dampers of a wheel walk: those on which no contact sticks in the balance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..hbm.solver.newton import Options
from ..hbm.solver.walking import WALK_SAMPLES
from .first_motions import solve_held_means, tuned_motion
from .newton import WheelBalance, WheelNewton, full_newton, newton_wheel
from .solution import WheelSolution, fitted_displacements
from .walking import WheelWalk, slipping_dampers

# rounds in which it is found which dampers walk; a residual above this share of the largest marks
# those that are undecided, where they are no more than this
WALK_ROUNDS = 10
UNDECIDED_SHARE = 0.3
MOST_UNDECIDED = 2


def solve_walking(
    balance: WheelBalance,
    motions: np.ndarray,
    start: WheelSolution | None,
    options: Options,
) -> tuple[WheelBalance, WheelNewton, str] | None:
    """The solution in which exactly those dampers walk on which no contact sticks, and its balance,
    without fallbacks also where it did not converge; None where none does, or it is not found.
    """
    wheel = balance.wheel
    H = balance.stuck.shape[3] // 2
    if balance.samples == 0:
        balance = replace(balance, samples=WALK_SAMPLES * (H + 1))
    near = start is not None and start.converged and start.walk is not None
    if near and start is not None and start.walk is not None:
        w, walks = fitted_displacements(start.w, wheel, H), start.walk.dampers
    else:
        known = start is not None and start.converged
        first = (
            fitted_displacements(start.w, wheel, H)
            if known and start is not None
            else tuned_motion(wheel, balance.flex.omega, H, balance.samples)
        )
        held = solve_held_means(balance, options, first)
        if held is None:
            return None
        w, walks = held.state.w, slipping_dampers(held.state.forces.shares)
    if not walks.any():
        return None
    tried: list[WheelNewton] = []
    own = balance
    # first by full steps: a line search takes long where a damper should walk and does not
    attempts = [(full_newton, walks), (newton_wheel, walks)]
    if not walks.all():
        attempts.append((newton_wheel, np.ones_like(walks)))
    for attempt, first_walks in attempts:
        rounds = _walking_rounds(balance, motions, w, first_walks, options, attempt)
        if rounds is None:
            return None
        own, end = rounds
        tried.append(end)
        if end.converged:
            break
    if not tried[-1].converged and options.fallbacks:
        # dampers that slip throughout have no other balance: to look for one takes longest
        return None
    end = replace(
        tried[-1],
        iterations=sum(one.iterations for one in tried),
        products=sum(one.products for one in tried),
    )
    return own, end, "newton, walking"


def _walking_rounds(
    balance: WheelBalance,
    motions: np.ndarray,
    w: np.ndarray,
    walks: np.ndarray,
    options: Options,
    attempt: Callable[[WheelBalance, np.ndarray, Options], WheelNewton],
) -> tuple[WheelBalance, WheelNewton] | None:
    """The balance in which exactly those dampers walk on which no contact sticks, and where Newton
    ended in it, with the cost of all rounds; None where none walks in the end.

    Args:
        w: (N, n, d, K) displacements to begin with.
        walks: (N,) dampers that walk to begin with, some of them.
        attempt: Newton's method.
    """
    wheel = balance.wheel
    iterations = products = 0
    tried: list[np.ndarray] = []
    while True:
        tried.append(walks)
        walk = WheelWalk(motions, wheel.springs, wheel.elements.tangents, walks)
        own = replace(balance, walk=walk)
        end = attempt(own, w, options)
        iterations += end.iterations
        products += end.products
        end = replace(end, iterations=iterations, products=products)
        if end.converged:
            slips = slipping_dampers(end.state.forces.shares)
            if (slips == walks).all():
                return own, end
            # those that stick again begin where they are
            turned = walks & ~slips
            walks = slips
        else:
            turned = undecided_dampers(end.state.residual)
            walks = walks ^ turned
        if end.converged and not walks.any():
            return None
        known = not walks.any() or any((walks == one).all() for one in tried)
        if len(tried) == WALK_ROUNDS or known:
            why = "it is not decided which dampers walk" if end.converged else end.reason
            return own, replace(end, converged=False, reason=why)
        w = replace(walk, dampers=turned).without_steps(end.state.w)


def undecided_dampers(residual: np.ndarray) -> np.ndarray:
    """(N,) True where a residual (N, n, d, K) is left after Newton's method with given dampers that
    walk. One that rests and should walk, or walks and should rest, has no balance and keeps its
    residual alone, while all others are solved; none where more than a few have it.
    """
    sizes = np.linalg.norm(residual.reshape(len(residual), -1), axis=1)
    large = sizes > UNDECIDED_SHARE * sizes.max()
    few = np.isfinite(sizes).all() and np.count_nonzero(large) <= MOST_UNDECIDED
    return large if few else np.zeros(len(sizes), dtype=bool)

"""From a solved point towards another frequency: the start on the curve through the last points,
and small steps where that does not lead there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .model import ReducedModel
from .predictor import PREDICTOR_POINTS, extrapolate_solution
from .solution import Solution
from .solve import solve_near
from .solver.fallback import match_harmonics
from .solver.newton import DEFAULT_OPTIONS, Options

# Newton steps of one point of a walk from a neighbour: more are better spent on shorter steps
WALK_ITERATIONS = 20
# points tried on one walk, and its shortest step as a share of the way
MOST_WALK_POINTS = 48
SHORTEST_WALK_STEP = 0.002


def walk_in_frequency(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: Solution,
    options: Options = DEFAULT_OPTIONS,
    enough: float = 1.0,
) -> list[Solution]:
    """Converged points from a solved one towards a frequency, each by Newton from the curve
    through the last ones; the step is halved where that fails.

    The last point is at the frequency, unless a fold or a corner of the curve ended the walk, or
    enough of the way was gone.

    Args:
        enough: share of the way after which the walk ends.
    """
    brief = replace(options, iterations=min(options.iterations, WALK_ITERATIONS), fallbacks=False)
    way = [start]
    step = (omega - start.omega) / 2
    shortest = SHORTEST_WALK_STEP * abs(omega - start.omega)
    for _ in range(MOST_WALK_POINTS if step else 0):
        target = way[-1].omega + step
        if abs(omega - way[-1].omega) <= 1.5 * abs(step):
            target = omega
        guess = predicted_start(way[-PREDICTOR_POINTS:], target, H) or way[-1]
        point = solve_near(model, target, H, samples, guess, brief)
        if point.converged:
            way.append(point)
            step *= 1.0 if point.iterations > WALK_ITERATIONS / 2 else 2.0
        else:
            step = (target - way[-1].omega) / 4
        gone = abs(way[-1].omega - start.omega)
        if abs(step) < shortest or gone >= enough * abs(omega - start.omega):
            break
    return way[1:]


def predicted_start(
    last: list[Solution],
    omega: float,
    H: int,
) -> Solution | None:
    """A start on the curve through the last solutions; None, which is full stick, where the last
    one sticks.
    """
    if not last or all_stick(last[-1]):
        return None
    known = np.array([match_harmonics(p.w, H) for p in last])
    w = np.empty(known.shape[1:])
    at = np.array([p.omega for p in last])
    extrapolate_solution(
        omega, known.reshape(len(last), -1, 2 * H + 1), at, len(last), w.reshape(-1, 2 * H + 1)
    )
    return replace(last[-1], w=w)


def all_stick(solution: Solution) -> bool:
    """No contact slips or lifts off."""
    return solution.states["stick"] == len(solution.w)

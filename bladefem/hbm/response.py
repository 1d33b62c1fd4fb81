"""Points at given frequencies, each started from the curve through the last ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from .frequency_walk import all_stick, predicted_start
from .from_neighbours import nearest_neighbours, solve_off_resonance
from .model import ReducedModel
from .predictor import PREDICTOR_POINTS
from .solution import Solution
from .solve import leading_stuck_solutions
from .solver.newton import DEFAULT_OPTIONS, Options
from .solver.point_compiled import compiles_points, solve_along, solve_started
from .validate_model import check_point

Keep = Callable[[float, Callable[[], Solution]], Solution]
# points that are solved at once
POINTS_AT_ONCE = 16


def response(
    model: ReducedModel,
    omegas: Iterable[float],
    H: int = 3,
    samples: int = 128,
    *,
    options: Options = DEFAULT_OPTIONS,
    keep: Keep = lambda omega, compute: compute(),
    similar: Sequence[Solution] = (),
) -> Iterator[Solution]:
    """Solve one point after the other, each started from the curve through the last ones.

    Where a resonance without damping is hit exactly, the point 1e-7 next to it is solved, as its
    `omega` says.

    Args:
        keep: is given each frequency and what solves it; see `bladefem.hbm.checkpoint`.
        similar: points of a poorer model, from which a point of a small model is solved where the
            last ones do not lead to it.
    """
    omegas = list(omegas)
    last: list[Solution] = []
    ready: dict[int, Solution] = {}

    def compute(i: int) -> Solution:
        if i not in ready:
            ready.clear()
            ready.update(
                enumerate(
                    _at_once(model, omegas[i : i + POINTS_AT_ONCE], H, samples, last, options), i
                )
            )
        if i in ready:
            return ready[i]
        found = _from_similar(model, omegas[i], H, samples, similar, options)
        return found or solve_off_resonance(
            model, omegas[i], H, samples, predicted_start(last, omegas[i], H), options
        )

    for i, omega in enumerate(omegas):
        solution = keep(omega, partial(compute, i))
        yield solution
        if solution.converged:
            last = [*last[1 - PREDICTOR_POINTS :], solution]


def _at_once(
    model: ReducedModel,
    omegas: Sequence[float],
    H: int,
    samples: int,
    last: list[Solution],
    options: Options,
) -> list[Solution]:
    """The first of some frequencies that one call solves: those where all contacts stick, or points
    of a small model.

    Both end where the other way is better, or where Newton needs more than a good start.
    """
    sticks = options.frugal and (not last or all_stick(last[-1]))
    # points that all stick have few harmonics; else the check of many frequencies would be for
    # nothing, point after point
    if not compiles_points(model, 1 if sticks else H):
        return []
    for omega in omegas:
        check_point(model, omega, H, samples)
    found = leading_stuck_solutions(model, omegas, H) if sticks else []
    return found or solve_along(model, np.array(omegas), H, samples, last, options)


def _from_similar(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    similar: Sequence[Solution],
    options: Options,
) -> Solution | None:
    """The point from the nearest one of a poorer model; None where that does not lead to it.

    Where a damper floats, points from stick take hundreds of steps: two of 43 took three quarters
    of a curve (seed 158 of benchmarks/choice_random.py).
    """
    starts = nearest_neighbours(similar, omega)
    if not starts or starts[0].w.shape[:2] != model.springs.shape:
        return None
    return solve_started(model, omega, H, samples, starts[0].w, options)

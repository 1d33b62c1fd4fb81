"""A point of a response from the solved points next to it: at once, in small steps, with more
samples, and last by fallbacks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..errors import NotSolvedError
from .frequency_walk import walk_in_frequency
from .model import ReducedModel
from .solution import Solution, mostly_lifts_off
from .solve import solve, solve_near
from .solver.fallback import match_harmonics
from .solver.newton import DEFAULT_OPTIONS, Options

# of a frequency: how far next to a resonance without damping a sweep solves, where it hits it
# exactly
OFF_RESONANCE = 1e-7
# times the samples that are tried where walks end close to a point
MORE_SAMPLES = (2, 4)
# change between two motions, over the larger one, from which on a point between them need not lie
# near the line through them
FAR_APART = 0.5


def solve_from(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    starts: Sequence[Solution],
    options: Options = DEFAULT_OPTIONS,
) -> Solution:
    """The point from the first of several neighbours, or the line between them, that leads to it,
    at once or in small steps, before fallbacks, which take far longer.

    Next to a fold of the curve only the neighbour on its other side does.
    """
    simply = replace(options, fallbacks=False)
    line = line_between(starts, omega, H)
    # between bouncing points full stick leads nowhere, slowly
    stick = not line
    tried = [*line, *starts] if len(starts) > 1 else []
    tries = (solve_off_resonance(model, omega, H, samples, start, simply, stick) for start in tried)
    found = next((point for point in tries if point.converged), None)
    return found or walk_from(model, omega, H, samples, starts, options, stick)[-1]


def line_between(starts: Sequence[Solution], omega: float, H: int) -> list[Solution]:
    """A start on the line through two solved points on both sides of a frequency, where most
    contacts lift off at both: neither of them leads far there, and fails slowly.

    None where the damper walks at one of them alone, or their motions are far apart, since the
    response may jump between them.

    Args:
        starts: the nearest point, and the nearest on its other side.
    """
    if len(starts) < 2 or not all(mostly_lifts_off(point) for point in starts[:2]):
        return []
    near, beyond = starts[:2]
    if (near.walk is None) != (beyond.walk is None):
        return []
    share = (omega - near.omega) / (beyond.omega - near.omega)
    first, last = (match_harmonics(point.w, H) for point in (near, beyond))
    moving = [np.linalg.norm(w[:, :, 1:]) for w in (last - first, first, last)]
    if moving[0] > FAR_APART * max(moving[1:]):
        return []
    return [replace(near, w=first + share * (last - first))]


def nearest_neighbours(points: Iterable[Solution], omega: float) -> list[Solution]:
    """The converged point that is nearest to a frequency, and the nearest on its other side."""
    good = [p for p in points if p.converged]
    if not good:
        return []
    near = min(good, key=lambda p: abs(p.omega - omega))
    beyond = [p for p in good if (p.omega > omega) != (near.omega > omega)]
    return [near, *([min(beyond, key=lambda p: abs(p.omega - omega))] if beyond else [])]


def walk_from(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    starts: Sequence[Solution],
    options: Options,
    from_stick: bool = True,
) -> list[Solution]:
    """Points on the way from one of several neighbours to a frequency, the last one at it; with
    more samples where walks end close to it, by fallbacks where no neighbour leads there.
    """
    walked = []
    for start in starts if options.fallbacks else ():
        way = walk_in_frequency(model, omega, H, samples, start, options)
        if way and way[-1].omega == omega:
            return way
        walked += way
    # sampled friction jumps a little at the limit of stick: between two neighbours that are close
    # to each other there may be no exact zero
    if walked and samples:
        nearest = min(walked, key=lambda p: abs(p.omega - omega))
        for factor in MORE_SAMPLES:
            point = solve_near(model, omega, H, factor * samples, nearest, options)
            if point.converged:
                return [*walked, replace(point, method="more samples")]
    first = starts[0] if starts else None
    return [*walked, solve_off_resonance(model, omega, H, samples, first, options, from_stick)]


def solve_off_resonance(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
    start: Solution | None,
    options: Options,
    from_stick: bool = True,
) -> Solution:
    """The point, or the one just next to it."""
    solved = partial(
        solve, model, H=H, samples=samples, start=start, options=options, from_stick=from_stick
    )
    try:
        return solved(omega)
    except NotSolvedError:
        return solved(omega * (1 + OFF_RESONANCE))

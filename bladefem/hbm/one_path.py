"""Whether the points of a sweep are one path without folds, told by the tangents at the points.

Following a response round folds takes two to ten times as long as sweeping it, and half of the
random models with lift-off have none (benchmarks/choice_random.py). Between two points of one path
the motion changes by what the mean of both tangents says, roughly; across a fold it does not, since
the tangents turn upright there and the points lie on different sheets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from .band_path import lies_between
from .branches import further_motions
from .from_neighbours import solve_from
from .model import ReducedModel
from .sensitivity import sensitivities
from .solution import Solution
from .solver.fallback import match_harmonics
from .solver.newton import Options

# what tangents may leave out of the change between two points, over that change: at most 0.47 on
# eleven random models without folds; 0.56 to 0.9 on three, between whose points contacts begin to
# slip or to lift off
LEFT_OUT = 0.5
# the same from which on it is a fold: 0.93 to 5.1 on 13 with folds
FOLDED = 0.9
# points that are solved between others where that is open
MAX_FURTHER = 12
# change of the motion between two points, over the motion, that needs no tangents
SMALL_CHANGE = 0.05
# the same over the share of the band between two points of a rough sweep, from which on there is a
# jump: at most 180 on 15 random models without folds, 290 to 21000 on eight of 13 with folds
JUMP_STEEPNESS = 200.0


def has_jump(points: Sequence[Solution]) -> bool:
    """A sweep, sorted by frequency, jumps from one motion to another."""
    good = [p for p in points if p.converged]
    width = good[-1].omega - good[0].omega if good else 0.0
    return any(
        _change(one, other) * width > JUMP_STEEPNESS * (other.omega - one.omega)
        for one, other in pairwise(good)
    )


def joined_path(
    model: ReducedModel,
    points: Sequence[Solution],
    H: int,
    samples: int,
    options: Options,
) -> list[Solution] | None:
    """The points of a sweep, sorted by frequency, with further ones where tangents leave it open,
    as one path without folds; None where they are none, or where a motion off it is found from open
    contacts or from full stick.
    """
    if len(points) < 2 or not all(p.converged for p in points):
        return None
    found = list(points)
    open_pairs = [pair for pair in pairwise(points) if _change(*pair) > SMALL_CHANGE]
    # what is likely to be a fold last, from where it is taken first
    open_pairs.sort(key=lambda pair: _change(*pair))
    rates: dict[float, np.ndarray] = {}
    while open_pairs:
        pair = open_pairs.pop()
        for point in pair:
            if point.omega not in rates:
                rates[point.omega] = sensitivities(model, point, ["omega"])["omega"].w
        left_out = _left_out(pair, rates)
        if left_out <= LEFT_OUT:
            continue
        if left_out > FOLDED or len(found) >= len(points) + MAX_FURTHER:
            return None
        middle = (pair[0].omega + pair[1].omega) / 2
        simply = replace(options, fallbacks=False)
        between = solve_from(model, middle, H, samples, pair, simply)
        if not between.converged:
            return None
        found.append(between)
        open_pairs += [(pair[0], between), (between, pair[1])]
    found.sort(key=lambda p: p.omega)
    band = points[0].omega, points[-1].omega
    further = further_motions(model, band, points[0], H, samples, options)
    return found if all(_lies_on(found, motion) for motion in further) else None


def _lies_on(points: Sequence[Solution], motion: Solution) -> bool:
    """A motion lies between two neighbours."""
    return any(
        left.omega <= motion.omega <= right.omega and lies_between(left, right, motion)
        for left, right in pairwise(points)
    )


def _moving(*arrays: np.ndarray) -> list[np.ndarray]:
    """Displacements without their means, with equally many harmonics."""
    most = max((a.shape[2] - 1) // 2 for a in arrays)
    return [match_harmonics(a, most)[:, :, 1:] for a in arrays]


def _change(one: Solution, other: Solution) -> float:
    """Change of the motion over the larger one."""
    a, b = _moving(one.w, other.w)
    largest = max(np.linalg.norm(a), np.linalg.norm(b))
    return float(np.linalg.norm(b - a) / largest) if largest else 0.0


def _left_out(pair: tuple[Solution, Solution], rates: dict[float, np.ndarray]) -> float:
    """What the mean of both tangents leaves out of the change of the motion, over that change."""
    one, other = pair
    a, b, rise, fall = _moving(one.w, other.w, rates[one.omega], rates[other.omega])
    ahead = (rise + fall) * (other.omega - one.omega) / 2
    return float(np.linalg.norm(b - a - ahead) / np.linalg.norm(b - a))

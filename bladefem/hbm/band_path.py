"""A path of motions through a band, followed round its folds, and whether a motion lies on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..errors import NotSolvedError
from .continuation import PathPoint, follow
from .model import ReducedModel
from .solution import Solution
from .solver.fallback import match_harmonics
from .solver.newton import Options

# first and longest arc-length step, as shares of the band
ARC_STEPS = (0.005, 0.1)
# relative distance of displacements up to which a motion lies on a path, between two of its points
SAME_MOTION = 0.03
# folds of one path, and of all before no further one is begun: a damper that lifts off everywhere
# and strikes back has a maze of internal resonances, which leads nowhere
MAX_FOLDS = 24


@dataclass(frozen=True)
class PathLimits:
    """How far the paths of a band are followed."""

    # folds of one path, and of all before no further one is begun
    folds: int = MAX_FOLDS
    # points of all paths with which they are given up, as they are with more folds; None for as
    # many as the size of the model allows, after which what was found is kept
    points: int | None = None

    def given_up(self, followed: Sequence[Solution]) -> bool:
        """Points with the numbers of their pieces are those of paths that were given up."""
        pieces = [point.branch for point in followed if point.branch]
        if self.points is None:
            return False
        return len(pieces) >= self.points or max(pieces, default=0) > self.folds


USUAL_LIMITS = PathLimits()


@dataclass
class BandPath:
    """Points of a path in their order, and whether it begins and ends at an end of the band."""

    points: list[PathPoint]
    # "low", "high" or "" of the first and the last point
    ends: tuple[str, str]


def count_folds(paths: Sequence[BandPath]) -> int:
    """Folds of all paths."""
    return sum(point.fold for path in paths for point in path.points)


def follow_path(
    model: ReducedModel,
    start: Solution,
    band: tuple[float, float],
    forward: bool,
    budget: int,
    notes: list[str],
    options: Options,
    limits: PathLimits = USUAL_LIMITS,
) -> BandPath:
    """The path from a solution until it leaves the band, closes on itself, or the budget ends."""
    points: list[PathPoint] = []
    folds = 0
    options = replace(options, frugal=False)
    bounds = min(band[0], start.omega), max(band[1], start.omega)
    try:
        for point in follow(
            model,
            "omega",
            start,
            bounds,
            forward=forward,
            steps=ARC_STEPS,
            options=options,
            crossings=False,
        ):
            points.append(point)
            if point.restarted and not (len(points) > 1 and _goes_on(points)):
                notes.append(
                    f"a path was begun again at {point.solution.frequency:.6g} Hz: "
                    f"{point.restarted}"
                )
            folds += point.fold
            if folds > limits.folds:
                notes.append(
                    "the response curve was not followed beyond "
                    f"{point.solution.frequency:.6g} Hz, after {limits.folds} folds: there may be "
                    "further motions"
                )
                break
            if len(points) >= budget or _closed(points):
                break
    except NotSolvedError as error:
        notes.append(str(error))
    return BandPath(
        points,
        (_end_of_band(start.omega, band), _end_of_band(points[-1].value, band) if points else ""),
    )


def follow_both_ways(
    model: ReducedModel,
    start: Solution,
    band: tuple[float, float],
    path: BandPath,
    budget: int,
    notes: list[str],
    options: Options,
    limits: PathLimits = USUAL_LIMITS,
) -> BandPath:
    """The path continued beyond its start in the other direction, unless it closed on itself."""
    if _closed(path.points):
        return path
    left = budget - len(path.points)
    back = follow_path(model, start, band, False, left, notes, options, limits)
    turned = (
        [
            replace(late, forward=not late.forward, fold=early.fold)
            for late, early in pairwise([*back.points[::-1], back.points[0]])
        ]
        if back.points
        else []
    )
    return BandPath([*turned[:-1], *path.points], (back.ends[1], path.ends[1]))


def _goes_on(points: Sequence[PathPoint]) -> bool:
    """The last point, at which the path was begun again, is the motion of the one before it."""
    a, b = (point.solution.w[:, :, 1:] for point in points[-2:])
    return bool(np.linalg.norm(b - a) <= SAME_MOTION * np.linalg.norm(a))


def _end_of_band(omega: float, band: tuple[float, float]) -> str:
    """Which end of the band a frequency lies at or beyond."""
    margin = 1e-6 * (band[1] - band[0])
    if omega <= band[0] + margin:
        return "low"
    return "high" if omega >= band[1] - margin else ""


def _closed(points: Sequence[PathPoint]) -> bool:
    """The path has come round to its start in the same direction."""
    if len(points) < 10 or points[0].forward != points[-1].forward:
        return False
    one, two, three = points[0], points[-2], points[-1]
    if not min(two.value, three.value) <= one.value <= max(two.value, three.value):
        return False
    return lies_between(two.solution, three.solution, one.solution)


def lies_between(
    left: Solution,
    right: Solution,
    point: Solution,
) -> bool:
    """Whether a point lies on the chord between two others, in displacements."""
    H = max(left.harmonics, point.harmonics)
    a, b, c = (match_harmonics(p.w, H) for p in (left, right, point))
    width = right.omega - left.omega
    share = np.clip((point.omega - left.omega) / width, 0, 1) if width else 0.0
    between = (1 - share) * a + share * b
    # the chord of a curved path lies off it by a share of its own length
    off = SAME_MOTION * max(np.linalg.norm(a), np.linalg.norm(b)) + 0.1 * np.linalg.norm(b - a)
    # a stuck contact may rest anywhere
    return bool(np.linalg.norm((c - between)[:, :, 1:]) <= off)


def lies_on_paths(paths: Sequence[BandPath], point: Solution) -> bool:
    """Whether a motion lies between two points of one of the paths."""
    for path in paths:
        for left, right in pairwise(path.points):
            low, high = sorted((left.value, right.value))
            if low <= point.omega <= high and lies_between(left.solution, right.solution, point):
                return True
    return False

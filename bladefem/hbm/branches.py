"""All motions of a band: paths round folds, their local maxima, and how each of them is reached.

Where contacts lift off, several motions exist at one frequency, and a sweep sees one of them. Here
the response is followed from both ends of the band, and from every known motion that lies on none
of the paths so far. Each path is cut at its folds into pieces along which the frequency keeps its
direction; a local maximum along a path is closed in on the path itself, so that it may lie right
next to a fold. (Krack and Gross, Harmonic Balance for Nonlinear Vibration Problems, 2019, Sect. 4.)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from ..errors import NotSolvedError
from ..friction.fourier import to_real
from .band_path import (
    USUAL_LIMITS,
    BandPath,
    PathLimits,
    count_folds,
    follow_both_ways,
    follow_path,
    lies_on_paths,
)
from .continuation import PathPoint
from .linear.condensation import condense
from .model import ReducedModel
from .path_maxima import close_in_maxima, path_maxima
from .slow_sweep import DOWN, UP, reached_by, visited_pieces
from .solution import Solution, size
from .solve import solve
from .solver.fallback import match_harmonics
from .solver.newton import DEFAULT_OPTIONS, Options

# points of all paths of a band: so many times unknowns, within these bounds
POINT_BUDGET = 3e5
MIN_POINTS = 300
MAX_POINTS = 1500
# paths of a band in addition to those from its ends
MAX_PATHS = 6
# residual of points of a path, relative: a looser one lets a path go on beyond a fold, 17 % above
# the peak at 2e-5
PATH_TOLERANCE = 1e-9
# frequencies of the band where motions off the paths are looked for
PROBED_FREQUENCIES = 7


@dataclass(frozen=True)
class Resonance:
    """A local maximum of the response along a path."""

    solution: Solution
    # root of the sum of squares of the moving harmonics' amplitudes at the probe [m]
    height: float
    # motions found at this frequency
    multiplicity: int
    # "up and down", "up", "down": by a sweep in that direction; "isolated": by neither
    reached: str

    @property
    def frequency(self) -> float:
        """[Hz]"""
        return self.solution.frequency


@dataclass(frozen=True)
class Branches:
    """The motions of a band."""

    # each in the order along its path, the frequency monotone in it
    pieces: tuple[tuple[Solution, ...], ...]
    # by falling height
    resonances: tuple[Resonance, ...]
    # what the search could not do, in sentences
    notes: tuple[str, ...] = ()

    @property
    def points(self) -> list[Solution]:
        """All of them, with the number of their piece from 1 on."""
        return [
            replace(point, branch=number)
            for number, piece in enumerate(self.pieces, 1)
            for point in piece
        ]


def find_branches(
    model: ReducedModel,
    band: tuple[float, float],
    known: Sequence[Solution],
    H: int,
    samples: int,
    *,
    peak: float = 1e-3,
    options: Options = DEFAULT_OPTIONS,
    limits: PathLimits = USUAL_LIMITS,
) -> Branches:
    """Paths through a band of circular frequencies [rad/s], from its ends and from known motions.

    Args:
        known: solutions in the band, such as those of a sweep.
        peak: relative accuracy of each local maximum.
        limits: where they have an end for points, paths that reach it, or have more folds, are
            given up as they are.
    """
    options = replace(options, tolerance=min(options.tolerance, PATH_TOLERANCE))
    notes: list[str] = []
    paths: list[BandPath] = []
    # points that stick may have been solved with fewer harmonics
    solved = [
        replace(p, harmonics=H, samples=samples, w=match_harmonics(p.w, H))
        for p in sorted(known, key=lambda p: p.omega)
        if p.converged
    ]
    if not solved:
        return Branches((), (), ("no point of the band was solved",))
    limit = int(np.clip(POINT_BUDGET / (model.unknowns(H)), MIN_POINTS, MAX_POINTS))
    if limits.points is not None:
        limit = min(limit, limits.points)
    budget = limit
    further = _further(model, band, solved[0], H, samples, options)
    for start in chain(solved[:1], solved[-1:], solved, further):
        forward = start is not solved[-1]
        at_end = start is solved[0] or start is solved[-1]
        full = len(paths) >= MAX_PATHS or count_folds(paths) >= limits.folds
        if budget <= 0 or (full and not at_end) or lies_on_paths(paths, start):
            continue
        path = follow_path(model, start, band, forward, budget, notes, options, limits)
        if not at_end:
            path = follow_both_ways(model, start, band, path, budget, notes, options, limits)
        budget -= len(path.points)
        paths.append(path)
        if limits.points is not None and (budget <= 0 or count_folds(paths) > limits.folds):
            return _sorted_out(paths, [], options.probe, notes)
    if budget <= 0:
        notes.append(f"paths ended after {limit} points: there may be further motions")
    for path in paths:
        close_in_maxima(model, path, band, peak, options)
    left_over = _runs([lies_on_paths(paths, p) for p in solved], solved)
    return _sorted_out(paths, left_over, options.probe, notes)


def _runs(on_path: Sequence[bool], solved: Sequence[Solution]) -> list[list[Solution]]:
    """Neighbouring known motions that lie on no path: the budget ended before them."""
    runs: list[list[Solution]] = []
    before = True
    for found, point in zip(on_path, solved, strict=True):
        if not found:
            if before:
                runs.append([])
            runs[-1].append(point)
        before = found
    return runs


def _further(
    model: ReducedModel,
    band: tuple[float, float],
    like: Solution,
    H: int,
    samples: int,
    options: Options,
) -> Iterable[Solution]:
    """Motions by Newton from open contacts and from full stick, at some frequencies of the band."""
    simply = replace(options, fallbacks=False, frugal=False)
    for omega in np.linspace(*band, PROBED_FREQUENCIES + 2)[1:-1]:
        try:
            open_contacts = to_real(condense(model, float(omega), H).free.T)
        except NotSolvedError:
            # a resonance without damping, exactly
            continue
        shape = (*model.springs.shape, 2 * H + 1)
        for start in (replace(like, w=open_contacts.reshape(shape)), None):
            point = solve(model, float(omega), H, samples, start=start, options=simply)
            if point.converged:
                yield point


def _sorted_out(
    paths: Sequence[BandPath],
    left_over: Sequence[list[Solution]],
    probe: int,
    notes: list[str],
) -> Branches:
    """Pieces between folds, and the local maxima with what is known of them.

    Args:
        left_over: motions on none of the paths, each run a piece without a known way to it.
    """
    pieces: list[list[Solution]] = []
    maxima: list[tuple[Solution, int]] = []
    ends: dict[str, int] = {}
    for path in paths:
        if len(path.points) < 2:
            continue
        first = len(pieces)
        pieces.extend(_pieces(path.points))
        for end, number in zip(path.ends, (first, len(pieces) - 1), strict=True):
            if end:
                ends.setdefault(end, number)
        for point in path_maxima(path, probe):
            own = (n for n in range(first, len(pieces)) if any(p is point for p in pieces[n]))
            maxima.append((point, next(own)))
    frequencies = [np.array([p.omega for p in piece]) for piece in pieces]

    def apart(n: int, i: int, other: int, j: int) -> float:
        return _distance(pieces[n][i], pieces[other][j])

    swept = {
        way: visited_pieces(frequencies, ends.get(end), way, apart)
        for end, way in (("low", UP), ("high", DOWN))
    }
    resonances = [
        Resonance(
            point,
            size(point, probe),
            _count(pieces, point.omega),
            reached_by(swept, number, point.omega),
        )
        for point, number in maxima
    ]
    resonances.sort(key=lambda r: -r.height)
    pieces.extend(left_over)
    return Branches(tuple(map(tuple, pieces)), tuple(resonances), tuple(dict.fromkeys(notes)))


def _pieces(points: Sequence[PathPoint]) -> list[list[Solution]]:
    """The path cut where the frequency turns back."""
    pieces = [[points[0].solution]]
    rising = 0.0
    for before, point in pairwise(points):
        change = np.sign(point.value - before.value)
        if rising and change and change != rising:
            pieces.append([])
        rising = change or rising
        pieces[-1].append(point.solution)
    return pieces


def _distance(one: Solution, other: Solution) -> float:
    H = max(one.harmonics, other.harmonics)
    return float(np.linalg.norm(match_harmonics(one.w, H) - match_harmonics(other.w, H)))


def _count(pieces: Sequence[Sequence[Solution]], omega: float) -> int:
    """Pieces that cross a frequency."""
    ends = ((min(p.omega for p in piece), max(p.omega for p in piece)) for piece in pieces)
    return sum(low <= omega <= high for low, high in ends)

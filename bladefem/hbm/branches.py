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
from .continuation import PathPoint, follow
from .linear.condensation import condense
from .model import ReducedModel
from .peak import find_peak
from .slow_sweep import DOWN, UP, reached_by, visited_pieces
from .solution import Solution, size
from .solve import solve
from .solver.fallback import match_harmonics
from .solver.newton import DEFAULT_OPTIONS, Options

# first and longest arc-length step, as shares of the band
ARC_STEPS = (0.005, 0.1)
# steps with which a local maximum is closed in
PEAK_STEP = 1e-4
# points of all paths of a band: so many times unknowns, within these bounds
POINT_BUDGET = 3e5
MIN_POINTS = 300
MAX_POINTS = 1500
# paths of a band in addition to those from its ends
MAX_PATHS = 6
# relative distance of displacements up to which a motion lies on a path, between two of its points
SAME_MOTION = 0.03
# residual of points of a path, relative: a looser one lets a path go on beyond a fold, 17 % above
# the peak at 2e-5
PATH_TOLERANCE = 1e-9
# frequencies of the band where motions off the paths are looked for
PROBED_FREQUENCIES = 7
# refinements of one local maximum
MAX_REFINEMENTS = 12
# height of a local maximum over the highest of its path below which it is not closed in
SMALL_MAXIMUM = 0.02
# local maxima of a path that are closed in, the highest ones: a maze of folds has dozens
MAX_CLOSED_IN = 8
# folds of one path, and of all before no further one is begun: a damper that lifts off everywhere
# and strikes back has a maze of internal resonances, which leads nowhere
MAX_FOLDS = 24


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


@dataclass
class _Path:
    """A path under way: its points in order, and whether it starts at an end of the band."""

    points: list[PathPoint]
    # "low", "high" or "" of the first and the last point
    ends: tuple[str, str]


def find_branches(
    model: ReducedModel,
    band: tuple[float, float],
    known: Sequence[Solution],
    H: int,
    samples: int,
    *,
    peak: float = 1e-3,
    options: Options = DEFAULT_OPTIONS,
) -> Branches:
    """Paths through a band of circular frequencies [rad/s], from its ends and from known motions.

    Args:
        known: solutions in the band, such as those of a sweep.
        peak: relative accuracy of each local maximum.
    """
    options = replace(options, tolerance=min(options.tolerance, PATH_TOLERANCE))
    notes: list[str] = []
    paths: list[_Path] = []
    # points that stick may have been solved with fewer harmonics
    solved = [
        replace(p, harmonics=H, samples=samples, w=match_harmonics(p.w, H))
        for p in sorted(known, key=lambda p: p.omega)
        if p.converged
    ]
    if not solved:
        return Branches((), (), ("no point of the band was solved",))
    limit = int(np.clip(POINT_BUDGET / (model.springs.size * (2 * H + 1)), MIN_POINTS, MAX_POINTS))
    budget = limit
    further = _further(model, band, solved[0], H, samples, options)
    for start in chain(solved[:1], solved[-1:], solved, further):
        forward = start is not solved[-1]
        at_end = start is solved[0] or start is solved[-1]
        full = len(paths) >= MAX_PATHS or _folds(paths) >= MAX_FOLDS
        if budget <= 0 or (full and not at_end) or _on_paths(paths, start):
            continue
        path = _followed(model, start, band, forward, budget, notes, options)
        if not at_end:
            path = _both_ways(model, start, band, path, budget, notes, options)
        budget -= len(path.points)
        paths.append(path)
    if budget <= 0:
        notes.append(f"paths ended after {limit} points: there may be further motions")
    for path in paths:
        _close_in(model, path, band, peak, options)
    left_over = _runs([_on_paths(paths, p) for p in solved], solved)
    return _sorted_out(paths, left_over, options.probe, notes)


def _folds(paths: Sequence[_Path]) -> int:
    return sum(point.fold for path in paths for point in path.points)


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


def _followed(
    model: ReducedModel,
    start: Solution,
    band: tuple[float, float],
    forward: bool,
    budget: int,
    notes: list[str],
    options: Options,
) -> _Path:
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
            if point.restarted:
                notes.append(
                    f"a path was begun again at {point.solution.frequency:.6g} Hz: "
                    f"{point.restarted}"
                )
            folds += point.fold
            if folds > MAX_FOLDS:
                notes.append(
                    f"a path was left at {point.solution.frequency:.6g} Hz after {MAX_FOLDS} "
                    "folds: there may be further motions"
                )
                break
            if len(points) >= budget or _closed(points, band):
                break
    except NotSolvedError as error:
        notes.append(str(error))
    return _Path(points, (_end(start.omega, band), _end(points[-1].value, band) if points else ""))


def _both_ways(
    model: ReducedModel,
    start: Solution,
    band: tuple[float, float],
    path: _Path,
    budget: int,
    notes: list[str],
    options: Options,
) -> _Path:
    """The path continued beyond its start in the other direction, unless it closed on itself."""
    if _closed(path.points, band):
        return path
    back = _followed(model, start, band, False, budget - len(path.points), notes, options)
    turned = (
        [
            replace(late, forward=not late.forward, fold=early.fold)
            for late, early in pairwise([*back.points[::-1], back.points[0]])
        ]
        if back.points
        else []
    )
    return _Path([*turned[:-1], *path.points], (back.ends[1], path.ends[1]))


def _end(omega: float, band: tuple[float, float]) -> str:
    """Which end of the band a frequency lies at or beyond."""
    margin = 1e-6 * (band[1] - band[0])
    if omega <= band[0] + margin:
        return "low"
    return "high" if omega >= band[1] - margin else ""


def _closed(points: Sequence[PathPoint], band: tuple[float, float]) -> bool:
    """The path has come round to its start in the same direction."""
    if len(points) < 10 or points[0].forward != points[-1].forward:
        return False
    one, two, three = points[0], points[-2], points[-1]
    if not min(two.value, three.value) <= one.value <= max(two.value, three.value):
        return False
    return _near(two.solution, three.solution, one.solution)


def _near(
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


def _on_paths(paths: Sequence[_Path], point: Solution) -> bool:
    for path in paths:
        for left, right in pairwise(path.points):
            low, high = sorted((left.value, right.value))
            if low <= point.omega <= high and _near(left.solution, right.solution, point):
                return True
    return False


def _close_in(
    model: ReducedModel,
    path: _Path,
    band: tuple[float, float],
    peak: float,
    options: Options,
) -> None:
    """Further points round the highest local maxima, put into the path where they belong."""
    heights = [size(p.solution, options.probe) for p in path.points]
    found = _maxima_to_close_in(heights, peak)
    highest = sorted(found, key=lambda i: -heights[i])[:MAX_CLOSED_IN]
    # from the end on: points that are put in move those behind them
    for i in sorted(highest, reverse=True):
        three = path.points[i - 1 : i + 2]
        path.points[i - 1 : i + 2] = _by_slope(model, three, peak, options) or _finer(
            model, three, band, peak, options
        )


def _maxima_to_close_in(heights: Sequence[float], peak: float) -> list[int]:
    """Numbers of the local maxima that are not small, and from which the path falls by more than
    the relative accuracy of a peak.
    """
    top = max(heights, default=0.0)
    found = []
    for i in range(1, len(heights) - 1):
        before, here, after = heights[i - 1 : i + 2]
        if here < max(before, after) or here < SMALL_MAXIMUM * top:
            continue
        if here - min(before, after) >= peak * here:
            found.append(i)
    return found


def _by_slope(
    model: ReducedModel,
    three: Sequence[PathPoint],
    peak: float,
    options: Options,
) -> list[PathPoint] | None:
    """Three points with the maximum between them found by its slope, which takes fewer points than
    short steps; None where that leaves the path, or where the frequency turns back in between.
    """
    first, middle, last = three
    turns = (middle.value - first.value) * (last.value - middle.value) <= 0
    if turns or not first.forward == middle.forward == last.forward:
        return None
    point = middle.solution
    simply = replace(options, fallbacks=False, frugal=False)
    try:
        found = find_peak(
            model,
            point.omega,
            point.harmonics,
            point.samples,
            near=point,
            tolerance=peak,
            options=simply,
        )
    except NotSolvedError:
        return None
    before, after = (
        (first, middle)
        if (found.omega - middle.value) * (last.value - middle.value) < 0
        else (middle, last)
    )
    low, high = sorted((before.value, after.value))
    inside = low <= found.omega <= high
    if not inside or not _near(before.solution, after.solution, found.solution):
        return None
    top = replace(middle, value=found.omega, solution=found.solution, fold=False)
    if found.omega == middle.value or found.height <= size(point, options.probe):
        return list(three)
    return [first, top, middle, last] if before is first else [first, middle, top, last]


def _finer(
    model: ReducedModel,
    three: Sequence[PathPoint],
    band: tuple[float, float],
    peak: float,
    options: Options,
) -> list[PathPoint]:
    """Three points with a maximum inside, and what lies between them by shorter steps."""
    probe = options.probe
    first, _, last = three
    length = abs(three[1].value - first.value) + abs(last.value - three[1].value)
    step = max(length / (band[1] - band[0]) / 8, PEAK_STEP)
    options = replace(options, frugal=False)
    found = [first]
    try:
        for point in follow(
            model,
            "omega",
            first.solution,
            (0.99 * band[0], 1.01 * band[1]),
            forward=first.forward,
            steps=(step, step),
            options=options,
            crossings=False,
        ):
            if len(found) > 4 * MAX_REFINEMENTS:
                break
            if point.value != first.value:
                found.append(point)
            beyond = (point.value - last.value) * (1 if last.forward else -1) >= 0
            falls = len(found) > 2 and size(point.solution, probe) < size(
                found[-2].solution, probe
            ) * (1 - peak)
            if point.forward == last.forward and beyond and falls:
                break
    except NotSolvedError:
        return list(three)
    if max(size(p.solution, probe) for p in found) < size(three[1].solution, probe):
        return list(three)
    return [*found, last]


def _sorted_out(
    paths: Sequence[_Path],
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
        for point in _local_maxima(path, probe):
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


def _local_maxima(path: _Path, probe: int) -> list[Solution]:
    """Points of a path that are higher than the one before and not lower than the one after."""
    heights = [size(p.solution, probe) for p in path.points]
    return [
        path.points[i].solution
        for i in range(1, len(heights) - 1)
        if heights[i] > heights[i - 1] and heights[i] >= heights[i + 1]
    ]


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

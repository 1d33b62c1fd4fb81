"""A band of frequencies, swept with the points where the curve needs them."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ..errors import InputError
from .band_path import USUAL_LIMITS, PathLimits
from .branches import Branches, find_branches
from .from_neighbours import nearest_neighbours, solve_from, walk_from
from .model import ReducedModel
from .next_frequency import Slope, first_look, next_frequency
from .response import response
from .sensitivity import sensitivities
from .solution import Solution, lifts_off, size
from .solver.newton import DEFAULT_OPTIONS, Options
from .validate_model import check_probe

# points after which a sweep gives up refining
BAND_LIMIT = 400
# unknowns up to which paths are followed wherever contacts lift off; of larger models, where the
# sweep shows a jump, too
MAX_PATH_UNKNOWNS = 800
# a jump: a share of the highest point between neighbours that this share of the band separates
JUMP_HEIGHT_SHARE = 0.05
JUMP_WIDTH = 1e-4


@dataclass(frozen=True)
class _BandSearch:
    """What does not change while a band is swept."""

    model: ReducedModel
    H: int
    samples: int
    options: Options
    # relative accuracy of each maximum, and distance of a point from the line through its
    # neighbours over the highest maximum
    accuracy: tuple[float, float]
    # the response is followed round folds where contacts lift off
    paths: bool
    # of a poorer model, to start from where neighbours do not lead to a point
    similar: Sequence[Solution]


def sweep(
    model: ReducedModel,
    band: tuple[float, float],
    H: int = 3,
    samples: int = 128,
    *,
    peak: float = 1e-3,
    curve: float = 0.02,
    options: Options = DEFAULT_OPTIONS,
    notes: list[str] | None = None,
    paths: bool = True,
    known: Sequence[Solution] = (),
    limits: PathLimits = USUAL_LIMITS,
    similar: Sequence[Solution] = (),
) -> Iterator[Solution]:
    """Solve a band of circular frequencies [rad/s]; points come in the order of need.

    A first look takes even steps and the resonances of both linear limits. Then every local maximum
    is closed in: the slope of its highest point is exact, and 1/amplitude^2 a parabola in omega^2,
    as it is for one mode, that has this slope and meets a neighbour; its vertex is solved next,
    until it is no higher than the tolerance allows.

    Where contacts lift off there may be several motions at one frequency. Then the response is
    followed round its folds (`bladefem.hbm.branches`), and the points that follow carry the number
    of their piece in `branch`; of many unknowns only where the sweep jumps, loses points or does
    not end.

    Args:
        peak: relative accuracy of each maximum.
        curve: distance of a point from the line through its neighbours, over the highest maximum.
        notes: takes what the search could not do, in sentences.
        paths: whether the response is followed round folds; otherwise one motion is looked for.
        known: converged points of the band, of this model with these harmonics and samples, which
            are not solved again; they come first.
        limits: of these paths.
        similar: points of a poorer model, to start from where neighbours do not lead to a point.

    Raises:
        InputError: the band is empty or not positive.
    """
    _check_band(band)
    check_probe(model, options.probe)
    search = _BandSearch(model, H, samples, options, (peak, curve), paths, similar)
    solved = {point.omega: point for point in known}
    yield from known
    notes = [] if notes is None else notes
    lost: list[float] = []
    look = [omega for omega in first_look(model, band) if omega not in solved]
    for point in _first_solutions(search, look, solved, lost):
        solved[point.omega] = point
        yield point
    followed = yield from _close_in_maxima(search, solved, notes)
    if followed:
        yield from _followed(search, band, solved, lost, limits, notes)


def _followed(
    search: _BandSearch,
    band: tuple[float, float],
    solved: dict[float, Solution],
    lost: list[float],
    limits: PathLimits,
    notes: list[str],
) -> Iterator[Solution]:
    """The response round its folds, from the ends of the band on; then the points that neither the
    first look nor a path has.

    Args:
        solved: points of the sweep; those at the ends of the band are added.
        lost: circular frequencies that the first look did not solve.
    """
    for point in _lost_ends(search, band, solved, lost):
        # a path may cross the others
        if point.converged:
            solved[point.omega] = point
            yield point
    points = list(solved.values())
    found = find_branches(
        search.model,
        band,
        points,
        search.H,
        search.samples,
        peak=search.accuracy[0],
        options=search.options,
        limits=limits,
    )
    notes.extend(found.notes)
    yield from found.points
    yield from _solved_again(search, _missed(lost, solved, found), points)


def _first_solutions(
    search: _BandSearch,
    look: Sequence[float],
    known: Mapping[float, Solution],
    lost: list[float],
) -> Iterator[Solution]:
    """The first look of a sweep: upwards without fallbacks, then the points that the neighbour
    below does not lead to; but not where the response is followed, since paths may lead to them.

    Args:
        look: circular frequencies of the first look.
        known: points that are solved already.
        lost: takes the circular frequencies of those points.
    """
    simply = replace(search.options, fallbacks=False)
    solved = dict(known)
    points = response(
        search.model, look, search.H, search.samples, options=simply, similar=search.similar
    )
    for solution in points:
        if search.options.fallbacks and not solution.converged:
            lost.append(solution.omega)
            continue
        solved[solution.omega] = solution
        yield solution
    if not (search.paths and _needs_continuation(search, solved)):
        yield from _solved_again(search, lost, solved.values())


def _close_in_maxima(
    search: _BandSearch, solved: dict[float, Solution], notes: list[str]
) -> Generator[Solution, None, bool]:
    """Solve the points that close in on every local maximum, one after the other.

    Args:
        solved: takes the points.

    Returns:
        True where one motion a frequency is too few, so that the response has to be followed.
    """
    probe = search.options.probe
    slope = _slope_of(search.model, solved, probe)

    @cache
    def height(omega: float) -> float:
        return size(solved[omega], probe)

    while not (search.paths and _needs_continuation(search, solved)):
        wanted = next_frequency(solved, height, slope, search.accuracy)
        if wanted is None:
            return False
        if len(solved) >= BAND_LIMIT:
            notes.append(_limit_note())
            # only normal loads that follow the motion make folds
            return search.paths and _normal_loads_follow(search.model)
        starts = nearest_neighbours(solved.values(), wanted)
        solved[wanted] = solve_from(
            search.model, wanted, search.H, search.samples, starts, search.options
        )
        yield solved[wanted]
    return True


def _lost_ends(
    search: _BandSearch,
    band: tuple[float, float],
    solved: Mapping[float, Solution],
    lost: Sequence[float],
) -> Iterator[Solution]:
    """The ends of the band that the first look lost, where paths begin.

    From the last point that was solved they lead past a resonance that bodies come to from beyond:
    with 31 harmonics a random model's was 5 times too low, which a slow march down the band keeps
    (seed 413 of benchmarks/choice_random.py).
    """
    return _solved_again(search, [omega for omega in band if omega in lost], solved.values())


def _missed(
    lost: list[float],
    solved: Mapping[float, Solution],
    found: Branches,
) -> list[float]:
    """Frequencies lost in the first look that no path went through either."""
    return [omega for omega in lost if omega not in solved and not _crossed(found, omega)]


def _crossed(branches: Branches, omega: float) -> bool:
    """A path leads through this circular frequency."""
    ends = ([p.omega for p in piece] for piece in branches.pieces)
    return any(min(omegas) <= omega <= max(omegas) for omegas in ends)


def _limit_note() -> str:
    return (
        f"the sweep ended after {BAND_LIMIT} points: peaks may be higher by more than the accuracy"
    )


def _solved_again(
    search: _BandSearch, lost: Sequence[float], known: Iterable[Solution]
) -> Iterator[Solution]:
    """Points that the first look lost, by walks from neighbours on both sides and by fallbacks."""
    solved = list(known)
    for omega in lost:
        starts = nearest_neighbours(solved, omega)
        walk = walk_from(search.model, omega, search.H, search.samples, starts, search.options)
        for solution in walk:
            solved.append(solution)
            yield solution


def _check_band(band: tuple[float, float]) -> None:
    if not 0 < band[0] < band[1] < np.inf:
        raise InputError(f"band {band}: expected 0 < low < high")


def _slope_of(model: ReducedModel, solved: Mapping[float, Solution], probe: int) -> Slope:
    """The slope of the height with the frequency at solved ones, computed once for each."""

    @cache
    def slope(omega: float) -> float:
        return float(sensitivities(model, solved[omega], ["omega"])["omega"].size[probe])

    return slope


def _normal_loads_follow(model: ReducedModel) -> bool:
    """Whether normal loads follow the motion, so that there may be several motions."""
    return not model.loads_prescribed


def _needs_continuation(search: _BandSearch, solved: Mapping[float, Solution]) -> bool:
    """Whether the response has to be followed round folds: contacts lift off, or the sweep
    jumps.
    """
    model = search.model
    if not _normal_loads_follow(model):
        return False
    points = [solved[omega] for omega in sorted(solved)]
    good = [p for p in points if p.converged]
    if len(good) < 2:
        return False
    if model.unknowns(search.H) <= MAX_PATH_UNKNOWNS:
        opened = {p.states["open"] for p in good}
        return len(opened) > 1 or any(lifts_off(p) for p in good)
    if len(good) < len(points):
        return True
    heights = np.array([size(p, search.options.probe) for p in good])
    steps = np.diff([p.omega for p in good])
    near = steps < JUMP_WIDTH * (good[-1].omega - good[0].omega)
    return bool(np.any(near & (abs(np.diff(heights)) > JUMP_HEIGHT_SHARE * heights.max())))

"""Frequency responses: a given list of frequencies, or a band with the points put where the curve
needs them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from ..errors import InputError
from .band_path import USUAL_LIMITS, PathLimits
from .branches import Branches, find_branches
from .frequency_walk import all_stick, predicted_start
from .from_neighbours import nearest_neighbours, solve_from, solve_off_resonance, walk_from
from .model import ReducedModel
from .next_frequency import Slope, first_look, next_frequency
from .predictor import PREDICTOR_POINTS
from .sensitivity import sensitivities
from .solution import Solution, lifts_off, size
from .solve import leading_stuck_solutions
from .solver.newton import DEFAULT_OPTIONS, Options
from .solver.point_compiled import compiles_points, solve_along, solve_started
from .validate_model import check_point, check_probe

Keep = Callable[[float, Callable[[], Solution]], Solution]
# points that are solved at once
POINTS_AT_ONCE = 16
# points after which a sweep gives up refining
BAND_LIMIT = 400
# unknowns up to which paths are followed wherever contacts lift off; of larger models, where the
# sweep shows a jump, too
MAX_PATH_UNKNOWNS = 700
# a jump: a share of the highest point between neighbours that this share of the band separates
JUMP_HEIGHT_SHARE = 0.05
JUMP_WIDTH = 1e-4


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
    # whatever the harmonics: the check of many frequencies would be for nothing, point after point
    if not compiles_points(model, 1):
        return []
    for omega in omegas:
        check_point(model, omega, H, samples)
    sticks = not last or all_stick(last[-1])
    found = leading_stuck_solutions(model, omegas, H) if options.frugal and sticks else []
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


def _close_in_maxima(
    model: ReducedModel,
    solved: dict[float, Solution],
    H: int,
    samples: int,
    accuracy: tuple[float, float],
    options: Options,
    paths: bool,
    notes: list[str],
) -> Generator[Solution, None, bool]:
    """Solve the points that close in on every local maximum, one after the other.

    Args:
        solved: takes the points.
        accuracy: of maxima, and of the curve between them, as in :func:`sweep`.

    Returns:
        True where one motion a frequency is too few, so that the response has to be followed.
    """
    slope = _slope_of(model, solved, options.probe)

    @cache
    def height(omega: float) -> float:
        return size(solved[omega], options.probe)

    while not (paths and _needs_continuation(model, solved, H, options.probe)):
        wanted = next_frequency(solved, height, slope, accuracy)
        if wanted is None:
            return False
        if len(solved) >= BAND_LIMIT:
            notes.append(_limit_note())
            # only normal loads that follow the motion make folds
            return paths and _normal_loads_follow(model)
        starts = nearest_neighbours(solved.values(), wanted)
        solved[wanted] = solve_from(model, wanted, H, samples, starts, options)
        yield solved[wanted]
    return True


def _missed(
    lost: list[float],
    solved: Mapping[float, Solution],
    found: Branches,
) -> list[float]:
    """Frequencies lost in the first look that no path went through either."""
    return [omega for omega in lost if omega not in solved and not _crossed(found, omega)]


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
    solved = {point.omega: point for point in known}
    yield from known
    notes = [] if notes is None else notes
    lost: list[float] = []
    look = [omega for omega in first_look(model, band) if omega not in solved]
    first = _first_solutions(model, look, solved, H, samples, options, paths, lost, similar)
    for point in first:
        solved[point.omega] = point
        yield point
    ends = peak, curve
    followed = yield from _close_in_maxima(model, solved, H, samples, ends, options, paths, notes)
    if followed:
        yield from _round_folds(model, band, solved, lost, H, samples, peak, options, limits, notes)


def _round_folds(
    model: ReducedModel,
    band: tuple[float, float],
    solved: dict[float, Solution],
    lost: list[float],
    H: int,
    samples: int,
    peak: float,
    options: Options,
    limits: PathLimits,
    notes: list[str],
) -> Iterator[Solution]:
    """The pieces of a response between its folds, and the points that no path leads to.

    Args:
        solved: circular frequency to point of the sweep.
        lost: circular frequencies of the first look that were left to paths.
        notes: takes what the search could not do, in sentences.
    """
    points = list(solved.values())
    found = find_branches(
        model, band, points, H, samples, peak=peak, options=options, limits=limits
    )
    notes.extend(found.notes)
    yield from found.points
    yield from _solved_again(model, _missed(lost, solved, found), points, H, samples, options)


def _crossed(branches: Branches, omega: float) -> bool:
    """A path leads through this circular frequency."""
    ends = ([p.omega for p in piece] for piece in branches.pieces)
    return any(min(omegas) <= omega <= max(omegas) for omegas in ends)


def _first_solutions(
    model: ReducedModel,
    look: Sequence[float],
    known: Mapping[float, Solution],
    H: int,
    samples: int,
    options: Options,
    paths: bool,
    lost: list[float],
    similar: Sequence[Solution],
) -> Iterator[Solution]:
    """The first look of a sweep: upwards without fallbacks, then the points that the neighbour
    below does not lead to; but not where the response is followed, since paths may lead to them.

    Args:
        look: circular frequencies of the first look.
        known: points that are solved already.
        lost: takes the circular frequencies of those points.
        similar: points of a poorer model, to start from where neighbours do not lead to a point.
    """
    simply = replace(options, fallbacks=False)
    solved = dict(known)
    for solution in response(model, look, H, samples, options=simply, similar=similar):
        if options.fallbacks and not solution.converged:
            lost.append(solution.omega)
            continue
        solved[solution.omega] = solution
        yield solution
    if not (paths and _needs_continuation(model, solved, H, options.probe)):
        yield from _solved_again(model, lost, solved.values(), H, samples, options)


def _limit_note() -> str:
    return (
        f"the sweep ended after {BAND_LIMIT} points: peaks may be higher by more than the accuracy"
    )


def _solved_again(
    model: ReducedModel,
    lost: Sequence[float],
    known: Iterable[Solution],
    H: int,
    samples: int,
    options: Options,
) -> Iterator[Solution]:
    """Points that the first look lost, by walks from neighbours on both sides and by fallbacks."""
    solved = list(known)
    for omega in lost:
        for solution in walk_from(
            model, omega, H, samples, nearest_neighbours(solved, omega), options
        ):
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


def _needs_continuation(
    model: ReducedModel,
    solved: Mapping[float, Solution],
    H: int,
    probe: int,
) -> bool:
    """Whether the response has to be followed round folds: contacts lift off, or the sweep
    jumps.
    """
    if not _normal_loads_follow(model):
        return False
    points = [solved[omega] for omega in sorted(solved)]
    good = [p for p in points if p.converged]
    if len(good) < 2:
        return False
    if model.unknowns(H) <= MAX_PATH_UNKNOWNS:
        opened = {p.states["open"] for p in good}
        return len(opened) > 1 or any(lifts_off(p) for p in good)
    if len(good) < len(points):
        return True
    heights = np.array([size(p, probe) for p in good])
    steps = np.diff([p.omega for p in good])
    near = steps < JUMP_WIDTH * (good[-1].omega - good[0].omega)
    return bool(np.any(near & (abs(np.diff(heights)) > JUMP_HEIGHT_SHARE * heights.max())))

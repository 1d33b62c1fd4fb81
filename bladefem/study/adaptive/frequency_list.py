"""The automatic choice along given frequencies: none gets more than the accuracy of the highest
point asks for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError, NotSolvedError
from ...hbm.from_neighbours import solve_from
from ...hbm.full_stick import sticks_safely
from ...hbm.predictor import PREDICTOR_POINTS, extrapolate_solution
from ...hbm.response import response
from ...hbm.solution import Solution, size
from ...hbm.solver.fallback import match_harmonics
from ...hbm.solver.newton import Options
from .band_sweep import solver_options
from .check_points import heights_of, left_out_motion, points_to_check
from .checked_curve import CheckedCurve
from .family import Family, carried_displacements, family_member, with_excited_harmonics
from .indicators import Indicators, indicate_errors, judged_orders, total_error
from .point_choice import KEPT_DIRECTIONS, likely_settings, next_settings
from .settings import Settings, enriched_settings

# of richer settings, each round one point
MAX_PASSES = 16
# accuracy that the first sweep is made for where contacts may lift off
FIRST_SWEEP_ACCURACY = 0.02
TINY = float(np.finfo(float).tiny)
# neighbours for which a point that is less wrong than predicted speaks, and how much at most
REPRESENTED_NEIGHBOURS = 3
MIN_REDUCTION = 0.25
# times the tolerated error that two steps of harmonics change, where one of them leaves half of it
ONE_STEP = 4
# neighbours that richer settings do not change, beyond which the others are left as they are
UNCHANGED_NEIGHBOURS = 2


@dataclass
class _Curve:
    """A sweep under way; lists in the order of the frequencies."""

    family: Family
    options: Options
    accuracy: float
    points: list[Solution]
    # of each point, see `heights_of`
    heights: np.ndarray
    # of each point
    used: list[Settings]
    # of each point what `left_out_motion` gives
    moved: np.ndarray
    # circular frequency of the judged points to the estimated relative error
    errors: dict[float, float]
    # those of them that no richer model has solved
    predicted: set[float]

    @property
    def limit(self) -> float:
        """Tolerated error [m], with the other half in hand."""
        return self.accuracy * float(self.heights.max()) / 2


def adapt_frequency_list(
    family: Family,
    omegas: Sequence[float],
    settings: Settings,
    accuracy: float,
) -> CheckedCurve:
    """Response at ascending circular frequencies [rad/s], everywhere within the accuracy of its
    highest point.

    All of them are solved with what contacts that slip commonly need. Then the curve is judged at
    some of its points, the peak first; round one that is too wrong richer settings are taken, as
    far as they change anything.

    Args:
        settings: to start the choice from.

    Returns:
        the points and the settings of the highest; others may have been solved with fewer
        harmonics, samples, ...

    Raises:
        InputError: no frequencies, or an accuracy that is none.
        NotSolvedError: no point converged.
    """
    curve = _first_curve(family, omegas, settings, accuracy)
    points = curve.points
    final: set[int] = set()
    known: dict[str, float] = {}
    for _ in range(MAX_PASSES):
        limit = curve.limit
        wrong = _first_wrong(curve, limit, final)
        if wrong is None:
            break
        found = indicate_errors(family, curve.used[wrong], points[wrong], known)
        better = next_settings(curve.used[wrong], found, 2 * limit / curve.heights[wrong])
        if better is not None:
            _refine_point(curve, wrong, better, found)
        # there is none, or it was not solved
        if curve.used[wrong] != better:
            final.add(wrong)
        known = {
            name: found.errors[name]
            for name in KEPT_DIRECTIONS
            if found.errors[name] <= accuracy / 20
        }
    top, *_ = _estimated_points(curve)
    return CheckedCurve(
        replace(curve.used[top], error=curve.errors[points[top].omega]), points, curve.errors
    )


def _first_curve(
    family: Family,
    omegas: Sequence[float],
    settings: Settings,
    accuracy: float,
) -> _Curve:
    """All points with the settings that points commonly need, none of them judged.

    Raises:
        InputError: no frequencies, or an accuracy that is none.
        NotSolvedError: no point converged.
    """
    if not len(omegas):
        raise InputError("omegas: none given, expected at least one circular frequency")
    if not 0 < accuracy < 1:
        raise InputError(
            f"accuracy {accuracy}: expected a relative error above 0 and below 1, such as 0.02"
        )
    options = solver_options(accuracy)
    settings = _first_settings(family, with_excited_harmonics(family, settings), accuracy)
    points = list(
        response(
            family_member(family, settings).model,
            omegas,
            settings.harmonics,
            settings.samples,
            options=options,
        )
    )
    if not any(p.converged for p in points):
        raise NotSolvedError(
            f"none of {len(points)} frequencies was solved; the first stopped because: "
            f"{points[0].reason}"
        )
    used = [settings] * len(points)
    return _Curve(
        family,
        options,
        accuracy,
        points,
        heights_of(points),
        used,
        left_out_motion(family, used, points),
        {},
        set(),
    )


def _first_wrong(
    curve: _Curve,
    limit: float,
    final: set[int],
) -> int | None:
    """The first judged point whose error [m] exceeds a limit, and which may still be refined."""
    for i in _estimated_points(curve):
        error = curve.errors[curve.points[i].omega] * curve.heights[i]
        if error > limit and i not in final:
            return i
    return None


def _first_settings(
    family: Family,
    settings: Settings,
    accuracy: float,
) -> Settings:
    """What all points are solved with; where contacts may lift off, few harmonics lead the way for
    more.

    With few modes the way may end on another of two solutions there, which were 0.17 % of the peak
    apart.
    """
    fine, coarse = (
        likely_settings(family, settings, error)
        for error in (accuracy, max(accuracy, FIRST_SWEEP_ACCURACY))
    )
    model = family_member(family, fine).model
    if model.loads_prescribed:
        return fine
    led = replace(fine, harmonics=coarse.harmonics, samples=coarse.samples)
    return (
        enriched_settings(led, "modes") or led
        if accuracy < FIRST_SWEEP_ACCURACY and "modes" in led.chosen
        else led
    )


def _estimated_points(curve: _Curve) -> Iterator[int]:
    """Numbers of the points whose error is estimated: those that are checked, the peak first, then
    others that show it.
    """
    places = {p.omega: i for i, p in enumerate(curve.points)}
    for point in points_to_check(curve.points, curve.heights, curve.moved, curve.accuracy):
        i = places[point.omega]
        if point.omega not in curve.errors:
            curve.errors[point.omega] = total_error(curve.family, curve.used[i], point).total
        _confirm_prediction(curve, i)
        yield i
    for i in sorted(places[omega] for omega in curve.errors):
        _confirm_prediction(curve, i)
        yield i


def _confirm_prediction(curve: _Curve, i: int) -> None:
    """Judge a point that was predicted to be too wrong.

    Where it is more wrong than that, so are all the others of the same settings; less goes for its
    neighbours only: an error that changes its sign along the curve vanishes somewhere.
    """
    point = curve.points[i]
    estimate = curve.errors[point.omega]
    if point.omega not in curve.predicted or estimate * curve.heights[i] <= curve.limit:
        return
    true = total_error(curve.family, curve.used[i], point).total
    for j, other in enumerate(curve.points):
        alike = (
            other.omega in curve.predicted and curve.used[j] == curve.used[i] and np.isfinite(true)
        )
        if alike and (true > estimate or abs(j - i) <= REPRESENTED_NEIGHBOURS):
            curve.errors[other.omega] *= max(true / estimate, MIN_REDUCTION)
    curve.errors[point.omega] = true
    curve.predicted.discard(point.omega)


def _refine_point(
    curve: _Curve,
    at: int,
    better: Settings,
    found: Indicators,
) -> None:
    """Solve a point with better settings, and its neighbours of the same settings as far as that
    changes them.

    Where two steps of the harmonics at once are a matter of few points, one does next to them.
    """
    old = curve.used[at]
    limit = curve.limit
    between = _single_step(curve.used[at], better)
    first: list[tuple[Solution, np.ndarray]] = []
    changed = {at: _replace_point(curve, at, better, first)}
    for side in (range(at + 1, len(curve.points)), range(at - 1, -1, -1)):
        unchanged = 0
        gained = first.copy()
        settings = better
        for i in side:
            if curve.used[i] != old or unchanged == UNCHANGED_NEIGHBOURS:
                break
            changed[i] = _replace_point(curve, i, settings, gained)
            unchanged = unchanged + 1 if changed[i] <= limit else 0
            if between and settings == better and changed[i] <= ONE_STEP * limit:
                settings = between
                gained = []
    raised = sorted(i for i in changed if curve.used[i] != old)
    before = curve.moved.copy()
    curve.moved[raised] = left_out_motion(
        curve.family, [curve.used[i] for i in raised], [curve.points[i] for i in raised]
    )
    if _same_model(old, better):
        solved = {i: changed[i] for i in raised if changed[i] < np.inf and curve.used[i] == better}
        _predict_errors(curve, (old, better), solved, before, found)


def _single_step(old: Settings, better: Settings) -> Settings | None:
    """With one step of the harmonics in place of two."""
    H = 2 * old.harmonics + 1
    if better.harmonics <= H:
        return None
    samples = better.samples * (H + 1) // (better.harmonics + 1)
    return replace(better, harmonics=H, samples=max(old.samples, samples))


def _predict_errors(
    curve: _Curve,
    settings: tuple[Settings, Settings],
    changed: dict[int, float],
    before: np.ndarray,
    found: Indicators,
) -> None:
    """The error of points that took more harmonics, from what these changed [m]; no richer model is
    solved.

    What is still left out changes a point by as much of the motion that `left_out_motion` gives as
    it did where it did most.

    Args:
        settings: the former and the present ones.
        before: what `left_out_motion` gave for all points with the former ones.
        found: what the former ones were wrong by, at one of the points.
    """
    places = sorted(changed)
    if not places or not 0 < found.errors["harmonics"] < np.inf or not np.isfinite(found.total):
        return
    old, new = settings
    samples = found.errors["samples"] * (max(old.samples, 1) / max(new.samples, 1)) ** 2
    by_harmonics = found.errors["harmonics"] / (
        found.errors["harmonics"] + found.errors["samples"] - samples
    )
    rest = found.total - found.errors["harmonics"] - found.errors["samples"] + samples
    most = by_harmonics * max(changed[i] / curve.heights[i] / max(before[i], TINY) for i in places)
    for i in places:
        curve.errors[curve.points[i].omega] = float(rest + most * curve.moved[i])
        curve.predicted.add(curve.points[i].omega)


def _replace_point(
    curve: _Curve,
    i: int,
    better: Settings,
    gained: list[tuple[Solution, np.ndarray]],
) -> float:
    """Put the point of better settings in place of the present one; the distance of their first
    harmonics [m].

    Args:
        gained: the neighbours that were changed before, and what that added to their displacements:
            its curve is added to the start, but for harmonics where contacts lift off; and this
            point to the list.
    """
    old = curve.points[i]
    settings = curve.used[i]
    poor = family_member(curve.family, settings)
    rich = family_member(curve.family, better)
    if _same_model(settings, better) and old.converged and sticks_safely(poor.model, old):
        return 0.0
    carried_over = carried_displacements(old.w, poor, rich, better.harmonics)
    smooth = gained and not (old.states["lift"] and _same_model(settings, better))
    start = replace(
        old, w=carried_over + _expected_change(gained, old.omega) if smooth else carried_over
    )
    new = solve_from(
        rich.model,
        old.omega,
        better.harmonics,
        better.samples,
        [start, *(neighbour for neighbour, _ in gained[-1:])],
        curve.options,
    )
    if old.converged and not new.converged:
        return np.inf
    # a point that sticks throughout is solved with the excited harmonics alone
    gained.append((new, match_harmonics(new.w, better.harmonics) - carried_over))
    curve.points[i] = new
    curve.used[i] = better
    curve.heights[i] = size(new) if new.converged else 0.0
    curve.errors.pop(old.omega, None)
    curve.predicted.discard(old.omega)
    if not old.converged:
        return np.inf
    orders = judged_orders(rich.model)
    return float(np.linalg.norm(new.probe[orders, 0] - old.probe[orders, 0]))


def _expected_change(gained: list[tuple[Solution, np.ndarray]], omega: float) -> np.ndarray:
    """The curve through the last of them."""
    at = np.array([p.omega for p, _ in gained[-PREDICTOR_POINTS:]])
    known = np.array([w for _, w in gained[-PREDICTOR_POINTS:]])
    result = np.empty(known.shape[1:])
    flat = (len(known), -1, known.shape[-1])
    extrapolate_solution(omega, known.reshape(flat), at, len(known), result.reshape(flat[1:]))
    return result


def _same_model(one: Settings, other: Settings) -> bool:
    """Whether they differ in harmonics and samples at most, so that what sticks with one sticks
    with the other.
    """
    return (one.modes, one.points, one.damper) == (other.modes, other.points, other.damper)

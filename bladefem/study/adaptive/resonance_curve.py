"""A response curve whose settings hold at its resonance, and what its other points are wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...errors import NotSolvedError
from ...hbm.band_path import USUAL_LIMITS, PathLimits
from ...hbm.peak import Peak
from ...hbm.solution import Solution, lifts_off, mostly_lifts_off, size
from ...hbm.sweep import MAX_PATH_UNKNOWNS
from .band_sweep import covered_band, solver_options
from .branch_choice import peak_error
from .cheaper_settings import PYTHON_OPERATIONS, cheaper_settings
from .check_points import (
    CHECKED_HEIGHT_SHARES,
    MAX_CHECKED_PEAKS,
    MIN_SHARE_OF_ACCURACY,
    heights_of,
    lasting_peak,
    left_out_motion,
    peak_of,
)
from .checked_curve import CheckedCurve
from .choice_in_time import March, choose_in_time, marched_widely
from .family import Family, family_member, with_excited_harmonics
from .indicators import moved_solution, richer_settings
from .peak_errors import (
    JUDGE_STEPS,
    OVERTONES,
    PeakErrors,
    compared_settings,
    judge_settings,
    peak_from,
)
from .resonance_choice import (
    FAR_BEYOND,
    choose_at_peak,
    has_final_harmonics,
    lacks_harmonics_for_lift_off,
    settings_of_lift_off,
)
from .settings import Settings, enriched_settings, same_settings
from .stiff_layer import climbed_to, settings_of_stiff_layer, softened_where_lifting

# of the accuracy: to which a sweep closes in its maxima
MAXIMUM_SHARE = 0.1
# sweeps of one curve with ever richer settings
MAX_SWEEPS = 3
# steps of the harmonics that points beside the peak may ask for, one after the other or at once
MISSED_STEPS = 2
# share of a resonance with poor settings below which richer ones, whose points were not solved
# there, have lost it: their highest solved point is then another one beside it
LOST_HEIGHT_SHARE = 0.5
# folds or points of a curve from which it is given up: many folds are mostly those of few samples
# and contact points, and it is followed with more of both (docs/verification.md, "Limits of marches
# and balances")
MANY_FOLDS = 6
MANY_POINTS = 100
FOLDED_SAMPLES = 256
FOLDED_POINTS = 16
# samples at most of a curve that is followed round folds, where they take no longer than Python
# does: each of them may make a fold (seed 67 of benchmarks/choice_random.py: 780 points with 96
# samples, 251 with 512, each in less time)
FREE_SAMPLES = 512


def resonance_curve(
    family: Family,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
    march: March | None = None,
    fixed: tuple[str, ...] = (),
) -> CheckedCurve:
    """A swept curve with settings that hold the height of its peak to half the accuracy.

    A rough sweep finds the peak, the settings are chosen there, and the curve is swept with them.
    It is swept again where that shows a higher peak, or points that lack harmonics, with settings
    that are no poorer. What its highest point differs by from the peak chosen at is counted.

    Args:
        settings: where the choice begins, for example those of a neighbouring load.
        band: [Hz]; round the resonances when None.
        march: what the blade keeps to after a motion, by which harmonics are chosen where most
            contacts lift off; richer balances tell them when None.
        fixed: names that the choice at the peak may not change although they are not the user's,
            such as modes; what lift-off, folds and flanks ask for is taken all the same.

    Raises:
        NotSolvedError: no point converged.
    """
    rough = _rough_curve(family, settings, band, mode)
    settings, points = _with_stiff_layer(family, *rough, band, mode, accuracy)
    used, top = settings, peak_of(points)
    swept = settings, 1.0
    notes: list[str] = []
    left = MISSED_STEPS
    for number in range(MAX_SWEEPS):
        used, peak, errors = _chosen(family, used, top, accuracy, number == 0, fixed, march)
        asked = _asks_for_harmonics(used, top, errors, march)
        if number == 0 and asked and same_settings(used, settings):
            chosen = used, peak, errors
            used, peak, errors = _with_missed(family, points, top, accuracy, fixed, chosen)
        used, peak = _with_free_samples(family, used, peak, points, accuracy)
        if swept[1] != accuracy or not same_settings(swept[0], used):
            finer = _with_fewer_folds(used, peak) if number == 0 else None
            limits = USUAL_LIMITS if finer is None else PathLimits(MANY_FOLDS, MANY_POINTS)
            points = _swept(family, used, points, swept, band, mode, accuracy, notes, limits)
            swept = used, accuracy
            if finer is not None and limits.given_up(points):
                used, top = _refined_top(family, used, peak_of(points), finer, accuracy)
                # it was given up, and is swept again in any case
                swept = used, 1.0
                continue
        points = _with_peak(points, peak)
        top = _resonance(family, used, points)
        if used.error is not None and used.error > FAR_BEYOND * accuracy:
            # the flanks of a peak that is far from right need no look of their own
            return CheckedCurve(used, points, {top.omega: used.error}, tuple(notes), _parts(errors))
        used, higher = _judged_top(family, used, peak, points, top, accuracy)
        significant = _checked_significant(family, used, points, top, accuracy) if asked else {}
        found = significant | _checked_flanks(family, used, points, top, errors)
        missed = _harmonics_missed(family, used, points, top, significant, accuracy, left)
        if number == MAX_SWEEPS - 1 or (missed is None and not higher):
            break
        left -= _steps_of_harmonics(used, missed or used)
        used = missed or used
    return CheckedCurve(used, points, found, tuple(notes), _parts(errors))


def _asks_for_harmonics(
    settings: Settings,
    top: Solution,
    errors: PeakErrors | None,
    march: March | None,
) -> bool:
    """Points beside the peak may ask for more harmonics: what these leave out no march has
    reported, and they may be refined.
    """
    in_time = marched_widely(march, settings, top) if errors is None else errors.in_time
    return not in_time and not has_final_harmonics(settings)


def _rough_curve(
    family: Family,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
) -> tuple[Settings, list[Solution]]:
    """A rough sweep, and the settings that it was made with: others than those given where contacts
    lift off at its peak and ask for them, unless that peak is lost with them.
    """
    settings = with_excited_harmonics(family, replace(settings, error=None))
    points = covered_band(family_member(family, settings).model, settings, band, mode, 1.0)
    top = peak_of(points)
    suited = _suited_to_lift_off(family, settings, top)
    if suited == settings:
        return settings, points
    richer = covered_band(family_member(family, suited).model, suited, band, mode, 1.0)
    return (settings, points) if _is_lost(top, richer) else (suited, richer)


def _with_stiff_layer(
    family: Family,
    settings: Settings,
    points: list[Solution],
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
) -> tuple[Settings, list[Solution]]:
    """A rough curve with the settings that a softened stiff layer asks for; as it was where their
    resonance is not found.

    A sweep comes to it from below, where contacts keep closed, and its points serve the curve: the
    way from few harmonics at the resonance takes up to 3.7 s with stiff layers on the shipped wedge
    under 80 N.
    """
    top = peak_of(points)
    richer = settings_of_stiff_layer(family, settings, top)
    if richer == settings:
        return settings, points
    found = covered_band(family_member(family, richer).model, richer, band, mode, 1.0)
    if not _is_lost(top, found):
        return richer, found
    climbed = climbed_to(family, settings, top, richer, accuracy)
    if climbed is None:
        return settings, points
    return richer, sorted([*found, climbed], key=lambda p: p.omega)


def _is_lost(top: Solution, points: Sequence[Solution]) -> bool:
    """No point is nearly as high as a resonance, and one next to its frequency was not solved."""
    omegas = np.array([p.omega for p in points])
    place = int(np.searchsorted(omegas, top.omega))
    beside = points[max(0, place - 1) : place + 1]
    low = size(peak_of(points)) < LOST_HEIGHT_SHARE * size(top)
    return low and not all(p.converged for p in beside)


def _parts(errors: PeakErrors | None) -> Mapping[str, float]:
    """Relative changes of the height of a peak, by respect; none where it was not judged."""
    return {} if errors is None else errors.height


def _suited_to_lift_off(family: Family, settings: Settings, top: Solution) -> Settings:
    """Settings for contacts that lift off at the resonance, where they do."""
    softer = softened_where_lifting(family, settings, top)
    return (
        settings_of_lift_off(softer, top) if lacks_harmonics_for_lift_off(settings, top) else softer
    )


def _swept(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    swept: tuple[Settings, float],
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
    notes: list[str],
    limits: PathLimits = USUAL_LIMITS,
) -> list[Solution]:
    """The curve with chosen settings, over the band of the points that an earlier sweep solved.

    Args:
        swept: settings and accuracy of that one.
        notes: takes what the sweep could not do.
        limits: folds and points after which following the paths is given up.
    """
    span = band or (points[0].frequency, points[-1].frequency)
    paths = not too_large_to_follow(family, settings)
    # paths are followed anew
    again = any(p.branch for p in points) or not _same_points(swept, (settings, accuracy))
    model = family_member(family, settings).model
    known = [] if again else points
    return covered_band(
        model,
        settings,
        span,
        mode,
        accuracy,
        band is None,
        paths,
        notes,
        known,
        limits,
        similar=points,
    )


def _with_free_samples(
    family: Family,
    settings: Settings,
    peak: Peak | None,
    points: Sequence[Solution],
    accuracy: float,
) -> tuple[Settings, Peak | None]:
    """More samples, and the peak with them, where the curve will be followed round folds and they
    take no longer than Python does; the same as before where that peak is not found.
    """
    lifts = any(lifts_off(p) for p in points if p.converged)
    open_samples = "samples" in settings.chosen and settings.samples > 0
    if peak is None or not (lifts and open_samples) or too_large_to_follow(family, settings):
        return settings, peak
    model = family_member(family, settings).model
    each = model.unknowns(settings.harmonics) * model.directions
    samples = settings.samples
    while 2 * samples <= FREE_SAMPLES and 2 * samples * each <= PYTHON_OPERATIONS:
        samples *= 2
    if samples == settings.samples:
        return settings, peak
    finer = replace(settings, samples=samples)
    try:
        return finer, peak_from(family, settings, peak, finer, accuracy, fallbacks=False)
    except NotSolvedError:
        return settings, peak


def _with_fewer_folds(settings: Settings, peak: Peak | None) -> Settings | None:
    """Settings with more samples and contact points, where folds of a curve may be of too few of
    them; None where they are the user's, no fewer, or most contacts lift off, whose folds are real.
    """
    if peak is None or mostly_lifts_off(peak.solution):
        return None
    finer = settings
    if "samples" in settings.chosen and settings.samples:
        finer = replace(finer, samples=max(settings.samples, FOLDED_SAMPLES))
    if "points" in settings.chosen and settings.points is not None:
        finer = replace(finer, points=max(settings.points, FOLDED_POINTS))
    return None if finer == settings else finer


def _refined_top(
    family: Family,
    settings: Settings,
    top: Solution,
    finer: Settings,
    accuracy: float,
) -> tuple[Settings, Solution]:
    """Finer settings and the peak with them; the same as before where it is not found."""
    try:
        peak = peak_from(family, settings, top, finer, accuracy, fallbacks=False)
    except NotSolvedError:
        return settings, top
    return finer, peak.solution


def _with_missed(
    family: Family,
    points: Sequence[Solution],
    top: Solution,
    accuracy: float,
    fixed: tuple[str, ...],
    chosen: tuple[Settings, Peak | None, PeakErrors | None],
) -> tuple[Settings, Peak | None, PeakErrors | None]:
    """The choice with the harmonics that points of the rough sweep lack, where the curve will be
    followed round folds: sweeping it twice costs far more than these points.
    """
    settings = chosen[0]
    lifts = any(lifts_off(p) for p in points if p.converged)
    if not lifts or too_large_to_follow(family, settings):
        return chosen
    significant = _checked_significant(family, settings, points, top, accuracy)
    richer = _harmonics_missed(family, settings, points, top, significant, accuracy, 1)
    if richer is None:
        return chosen
    return _chosen(family, richer, top, accuracy, lower=False, fixed=fixed)


def _resonance(family: Family, settings: Settings, points: Sequence[Solution]) -> Solution:
    """The highest point; where the curve was followed round folds, the highest that is not
    unstable.

    A damper that bounces has motions that no blade keeps: in a march they fall to a third.
    """
    if any(p.branch for p in points):
        return lasting_peak(family_member(family, settings).model, points)
    return peak_of(points)


def _judged_top(
    family: Family,
    settings: Settings,
    peak: Peak | None,
    points: Sequence[Solution],
    top: Solution,
    accuracy: float,
) -> tuple[Settings, bool]:
    """Settings with the error of the resonance of the curve, and whether it lies too high above
    the peak that they were chosen at to hold there.

    A lower rise is counted in the error: random models have such points 0.2 to 0.6 % above a peak
    that was closed in on a shoulder, with estimates of 0.1 % there. Where the curve was followed
    round folds, the peak of a richer model is followed as well, and only what a sweep leaves of its
    maxima is counted; that the settings hold is known then.
    """
    if settings.error is None or peak is None:
        return settings, False
    rise = size(top) / peak.height - 1
    if rise > accuracy / 2 and top.branch:
        error = peak_error(family, settings, points, top)
        if error <= accuracy / 2:
            return replace(settings, error=error + accuracy * MAXIMUM_SHARE), False
    return replace(settings, error=settings.error + abs(rise)), rise > accuracy / 2


def _same_points(one: tuple[Settings, float], other: tuple[Settings, float]) -> bool:
    """Sweeps with two settings and accuracies solve the same points, and equally well."""
    return same_settings(one[0], other[0]) and solver_options(one[1]) == solver_options(other[1])


def too_large_to_follow(family: Family, settings: Settings) -> bool:
    """The balance has too many unknowns for following its motions round folds in a curve of many
    points.
    """
    return family_member(family, settings).model.unknowns(settings.harmonics) > MAX_PATH_UNKNOWNS


def _chosen(
    family: Family,
    settings: Settings,
    top: Solution,
    accuracy: float,
    lower: bool,
    fixed: tuple[str, ...],
    march: March | None = None,
) -> tuple[Settings, Peak | None, PeakErrors | None]:
    """Settings that hold at the peak next to a point; the same with an unknown error where that
    peak was not closed in.

    Args:
        lower: they may become poorer where not all is needed.
        fixed: names that may not be changed.
    """
    try:
        peak = peak_from(family, settings, top, settings, accuracy)
        if march is not None and marched_widely(march, settings, peak.solution):
            choice = choose_in_time(family, settings, peak, accuracy, march, fixed)
            if choice is not None:
                return choice
        enough = choose_at_peak(family, settings, peak, accuracy, fixed)
        # points of a softened layer are swept already with what is chosen
        cheaper = lower and not settings.softened
        return cheaper_settings(family, *enough, accuracy) if cheaper else enough
    except NotSolvedError:
        return replace(settings, error=np.inf), None, None


def _with_peak(points: list[Solution], peak: Peak | None) -> list[Solution]:
    """The points with the peak that was found by its slope, if it is none of them."""
    if peak is None or any(p.omega == peak.omega for p in points):
        return points
    return sorted([*points, peak.solution], key=lambda p: p.omega)


def _checked_flanks(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
    errors: PeakErrors | None,
) -> dict[float, float]:
    """Circular frequency -> estimated relative error: of the peak, and of one point on each flank
    for each of CHECKED_HEIGHT_SHARES of its height.

    A flank is judged in the respect that is worst at the peak, as far from the peak of the richer
    present model from its own.
    """
    found = {top.omega: np.inf if settings.error is None else settings.error}
    if errors is None or not errors.better:
        return found
    worst = max(errors.better, key=lambda name: errors.needs[name])
    other = judge_settings(family, settings, worst, top)
    if other is None:
        return found
    shift = errors.better[worst].omega / top.omega
    for point in _flanks(points, heights_of(points), top):
        found[point.omega] = _change(family, settings, point, other, worst, shift, top)
    return found


def _checked_significant(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
    accuracy: float,
) -> dict[float, float]:
    """Circular frequency -> estimated relative error by more harmonics, among the MAX_CHECKED_PEAKS
    points where harmonics that were left out move the contacts most; where there is one motion, of
    those that are no neighbours of each other, and not at the resonance, which was judged.
    """
    alike = _has_one_motion(family, settings)
    share = heights_of(points) / size(top)
    significant = left_out_motion(family, [settings] * len(points), points) * share
    order = np.argsort(-significant)[:MAX_CHECKED_PEAKS]
    kept: list[int] = []
    for i in order[significant[order] > MIN_SHARE_OF_ACCURACY * accuracy].tolist():
        known = points[i] is top or any(abs(i - j) == 1 for j in kept)
        if points[i].converged and not (alike and known):
            kept.append(i)
    chosen = [points[i] for i in kept]
    other = richer_settings(family, settings, "harmonics")
    if other is None:
        return {}
    return {p.omega: _change(family, settings, p, other, "harmonics", 1.0, p) for p in chosen}


def _flanks(
    points: Sequence[Solution],
    heights: np.ndarray,
    top: Solution,
) -> list[Solution]:
    """The points on each side of the peak whose heights are nearest to CHECKED_HEIGHT_SHARES of
    it.
    """
    omegas = np.array([p.omega for p in points])
    chosen = []
    for side in (omegas < top.omega, omegas > top.omega):
        good = np.flatnonzero(side & (heights > 0))
        for share in CHECKED_HEIGHT_SHARES if len(good) else ():
            chosen.append(good[np.argmin(abs(heights[good] - share * size(top)))])
    return [points[i] for i in dict.fromkeys(chosen)]


def _change(
    family: Family,
    settings: Settings,
    point: Solution,
    other: Settings,
    name: str,
    shift: float,
    largest: Solution,
) -> float:
    """Relative change of the amplitude in a model that is richer in the respect of this name, at a
    frequency shifted by a factor; infinite where that is not solved, or too large to be.

    Args:
        largest: whose contacts tell how large a model may be; of a flank those of the resonance,
            which that model judged (11 900 unknowns in place of 6000 took half of a curve's time
            under 190 N on an imported wedge).
    """
    pair = compared_settings(family, settings, other, name, largest)
    if pair is None:
        return np.inf
    own, judge, factor = pair
    options = replace(solver_options(1e-2), fallbacks=False, iterations=JUDGE_STEPS)
    base = point if own == settings else moved_solution(family, settings, point, own, options)
    if not base.converged:
        return np.inf
    better = moved_solution(family, own, replace(base, omega=base.omega * shift), judge, options)
    return factor * abs(size(base) / size(better) - 1) if better.converged else np.inf


def _harmonics_missed(
    family: Family,
    settings: Settings,
    points: Sequence[Solution],
    top: Solution,
    significant: Mapping[float, float],
    accuracy: float,
    most: int,
) -> Settings | None:
    """Settings with more harmonics where significant points away from the peak are wrong beyond
    their tolerance, with as many as these points ask for; None where all hold, or harmonics are not
    to be chosen.

    Args:
        most: steps of the harmonics that are taken at once.
    """
    if "harmonics" not in settings.chosen:
        return None
    wrong = [
        point
        for point in points
        if point is not top
        and np.isfinite(significant.get(point.omega, np.inf))
        and significant[point.omega] > _tolerated(point, top, accuracy)
    ]
    followed = any(point.branch for point in points)
    # where there may be several motions, more are asked for by the points of the next curve only
    most = most if _has_one_motion(family, settings) else min(most, 1)
    richer = _next_for_flanks(settings, followed) if wrong and most > 0 else None
    for _ in range(most - 1):
        more = None if richer is None else _next_for_flanks(richer, followed)
        if richer is None or more is None:
            break
        if _all_hold(family, settings, richer, wrong, top, accuracy):
            break
        richer = more
    return richer


def _has_one_motion(family: Family, settings: Settings) -> bool:
    """No normal load follows the motion, which makes several motions at one frequency."""
    model = family_member(family, settings).model
    return model.directions == model.elements.tangents


def _next_for_flanks(settings: Settings, followed: bool) -> Settings | None:
    """One step of the harmonics, to OVERTONES before any more; None where there is none.

    Args:
        followed: the curve is followed round folds, which beyond OVERTONES takes longer than all
            else: 42 s in place of 10 for one flank (seed 105 of benchmarks/choice_random.py).
    """
    richer = enriched_settings(settings, "harmonics")
    if richer is None or richer.harmonics <= OVERTONES:
        return richer
    if settings.harmonics < OVERTONES:
        return replace(richer, harmonics=OVERTONES)
    return None if followed else richer


def _steps_of_harmonics(poorer: Settings, richer: Settings) -> int:
    """How many steps of `_next_for_flanks` lie between two numbers of harmonics."""
    steps = 0
    while poorer.harmonics < richer.harmonics:
        poorer = _next_for_flanks(poorer, False) or richer
        steps += 1
    return steps


def _tolerated(point: Solution, top: Solution, accuracy: float) -> float:
    """Relative error of a point that is the accuracy of the peak."""
    return accuracy * size(top) / max(size(point), 1e-6 * size(top))


def _all_hold(
    family: Family,
    settings: Settings,
    richer: Settings,
    points: Sequence[Solution],
    top: Solution,
    accuracy: float,
) -> bool:
    """None of the points is known to be wrong beyond its tolerance with richer settings: a sweep
    with these costs far more than the points.
    """
    other = richer_settings(family, richer, "harmonics")
    if other is None:
        return True
    options = replace(solver_options(1e-2), fallbacks=False, iterations=JUDGE_STEPS)
    for point in points:
        moved = moved_solution(family, settings, point, richer, options)
        if not moved.converged:
            continue
        error = _change(family, richer, moved, other, "harmonics", 1.0, moved)
        if np.isfinite(error) and error > _tolerated(moved, top, accuracy):
            return False
    return True

"""A response curve whose settings hold at its resonance, and what its other points are wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...errors import NotSolvedError
from ...hbm.band_path import USUAL_LIMITS, PathLimits
from ...hbm.peak import Peak
from ...hbm.solution import Solution, lifts_off, size
from .band_sweep import covered_band, solver_options
from .branch_choice import peak_error
from .cheaper_settings import cheaper_settings
from .check_points import (
    lasting_peak,
    peak_of,
)
from .checked_curve import CheckedCurve
from .choice_in_time import March, choose_in_time, marched_widely
from .family import Family, family_member, with_excited_harmonics
from .flank_checks import checked_flanks, checked_significant, harmonics_missed, steps_of_harmonics
from .followed_settings import (
    MANY_FOLDS,
    MANY_POINTS,
    refined_top,
    too_large_to_follow,
    with_fewer_folds,
    with_free_samples,
)
from .peak_errors import (
    PeakErrors,
    peak_from,
)
from .resonance_choice import (
    FAR_BEYOND,
    choose_at_peak,
    has_final_harmonics,
    lacks_harmonics_for_lift_off,
    settings_of_lift_off,
)
from .settings import Settings, same_settings
from .stiff_layer import climbed_to, settings_of_stiff_layer, softened_where_lifting

# of the accuracy: to which a sweep closes in its maxima
MAXIMUM_SHARE = 0.1
# sweeps of one curve with ever richer settings
MAX_SWEEPS = 3
# steps of the harmonics that points of the sweeps may ask for beside the peak, one after the other
# or at once, beyond the one that those of the rough sweep may ask for
MISSED_STEPS = 2
# share of a resonance with poor settings below which richer ones, whose points were not solved
# there, have lost it: their highest solved point is then another one beside it
LOST_HEIGHT_SHARE = 0.5


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
    swept, left = (settings, 1.0), MISSED_STEPS
    notes: list[str] = []
    for number in range(MAX_SWEEPS):
        begun = settings if number == 0 else None
        (used, peak, errors), asked = _chosen_for_curve(
            family, used, begun, points, top, accuracy, fixed, march
        )
        if swept[1] != accuracy or not same_settings(swept[0], used):
            finer = with_fewer_folds(used, peak) if number == 0 else None
            limits = USUAL_LIMITS if finer is None else PathLimits(MANY_FOLDS, MANY_POINTS)
            points = _swept(family, used, points, swept, band, mode, accuracy, notes, limits)
            swept = used, accuracy
            if finer is not None and limits.given_up(points):
                used, top = refined_top(family, used, peak_of(points), finer, accuracy)
                # it was given up, and is swept again in any case
                swept = used, 1.0
                continue
        points = _with_peak(points, peak)
        top = _resonance(family, used, points)
        if used.error is not None and used.error > FAR_BEYOND * accuracy:
            # the flanks of a peak that is far from right need no look of their own
            return CheckedCurve(used, points, {top.omega: used.error}, tuple(notes), _parts(errors))
        used, higher = _judged_top(family, used, peak, points, top, accuracy)
        significant = checked_significant(family, used, points, top, accuracy) if asked else {}
        found = significant | checked_flanks(family, used, points, top, peak, errors)
        missed = harmonics_missed(family, used, points, top, significant, accuracy, left)
        if number == MAX_SWEEPS - 1 or (missed is None and not higher):
            break
        left -= steps_of_harmonics(used, missed or used)
        used = missed or used
    return CheckedCurve(used, points, found, tuple(notes), _parts(errors))


def _chosen_for_curve(
    family: Family,
    settings: Settings,
    begun: Settings | None,
    points: Sequence[Solution],
    top: Solution,
    accuracy: float,
    fixed: tuple[str, ...],
    march: March | None,
) -> tuple[tuple[Settings, Peak | None, PeakErrors | None], bool]:
    """Settings that hold at the peak, with what a sweep needs beyond; and whether points beside the
    peak may ask for more harmonics.

    Args:
        begun: settings of the rough sweep, whose points these are; None after it.
    """
    chosen = _chosen(family, settings, top, accuracy, begun is not None, fixed, march)
    asked = _asks_for_harmonics(chosen[0], top, chosen[2], march)
    if begun is not None and asked and same_settings(chosen[0], begun):
        chosen = _with_missed(family, points, top, accuracy, fixed, chosen)
    used, peak, errors = chosen
    used, peak = with_free_samples(family, used, peak, points, accuracy)
    return (used, peak, errors), asked


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
    try:
        richer = covered_band(family_member(family, suited).model, suited, band, mode, 1.0)
    except NotSolvedError:
        # no point converged
        return settings, points
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
    found: list[Solution] = []
    try:
        found = covered_band(family_member(family, richer).model, richer, band, mode, 1.0)
        if not _is_lost(top, found):
            return richer, found
    except NotSolvedError:
        # no point converged
        pass
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
    significant = checked_significant(family, settings, points, top, accuracy)
    richer = harmonics_missed(
        family, settings, points, top, significant, accuracy, 1, followed=True
    )
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

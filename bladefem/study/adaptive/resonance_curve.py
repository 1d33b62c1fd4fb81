"""A response curve whose settings hold at its resonance, and what its other points are wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

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
from .family import Family, family_member
from .flank_checks import checked_flanks, checked_significant, harmonics_missed, steps_of_harmonics
from .followed_settings import (
    MANY_FOLDS,
    MANY_POINTS,
    free_samples,
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
)
from .rough_curve import rough_curve
from .settings import Settings, same_settings

# of the accuracy: to which a sweep closes in its maxima
MAXIMUM_SHARE = 0.1
# sweeps of one curve with ever richer settings
MAX_SWEEPS = 3
# steps of the harmonics that points of the sweeps may ask for beside the peak, one after the other
# or at once, beyond the one that those of the rough sweep may ask for
MISSED_STEPS = 2


@dataclass(frozen=True)
class _Curve:
    """What does not change while the settings of a curve are chosen."""

    family: Family
    # [Hz]; round the resonances of the mode when None
    band: tuple[float, float] | None
    mode: int
    accuracy: float
    # what the blade keeps to after a motion; None: richer balances tell the harmonics
    march: March | None
    # names that the choice at the peak may not change
    fixed: tuple[str, ...]


class _Chosen(NamedTuple):
    """Settings that hold at a peak; without peak and errors where it was not closed in."""

    settings: Settings
    peak: Peak | None
    errors: PeakErrors | None


class _Sweep(NamedTuple):
    """What a sweep was made with."""

    settings: Settings
    accuracy: float


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
    curve = _Curve(family, band, mode, accuracy, march, fixed)
    settings, points = rough_curve(family, settings, band, mode, accuracy)
    notes: list[str] = []
    points, swept = _first_sweep(curve, settings, points, notes)
    used, top, left = settings, peak_of(points), MISSED_STEPS
    for number in range(MAX_SWEEPS):
        begun = settings if number == 0 else None
        (used, peak, errors), asked = _chosen_for_curve(curve, used, begun, points, top)
        if swept.accuracy != accuracy or not same_settings(swept.settings, used):
            finer = with_fewer_folds(used, peak) if number == 0 else None
            limits = USUAL_LIMITS if finer is None else PathLimits(MANY_FOLDS, MANY_POINTS)
            points = _swept(curve, used, points, swept, notes, limits)
            swept = _Sweep(used, accuracy)
            if finer is not None and limits.given_up(points):
                used, top = refined_top(family, used, peak_of(points), finer, accuracy)
                # it was given up, and is swept again in any case
                swept = _Sweep(used, 1.0)
                continue
        points = _with_peak(points, peak)
        top = _resonance(family, used, points)
        if used.error is not None and used.error > FAR_BEYOND * accuracy:
            # the flanks of a peak that is far from right need no look of their own
            return CheckedCurve(used, points, {top.omega: used.error}, tuple(notes), _parts(errors))
        used, higher = _judged_top(curve, used, peak, points, top)
        significant = checked_significant(family, used, points, top, accuracy) if asked else {}
        missed = harmonics_missed(family, used, points, top, significant, accuracy, left)
        if number == MAX_SWEEPS - 1 or (missed is None and not higher):
            break
        left -= steps_of_harmonics(used, missed or used)
        used = missed or used
    # flanks are judged once: those of a peak that is left for a higher one say nothing
    found = significant | checked_flanks(family, used, points, top, peak, errors)
    return CheckedCurve(used, points, found, tuple(notes), _parts(errors))


def _first_sweep(
    curve: _Curve, settings: Settings, rough: list[Solution], notes: list[str]
) -> tuple[list[Solution], _Sweep]:
    """The points that the choice begins with, and how they were swept: those of the rough sweep,
    but where harmonics are final. That leads to a lower part of a flat top, whose judges take
    seconds for nothing.
    """
    begun = _Sweep(settings, 1.0)
    if not has_final_harmonics(settings):
        return rough, begun
    points = _swept(curve, settings, rough, begun, notes, USUAL_LIMITS)
    return points, _Sweep(settings, curve.accuracy)


def _chosen_for_curve(
    curve: _Curve,
    settings: Settings,
    begun: Settings | None,
    points: Sequence[Solution],
    top: Solution,
) -> tuple[_Chosen, bool]:
    """Settings that hold at the peak, with what a sweep needs beyond; and whether points beside the
    peak may ask for more harmonics.

    Args:
        begun: settings of the rough sweep, whose points these are; None after it.
    """
    chosen = _chosen(curve, settings, top, points if begun is not None else None)
    asked = _asks_for_harmonics(chosen, top, curve.march)
    if begun is not None and asked and same_settings(chosen.settings, begun):
        chosen = _with_missed(curve, points, top, chosen)
    used, peak = with_free_samples(
        curve.family, chosen.settings, chosen.peak, points, curve.accuracy
    )
    return _Chosen(used, peak, chosen.errors), asked


def _asks_for_harmonics(chosen: _Chosen, top: Solution, march: March | None) -> bool:
    """Points beside the peak may ask for more harmonics: what these leave out no march has
    reported, and they may be refined.
    """
    settings, errors = chosen.settings, chosen.errors
    in_time = marched_widely(march, settings, top) if errors is None else errors.in_time
    return not in_time and not has_final_harmonics(settings)


def _parts(errors: PeakErrors | None) -> Mapping[str, float]:
    """Relative changes of the height of a peak, by respect; none where it was not judged."""
    return {} if errors is None else errors.height


def _swept(
    curve: _Curve,
    settings: Settings,
    points: Sequence[Solution],
    before: _Sweep,
    notes: list[str],
    limits: PathLimits,
) -> list[Solution]:
    """The curve with chosen settings, over the band of the points that an earlier sweep solved.

    Args:
        before: that one.
        notes: takes what the sweep could not do.
        limits: folds and points after which following the paths is given up.
    """
    # paths are followed anew
    again = any(p.branch for p in points) or not _same_points(
        before, _Sweep(settings, curve.accuracy)
    )
    return covered_band(
        family_member(curve.family, settings).model,
        settings,
        curve.band or (points[0].frequency, points[-1].frequency),
        curve.mode,
        curve.accuracy,
        widen=curve.band is None,
        paths=not too_large_to_follow(curve.family, settings),
        notes=notes,
        known=[] if again else points,
        limits=limits,
        similar=points,
    )


def _with_missed(
    curve: _Curve, points: Sequence[Solution], top: Solution, chosen: _Chosen
) -> _Chosen:
    """The choice with the harmonics that points of the rough sweep lack, where the curve will be
    followed round folds: sweeping it twice costs far more than these points.
    """
    family, settings, accuracy = curve.family, chosen.settings, curve.accuracy
    lifts = any(lifts_off(p) for p in points if p.converged)
    if not lifts or too_large_to_follow(family, settings):
        return chosen
    significant = checked_significant(family, settings, points, top, accuracy)
    richer = harmonics_missed(
        family, settings, points, top, significant, accuracy, 1, followed=True
    )
    if richer is None:
        return chosen
    return _chosen(replace(curve, march=None), richer, top, None)


def _resonance(family: Family, settings: Settings, points: Sequence[Solution]) -> Solution:
    """The highest point; where the curve was followed round folds, the highest that is not
    unstable.

    A damper that bounces has motions that no blade keeps: in a march they fall to a third.
    """
    if any(p.branch for p in points):
        return lasting_peak(family_member(family, settings).model, points)
    return peak_of(points)


def _judged_top(
    curve: _Curve,
    settings: Settings,
    peak: Peak | None,
    points: Sequence[Solution],
    top: Solution,
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
    accuracy = curve.accuracy
    rise = size(top) / peak.height - 1
    if rise > accuracy / 2 and top.branch:
        error = peak_error(curve.family, settings, points, top)
        if error <= accuracy / 2:
            return replace(settings, error=error + accuracy * MAXIMUM_SHARE), False
    return replace(settings, error=settings.error + abs(rise)), rise > accuracy / 2


def _same_points(one: _Sweep, other: _Sweep) -> bool:
    """Two sweeps solve the same points, and equally well."""
    equally = solver_options(one.accuracy) == solver_options(other.accuracy)
    return equally and same_settings(one.settings, other.settings)


def _chosen(
    curve: _Curve, settings: Settings, top: Solution, rough: Sequence[Solution] | None
) -> _Chosen:
    """Settings that hold at the peak next to a point; the same with an unknown error where that
    peak was not closed in.

    Args:
        rough: points of the rough sweep, after which settings may become poorer where not all is
            needed; None: they may not.
    """
    family, accuracy, march, fixed = curve.family, curve.accuracy, curve.march, curve.fixed
    try:
        peak = peak_from(family, settings, top, settings, accuracy)
        if march is not None and marched_widely(march, settings, peak.solution):
            choice = choose_in_time(family, settings, peak, accuracy, march, fixed)
            if choice is not None:
                return _Chosen(*choice)
        enough = choose_at_peak(family, settings, peak, accuracy, fixed)
        # points of a softened layer are swept already with what is chosen
        if rough is None or settings.softened:
            return _Chosen(*enough)
        free = free_samples(family, enough.settings, rough) > enough.settings.samples
        held = ("samples",) if free else ()
        return _Chosen(*cheaper_settings(family, *enough, accuracy, held))
    except NotSolvedError:
        return _Chosen(replace(settings, error=np.inf), None, None)


def _with_peak(points: list[Solution], peak: Peak | None) -> list[Solution]:
    """The points with the peak that was found by its slope, if it is none of them."""
    if peak is None or any(p.omega == peak.omega for p in points):
        return points
    return sorted([*points, peak.solution], key=lambda p: p.omega)

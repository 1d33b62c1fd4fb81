"""Settings chosen by what is asked for: the height of a resonance, wherever richer models put it
(``peak_errors``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...errors import NotSolvedError
from ...hbm.full_stick import sticks_safely
from ...hbm.peak import Peak
from ...hbm.solution import Solution, lifts_off, mostly_lifts_off
from .family import (
    Family,
    family_member,
)
from .indicators import judging_harmonics
from .peak_errors import (
    MANY_HARMONICS,
    PeakErrors,
    compared_settings,
    judge_settings,
    peak_errors,
    peak_from,
    too_large,
)
from .point_choice import LIKELY_SETTINGS, likely_settings
from .settings import DIRECTIONS, Settings, enriched_settings

# enrichments of one peak before giving up
MAX_ENRICHMENTS = 8
# of the accuracy: errors that are small enough together, and one that need not be lowered
SUFFICIENT_SHARE = 0.8
NEGLIGIBLE_SHARE = 0.05
# of the sum of all errors: one that is less is not worth a richer model
MINOR_SHARE = 0.125
# of the change by harmonics: change by samples from which on it is theirs
SAMPLES_SHARE = 0.8
# of the accuracy: an error from which on a peak with lift-off is refined only while that helps
FAR_BEYOND = 4.0
# unknowns of the largest balance that is chosen; model.harmonics and contact.points may ask for
# more
LARGEST_BALANCE = 6000
# the same where contacts lift off: finer ones cost minutes a curve there
MAX_LIFTING_UNKNOWNS = 3100
# contact points of a seat with which a damper is tried first that comes off: with four, Newton's
# method takes up to twenty times as long
LIFTING_POINTS = 8
# unknowns of a balance that is small, and what it is tried with first where most contacts lift off:
# its points cost no more with these, and a second curve, for what was missing, costs as much again
SMALL_LIFTING_BALANCE = 300
LIFTING_HARMONICS = 7
LIFTING_SAMPLES = 256
# contact points of a seat below which an error that does not fall is one of too few of them
FEW_POINTS = 32


class Choice(NamedTuple):
    """Settings, the peak with them, and its estimated errors."""

    settings: Settings
    peak: Peak
    errors: PeakErrors


def choose_at_peak(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
    fixed: tuple[str, ...] = (),
    sufficient: float = SUFFICIENT_SHARE,
) -> Choice:
    """Settings whose estimated errors of height and frequency keep within a share of the accuracy,
    or the best that may be chosen.

    - Not refined is a respect whose richer model was not solved; not judged again is one whose
      error was negligible, or could not be judged where contacts lift off.
    - Where contacts lift off, refining ends once it does not halve an error far beyond the
      accuracy, unless there are few contact points; the error that the richer model still has
      counts for the poorer one as well. It goes on where the respect made richer has halved its own
      error: what is left is another respect's, which is refined next.
    - Missing harmonics come first there, several at once, and where most contacts lift off: with
      few of them more contact points lead away from the truth.

    Args:
        peak: found with `settings`.
        fixed: names that may not be changed here although they are not the user's.
        sufficient: that share.

    Raises:
        NotSolvedError: most contacts lift off, and the peak was not found with three harmonics.
    """
    known: dict[str, tuple[float, float]] = {}
    before: Choice | None = None
    settings, peak = _with_usual_settings(family, settings, peak, accuracy, fixed)
    for _ in range(MAX_ENRICHMENTS):
        given = settings.harmonics
        settings, peak = _with_harmonics_of_lift_off(family, settings, peak, accuracy)
        if settings.harmonics != given:
            # they were not judged, and others are now
            known.pop("harmonics", None)
        errors = peak_errors(family, settings, peak, accuracy, known)
        if before is not None:
            errors = _with_errors_before(errors, settings, before)
        settings = replace(settings, error=errors.total)
        found = Choice(settings, peak, errors)
        far = errors.total > FAR_BEYOND * accuracy and _lift_off(peak, errors)
        if far and before is not None and _ends_refining(settings, errors, before, fixed):
            return min(_seen_from(errors, before), found, key=lambda one: one.errors.total)
        before = found
        known = _errors_to_keep(errors, NEGLIGIBLE_SHARE * accuracy, far)
        if _near_enough(settings, errors, sufficient * accuracy):
            break
        hard = far or mostly_lifts_off(peak.solution)
        richer = _richer_choice(family, settings, peak, errors, accuracy, fixed, hard)
        if richer is None:
            break
        settings, peak = richer
    return Choice(settings, peak, errors)


def _with_usual_settings(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
    fixed: tuple[str, ...],
) -> tuple[Settings, Peak]:
    """Where a choice for a fine accuracy begins, and the peak there: with what it mostly ends at
    where contacts slip. Climbing there took three quarters of the time of small models.
    """
    finest, _ = LIKELY_SETTINGS[0]
    if settings.error is not None or accuracy > finest:
        return settings, peak
    if sticks_safely(family_member(family, settings).model, peak.solution):
        return settings, peak
    usual = likely_settings(family, settings, accuracy, fixed)
    if usual == settings:
        return settings, peak
    try:
        return usual, peak_from(family, settings, peak.solution, usual, accuracy, fallbacks=False)
    except NotSolvedError:
        return settings, peak


def _errors_to_keep(
    errors: PeakErrors,
    negligible: float,
    far: bool,
) -> dict[str, tuple[float, float]]:
    """Respect to changes of height and frequency that are not judged again: negligible ones, and
    far from the accuracy those that could not be judged.
    """
    return {
        name: (errors.height[name], errors.frequency[name])
        for name, need in errors.needs.items()
        if need <= negligible or (far and not np.isfinite(need))
    }


def _richer_choice(
    family: Family,
    settings: Settings,
    peak: Peak,
    errors: PeakErrors,
    accuracy: float,
    fixed: tuple[str, ...],
    hard: bool,
) -> tuple[Settings, Peak] | None:
    """The next settings and the peak with them; None where nothing more may be chosen, or where
    that peak was not found.

    Args:
        hard: missing harmonics come first, and Newton's method has no fallbacks.
    """
    if hard:
        first = _harmonics_first(errors, accuracy)
    else:
        first = _samples_first(family, settings, errors)
    better = _next_settings(family, settings, peak, errors, accuracy, fixed, first)
    if better is None:
        return None
    base, point = _solution_ahead(family, settings, peak, errors, better)
    try:
        return better, peak_from(family, base, point, better, accuracy, fallbacks=not hard)
    except NotSolvedError:
        return None


def _near_enough(settings: Settings, errors: PeakErrors, limit: float) -> bool:
    """The errors together keep to a limit, or harmonics are not refined further."""
    return has_final_harmonics(settings) or sum(errors.needs.values()) <= limit


def has_final_harmonics(settings: Settings) -> bool:
    """More harmonics would cost minutes on a layer that is a softer one anyway, for the same
    error.
    """
    return settings.softened and settings.harmonics >= MANY_HARMONICS


def _harmonics_first(errors: PeakErrors, accuracy: float) -> str:
    """The name of the harmonics where they are missing, else none."""
    return "harmonics" if errors.needs["harmonics"] > SUFFICIENT_SHARE * accuracy else ""


def _samples_first(family: Family, settings: Settings, errors: PeakErrors) -> str:
    """The name of the samples where they are most of what harmonics seem to change, since the model
    that judges those has more samples as well; else none.

    Seed 30 of benchmarks/choice_random.py climbed to 15 harmonics, with 64 samples, for a change of
    0.3 % that 128 samples take away.
    """
    given = family_member(family, settings).model.loads_prescribed and settings.samples > 0
    few = settings.samples < 8 * (judging_harmonics(settings.harmonics) + 1)
    changed = errors.height["harmonics"], errors.height["samples"]
    alike = np.isfinite(changed).all() and changed[1] >= SAMPLES_SHARE * changed[0]
    return "samples" if given and few and alike else ""


def _solution_ahead(
    family: Family,
    settings: Settings,
    peak: Peak,
    errors: PeakErrors,
    better: Settings,
) -> tuple[Settings, Solution]:
    """Where the search for the peak of a better model starts: at the peak that judged the harmonics
    where it has more of them, which is nearer; else at the peak itself.
    """
    ahead = errors.better.get("harmonics")
    judge = judge_settings(family, settings, "harmonics", peak.solution)
    if ahead is None or judge is None or better.harmonics <= settings.harmonics:
        return settings, peak.solution
    pair = compared_settings(family, settings, judge, "harmonics", peak.solution)
    return (settings, peak.solution) if pair is None else (pair[1], ahead.solution)


def _with_harmonics_of_lift_off(
    family: Family,
    settings: Settings,
    peak: Peak,
    accuracy: float,
) -> tuple[Settings, Peak]:
    """``settings_of_lift_off``, and the peak with them, where most contacts lift off."""
    if not lacks_harmonics_for_lift_off(settings, peak.solution):
        return settings, peak
    richer = settings_of_lift_off(settings, peak.solution)
    if richer == settings:
        return settings, peak
    try:
        # the shipped wedge under 9 N: 5 s of CPU; with fallbacks no maximum is closed in after 24
        found = peak_from(family, settings, peak.solution, richer, accuracy, fallbacks=False)
    except NotSolvedError:
        found = peak_from(family, settings, peak.solution, richer, accuracy)
    return richer, found


def settings_of_lift_off(settings: Settings, top: Solution) -> Settings:
    """More than one harmonic, and LIFTING_POINTS contact points, where these may be chosen; of a
    small balance LIFTING_HARMONICS and LIFTING_SAMPLES at once.

    Args:
        top: the point where contacts lift off.
    """
    richer = enriched_settings(settings, "harmonics") or settings
    few = richer.points is not None and richer.points < LIFTING_POINTS
    if few and "points" in richer.chosen:
        return replace(richer, points=LIFTING_POINTS)
    nodes, directions, _ = top.w.shape
    if nodes * directions * (2 * LIFTING_HARMONICS + 1) > SMALL_LIFTING_BALANCE:
        return richer
    more = max(richer.harmonics, min(LIFTING_HARMONICS, settings.most))
    richer = replace(richer, harmonics=more)
    if "samples" in richer.chosen and richer.samples:
        richer = replace(richer, samples=max(richer.samples, LIFTING_SAMPLES))
    return richer


def _seen_from(errors: PeakErrors, before: Choice) -> Choice:
    """A choice whose errors are at least those that a richer model still has, where they are known:
    a model with few harmonics may be blind to the error by its contact points.
    """
    settings, peak, own = before
    height, frequency = (
        {
            name: max(change, richer[name]) if np.isfinite(richer[name]) else change
            for name, change in poorer.items()
        }
        for poorer, richer in (
            (own.height, errors.height),
            (own.frequency, errors.frequency),
        )
    )
    seen = replace(own, height=height, frequency=frequency)
    return Choice(replace(settings, error=seen.total), peak, seen)


def _with_errors_before(errors: PeakErrors, settings: Settings, before: Choice) -> PeakErrors:
    """Errors that are not known, because the richer model was not solved, as they were before in
    the respects that have not been refined since.
    """
    kept = [
        name
        for name, change in errors.height.items()
        if not np.isfinite(change)
        and getattr(settings, name) == getattr(before.settings, name)
        and np.isfinite(before.errors.height[name])
    ]
    return replace(
        errors,
        height={**errors.height, **{name: before.errors.height[name] for name in kept}},
        frequency={**errors.frequency, **{name: before.errors.frequency[name] for name in kept}},
    )


def _ends_refining(
    settings: Settings,
    errors: PeakErrors,
    before: Choice,
    fixed: tuple[str, ...],
) -> bool:
    """Far beyond the accuracy richer models do not help, and there are enough contact points and
    harmonics.
    """
    if _few_points(settings, errors, fixed) or _few_harmonics(settings, errors, before, fixed):
        return False
    return _stalled(settings, errors, before)


def _stalled(settings: Settings, errors: PeakErrors, before: Choice) -> bool:
    """Neither all errors together nor those of the respects that were made richer have halved."""
    poorer, _, own = before
    refined = [name for name in DIRECTIONS if getattr(settings, name) != getattr(poorer, name)]
    left, had = (sum(found.height[name] for name in refined) for found in (errors, own))
    return not (errors.total <= own.total / 2 or left < had / 2)


def _few_points(settings: Settings, errors: PeakErrors, fixed: tuple[str, ...]) -> bool:
    """There are few contact points, and with more of them at most half of the contacts lift off: a
    damper that comes off as a whole gains nothing by them.
    """
    more = errors.better.get("points")
    if settings.points is None or settings.points >= FEW_POINTS or more is None:
        return False
    free = "points" in settings.chosen and "points" not in fixed
    return free and 2 * more.solution.states["lift"] <= len(more.solution.w)


def _few_harmonics(
    settings: Settings, errors: PeakErrors, before: Choice, fixed: tuple[str, ...]
) -> bool:
    """There are fewer than LIFTING_HARMONICS, and more were found where most contacts keep closed,
    with the peak before as well: the change from one harmonic to three says little of the next.

    The shipped wedge under 55 N ended with three harmonics, 143 um and an error of 27 %; it has
    160 um with an error of 2.5 %, between those of neighbouring loads.
    """
    more = errors.better.get("harmonics")
    if settings.harmonics >= LIFTING_HARMONICS or more is None:
        return False
    free = "harmonics" in settings.chosen and "harmonics" not in fixed
    return free and not any(mostly_lifts_off(p.solution) for p in (before.peak, more))


def _lift_off(peak: Peak, errors: PeakErrors) -> bool:
    """Contacts lift off at the peak, or at one of the richer models."""
    return any(lifts_off(p.solution) for p in (peak, *errors.better.values()))


def lacks_harmonics_for_lift_off(settings: Settings, top: Solution) -> bool:
    """At least half of the contacts lift off at the resonance, and there is one harmonic, which
    knows nothing of that: it may find half of the amplitude.
    """
    one = settings.harmonics == 1 and "harmonics" in settings.chosen
    return one and mostly_lifts_off(top)


def _next_settings(
    family: Family,
    settings: Settings,
    peak: Peak,
    errors: PeakErrors,
    accuracy: float,
    fixed: tuple[str, ...],
    first: str = "",
) -> Settings | None:
    """Richer in the respect that is worst; None where nothing helps.

    Args:
        first: a respect that is taken before worse ones; harmonics in large steps.
    """
    needs = {name: need for name, need in errors.needs.items() if np.isfinite(need)}
    for name in sorted(needs, key=lambda name: (name != first, -needs[name])):
        if (
            name not in settings.chosen
            or name in fixed
            or needs[name] <= max(NEGLIGIBLE_SHARE * accuracy, MINOR_SHARE * sum(needs.values()))
        ):
            continue
        large = name == first == "harmonics"
        need = np.inf if large else needs[name] / (SUFFICIENT_SHARE * accuracy)
        if name == "points" and _lift_off(peak, errors):
            # which contacts lift off converges to first order in the points, not to second
            need = need**2
        for step in (need, 1.0):
            better = enriched_settings(settings, name, step)
            if better is not None and not too_large(
                family, better, peak.solution, MAX_LIFTING_UNKNOWNS, LARGEST_BALANCE
            ):
                return better
    return None

"""Model no more than the scene needs: enrich what the indicators find too wrong until half the
tolerance is met.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...errors import NotSolvedError
from ...hbm.band_path import USUAL_LIMITS, PathLimits
from ...hbm.full_stick import sticks_safely
from ...hbm.linear_resonances import free_resonances, stuck_partners
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution, size
from ...hbm.solver.newton import Options
from ...hbm.sweep import sweep
from .branch_choice import anchor_of, peak_error
from .check_points import heights_of, lasting_peak, left_out_motion, peak_of, points_to_check
from .family import Family, family_member, with_excited_harmonics
from .indicators import Indicators, indicate_errors, moved_solution, total_error
from .settings import Settings, enriched_settings

MAX_ROUNDS = 12
# whose indicators, where they are small, outlast a change of the others
KEPT_DIRECTIONS = ("modes", "damper")
# accuracy from which, where contacts slip
LIKELY_SETTINGS = (
    (0.003, {"harmonics": 7, "samples": 256, "points": 16}),
    (0.03, {"harmonics": 3, "samples": 64, "points": 16}),
)
# sweeps of one curve with ever richer settings
MAX_SWEEPS = 3
MAX_BAND_WIDENINGS = 4
# factor by which the accuracy at a lower point is tightened at most, for a peak that is too wrong
MIN_ACCURACY_FACTOR = 0.05


@dataclass(frozen=True)
class Checked:
    """A curve whose settings were checked at some of its points."""

    # with the error estimated at the resonance
    settings: Settings
    # sorted by frequency
    points: list[Solution]
    # circular frequency of the checked points to the estimated relative error
    errors: dict[float, float]
    # what the sweep could not do, in sentences
    notes: tuple[str, ...] = ()
    # parts of the error of the resonance by what richer models change (settings.DIRECTIONS); empty
    # where they are not known one by one
    parts: Mapping[str, float] = field(default_factory=dict)


def choose_settings(
    family: Family,
    settings: Settings,
    point: Solution,
    accuracy: float,
) -> tuple[Settings, Solution, Indicators]:
    """Settings whose estimated error at one point is below half the accuracy, or the best that may
    be chosen.

    Nothing is refined because something was not solved: where a richer model of the point is not,
    its respect is left as it is, and the error is unknown (infinite).

    Args:
        point: solved with `settings`; its frequency is kept.
    """
    known: dict[str, float] = {}
    if (
        settings.error is None
        and point.converged
        and not sticks_safely(family_member(family, settings).model, point)
    ):
        usual = likely_settings(family, settings, accuracy)
        further = moved_solution(family, settings, point, usual) if usual != settings else point
        settings, point = (usual, further) if further.converged else (settings, point)
    found: Indicators
    for _ in range(MAX_ROUNDS):
        judged = total_error(family, settings, point)
        if judged is not None and judged.total <= accuracy / 2:
            found = judged
        else:
            found = indicate_errors(family, settings, point, known)
        settings = replace(settings, error=found.total)
        if found.total <= accuracy / 2:
            break
        better = next_settings(settings, found, accuracy)
        if better is None:
            break
        richer_point = _solved(family, settings, point, better, found)
        if richer_point is None or not richer_point.converged:
            break
        known = {
            name: error
            for name in KEPT_DIRECTIONS
            if (error := found.errors[name]) <= accuracy / 20
            and getattr(better, name) == getattr(settings, name)
        } | dict.fromkeys(found.unknown, np.inf)
        point = richer_point
        settings = better
    return settings, point, found


def likely_settings(
    family: Family,
    settings: Settings,
    accuracy: float,
    fixed: tuple[str, ...] = (),
) -> Settings:
    """Where a search had better begin than at its first settings: with what most points need whose
    contacts slip.
    """
    usual = next((usual for finest, usual in LIKELY_SETTINGS if accuracy <= finest), {})
    most = {"harmonics": min(settings.most, family.harmonics)}
    raised = {
        name: max(getattr(settings, name), min(value, most.get(name, value)))
        for name, value in usual.items()
        if name in settings.chosen and name not in fixed and getattr(settings, name) is not None
    }
    return replace(settings, **raised)


def _solved(
    family: Family,
    settings: Settings,
    point: Solution,
    better: Settings,
    found: Indicators,
) -> Solution:
    """The point solved with better settings, from the solution with more harmonics where there is
    one.
    """
    ahead = found.better.get("harmonics")
    return moved_solution(
        family, settings, ahead if ahead is not None and ahead.converged else point, better
    )


def next_settings(
    settings: Settings,
    found: Indicators,
    accuracy: float,
) -> Settings | None:
    """Enriched in each open respect that takes more than its share, the worst at least; None when
    nothing helps.
    """
    names = [
        name
        for name in settings.chosen
        if name not in found.unknown and found.errors.get(name, 0.0) > accuracy / 20
    ]
    names.sort(key=lambda name: -found.errors[name])
    share = accuracy / 2 / max(len(settings.chosen), 1)
    better = settings
    for name in names:
        if name == names[0] or found.errors[name] > share:
            better = enriched_settings(better, name, found.errors[name] / share) or better
    return None if better == settings else better


def adapted_settings(
    family: Family,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
) -> Checked:
    """A swept curve with settings that hold at its peak and on its flanks; swept again where they
    did not.

    The tolerated error of a point is the accuracy times the height of the peak over the height of
    the point. Where points were not solved, richer settings are asked for by the peak only, and
    used only between the nearest of them: each would cost all fallbacks again.

    Args:
        band: [Hz]; round the resonances when None.

    Raises:
        NotSolvedError: no point converged.
    """
    widen = band is None
    settings = with_excited_harmonics(family, settings)
    if settings.chosen:
        rough = covered_band(family_member(family, settings).model, settings, band, mode, 1.0)
        settings, _, _ = choose_settings(family, settings, peak_of(rough), accuracy)
        band = band or (rough[0].frequency, rough[-1].frequency)
    points: list[Solution] = []
    for last in [False] * (MAX_SWEEPS - 1) + [True]:
        model = family_member(family, settings).model
        inner = _solvable(points)
        if inner is None:
            points = covered_band(model, settings, band, mode, accuracy, widen)
        else:
            points = _replaced(points, response_points(model, settings, inner, accuracy))
        if settings.chosen and any(p.branch for p in points):
            return _adapted_branches(family, settings, band, mode, accuracy, points)
        top = peak_of(points)
        used = settings
        errors = {}
        whole = all(p.converged for p in points)
        left_out = left_out_motion(family, [settings] * len(points), points)
        for point in points_to_check(points, heights_of(points), left_out, accuracy):
            tolerated = accuracy * size(top) / size(point)
            if last or not (whole or point is top):
                found = total_error(family, settings, point)
            else:
                used, _, found = choose_settings(family, settings, point, tolerated)
                used = replace(used, error=settings.error)
            errors[point.omega] = found.total
            if used != settings:
                break
        if used == settings:
            return Checked(replace(settings, error=errors[top.omega]), points, errors)
        settings = used
    return Checked(replace(settings, error=errors[top.omega]), points, errors)


def _adapted_branches(
    family: Family,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
    points: list[Solution],
) -> Checked:
    """The adapted curve where several motions were found: its error is that of the height of the
    highest peak that is not unstable, wherever it lies.
    """
    widen = band is None
    band = band or (points[0].frequency, points[-1].frequency)
    demanded = accuracy
    top = lasting_peak(family_member(family, settings).model, points)
    error = peak_error(family, settings, points, top)
    for _ in range(MAX_SWEEPS):
        if error <= accuracy / 2 or not np.isfinite(error):
            break
        demanded *= max(accuracy / 2 / error, MIN_ACCURACY_FACTOR)
        before = replace(settings, error=None)
        settings, _, _ = choose_settings(family, settings, anchor_of(points, top), demanded)
        if replace(settings, error=None) == before:
            continue
        points = covered_band(
            family_member(family, settings).model, settings, band, mode, accuracy, widen
        )
        top = lasting_peak(family_member(family, settings).model, points)
        error = peak_error(family, settings, points, top)
    return Checked(replace(settings, error=error), points, {top.omega: error})


def _solvable(points: Sequence[Solution]) -> tuple[float, float] | None:
    """Frequencies [Hz] round the peak, a little inside the nearest unsolved points; None where all
    were solved.
    """
    lost = np.array([p.frequency for p in points if not p.converged])
    if not len(lost):
        return None
    top = peak_of(points).frequency
    low = max((0.9 * f + 0.1 * top for f in lost if f < top), default=points[0].frequency)
    high = min((0.9 * f + 0.1 * top for f in lost if f > top), default=points[-1].frequency)
    return low, high


def _replaced(old: Sequence[Solution], new: Sequence[Solution]) -> list[Solution]:
    """Points sorted by frequency, the new ones in place of the old ones in their band."""
    return sorted(
        [*new, *(p for p in old if not new[0].omega <= p.omega <= new[-1].omega)],
        key=lambda p: p.omega,
    )


def solver_options(accuracy: float) -> Options:
    """When a point is accepted whose model may be wrong by the accuracy anyway."""
    return Options(tolerance=float(np.clip(1e-3 * accuracy, 1e-10, 1e-6)), frugal=True)


def checked_points(curve: Checked) -> np.ndarray:
    """(k,) bool: which points were checked themselves."""
    return np.array([p.omega in curve.errors for p in curve.points])


def estimated_errors(curve: Checked) -> np.ndarray:
    """(k,) estimated relative error of each point: linear in frequency between the checked ones,
    held beyond them.

    Unknown (infinite) at points that were not solved, and where the nearest checked one tells
    nothing.
    """
    at = np.array(sorted(curve.errors))
    known_errors = np.array([curve.errors[w] for w in at])
    omegas = np.array([p.omega for p in curve.points])
    if not np.isfinite(known_errors).any():
        return np.full(len(omegas), np.inf)
    blind = ~np.isfinite(known_errors[abs(omegas[:, None] - at).argmin(axis=1)])
    between = np.interp(
        omegas, at[np.isfinite(known_errors)], known_errors[np.isfinite(known_errors)]
    )
    return np.where(blind | [not p.converged for p in curve.points], np.inf, between)


def covered_band(
    model: ReducedModel,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
    widen: bool = False,
    paths: bool | None = None,
    notes: list[str] | None = None,
    known: Sequence[Solution] = (),
    limits: PathLimits = USUAL_LIMITS,
) -> list[Solution]:
    """A sweep of a band [Hz], or of one round the resonances; that one is widened until its highest
    point lies inside.

    Args:
        widen: a given band may be widened as well.
        paths: whether the response is followed round folds; where accuracy is below 1 if left out.
        notes: takes what the last sweep could not do, in sentences.
        known: points of this model with these settings and solver options, not to be solved again.
        limits: of the paths on which the response is followed.

    Raises:
        NotSolvedError: no point converged.
    """
    swept = band or default_band(model, mode)
    between = _halfway(model, mode)
    for _ in range(1 if band and not widen else MAX_BAND_WIDENINGS):
        left_open: list[str] = []
        points = response_points(model, settings, swept, accuracy, paths, left_open, known, limits)
        good = [p.omega for p in points if p.converged]
        top = peak_of(points).omega
        if good[0] < top < good[-1] or limits.given_up(points):
            break
        swept = _doubled_band(swept, top == good[0], between)
    if notes is not None:
        notes[:] = left_open
    return points


def _doubled_band(
    band: tuple[float, float],
    downwards: bool,
    limits: tuple[float, float],
) -> tuple[float, float]:
    """Twice the band [Hz] on the side of its highest point, inside the limits."""
    low, high = band
    width = high - low
    if downwards:
        low -= width
    else:
        high += width
    return max(low, limits[0]), min(high, limits[1])


def _halfway(model: ReducedModel, mode: int) -> tuple[float, float]:
    """Frequencies [Hz] half way to the neighbouring modes: beyond them the flank of another
    resonance may be higher.
    """
    ends = np.sort([free_resonances(model), stuck_partners(model)], axis=0) / (2 * np.pi)
    low = 0.1 * ends[0, 0] if mode == 1 else (ends[1, mode - 2] + ends[0, mode - 1]) / 2
    high = 3 * ends[1, -1] if mode == ends.shape[1] else (ends[1, mode - 1] + ends[0, mode]) / 2
    return min(low, 0.99 * ends[0, mode - 1]), max(high, 1.01 * ends[1, mode - 1])


def response_points(
    model: ReducedModel,
    settings: Settings,
    band: tuple[float, float],
    accuracy: float,
    paths: bool | None = None,
    notes: list[str] | None = None,
    known: Sequence[Solution] = (),
    limits: PathLimits = USUAL_LIMITS,
) -> list[Solution]:
    """A sweep of a band [Hz], sorted by frequency; an accuracy of 1 asks for no more than the place
    of the peak.

    Where several motions were followed, their points have a `branch`, and replace those
    that the sweep solved before.

    Args:
        known: points of this model with these settings and solver options, not to be solved again.
        limits: of the paths on which the response is followed.

    Raises:
        NotSolvedError: no point converged.
    """
    rough = accuracy >= 1
    ends = 2 * np.pi * band[0], 2 * np.pi * band[1]
    swept = partial(
        sweep,
        model,
        ends,
        settings.harmonics,
        settings.samples,
        peak=min(accuracy / 10, 1e-2),
        curve=0.2 if rough else 0.02,
        notes=notes,
        paths=not rough if paths is None else paths,
        known=[p for p in known if p.converged and ends[0] <= p.omega <= ends[1]],
        limits=limits,
    )
    options = solver_options(accuracy)
    points = list(swept(options=replace(options, fallbacks=not rough)))
    if rough and 2 * sum(p.converged for p in points) < len(points):
        if notes is not None:
            notes.clear()
        points = list(swept(options=options))
    points.sort(key=lambda s: s.omega)
    if any(p.branch for p in points):
        points = [p for p in points if p.branch or not p.converged]
    if not any(p.converged for p in points):
        raise NotSolvedError(
            f"no point between {band[0]:.5g} and {band[1]:.5g} Hz was solved; the first stopped "
            f"because: {points[0].reason}"
        )
    return points


def default_band(model: ReducedModel, mode: int) -> tuple[float, float]:
    """From a little below to a little above the resonances [Hz] of a mode with free and with
    sticking contacts.
    """
    pair = np.array([free_resonances(model)[mode - 1], stuck_partners(model)[mode - 1]]) / (
        2 * np.pi
    )
    margin = max(0.01 * pair.mean(), 0.15 * np.ptp(pair))
    return pair.min() - margin, pair.max() + margin

"""Settings that hold at a peak, made poorer again where that costs less than it saves.

A choice only climbs, in steps of several at once where an error is large, and takes over the damper
model of another load. Here each respect that was chosen is tried one step poorer: the peak of the
poorer model takes a few points, the curve that is swept next takes many.
"""

from __future__ import annotations

from dataclasses import replace

from ...errors import NotSolvedError
from ...hbm.peak import Peak
from ...hbm.solution import lifts_off
from .family import Family, family_member, lowest_harmonics
from .peak_errors import SHIFT_WEIGHT, PeakErrors, peak_from
from .resonance_choice import (
    LIFTING_POINTS,
    SUFFICIENT_SHARE,
    Choice,
    lacks_harmonics_for_lift_off,
)
from .settings import DAMPER_MODELS, FIRST_SETTINGS, Settings

# points of the sweep that follows a choice
CURVE_POINTS = 40
# points that the peak of a poorer model takes
PEAK_POINTS = 5
# of the time of a curve: what fewer harmonics have to save
LEAST_SAVED_SHARE = 0.25
# operations in the time that Python takes for a Newton step: 0.2 ms, where an operation takes 1 ns
PYTHON_OPERATIONS = 2e5
# how many times larger the error of a respect becomes by one step back, roughly: by half the
# harmonics, or half the samples or points, whose errors are of second order
ERROR_GROWTH = {"harmonics": 8.0, "samples": 4.0, "points": 4.0, "damper": 1.0}


def cheaper_settings(
    family: Family,
    settings: Settings,
    peak: Peak,
    errors: PeakErrors,
    accuracy: float,
    held: tuple[str, ...] = (),
) -> Choice:
    """Settings from `choose_at_peak`, poorer in what is not needed.

    A respect is made poorer where the error that its step back is expected to leave fits into the
    accuracy, where the sweep that follows saves more than the poorer peak takes, and where that
    peak lies as near as the accuracy asks for. What it differs by is added to the errors.

    Args:
        held: respects that stay as they are, since the curve gets more of them anyway.
    """
    left = SUFFICIENT_SHARE * accuracy - sum(errors.needs.values())
    for name, growth in ERROR_GROWTH.items():
        poorer = _one_step_back(family, settings, name)
        if name in held or poorer is None or left <= 0 or _too_few_points(poorer, peak):
            continue
        expected = (growth - 1) * errors.needs[name]
        if expected > left or not _saves(family, settings, poorer):
            continue
        try:
            found = peak_from(family, settings, peak, poorer, accuracy, fallbacks=False)
        except NotSolvedError:
            continue
        height = abs(found.height / peak.height - 1)
        shift = abs(found.vertex / peak.vertex - 1)
        if max(height, SHIFT_WEIGHT * shift) > left or lacks_harmonics_for_lift_off(
            poorer, found.solution
        ):
            continue
        errors = _with_error(errors, name, height, shift)
        settings = replace(poorer, error=errors.total)
        peak = found
        left = SUFFICIENT_SHARE * accuracy - sum(errors.needs.values())
    return Choice(settings, peak, errors)


def _too_few_points(settings: Settings, peak: Peak) -> bool:
    """Contacts lift off, and there would be fewer points than a damper that comes off needs."""
    few = settings.points is not None and settings.points < LIFTING_POINTS
    return few and lifts_off(peak.solution)


def _one_step_back(family: Family, settings: Settings, name: str) -> Settings | None:
    """Poorer settings in one respect; None where it is the user's, or the poorest already."""
    value = getattr(settings, name)
    if name not in settings.chosen or value is None:
        return None
    if name == "damper":
        # the damper as a mass is no poorer model of the same thing: it has no rotation
        elastic = value == DAMPER_MODELS[-1] and FIRST_SETTINGS["damper"] in family.dampers
        return replace(settings, damper=FIRST_SETTINGS["damper"]) if elastic else None
    least = FIRST_SETTINGS[name]
    if name == "harmonics":
        least = max(least, lowest_harmonics(family, settings))
    if name == "samples":
        least = max(least, 8 * (settings.harmonics + 1))
    poorer = max(least, (value - 1) // 2 if name == "harmonics" else value // 2)
    return replace(settings, **{name: poorer}) if poorer < value else None


def _saves(family: Family, settings: Settings, poorer: Settings) -> bool:
    """The curve saves more with poorer settings than their peak takes; with fewer harmonics enough
    to risk that a flank asks for more, with which it is swept again.
    """
    before = _point_cost(family, settings)
    after = _point_cost(family, poorer)
    saved = CURVE_POINTS * (before - after)
    risked = LEAST_SAVED_SHARE * CURVE_POINTS * (before + PYTHON_OPERATIONS)
    fewer = poorer.harmonics < settings.harmonics
    return saved > max(PEAK_POINTS * after, risked if fewer else 0.0)


def _point_cost(family: Family, settings: Settings) -> float:
    """Operations of a Newton step, roughly: the friction law with its derivative at each sample,
    and the solution of the linear equations.
    """
    model = family_member(family, settings).model
    unknowns = model.unknowns(settings.harmonics)
    modes = len(model.side(1).omega)
    if isinstance(model.damper, tuple):
        modes += len(model.damper[0].omega)
    flexibility = settings.harmonics * model.springs.size**2 * modes
    return float(unknowns * settings.samples * model.directions + unknowns**2 + flexibility)


def _with_error(errors: PeakErrors, name: str, height: float, shift: float) -> PeakErrors:
    """The errors of a model that is poorer in one respect, whose peak differs by this."""
    heights = dict(errors.height)
    shifts = dict(errors.frequency)
    heights[name] += height
    shifts[name] += shift
    return replace(errors, height=heights, frequency=shifts)

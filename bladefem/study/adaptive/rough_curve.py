"""The rough sweep at whose peak settings are chosen, with what lift-off and stiff layers ask for
before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...data import RigidBody
from ...errors import NotSolvedError
from ...hbm.solution import Solution, size
from .band_sweep import covered_band
from .cheaper_settings import PYTHON_OPERATIONS
from .check_points import (
    peak_of,
)
from .family import Family, family_member, with_excited_harmonics
from .resonance_choice import (
    lacks_harmonics_for_lift_off,
    settings_of_lift_off,
)
from .settings import Settings, enriched_settings
from .stiff_layer import climbed_to, settings_of_stiff_layer, softened_where_lifting

# share of a resonance with poor settings below which richer ones, whose points were not solved
# there, have lost it: their highest solved point is then another one beside it
LOST_HEIGHT_SHARE = 0.5


def rough_curve(
    family: Family,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
    accuracy: float,
) -> tuple[Settings, list[Solution]]:
    """A rough sweep, and the settings that it was made with: those given, or richer ones where
    contacts lift off at its peak and ask for them, or a stiff layer.

    Args:
        band: [Hz]; round the resonances when None.
        accuracy: of the resonance amplitude, to which a stiff layer's is climbed to.

    Raises:
        NotSolvedError: no point converged.
    """
    swept = _swept_roughly(family, settings, band, mode)
    return _with_stiff_layer(family, *swept, band, mode, accuracy)


def _swept_roughly(
    family: Family,
    settings: Settings,
    band: tuple[float, float] | None,
    mode: int,
) -> tuple[Settings, list[Solution]]:
    """A rough sweep, and the settings that it was made with: others than those given where contacts
    lift off at its peak and ask for them, unless that peak is lost with them.
    """
    settings = with_excited_harmonics(family, replace(settings, error=None))
    settings = _with_free_harmonics(family, settings)
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
    return (settings, points) if is_lost(top, richer) else (suited, richer)


def _with_free_harmonics(family: Family, settings: Settings) -> Settings:
    """More than one harmonic where normal loads do not follow the motion and the points cost no
    more than Python does with them: one in three of such models needs them, and its curve is not
    swept, nor its peak judged, twice. Not of a damper that friction alone holds: it may walk, and
    a point that has no solution then takes twice as long (seed 34 of benchmarks/choice_random.py).
    """
    richer = enriched_settings(settings, "harmonics")
    if settings.harmonics > 1 or richer is None or "harmonics" not in settings.chosen:
        return settings
    model = family_member(family, richer).model
    each = model.unknowns(richer.harmonics) * model.directions * max(richer.samples, 1)
    small = model.loads_prescribed and each <= PYTHON_OPERATIONS
    return richer if small and not isinstance(model.damper, RigidBody) else settings


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
        if not is_lost(top, found):
            return richer, found
    except NotSolvedError:
        # no point converged
        pass
    climbed = climbed_to(family, settings, top, richer, accuracy)
    if climbed is None:
        return settings, points
    return richer, sorted([*found, climbed], key=lambda p: p.omega)


def is_lost(top: Solution, points: Sequence[Solution]) -> bool:
    """No point is nearly as high as a resonance, and one next to its frequency was not solved."""
    omegas = np.array([p.omega for p in points])
    place = int(np.searchsorted(omegas, top.omega))
    beside = points[max(0, place - 1) : place + 1]
    low = size(peak_of(points)) < LOST_HEIGHT_SHARE * size(top)
    return low and not all(p.converged for p in beside)


def _suited_to_lift_off(family: Family, settings: Settings, top: Solution) -> Settings:
    """Settings for contacts that lift off at the resonance, where they do."""
    softer = softened_where_lifting(family, settings, top)
    return (
        settings_of_lift_off(softer, top) if lacks_harmonics_for_lift_off(settings, top) else softer
    )

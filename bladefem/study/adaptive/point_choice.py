"""Settings at one frequency: what the indicators find too wrong is enriched until half of the
accuracy is kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...hbm.full_stick import sticks_safely
from ...hbm.solution import Solution
from .family import Family, family_member
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

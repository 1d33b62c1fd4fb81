"""A lower motion beside a resonance with lift-off, at the same frequency.

A damper that bounces holds less than one that only slips, and the blade may keep to either: which
one depends on how it came there. From rest the shipped wedge under 36 N keeps 131 um where its
resonance is 610 um. A curve that is not followed round folds does not show it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError, NotSolvedError
from ...hbm.solution import Solution, mostly_lifts_off, size
from ...hbm.solve import solve
from ...hbm.solver.newton import DEFAULT_OPTIONS
from ...hbm.stability import STABLE, UNIQUE, stability_verdict
from ..adaptive.family import Family, family_member, lowest_harmonics
from ..adaptive.settings import FIRST_SETTINGS, Settings
from .march_by_steps import band_by_steps
from .verdicts import (
    CURVE_OPERATIONS,
    JUDGED_HARMONICS,
    JUDGED_SAMPLES,
    model_in_time,
    settings_in_time,
)

# of the amplitude given: what is higher is the same motion on other contact points
OTHER_MOTION = 0.7
# operations that a march of it may need, some second
MAX_COUNTED = 1e10
# from full stick Newton's method comes to the low motion in a few steps, or it is not near
SEARCH = replace(DEFAULT_OPTIONS, iterations=25, fallbacks=False)


@dataclass(frozen=True)
class LowerMotion:
    """A motion at the frequency of a resonance that is another one."""

    # root of the sum of squares of the harmonics at the probe; the highest of a march, where the
    # periodic motion does not last but leads to another low one [m]
    amplitude: float
    # why it is not known to last; else ""
    doubt: str = ""

    @property
    def rounded(self) -> float:
        """The amplitude with two digits, since few contact points give it [m]: 120
        um under 36 N of the shipped wedge, where a march of all of them from rest keeps 135.
        """
        return float(f"{self.amplitude:.2g}")


def lower_motion(
    models: Family, settings: Settings, top: Solution, given: float, frequency: float
) -> LowerMotion | None:
    """The motion that Newton's method comes to from full stick, as the contacts of a blade at rest
    are, where it is far lower than the resonance, and the blade not known to leave it for that;
    else None.

    Few contact points tell it, since most of its contacts stay closed.

    Args:
        settings, top: of the curve, and its resonance; where contacts mostly stay closed there no
            other motion is sought.
        given: amplitude of the resonance [m].
        frequency: of the resonance [Hz].
    """
    if not mostly_lifts_off(top) or settings.softened:
        return None
    few = _few_points(models, settings)
    # a motion, its verdict and its march have the same modes
    model = family_member(models, few).model
    omega = 2 * np.pi * frequency
    try:
        found = solve(model, omega, few.harmonics, few.samples, options=SEARCH)
    except (InputError, NotSolvedError):
        return None
    most = OTHER_MOTION * given
    if not found.converged or size(found) > most:
        return None
    lasting = model_in_time(models, few)
    if stability_verdict(lasting, found, CURVE_OPERATIONS).verdict in (STABLE, UNIQUE):
        return LowerMotion(size(found))
    kept = band_by_steps(lasting, found, MAX_COUNTED)
    if kept.reason:
        return LowerMotion(size(found), kept.reason)
    return LowerMotion(kept.highest) if kept.highest <= most else None


def _few_points(models: Family, settings: Settings) -> Settings:
    """Settings with as many contact points as a choice begins with, where these are not the user's,
    and harmonics that a verdict needs.
    """
    harmonics = max(lowest_harmonics(models, settings), min(JUDGED_HARMONICS, models.harmonics))
    few = replace(settings, harmonics=harmonics, samples=max(JUDGED_SAMPLES, 8 * harmonics + 8))
    if "points" in settings.chosen:
        few = replace(few, points=FIRST_SETTINGS["points"])
    return settings_in_time(models, few)

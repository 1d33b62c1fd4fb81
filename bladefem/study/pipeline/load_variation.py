"""Models along the static load of a seat, the damper seated anew, and the slope of their peaks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from ...hbm.model import ReducedModel
from ...hbm.node_gradients import node_gradients
from ...hbm.peak import Peak, with_slope
from ...hbm.peak_levels import Variation
from ..adaptive.family import Family, family_member, joined_elements
from ..adaptive.settings import Settings
from .assemble_model import LoadCase

CaseAt = Callable[[float], LoadCase]
FamilyOf = Callable[[LoadCase], Family]

# relative step of the load by which the seating is differentiated
SEATING_DIFFERENCE_STEP = 1e-4


def load_variation(
    case_at: CaseAt,
    family_of: FamilyOf,
    settings: Settings,
) -> Variation:
    """Models along the static load, the damper seated anew for each."""

    @cache
    def model_at(load: float) -> ReducedModel:
        return family_member(family_of(case_at(load)), settings).model

    def sloped(
        model: ReducedModel,
        peak: Peak,
        load: float,
    ) -> Peak:
        groups = family_member(family_of(case_at(load)), settings).groups
        low, high = (
            joined_elements(case_at(load * (1 + sign * SEATING_DIFFERENCE_STEP)).elements, groups)
            for sign in (-1, 1)
        )
        rates = {
            "load": _relative_rate(low.n0, high.n0),
            "kt": _relative_rate(low.kt, high.kt),
            "kn": _relative_rate(low.kn, high.kn),
        }
        proportional = abs(rates["load"] - 1).max() < SEATING_DIFFERENCE_STEP
        if proportional and not (rates["kt"].any() or rates["kn"].any()):
            return with_slope(model, peak, "load", load)
        names = [name for name in rates if np.any(rates[name])]
        gradients = node_gradients(model, peak.solution, names)
        slope = sum(float(gradients[name] @ rates[name]) for name in names)
        return replace(peak, value=load, slope=slope)

    return Variation(model_at, sloped)


def _relative_rate(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) derivative of ln |x| by the logarithm of the load; 0 where x is 0 or hardly changes."""
    middle = (low + high) / 2
    change = (high - low) / (2 * SEATING_DIFFERENCE_STEP)
    rate = np.divide(change, middle, out=np.zeros_like(middle), where=middle != 0)
    return np.where(abs(rate) < SEATING_DIFFERENCE_STEP, 0.0, rate)

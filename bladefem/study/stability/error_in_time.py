"""The error of a resonance with lift-off from a march in time, where richer balances disagree.

Where contacts lift off, balances with more harmonics are often not solved, or end on another motion
of several: their difference says little of the one that is given. A march in time has no harmonics
left out, and begins at the very motion that is judged (``march_from_motion``).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...hbm.linear.condensation import condense
from ...hbm.solution import Solution, lifts_off, mostly_lifts_off, size
from ...hbm.solve import as_solution
from ...hbm.solver.fallback import Attempt
from ...hbm.solver.newton import Newton
from ...hbm.solver.residual import Balance, evaluate_balance
from ..adaptive.checked_curve import CheckedCurve
from ..adaptive.choice_in_time import COVERED_IN_TIME, MarchedBand
from ..adaptive.family import Family, Member, carried_displacements, family_member
from ..adaptive.resonance_choice import LIFTING_POINTS
from ..adaptive.settings import Settings
from .exact_march import exact_band
from .kept_band import KeptBand
from .march_by_steps import MAX_COUNTED_LAST, band_by_steps
from .march_from_motion import FEWEST_POINTS, affordable_march, kept_band
from .verdicts import model_in_time, settings_in_time

# relative, of an error that was summed twice
ROUNDING = 1e-9
# error over the change by twice the contact points, where there are more of them still: on the
# shipped wedge under 18 N 8 points change the 1251 um with 4 by 8.7 %, all of them by 17 %
ERROR_OVER_CHANGE = 2.0


@dataclass(frozen=True)
class Marches:
    """Marches by steps from motions of the models of one load case, each done once."""

    models: Family
    # settings less their error, circular frequency and amplitude of the motion to what was found
    done: dict[tuple[Settings, float, float], KeptBand] = field(default_factory=dict)

    def band(self, settings: Settings, point: Solution) -> KeptBand | None:
        """What the blade keeps to after a motion; None where a march by steps is not affordable.

        Steps serve small models too: an exact march tells the same to 0.6 % and takes 5 to 28 times
        as long. It is asked where steps come to no end.
        """
        key = replace(settings, error=None), point.omega, size(point)
        if key not in self.done:
            model = model_in_time(self.models, settings_in_time(self.models, settings))
            if not affordable_march(model):
                return None
            band = band_by_steps(model, point)
            if band.reason and not band.too_long:
                band = exact_band(model, point) or band
            self.done[key] = band
        return self.done[key]

    def marched_on(self, settings: Settings, point: Solution, unsettled: KeptBand) -> KeptBand:
        """A band that had not settled, marched until it has, as far as that is affordable.

        The way down from an unstable motion may be far higher than what the blade keeps to: plane
        blades under 3 N have 1.06 to 3.19 um between 100 and 125 periods, 1.66 um after 300.
        """
        model = model_in_time(self.models, settings_in_time(self.models, settings))
        longer = band_by_steps(model, point, known=0.0)
        if longer.reason:
            return unsettled
        self.done[replace(settings, error=None), point.omega, size(point)] = longer
        return longer

    def __call__(
        self,
        settings: Settings,
        point: Solution,
        on: Settings | None = None,
    ) -> MarchedBand | None:
        """The marched band for the choice of harmonics, also on the model of other settings; None
        as well where the march came to no end.
        """
        if on is not None:
            point = carried_motion(self.models, settings, point, on)
        band = self.band(on or settings, point)
        return None if band is None or band.reason else MarchedBand(band.lowest, band.highest)


@dataclass(frozen=True)
class ErrorInTime:
    """Error of a resonance amplitude by a march."""

    # relative; inf where it is not known
    error: float
    # of the march; its points are those of a model with more of them than the resonance's, None
    # where it has the same. None where no march was possible
    band: KeptBand | None


def error_in_time(
    marches: Marches,
    curve: CheckedCurve,
    top: Solution,
    accuracy: float,
) -> ErrorInTime | None:
    """The error of a resonance by a march from it; None where that does not apply, is not possible,
    or tells more than the balances do.

    It replaces what richer balances say of harmonics and samples. Where they say nothing of contact
    points, twice as many are marched.

    Args:
        top: the resonance, a point of the curve.
    """
    models = marches.models
    estimated = curve.settings.error
    if estimated is None or estimated <= accuracy or not lifts_off(top):
        return None
    left = sum(change for name, change in curve.parts.items() if name not in COVERED_IN_TIME)
    known = bool(curve.parts) and np.isfinite(left)
    settings = curve.settings if known else _finer_settings(models, curve.settings)
    if settings is None:
        return None
    start = top if known else carried_motion(models, curve.settings, top, settings)
    band = marches.band(settings, start)
    if band is None or band.reason:
        return None
    error = MarchedBand(band.lowest, band.highest).farthest(size(top))
    if known:
        error += left
    elif _finer_settings(models, settings) is not None:
        error *= ERROR_OVER_CHANGE
    # a march that the harmonics were chosen by tells the same
    if error > estimated * (1 + ROUNDING):
        return None
    return ErrorInTime(error, band if known else replace(band, points=settings.points))


def error_of_doubt(marches: Marches, curve: CheckedCurve, top: Solution) -> ErrorInTime | None:
    """The error of a resonance whose motion may not last and is not marched with its own contact
    points: what LIFTING_POINTS keep after it, where that is more than balances tell, else None.

    Unknown where such a march is not possible and most contacts lift off: balances then agree on
    motions that the blade leaves.

    The motion need not be solved with these points to start from it. What they lead away by is
    theirs as well, so that the error is rather too large: under 18 N and engine order 4 the shipped
    wedge's 677 um with all 63 points and three harmonics kept 709 to 728 um so, 7.5 % beside 4.9 %
    by balances and meshes; a plain march of all points keeps 595 to 628 um at that frequency.

    Args:
        top: the resonance, a point of the curve.
    """
    models, settings = marches.models, settings_in_time(marches.models, curve.settings)
    own = settings.points
    unknown = ErrorInTime(np.inf, None) if mostly_lifts_off(top) else None
    # with the fewest a march of as many operations was tried
    if own is not None and own <= FEWEST_POINTS:
        return unknown
    fewer = replace(settings, points=LIFTING_POINTS if own is None else min(own, LIFTING_POINTS))
    start = carried_motion(models, curve.settings, top, fewer)
    band = kept_band(model_in_time(models, fewer), start, MAX_COUNTED_LAST)
    if band.reason:
        return unknown
    error = band.farthest(size(top))
    if error <= (curve.settings.error or 0.0):
        return None
    return ErrorInTime(error, replace(band, points=fewer.points))


def _finer_settings(models: Family, settings: Settings) -> Settings | None:
    """Twice the contact points; None where there are no more."""
    if settings.points is None:
        return None
    finer = replace(settings, points=2 * settings.points)
    before, after = (len(family_member(models, s).model.springs) for s in (settings, finer))
    return finer if after > before else None


def carried_motion(
    models: Family,
    settings: Settings,
    point: Solution,
    other: Settings,
) -> Solution:
    """The motion of a point on the contact points of other settings, with the forces that belong to
    it; no solution of that balance, but a start of a march.

    Solving it there mostly ends on another motion, or nowhere.
    """
    old, new = (family_member(models, some) for some in (settings, other))
    H = point.harmonics
    w = carried_displacements(point.w, old, new, H)
    walk = None if point.walk is None else _carried_motions(point.walk, old, new)
    linear = condense(new.model, point.omega, H)
    balance = Balance(new.model, linear, point.samples, walk=walk)
    reason = "carried over from other contact points"
    start = Newton(evaluate_balance(balance, w), 0, False, reason, walk=walk)
    return as_solution(balance, Attempt("", start), 0, reason)


def _carried_motions(walk: np.ndarray, old: Member, new: Member) -> np.ndarray:
    """(m', z) motions along which a damper walks, from those of another member (m, z)."""
    parts = walk.T.reshape(walk.shape[1], -1, old.model.directions, 1)
    return np.stack([carried_displacements(w, old, new, 0).ravel() for w in parts], axis=1)

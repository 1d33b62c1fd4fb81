"""Which motion of a curve is given as its resonance: the highest, if it lasts, or what a march from
there leaves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...hbm.solution import Solution, lifts_off, size
from ...hbm.stability import UNIQUE, UNSTABLE, Verdict
from ...scene.tables import Scene
from ...util.arrays import RealArray
from ..adaptive.check_points import heights_of
from ..adaptive.checked_curve import CheckedCurve, estimated_errors
from ..adaptive.settings import Settings
from .error_in_time import Marches, error_in_time, error_of_doubt
from .finer_contacts import FinerMotion, unstable_with_more_points
from .flank_motions import flank_motions
from .highest_stable import highest_lasting
from .kept_band import KeptBand, scaled_band
from .march_from_motion import kept_of_family
from .strong_drive import strong_drives
from .verdicts import Stability, judged_above, model_in_time, richer_models, stability_of

# with which a verdict on a motion whose contacts lift off is believed
ENOUGH_HARMONICS = 15


@dataclass(frozen=True)
class JudgedResonance:
    """The point that is given as the resonance of a curve, and how it was judged."""

    point: Solution
    # of all points of the curve
    marks: Stability
    # what the blade does at the highest point where that is unstable, or its verdict in doubt
    march: KeptBand | None = None
    # the amplitude given is the highest that the blade keeps to after the point
    march_replaces_balance: bool = False
    # relative rise above it by marches from unstable motions beside it
    flank_rise: float = 0.0
    # why not all marches from unstable motions beside it are known; else ""
    flank_march_failure: str = ""
    # contacts lift off, and marches after a strong drive take too long
    strong_drive_skipped: bool = False

    @property
    def amplitude(self) -> float:
        """The one given [m]."""
        if self.march_replaces_balance and self.march is not None:
            return self.march.highest
        return size(self.point)

    def is_doubtful(self, curve: CheckedCurve) -> bool:
        """Contacts lift off, few harmonics do not call the highest motion unstable, and what the
        blade does there is not known from a march.
        """
        unknown = self.march is not None and bool(self.march.reason)
        return unknown and self.unstable_peak(curve) is None

    def unstable_peak(self, curve: CheckedCurve) -> Solution | None:
        """The highest point of the curve where it is unstable."""
        place = int(heights_of(curve.points).argmax())
        unstable = self.marks.verdict[place] == UNSTABLE and self.march is not None
        return curve.points[place] if unstable else None


def judged_resonance(
    marches: Marches, curve: CheckedCurve, scene: Scene, sought: bool = False
) -> JudgedResonance:
    """Judge a curve, and march from its highest point where that is unstable, be it with more
    contact points than the curve has, from unstable motions beside the resonance, and from strong
    drives where contacts lift off.

    That one gives way to the highest that was judged and is not, where the blade is known to keep
    to less than that: else the blade moves most next to the unstable one.

    Args:
        sought: marches have found the resonance; from the highest point none is made.
    """
    heights = heights_of(curve.points)
    place = int(heights.argmax())
    highest = curve.points[place]
    if not scene.study.stability:
        empty = np.full(len(heights), "")
        unasked = Stability(empty, np.full(len(heights), np.nan), bifurcation=empty)
        return JudgedResonance(highest, unasked)
    models, settings = marches.models, curve.settings
    model = model_in_time(models, settings)
    richer = richer_models(models, settings)
    marks = stability_of(model, curve.points, richer)
    if sought:
        return JudgedResonance(highest, marks)
    judged = _at_the_highest(marches, curve, scene, marks, place)
    judged = _with_flanks(marches, curve, judged, highest, scene.accuracy)
    driven = strong_drives(marches, curve, judged.amplitude)
    if driven.point is None:
        return replace(judged, strong_drive_skipped=driven.too_long)
    return JudgedResonance(
        driven.point,
        marks,
        driven.kept,
        march_replaces_balance=True,
        flank_march_failure=judged.flank_march_failure,
    )


def _with_flanks(
    marches: Marches,
    curve: CheckedCurve,
    judged: JudgedResonance,
    highest: Solution,
    accuracy: float,
) -> JudgedResonance:
    """The highest amplitude that the blade keeps to beside the resonance in place of that, where it
    is a march's as well, or lower by more than the accuracy.
    """
    given = judged.amplitude
    known = None if judged.march is None else highest
    found = flank_motions(marches, curve, judged.marks, given, known)
    if found.point is None or found.highest <= given:
        return replace(judged, flank_march_failure=found.reason)
    rise = found.highest / given - 1
    if judged.march_replaces_balance or rise > accuracy:
        return JudgedResonance(
            found.point,
            judged.marks,
            found.kept,
            march_replaces_balance=True,
            flank_march_failure=found.reason,
        )
    return replace(judged, flank_rise=rise, flank_march_failure=found.reason)


def _at_the_highest(
    marches: Marches, curve: CheckedCurve, scene: Scene, marks: Stability, place: int
) -> JudgedResonance:
    """What the blade does at the highest point, or at the highest that lasts.

    That one is marched as well: few harmonics and contact points may call a motion stable that the
    blade leaves.
    """
    heights = heights_of(curve.points)
    highest = curve.points[place]
    models, settings = marches.models, curve.settings
    model = model_in_time(models, settings)
    richer = richer_models(models, settings)
    left = _left_for(marches, settings, highest, marks, place, scene.accuracy)
    if left is None:
        return JudgedResonance(highest, marks)
    marks, kept = left
    if kept.reason or kept.holds(size(highest), scene.accuracy):
        return JudgedResonance(highest, marks, kept, _contradicts(kept, highest, scene.accuracy))
    marks = judged_above(model, curve.points, richer, marks, kept.highest)
    lower = highest_lasting(heights, marks.verdict)
    if lower is None or heights[lower] <= kept.highest:
        return JudgedResonance(highest, marks, kept, _contradicts(kept, highest, scene.accuracy))
    lasting = curve.points[lower]
    held = _marched(marches, settings, lasting)
    if held.reason or held.holds(size(lasting), scene.accuracy):
        return JudgedResonance(lasting, marks, kept)
    if held.highest > kept.highest:
        return JudgedResonance(lasting, marks, held, march_replaces_balance=True)
    return JudgedResonance(highest, marks, kept, march_replaces_balance=True)


def _left_for(
    marches: Marches,
    settings: Settings,
    highest: Solution,
    marks: Stability,
    place: int,
    accuracy: float,
) -> tuple[Stability, KeptBand] | None:
    """What the blade keeps to after the highest point of a curve, where that is unstable or its
    verdict in doubt, with the verdicts on the curve; None where it is neither.
    """
    verdict = marks.verdict[place]
    if verdict == UNSTABLE:
        return marks, _marched(marches, settings, highest)
    finer = unstable_with_more_points(marches.models, settings, highest, verdict)
    if finer is not None:
        kept = _marched(marches, finer.settings, finer.motion)
        return _with_verdict(marks, place, finer.verdict), _scaled(kept, finer, highest)
    if not _doubtful(highest, verdict):
        return None
    kept = _marched(marches, settings, highest)
    if kept.reason or kept.holds(size(highest), accuracy):
        return marks, kept
    return _with_verdict(marks, place, Verdict(UNSTABLE, np.nan)), kept


def _doubtful(point: Solution, verdict: str) -> bool:
    """Contacts lift off, and a verdict has few harmonics and was not confirmed by more of them.

    On the shipped wedge with ground faces three harmonics call 301 um stable under 580 N, or
    unstable, by the last digits of the reduction; a march ends on 287 um.
    """
    return verdict != UNIQUE and lifts_off(point) and point.harmonics < ENOUGH_HARMONICS


def _marched(marches: Marches, settings: Settings, point: Solution) -> KeptBand:
    """What the blade keeps to after an unstable motion."""
    kept = marches.band(settings, point)
    if kept is None or kept.too_long:
        kept = kept_of_family(marches.models, settings, point)
    elif kept.unsettled:
        kept = marches.marched_on(settings, point, kept)
    return kept


def _scaled(kept: KeptBand, finer: FinerMotion, point: Solution) -> KeptBand:
    """A band marched with more contact points, over the amplitude with the fewer ones."""
    ratio = size(point) / size(finer.motion)
    points = finer.settings.points if kept.points is None else kept.points
    return replace(scaled_band(kept, ratio), points=points)


def _with_verdict(marks: Stability, place: int, verdict_there: Verdict) -> Stability:
    """The verdicts on a curve with another one at a point."""
    verdict, multiplier = marks.verdict.astype("<U15"), marks.multiplier.copy()
    bifurcation = marks.bifurcation.copy()
    verdict[place], multiplier[place] = verdict_there.verdict, verdict_there.multiplier
    bifurcation[place] = verdict_there.bifurcation
    return replace(marks, verdict=verdict, multiplier=multiplier, bifurcation=bifurcation)


def _contradicts(kept: KeptBand, top: Solution, accuracy: float) -> bool:
    """The highest amplitude that the blade keeps to is known, and not that of the motion that it
    was marched from.
    """
    return not kept.reason and abs(kept.highest / size(top) - 1) > accuracy


def judged_in_time(
    scene: Scene,
    marches: Marches,
    curve: CheckedCurve,
    resonance: JudgedResonance,
) -> tuple[CheckedCurve, RealArray, KeptBand | None]:
    """The curve with the error of its resonance by a march where that tells it, the estimated error
    of each point, and the march.
    """
    top = resonance.point
    estimated = estimated_errors(curve)
    if not scene.study.stability:
        return curve, estimated, None
    judged = error_in_time(marches, curve, top, scene.accuracy)
    if judged is None and resonance.is_doubtful(curve):
        judged = error_of_doubt(marches, curve, top)
    if judged is None:
        return curve, estimated, None
    estimated[[p is top for p in curve.points]] = judged.error
    settings = replace(curve.settings, error=judged.error)
    return replace(curve, settings=settings), estimated, judged.band

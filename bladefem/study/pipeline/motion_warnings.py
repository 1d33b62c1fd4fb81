"""Where the blade may move otherwise than the resonance that is given: unstable motions, motions
beside it, and marches in its place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...hbm.solution import Solution, size
from ...hbm.stability import UNKNOWN
from ..stability.resonance_in_time import ResonanceInTime
from .curve import Curve, load_of
from .load_remarks import LoadRemark, Reason
from .resonance_list import ISOLATED, reach_of_resonance
from .stability_remarks import rippled

MARCH_GIVEN = "under {loads} the amplitude given is that of an integration in time (a march)"
FOLDED = Reason(
    "under {loads} the blade has several steady vibrations (motions) at one frequency, as the "
    "curve folds back over itself",
    "see in points.csv which points belong to one branch, and local_resonances.csv, where there is "
    "one, for the sweep that reaches each maximum",
)
LOWER = Reason(
    "from rest the blade may keep to a far lower motion than the one given, at the same frequency, "
    "under {loads}",
    "judge by the larger one, which is given; a measurement that starts from rest may show the "
    "lower one",
    "Contacts lift off at the resonance; the error reported is that of the larger motion alone",
)
UNSTABLE_TOP = "since the highest periodic motion is unstable and the blade leaves it"
AS_GIVEN = "use it as given"
WIDER_BAND = "widen study.band: beyond its end, where this march lies, amplitudes may be higher"
UNSTABLE_WITHIN_ERROR = Reason(
    "under {loads} the resonance given is an unstable motion: the blade leaves it for amplitudes "
    "that its error counts",
    "use the amplitude with its error",
)
UNSTABLE_KEPT = Reason(
    "under {loads} the resonance given is an unstable motion, as the larger amplitude, and what "
    "the blade comes to after it is not known",
    "take fewer contact.points, so that the motion after it can be sought in time",
)
UNSTABLE_LEFT_OUT = Reason(
    "under {loads} the resonance given is the highest motion that is not unstable; a higher one is "
    "unstable, and the blade leaves it",
    f"{AS_GIVEN}; the details say where the higher one leads to",
)
UNJUDGED = Reason(
    "under {loads} the motion at the resonance was not judged: it may be unstable, and the blade "
    "leave it for another",
    "take fewer contact.points, so that it can be judged",
)
UNMARCHED = Reason(
    "under {loads} the blade may keep to a higher motion than the resonance given: others nearly "
    "as high are unstable, and what it comes to after some of them is not known",
    "take fewer contact.points or model.modes, so that they can be marched from",
)
DOUBTFUL = Reason(
    "under {loads} it is not known whether the blade keeps to the motion at the resonance: "
    "contacts lift off, and too few harmonics judge it",
    "take fewer contact.points, or model.harmonics = 15",
)
UNCONFIRMED = Reason(
    "under {loads} it is not known whether the blade keeps to the motion at the resonance: "
    "contacts lift off, and no motion of this scene can be judged",
    "take these amplitudes as unconfirmed; where contacts stay closed they are not in doubt",
)


def folded_curves(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Curves with several motions at one frequency."""
    for c in curves:
        count = int(c.branch.max(initial=0))
        if count > 1:
            yield LoadRemark(FOLDED, load_of(c), f"{count} branches between its folds")


def lower_motions(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances at whose frequency the blade may keep to a far lower motion: marched or measured
    from rest it may be the only one that is seen.
    """
    for c in curves:
        if c.lower is None:
            continue
        there = f"{1e6 * c.lower.rounded:g} um in place of {1e6 * c.curve_amplitude:.4g} um"
        doubt = f"; whether it lasts is not known: {c.lower.doubt}" if c.lower.doubt else ""
        yield LoadRemark(
            LOWER, load_of(c), f"some {there} at {c.peak_frequency:.5g} Hz{doubt}", f"some {there}"
        )


def unstable_resonances(curves: Sequence[Curve], accuracy: float) -> Iterator[LoadRemark]:
    """What became of the resonances that are unstable and not left for a ripple alone."""
    for c in curves:
        if c.unstable_peak is None:
            if c.march_replaces_balance:
                yield _marched_beside(c)
        elif not rippled(c, accuracy):
            yield _of_unstable(c, c.unstable_peak)


def _of_unstable(curve: Curve, top: Solution) -> LoadRemark:
    march = curve.march_at_peak
    at = _place(curve, top)
    named = f" ({curve.bifurcation[at]})" if curve.bifurcation[at] else ""
    where = f"unstable motion of {1e6 * size(top):.4g} um at {top.frequency:.5g} Hz{named}"
    marched = "" if march is None else f"; {march.sentence}"
    if curve.march_replaces_balance:
        if curve.keeps_unstable:
            reason = Reason(f"{MARCH_GIVEN}, {UNSTABLE_TOP}", AS_GIVEN)
            return LoadRemark(reason, load_of(curve), f"{where}{marched}")
        return _marched_from_flank(curve, UNSTABLE_TOP, where)
    if curve.keeps_unstable:
        known = march is not None and not march.reason
        reason = UNSTABLE_WITHIN_ERROR if known else UNSTABLE_KEPT
        return LoadRemark(reason, load_of(curve), f"{where}{marched}")
    given = f"{1e6 * curve.peak_amplitude:.4g} um at {curve.peak_frequency:.5g} Hz"
    return LoadRemark(UNSTABLE_LEFT_OUT, load_of(curve), f"{where}, given {given}{marched}")


def _marched_beside(curve: Curve) -> LoadRemark:
    """A march beside the highest motion, which is not known to be unstable, gives the resonance."""
    top = int(np.where(curve.converged, curve.amplitude, 0.0).argmax())
    judged = "was not judged" if curve.stability[top] == UNKNOWN else "lasts"
    driven = curve.march_at_peak is not None and curve.march_at_peak.drive > 1
    why = "a strong drive leads to a higher motion" if driven else "motions beside it do not last"
    where = f"{1e6 * curve.amplitude[top]:.4g} um at {curve.frequency[top]:.5g} Hz"
    return _marched_from_flank(
        curve, f"as the highest periodic motion {judged}, and {why}", f"periodic motion of {where}"
    )


def _marched_from_flank(curve: Curve, why: str, where: str) -> LoadRemark:
    """A march from another point than the highest one gives the resonance.

    Args:
        where: the highest periodic motion.
    """
    found = "" if curve.march_at_peak is None else f", {curve.march_at_peak.sentence}"
    at_end = curve.peak_frequency in (curve.frequency.min(), curve.frequency.max())
    start = f"from {1e6 * curve.balance_amplitude:.4g} um at {curve.peak_frequency:.5g} Hz"
    reason = Reason(f"{MARCH_GIVEN}, {why}", WIDER_BAND if at_end else AS_GIVEN)
    return LoadRemark(reason, load_of(curve), f"{where}; {start}{found}")


def resonances_in_time(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances that balances do not give and marches from frequency to frequency do."""
    for c in curves:
        if c.resonance_by_march is not None:
            yield LoadRemark(
                _found_by_marches(c.resonance_by_march), load_of(c), c.resonance_by_march.sentence
            )


def _found_by_marches(found: ResonanceInTime) -> Reason:
    law = " with the law of the layer" if found.by_law else ""
    return Reason(
        f"{MARCH_GIVEN}{law}, with {found.points} contact points a seat, since most contacts lift "
        "off",
        "use it with its error, which more contact.points lower",
        "The harmonic balance does not give the resonance there",
    )


def unjudged_resonances(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances whose motion could not be judged, among others that were. One that a march gives
    needs no verdict.
    """
    for c in curves:
        asked = not c.is_march and (c.stability != UNKNOWN).any()
        if asked and c.stability[_place(c, c.peak)] == UNKNOWN:
            yield LoadRemark(UNJUDGED, load_of(c))


def unmarched_motions(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances beside which marches from unstable motions are not known."""
    for c in curves:
        if c.flank_march_failure:
            yield LoadRemark(UNMARCHED, load_of(c), c.flank_march_failure)


def doubtful_resonances(curves: Sequence[Curve], unjudged: str = "") -> Iterator[LoadRemark]:
    """Resonances that lift off, are not known to be unstable by few harmonics, and could not be
    marched from.

    Args:
        unjudged: why no motion of any curve could be judged or marched; "" where some could.
    """
    for c in curves:
        march = c.march_at_peak
        if c.unstable_peak is not None or march is None or not march.reason:
            continue
        # a march with fewer contact points tells the error
        if c.error_march is not None:
            continue
        if unjudged:
            yield LoadRemark(UNCONFIRMED._replace(cause=unjudged), load_of(c))
        else:
            yield LoadRemark(DOUBTFUL._replace(cause=march.reason), load_of(c))


def selective_sweeps(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances that not every slow sweep comes to; none that marches have found."""
    for c in curves:
        reached, keeps = reach_of_resonance(c)
        if reached == ISOLATED:
            reason = Reason(
                "under {loads} no slow sweep reaches the resonance given, only motions that start "
                "near it",
                "judge by the resonance given; sweeps of a test rig may show less",
            )
            yield LoadRemark(reason, load_of(c), f"sweeps keep to {keeps}")
        elif reached:
            reason = Reason(
                f"under {{loads}} only a slow sweep {reached} reaches the resonance given",
                f"judge by the resonance given, and measure it with a sweep {reached}",
            )
            yield LoadRemark(reason, load_of(c), f"the other sweep keeps to {keeps}")


def _place(curve: Curve, point: Solution) -> int:
    """Number of a point of a curve; of several at one frequency the one of that height."""
    at = np.flatnonzero(curve.frequency == point.frequency)
    return int(at[abs(curve.amplitude[at] - size(point)).argmin()])

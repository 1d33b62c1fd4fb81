"""What is said of the stability of the motions of curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd

import numpy as np

from ...errors import InputError
from ...hbm.sector_modes import blades_of_wave
from ...hbm.solution import Solution, size
from ...hbm.stability import STABLE, UNIQUE, UNKNOWN, UNSTABLE
from ...scene.units import newtons
from ..adaptive.family import Family
from ..adaptive.settings import Settings
from ..stability.verdicts import model_in_time
from .curve import Curve, load_of
from .load_remarks import LoadRemark, sentences_of_kinds

# what remarks on several loads have in common
UNSTABLE_TOP = "the highest motion is unstable"
MARCH_GIVEN = "the amplitude given is that of an integration in time (a march)"


@dataclass(frozen=True)
class Disturbances:
    """Disturbances that the points of a travelling wave were judged against."""

    # after which they repeat, as the wave does; 1 where all move in phase, or no wave can be judged
    blades: int = 1
    # nodal diameters that they are made of, and how many the wheel has; none without a wheel
    diameters: tuple[int, ...] = ()
    possible: int = 0
    # why no wave can be judged
    reason: str = ""

    @property
    def sentence(self) -> str:
        """What was looked at, and what was not; "" where nothing is left."""
        if self.blades == 1:
            return ""
        found = f"disturbances that repeat after {self.blades} blades, as the wave does, were"
        if not self.diameters:
            return f"{found} considered, not those of other nodal diameters"
        listed = ", ".join(map(str, self.diameters))
        others = self.possible - len(self.diameters)
        return (
            f"{found} considered (nodal diameters {listed}), not those of the other {others} nodal "
            "diameters"
        )


def judged_disturbances(
    models: Family,
    settings: Settings,
    engine_order: int = 0,
    sectors: int = 0,
    flow: bool = False,
) -> Disturbances:
    """What the verdicts on a family of models look at.

    Args:
        sectors: of the wheel; 0 without one.
        flow: the waves have forces of a flow.
    """
    if flow:
        return Disturbances(
            reason="the flow's forces differ between the waves that would have to be marched"
        )
    try:
        blades = blades_of_wave(model_in_time(models, settings))
    except InputError as error:
        blades = sectors // gcd(sectors, engine_order) if sectors else 0
        if blades <= models.harmonics:
            return Disturbances(reason=str(error))
        return Disturbances(
            reason=f"the travelling wave of engine order {engine_order} repeats after {blades} of "
            f"{sectors} blades, which takes as many harmonics, and {models.harmonics} are known"
        )
    if not sectors:
        return Disturbances(blades)
    turned = ((h * engine_order) % sectors for h in range(blades))
    diameters = sorted({min(n, sectors - n) for n in turned})
    return Disturbances(blades, tuple(diameters), sectors // 2 + 1)


def stability_sentence(
    parts: Sequence[tuple[np.ndarray, np.ndarray]],
    judged: Disturbances = Disturbances(),
) -> str:
    """What was found on all curves, for the report.

    Args:
        parts: verdicts and multipliers of each curve.
        judged: what they looked at.
    """
    verdict, largest = (np.concatenate(column) for column in zip(*parts, strict=True))
    counts = {name: int((verdict == name).sum()) for name in (UNIQUE, STABLE, UNSTABLE, UNKNOWN)}
    if counts[UNIQUE]:
        return (
            "stability: normal loads are prescribed, so that each periodic motion is the only "
            "one, and stable"
        )
    if counts[UNKNOWN] == len(verdict) and judged.reason:
        return f"stability is unknown: no point could be judged, since {judged.reason}"
    if counts[UNKNOWN] == len(verdict):
        return (
            "stability is unknown: no point could be judged; it takes Coulomb's law, a wave that "
            "repeats after few blades, no more of them than model.harmonics where that is given, "
            "and not too many contact nodes that slip"
        )
    worst = ""
    # a motion that a march alone shows to be unstable has no multiplier
    if counts[UNSTABLE] and np.isfinite(largest).any():
        worst = f" (largest Floquet multiplier {np.nanmax(largest):.4g})"
    left_out = ""
    if counts[UNKNOWN]:
        left_out = (
            " (where the verdicts on a curve would cost more than its points, only the local "
            "maxima, the neighbours of the highest and points spread evenly are judged)"
        )
    wave = f"; {judged.sentence}" if judged.sentence else ""
    return (
        f"stability: {counts[STABLE]} points stable, {counts[UNSTABLE]} unstable{worst}, "
        f"{counts[UNKNOWN]} not judged{left_out}{wave}"
    )


def ripple_sentence(curves: Sequence[Curve], accuracy: float) -> str:
    """The resonances that are unstable, but left for a motion of the same amplitude within an
    accuracy, or "".

    A rigid damper on its contacts has no damping at its own frequencies of some kilohertz: there
    small ripples grow, and the blade hardly takes note of them.
    """
    moved = [
        c.march_at_peak.farthest(size(c.unstable_peak))
        for c in curves
        if c.unstable_peak is not None and c.march_at_peak is not None and _rippled(c, accuracy)
    ]
    if not moved:
        return ""
    loads = ", ".join(newtons(c.load) for c in curves if _rippled(c, accuracy))
    return (
        f"under {loads} the motion at the resonance is unstable to a ripple; marched in time from "
        f"there the amplitude stays within {100 * max(moved):.1f} % of the one given"
    )


def _rippled(curve: Curve, accuracy: float) -> bool:
    # with little room beside the mesh's error a march is given that keeps within the accuracy
    if curve.march_replaces_balance or not curve.keeps_unstable or curve.march_at_peak is None:
        return False
    return curve.march_at_peak.holds(size(curve.peak), accuracy)


def folded_sentence(curves: Sequence[Curve]) -> str:
    """The curves with several motions at one frequency, or ""."""
    pieces = {newtons(c.load): int(c.branch.max(initial=0)) for c in curves}
    each = ", ".join(f"{load} ({count} branches)" for load, count in pieces.items() if count > 1)
    if not each:
        return ""
    return (
        "the blade has several steady vibrations (motions) at one frequency, as the curve folds "
        f"back over itself; branches between its folds: {each}"
    )


def unstable_sentences(curves: Sequence[Curve], accuracy: float) -> list[str]:
    """What became of the resonances that are unstable and not left for a ripple alone."""
    return sentences_of_kinds(_of_unstable(curve, accuracy) for curve in curves)


def _of_unstable(curve: Curve, accuracy: float) -> LoadRemark | None:
    top, march = curve.unstable_peak, curve.march_at_peak
    if top is None:
        return _from_a_flank(curve)
    if _rippled(curve, accuracy):
        return None
    at = _place(curve, top)
    named = f" ({curve.bifurcation[at]})" if curve.bifurcation[at] else ""
    where = f"under {load_of(curve)}, {1e6 * size(top):.4g} um at {top.frequency:.5g} Hz{named}"
    if curve.march_replaces_balance and not curve.keeps_unstable:
        return LoadRemark(
            f"{UNSTABLE_TOP}; {MARCH_GIVEN}", f"{where}: {_marched_from_flank(curve)}"
        )
    marched = "" if march is None else f": {march.sentence}"
    if curve.march_replaces_balance:
        return LoadRemark(f"{UNSTABLE_TOP}; {MARCH_GIVEN}", f"{where}{marched}")
    if curve.keeps_unstable and march is not None and not march.reason:
        return LoadRemark(f"{UNSTABLE_TOP}; it is given as the resonance", f"{where}{marched}")
    if curve.keeps_unstable:
        given = "it is given as the resonance, being the larger amplitude"
        return LoadRemark(f"{UNSTABLE_TOP}; {given}", f"{where}{marched}")
    instead = f"{1e6 * curve.peak_amplitude:.4g} um at {curve.peak_frequency:.5g} Hz"
    given = "the resonance given is the highest one that is not"
    return LoadRemark(f"{UNSTABLE_TOP}; {given}", f"{where}, given {instead}{marched}")


def _from_a_flank(curve: Curve) -> LoadRemark | None:
    """Where a march beside the highest motion, which is not known to be unstable, gives the
    resonance.
    """
    if not curve.march_replaces_balance:
        return None
    top = int(np.where(curve.converged, curve.amplitude, 0.0).argmax())
    judged = "was not judged" if curve.stability[top] == UNKNOWN else "lasts"
    driven = curve.march_at_peak is not None and curve.march_at_peak.drive > 1
    why = "a strong drive leads to a higher one" if driven else "motions beside it do not last"
    where = (
        f"under {load_of(curve)}, {1e6 * curve.amplitude[top]:.4g} um at "
        f"{curve.frequency[top]:.5g} Hz"
    )
    return LoadRemark(
        f"the highest motion {judged}, and {why}; {MARCH_GIVEN}",
        f"{where}: {_marched_from_flank(curve)}",
    )


def _marched_from_flank(curve: Curve) -> str:
    """What the resonance was marched from, and what was found."""
    found = "" if curve.march_at_peak is None else f", {curve.march_at_peak.sentence}"
    ends = {curve.frequency.min(): "first", curve.frequency.max(): "last"}
    end = ends.get(curve.peak_frequency)
    beyond = f", the {end} point of the band, beyond which it may be higher" if end else ""
    return (
        f"from {1e6 * curve.balance_amplitude:.4g} um at {curve.peak_frequency:.5g} Hz"
        f"{beyond}{found}"
    )


def unmarched_sentence(curves: Sequence[Curve]) -> str:
    """The resonances beside which marches from unstable motions are not known, or ""."""
    each = ", ".join(
        f"{newtons(c.load)} ({c.flank_march_failure})" for c in curves if c.flank_march_failure
    )
    if not each:
        return ""
    return (
        "motions nearly as high as the resonance are unstable, and what the blade keeps to after "
        f"some of them is not known, it may be higher: {each}"
    )


def undriven_sentence(curves: Sequence[Curve]) -> str:
    """The resonances beside which no motion was sought that only a strong drive leads to, or ""."""
    loads = ", ".join(newtons(c.load) for c in curves if c.strong_drive_skipped)
    if not loads:
        return ""
    return (
        f"under {loads} contacts lift off, and motions that only a strong drive leads to were not "
        "sought: marches of this model take too long"
    )


def lower_sentence(curves: Sequence[Curve]) -> str:
    """The resonances at whose frequency the blade may keep to a far lower motion, or "": marched or
    measured from rest it may be the only one that is seen.
    """
    each = ", ".join(
        f"some {1e6 * c.lower.rounded:g} um in place of {1e6 * c.curve_amplitude:.4g} um at "
        f"{c.peak_frequency:.5g} Hz under {newtons(c.load)}"
        + (f" (whether it lasts is not known: {c.lower.doubt})" if c.lower.doubt else "")
        for c in curves
        if c.lower is not None
    )
    if not each:
        return ""
    return (
        "contacts lift off at the resonance, and from rest the blade may keep to another, lower "
        f"motion at the same frequency: {each}; the larger one is given, and the error reported is "
        "that of this one alone"
    )


def unjudged_sentence(curves: Sequence[Curve]) -> str:
    """The resonances whose motion could not be judged, among others that were, or "". One that a
    march gives needs no verdict.
    """
    asked = [c for c in curves if not c.is_march and (c.stability != UNKNOWN).any()]
    unknown = [c for c in asked if c.stability[_place(c, c.peak)] == UNKNOWN]
    if not unknown:
        return ""
    loads = ", ".join(newtons(c.load) for c in unknown)
    return (
        f"under {loads} the motion at the resonance was not judged: it may be unstable, and the "
        "blade leave it for another"
    )


def doubtful_sentence(curves: Sequence[Curve], unjudged: str = "") -> str:
    """The resonances that lift off, are not known to be unstable by few harmonics, and could not be
    marched from, or "".

    Args:
        unjudged: why no motion of any curve could be judged or marched; "" where some could.
    """
    # loads that share a reason say it once
    by_reason: dict[str, list[str]] = {}
    for c in curves:
        if (
            c.unstable_peak is None
            and c.march_at_peak is not None
            and c.march_at_peak.reason
            # a march with fewer contact points tells the error
            and c.error_march is None
        ):
            by_reason.setdefault(unjudged or c.march_at_peak.reason, []).append(newtons(c.load))
    if not by_reason:
        return ""
    each = "; ".join(f"{', '.join(loads)} ({reason})" for reason, loads in by_reason.items())
    judged = "" if unjudged else "too few harmonics judge it, "
    return (
        f"contacts lift off at the resonance, {judged}and whether the blade keeps to it is not "
        f"known: {each}"
    )


def _place(curve: Curve, point: Solution) -> int:
    """Number of a point of a curve; of several at one frequency the one of that height."""
    at = np.flatnonzero(curve.frequency == point.frequency)
    return int(at[abs(curve.amplitude[at] - size(point)).argmin()])

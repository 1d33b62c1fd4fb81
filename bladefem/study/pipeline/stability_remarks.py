"""How the motions of curves were judged, and how far that reaches: sentences on the method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import gcd

import numpy as np

from ...errors import InputError
from ...hbm.sector_modes import blades_of_wave
from ...hbm.solution import size
from ...hbm.stability import STABLE, UNIQUE, UNKNOWN, UNSTABLE
from ...scene.units import newtons
from ...util.message import Message, method
from ..adaptive.family import Family
from ..adaptive.settings import Settings
from ..stability.verdicts import model_in_time
from .curve import Curve


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
) -> Message:
    """What was found on all curves, with what was judged in the details.

    Args:
        parts: verdicts and multipliers of each curve.
        judged: what they looked at.
    """
    verdict, largest = (np.concatenate(column) for column in zip(*parts, strict=True))
    counts = {name: int((verdict == name).sum()) for name in (UNIQUE, STABLE, UNSTABLE, UNKNOWN)}
    if counts[UNIQUE]:
        return method(
            "stability: normal loads are prescribed, so that each periodic motion is the only "
            "one, and stable"
        )
    if counts[UNKNOWN] == len(verdict) and judged.reason:
        return method(f"stability is unknown: no point could be judged, since {judged.reason}")
    if counts[UNKNOWN] == len(verdict):
        return method(
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
            "where the verdicts on a curve would cost more than its points, only the local "
            "maxima, the neighbours of the highest and points spread evenly are judged"
        )
    return method(
        f"stability: {counts[STABLE]} points stable, {counts[UNSTABLE]} unstable{worst}, "
        f"{counts[UNKNOWN]} not judged",
        detail="; ".join(filter(None, [left_out, judged.sentence])),
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
        if c.unstable_peak is not None and c.march_at_peak is not None and rippled(c, accuracy)
    ]
    if not moved:
        return ""
    loads = ", ".join(newtons(c.load) for c in curves if rippled(c, accuracy))
    return (
        f"under {loads} the motion at the resonance is unstable to a ripple; marched in time from "
        f"there the amplitude stays within {100 * max(moved):.1f} % of the one given"
    )


def rippled(curve: Curve, accuracy: float) -> bool:
    """The resonance is unstable, and marched in time from there the amplitude stays within an
    accuracy.
    """
    # with little room beside the mesh's error a march is given that keeps within the accuracy
    if curve.march_replaces_balance or not curve.keeps_unstable or curve.march_at_peak is None:
        return False
    return curve.march_at_peak.holds(size(curve.peak), accuracy)


def undriven_sentence(curves: Sequence[Curve]) -> str:
    """The resonances beside which no motion was sought that only a strong drive leads to, or ""."""
    loads = ", ".join(newtons(c.load) for c in curves if c.strong_drive_skipped)
    if not loads:
        return ""
    return (
        f"under {loads} contacts lift off, and motions that only a strong drive leads to were not "
        "sought: marches of this model take too long"
    )

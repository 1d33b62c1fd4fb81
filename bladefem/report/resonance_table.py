"""The resonances of all loads, where a load has several or not every sweep comes to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import pandas as pd

from ..hbm.stability import STABLE, UNKNOWN
from ..study.pipeline.curve import Curve
from ..study.pipeline.resonance_list import LocalResonance, local_resonances, motions_at
from ..view.response import MARCHED

# how a lower motion at the frequency of a resonance is reached
FROM_REST = "from rest"


def resonance_table(curves: Sequence[Curve]) -> dict[str, pd.DataFrame]:
    """One row a local maximum, one of a resonance that a march in time gives in place of the
    balance, and one of a lower motion at its frequency; no table where each load has one row,
    which the summary lists.
    """
    listed = [
        (curve, [*_marched(curve), *local_resonances(curve), *_lower(curve)]) for curve in curves
    ]
    if all(len(found) <= 1 for _, found in listed):
        return {}
    rows = [
        {
            "load": curve.load,
            **({} if curve.mass is None else {"mass": curve.mass}),
            **asdict(resonance),
        }
        for curve, found in listed
        for resonance in found
    ]
    return {"response/local_resonances": pd.DataFrame(rows)}


def _marched(curve: Curve) -> list[LocalResonance]:
    """The resonance that a march gives; it lies on none of the paths of balances."""
    if curve.curve_amplitude == curve.balance_amplitude:
        return []
    frequency, height = curve.peak_frequency, curve.peak_amplitude
    march = curve.march_at_peak
    driven = curve.resonance_by_march is None and march is not None and march.drive > 1
    reached = f"{MARCHED} after a strong drive" if driven else MARCHED
    return [LocalResonance(frequency, height, STABLE, "", motions_at(curve, frequency), reached)]


def _lower(curve: Curve) -> list[LocalResonance]:
    """The lower motion at the frequency of the resonance that is given; no maximum of its own."""
    if curve.lower is None:
        return []
    frequency = curve.peak_frequency
    stability = UNKNOWN if curve.lower.doubt else STABLE
    motions = motions_at(curve, frequency)
    return [LocalResonance(frequency, curve.lower.rounded, stability, "", motions, FROM_REST)]

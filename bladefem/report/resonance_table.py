"""The resonances of all loads, where a load has several or not every sweep comes to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import pandas as pd

from ..hbm.stability import STABLE
from ..study.pipeline.curve import Curve
from ..study.pipeline.resonance_list import LocalResonance, local_resonances, motions_at
from ..view.response import MARCHED


def resonance_table(curves: Sequence[Curve]) -> dict[str, pd.DataFrame]:
    """One row a local maximum, and one of a resonance that a march in time gives in place of the
    balance; no table where each load has one, which the summary lists.
    """
    listed = [(curve, [*_marched(curve), *local_resonances(curve)]) for curve in curves]
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

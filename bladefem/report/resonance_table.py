"""The resonances of all loads, where a load has several or not every sweep comes to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import pandas as pd

from ..study.pipeline.loads import Curve
from ..study.pipeline.resonance_list import local_resonances


def resonance_table(curves: Sequence[Curve]) -> dict[str, pd.DataFrame]:
    """One row a local maximum; no table where each load has one, which the summary lists."""
    listed = [(curve, local_resonances(curve)) for curve in curves]
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

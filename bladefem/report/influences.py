"""Tables of what the best load depends on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..study.influences import HEIGHT_TOLERANCE, Influence
from ..study.pipeline.best_load import BestLoad

PARAMETER_NAMES = {
    "kt": "tangential stiffness",
    "kn": "normal stiffness",
    "roughness": "roughness of the seats",
    "mu": "friction coefficient",
    "damping": "damping ratio",
    "seat friction": "friction while seating",
}
QUANTITIES = ("load", "amplitude", "frequency")


def influence_table(found: Sequence[Influence], best: BestLoad) -> pd.DataFrame:
    """One row a parameter: range, logarithmic derivatives, and values at both ends, SI units."""
    now = {"load": best.load, "amplitude": best.amplitude, "frequency": best.frequency}
    rows = []
    for one in found:
        row = {
            "parameter": PARAMETER_NAMES[one.parameter.name],
            "low": one.parameter.low,
            "high": one.parameter.high,
            "range_from": one.parameter.range_from,
        }
        for i, name in enumerate(QUANTITIES):
            row[f"{name}_by_parameter"] = getattr(one, name)
            row[f"{name}_now"] = now[name]
            for j, end in enumerate(("low", "high")):
                row[f"{name}_{end}"] = one.predicted[j, i]
                row[f"{name}_{end}_solved"] = one.solved[j, i]
        rows.append(row)
    return pd.DataFrame(rows)


def influence_sentence(found: Sequence[Influence]) -> str:
    """The largest influence in words, and where the derivatives do not carry over the range."""
    top = found[0]
    low, high = top.parameter.low, top.parameter.high
    known = [one for one in found if np.isfinite(one.solved).all()]
    checked = ""
    if known:
        off = np.abs(np.log([one.predicted / one.solved for one in known])).max(axis=(0, 1))
        load, amplitude, _ = 100 * np.expm1(off)
        checked = (
            f"; solved again at the ends of {len(known)} ranges, the derivatives are off by up to "
            f"{amplitude:.2g} % of the amplitude and {load:.2g} % of the best load there, searched "
            f"until the amplitude falls by less than {100 * HEIGHT_TOLERANCE:g} %"
        )
    failed = "".join(f"; {one.reason}" for one in found if one.reason)
    name = PARAMETER_NAMES[top.parameter.name]
    return (
        f"the best amplitude depends most on the {name}: over {low:.3g} to "
        f"{high:.3g} times its value it changes by a factor of {np.exp(top.span):.3g} by the exact "
        f"derivative{checked}{failed}"
    )

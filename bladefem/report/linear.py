"""The optimal linear approximation of the contacts at each resonance (Eq. 7-16): columns, a table,
a sentence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..data import Patch
from ..study.pipeline.contact_cycle import ContactCycle


def linear_columns(cycle: ContactCycle) -> dict[str, np.ndarray]:
    """K_ad [N/m], C_ad [N s/m] and F_c0 [N] of each node, for each tangent; nan at rest."""
    kinds = {
        "k_ad": cycle.linear.stiffness,
        "c_ad": cycle.linear.damping,
        "f_c0": cycle.linear.constant,
    }
    return {
        f"{name}_t{t + 1}": values[:, t]
        for name, values in kinds.items()
        for t in range(values.shape[1])
    }


def harmonic_table(patches: Sequence[Patch], cycles: Sequence[ContactCycle]) -> pd.DataFrame:
    """K_ad [N/m] and C_ad [N s/m] of each harmonic: one row a resonance, node, tangent and
    harmonic; nan where at rest.

    Nodes are numbered from 1 along the rows of ``node_table``.
    """
    names = np.repeat([p.seat for p in patches], [len(p.area) for p in patches])
    frames = []
    for c in cycles:
        node, tangent, harmonic = (
            index.ravel() for index in np.indices(c.harmonic.stiffness.shape)
        )
        frames.append(
            pd.DataFrame(
                {
                    "load": c.load,
                    **({} if c.mass is None else {"mass": c.mass}),
                    "patch": names[node],
                    "node": node + 1,
                    "tangent": tangent + 1,
                    "harmonic": harmonic + 1,
                    "k_ad": c.harmonic.stiffness.ravel(),
                    "c_ad": c.harmonic.damping.ravel(),
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


def linear_sentence(cycles: Sequence[ContactCycle]) -> str:
    """For the report: whether the approximation does the work of the friction forces."""
    worst = max(cycle.mismatch for cycle in cycles)
    return (
        "K_ad, C_ad and F_c0 of nodes.csv are the linear element closest to each friction element "
        "at its resonance (by harmonic in results.nc, group approximation): the work of a period "
        f"is that of friction, apart by {worst:.0e} of the largest"
    )

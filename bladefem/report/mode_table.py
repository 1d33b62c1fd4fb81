"""Natural frequencies as a table, by nodal diameter and family."""

from __future__ import annotations

import numpy as np
import pandas as pd

from geometry.mesh import Mesh

from ..data import ModeSet
from ..study.modes.comparison import family_references, name_modes


def mode_table(
    sets: list[ModeSet],
    geometry: Mesh,
    clamped: ModeSet | None = None,
) -> pd.DataFrame:
    """One row a mode of each nodal diameter, named after the clamped blade's modes where these are
    given.
    """
    references = family_references(geometry, clamped)
    rows = [
        pd.DataFrame(
            {
                "nodal_diameter": 0 if s.nodal_diameter is None else s.nodal_diameter,
                "mode": np.arange(1, len(s.frequencies) + 1),
                "frequency": s.frequencies,
                "family": name_modes(s, references)["family"],
                "residual": s.residuals,
            }
        )
        for s in sets
    ]
    return pd.concat(rows, ignore_index=True)

"""Effective masses of the whole wheel from the modes of one sector.

A translation along the axis and a rotation about it move all sectors alike (nodal diameter 0); a
translation across the axis is the sum of two waves of nodal diameter 1, e_x = (r + r*) / 2 with r =
e_x + j e_y, which R turns into e^{-j theta} r. In half a wheel both translations change their sign
from sector to sector, so that modes of nodal diameter 1 follow each by itself. Other nodal
diameters carry no rigid motion (Clough and Penzien, Dynamics of Structures, sect. 26).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from geometry.mesh import counting_sense, sector_of

from ...data import ModeSet
from .comparison import rigid_motion

if TYPE_CHECKING:
    from ...fem.body import Body


def effective_masses(sets: Sequence[ModeSet], body: Body) -> pd.DataFrame:
    """One row a mode and direction that it can follow.

    Args:
        sets: modes of a body, or of nodal diameters of a wheel; those beyond 1 have no row.
        body: fem.body.Body, for its mass; collective on its ranks.

    Returns:
        nodal_diameter (wheels), mode, frequency [Hz], direction, factor [kg^1/2 or kg^1/2 m] of
        participation with mass-normalised modes of the whole wheel (both waves of a pair together),
        effective_mass [kg or kg m^2] its square, share [1] of the rigid mass, sum [1] of the shares
        up to this mode.
    """
    frames = [
        _mass_rows(modes, body, direction, factor)
        for modes in sets
        for direction, factor in _mass_directions(modes, body)
    ]
    columns = ["mode", "frequency", "direction", "factor", "effective_mass", "share", "sum"]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=columns)


def _mass_directions(modes: ModeSet, body: Body) -> list[tuple[str, float]]:
    """Directions of one set, with the factor from a sector to the wheel."""
    n = modes.nodal_diameter
    plane = body.dim == 2
    if n is None:
        return [
            (name, 1.0) for name in (("x", "y") if plane else ("x", "y", "z", "rx", "ry", "rz"))
        ]
    count = float(sector_of(body.mesh).count)
    return {
        0: [("rz", count)] if plane else [("z", count), ("rz", count)],
        1: [("x", count), ("y", count)] if count == 2 else [("x, y", count / 2)],
    }.get(n, [])


def _mass_rows(
    modes: ModeSet,
    body: Body,
    direction: str,
    factor: float,
) -> pd.DataFrame:
    from ...fem.gyroscopic import own_rows
    from ...fem.linalg import apply_block, inner_products

    points = body.mesh.points
    if direction == "x, y":
        rigid = rigid_motion(points, "x") + 1j * counting_sense(body.mesh) * rigid_motion(
            points, "y"
        )
    else:
        rigid = rigid_motion(points, direction)
    inside = (body.rows >= 0)[:, None]
    r = own_rows(body, np.where(inside, rigid, 0.0)[None])
    moved = apply_block(body.mass, r)
    total = inner_products(body.comm, r, moved)[0, 0].real
    coupling = inner_products(body.comm, own_rows(body, modes.shapes), moved)[:, 0]
    share = np.abs(coupling) ** 2 / total
    table = pd.DataFrame(
        {
            "mode": np.arange(1, len(share) + 1),
            "frequency": modes.frequencies,
            "direction": direction,
            "factor": np.sqrt(factor * total * share),
            "effective_mass": factor * share * total,
            "share": share,
            "sum": np.cumsum(share),
        }
    )
    if modes.nodal_diameter is not None:
        table.insert(0, "nodal_diameter", modes.nodal_diameter)
    return table

"""A wedge: both flanks, blunted at the top by a straight edge and at the bottom by a box."""

from __future__ import annotations

import numpy as np

from .record import DamperShape


def wedge_outline(flanks: np.ndarray, base: float) -> np.ndarray:
    """Six corners: foot, inner and outer end on this blade's side, and back on the next one's."""
    drop = np.array([base, 0.0])
    (inner, outer), (inner_next, outer_next) = flanks
    return np.array([inner - drop, inner, outer, outer_next, inner_next, inner_next - drop])


SHAPE = DamperShape("wedge", wedge_outline)

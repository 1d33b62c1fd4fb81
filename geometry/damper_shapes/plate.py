"""A flat plate: both seats in one plane, across the radial line midway between the blades.

Rotation presses it outwards against both undersides, each with half of its centrifugal force.
Friction alone holds it in the plane of the seats.
"""

from __future__ import annotations

import numpy as np

from bladefem.errors import InputError

from .record import DamperShape

# of the seat's width: how far its ends may lie from one plane
FLATNESS_TOLERANCE = 1e-6


def plate_outline(flanks: np.ndarray, base: float) -> np.ndarray:
    """A rectangle of height ``base``, the seats at both ends of its top.

    Raises:
        InputError: seats that are not in one plane across the radial line between the blades.
    """
    (inner, outer), (inner_next, outer_next) = flanks
    heights = flanks[..., 0]
    if np.ptp(heights) > FLATNESS_TOLERANCE * np.linalg.norm(outer - inner):
        raise InputError(
            "damper.shape = 'plate': the seats are not in one plane, expected "
            "damper.angle = '90 deg', or platform faces across the radial line between the blades"
        )
    drop = np.array([base, 0.0])
    return np.array([inner - drop, inner, outer, outer_next, inner_next, inner_next - drop])


SHAPE = DamperShape("plate", plate_outline)

"""Displacements in contact of all blades from the modes of their ring, and forces in these modes.

What a blade sees of a motion is what the first one sees of it handed back so many blades. With the
readings of the first blade, and what handing back does to the two modes of a pair, those of all are
known: they fit into the fastest memory of a processor, where a matrix of all of them does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..util.numba_options import INNER_KERNEL, KERNEL
from .ring_contacts import in_places
from .sector_modes import SectorModes

# entries of a hand-over that are no more than rounding
ROUNDING = 1e-9


class RingReadings(NamedTuple):
    """Of the k displacements of each of r blades in M modes."""

    # (M, k) displacements of the first blade by each mode [kg^-1/2], and the transpose
    by_mode: np.ndarray
    by_displacement: np.ndarray
    # (r, M): a motion q handed back is along q + across q[partner]
    along: np.ndarray
    across: np.ndarray
    # (M,) number of the other mode of a pair, or of the mode itself where it has none
    partner: np.ndarray


def ring_readings(system: SectorModes, places: np.ndarray) -> RingReadings:
    """Of the contact displacements of a blade in these places of a row; -1: none."""
    r, M = system.blades, len(system.stiffness)
    own = np.arange(M)
    apart = abs(system.turn - np.diag(np.diag(system.turn)))
    partner = np.where(apart.max(axis=1) > ROUNDING, apart.argmax(axis=1), own)
    back = np.array([np.linalg.matrix_power(system.turn.T, b) for b in range(r)])
    first = in_places(system.contact[: len(system.contact) // r].T, places)
    return RingReadings(
        first,
        first.T.copy(),
        back[:, own, own].copy(),
        np.where(partner == own, 0.0, back[:, own, partner]),
        partner,
    )


@njit(**KERNEL)
def displacements(readings, q):
    """(r, k) displacements of modal coordinates q (M,)."""
    r, M = readings.along.shape
    seen = np.empty((r, M))
    for b in range(r):
        for i in range(M):
            other = q[readings.partner[i]]
            seen[b, i] = readings.along[b, i] * q[i] + readings.across[b, i] * other
    return np.dot(seen, readings.by_mode)


@njit(**INNER_KERNEL)
def modal_forces(readings, forces):
    """(M,) forces in the modes of forces (r, k) on the blades."""
    r, M = readings.along.shape
    seen = np.dot(forces, readings.by_displacement)
    total = np.zeros(M)
    for b in range(r):
        for i in range(M):
            # of a pair each mode's part across is the other's with the sign turned
            other = seen[b, readings.partner[i]]
            total[i] += readings.along[b, i] * seen[b, i] - readings.across[b, i] * other
    return total

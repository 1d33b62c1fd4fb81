"""Bodies with the springs of the contacts that stay closed, seen from the forces that friction
still decides.

A node that sticks throughout a period is a spring in all directions, and a node that never lifts
off is one in its normal direction. Such springs join the bodies, whose steps in time are exact:
fewer forces are left to be followed, and the high frequencies of a damper on its normal springs
bring no error of sampling. Modes that the springs couple stay together in groups.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph, csr_array

from .sector_modes import SectorModes

# entry of a stiffness or damping matrix over its largest one that couples no modes
UNCOUPLED = 1e-13


@dataclass(frozen=True)
class OpenContacts:
    """q'' + D q' + K q = -P f and w = U q - R f, of the nodes that do not stick throughout; M
    modes, n nodes of d directions, m forces f that are not those of closed springs.
    """

    # (M, M) K [1/s^2] and D [1/s]
    stiffness: np.ndarray
    damping: np.ndarray
    # (M, m) P [kg^-1/2]
    push: np.ndarray
    # (n d, M) U [kg^-1/2]
    reading: np.ndarray
    # (n d, m) R [m/N]
    flexibility: np.ndarray
    # (n d,) number of the force in each direction, -1: that of a closed spring
    force: np.ndarray
    # modes of each group that stiffness and damping couple
    groups: tuple[np.ndarray, ...]


def open_contacts(
    system: SectorModes,
    stuck: np.ndarray,
    pressed: np.ndarray,
    springs: np.ndarray,
) -> OpenContacts:
    """The system with the springs of closed contacts.

    Args:
        stuck, pressed: (nodes,) node sticks throughout; its normal direction, the first one, is a
            spring throughout.
        springs: (nodes, d) stiffness in full stick [N/m].
    """
    d = springs.shape[1]
    closed_rows = np.repeat(stuck[:, None], d, axis=1)
    closed_rows[:, 0] |= pressed
    closed_rows &= springs > 0
    closed = np.flatnonzero(closed_rows)
    # a stuck node without stiffness in a direction carries no force there
    moving = np.repeat(~stuck, d)
    free = np.flatnonzero(moving & ~closed_rows.ravel())
    K = system.stiffness_matrix
    U = system.contact[free]
    R = system.residual[np.ix_(free, free)]
    reading = np.zeros((len(moving), len(K)))
    flexibility = np.zeros((len(moving), len(free)))
    if len(closed):
        k = springs.ravel()[closed]
        joint = np.linalg.inv(np.diag(1 / k) + system.residual[np.ix_(closed, closed)])
        across = system.residual[np.ix_(closed, free)]
        forces = joint @ system.contact[closed]
        relief = joint @ across
        K = K + system.contact[closed].T @ forces
        U = U - across.T @ forces
        R = R - across.T @ relief
        reading[closed] = forces / k[:, None]
        flexibility[closed] = relief / k[:, None]
    reading[free] = U
    flexibility[free] = R
    force = np.full(len(moving), -1)
    force[free] = np.arange(len(free))
    return OpenContacts(
        K,
        system.damping,
        np.ascontiguousarray(U.T),
        reading[moving],
        flexibility[moving],
        force[moving],
        coupled_groups(K, system.damping),
    )


def coupled_groups(stiffness: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, ...]:
    """Numbers of the modes of each group that neither matrix (M, M) couples to others."""
    couples = np.zeros(stiffness.shape, dtype=bool)
    for matrix in (stiffness, damping):
        couples |= abs(matrix) > UNCOUPLED * max(abs(matrix).max(initial=0.0), 1e-300)
    count, label = csgraph.connected_components(csr_array(couples), directed=False)
    return tuple(np.flatnonzero(label == g) for g in range(count))

"""Stress of periodic motion: the largest von Mises stress of all harmonics together, where, and how
much of it the mesh leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .body import Body
from .stress import mises_vector, nodal_stress, stress_jumps, von_mises
from .stress_error import mesh_error

# instants of a period for each harmonic, the highest one included: between two of them a stress is
# larger by 0.12 % at most
INSTANTS_PER_HARMONIC = 64
# looked at together, to spare memory
INSTANTS_AT_A_TIME = 64
# nodes that are followed in time: those with the largest sum of the harmonics' own stresses
MAX_NODES_IN_TIME = 4000
# places where the mesh may hide a larger stress
RIVAL_PLACES = 12
# harmonics below this share of the largest one's displacement are left out
NEGLIGIBLE_HARMONIC_SHARE = 1e-5


@dataclass(frozen=True)
class AlternatingStress:
    """The largest von Mises stress that the alternating motion reaches in a period."""

    # [Pa], at a node
    largest: float
    # (3,) where [m]
    place: np.ndarray
    # (H,) of each harmonic alone at that place, harmonic 1 first [Pa]
    by_harmonic: np.ndarray
    # estimated relative error by the mesh: what the largest stress may be at this place or at one
    # where the mesh leaves more open, see `stress_error.mesh_error`
    mesh_error: float
    # (n_points,) at each node [Pa]; of nodes that are far from the largest the sum of the
    # harmonics' own amplitudes, which is not below it
    field: np.ndarray


def alternating_stress(
    body: Body,
    harmonics: np.ndarray,
    touched: np.ndarray | None = None,
) -> AlternatingStress:
    """Stress of the motion Re(sum over h of u_h e^{j h w t}), by the recovered nodal stresses.

    Args:
        harmonics: (H, n_points, dim) complex displacements of harmonics 1..H [m].
        touched: (n_points,) True where tractions may act; without it free faces do not count in the
            estimated error.
    """
    size = np.array([np.abs(u).max() for u in harmonics])
    kept = [h for h in range(len(harmonics)) if size[h] > NEGLIGIBLE_HARMONIC_SHARE * size.max()]
    found = np.array([nodal_stress(body, harmonics[h]) for h in kept])
    own = von_mises(found)
    # the sum of the harmonics' own maxima bounds what they reach together
    bound = own.sum(axis=0)
    count = min(MAX_NODES_IN_TIME, bound.size)
    nodes = np.argpartition(bound, -count)[-count:]
    largest = _largest_in_period(found[:, nodes], np.array(kept) + 1)
    field = bound.copy()
    field[nodes] = largest
    worst = int(largest.argmax())
    node = int(nodes[worst])
    by_harmonic = np.zeros(len(harmonics))
    by_harmonic[kept] = own[:, node]
    strongest = int(own[:, node].argmax())
    u = harmonics[kept[strongest]]
    possible = bound + stress_jumps(body, u, found[strongest])
    rivals = np.argpartition(possible, -min(RIVAL_PLACES, count))[-min(RIVAL_PLACES, count) :]
    highest = [
        bound[rival] * (1 + mesh_error(body, u, found[strongest], int(rival), touched))
        for rival in rivals
    ]
    own_error = mesh_error(body, u, found[strongest], node, touched)
    return AlternatingStress(
        float(largest[worst]),
        body.mesh.points[node],
        by_harmonic,
        max(own_error, float(max(highest) / bound[node] - 1)),
        field,
    )


def _largest_in_period(stress: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """(n,) largest von Mises stress of Re(sum over h of s_h e^{j orders_h w t}) in a period [Pa].

    Args:
        stress: (h, n, 6) complex [Pa].
        orders: (h,) harmonics, ascending.
    """
    instants = INSTANTS_PER_HARMONIC * int(orders[-1])
    angle = np.outer(2 * np.pi * np.arange(instants) / instants, orders)
    turns = np.concatenate([np.cos(angle), -np.sin(angle)], axis=1)
    vector = mises_vector(stress).reshape(len(orders), -1)
    parts = np.concatenate([vector.real, vector.imag])
    largest = np.zeros(stress.shape[1])
    for turn in np.array_split(turns, -(-instants // INSTANTS_AT_A_TIME)):
        # matrix products: einsum takes several times as long
        now = (turn @ parts).reshape(len(turn), len(largest), -1)
        largest = np.maximum(largest, (now * now).sum(axis=2).max(axis=0))
    return np.sqrt(largest)

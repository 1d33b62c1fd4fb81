"""Stress of periodic motion: the largest von Mises stress of all harmonics together, where, and how
much of it the mesh leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .body import Body
from .stress import GaussStress, gauss_stress, nodal_stress, von_mises

__all__ = ["AlternatingStress", "alternating_stress", "mesh_error"]

# instants of a period for each harmonic, the highest one included
INSTANTS = 16
# Gauss points that are followed in time: those with the largest sum of the harmonics' own stresses
FOLLOWED = 4000
# harmonics below this share of the largest one's stress are left out
NEGLIGIBLE = 1e-5


@dataclass(frozen=True)
class AlternatingStress:
    """The largest von Mises stress that the alternating motion reaches in a period."""

    # [Pa], at a Gauss point
    largest: float
    # (3,) where [m]
    place: np.ndarray
    # (H,) of each harmonic alone at that place, harmonic 1 first [Pa]
    by_harmonic: np.ndarray
    # estimated relative error by the mesh, see `mesh_error`
    mesh_error: float


def alternating_stress(body: Body, harmonics: np.ndarray) -> AlternatingStress:
    """Stress of the motion Re(sum over h of u_h e^{j h w t}).

    Args:
        harmonics: (H, n_points, dim) complex displacements of harmonics 1..H [m].
    """
    size = np.array([np.abs(u).max() for u in harmonics])
    kept = [h for h in range(len(harmonics)) if size[h] > NEGLIGIBLE * size.max()]
    found = [gauss_stress(body, harmonics[h]) for h in kept]
    own = np.array([von_mises(one.stress) for one in found])
    # the sum of the harmonics' own maxima bounds what they reach together
    bound = own.sum(axis=0)
    count = min(FOLLOWED, bound.size)
    places = np.argpartition(bound.ravel(), -count)[-count:]
    angle = 2 * np.pi * np.arange(INSTANTS * (kept[-1] + 1)) / (INSTANTS * (kept[-1] + 1))
    turns = np.exp(1j * np.outer(angle, np.array(kept) + 1))
    chosen = np.array([one.stress.reshape(-1, 6)[places] for one in found])
    in_time = np.array([von_mises(np.einsum("h,hps->ps", turn, chosen).real) for turn in turns])
    largest = in_time.max(axis=0)
    worst = int(largest.argmax())
    at = np.unravel_index(places[worst], bound.shape)
    by_harmonic = np.zeros(len(harmonics))
    by_harmonic[kept] = own[(slice(None), *at)]
    strongest = harmonics[kept[int(own[(slice(None), *at)].argmax())]]
    return AlternatingStress(
        float(largest[worst]),
        found[0].points[at],
        by_harmonic,
        mesh_error(body, strongest, found[0], at[0]),
    )


def mesh_error(body: Body, u: np.ndarray, stress: GaussStress, cell: int) -> float:
    """Relative error of the stress in a cell, from its jump to the smoothed stress of its nodes.

    The recovered field of Zienkiewicz and Zhu (1987, doi:10.1002/nme.1620240206): the largest
    difference, over the cell's nodes, between the von Mises stress of the cells round a node and
    their mean there.

    Args:
        u: (n_points, dim) displacements, complex or real [m].
        stress: of any harmonic; only its order of cells is used.
        cell: number of the cell in that order.
    """
    cells = np.concatenate([body.mesh.bodies[name] for name in body.material])
    nodes = cells[cell]
    smooth = von_mises(nodal_stress(body, u))[nodes]
    around = np.flatnonzero(np.isin(cells, nodes).any(axis=1))
    own = von_mises(gauss_stress(body, u).stress[around])
    worst = own.max(axis=1)
    jump = 0.0
    for node, mean in zip(nodes, smooth, strict=True):
        touching = (cells[around] == node).any(axis=1)
        jump = max(jump, np.ptp(worst[touching]) / max(mean, np.finfo(float).tiny))
    return float(jump)

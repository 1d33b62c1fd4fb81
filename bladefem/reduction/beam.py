"""The reference blade: an Euler-Bernoulli cantilever with a lumped platform, small enough to know
by heart.

Length 0.15 m, section 0.03 m x 0.006 m, steel, 20 elements, platform of 0.05 kg at z = 0.045 m: the
first two natural frequencies are 220.86 Hz and 1236.6 Hz. Shape functions after Przemieniecki,
Theory of Matrix Structural Analysis (1968), Sect. 5.6 and 11.3.
"""

from __future__ import annotations

import numpy as np

from ..data import PortModel
from .matrices import port_model_from_matrices


def beam_matrices(
    length: float = 0.15,
    width: float = 0.03,
    thickness: float = 0.006,
    *,
    E: float = 2.1e11,
    rho: float = 7850.0,
    elements: int = 20,
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and consistent mass of a cantilever clamped at z = 0, bending over its thickness.

    Returns:
        K, M: (2 elements, 2 elements) [N/m, N, N m] and [kg, kg m, kg m^2]; dofs are deflection and
        slope of each node from the first free one to the tip.
    """
    l = length / elements
    EI = E * width * thickness**3 / 12
    k = (
        EI
        / l**3
        * np.array(
            [
                [12, 6 * l, -12, 6 * l],
                [6 * l, 4 * l**2, -6 * l, 2 * l**2],
                [-12, -6 * l, 12, -6 * l],
                [6 * l, 2 * l**2, -6 * l, 4 * l**2],
            ]
        )
    )
    m = (
        rho
        * width
        * thickness
        * l
        / 420
        * np.array(
            [
                [156, 22 * l, 54, -13 * l],
                [22 * l, 4 * l**2, 13 * l, -3 * l**2],
                [54, 13 * l, 156, -22 * l],
                [-13 * l, -3 * l**2, -22 * l, 4 * l**2],
            ]
        )
    )
    K, M = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for e in range(elements):
        dofs = slice(2 * e, 2 * e + 4)
        K[dofs, dofs] += k
        M[dofs, dofs] += m
    return K[2:, 2:], M[2:, 2:]


def reference_blade(
    points: int = 1,
    *,
    modes: int | None = None,
    elements: int = 20,
    platform: float = 0.05,
    at: float = 0.045,
) -> PortModel:
    """The reference blade with its two platform sides as contact, its tip as load and probe.

    Contact port: the tangential displacement of the platform, first `points` nodes that touch the
    damper on this side, then `points` nodes of the other side, which touches the damper of the
    blade before (`bladefem.reduction.assemble` turns them to the next blade).

    Args:
        platform: lumped mass [kg] at the height `at` [m], which must be a node: a multiple of 0.15
            / elements.
    """
    K, M = beam_matrices(elements=elements)
    dof = 2 * round(at / (0.15 / elements)) - 2
    M[dof, dof] += platform
    tip = 2 * elements - 2
    ports = {"contact": np.full(2 * points, dof), "load": np.array([tip]), "probe": np.array([tip])}
    return port_model_from_matrices(M, K, ports, count=modes)

"""Blades of the tuned shape with another stiffness and mass, as a pattern of a wheel.

With the aerofoil's modes Phi held at the root, of mass 1 and stiffness Omega^2, and its static
motions Psi by those of the root, L = Phi^T M Psi, a blade of another modulus (1 + k) and density
(1 + m) adds

    dK = k [Omega^2, 0; 0, Psi^T K Psi],    dM = m [1, L; L^T, Psi^T M Psi].

By family, k and m are those of each mode: the root then feels the modes' own parts of its inertia,
L^T m L, and no other stiffness.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...wheel.model import Pattern, frequency_pattern
from ...wheel.pattern_file import BladeDeviations

if TYPE_CHECKING:
    from ...fem.held_part import HeldPart


def deviation_pattern(
    families: np.ndarray,
    deviation: BladeDeviations,
    aerofoil: HeldPart | None = None,
) -> Pattern:
    """The pattern of a wheel's deviations.

    Args:
        families: (q,) circular frequencies of the blade-alone modes [rad/s].
        aerofoil: the tuned one with p motions of its root; wanted where stiffness or mass deviates,
            whose pattern then has q + p readings.

    Raises:
        InputError: a deviation makes a blade unstable, or the shapes do not fit.
    """
    pattern = frequency_pattern(families, deviation.frequency)
    if aerofoil is None:
        return pattern
    q = len(families)
    size = q + len(aerofoil.inertia)
    stiffness = np.zeros((len(deviation.frequency), size, size))
    mass = np.zeros_like(stiffness)
    own = np.arange(q)
    stiffness[:, own, own] = families**2 * deviation.stiffness
    if pattern.stiffness is not None:
        stiffness[:, :q, :q] += pattern.stiffness
    if deviation.one_stiffness:
        stiffness[:, q:, q:] = deviation.stiffness[:, :1, None] * aerofoil.stiffness
    mass[:, own, own] = deviation.mass
    mass[:, :q, q:] = deviation.mass[:, :, None] * aerofoil.coupling
    mass[:, q:, :q] = mass[:, :q, q:].swapaxes(1, 2)
    if deviation.one_mass:
        mass[:, q:, q:] = deviation.mass[:, :1, None] * aerofoil.inertia
    else:
        mass[:, q:, q:] = aerofoil.coupling.T @ mass[:, :q, q:]
    return replace(pattern, stiffness=stiffness, mass=mass)

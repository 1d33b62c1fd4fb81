"""A wheel of lumped blades: disc, platform and tip of each sector in a row of springs, one friction
element between neighbouring platforms. The smallest wheel that localises and slips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Elements, PortModel
from ..hbm.linear.bodies import Damping
from ..reduction.assemble import pair_model, recombine_contact
from ..reduction.matrices import port_model_from_matrices
from .model import Pattern, Wheel, engine_order

DISC = 0
PLATFORM = 1
TIP = 2


@dataclass(frozen=True)
class LumpedBlades:
    """Masses [kg] and stiffnesses [N/m] of a sector; springs join the disc to the ground."""

    count: int = 36
    tip: float = 0.1
    platform: float = 0.1
    disc: float = 1.0
    # tip to platform, platform to disc, disc to the ground, disc to the next disc
    aerofoil: float = 1.0e6
    shank: float = 4.0e6
    ground: float = 2.0e6
    rim: float = 1.0e7
    # modal damping [1]
    damping: float = 1e-3


def lumped_matrices(blades: LumpedBlades) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, K (3, 3) of a sector alone, and the stiffness K_next (3, 3) to the next sector."""
    M = np.diag([blades.disc, blades.platform, blades.tip])
    b = blades
    K = np.array(
        [
            [b.ground + 2 * b.rim + b.shank, -b.shank, 0.0],
            [-b.shank, b.shank + b.aerofoil, -b.aerofoil],
            [0.0, -b.aerofoil, b.aerofoil],
        ]
    )
    to_next = np.zeros((3, 3))
    to_next[DISC, DISC] = -b.rim
    return M, K, to_next


def lumped_wheel(
    blades: LumpedBlades,
    order: int,
    force: float,
    kt: float,
    limit: float,
) -> Wheel:
    """The wheel under an engine order on the tips, with elements of stiffness kt [N/m] and friction
    limit [N]; the stretches of aerofoil and shank are the readings of the port "blade".
    """
    M, K, to_next = lumped_matrices(blades)
    ports = {
        # the platform towards the next one, the same towards the one before
        "contact": np.eye(3)[[PLATFORM, PLATFORM]],
        "blade": np.array([[0.0, -1.0, 1.0], [-1.0, 1.0, 0.0]]),
        "load": np.array([TIP]),
        "probe": np.array([TIP]),
    }
    sectors: dict[int, PortModel] = {}
    for d in range(blades.count // 2 + 1):
        phase = 2 * np.pi * d / blades.count
        stiffness = K + to_next * np.exp(1j * phase) + to_next.T * np.exp(-1j * phase)
        real = 2 * d % blades.count == 0
        body = port_model_from_matrices(
            M, stiffness.real if real else stiffness, ports, nodal_diameter=d
        )
        pair = pair_model(body, slice(1, 2), phase)
        sectors[d] = recombine_contact(pair, np.array([[1.0, -1.0]]))
    element = Elements(np.array([kt]), np.zeros(1), np.ones(1), np.array([limit]), tangents=1)
    excitation = {1: engine_order(blades.count, order, np.array([force]))}
    return Wheel(blades.count, sectors, element, excitation, Damping(ratio=blades.damping))


def lumped_pattern(blades: LumpedBlades, deviation: np.ndarray) -> Pattern:
    """Relative deviations (N,) of the stiffness of each blade, aerofoil and shank alike."""
    own = np.diag([blades.aerofoil, blades.shank])
    return Pattern(stiffness=np.asarray(deviation, dtype=float)[:, None, None] * own)

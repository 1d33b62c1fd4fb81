"""What the amplitude means for the blade's life: stress of the mode studied, next to that of
rotation and heat.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...data import ModeSet
from ...util.arrays import RealArray
from ..pipeline.bodies import Bodies
from ..pipeline.coriolis import mode_shift
from ..pipeline.ports import blade_ports
from .linear_response import steady_state


@dataclass(frozen=True)
class Strength:
    """Largest von Mises stresses at the Gauss points of the blade; at sharp edges they grow with a
    finer mesh.
    """

    # 1 = lowest
    mode: int
    # amplitude in that mode, for each metre of motion at the probe [Pa/m]
    alternating: float
    # (3,) where [m]
    alternating_at: RealArray
    # of rotation and heat [Pa]; 0 at rest in a body without heat
    steady: float
    # (3,)
    steady_at: RealArray
    # (n_points,) of rotation and heat at the nodes, as signed von Mises stress [Pa]
    mean: RealArray
    # by how much Coriolis forces move the frequency of the mode's waves; relative, 0 at rest
    coriolis: float


def mode_strength(bodies: Bodies, modes: ModeSet) -> Strength:
    """Stresses of the mode that the scene studies; the other modes and the damper's forces are left
    out.

    Args:
        modes: of the nodal diameter that the engine order excites.
    """
    from ...fem.stress import nodal_stress, signed_von_mises
    from ...fem.thermal_strain import has_thermal_strain

    excitation = bodies.scene.excitation
    ports = blade_ports(bodies.mesh, [], excitation)
    shape = modes.shapes[min(excitation.mode, len(modes.shapes)) - 1].astype(complex)
    seen = abs(ports.matrix[:, ports.names["probe"]].T @ shape[:, : bodies.mesh.dimension].ravel())[
        0
    ]
    alternating, there = _worst_place(bodies, shape / max(seen, 1e-300))
    rest = 0.0, np.full(3, np.nan)
    mean = np.zeros(len(bodies.mesh.points))
    steady, place = rest
    if bodies.scene.operation.speed > 0 or has_thermal_strain(bodies.still_blade):
        state = steady_state(bodies)
        steady, place = _worst_place(bodies, state.displacement, heated=True, large=state.large)
        stress = nodal_stress(
            bodies.still_blade, state.displacement, heated=True, large=state.large
        )
        mean = signed_von_mises(stress)
    return Strength(
        excitation.mode, alternating, there, steady, place, mean, mode_shift(bodies, [modes])
    )


def _worst_place(
    bodies: Bodies, u: np.ndarray, heated: bool = False, large: bool = False
) -> tuple[float, np.ndarray]:
    """Largest von Mises stress [Pa] of displacements (n_points, d) and its place (3,) [m].

    Args:
        heated: of the static state.
        large: of one with large displacements.
    """
    from ...fem.stress import gauss_stress, von_mises

    found = gauss_stress(bodies.still_blade, u, heated=heated, large=large)
    size = von_mises(found.stress)
    worst = np.unravel_index(size.argmax(), size.shape)
    return float(size[worst]), found.points[worst]

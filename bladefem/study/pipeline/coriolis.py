"""Coriolis forces in responses: counted where they move the mode studied by more than a share of
the accuracy asked for, or where the scene says so.

They couple the modes of a sector as damping does, but do no work. In nodal diameters between 0 and
N/2 they part the two travelling waves of a mode in frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...data import ModeSet
from ...hbm.linear_resonances import wave_frequencies
from ...hbm.model import Damping
from ...reduction.assemble import folded_diameter
from ...scene.tables import Scene
from .bodies import Bodies, rotation_of
from .normal_modes import MODES_SHOWN, excited_modes
from .reduced_sector import Reduced

# of the accuracy: shift of a frequency that responses may leave out
CORIOLIS_SHARE = 0.1


def counts_coriolis(scene: Scene, shift: float) -> bool:
    """Whether responses have Coriolis forces that move the mode studied by this share of its
    frequency.
    """
    asked = scene.operation.coriolis
    return shift > 0 and (shift > CORIOLIS_SHARE * scene.accuracy if asked is None else asked)


def coriolis_shift(omega: np.ndarray, damping: np.ndarray, mode: int) -> float:
    """By how much the waves that a mode becomes differ from its frequency [1], the larger of both.

    Args:
        omega: (m,) circular frequencies of one nodal diameter [rad/s].
        damping: (m, m) speed times Coriolis coupling [1/s].
        mode: 1 = lowest.
    """
    few = slice(MODES_SHOWN)
    frequency = omega[few]
    row = min(mode, len(frequency)) - 1
    if not frequency[row] > 0:
        return 0.0
    both = [wave_frequencies(frequency, sign * damping[few, few])[row] for sign in (1, -1)]
    return float(max(abs(w / frequency[row] - 1) for w in both))


def with_coriolis(scene: Scene, reduced: Reduced) -> Reduced:
    """The reduced sector with Coriolis forces where responses are to have them."""
    if not reduced.coriolis or not counts_coriolis(scene, _reduced_shift(scene, reduced)):
        return reduced
    sector = {
        n: replace(body, damping=reduced.coriolis.get(n)) for n, body in reduced.sector.items()
    }
    return replace(reduced, sector=sector)


def has_coriolis(reduced: Reduced) -> bool:
    """Responses of this sector have Coriolis forces."""
    return any(body.damping is not None for body in reduced.sector.values())


def _reduced_shift(scene: Scene, reduced: Reduced) -> float:
    """`coriolis_shift` in the nodal diameter that the engine order excites, or the nearest one."""
    wanted = 0
    if reduced.sectors:
        wanted, _ = folded_diameter(1, scene.excitation.engine_order, reduced.sectors)
    n = min(reduced.sector, key=lambda known: abs(known - wanted))
    if n not in reduced.coriolis:
        return 0.0
    return coriolis_shift(reduced.sector[n].omega, reduced.coriolis[n], scene.excitation.mode)


def response_damping(bodies: Bodies, sets: Sequence[ModeSet]) -> list[np.ndarray]:
    """Modal damping of each nodal diameter: (m,) viscous [1/s], or (m, m) where responses have
    Coriolis forces.
    """
    law = Damping(ratio=bodies.scene.operation.damping)
    viscous = [law.viscous(2 * np.pi * found.frequencies) for found in sets]
    if not counts_coriolis(bodies.scene, mode_shift(bodies, sets)):
        return viscous
    return [
        np.diag(own) + coriolis_damping(bodies, found)
        for own, found in zip(viscous, sets, strict=True)
    ]


def coriolis_in_response(bodies: Bodies, excited: ModeSet) -> np.ndarray | None:
    """(m, m) `coriolis_damping` of the modes that the engine order excites; None where responses
    leave it out.
    """
    if not counts_coriolis(bodies.scene, mode_shift(bodies, [excited])):
        return None
    return coriolis_damping(bodies, excited)


def mode_shift(bodies: Bodies, sets: Sequence[ModeSet]) -> float:
    """By how much Coriolis forces move the waves of the mode that the scene studies [1]; 0 at
    rest.
    """
    if not bodies.scene.operation.speed > 0:
        return 0.0
    excited = excited_modes(bodies.scene, bodies.mesh, sets)
    omega = 2 * np.pi * excited.frequencies
    return coriolis_shift(omega, coriolis_damping(bodies, excited), bodies.scene.excitation.mode)


def coriolis_damping(bodies: Bodies, modes: ModeSet) -> np.ndarray:
    """(m, m) speed times the Coriolis coupling of the modes of one nodal diameter [1/s]."""
    from ...fem.gyroscopic import coupling

    spin = rotation_of(bodies)
    return spin.speed * coupling(bodies.still_blade, modes, spin.axis)

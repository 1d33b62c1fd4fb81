"""Coriolis forces of the damper in responses: counted where they move the mode studied, with all
contacts sticking, by more than a share of the accuracy asked for, or where the scene says so.

How far they reach depends on the contact: a damper on soft seats moves with both platforms, a
bonded one keeps them from moving.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.mesh import Mesh

from ...data import Patch
from ...hbm.linear_resonances import stuck_modes, stuck_partners, stuck_resonances
from ...hbm.model import ReducedModel
from ...scene.tables import Scene
from .assemble_model import LoadCase, joint_model
from .coriolis import counts_coriolis
from .reduced_sector import DamperSpin, Reduced, with_damper_mass


def with_damper_coriolis(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: Sequence[Patch],
    case: LoadCase,
) -> Reduced:
    """The reduced sector with Coriolis forces of the damper where responses are to have them, and
    with what the rotation does to it.
    """
    if reduced.damper_coriolis is None:
        return reduced
    spin = damper_spin(scene, mesh, reduced, patches, case)
    reduced = replace(reduced, damper_spin=spin)
    return _turning(reduced) if counts_coriolis(scene, spin.coriolis) else reduced


def damper_spin(
    scene: Scene,
    mesh: Mesh,
    reduced: Reduced,
    patches: Sequence[Patch],
    case: LoadCase,
) -> DamperSpin:
    """The change of the stuck resonance in which most of the mode studied is, with the heaviest
    damper of the study.

    Args:
        case: tells the stiffness of the contacts.
    """
    heaviest = max(scene.study.masses or (), default=None)
    heavy = with_damper_mass(reduced, heaviest)
    still, turning = (
        joint_model(scene, mesh, body, list(patches), case, 1, "elastic")
        for body in (heavy, _turning(heavy))
    )
    partners = stuck_partners(still)
    if not len(partners):
        return DamperSpin(0.0, 0.0)
    omega = partners[min(scene.excitation.mode, len(partners)) - 1]
    shift = float(np.min(np.abs(stuck_resonances(turning) / omega - 1)))
    return DamperSpin(shift, _softening(still, turning, omega))


def _turning(reduced: Reduced) -> Reduced:
    return replace(reduced, damper=replace(reduced.damper, damping=reduced.damper_coriolis))


def _softening(still: ReducedModel, turning: ReducedModel, omega: float) -> float:
    """Share of its frequency that a stuck mode loses by spin softening of the damper, to first
    order.

    Softening is -speed^2 M P, P across the axis; Coriolis forces are C = 2 speed M (a x), and
    (a x)^2 = -P: on modes of mass 1 it is -C^H C / 4, but for what these modes do not span.
    """
    assert isinstance(turning.damper, tuple)
    coupling = turning.damper[0].damping
    assert coupling is not None
    found, shapes = stuck_modes(still)
    damper = shapes[len(still.side(1).omega) :, int(np.argmin(np.abs(found - omega)))]
    return float(np.linalg.norm(coupling @ damper) ** 2 / 8 / omega**2)

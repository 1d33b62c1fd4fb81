"""Coriolis forces of the damper in responses: counted where they change frequency or amplitude of
the mode studied by more than a share of the accuracy asked for, or where the scene says so.

Both are given by the mode with all contacts sticking. With w the tangential motion of the contacts
for one unit a of the blade's, friction does most against the excitation where k_t |w| a is some two
times its limit; its work is then in proportion to k_t |w|^2 a^2, that of the excitation to a: the
amplitude goes with 1 / |w|^2. It is some 25 times as sensitive as the frequency, as little of the
mode's energy is in the damper.

How far they reach depends on the contact: a damper on soft seats moves with both platforms, a
bonded one keeps them from moving.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.mesh import Mesh

from ...data import Patch
from ...hbm.linear_resonances import stuck_modes, stuck_motion, stuck_partners
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

    A damper that is a mass has none: they push it up and down the slope, where it does not go.
    """
    if reduced.damper_coriolis is None:
        return reduced
    spin = damper_spin(scene, mesh, reduced, patches, case)
    if scene.model.damper == "mass":
        return replace(reduced, damper_spin=replace(spin, coriolis=0.0, amplitude=0.0))
    reduced = replace(reduced, damper_spin=spin)
    return (
        _turning(reduced) if counts_coriolis(scene, max(spin.coriolis, spin.amplitude)) else reduced
    )


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
        return DamperSpin(0.0, 0.0, 0.0, 0.0)
    omega = partners[min(scene.excitation.mode, len(partners)) - 1]
    before, _, rubbing = _stuck_mode(still, omega)
    after, _, rubbing_after = _stuck_mode(turning, omega)
    coriolis = abs(after / before - 1)
    amplitude = 2 * abs(rubbing_after / rubbing - 1) if rubbing > 0 else 0.0
    softening = _softening(still, turning, omega)
    # both push the damper across the axis: in proportion
    ratio = softening / coriolis if coriolis > 0 else 0.0
    return DamperSpin(coriolis, amplitude, softening, ratio * amplitude)


def _stuck_mode(model: ReducedModel, omega: float) -> tuple[float, np.ndarray, float]:
    """Circular frequency [rad/s] and shape (n,) of the stuck mode next to a frequency, and root of
    its tangential contact energy.
    """
    found, shapes = stuck_modes(model)
    nearest = int(np.argmin(np.abs(found - omega)))
    shape = shapes[:, nearest]
    tangents = model.elements.tangents
    moved = stuck_motion(model, shape[:, None])[:, -tangents:, 0]
    energy = np.sum(model.springs[:, -tangents:] * np.abs(moved) ** 2)
    return float(found[nearest]), shape, float(np.sqrt(energy))


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
    _, shape, _ = _stuck_mode(still, omega)
    damper = shape[len(still.side(1).omega) :]
    return float(np.linalg.norm(coupling @ damper) ** 2 / 8 / omega**2)

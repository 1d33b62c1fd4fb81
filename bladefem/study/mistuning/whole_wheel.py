"""The whole wheel of a scene: the sector reduced in every nodal diameter with the coordinates of
its blade-alone modes, joined with the friction elements of a load case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from geometry.mesh import Mesh, sector_of

from ...data import ModeSet, Patch
from ...errors import InputError
from ...hbm.model import softened_layer
from ...reduction.assemble import pair_model
from ...reduction.truncate import truncate_modes
from ...scene.tables import Scene
from ...wheel.model import Wheel
from ..adaptive.settings import Settings
from ..pipeline.assemble_model import LoadCase, joint_model
from ..pipeline.bodies import Bodies
from ..pipeline.coriolis import with_coriolis
from ..pipeline.damper_coriolis import with_damper_coriolis
from ..pipeline.flow import scene_flow, wheel_influence
from ..pipeline.joined_contacts import joined_member
from ..pipeline.reduced_sector import Reduced, reduce_sector, with_damper_mass
from .engine_orders import order_forces
from .other_blades import foot_of


@dataclass(frozen=True)
class WheelSector:
    """A sector in all nodal diameters."""

    reduced: Reduced
    # (q,) circular frequencies of the blade-alone modes that the port "blade" reads [rad/s]
    families: np.ndarray


def reduce_wheel(
    bodies: Bodies,
    patches: list[Patch],
    modes: int,
    clamped: ModeSet | None,
    families: int,
    wheel_modes: Sequence[ModeSet] = (),
    root: bool = False,
) -> WheelSector:
    """The sector in nodal diameters 0 to N/2.

    Args:
        modes: modes kept in each nodal diameter.
        clamped: modes of the aerofoil held at its root.
        families: of these that deviate from blade to blade.
        wheel_modes: modes of the tuned wheel, wanted with the root.
        root: read the motions of the aerofoil's root too: of blades of another shape, stiffness or
            mass, whose inertia differs under these.

    Raises:
        InputError: the scene is no wheel, or names no aerofoil.
    """
    omega, readings = blade_readings(bodies, clamped, families, wheel_modes, root)
    diameters = range(sector_of(bodies.mesh).count // 2 + 1)
    reduced = reduce_sector(bodies, patches, list(diameters), modes, readings)
    return WheelSector(reduced, omega)


def blade_readings(
    bodies: Bodies,
    clamped: ModeSet | None,
    families: int,
    modes: Sequence[ModeSet] = (),
    root: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Circular frequencies (q,) of the blade-alone modes [rad/s], and the columns (n_points*dim, q)
    that read their coordinates, with more for the motions of the root; the arguments are those of
    `reduce_wheel`.
    """
    from ...fem.held_part import section_readings
    from ...fem.readings import modal_readings

    if bodies.mesh.sector is None or "cyclic" not in bodies.mesh.pairs:
        raise InputError("mistuning: expected a wheel, blades clamped at their roots have no disc")
    if clamped is None:
        raise InputError(
            "mistuning: the mesh has no faces 'pressure_side' or 'suction_side', expected them to "
            "know the blade-alone modes"
        )
    if families > len(clamped.frequencies):
        raise InputError(
            f"mistuning.families = {families}: expected at most {len(clamped.frequencies)}"
        )
    omega = 2 * pi * clamped.frequencies[:families]
    readings = modal_readings(bodies.still_blade, clamped.shapes[:families], omega)
    if root:
        foot = foot_of(bodies.mesh, modes, families)
        readings = np.hstack([readings, section_readings(bodies.mesh, foot.nodes, foot.motions)])
    return omega, readings


def whole_wheel(
    scene: Scene,
    mesh: Mesh,
    sector: WheelSector,
    patches: list[Patch],
    case: LoadCase,
    settings: Settings,
) -> Wheel:
    """The tuned wheel under one load, with the modes, contact points and damper of the settings.

    Mean displacements are held in the preload state, for the search over a band: dampers that slip
    throughout walk, each by a step of its own, which takes a further solution at each point and
    moves the vibration little. A peak is searched again with free ones (`wheel.local_peak`).
    """
    reduced = with_coriolis(scene, sector.reduced)
    reduced = with_damper_coriolis(scene, mesh, reduced, patches, case)
    reduced = with_damper_mass(reduced, case.mass)
    count = reduced.sectors
    bodies = {d: truncate_modes(reduced.sector[d], settings.modes) for d in range(count // 2 + 1)}
    sides = tuple(
        pair_model(body, reduced.following, 2 * pi * d / count) for d, body in bodies.items()
    )
    model = joint_model(
        scene, mesh, reduced, patches, case, settings.harmonics, settings.damper, sides
    )
    model = joined_member(model, patches, settings.points, scene.contact.points).model
    if settings.softened:
        model = softened_layer(model)
    damper = model.damper[0] if isinstance(model.damper, tuple) else model.damper
    return Wheel(
        count,
        dict(enumerate(model.sides)),
        model.elements,
        order_forces(scene, count),
        model.damping,
        damper,
        model.damper_damping,
        influence=wheel_influence(scene_flow(scene, count), bodies),
        coupled=False,
        start=model.start,
        series=model.series,
    )

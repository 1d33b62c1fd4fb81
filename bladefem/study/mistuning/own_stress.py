"""Stress of a blade of another shape on its own mesh: aerofoil, platform, shank and its part of the
disc, in vibration and in rotation.

The wheel tells how the cut faces of that sector move, which forces its contacts have, and how its
blade-alone modes move, y in the tuned coordinates, T^-1 y in its own (`other_blades`). With these
the sector is solved once more by itself (`fem.cut_sector`), so that its stress is that of its own
elements everywhere. In rotation the other aerofoil pulls on its root as no tuned one does, and the
wheel gives way to that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.mesh import Mesh, spin_axis

from ...scene.tables import Scene
from ...util.arrays import ComplexArray, RealArray
from ..pipeline.bodies import Bodies
from ..pipeline.damped_motion import MAX_FREQUENCY_RATIO, DampedMotion, touched_nodes
from ..pipeline.normal_modes import MODES_SHOWN
from ..pipeline.ports import blade_ports
from .other_blades import by_tuned_modes

if TYPE_CHECKING:
    from ...fem.body import Body
    from ...fem.cut_sector import CutSector
    from ...fem.held_part import HeldPart


@dataclass(frozen=True)
class OwnStress:
    """Stress of the sector of one blade of another shape; n nodes of its mesh."""

    # largest von Mises stress over a period [Pa], its place (3,) [m], and the estimated relative
    # error by the mesh there
    largest: float
    place: RealArray
    mesh_error: float
    mesh: Mesh
    # (n,) largest von Mises stress over a period, and the signed one of rotation and heat [Pa]
    field: RealArray
    mean: RealArray
    # forces that hold the blade's own coordinates over those of their inertia, the largest of all
    # harmonics: how far wheel and sector disagree about the blade
    mismatch: float


@dataclass(frozen=True)
class KnownMotion:
    """What the wheel knows of the sector of a blade of another shape, on the mesh of the others."""

    mesh: Mesh
    motion: DampedMotion
    # (H, n_points*dim) forces of its contacts [N]
    contact: ComplexArray
    # (H,) excitation on the port "load" [N]
    load: ComplexArray
    # (H, q) readings of its blade-alone modes
    coordinates: ComplexArray
    # (n_points, dim) displacement by rotation and heat [m]
    offset: RealArray
    # it is that of a nonlinear preload
    large: bool = False


def steady_root_forces(
    tuned: HeldPart,
    other: HeldPart,
    speed: float,
    root: np.ndarray,
) -> np.ndarray:
    """(p,) forces [N] by which the other aerofoil pulls on its root more than the tuned one does,
    in rotation and heat.

    Args:
        speed: [rad/s].
        root: (p,) how the root moves in the tuned wheel.
    """
    pull = _steady_pull(other, speed) - _steady_pull(tuned, speed)
    return np.asarray(pull - (other.stiffness - tuned.stiffness) @ root)


def _steady_pull(part: HeldPart, speed: float) -> np.ndarray:
    """(p,) work of the steady loads on the motions that follow the root."""
    static = part.on_mesh(part.static).reshape(len(part.static), -1)
    return static @ _steady_loads(part.body, speed, part.body.mesh)


def _steady_loads(body: Body, speed: float, mesh: Mesh) -> np.ndarray:
    """(n_points*dim,) of rotation and heat [N]."""
    from ...fem.linear_preload import thermal_force
    from ...fem.loads import centrifugal

    return np.asarray(centrifugal(body, speed, spin_axis(mesh)) + thermal_force(body))


def own_stress(
    scene: Scene, mesh: Mesh, tuned: HeldPart, other: HeldPart, known: KnownMotion
) -> OwnStress:
    """The stress of a blade of another shape; on one rank.

    Args:
        scene, mesh: of that shape.
        tuned, other: the aerofoils of the tuned and of that shape, held at their roots.
    """
    from ...fem.alternating_stress import alternating_stress
    from ...fem.compat import MPI
    from ...fem.stress import nodal_stress, signed_von_mises

    bodies = Bodies(scene, mesh, MPI.COMM_SELF)
    fields, mismatch = own_motion(bodies, tuned, other, known)
    found = alternating_stress(bodies.still_blade, fields, touched_nodes(bodies))
    mean = np.zeros(len(mesh.points))
    if np.any(known.offset):
        offset = own_offset(bodies, known)
        mean = signed_von_mises(
            nodal_stress(bodies.still_blade, offset, heated=True, large=known.large)
        )
    return OwnStress(
        found.largest, found.place, found.mesh_error, mesh, found.field, mean, mismatch
    )


def own_motion(
    bodies: Bodies, tuned: HeldPart, other: HeldPart, known: KnownMotion
) -> tuple[ComplexArray, float]:
    """(H, n_points, dim) displacements [m] on its own mesh, zero in harmonics beyond its modes, and
    `OwnStress.mismatch`.
    """
    from ...fem.cut_sector import cut_sector, harmonic_motion
    from ...fem.modes import modes
    from ...fem.readings import modal_readings

    sector = cut_sector(bodies.blade)
    held = modes(sector.flex.con, MODES_SHOWN, sector.flex)
    fields = np.zeros((len(known.coordinates), *bodies.mesh.points.shape), complex)
    H = len(fields)
    highest = MAX_FREQUENCY_RATIO * held.frequencies[-1]
    kept = [h for h in range(H) if (h + 1) * known.motion.frequency < highest]
    if not kept:
        return fields, 0.0
    own = modal_readings(bodies.still_blade, other.on_mesh(other.shapes), other.omega)
    T, _ = by_tuned_modes(tuned, other)
    coordinates = np.linalg.solve(T, known.coordinates[kept].T).T
    omega = 2 * np.pi * known.motion.frequency * (np.array(kept) + 1)
    # near a resonance a damping ratio is a damping proportional to mass
    damped = omega * np.sqrt(1 - 2j * bodies.scene.operation.damping)
    moved = _at_cuts(sector, known.mesh, known.motion.harmonics[kept])
    found = harmonic_motion(
        sector, held, moved, _own_loads(bodies, known)[kept], damped, own, coordinates
    )
    fields[kept] = found.fields
    inertia = omega[:, None] ** 2 * abs(coordinates)
    return fields, float(abs(found.forces).max() / max(inertia.max(), np.finfo(float).tiny))


def own_offset(bodies: Bodies, known: KnownMotion) -> RealArray:
    """(n_points, dim) displacement [m] of the sector by rotation and heat, of the kind of the
    wheel's.
    """
    from ...fem.cut_sector import HELD, cut_sector, static_motion
    from ...fem.preload import preload

    body = bodies.still_blade
    sector = cut_sector(body)
    loads = _steady_loads(body, bodies.scene.operation.speed, bodies.mesh)
    moved = _at_cuts(sector, known.mesh, known.offset[None])
    if known.large:
        # from what follows the cut faces alone: the linear answer to the loads may be far off
        bent = static_motion(sector, moved, np.zeros_like(loads[None]))[0]
        speed = bodies.scene.operation.speed
        axis = spin_axis(bodies.mesh)
        return preload(sector.body, speed, HELD, axis, given=bent).displacement
    return np.asarray(static_motion(sector, moved, loads[None])[0])


def _at_cuts(sector: CutSector, mesh: Mesh, fields: np.ndarray) -> np.ndarray:
    """(H, n_points, dim) on the sector's own mesh, at its cut faces alone."""
    from ...fem.face_values import face_values

    own = sector.body.mesh
    pair = mesh.pairs["cyclic"]
    values = face_values(mesh, (pair.master, pair.slave), own.points[sector.cut])
    moved = np.zeros((len(fields), *own.points.shape), fields.dtype)
    for field, given in zip(moved, fields, strict=True):
        field[sector.cut] = values @ given
    return moved


def _own_loads(bodies: Bodies, known: KnownMotion) -> ComplexArray:
    """(H, n_points*dim) of excitation and contacts on its own mesh [N]."""
    from ...fem.face_values import face_values

    mesh = bodies.mesh
    H = len(known.load)
    ports = blade_ports(mesh, [], bodies.scene.excitation)
    excited = ports.matrix[:, ports.names["load"]].toarray()[:, 0]
    loads = known.load[:, None] * excited
    forces = known.contact.reshape(H, len(known.mesh.points), -1)
    nodes = np.flatnonzero(np.any(forces, axis=(0, 2)))
    if len(nodes):
        seats = [p.master for name, p in mesh.pairs.items() if name != "cyclic"]
        values = face_values(mesh, seats, known.mesh.points[nodes])
        loads = loads + np.array([(values.T @ f[nodes]).ravel() for f in forces])
    return np.asarray(loads)

"""The contact problem of the damper between two platforms: patches, gaps and flexibility."""

from __future__ import annotations

import numpy as np

from geometry.mesh import Mesh

from ...contact.interface_elements import pair_ratio, with_interface_law
from ...contact.patch import make_patch, normal_ports, port_matrix
from ...contact.seating import ContactProblem
from ...data import SEATS, Patch
from ...errors import InputError
from ...scene.kinds import kind_named
from ...scene.material_table import operating_materials
from ...scene.tables import Scene
from .bodies import Bodies


def contact_patches(mesh: Mesh) -> list[Patch]:
    """The patches of the damper: "this" on this blade's seat, "next" on the next blade's.

    Raises:
        InputError: the mesh has no such pairs of faces.
    """
    missing = [name for name in ("this", "next") if name not in mesh.pairs]
    if missing:
        raise InputError(
            f"the mesh has no contact pair on its {SEATS[missing[0]]} seat: expected faces "
            "seat_right and damper_left, seat_left and damper_right with matching nodes; "
            "imported.seats draws a damper to a STEP file"
        )
    return [make_patch(mesh, name) for name in ("this", "next")]


def seat_damper(bodies: Bodies, patches: list[Patch]) -> ContactProblem:
    """The contact problem of the damper between two platforms, with the scene's interface layer:
    after it, each load state costs milliseconds.

    Returns:
        contact.seating.ContactProblem, for :func:`bladefem.contact.seating.solve_seating`.
    """
    return on_layer(bodies.scene, condense_contact(bodies, patches))


def on_layer(scene: Scene, problem: ContactProblem) -> ContactProblem:
    """A contact problem with the scene's interface layer between its faces."""
    ratio = pair_ratio(*operating_materials(scene))
    return with_interface_law(problem, scene.contact, ratio)


def condense_contact(bodies: Bodies, patches: list[Patch]) -> ContactProblem:
    """The contact problem of rigid faces: all that takes finite elements."""
    from ...contact.condensed_bodies import hold_axially
    from ...contact.seating import contact_problem

    gap = seat_clearance(bodies, patches) + thermal_gap(bodies, patches)
    problem = contact_problem(
        bodies.mesh, patches, bodies.seated, bodies.damper, gap, swell=bodies.seat_swell
    )
    return hold_axially(problem) if bodies.scene.damper.axial == "held" else problem


def thermal_gap(bodies: Bodies, patches: list[Patch]) -> np.ndarray:
    """(n,) gap of the seats that the thermal strains of blade and damper open [m]."""
    from ...fem.linear_preload import thermal_displacement
    from ...fem.thermal_strain import has_thermal_strain

    mesh = bodies.mesh
    ports = normal_ports(patches, mesh)
    if not has_thermal_strain(bodies.still_blade):
        return np.zeros(len(ports))
    blade, damper = (
        port_matrix(patches, mesh, side)[:, ports].T @ moved.ravel()
        for side, moved in (
            ("blade", bodies.warm_displacement),
            ("damper", thermal_displacement(bodies.damper)),
        )
    )
    return np.asarray(damper - blade)


def seat_clearance(bodies: Bodies, patches: list[Patch]) -> np.ndarray:
    """(n,) gap of the seats in addition to that of the mesh: their shape, and the clearance [m]."""
    from ...contact.face_profile import seat_gap

    scene = bodies.scene
    gap = np.concatenate([seat_gap(patch, bodies.mesh, scene.contact) for patch in patches])
    return gap if kind_named(scene.kind).clearance_is_meshed else gap + scene.damper.clearance

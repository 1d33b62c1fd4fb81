"""What each stage depends on, as a hash: a changed friction coefficient does not redo the mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from geometry.joined_files import split_entry

from ...io.stage_cache import code_of, key_of
from ...scene.tables import Scene
from ..adaptive.settings import Settings
from .assemble_model import LoadCase

__all__ = [
    "contact_key",
    "mesh_key",
    "modes_key",
    "pair_key",
    "reduction_key",
    "response_key",
    "strength_key",
    "zmass_key",
]


def mesh_key(scene: Scene) -> str:
    """The mesh."""
    shapes = (
        scene.aerofoil,
        scene.platform,
        scene.shank,
        scene.disc,
        replace(scene.damper, mass=None),
        scene.plane,
        scene.z_mass,
        scene.foundation.depth,
        scene.hertz,
        scene.punch,
        scene.imported,
        scene.mesh,
    )
    return key_of(scene.kind, *shapes, code_of("geometry"), _stamp(scene))


def _stamp(scene: Scene) -> list[float]:
    """Imported files count by their times of change too."""
    if scene.kind != "imported":
        return []
    entries = [split_entry(entry)[1] for entry in scene.imported.more or ()]
    files = [Path(name) for name in (scene.imported.file, *entries)]
    return [file.stat().st_mtime if file.exists() else 0.0 for file in files]


def modes_key(scene: Scene) -> str:
    """The modes without damper."""
    operation = scene.operation
    return key_of(
        mesh_key(scene),
        scene.material.blade,
        operation.speed if operation.stiffening else 0.0,
        operation.preload,
        scene.model.nodal_diameters,
        code_of("bladefem.fem"),
    )


def strength_key(scene: Scene) -> str:
    """Stresses of the mode studied and of rotation."""
    return key_of(
        modes_key(scene), scene.operation.speed, scene.excitation, code_of("bladefem.study")
    )


def contact_key(scene: Scene) -> str:
    """The contact problem."""
    contact = scene.contact
    return key_of(
        _bodies_key(scene),
        contact.crown,
        contact.crown_across,
        contact.edge_radius,
        contact.edge_width,
    )


def _bodies_key(scene: Scene) -> str:
    """Blade, damper and their patches, whatever the shape of the seats."""
    return key_of(
        modes_key(scene),
        scene.material.damper,
        scene.damper.mass,
        scene.plane.damper_mass,
        code_of("bladefem.contact"),
    )


def zmass_key(scene: Scene) -> str:
    """The pressure under the Z-shaped mass."""
    return key_of(
        mesh_key(scene),
        scene.material,
        scene.foundation.skew,
        scene.study.loads,
        code_of("bladefem.fem", "bladefem.contact"),
    )


def pair_key(scene: Scene) -> str:
    """The pressure between the bodies of a verification pair."""
    return key_of(
        mesh_key(scene),
        scene.material,
        scene.study.loads,
        code_of("bladefem.fem", "bladefem.contact", "bladefem.study"),
    )


def reduction_key(scene: Scene, diameters: Sequence[int], modes: int) -> str:
    """The reduced sector."""
    return key_of(
        _bodies_key(scene),
        scene.excitation.at,
        np.array(scene.excitation.direction),
        scene.model.reduction,
        np.array(diameters),
        modes,
    )


def response_key(scene: Scene, settings: Settings, case: LoadCase) -> str:
    """The response curve of one load and mass, whichever others are studied with it."""
    return key_of(
        contact_key(scene),
        case.load,
        case.mass,
        scene.contact,
        scene.operation,
        scene.excitation,
        replace(scene.study, loads=(), masses=(), own_load=False),
        scene.accuracy,
        scene.model,
        replace(settings, error=None),
        code_of("bladefem.hbm", "bladefem.friction", "bladefem.reduction", "bladefem.study"),
    )

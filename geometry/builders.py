"""From a scene to its mesh, by the builder that the record of its kind names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bladefem.scene.fields import value_at
from bladefem.scene.kinds import kind_named, load_function

from .mesh import Mesh

if TYPE_CHECKING:
    from bladefem.scene.tables import Scene


def build_here(scene: Scene) -> Mesh:
    """The mesh of a scene, by its ``kind``; the builders and gmsh are loaded when they are needed.

    Args:
        scene: has ``kind``, ``mesh`` (MeshSize) and the tables of its kind: aerofoil, platform,
            shank, disc, damper; plane; z_mass, foundation; hertz; punch; imported.

    Raises:
        InputError: a parameter has to change, or the kind is unknown; one sentence.
    """
    kind = kind_named(scene.kind)
    return load_function(kind.builder)(*(value_at(scene, name) for name in kind.shape))

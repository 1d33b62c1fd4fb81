"""From a scene to its mesh. Anything with the right tables will do; nothing here knows bladefem's
Scene.
"""

from __future__ import annotations

from typing import Any

from bladefem.errors import InputError, suggestion

from .mesh import Mesh

__all__ = ["build", "build_here"]


def build(scene: Any) -> Mesh:
    """The mesh of a scene, made in a process of its own, so that a crash of gmsh becomes a
    sentence.

    Args:
        scene: as for `build_here`.

    Raises:
        InputError: a parameter has to change, or the kind is unknown; one sentence.
    """
    from .isolated_process import build_apart

    _check_kind(scene)
    return build_apart(scene)


def build_here(scene: Any) -> Mesh:
    """The mesh of a scene, by its ``kind``; the builders and gmsh are loaded when they are needed.

    Args:
        scene: has ``kind``, ``mesh`` (MeshSize) and the tables of its kind: aerofoil, platform,
            shank, disc, damper; plane; z_mass, foundation; hertz; punch; imported.

    Raises:
        InputError: a parameter has to change, or the kind is unknown; one sentence.
    """
    _check_kind(scene)
    return BUILDERS[scene.kind](scene)


def _check_kind(scene: Any) -> None:
    if scene.kind not in BUILDERS:
        raise InputError(f"kind = {scene.kind!r} is unknown{suggestion(str(scene.kind), BUILDERS)}")


def _sector(scene: Any) -> Mesh:
    from .sector import wedge_sector

    return wedge_sector(
        scene.aerofoil, scene.platform, scene.shank, scene.disc, scene.damper, scene.mesh
    )


def _plane(scene: Any) -> Mesh:
    from .plane import plane_blades

    return plane_blades(scene.plane, scene.mesh)


def _z_mass(scene: Any) -> Mesh:
    from .zmass import z_mass

    return z_mass(scene.z_mass, scene.mesh, scene.foundation.depth)


def _hertz(scene: Any) -> Mesh:
    from .contact_pairs import hertz_pair

    return hertz_pair(scene.hertz, scene.mesh)


def _punch(scene: Any) -> Mesh:
    from .contact_pairs import punch

    return punch(scene.punch, scene.mesh)


def _imported(scene: Any) -> Mesh:
    from .imported import read_geometry

    return read_geometry(scene.imported, scene.mesh)


BUILDERS = {
    "wedge sector": _sector,
    "plane blades": _plane,
    "z mass": _z_mass,
    "hertz": _hertz,
    "punch": _punch,
    "imported": _imported,
}

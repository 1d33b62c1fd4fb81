"""What the geometry refuses before any drawing: proportions, far too many elements, unknown names.

Plain arithmetic on the tables of a scene; a mesh that passes may still be refused by the mesher.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any

from bladefem.errors import InputError, suggestion

from .parameters import Plane

# cells; as finalise_mesh.MANY, which counts again once the volumes are known
MANY = 3e6
# faces and node sets of the parametric shapes that a force can act on
NAMES = {
    "wedge sector": (
        "clamp",
        "cyclic_high",
        "cyclic_low",
        "pressure_side",
        "seat_left",
        "seat_right",
        "suction_side",
        "tip",
        "tip_leading",
        "tip_mid",
        "tip_trailing",
        "trailing_edge",
    ),
    "plane blades": (
        "clamp",
        "pressure_side",
        "seat_left",
        "seat_right",
        "suction_side",
        "tip",
        "tip_leading",
        "tip_mid",
        "tip_trailing",
    ),
}


def check_parameters(scene: Any) -> None:
    """Refuse what cannot be drawn, and meshes that would never end.

    Args:
        scene: as for ``builders.build_here``.

    Raises:
        InputError: the first rule that is broken, with the field to change.
    """
    if scene.kind in _SHAPES:
        _SHAPES[scene.kind](scene)
    if scene.kind in _CELLS:
        _refuse_many(scene, _CELLS[scene.kind](scene))


def check_names(scene: Any) -> None:
    """Refuse an excitation at a face or node set that the shape does not have.

    Raises:
        InputError: no such name, with the nearest one.
    """
    names = NAMES.get(scene.kind)
    if names is None:
        return
    # only there with a fillet; the damper's own faces are not the blade's
    known = [*names, "fillet"] if _has_fillet(scene) else list(names)
    at = scene.excitation.at
    if at not in known:
        raise InputError(
            f"excitation.at = {at!r}: a {scene.kind} has no face or node set of that "
            f"name{suggestion(at, known)}"
        )


def _has_fillet(scene: Any) -> bool:
    return scene.kind == "wedge sector" and scene.aerofoil.fillet > 0


def _refuse_many(scene: Any, cells: float) -> None:
    """The field that is to blame is the one that was given."""
    if cells <= MANY:
        return
    mesh = scene.mesh
    given = {
        "mesh.size": mesh.size is not None,
        "mesh.contact_size": mesh.contact_size is not None,
    }
    name = next((key for key, is_given in given.items() if is_given), "mesh.scale")
    if mesh.scale < 1:
        name = "mesh.scale"
    value = getattr(mesh, name.partition(".")[2])
    raise InputError(
        f"{name} = {value:.4g}{'' if name == 'mesh.scale' else ' m'}: gives about {cells:.1g} "
        f"cells, expected at most {MANY:.0e}; choose larger elements, or check the length unit"
    )


def _wedge_cells(scene: Any) -> float:
    """A lower bound: the volume above the rim in elements of the base size, and the seats."""
    from .sizing import blade_volume, sector_sizes

    parts = (scene.aerofoil, scene.platform, scene.shank, scene.disc)
    sizes = sector_sizes(*parts, scene.damper, scene.mesh)
    solid = blade_volume(*parts) / (0.12 * (scene.mesh.scale * sizes.base) ** 3)
    seats = 2 * scene.platform.seat_width * scene.damper.length
    return solid + seats / (0.43 * (scene.mesh.scale * sizes.contact) ** 2)


def _plane_cells(scene: Any) -> float:
    plane = scene.plane
    base = scene.mesh.size or _plane_size(plane)
    area = plane.length * plane.thickness + plane.platform_width * plane.platform_thickness
    cells = area / (0.43 * (scene.mesh.scale * base) ** 2)
    contact = scene.mesh.contact_size
    if contact is None:
        return cells
    return cells + 4 * plane.seat_width / (scene.mesh.scale * contact)


def _plane_size(plane: Plane) -> float:
    return min(plane.thickness / 2, plane.platform_thickness / 3, plane.damper_height / 2)


def _z_mass_cells(scene: Any) -> float:
    z = scene.z_mass
    base = scene.mesh.size or min(z.thickness / 2, z.bar / 3)
    solid = z.thickness * z.bar * (z.height + 2 * z.width)
    cells = 0.5 * solid / (0.12 * (scene.mesh.scale * base) ** 3)
    contact = scene.mesh.contact_size or base
    surface = 0.5 * z.bar * (z.height + 2 * z.width)
    return cells + surface / (0.43 * (scene.mesh.scale * contact) ** 2)


def _pair_cells(scene: Any) -> float:
    """A lower bound: three layers of elements of the contact size on the seats of both bodies."""
    pair = scene.hertz if scene.kind == "hertz" else scene.punch
    radius = pair.contact_radius if scene.kind == "hertz" else pair.radius
    fine = scene.mesh.scale * (scene.mesh.contact_size or radius / 10)
    if pair.dimension == 3:
        return 6 * pi / 4 * radius**2 / (0.43 * fine**2)
    return 6 * radius / fine


def _check_sector(scene: Any) -> None:
    from .sector_check import check_sector

    check_sector(scene.aerofoil, scene.platform, scene.shank, scene.disc, scene.damper)


def _check_plane(scene: Any) -> None:
    from .plane import check_plane

    check_plane(scene.plane)


def _check_z_mass(scene: Any) -> None:
    from .zmass import check_z_mass

    check_z_mass(scene.z_mass)


def _check_hertz(scene: Any) -> None:
    from .contact_pairs import check_hertz

    check_hertz(scene.hertz, scene.mesh)


def _check_punch(scene: Any) -> None:
    from .contact_pairs import check_punch

    check_punch(scene.punch, scene.mesh)


def _check_imported(scene: Any) -> None:
    """The kind of the file, and the syntax of the names given to its groups."""
    from .raw_mesh import READERS
    from .renaming import read_names

    suffix = Path(scene.imported.file).suffix.lower()
    if suffix not in (*READERS, *STEP):
        raise InputError(
            f"imported.file = {scene.imported.file!r}: unknown kind of mesh; known are "
            f"{', '.join(sorted((*READERS, *STEP)))}"
        )
    read_names(scene.imported.names or ())


STEP = (".step", ".stp")

_SHAPES: dict[str, Callable[[Any], None]] = {
    "wedge sector": _check_sector,
    "plane blades": _check_plane,
    "z mass": _check_z_mass,
    "hertz": _check_hertz,
    "punch": _check_punch,
    "imported": _check_imported,
}
_CELLS: dict[str, Callable[[Any], float]] = {
    "wedge sector": _wedge_cells,
    "plane blades": _plane_cells,
    "z mass": _z_mass_cells,
    "hertz": _pair_cells,
    "punch": _pair_cells,
}

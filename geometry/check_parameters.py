"""What the geometry refuses before any drawing: proportions, far too many elements, unknown names.

Plain arithmetic on the tables of a scene, by the functions that the record of its kind names; a
mesh that passes may still be refused by the mesher.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bladefem.errors import InputError, suggestion
from bladefem.scene.kinds import kind_named
from bladefem.scene.support import area_springs, held_letters
from bladefem.scene.units import show

from .parameters import MAX_CELLS

if TYPE_CHECKING:
    from bladefem.scene.tables import Scene

# faces at which a damper touches two blades
DAMPER_FACES = ("seat_right", "damper_left", "seat_left", "damper_right")


def check_parameters(scene: Scene) -> None:
    """Refuse what cannot be drawn, and meshes that would never end.

    Args:
        scene: as for ``builders.build_here``.

    Raises:
        InputError: the first rule that is broken, with the field to change.
    """
    kind = kind_named(scene.kind)
    if kind.check is not None:
        kind.check(scene)
    if kind.cells is not None:
        _refuse_many(scene, kind.cells(scene))


def check_names(scene: Scene) -> None:
    """Refuse an excitation or a support at a face or node set that the shape does not have.

    Raises:
        InputError: no such name, with the nearest one.
    """
    face_names = kind_named(scene.kind).face_names
    if face_names is None:
        return
    known = face_names(scene)
    for field, name in [("excitation.at", scene.excitation.at), *_held_names(scene)]:
        if name not in known:
            raise InputError(
                f"{field} = {name!r}: a scene of kind '{scene.kind}' has no face or node set of "
                f"that name{suggestion(name, known)}"
            )


def check_file(scene: Scene) -> list[str]:
    """What responses need and the file of a scene's own geometry does not have, one sentence each.

    The file is read, and drawn where it is a STEP file, which takes seconds.

    Raises:
        InputError: what the mesh would be refused for, or a support that the file does not have.
    """
    kind = kind_named(scene.kind)
    if kind.file_names is None:
        return []
    known = kind.file_names(scene)
    for field, name in _held_names(scene):
        if name not in known:
            raise InputError(
                f"{field} = {name!r}: the file has no face or node set of that "
                f"name{suggestion(name, known)}"
            )
    lacks = []
    at = scene.excitation.at
    if at not in known:
        lacks.append(
            f"excitation.at = {at!r}: enough for modes, responses need a face or node set of the "
            f"file{suggestion(at, known)}"
        )
    missing = sorted(set(DAMPER_FACES) - known)
    if missing:
        lacks.append(
            f"the file has no {', '.join(missing)}: enough for modes, responses need a damper with "
            "its seats; imported.seats draws one to a STEP file"
        )
    return lacks


def _held_names(scene: Scene) -> list[tuple[str, str]]:
    """Fields of the supports and the names in them; an empty name holds nothing."""
    support = scene.support
    return [
        *([("support.clamp", support.clamp)] if support.clamp else []),
        *(("support.springs", face) for face, *_ in area_springs(support)),
        *(("support.directions", face) for face, _ in held_letters(support)),
    ]


def _refuse_many(scene: Scene, cells: float) -> None:
    """The field that is to blame is the one that was given, of two sizes the smaller one."""
    if cells <= MAX_CELLS:
        return
    mesh = scene.mesh
    sizes = {"mesh.size": mesh.size, "mesh.contact_size": mesh.contact_size}
    given = {name: size for name, size in sizes.items() if size is not None}
    said = f"mesh.scale = {mesh.scale:.4g}"
    if given and mesh.scale >= 1:
        name, size = min(given.items(), key=lambda item: item[1])
        said = f"{name} = {show(size, 'm')}"
    raise InputError(
        f"{said}: gives about {cells:.1g} cells, expected at most {MAX_CELLS:.0e}; choose larger "
        "elements, or check the length unit"
    )

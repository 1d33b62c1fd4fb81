"""What the geometry refuses before any drawing: proportions, far too many elements, unknown names.

Plain arithmetic on the tables of a scene, by the functions that the record of its kind names; a
mesh that passes may still be refused by the mesher.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bladefem.errors import InputError, suggestion
from bladefem.scene.kinds import kind_named
from bladefem.scene.support import area_springs, held_letters

if TYPE_CHECKING:
    from bladefem.scene.tables import Scene

# cells; as finalise_mesh.MAX_CELLS, which counts again once the volumes are known
MAX_CELLS = 3e6


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
    support = scene.support
    wanted = [("excitation.at", scene.excitation.at)]
    # an empty name holds nothing
    wanted += [("support.clamp", support.clamp)] if support.clamp else []
    wanted += [("support.springs", face) for face, *_ in area_springs(support)]
    wanted += [("support.directions", face) for face, _ in held_letters(support)]
    for field, name in wanted:
        if name not in known:
            raise InputError(
                f"{field} = {name!r}: a {scene.kind} has no face or node set of that "
                f"name{suggestion(name, known)}"
            )


def _refuse_many(scene: Scene, cells: float) -> None:
    """The field that is to blame is the one that was given."""
    if cells <= MAX_CELLS:
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
        f"cells, expected at most {MAX_CELLS:.0e}; choose larger elements, or check the length unit"
    )

"""Prerequisites that a mesh is missing for a task, checked together before long work."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from geometry.mesh import Mesh

from ...contact.face_profile import seat_gap
from ...data import Patch
from ...errors import InputError, suggestion
from ...hbm.model import Damping
from ...scene.tables import Scene, Support
from ...scene.validate import refuse_bladeless
from .damper_contact import contact_patches
from .ports import named_nodes


def found_patches(
    scene: Scene,
    mesh: Mesh,
    excited: bool,
) -> list[Patch]:
    """The contact patches of a mesh that also has the nodes to excite, where these are needed.

    Raises:
        InputError: one or both are missing, or cannot show crowns and eased edges as [contact]
            wants them.
    """
    patches: list[Patch] = []
    looks: list[Callable[[], object]] = [
        lambda: patches.extend(contact_patches(mesh)),
        lambda: [seat_gap(patch, mesh, scene.contact) for patch in patches],
    ]
    if excited:
        looks.insert(0, lambda: named_nodes(mesh, scene.excitation.at))
    _all_reported(looks)
    return patches


def refuse_loads(
    scene: Scene,
    mesh: Mesh,
    loads: Sequence[tuple[str, float]],
    damping: Damping | None,
) -> None:
    """Check that a mesh has the faces of pressure waves, and the nodes of the excitation that all
    are seen at.

    Args:
        loads: faces and pressures [Pa], as of study.answer.
        damping: the scene's when left out, which must not be zero then.

    Raises:
        InputError: it has not, or there is no damping.
    """
    if damping is None and not scene.operation.damping > 0:
        raise InputError(
            "operation.damping = 0: expected some damping for a forced response, here or by "
            "--damping"
        )

    def face(name: str) -> None:
        if name not in mesh.faces:
            raise InputError(
                f"forced, {name}: the mesh has no such face{suggestion(name, mesh.faces)}"
            )

    _all_reported(
        [
            lambda: named_nodes(mesh, scene.excitation.at),
            *(lambda name=name: face(name) for name, _ in loads if name != "excitation"),
        ]
    )


def _all_reported(looks: Sequence[Callable[[], object]]) -> None:
    """Run all checks; what they refuse becomes one message."""
    problems = []
    for look in looks:
        try:
            look()
        except InputError as error:
            problems.append(str(error))
    if problems:
        raise InputError("; and ".join(problems))


def check_blade(scene: Scene, mesh: Mesh) -> None:
    """Modes and responses need a blade, and a blade needs its clamp."""
    refuse_bladeless(scene.kind)
    clamp = scene.support.clamp
    names = {*mesh.faces, *mesh.nodes}
    if clamp and clamp not in names:
        raise InputError(
            f"support.clamp = '{clamp}': the mesh has no such face or node set, expected one that "
            f"holds the blade{suggestion(clamp, names)}{_how_to_name(scene)}"
        )


def _how_to_name(scene: Scene) -> str:
    """How a set of a file becomes the clamp, where the scene says nothing of it."""
    left_out = scene.kind == "imported" and scene.support.clamp == Support().clamp
    return '; or name one, such as imported.names = ["clamp = face_1"]' if left_out else ""

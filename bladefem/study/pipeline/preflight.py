"""What a run would refuse on its way and a scene alone can tell: checked before any meshing."""

from __future__ import annotations

import numpy as np

from ...contact.interface_elements import seat_contact, stiffnesses
from ...errors import InputError
from ...scene.kinds import kind_named
from ...scene.tables import Scene
from ...scene.units import show
from ..kinds.hertz import check_loads

__all__ = ["refuse_run"]


def refuse_run(scene: Scene) -> None:
    """Refuse a scene that a later stage could not solve.

    Raises:
        InputError: the first thing that is wrong, with the field to change.
    """
    if scene.kind == "hertz" and scene.hertz.interference is None:
        check_loads(scene)
    if kind_named(scene.kind).has_seats:
        _refuse_own_load(scene)
        _refuse_soft_seats(scene)


def _refuse_own_load(scene: Scene) -> None:
    """Only rotation presses a damper by its own mass."""
    if scene.study.own_load and not scene.operation.speed > 0:
        raise InputError(
            "study.own_load = true: nothing presses the damper on its seats at operation.speed = "
            f"{show(scene.operation.speed, 'rad/s')}, expected a speed that does, or study.loads "
            "alone"
        )


def _refuse_soft_seats(scene: Scene) -> None:
    """A normal load that follows the motion needs a normal stiffness on each seat."""
    if scene.contact.normal != "coupled" or scene.contact.stiffness == "map":
        return
    for patch, side in (("this", "right"), ("next", "left")):
        # the ratio of the stiffnesses does not decide whether they are zero
        _, normal = stiffnesses(seat_contact(scene.contact, patch), 1.0, np.ones(1))
        if not normal[0] > 0:
            raise InputError(
                f"contact.kn_area: the normal stiffness of the {side} seat (kn, kn_area, or by "
                "Mindlin from kt, kt_area) is 0, expected a positive value where contact.normal "
                "is 'coupled'"
            )

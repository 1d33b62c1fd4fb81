"""What a run would refuse on its way and a scene alone can tell: checked before any meshing."""

from __future__ import annotations

from ...errors import InputError
from ...scene.kinds import kind_named
from ...scene.tables import Scene
from ...scene.units import show
from ..kinds.hertz import check_loads


def refuse_run(scene: Scene) -> None:
    """Refuse a scene that a later stage could not solve.

    Raises:
        InputError: the first thing that is wrong, with the field to change.
    """
    if scene.kind == "hertz" and scene.hertz.interference is None:
        check_loads(scene)
    if kind_named(scene.kind).has_seats:
        _refuse_own_load(scene)


def _refuse_own_load(scene: Scene) -> None:
    """Only rotation presses a damper by its own mass."""
    if scene.study.own_load and not scene.operation.speed > 0:
        raise InputError(
            "study.own_load = true: nothing presses the damper on its seats at operation.speed = "
            f"{show(scene.operation.speed, 'rad/s')}, expected a speed that does, or study.loads "
            "alone"
        )

"""What a run would refuse on its way and a scene alone can tell: checked before any meshing."""

from __future__ import annotations

from ...errors import InputError
from ...scene.aerodynamics import refuse_flow
from ...scene.kinds import kind_named, load_function
from ...scene.tables import Scene
from ...scene.units import show
from ..fatigue import haigh_diagram
from ..mistuning.validate import check_mistuning


def refuse_run(scene: Scene) -> None:
    """Refuse a scene that a later stage could not solve.

    Raises:
        InputError: the first thing that is wrong, with the field to change.
    """
    haigh_diagram(scene.fatigue)
    check_mistuning(scene)
    kind = kind_named(scene.kind)
    refuse_flow(scene)
    if kind.preflight is not None:
        load_function(kind.preflight)(scene)
    if kind.has_seats:
        _refuse_own_load(scene)


def _refuse_own_load(scene: Scene) -> None:
    """Only rotation presses a damper by its own mass."""
    if scene.study.own_load and not scene.operation.speed > 0:
        raise InputError(
            "study.own_load = true: nothing presses the damper on its seats at operation.speed = "
            f"{show(scene.operation.speed, 'rad/s')}, expected a speed that does, or study.loads "
            "alone"
        )

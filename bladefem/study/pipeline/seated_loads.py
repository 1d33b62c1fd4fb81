"""The contact stage: the damper on its seats under every load of the study, and its own load."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ...contact.frictional_seating import FrictionalProblem, normal_part
from ...contact.seating import ContactProblem
from ...contact.seating import solve_seating as seat
from ...data import Patch
from ...errors import InputError, NotSolvedError
from ...scene.tables import Scene
from ...scene.units import newtons, show
from ...util.message import warning
from .bodies import Bodies
from .damper_contact import condense_contact, on_layer
from .history import (
    FRICTIONLESS,
    coarse_history,
    condense_friction,
    damper_masses,
    history_sentence,
    seat_by_history,
)
from .loads import default_loads
from .run_records import Seating
from .stage_inputs import stage_key
from .stage_runner import StageClock, StageOfOneRank, StageRunner


def seat_every_load(
    scene: Scene,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
    clock: StageClock,
) -> Seating:
    """The damper on its seats under every load, without friction or after the scene's history."""
    condensed = keep.of_one_rank(condensed_stage(scene, patches), bodies)
    rough = None if scene.contact.history == FRICTIONLESS else condensed
    bare = condensed if rough is None else normal_part(rough)
    problem = on_layer(scene, bare)
    own = _own_load(scene, problem, rough, clock.messages)
    return seat_at_loads(
        scene, Seating(problem, {}, own, rough=rough), studied_loads(scene, own), clock
    )


def condensed_stage(scene: Scene, patches: list[Patch]) -> StageOfOneRank:
    """What takes finite elements of the contact: a ContactProblem, or a FrictionalProblem where the
    seating has a history.
    """
    condense = condense_contact if scene.contact.history == FRICTIONLESS else condense_friction
    return StageOfOneRank(
        seating_stage(scene), stage_key("contact", scene), lambda some: condense(some, patches)
    )


def seating_stage(scene: Scene) -> str:
    """Name under which a run folder holds the contact problem of the seats."""
    return "contact" if scene.contact.history == FRICTIONLESS else "contact_friction"


def seat_at_loads(
    scene: Scene,
    seating: Seating,
    loads: Iterable[float],
    clock: StageClock,
) -> Seating:
    """The seats under some loads."""
    found = _seated(scene, seating, loads, clock.messages)
    if found.masses:
        clock.messages.append(history_sentence(found.masses))
    return found


def with_more_loads(
    scene: Scene,
    seating: Seating,
    loads: Iterable[float],
    messages: list[str],
) -> Seating:
    """The seating with the seats under more loads."""
    new = sorted(set(loads) - set(seating.maps))
    if not new:
        return seating
    added = _seated(scene, seating, new, messages)
    return replace(
        seating,
        maps=dict(sorted({**seating.maps, **added.maps}.items())),
        masses=tuple(sorted((*seating.masses, *added.masses), key=lambda made: made.load)),
    )


def _seated(
    scene: Scene,
    seating: Seating,
    loads: Iterable[float],
    messages: list[str],
) -> Seating:
    rough = seating.rough
    if rough is None:
        speed = scene.operation.speed
        bedded = scene.contact.bedded
        maps = {load: seat(seating.problem, speed, normal=load, bedded=bedded) for load in loads}
        return replace(seating, maps=maps)
    seated = {load: seat_by_history(scene, rough, load) for load in loads}
    messages.extend(map(warning, coarse_history(seated)))
    maps = {load: found.maps for load, found in seated.items()}
    return replace(seating, maps=maps, masses=tuple(damper_masses(scene, rough, seated)))


def _own_load(
    scene: Scene,
    problem: ContactProblem,
    rough: FrictionalProblem | None,
    messages: list[str],
) -> float | None:
    """Mean normal load of a seat [N] by the damper's mass at the operating speed; None when nothing
    presses it.
    """
    if not scene.operation.speed > 0:
        return None
    try:
        if rough is None:
            maps = seat(problem, scene.operation.speed, bedded=scene.contact.bedded)
        else:
            maps = seat_by_history(scene, rough, None).maps
    except NotSolvedError as error:
        messages.append(warning(f"the damper's own centrifugal load does not seat it: {error}"))
        return None
    own = float(np.mean([m.force.sum() for m in maps]))
    messages.append(
        f"own load: the damper's {1e3 * problem.mass:.3g} g press each seat with {newtons(own, 4)} "
        f"at {show(scene.operation.speed, 'rad/s')}"
    )
    return own


def studied_loads(
    scene: Scene,
    own: float | None,
    laid: Sequence[float] | None = None,
) -> list[float]:
    """Mean normal loads of a seat to study [N], ascending with the damper's own one where that is
    wanted.

    Args:
        laid: loads of the design chart where the scene gives none; rough ones when left out.
    """
    given = scene.study.loads or laid or default_loads(scene)
    if not scene.study.own_load:
        return list(given)
    if own is None:
        raise InputError(
            "study.own_load = true: nothing presses the damper on its seats at operation.speed = "
            f"{show(scene.operation.speed, 'rad/s')}, expected a speed that does, or study.loads "
            "alone"
        )
    return sorted({*given, float(f"{own:.4g}")})

"""From a scene to forced responses, stage by stage; each is kept in the run folder and found there
by the next run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, overload

from ...contact.peak_pressure import peak_remarks
from ...data import ModeSet, Patch
from ...errors import InputError, suggestion
from ...io.run_folder import given_fields
from ...scene.aerodynamics import has_flow, refuse_flow
from ...scene.assumed import assumed_physics
from ...scene.tables import Scene
from ...scene.validate import refuse_response
from ...scene.warnings import implausible_values
from ...util.communicator import Communicator
from ...util.message import warning
from ...util.progress import Progress, without_progress
from ..adaptive.contact_mesh import coarse_sentence
from ..adaptive.settings import first_settings
from ..modes.clamped_aerofoil import clamped_blade
from ..modes.stress import mode_strength
from .bodies import Bodies, is_wheel
from .body_mesh import mode_errors
from .case_models import judged_modes, load_cases, middle_case, reduced_sector
from .flutter import find_flutter, flutter_sentences, with_best_load
from .history import refuse_jamming
from .normal_modes import excited_modes, find_modes, responding_diameters
from .response_stage import run_response
from .run_records import ModalRun, ReducedRun, Run, SeatedRun, SolvedRun
from .scene_mesh import build_mesh
from .seated_loads import condensed_stage, seat_every_load
from .stage_inputs import stage_key
from .stage_runner import Folder, StageClock, StageOfOneRank, StageRunner
from .validate_mesh import check_blade, found_patches

STAGES = ("mesh", "modes", "contact", "reduction", "response")


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["mesh"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> Run: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["modes"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> ModalRun: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["contact"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> SeatedRun: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["reduction"],
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> ReducedRun: ...


@overload
def run(
    scene: Scene,
    folder: Folder,
    until: Literal["response"] = ...,
    comm: Communicator | None = ...,
    progress: Progress = ...,
) -> SolvedRun: ...


def run(
    scene: Scene,
    folder: Folder,
    until: str = "response",
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> Run:
    """Run a scene as far as a stage, on all ranks of a communicator.

    Args:
        folder: the run folder; finished stages are picked up from it. None: in memory.
        until: one of STAGES.
        progress: wraps long loops, as tqdm does: progress(items, label).

    Returns:
        the record of that stage, see :mod:`bladefem.study.pipeline.run_records`.

    Raises:
        InputError: the scene cannot be run as it is; NotSolvedError: a stage found no solution.
    """
    if until not in STAGES:
        raise InputError(f"until = {until!r}: expected a stage{suggestion(until, STAGES)}")
    responds = until in STAGES[3:]
    if responds:
        refuse_response(scene)
        refuse_flow(scene)
    doubts = [*implausible_values(scene), *_assumed(scene, folder)]
    keep = StageRunner(folder, comm, StageClock({}, [*map(warning, doubts)], progress))
    meshed = _run_mesh(scene, keep)
    if until == "mesh":
        return meshed
    check_blade(scene, meshed.mesh)
    patches = [] if until == "modes" else found_patches(scene, meshed.mesh, excited=responds)
    if patches:
        refuse_jamming(scene, meshed.mesh, patches)
    bodies = Bodies(scene, meshed.mesh, comm, progress)
    modal = _run_modes(meshed, bodies, patches, keep, responds)
    if until == "modes":
        return modal
    seated = _run_contact(modal, bodies, patches, keep)
    if until == "contact":
        return seated
    reduced = _run_reduction(seated, bodies, patches, keep)
    if until == "reduction":
        return reduced
    if not has_flow(scene):
        return run_response(reduced, bodies, patches, keep)
    with keep.clock("flutter"):
        # what friction does not hold is refused before the responses
        flutter = find_flutter(reduced, bodies, patches, keep)
    solved = run_response(reduced, bodies, patches, keep)
    if flutter is None:
        return solved
    with keep.clock("flutter"):
        flutter = with_best_load(flutter, solved, bodies, patches, keep)
    keep.clock.messages.extend(flutter_sentences(flutter))
    return replace(solved, flutter=flutter)


def _assumed(scene: Scene, folder: Folder) -> list[str]:
    """What the folder's user did not give; unknown without a folder, and of scenes of a program."""
    return [] if folder is None else assumed_physics(scene, given_fields(folder))


def _run_mesh(scene: Scene, keep: StageRunner) -> Run:
    clock = keep.clock
    with clock("mesh"):
        mesh = keep("mesh", stage_key("mesh", scene), lambda: build_mesh(scene, keep.comm))
    # what was done to a user's own elements
    clock.messages.extend(mesh.report.get("notes", ()))
    return Run(
        scene=scene,
        folder=None if keep.folder is None else Path(keep.folder),
        mesh=mesh,
        timings=clock.seconds,
        messages=clock.messages,
    )


def _run_modes(
    before: Run,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
    responds: bool,
) -> ModalRun:
    """Modes without damper; where ranks have the bodies for themselves, side by side what follows
    from them by one rank alone.

    Args:
        patches: of the contact, where its stage follows.
    """
    scene = before.scene
    # the reduction needs more modes of the same pencils
    reduced = judged_modes(scene, first_settings(scene)) if responds else 0
    diameters = responding_diameters(scene, before.mesh) if responds else None
    clamped = StageOfOneRank("clamped", stage_key("modes", scene), clamped_blade)

    def found_modes() -> list[ModeSet]:
        turns = scene.operation.stiffening and scene.operation.speed != 0
        # without a reduction ranks may share the sector for few nodal diameters
        if responds and turns and is_wheel(before.mesh):
            keep.compute_beside_state(clamped, bodies)
        return find_modes(bodies, diameters, reduced=reduced)

    with keep.clock("modes"):
        modes = keep("modes", stage_key("modes", scene, *(diameters or ())), found_modes)
    if patches:
        beside = [condensed_stage(scene, patches)]
        if responds:
            beside.append(_mode_errors_stage(before, modes, patches))
        with keep.clock("contact"):
            keep.compute_ahead([*beside, clamped], bodies)
    with keep.clock("modes"):
        blade_alone = keep.of_one_rank(clamped, bodies)
    keep.clock.messages.extend(bodies.storage_remarks)
    return ModalRun(**vars(before), modes=modes, clamped=blade_alone)


def _mode_errors_stage(run: Run, modes: Sequence[ModeSet], patches: list[Patch]) -> StageOfOneRank:
    """The error of the stiffness by the mesh, in the modes that are excited."""
    excited = excited_modes(run.scene, run.mesh, modes)
    return StageOfOneRank(
        "mode_errors",
        stage_key("mode errors", run.scene),
        lambda some: mode_errors(some, patches, excited),
    )


def _run_contact(
    before: ModalRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
) -> SeatedRun:
    scene = before.scene
    mesh = before.mesh
    clock = keep.clock
    with clock("contact"):
        seating = seat_every_load(scene, bodies, patches, keep, clock)
        if mesh.dimension == 2:
            coarse = coarse_sentence(m for pair in seating.maps.values() for m in pair)
            clock.messages.extend(map(warning, filter(None, [coarse])))
        clock.messages.extend(map(warning, peak_remarks(seating.maps, scene, mesh.depth)))
    return SeatedRun(**vars(before), contact=seating)


def _run_reduction(
    before: SeatedRun,
    bodies: Bodies,
    patches: list[Patch],
    keep: StageRunner,
) -> ReducedRun:
    scene = before.scene
    mesh = before.mesh
    excited = excited_modes(scene, mesh, before.modes)
    strength = StageOfOneRank(
        "strength", stage_key("stress", scene), lambda some: mode_strength(some, excited)
    )
    with keep.clock("stresses"):
        stressed = keep.of_one_rank(strength, bodies)
    cases = load_cases(scene, mesh, before.contact)
    middle = middle_case(cases)
    with keep.clock("reduction"):
        settings, reduced = reduced_sector(scene, bodies, middle, patches, keep)
        errors = keep.of_one_rank(_mode_errors_stage(before, before.modes, patches), bodies)
    return ReducedRun(
        **vars(before),
        strength=stressed,
        settings=settings,
        reduced=reduced,
        mode_errors=errors,
    )

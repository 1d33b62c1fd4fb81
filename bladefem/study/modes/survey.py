"""A survey of the modes: all nodal diameters, and what was asked for in addition."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from geometry.mesh import Mesh

from ...data import ModeSet
from ...errors import InputError
from ...hbm.model import Damping
from ...io.run_folder import given_fields
from ...io.stage_cache import cached_stage, found_remark, on_root
from ...io.stored_stage import stored_stage
from ...scene.tables import Scene
from ...util.communicator import Communicator
from ...util.message import method
from ...util.progress import Progress, without_progress
from ..pipeline import pipeline
from ..pipeline.bodies import Bodies, is_wheel
from ..pipeline.normal_modes import MODES_SHOWN, eigensolver, excited_modes, wheel_modes
from ..pipeline.run_records import ModalRun
from ..pipeline.stage_inputs import stage_key
from ..pipeline.validate_mesh import check_blade, refuse_loads
from .campbell import Campbell, campbell_tables
from .clamped_aerofoil import clamped_blade
from .comparison import mac
from .effective_mass import effective_masses
from .linear_response_report import ForcedResponseAnswer, forced_response_answer
from .mesh_convergence import MODES_STUDIED, Convergence, default_sizes, mesh_convergence

# engine orders above the scene's own, in Campbell and SAFE diagrams; all below it are looked at,
# since the lowest carry most of an uneven inflow
ORDERS_ABOVE = 3


@dataclass(frozen=True)
class Wanted:
    """What to find besides the modes."""

    # [rad/s] of a Campbell diagram
    speeds: Sequence[float] | None = None
    # [m] of a refinement study; empty: chosen
    sizes: Sequence[float] | None = None
    # folder of a run to compare with
    other: Path | None = None
    # every nodal diameter from scratch
    direct: bool = False
    # of a linear forced response; empty: the scene's excitation
    loads: Sequence[tuple[str, float]] | None = None
    # of that response; the scene's modal damping when left out
    damping: Damping | None = None


@dataclass(frozen=True)
class Survey:
    """What was found; the run's modes are those of all nodal diameters."""

    run: ModalRun
    bodies: Bodies
    # effective masses
    masses: pd.DataFrame
    campbell: Campbell | None = None
    convergence: Convergence | None = None
    # linear forced response
    answer: ForcedResponseAnswer | None = None
    # (modes, modes of the other run) in the excited nodal diameter
    mac: np.ndarray | None = None
    # the other run's
    compared: ModeSet | None = field(default=None, repr=False)
    # of the aerofoil clamped at its root, at rest
    clamped: ModeSet | None = field(default=None, repr=False)


def survey_modes(
    scene: Scene,
    folder: str | Path,
    wanted: Wanted,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> Survey:
    """Modes of every nodal diameter, and what is asked for in addition; collective.

    Raises:
        InputError, NotSolvedError: from the stages.
    """
    other = None if wanted.other is None else on_root(comm, partial(_read_other, wanted.other))
    start = pipeline.run(scene, folder, until="mesh", comm=comm, progress=progress)
    check_blade(scene, start.mesh)
    if wanted.other is not None and other is not None:
        refuse_other_kind(wanted.other, start.mesh, other[1])
    if wanted.loads is not None:
        refuse_loads(scene, start.mesh, wanted.loads, wanted.damping)
    bodies = Bodies(scene, start.mesh, comm, progress)
    clock = time.perf_counter()
    key = stage_key("survey", scene, wanted.direct)
    sets, before = cached_stage(
        folder, "survey", key, lambda: _all_modes(bodies, wanted.direct), comm
    )
    messages = [*start.messages, *([] if before is None else [found_remark("modes", before)])]
    messages += rigid_mode_remarks(sets)
    run = ModalRun(**{**vars(start), "messages": messages}, modes=sets)
    run.messages.extend(bodies.storage_remarks)
    clock = _stage_seconds(run, "modes", clock)
    result = Survey(
        run, bodies, effective_masses(sets, bodies.still_blade), clamped=clamped_blade(bodies)
    )
    clock = _stage_seconds(run, "effective masses, clamped blade", clock)
    if wanted.speeds is not None:
        result = replace(result, campbell=_campbell(run, bodies, wanted.speeds, folder, comm))
        run.messages.append(orders_remark(scene, on_root(comm, lambda: given_fields(folder))))
        clock = _stage_seconds(run, "campbell", clock)
    if wanted.sizes is not None:
        found = _convergence(run, wanted.sizes, folder, comm, progress)
        result = replace(result, convergence=found)
        clock = _stage_seconds(run, "mesh refinement", clock)
    if wanted.loads is not None:
        result = replace(
            result, answer=forced_response_answer(bodies, wanted.loads, wanted.damping)
        )
        if result.answer is not None and result.answer.response.coriolis is not None:
            messages.append(method("the forced response has Coriolis forces"))
        clock = _stage_seconds(run, "forced response", clock)
    return result if other is None else _compare_modes(result, *other)


def _campbell(
    run: ModalRun,
    bodies: Bodies,
    speeds: Sequence[float],
    folder: str | Path,
    comm: Communicator | None,
) -> Campbell:
    """Campbell tables of these speeds [rad/s], which the folder keeps."""
    orders = _engine_orders(run.scene)
    found, seconds = cached_stage(
        folder,
        "campbell",
        stage_key("campbell", run.scene, list(speeds), orders),
        lambda: campbell_tables(bodies, speeds, orders),
        comm,
    )
    if seconds is not None:
        run.messages.append(found_remark("campbell", seconds))
    return found


def _convergence(
    run: ModalRun,
    sizes: Sequence[float],
    folder: str | Path,
    comm: Communicator | None,
    progress: Progress,
) -> Convergence:
    """The excited diameter on meshes of these sizes, of the usual ones where none are given, which
    the folder keeps.
    """
    excited = excited_set(run)
    n = excited.nodal_diameter
    # after the rigid modes, which any mesh has exactly
    count = MODES_STUDIED + int(np.count_nonzero(excited.frequencies == 0))
    wanted = list(sizes) or default_sizes(run.scene)
    diameters = None if n is None else [n]
    found, seconds = cached_stage(
        folder,
        "mesh_refinement",
        stage_key("mesh_refinement", run.scene, wanted, diameters, count),
        lambda: mesh_convergence(run.scene, wanted, diameters, count, comm, progress),
        comm,
    )
    if seconds is not None:
        run.messages.append(found_remark("mesh refinement", seconds))
    return found


def rigid_mode_remarks(sets: Sequence[ModeSet]) -> list[str]:
    """How many modes of frequency zero there are; nothing where the body is held."""
    found = {s.nodal_diameter: int(np.count_nonzero(s.frequencies == 0)) for s in sets}
    rigid = {n: count for n, count in found.items() if count}
    if not rigid:
        return []
    where = ", ".join(
        f"{count}" if n is None else f"{count} in nodal diameter {n}" for n, count in rigid.items()
    )
    return [f"rigid modes, of frequency 0: {where}; the supports leave the body free in them"]


def excited_set(run: ModalRun) -> ModeSet:
    """The modes of the nodal diameter that the engine order excites, or the nearest one that is
    there.
    """
    return excited_modes(run.scene, run.mesh, run.modes)


def _all_modes(bodies: Bodies, direct: bool) -> list[ModeSet]:
    from ...fem.modes import modes

    if not is_wheel(bodies.mesh):
        flex = bodies.factorised(0)
        return [modes(flex.con, MODES_SHOWN, flex, solver=eigensolver(bodies.scene))]
    return wheel_modes(bodies, MODES_SHOWN, bodies.scene.model.nodal_diameters, direct)


def _engine_orders(scene: Scene) -> list[int]:
    return list(range(1, scene.excitation.engine_order + ORDERS_ABOVE + 1))


def order_is_given(given: Collection[str] | None) -> bool:
    """Whether somebody gave the scene's engine order: it counts as given where nobody knows.

    Args:
        given: dotted names of the fields that were given, as the run folder knows them.
    """
    return given is None or "excitation.engine_order" in given


def orders_remark(scene: Scene, given: Collection[str] | None) -> str:
    """Which engine orders the diagrams have; a default that nobody gave stands where it is seen."""
    own = f"excitation.engine_order = {scene.excitation.engine_order}"
    text = (
        "Campbell crossings, interference and margins are those of engine orders 1 to "
        f"{_engine_orders(scene)[-1]}, up to {ORDERS_ABOVE} above {own}"
    )
    if order_is_given(given):
        return method(text)
    return f"{text}, the default: the scene gives none"


def _stage_seconds(
    run: ModalRun,
    name: str,
    since: float,
) -> float:
    now = time.perf_counter()
    run.timings[name] = now - since
    return now


def _read_other(folder: Path) -> tuple[Mesh, list[ModeSet]]:
    """Mesh and modes of another run.

    Raises:
        InputError: the folder holds none.
    """
    mesh = _read_stage(folder, "mesh")
    sets = _read_stage(folder, "survey") or _read_stage(folder, "modes")
    if mesh is None or sets is None:
        raise InputError(
            f"--compare {folder}: expected the folder of an earlier run of 'bladefem modes'"
        )
    return mesh, sets


def _read_stage(folder: Path, name: str) -> Any:
    """A stage of another run, whatever it was made from; None where it has none."""
    try:
        return stored_stage(folder, name)
    except InputError:
        return None


def refuse_other_kind(folder: Path, own: Mesh, sets: Sequence[ModeSet]) -> None:
    """Modes of a wheel are not compared with those of a single blade.

    Raises:
        InputError: one of both is a wheel, the other a single blade.
    """
    of_wheel = any(s.nodal_diameter is not None for s in sets)
    if of_wheel == is_wheel(own):
        return
    theirs, mine = ("a wheel", "a single blade")[:: 1 if of_wheel else -1]
    raise InputError(
        f"--compare {folder}: its modes are those of {theirs}, expected the run of {mine}, as in "
        "this scene"
    )


def _compare_modes(
    result: Survey,
    mesh: Mesh,
    sets: list[ModeSet],
) -> Survey:
    """MAC against the same nodal diameter of another run; its shapes are interpolated where the
    mesh is another one.
    """
    mine = excited_set(result.run)
    theirs = [s for s in sets if s.nodal_diameter == mine.nodal_diameter]
    if not theirs:
        known = ", ".join(str(s.nodal_diameter) for s in sets)
        raise InputError(
            f"compare: the other run has modes of nodal diameters {known}, expected "
            f"{mine.nodal_diameter} among them"
        )
    own = result.run.mesh
    same = mesh.points.shape == own.points.shape and np.array_equal(mesh.points, own.points)
    match = mac(
        _of_blade(own, mine),
        _of_blade(mesh, theirs[0]) if same else theirs[0],
        _blade_alone(own),
        None if same else _blade_alone(mesh),
    )
    return replace(result, mac=match, compared=theirs[0])


def _blade_alone(mesh: Mesh) -> Mesh:
    """The blade alone: the damper is not part of the modes."""
    return replace(mesh, bodies={"blade": mesh.bodies["blade"]})


def _of_blade(mesh: Mesh, modes: ModeSet) -> ModeSet:
    """The modes with everything but the blade at rest."""
    inside = np.isin(np.arange(len(mesh.points)), mesh.bodies["blade"])
    return replace(modes, shapes=np.where(inside[:, None], modes.shapes, 0.0))

"""What a mistuned scene adds to a run: the whole wheel with one pattern, or the statistics of
many.
"""

from __future__ import annotations

import time
from dataclasses import replace

from ...errors import InputError
from ...io.stage_cache import cached_stage, found_remark, on_root
from ...scene.fields import value_at
from ...scene.kinds import kind_named
from ...scene.other_blades import other_blades
from ...scene.tables import Scene
from ...util.communicator import Communicator
from ...util.message import warning
from ...util.progress import Progress, without_progress
from ...wheel.model import Pattern, Wheel
from ...wheel.pattern_file import BladeDeviations
from ...wheel.solution import WheelSolution
from ...wheel.statistics import (
    Amplification,
    joined_loads,
)
from ...wheel.walking import with_free_means
from ..adaptive.band_sweep import solver_options
from ..pipeline.assemble_model import LoadCase
from ..pipeline.bodies import Bodies
from ..pipeline.case_models import load_cases
from ..pipeline.curve import Curve
from ..pipeline.damped_motion import DampedStress, stress_of_motion
from ..pipeline.run_records import SolvedRun
from ..pipeline.stage_inputs import stage_key
from .blade_material import deviation_pattern
from .blade_stress import SolvedWheel, WheelShapes, all_modes, blade_motion
from .drawn_wheels import KeptWheels, drawn_statistics, drawn_wheels
from .engine_orders import own_harmonic
from .odd_blade import odd_blade_stress
from .other_blades import OtherBlades, changed_blades, foot_of, held_aerofoil
from .own_stress import OwnStress
from .pattern_response import PatternResponse, pattern_response
from .pattern_sentences import pattern_sentences
from .peak_choice import SearchedWheel, wanted_truncation
from .scatter_use import ScatteredUse, scattered_use
from .validate import refuse_scatter, scene_deviations
from .wheel_utilisation import wheel_utilisation_message
from .whole_wheel import WheelSector, blade_readings, reduce_wheel, whole_wheel


def with_whole_wheel(
    run: SolvedRun,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> SolvedRun:
    """The run with the whole wheel under the load that the report begins with."""
    start = time.perf_counter()
    best = run.response.curves[run.response.best_curve]
    bodies = Bodies(run.scene, run.mesh, comm, progress)
    deviation = _run_deviations(run)
    root = deviation.of_material or bool(run.scene.mistuning.blades)
    sector, remarks = _kept_sector(run, [best], bodies, comm, root)
    others, other_remarks = _kept_blades(run, comm)
    key = stage_key(
        "whole wheel",
        run.scene,
        best.load,
        best.mass,
        best.peak.omega,
        deviation,
        *_blade_keys(run.scene),
    )
    found, seconds = cached_stage(
        run.folder,
        "whole_wheel",
        key,
        lambda: _best_response(run, sector, deviation, best, bodies, others, root),
        comm,
    )
    remarks.extend(other_remarks)
    if seconds is not None:
        remarks.append(found_remark("whole_wheel", seconds))
    result = replace(
        run,
        wheel=[found],
        timings={**run.timings, "whole wheel": time.perf_counter() - start},
    )
    held = run.scene.model.static == "uncoupled"
    said = filter(None, [*pattern_sentences([found], held), wheel_utilisation_message(result)])
    return replace(result, messages=[*run.messages, *remarks, *said])


def _best_response(
    run: SolvedRun,
    sector: WheelSector,
    deviation: BladeDeviations,
    curve: Curve,
    bodies: Bodies,
    others: OtherBlades | None,
    root: bool,
) -> PatternResponse:
    """The response of all blades under the load of a curve, whose sectors the ranks share, with the
    stress of the highest one, on one rank.
    """
    comm = bodies.comm
    # all ranks have to take the same decisions: from the same numbers to the last digit
    wheel, pattern, curve, others = on_root(
        comm,
        lambda: (
            _wheels(run, sector, [curve])[0],
            _run_pattern(run, sector, deviation, others),
            curve,
            others,
        ),
    )
    frequency = deviation.blade_alone
    if others is not None:
        frequency = frequency + others.frequencies(*frequency.shape)

    def solved_wheel(pattern: Pattern, solution: WheelSolution) -> SolvedWheel:
        shapes = _shapes_on_one_rank(run, bodies, len(sector.families), root)
        case = _cases(run)[curve.load, curve.mass]
        return SolvedWheel(shapes, wheel, pattern, case, solution, curve.settings.points)

    def stress(
        pattern: Pattern, solution: WheelSolution, blade: int
    ) -> tuple[DampedStress, OwnStress | None]:
        return _blade_stress(run, solved_wheel(pattern, solution), blade, others)

    shared = replace(wheel, comm=comm)
    held_means = run.scene.model.static == "uncoupled"
    searched = SearchedWheel(
        shared,
        None if held_means else with_free_means(shared),
        pattern,
        own_harmonic(run.scene),
        solver_options(run.scene.accuracy),
    )
    return pattern_response(
        searched,
        frequency,
        curve,
        lambda *of_blade: on_root(comm, lambda: stress(*of_blade)),
        others,
        wanted_truncation(run.scene),
        run.scene.accuracy,
    )


def _shapes_on_one_rank(run: SolvedRun, bodies: Bodies, families: int, root: bool) -> WheelShapes:
    """The shapes that the motion of a blade is made of, from bodies of this rank alone.

    Args:
        root: with the motions of the blade's root.
    """
    from ...fem.compat import MPI

    alone = Bodies(run.scene, run.mesh, MPI.COMM_SELF)
    alone.kept.update(bodies.kept)
    _, readings = blade_readings(alone, run.clamped, families, run.modes, root)
    return WheelShapes(alone, list(run.contact.problem.patches), all_modes(alone), readings)


def _blade_stress(
    run: SolvedRun, solved: SolvedWheel, blade: int, others: OtherBlades | None
) -> tuple[DampedStress, OwnStress | None]:
    """The stress of a blade on the mesh of the tuned shape, and on its own where that differs."""
    alone, case = solved.shapes.bodies, solved.case
    if others is None or blade not in others.changes:
        return stress_of_motion(alone, case, blade_motion(solved, blade)), None
    motion, own = odd_blade_stress(run, solved, blade, _given_blades(run.scene)[blade])
    return stress_of_motion(alone, case, motion), own


def _run_deviations(run: SolvedRun) -> BladeDeviations:
    """Deviations of the blades by the scene's pattern."""
    name = kind_named(run.scene.kind).sectors
    count = 0 if name is None else value_at(run.scene, name)
    return scene_deviations(run.scene, count, run.scene.mistuning.families)


def _run_pattern(
    run: SolvedRun,
    sector: WheelSector,
    deviation: BladeDeviations,
    others: OtherBlades | None,
) -> Pattern:
    """The deviations of all blades as forces on their readings; on one rank."""
    aerofoil = None
    if deviation.of_material:
        families = len(sector.families)
        foot = foot_of(run.mesh, run.modes, families)
        aerofoil = held_aerofoil(run.scene, run.mesh, foot, families, run.clamped)
    pattern = deviation_pattern(sector.families, deviation, aerofoil)
    return pattern if others is None else others.added(pattern, len(deviation.mass))


def scatter_of_run(
    run: SolvedRun,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> Amplification:
    """Statistics under all loads of a run; wheels are dealt out over the ranks.

    Raises:
        InputError: the scene has no scatter, or several damper masses.
    """
    scene = run.scene
    refuse_scatter(scene)
    curves = run.response.curves
    root = bool(scene.mistuning.blades)
    sector, _ = _kept_sector(run, curves, Bodies(scene, run.mesh, comm, progress), comm, root)
    made = _wheels(run, sector, curves)
    others, _ = _kept_blades(run, comm)
    return joined_loads(
        [
            _kept_statistics(run, sector, curve, wheel, others, comm, progress)
            for curve, wheel in zip(curves, made, strict=True)
        ]
    )


def scatter_utilisation(
    run: SolvedRun,
    found: Amplification,
) -> tuple[list[ScatteredUse], list[str]]:
    """The utilisation with the band of the scatter, and why it is not known."""
    try:
        return scattered_use(run, found), []
    except InputError as error:
        return [], [warning(f"the utilisation is not known: {error}")]


def _kept_statistics(
    run: SolvedRun,
    sector: WheelSector,
    curve: Curve,
    wheel: Wheel,
    others: OtherBlades | None,
    comm: Communicator | None,
    progress: Progress,
) -> Amplification:
    """Statistics under the load of one curve, computed or found in the folder, where each wheel is
    kept until all are there.
    """
    key = stage_key("scatter", run.scene, curve.load, curve.peak.omega, *_blade_keys(run.scene))
    name = f"scatter_{curve.load:g}N"
    kept = KeptWheels(run.folder, f"{name}_wheels", key)

    def compute() -> Amplification:
        drawn = drawn_wheels(run.scene, sector.families, wheel, curve, others, kept)
        return drawn_statistics(drawn, comm, progress)

    found, _ = cached_stage(run.folder, name, key, compute, comm)
    on_root(comm, kept.remove)
    return found


def _kept_sector(
    run: SolvedRun,
    curves: list[Curve],
    bodies: Bodies,
    comm: Communicator | None,
    root: bool,
) -> tuple[WheelSector, list[str]]:
    """The sector in all nodal diameters, with the motions of the aerofoil's root or without,
    computed or found in the folder, and the remark that it was.
    """
    scene = run.scene
    patches = list(run.contact.problem.patches)
    modes = max(curve.settings.modes for curve in curves)
    families = scene.mistuning.families

    def compute() -> WheelSector:
        # the stress of a blade needs the shapes of the same modes
        all_modes(bodies, modes)
        return reduce_wheel(bodies, patches, modes, run.clamped, families, run.modes, root)

    key = stage_key("wheel", scene, modes, root)
    sector, seconds = cached_stage(run.folder, "wheel_sector", key, compute, comm)
    return sector, [] if seconds is None else [found_remark("wheel_sector", seconds)]


def _kept_blades(run: SolvedRun, comm: Communicator | None) -> tuple[OtherBlades | None, list[str]]:
    """The blades of another shape, computed or found in the folder, and the remark that they were;
    None where the scene gives none.
    """
    scene = run.scene
    if not scene.mistuning.blades:
        return None, []
    given = _given_blades(scene)
    key = stage_key("other blades", scene, *_blade_keys(scene))

    def compute() -> OtherBlades:
        return changed_blades(scene, run.mesh, run.clamped, run.modes, given)

    found, seconds = cached_stage(
        run.folder, "other_blades", key, lambda: on_root(comm, compute), comm
    )
    return found, [] if seconds is None else [found_remark("other_blades", seconds)]


def _blade_keys(scene: Scene) -> list[str]:
    """What the meshes of other blades depend on."""
    return [stage_key("mesh", other) for other in _given_blades(scene).values()]


def _given_blades(scene: Scene) -> dict[int, Scene]:
    """The scenes of the blades of another shape."""
    name = kind_named(scene.kind).sectors
    return {} if name is None else other_blades(scene, value_at(scene, name))


def _cases(run: SolvedRun) -> dict[tuple[float, float | None], LoadCase]:
    """The friction elements of each load and mass of a damper."""
    cases = load_cases(run.scene, run.mesh, run.contact)
    return {(case.load, case.mass): case for case in cases}


def _wheels(
    run: SolvedRun,
    sector: WheelSector,
    curves: list[Curve],
) -> list[Wheel]:
    """The tuned wheel of each curve."""
    patches = list(run.contact.problem.patches)
    cases = _cases(run)
    return [
        whole_wheel(
            run.scene,
            run.mesh,
            sector,
            patches,
            cases[curve.load, curve.mass],
            curve.settings,
        )
        for curve in curves
    ]

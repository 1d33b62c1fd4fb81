"""What a mistuned scene adds to a run: the whole wheel with one pattern, or the statistics of
many.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from ...errors import InputError
from ...scene.fields import value_at
from ...scene.kinds import kind_named
from ...scene.tables import Scene
from ...util.communicator import Communicator
from ...util.progress import Progress, unwatched
from ...wheel.model import Pattern, Wheel, frequency_pattern
from ...wheel.resonance import Respond
from ...wheel.scatter import MAX_DEVIATIONS, drawn_patterns
from ...wheel.statistics import Amplification, scatter_statistics, wheel_respond
from ..pipeline.case_models import load_cases
from ..pipeline.loads import Curve
from ..pipeline.run_records import SolvedRun
from ..pipeline.stages import Bodies
from .pattern_response import (
    SEARCH,
    frequency_grid,
    pattern_responses,
    scene_deviations,
    scene_scatter,
)
from .whole_wheel import WheelSector, read_orders, reduce_wheel, whole_wheel


def is_mistuned(scene: Scene) -> bool:
    """The scene gives how its blades differ."""
    return scene.mistuning.pattern is not None or scene.mistuning.scatter is not None


def check_mistuning(scene: Scene) -> None:
    """Refuse what cannot be run before long work.

    Raises:
        InputError: the pattern, the engine orders or the kind of scene do not fit.
    """
    if not is_mistuned(scene):
        return
    name = kind_named(scene.kind).sectors
    if name is None:
        raise InputError(f"mistuning: a scene of kind '{scene.kind}' has no wheel")
    count = value_at(scene, name)
    if count == 0:
        raise InputError("mistuning: expected a wheel, imported.sectors = 0 has a single blade")
    scene_deviations(scene, count, scene.mistuning.families)
    read_orders(scene)


def with_whole_wheel(
    run: SolvedRun,
    comm: Communicator | None = None,
    progress: Progress = unwatched,
) -> SolvedRun:
    """The run with the whole wheel under the load whose tuned resonance is lowest."""
    start = time.perf_counter()
    best = min(run.response.curves, key=lambda curve: curve.peak_amplitude)
    sector, wheels = _wheels(run, [best], comm, progress)
    found = pattern_responses(run.scene, sector, wheels, [best], progress)
    seconds = time.perf_counter() - start
    return replace(run, wheel=found, timings={**run.timings, "whole wheel": seconds})


def scatter_of_run(
    run: SolvedRun,
    comm: Communicator | None = None,
    progress: Progress = unwatched,
) -> Amplification:
    """Statistics under all loads of a run; wheels are dealt out over the ranks.

    Raises:
        InputError: the scene has no scatter, or several damper masses.
    """
    scene = run.scene
    if scene.mistuning.scatter is None:
        raise InputError(
            "mistuning.scatter: expected a relative standard deviation of the blades' "
            "frequencies, such as '1 %', for 'bladefem scatter'"
        )
    curves = run.response.curves
    if len({curve.mass for curve in curves}) > 1:
        raise InputError("study.masses: expected one damper mass for 'bladefem scatter'")
    sector, made = _wheels(run, curves, comm, progress)
    wheels = {curve.load: wheel for curve, wheel in zip(curves, made, strict=True)}
    by_load = {curve.load: curve for curve in curves}

    def patterns(wheel: Wheel) -> list[Pattern]:
        return drawn_patterns(
            wheel,
            scene_scatter(scene),
            scene.mistuning.wheels,
            lambda deviation: frequency_pattern(sector.families, deviation),
        )

    spread = MAX_DEVIATIONS * scene.mistuning.scatter + 0.005
    return scatter_statistics(
        wheels,
        {load: patterns(wheel) for load, wheel in wheels.items()},
        lambda load, pattern: frequency_grid(wheels[load], by_load[load], pattern, spread),
        _respond_by(by_load, wheels),
        comm,
        SEARCH,
        progress,
    )


def _respond_by(
    curves: dict[float, Curve], wheels: dict[float, Wheel]
) -> Callable[[Wheel, Pattern], Respond]:
    """Solves a wheel with the settings of its load's curve."""
    load_of = {id(wheel): load for load, wheel in wheels.items()}

    def respond(wheel: Wheel, pattern: Pattern) -> Respond:
        settings = curves[load_of[id(wheel)]].settings
        H = max(settings.harmonics, *wheel.excitation)
        return wheel_respond(wheel, pattern, H, max(settings.samples, 8 * (H + 1)))

    return respond


def _wheels(
    run: SolvedRun,
    curves: list[Curve],
    comm: Communicator | None,
    progress: Progress,
) -> tuple[WheelSector, list[Wheel]]:
    """The sector in all nodal diameters, and the tuned wheel of each curve."""
    scene = run.scene
    patches = list(run.contact.problem.patches)
    bodies = Bodies(scene, run.mesh, comm, progress)
    modes = max(curve.settings.modes for curve in curves)
    sector = reduce_wheel(bodies, patches, modes, run.clamped, scene.mistuning.families)
    cases = {(case.load, case.mass): case for case in load_cases(scene, run.mesh, run.contact)}
    wheels = [
        whole_wheel(scene, run.mesh, sector, patches, cases[curve.load, curve.mass], curve.settings)
        for curve in curves
    ]
    return sector, wheels

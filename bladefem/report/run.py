"""All that a run leaves in its folder: tables, one netCDF file, ParaView files, pictures and the
report.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from geometry.mesh import Mesh
from geometry.quality import quality_rows

from ..contact.state_table import quasi_static
from ..data import ModeSet
from ..hbm.parallel import share_work
from ..io.run_folder import take_folder
from ..io.stage_cache import on_root
from ..scene.tables import Scene
from ..scene.units import show
from ..study.mistuning.stage import with_whole_wheel
from ..study.mistuning.validate import check_mistuning, is_mistuned
from ..study.modes.comparison import family_table
from ..study.modes.stress import Strength
from ..study.modes.survey import excited_set
from ..study.pipeline import pipeline
from ..study.pipeline.contact_cycle import ContactCycle
from ..study.pipeline.coriolis import CORIOLIS_SHARE, has_coriolis
from ..study.pipeline.linear_limits import Limit
from ..study.pipeline.loads import Curve, design_table
from ..study.pipeline.response_remarks import load_of
from ..study.pipeline.run_records import SolvedRun, folder_of
from ..study.pipeline.stability import UNIQUE
from ..study.pipeline.state_check import state_sentence
from ..util.arrays import ComplexArray
from ..util.communicator import Communicator
from ..util.message import method, warning
from ..util.progress import Progress, without_progress
from ..view import mesh, modes, optimum, response, speed
from ..view.influence import draw_influences
from ..view.live_curves import live_diameters, live_loops, live_optimum, live_responses
from ..view.live_shapes import live_motion, live_shapes
from ..view.motion import draw_motion
from .best_load import best_load_table
from .fatigue import (
    utilisation_drawing,
    utilisation_table,
    worst_utilisation,
)
from .flow import flow_drawing, flow_headlines, flow_tables
from .headlines import Headline
from .influences import influence_sentence, influence_table
from .linear import linear_sentence
from .nodes import (
    cycles_of,
    draw_hysteresis,
    draw_wear,
    seat_loops,
    wear_sentence,
    wear_table,
)
from .pressure import PICTURE, draw_seats, pressure_table
from .resonance_table import resonance_table
from .run_files import MODE_SHAPES, file_writers
from .wheel import blade_table, pattern_drawings, pattern_headlines, pattern_table
from .write import Page, write_report

# the figure of the blade's motion under the best load
MOTION_FIGURE = "response/damped_motion"
# relative difference of frequencies that no search resolves
SAME_FREQUENCY = 1e-4
MESH_ERROR_NOTE = (
    "the estimated errors are those of modes, harmonics, samples, contact points, damper model and "
    "of the mesh, of seats and blade; other meshes are compared by 'bladefem modes --converge' "
    "(frequencies) and 'bladefem chart --mesh' (resonance)"
)


# what takes a second or more
SLOWEST_TO_WRITE = ("modes/first_modes", "mesh/mesh", "modes/mode_on_the_wheel", MODE_SHAPES)


def report_run(
    scene: Scene,
    folder: str | Path,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> SolvedRun:
    """Everything: mesh, modes, contact, responses, and the folder with pictures and report.

    Raises:
        InputError: the scene cannot be run as it is; NotSolvedError: a stage found no solution.
    """
    check_mistuning(scene)
    result = pipeline.run(scene, folder, comm=comm, progress=progress)
    if is_mistuned(scene):
        result = with_whole_wheel(result, comm, progress)
    return write_run(result, comm, progress)


def write_run(
    result: SolvedRun,
    comm: Communicator | None = None,
    progress: Progress = without_progress,
) -> SolvedRun:
    """Write the folder of a finished run; returns the run with the time that it took.

    Pictures and files are dealt over the ranks; rank 0 writes the report, which holds the pictures.
    """
    start = time.perf_counter()
    folder = folder_of(result)
    moved = on_root(comm, lambda: take_folder(folder, result.scene))
    cycles = cycles_of(result)
    tables = _all_tables(result, cycles)
    drawings = _all_drawings(result, tables, cycles)
    figures = {name: folder / f"{name.split('/')[1]}.png" for name in drawings}
    jobs: dict[str, Callable[[], object]] = {
        **{name: partial(draw, figures[name]) for name, draw in drawings.items()},
        **file_writers(result, tables, cycles),
    }
    # the longest first: what follows goes to the rank that is free
    order = sorted(jobs, key=lambda name: name not in SLOWEST_TO_WRITE)
    share_work(
        lambda name: _finished(jobs[name]),
        order,
        comm,
        lambda items: progress(items, "pictures and files"),
        on_demand=True,
    )
    messages = [*filter(None, [moved]), *_report_messages(result, cycles)]
    on_root(comm, lambda: _write_page(result, tables, cycles, figures, messages))
    return replace(
        result, timings={**result.timings, "pictures and report": time.perf_counter() - start}
    )


def _all_tables(result: SolvedRun, cycles: list[ContactCycle]) -> dict[str, pd.DataFrame]:
    patches = list(result.contact.problem.patches)
    coefficient = result.scene.contact.wear_coefficient
    tables = {**_tables(result), **flow_tables(result), **_wheel_tables(result)}
    if coefficient is not None:
        tables["contact/wear"] = wear_table(patches, cycles, coefficient)
    return tables


def _all_drawings(
    result: SolvedRun,
    tables: dict[str, pd.DataFrame],
    cycles: list[ContactCycle],
) -> dict[str, Callable[[Path], object]]:
    """Name of a picture -> what draws it into a file."""
    patches = list(result.contact.problem.patches)
    return {
        **_drawings(result, tables),
        "response/hysteresis": lambda file: draw_hysteresis(cycles, file),
        "contact/friction_work": lambda file: draw_wear(patches, cycles[_best(result)], file),
        **utilisation_drawing(result),
        **flow_drawing(result),
        **({} if result.wheel is None else pattern_drawings(result.wheel)),
    }


def _finished(job: Callable[[], object]) -> None:
    """What a job returns is of no use to other ranks."""
    job()


def _write_page(
    result: SolvedRun,
    tables: dict[str, pd.DataFrame],
    cycles: list[ContactCycle],
    figures: dict[str, Path],
    messages: list[str],
) -> None:
    """The report, once its pictures are there."""
    write_report(
        folder_of(result),
        result.scene,
        tables,
        figures,
        messages,
        result.timings,
        page=Page(
            _live(result, tables, cycles), more=[*flow_headlines(result), *_wheel_headlines(result)]
        ),
    )


def _report_messages(result: SolvedRun, cycles: list[ContactCycle]) -> list[str]:
    """What the run had to say, and how far its models reach."""
    coefficient = result.scene.contact.wear_coefficient
    messages = [
        *result.messages,
        method(MESH_ERROR_NOTE),
        _static_contact(result),
        *_coriolis(result),
        method(_states(result)),
        method(linear_sentence(cycles)),
        *beyond_stick(result),
    ]
    if result.response.influences:
        messages.append(influence_sentence(result.response.influences))
    if coefficient is not None:
        messages.append(wear_sentence(cycles, coefficient))
    return messages


def _live(
    result: SolvedRun,
    tables: dict[str, pd.DataFrame],
    cycles: list[ContactCycle],
) -> dict[str, dict[str, Any]]:
    """Figures to hover over and rotate, by the names of the pictures that they replace."""
    excited = excited_set(result)
    shapes = live_shapes(
        result.mesh, excited, [str(name) for name in tables["modes/modes"]["family"]]
    )
    motions = live_motion(result.mesh, _motions(result))
    curves = {
        name: live_responses(points, _title(result.scene))
        for name, points in _by_mass(tables["response/points"])
    }
    return {
        **curves,
        "response/optimum": live_optimum(
            tables["response/summary"],
            result.contact.own,
            searched=tables.get("response/best_load"),
        ),
        "response/hysteresis": live_loops(seat_loops(cycles)),
        "modes/frequencies_by_nodal_diameter": live_diameters(tables["modes/nodal_diameters"]),
        **({} if shapes is None else {"modes/first_modes": shapes}),
        **({} if motions is None else {MOTION_FIGURE: motions}),
    }


def _motions(result: SolvedRun) -> dict[str, ComplexArray]:
    """Title to the motion at the resonance of each load whose stress was computed, the lowest
    resonance first.
    """
    curves = result.response.curves
    order = sorted(result.damped, key=lambda number: curves[number].peak_amplitude)
    return {
        f"{result.damped[number].load:.4g} N per seat, {curves[number].peak_frequency:.5g} Hz": (
            result.damped[number].motion
        )
        for number in order
    }


def _wheel_tables(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """Tables of the whole wheel, where blades differ."""
    if result.wheel is None:
        return {}
    return {
        "wheel/whole_wheel": pattern_table(result.wheel),
        "wheel/blades": blade_table(result.wheel),
    }


def _wheel_headlines(result: SolvedRun) -> list[Headline]:
    """First numbers of the whole wheel, where blades differ."""
    if result.wheel is None:
        return []
    return pattern_headlines(result.wheel, worst_utilisation(result))


def _static_contact(result: SolvedRun) -> str:
    """Whether the contact may be taken as quasi-static up to the last harmonic kept of the highest
    frequency.
    """
    patch = next(iter(result.contact.maps.values()))[0].patch
    highest = max(
        curve.settings.harmonics * float(np.max(curve.frequency))
        for curve in result.response.curves
    )
    found = quasi_static(patch, result.scene.material.blade, highest)
    return method(found.sentence) if found.holds else warning(found.sentence)


def _coriolis(result: SolvedRun) -> list[str]:
    """Whether responses have Coriolis forces, and what they do."""
    shift = result.strength.coriolis
    if not shift > 0:
        return []
    share = (
        f"Coriolis forces move the waves of mode {result.strength.mode} by {100 * shift:.2g} % of "
        "its frequency"
    )
    if has_coriolis(result.reduced):
        return [method(f"{share}; responses have them.")]
    if shift <= CORIOLIS_SHARE * result.scene.accuracy:
        return [method(f"{share}; they are left out of the responses.")]
    return [
        warning(
            f"{share}, and are left out of the responses by operation.coriolis = false: resonances "
            "lie that much lower or higher, and amplitudes may differ; 'bladefem modes --campbell' "
            "has both waves."
        )
    ]


def _states(result: SolvedRun) -> str:
    """Whether the paper's table of states would do for the loads of the run and the normal motion
    at its resonances.
    """
    motions = [
        c.peak.w[:, 0, 1:]
        for c in result.response.curves
        if c.peak.w.shape[1] == result.mesh.dimension
    ]
    travel = max((float(np.abs(w).max()) for w in motions), default=0.0)
    return state_sentence(
        result.scene, result.contact.problem, list(result.contact.maps), travel or 1e-6
    )


def beyond_stick(result: SolvedRun) -> list[str]:
    """Why resonances lie above that of full stick, where the static load leaves points open."""
    stuck = result.response.limits[1].peak_frequency
    opened = {
        load
        for load, maps in result.contact.maps.items()
        if any((one.force <= 0).any() for one in maps)
    }
    above = [
        load_of(curve)
        for curve in result.response.curves
        if curve.load in opened and curve.peak_frequency > (1 + SAME_FREQUENCY) * stuck
    ]
    if not above:
        return []
    return [
        f"resonances above that of full stick under {', '.join(above)}: contact points that the "
        "static load leaves open close in vibration, and count as open in full stick"
    ]


def _tables(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """Tables of the report, "section/name", SI columns."""
    curves = result.response.curves
    return {
        "mesh/quality": pd.DataFrame(quality_rows(result.mesh), columns=["what", "value"]),
        "modes/modes": family_table(excited_set(result), result.mesh, result.clamped),
        "modes/nodal_diameters": mode_table(result.modes, result.mesh, result.clamped),
        "modes/stresses": _stresses(result.strength),
        **utilisation_table(result),
        "contact/pressure": pressure_table(result.contact.maps),
        **_own_load(result),
        **_best_load(result),
        **_damper_masses(result),
        "response/summary": _summary(result),
        **resonance_table(curves),
        "response/points": _joined(
            [*map(points_of, curves), *map(linear_points, result.response.limits)]
        ),
    }


def _joined(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """Response points of all curves; the linear limits have one motion each."""
    points = pd.concat(parts, ignore_index=True)
    return points.fillna({"stability": UNIQUE}) if "stability" in points else points


def _summary(result: SolvedRun) -> pd.DataFrame:
    """The design table, with the alternating stress at each resonance."""
    table = pd.DataFrame(design_table(result.response.curves, result.response.limits))
    table.insert(
        table.columns.get_loc("reduction") + 1,
        "alternating_stress",
        _alternating(result, table["peak_amplitude"].to_numpy()),
    )
    return table


def _alternating(result: SolvedRun, amplitudes: np.ndarray) -> np.ndarray:
    """(rows,) alternating stress [Pa] of the design table: of the whole motion where that was
    computed, in proportion to the amplitude where a march contradicts it, of the mode alone at
    the other loads, without damper and stuck.
    """
    stress = result.strength.alternating * amplitudes
    for number, found in (result.damped or {}).items():
        curve = result.response.curves[number]
        marched = curve.peak_amplitude / curve.balance_amplitude
        stress[1 + number] = marched * found.largest
    return stress


def _stresses(found: Strength) -> pd.DataFrame:
    """Where the blade is stressed most, by rotation and by the mode studied."""
    rows = [
        ("rotation", found.steady, found.steady_at),
        (f"mode {found.mode}, 1 mm at the probe", 1e-3 * found.alternating, found.alternating_at),
    ]
    return pd.DataFrame(
        [
            {"state": name, "von_mises_gauss": size, **dict(zip("xyz", place, strict=True))}
            for name, size, place in rows
            if size > 0
        ]
    )


def _own_load(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """The load that the damper's own mass makes at the operating speed, where it makes any."""
    own = result.contact.own
    return (
        {}
        if own is None
        else {
            "contact/own_load": pd.DataFrame(
                {
                    "mass": [result.contact.problem.mass],
                    "speed": [result.scene.operation.speed],
                    "load": [own],
                }
            )
        }
    )


def _best_load(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """What the exact search for the best load found, where there was one."""
    best = result.response.best
    if not best:
        return {}
    found = {"response/best_load": best_load_table(best)}
    if result.response.influences:
        lowest = min((b for b in best if not b.reason), key=lambda b: b.amplitude)
        found["response/influences"] = influence_table(result.response.influences, lowest)
    return found


def _damper_masses(result: SolvedRun) -> dict[str, pd.DataFrame]:
    """The damper that makes each load, where friction takes part in the seating."""
    masses = result.contact.masses
    return {"contact/damper_mass": pd.DataFrame(map(asdict, masses))} if masses else {}


def _by_mass(points: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Name of the picture and response points of each damper mass, the linear limits with all of
    them.
    """
    if "mass" not in points:
        return [("response/forced_response", points)]
    return [
        (
            f"response/forced_response_{1e3 * mass:g}g",
            points[(points["mass"] == mass) | points["mass"].isna()],
        )
        for mass in points["mass"].dropna().unique()
    ]


def mode_table(
    sets: list[ModeSet],
    geometry: Mesh,
    clamped: ModeSet | None = None,
) -> pd.DataFrame:
    """One row a mode of each nodal diameter, named after the clamped blade's modes where these are
    given.
    """
    rows = [
        pd.DataFrame(
            {
                "nodal_diameter": 0 if s.nodal_diameter is None else s.nodal_diameter,
                "mode": np.arange(1, len(s.frequencies) + 1),
                "frequency": s.frequencies,
                "family": family_table(s, geometry, clamped)["family"],
                "residual": s.residuals,
            }
        )
        for s in sets
    ]
    return pd.concat(rows, ignore_index=True)


def points_of(curve: Curve) -> pd.DataFrame:
    """One row a response point."""
    mass = {} if curve.mass is None else {"mass": curve.mass}
    return pd.DataFrame(
        {
            "load": curve.load,
            **mass,
            "frequency": curve.frequency,
            "amplitude": curve.amplitude,
            "phase": np.angle(curve.first),
            "converged": curve.converged,
            "method": curve.method,
            "route": curve.route,
            "residual": curve.residual,
            "iterations": curve.iterations,
            "slipping": curve.slipping,
            "drift": curve.drift,
            "dissipated": curve.dissipated,
            "imbalance": curve.imbalance,
            "estimated_error": curve.estimated,
            "tolerated_error": curve.tolerated,
            "error_checked": curve.checked,
            **({"branch": curve.branch} if curve.branch.any() else {}),
            **(
                {
                    "stability": curve.stability,
                    "multiplier": curve.multiplier,
                    "bifurcation": curve.bifurcation,
                }
                if any(curve.stability)
                else {}
            ),
        }
    )


def linear_points(limit: Limit) -> pd.DataFrame:
    """One row a point of a linear limit, with the columns of :func:`points_of`."""
    return pd.DataFrame(
        {
            "load": limit.load,
            "frequency": limit.frequency,
            "amplitude": abs(limit.first),
            "phase": np.angle(limit.first),
            "converged": True,
            "method": "linear",
            "route": "linear",
            "residual": 0.0,
            "iterations": 0,
            "slipping": 0,
            "drift": 0.0,
            "dissipated": 0.0,
            "imbalance": 0.0,
            "estimated_error": 0.0,
            "tolerated_error": 0.0,
            "error_checked": False,
        }
    )


def _best(result: SolvedRun) -> int:
    """Number of the curve with the lowest resonance: pictures of one load show that one."""
    return int(np.argmin([curve.peak_amplitude for curve in result.response.curves]))


def _title(scene: Scene) -> str:
    """What shakes the blade, and where it is seen."""
    excitation = scene.excitation
    speed = scene.operation.speed
    order = (
        f", engine order {excitation.engine_order} at {show(speed, 'rad/s')}" if speed > 0 else ""
    )
    return f"motion of {excitation.at} under {show(excitation.force, 'N')}{order}"


def _drawings(
    result: SolvedRun, tables: dict[str, pd.DataFrame]
) -> dict[str, Callable[[Path], object]]:
    """What to draw: "section/name" to a function of the file."""
    geometry = result.mesh
    excited = excited_set(result)
    best = result.response.curves[_best(result)].load
    drawings: dict[str, Callable[[Path], object]] = {
        "mesh/mesh": lambda file: mesh.draw_mesh(geometry, file, title=result.scene.title),
        "modes/first_modes": lambda file: modes.draw_mode_sheet(
            geometry, excited, file, families=list(tables["modes/modes"]["family"])
        ),
        f"contact/{PICTURE}": lambda file: draw_seats(result.contact.maps, best, file),
        **{
            name: partial(response.draw_responses, points, title=_title(result.scene))
            for name, points in _by_mass(tables["response/points"])
        },
        "response/optimum": lambda file: optimum.draw_optimum(
            tables["response/summary"],
            file,
            points=tables["response/points"],
            own=result.contact.own,
            searched=tables.get("response/best_load"),
        ),
    }
    for title, motion in list(_motions(result).items())[:1]:
        drawings[MOTION_FIGURE] = partial(draw_motion, geometry, motion, title=title)
    if "response/influences" in tables:
        drawings["response/influences"] = partial(draw_influences, tables["response/influences"])
    if len(result.modes) > 1:
        number = result.scene.excitation.mode - 1
        drawings["modes/mode_on_the_wheel"] = lambda file: modes.draw_wheel_mode(
            geometry, excited, number, file
        )
        drawings["modes/frequencies_by_nodal_diameter"] = lambda file: speed.draw_nodal_diameters(
            tables["modes/nodal_diameters"], file
        )
    return drawings

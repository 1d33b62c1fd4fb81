"""Pictures of a run's report, still and live."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from ..scene.tables import Scene
from ..scene.units import newtons, show
from ..study.modes.survey import excited_set
from ..study.pipeline.contact_cycle import ContactCycle
from ..study.pipeline.run_records import SolvedRun
from ..util.arrays import ComplexArray
from ..view import mesh, modes, optimum, response, speed
from ..view.influence import draw_influences
from ..view.live_curves import live_diameters, live_loops, live_optimum, live_responses
from ..view.live_shapes import live_motion, live_shapes
from ..view.live_wheel import live_wheel
from ..view.motion import draw_motion
from .best_load import lowest_resonance
from .fatigue import utilisation_drawing
from .flow import flow_drawing
from .nodes import draw_hysteresis, draw_wear, seat_loops
from .pressure import PICTURE, draw_seats
from .wheel import WHEEL_FIGURE, pattern_drawings, shown_response

# the figure of the blade's motion under the best load
MOTION_FIGURE = "response/damped_motion"


def run_drawings(
    result: SolvedRun,
    tables: dict[str, pd.DataFrame],
    cycles: list[ContactCycle],
) -> dict[str, Callable[[Path], object]]:
    """Name of a picture -> what draws it into a file."""
    patches = list(result.contact.problem.patches)
    return {
        **_drawings(result, tables),
        "response/hysteresis": lambda file: draw_hysteresis(cycles, file),
        "contact/friction_work": lambda file: draw_wear(
            patches, cycles[result.response.best_curve], file
        ),
        **utilisation_drawing(result),
        **flow_drawing(result),
        **({} if result.wheel is None else pattern_drawings(result.wheel)),
    }


def live_figures(
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
            named=_names_optimum(tables),
        ),
        "response/hysteresis": live_loops(seat_loops(cycles)),
        **_live_frequencies(tables["modes/nodal_diameters"]),
        **({} if shapes is None else {"modes/first_modes": shapes}),
        **({} if motions is None else {MOTION_FIGURE: motions}),
        **_live_wheel(result),
    }


def _live_frequencies(table: pd.DataFrame) -> dict[str, Any]:
    """Over the nodal diameters of a wheel."""
    if "nodal_diameter" not in table:
        return {}
    return {"modes/frequencies_by_nodal_diameter": live_diameters(table)}


def _names_optimum(tables: dict[str, pd.DataFrame]) -> bool:
    """The answer names an optimum."""
    summary, points = tables["response/summary"], tables["response/points"]
    return not lowest_resonance(summary, points, tables.get("response/best_load")).against


def _live_wheel(result: SolvedRun) -> dict[str, dict[str, Any]]:
    """All blades of a mistuned wheel at its highest point."""
    if result.wheel is None:
        return {}
    r = shown_response(result.wheel)
    title = f"{newtons(r.load, 4)} per seat, {r.frequency:.5g} Hz"
    return {WHEEL_FIGURE: live_wheel(r.solution.probe[:, 1:, 0], title)}


def _motions(result: SolvedRun) -> dict[str, ComplexArray]:
    """Title to the motion at the resonance of each load whose stress was computed, the lowest
    resonance first; last that of the highest blade of a mistuned wheel.
    """
    curves = result.response.curves
    order = sorted(result.damped, key=lambda number: curves[number].peak_amplitude)
    found = {
        f"{newtons(result.damped[number].load, 4)} per seat, "
        f"{curves[number].peak_frequency:.5g} Hz": (
            curves[number].over_balance * result.damped[number].motion
        )
        for number in order
    }
    if result.wheel is not None:
        r = shown_response(result.wheel)
        name = f"blade {r.peak.blade + 1} of the mistuned wheel, {newtons(r.load, 4)}"
        found[name] = r.highest.stress.motion
    return found


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
    best = result.response.curves[result.response.best_curve].load
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
            named=_names_optimum(tables),
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

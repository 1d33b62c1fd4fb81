"""Tables, fields and the picture of what of the material's endurance a run uses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from geometry.mesh import Mesh

from ..errors import InputError
from ..scene.units import newtons
from ..study.fatigue import Utilisation, haigh_diagram
from ..study.mistuning.pattern_response import PatternResponse
from ..study.mistuning.wheel_utilisation import BladeUse, wheel_utilisation
from ..study.pipeline.curve import load_of
from ..study.pipeline.run_records import SolvedRun
from ..study.pipeline.utilisation import (
    blade_nodes,
    highest_wheel_use,
    run_utilisation,
    upper_end,
    upper_wheel_end,
)
from ..view.fatigue import draw_utilisation
from ..view.mesh import save_vtu


def known_utilisation(run: SolvedRun) -> dict[int, Utilisation]:
    """By number of the curve; empty where it is not known, which the run's messages say."""
    try:
        return run_utilisation(run)
    except InputError:
        return {}


def known_wheel_use(run: SolvedRun) -> list[tuple[PatternResponse, list[BladeUse]]]:
    """Each response of the whole wheel with the utilisation of its highest blades, the blade that
    decides first; empty where it is not known, which the run's messages say.
    """
    if run.wheel is None or not known_utilisation(run):
        return []
    try:
        return list(zip(run.wheel, wheel_utilisation(run), strict=True))
    except InputError:
        return []


def utilisation_table(run: SolvedRun) -> dict[str, pd.DataFrame]:
    """The worst places of the blade at each resonance whose whole motion is known, those of the
    blade that decides on a mistuned wheel, and where shapes differ one row for each; no table
    without a diagram.
    """
    found = known_utilisation(run)
    if not found:
        return {}
    rows = []
    for number, used in found.items():
        curve = run.response.curves[number]
        first = {"load": curve.load, **({} if curve.mass is None else {"mass": curve.mass})}
        rows += _worst_rows(run, first, used, upper_end(run, number))
    tables = {"modes/fatigue": pd.DataFrame(rows)}
    number = run.response.best_curve
    rows = []
    blades = []
    for response, uses in known_wheel_use(run):
        for use in uses:
            bound = upper_wheel_end(run, number, use.blade.worst.mesh_error)
            first = {"load": response.load, "blade": use.blade.blade + 1}
            if use is uses[0]:
                rows += _worst_rows(run, first, use.used, bound)
            if len(uses) > 1:
                blades.append(
                    {
                        **first,
                        "highest_amplitude": use.blade.height,
                        "peak_frequency": use.blade.frequency,
                        "alternating_stress": use.blade.worst.largest,
                        "utilisation": use.highest,
                        "utilisation_bound": bound * use.highest,
                    }
                )
    if rows:
        tables["wheel/fatigue_of_the_worst_blade"] = pd.DataFrame(rows)
    if blades:
        tables["wheel/utilisation_of_the_shapes"] = pd.DataFrame(blades)
    return tables


def _worst_rows(
    run: SolvedRun,
    first: dict[str, float],
    used: Utilisation,
    bound: float,
) -> list[dict[str, float]]:
    """One row a place.

    Args:
        first: columns that all rows share.
        bound: upper ends of the errors over the utilisation [1].
    """
    diagram = haigh_diagram(run.scene.fatigue)
    # the utilisation is known only with a diagram
    assert diagram is not None
    allowed = diagram.allowed(used.mean)
    return [
        {
            **first,
            "place": rank,
            **dict(zip("xyz", used.points[node], strict=True)),
            "mean_stress": used.mean[node],
            "alternating_stress": used.alternating[node],
            "allowed_stress": allowed[node],
            "utilisation": used.used[node],
            "utilisation_bound": bound * used.used[node],
        }
        for rank, node in enumerate(used.worst_places(), 1)
    ]


@dataclass(frozen=True)
class WorstUse:
    """The highest utilisation of a mistuned wheel."""

    # number from 0
    blade: int
    value: float
    # with the upper ends of its errors
    bound: float
    # on the tuned wheel
    tuned: float


def worst_utilisation(run: SolvedRun) -> list[WorstUse]:
    """Highest utilisation, response by response of the whole wheel; empty where it is not known."""
    tuned = known_utilisation(run)
    if not tuned:
        return []
    number = run.response.best_curve
    beside = float(tuned[number].used[tuned[number].worst])
    return [
        WorstUse(
            worst.blade.blade,
            worst.highest,
            highest_wheel_use(run, number, worst.used, worst.blade.worst.mesh_error),
            beside,
        )
        for _, (worst, *_) in known_wheel_use(run)
    ]


def utilisation_drawing(run: SolvedRun) -> dict[str, Callable[[Path], object]]:
    """The map on the blade under the best load."""
    found = known_utilisation(run)
    if not found:
        return {}
    number = run.response.best_curve
    load = run.response.curves[number].load
    field = _on_mesh(run.mesh, found[number].used)
    title = f"utilisation at the resonance under {newtons(load, 4)}"
    drawings: dict[str, Callable[[Path], object]] = {
        "modes/utilisation": lambda file: draw_utilisation(run.mesh, field, title, file)
    }
    for response, (worst, *_) in known_wheel_use(run):
        words = f"utilisation of blade {worst.blade.blade + 1} under {newtons(response.load, 4)}"
        values = _on_mesh(worst.mesh, worst.used.used)
        drawings["wheel/utilisation_of_the_worst_blade"] = partial(
            draw_utilisation, worst.mesh, values, words
        )
    return drawings


def save_fatigue_vtu(run: SolvedRun, file: Path) -> None:
    """Mean and alternating stress and utilisation of each known resonance, for ParaView; of a
    deciding blade of another shape in a file of its own.
    """
    found = known_utilisation(run)
    if not found:
        return
    fields = {"mean stress [Pa]": run.strength.mean}
    for number, used in found.items():
        load = load_of(run.response.curves[number])
        fields[f"alternating stress, {load} [Pa]"] = _on_mesh(run.mesh, used.alternating)
        fields[f"utilisation, {load} [1]"] = _on_mesh(run.mesh, used.used)
    for response, (worst, *_) in known_wheel_use(run):
        mesh, used = worst.mesh, worst.used
        name = f"blade {worst.blade.blade + 1}, {newtons(response.load)}"
        own = {
            f"alternating stress, {name} [Pa]": _on_mesh(mesh, used.alternating),
            f"utilisation, {name} [1]": _on_mesh(mesh, used.used),
        }
        if worst.blade.own_stress is None:
            fields |= own
        else:
            own["mean stress [Pa]"] = _on_mesh(mesh, used.mean)
            save_vtu(mesh, file.with_name(f"{file.stem}_of_the_worst_blade{file.suffix}"), own)
    save_vtu(run.mesh, file, fields)


def _on_mesh(mesh: Mesh, values: np.ndarray) -> np.ndarray:
    """(n_points,) values at the blade's nodes, zero elsewhere."""
    field = np.zeros(len(mesh.points))
    field[blade_nodes(mesh)] = values
    return field

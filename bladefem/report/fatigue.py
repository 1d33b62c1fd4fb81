"""Tables, fields and the picture of what of the material's endurance a run uses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import InputError
from ..study.fatigue import Utilisation, haigh_diagram
from ..study.pipeline.run_records import SolvedRun
from ..study.pipeline.utilisation import blade_nodes, highest_use, lowest_curve, run_utilisation
from ..view.fatigue import draw_utilisation
from ..view.mesh import save_vtu


def known_utilisation(run: SolvedRun) -> dict[int, Utilisation]:
    """By number of the curve; empty where it is not known, which the run's messages say."""
    try:
        return run_utilisation(run)
    except InputError:
        return {}


def utilisation_table(run: SolvedRun) -> dict[str, pd.DataFrame]:
    """The worst places of the blade at each resonance whose whole motion is known; no table
    without a diagram.
    """
    diagram = haigh_diagram(run.scene.fatigue)
    found = known_utilisation(run)
    if diagram is None or not found:
        return {}
    rows = []
    for number, used in found.items():
        bound = highest_use(run, number, used) / max(used.used[used.worst], 1e-300)
        allowed = diagram.allowed(used.mean)
        for rank, node in enumerate(used.worst_places(), 1):
            rows.append(
                {
                    "load": run.response.curves[number].load,
                    "place": rank,
                    **dict(zip("xyz", used.points[node], strict=True)),
                    "mean_stress": used.mean[node],
                    "alternating_stress": used.alternating[node],
                    "allowed_stress": allowed[node],
                    "utilisation": used.used[node],
                    "utilisation_bound": bound * used.used[node],
                }
            )
    return {"modes/fatigue": pd.DataFrame(rows)}


def utilisation_drawing(run: SolvedRun) -> dict[str, Callable[[Path], object]]:
    """The map on the blade under the best load."""
    found = known_utilisation(run)
    if not found:
        return {}
    number = lowest_curve(run)
    load = run.response.curves[number].load
    field = _on_mesh(run, found[number].used)
    return {"modes/utilisation": lambda file: draw_utilisation(run.mesh, field, load, file)}


def save_fatigue_vtu(run: SolvedRun, file: Path) -> None:
    """Mean and alternating stress and utilisation of each known resonance, for ParaView."""
    found = known_utilisation(run)
    if not found:
        return
    fields = {"mean stress [Pa]": run.strength.mean}
    for number, used in found.items():
        load = f"{run.response.curves[number].load:g} N"
        fields[f"alternating stress, {load} [Pa]"] = _on_mesh(run, used.alternating)
        fields[f"utilisation, {load} [1]"] = _on_mesh(run, used.used)
    save_vtu(run.mesh, file, fields)


def _on_mesh(run: SolvedRun, values: np.ndarray) -> np.ndarray:
    """(n_points,) values at the blade's nodes, zero elsewhere."""
    field = np.zeros(len(run.mesh.points))
    field[blade_nodes(run.mesh)] = values
    return field

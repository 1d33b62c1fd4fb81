"""What of the material's endurance a run uses, at the loads whose whole motion is known."""

from __future__ import annotations

import numpy as np

from geometry.mesh import Mesh

from ...errors import InputError
from ...scene.units import newtons
from ...util.message import warning
from ..fatigue import Utilisation, fatigue_utilisation, haigh_diagram
from .run_records import SolvedRun


def run_utilisation(run: SolvedRun) -> dict[int, Utilisation]:
    """Number of a curve to the utilisation at the blade's nodes at its resonance.

    Stresses are those of the balance, in proportion to the amplitude that is given. Empty where the
    scene gives no diagram.

    Raises:
        InputError: the diagram does not reach a mean stress of the blade.
    """
    diagram = haigh_diagram(run.scene.fatigue)
    if diagram is None:
        return {}
    blade = blade_nodes(run.mesh)
    points = run.mesh.points[blade]
    mean = run.strength.mean[blade]
    found = {}
    for number, stress in run.damped.items():
        alternating = run.response.curves[number].over_balance * stress.field[blade]
        found[number] = fatigue_utilisation(diagram, points, alternating, mean)
    return found


def blade_nodes(mesh: Mesh) -> np.ndarray:
    """Numbers of the nodes of all bodies but the damper."""
    cells = [body.ravel() for name, body in mesh.bodies.items() if name != "damper"]
    return np.unique(np.concatenate(cells))


def utilisation_message(run: SolvedRun) -> str:
    """The highest utilisation under the best load, with what its estimate leaves open; empty where
    the scene gives no diagram.
    """
    try:
        found = run_utilisation(run)
    except InputError as error:
        return warning(f"the utilisation is not known: {error}")
    if not found:
        return ""
    number = run.response.best_curve
    used = found[number]
    return (
        f"utilisation at the best load, {newtons(run.response.curves[number].load, 4)}: "
        f"{worst_place(used)}; {highest_use(run, number, used):.3g} "
        "with the upper ends of the error of the mesh and of the loading history"
    )


def worst_place(used: Utilisation) -> str:
    """The highest utilisation, where it is and by which stresses, in words."""
    worst = used.worst
    place = ", ".join(f"{1e3 * x:.1f}" for x in used.points[worst])
    return (
        f"{used.used[worst]:.3g} at ({place}) mm, {1e-6 * used.alternating[worst]:.4g} MPa over a "
        f"mean stress of {1e-6 * used.mean[worst]:.4g} MPa"
    )


def highest_use(run: SolvedRun, number: int, used: Utilisation) -> float:
    """The largest utilisation of the tuned wheel with the estimated error of the mesh and the
    largest amplitude that a loading history can leave.

    Args:
        number: of the curve under the same load.
    """
    return float(used.used[used.worst]) * upper_end(run, number)


def highest_wheel_use(run: SolvedRun, number: int, used: Utilisation, mesh_error: float) -> float:
    """The largest utilisation of a blade of a mistuned wheel, whose stresses are those of a
    balance: as ``highest_use``, with the rise of a march above the tuned balance too.

    Args:
        number: of the tuned wheel's curve under the same load.
        mesh_error: estimated relative error of the stress by the mesh.
    """
    return float(used.used[used.worst]) * upper_wheel_end(run, number, mesh_error)


def upper_end(run: SolvedRun, number: int) -> float:
    """The upper ends of the errors of ``highest_use`` over the utilisation [1]."""
    return _history_share(run, number) * (1 + run.damped[number].mesh_error)


def upper_wheel_end(run: SolvedRun, number: int, mesh_error: float) -> float:
    """The same of ``highest_wheel_use``, with its arguments [1]."""
    march = max(run.response.curves[number].over_balance, 1.0)
    return _history_share(run, number) * march * (1 + mesh_error)


def _history_share(run: SolvedRun, number: int) -> float:
    """Largest amplitude that a loading history can leave over the one given."""
    curve = run.response.curves[number]
    if curve.interval is None:
        return 1.0
    return max(curve.interval.highest / curve.peak_amplitude, 1.0)

"""What of the material's endurance a run uses, at the loads whose whole motion is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.mesh import Mesh

from ...errors import InputError
from ...util.message import warning
from ..fatigue import Utilisation, fatigue_utilisation, haigh_diagram
from .run_records import SolvedRun

if TYPE_CHECKING:
    from ..mistuning.deciding_blades import DecidingBlade


def run_utilisation(run: SolvedRun) -> dict[int, Utilisation]:
    """Number of a curve to the utilisation at the blade's nodes at its resonance.

    Empty where the scene gives no diagram.

    Raises:
        InputError: the diagram does not reach a mean stress of the blade.
    """
    diagram = haigh_diagram(run.scene.fatigue)
    if diagram is None:
        return {}
    blade = blade_nodes(run.mesh)
    points = run.mesh.points[blade]
    mean = run.strength.mean[blade]
    return {
        number: fatigue_utilisation(diagram, points, found.field[blade], mean)
        for number, found in run.damped.items()
    }


@dataclass(frozen=True)
class BladeUse:
    """The utilisation at the nodes of one blade of a mistuned wheel."""

    blade: DecidingBlade
    # its own mesh, where it has another shape
    mesh: Mesh
    used: Utilisation

    @property
    def highest(self) -> float:
        """[1]"""
        return float(self.used.used[self.used.worst])


def wheel_utilisation(run: SolvedRun) -> list[list[BladeUse]]:
    """Of each load of the whole wheel the utilisation of the highest blade of each shape, where
    that moves most; the blade that decides first.

    Empty where all blades are alike or the scene gives no diagram.

    Raises:
        InputError: the diagram does not reach a mean stress of a blade.
    """
    diagram = haigh_diagram(run.scene.fatigue)
    if diagram is None or run.wheel is None:
        return []
    found = []
    for response in run.wheel:
        uses = []
        for one in response.blades:
            own = one.own_stress
            mesh, mean = (run.mesh, run.strength.mean) if own is None else (own.mesh, own.mean)
            nodes = blade_nodes(mesh)
            used = fatigue_utilisation(
                diagram, mesh.points[nodes], one.worst.field[nodes], mean[nodes]
            )
            uses.append(BladeUse(one, mesh, used))
        found.append(sorted(uses, key=lambda use: -use.highest))
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
        f"utilisation at the best load, {run.response.curves[number].load:.4g} N: "
        f"{_worst_place(used)}; {highest_use(run, number, used):.3g} "
        "with the upper ends of the error of the mesh and of the loading history"
    )


def _worst_place(used: Utilisation) -> str:
    worst = used.worst
    place = ", ".join(f"{1e3 * x:.1f}" for x in used.points[worst])
    return (
        f"{used.used[worst]:.3g} at ({place}) mm, {1e-6 * used.alternating[worst]:.4g} MPa over a "
        f"mean stress of {1e-6 * used.mean[worst]:.4g} MPa"
    )


def wheel_utilisation_message(run: SolvedRun) -> str:
    """The highest utilisation of the mistuned wheel next to the tuned one's; empty where it is not
    known.
    """
    try:
        tuned = run_utilisation(run)
    except InputError:
        # the tuned wheel's message says why
        return ""
    try:
        found = wheel_utilisation(run)
    except InputError as error:
        return warning(f"the utilisation of the mistuned wheel is not known: {error}")
    if not found or run.wheel is None:
        return ""
    number = run.response.best_curve
    response, (first, *others) = run.wheel[0], found[0]
    said = (
        f"utilisation of the mistuned wheel under {response.load:.4g} N, blade "
        f"{first.blade.blade + 1}: {_worst_place(first.used)}, against "
        f"{tuned[number].used.max():.3g} of the tuned wheel; "
        f"{highest_use(run, number, first.used, first.blade.worst.mesh_error):.3g} with the upper "
        "ends of the error of the mesh and of the loading history"
    )
    for use in others:
        said += (
            f"; the highest blade of another shape than that, {use.blade.blade + 1}, uses "
            f"{use.highest:.3g} where it moves most, "
            f"{highest_use(run, number, use.used, use.blade.worst.mesh_error):.3g} with these"
        )
    return said


def highest_use(
    run: SolvedRun,
    number: int,
    used: Utilisation,
    mesh_error: float | None = None,
) -> float:
    """The largest utilisation with the estimated error of the mesh and the largest amplitude that
    a loading history can leave, or a march from an unstable motion.

    Args:
        number: of the curve under the same load.
        mesh_error: estimated relative error of the stress by the mesh; that of the tuned wheel at
            the curve's resonance when left out.
    """
    curve = run.response.curves[number]
    # stresses are those of the balance
    share = curve.over_balance
    if curve.interval is not None:
        share = max(curve.interval.highest / curve.balance_amplitude, share)
    if mesh_error is None:
        mesh_error = run.damped[number].mesh_error
    return float(used.used[used.worst] * share * (1 + mesh_error))

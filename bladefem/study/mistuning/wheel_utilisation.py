"""The utilisation of a mistuned wheel: of the highest blade of each shape, and which decides."""

from __future__ import annotations

from dataclasses import dataclass

from geometry.mesh import Mesh

from ...errors import InputError
from ...scene.units import newtons
from ...util.message import warning
from ..fatigue import Utilisation, fatigue_utilisation, haigh_diagram
from ..pipeline.run_records import SolvedRun
from ..pipeline.utilisation import blade_nodes, highest_wheel_use, run_utilisation, worst_place
from .deciding_blades import DecidingBlade


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
    """Utilisation of the highest blade of each shape, where that moves most, load by load of the
    whole wheel; the blade that decides first.

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
    bound = highest_wheel_use(run, number, first.used, first.blade.worst.mesh_error)
    said = (
        f"utilisation of the mistuned wheel under {newtons(response.load, 4)}, blade "
        f"{first.blade.blade + 1}: {worst_place(first.used)}, against "
        f"{tuned[number].used.max():.3g} of the tuned wheel; "
        f"{bound:.3g} with the upper ends of the error of the mesh and of the loading history"
    )
    for use in others:
        said += (
            f"; the highest blade of another shape than that, {use.blade.blade + 1}, uses "
            f"{use.highest:.3g} where it moves most, "
            f"{highest_wheel_use(run, number, use.used, use.blade.worst.mesh_error):.3g} with these"
        )
    return said

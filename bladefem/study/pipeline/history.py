"""Seats of a scene with a loading history: friction takes part while the engine runs up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.mesh import Mesh

from ...contact.admissible_load import holds_itself, normal_load_bounds
from ...contact.condensed_bodies import hold_axially
from ...contact.frictional_seating import (
    FORCE_CHANGE_TOLERANCE,
    FrictionalProblem,
    FrictionalSeating,
    frictional_problem,
    seat_with_friction,
)
from ...contact.interface_elements import interface_law, layer_friction, pair_ratio
from ...contact.patch import rigid_ports
from ...data import Patch
from ...errors import InputError
from ...scene.material_table import operating_materials
from ...scene.tables import Scene
from ...scene.units import newtons
from ...util.percent import percent
from .bodies import Bodies
from .damper_contact import seat_clearance, thermal_gap

FRICTIONLESS = "frictionless"


@dataclass(frozen=True)
class DamperMass:
    """The damper that makes one load of the seats at the operating speed."""

    # mean normal load of a seat [N]
    load: float
    # [kg] after the scene's history, and without friction
    mass: float
    frictionless: float
    # [kg] over all friction forces that equilibrium and Coulomb's limit admit
    lightest: float
    heaviest: float
    # share of the damper's centrifugal load that friction carries
    share: float


def refuse_jamming(
    scene: Scene,
    mesh: Mesh,
    patches: Sequence[Patch],
) -> None:
    """Refuse seats that friction alone can hold a damper between, which only takes the mesh.

    Raises:
        InputError: the seats are steeper than the friction angle, and the scene asks for a history.
    """
    if scene.contact.history == FRICTIONLESS:
        return
    mu = _layer(scene, patches)[1]
    if holds_itself(rigid_ports(patches, mesh, np.zeros(3)), mu):
        raise InputError(
            f"contact.mu = {scene.contact.mu:g}: friction alone holds the damper between its seats "
            "(self-locking), so that contact.history does not tell its load; expected flatter "
            "seats or less friction"
        )


def condense_friction(bodies: Bodies, patches: Sequence[Patch]) -> FrictionalProblem:
    """All ports of the seats, normal and tangential: what takes finite elements.

    Blade and damper are warm before speed presses them together: their thermal strains open or
    close the seats, and leave no tangential traction.
    """
    gap = seat_clearance(bodies, list(patches)) + thermal_gap(bodies, list(patches))
    problem = frictional_problem(
        bodies.mesh, patches, bodies.seated, bodies.damper, gap, bodies.seat_swell
    )
    return hold_axially(problem) if bodies.scene.damper.axial == "held" else problem


def seat_by_history(
    scene: Scene,
    problem: FrictionalProblem,
    normal: float | None,
) -> FrictionalSeating:
    """The seats after the scene's history.

    Args:
        normal: wanted mean normal load of a seat at the operating speed [N]; None: by the damper's
            own mass.
    """
    ratio = pair_ratio(*operating_materials(scene))
    law = interface_law(problem.patches, scene.contact, ratio)
    kt, mu = _layer(scene, problem.patches)
    return seat_with_friction(
        problem, law, kt, mu, _speeds(scene), normal=normal, bedded=scene.contact.bedded
    )


def damper_masses(
    scene: Scene,
    problem: FrictionalProblem,
    seated: dict[float, FrictionalSeating],
) -> list[DamperMass]:
    """The mass that makes each load, with its band."""
    mu = _layer(scene, problem.patches)[1]
    load = scene.operation.speed**2 * problem.load
    low, high = normal_load_bounds(problem.rigid, load, mu)
    plain = _without_friction(problem, load)
    return [
        DamperMass(
            normal,
            found.scale * problem.mass,
            normal / plain * problem.mass,
            normal / high * problem.mass,
            normal / low * problem.mass,
            found.share,
        )
        for normal, found in seated.items()
    ]


def history_sentence(masses: Sequence[DamperMass]) -> str:
    """What friction does to the load of the seats."""
    parts = [
        f"{newtons(one.load, 4)} by {1e3 * one.mass:.3g} g ({1e3 * one.lightest:.3g} to "
        f"{1e3 * one.heaviest:.3g} g over all friction forces that could be left, "
        f"{1e3 * one.frictionless:.3g} g without friction)"
        for one in masses
    ]
    shares = [100 * one.share for one in masses]
    carried = f"{min(shares):.3g}"
    if f"{max(shares):.3g}" != carried:
        carried += f" to {max(shares):.3g}"
    return (
        f"seated with friction, which carries {carried} % of the damper's load: a seat is pressed "
        f"with {', '.join(parts)}"
    )


def coarse_history(seated: dict[float, FrictionalSeating]) -> list[str]:
    """What to say of loads whose friction forces still change with the load steps."""
    return [
        f"seating with friction at {newtons(load, 4)}: the friction forces still change by "
        f"{percent(found.change)} of the largest friction limit between {found.steps // 2} and "
        f"{found.steps} load steps"
        for load, found in seated.items()
        if found.change > FORCE_CHANGE_TOLERANCE
    ]


def _without_friction(problem: FrictionalProblem, load: np.ndarray) -> float:
    """Mean normal load of a seat [N] under a load without friction: the part of the load that
    normal forces can hold decides.
    """
    n = len(problem.clearance)
    normal = problem.rigid.reshape(n, -1, problem.rigid.shape[1])[:, 0]
    force = np.linalg.lstsq(normal.T, -load, rcond=1e-6)[0]
    return float(force.sum()) / len(problem.patches)


def _layer(scene: Scene, patches: Sequence[Patch]) -> tuple[np.ndarray, np.ndarray]:
    ratio = pair_ratio(*operating_materials(scene))
    return layer_friction(patches, scene.contact, ratio)


def _speeds(scene: Scene) -> tuple[float, ...]:
    """The speeds passed, the operating one at last."""
    history = scene.contact.history
    given = () if isinstance(history, str) else history
    if given and given[-1] == scene.operation.speed:
        return given
    return (*given, scene.operation.speed)

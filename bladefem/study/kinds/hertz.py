"""A sphere or a cylinder pressed on a block, from its scene, and Hertz' closed form next to it.

Johnson, Contact Mechanics (1985), Sect. 4.2; P is the whole force, in the plane that on a metre of
cylinder, and a the radius or half width of the contact (contact/hertz.py):

    sphere:     p = p0 sqrt(1 - (r/a)^2),   p0 = 3 P / (2 pi a^2)
    cylinder:   p = p0 sqrt(1 - (x/a)^2),   p0 = 2 P / (pi a)

The two blocks are held at their far faces; they are no half spaces, which moves their approach but
hardly the pressure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.contact_pairs import SEAT_RATIO
from geometry.mesh import Mesh

from ...contact.complementarity import LCPSolution, solve_lcp
from ...contact.hertz import MIN_ELEMENTS_PER_RADIUS, contact_modulus, line_width, point_radius
from ...contact.patch import initial_gap, make_patch, normal_ports, port_matrix
from ...data import PressureMap
from ...errors import InputError, NotSolvedError
from ...scene.limits import unless_at_least, unless_at_most
from ...scene.tables import Scene
from ...scene.units import show, show_least, show_most
from ...util.communicator import Communicator
from ..pipeline.scene_mesh import build_mesh
from .punch import held_port_flexibility

# contact radius over the expected one, at most
MAX_RADIUS_RATIO = 0.9 * SEAT_RATIO


@dataclass(frozen=True)
class Pressed:
    """A quarter (half, in the plane) of the contact under each whole load [N]; the same on every
    rank.
    """

    mesh: Mesh
    maps: dict[float, PressureMap]
    # of the far faces [m]
    approach: dict[float, float]


def press_pair(scene: Scene, comm: Communicator | None = None) -> Pressed:
    """Press the pair of a scene of kind "hertz" with each of its loads.

    Raises:
        InputError: another kind of scene, or a load whose contact does not fit the mesh.
            NotSolvedError: the contact iteration stopped.
    """
    from ...fem.body import assemble

    if scene.kind != "hertz":
        raise InputError(f"kind = '{scene.kind}': expected 'hertz'")
    given = scene.hertz.interference
    loads = check_loads(scene) if given is None else ()
    mesh = build_mesh(scene, comm)
    patch = make_patch(mesh, "this")
    ports = normal_ports([patch], mesh)
    parts = []
    for name, material, held in (
        ("blade", scene.material.blade, "clamp"),
        ("damper", scene.material.damper, "load"),
    ):
        body = assemble(mesh, name, material, comm, plane="strain")
        parts.append(held_port_flexibility(body, port_matrix([patch], mesh, name)[:, ports], held))
    C = parts[0] + parts[1]
    gap = initial_gap(patch, mesh)
    part = 4 if mesh.dimension == 3 else 2
    if given is not None:
        found = solve_lcp(C, gap - given)
        _require_solved(scene, None, found)
        load = part * float(found.force.sum())
        _check_load(scene, load)
        seat = PressureMap(patch, found.force, found.gap, found.residual)
        return Pressed(mesh, {load: seat}, {load: given})
    maps = {}
    approach = {}
    for load in loads:
        found = solve_lcp(C, gap, -np.ones((len(C), 1)), np.array([-load / part]))
        _require_solved(scene, load, found)
        _check_load(scene, load)
        maps[load] = PressureMap(patch, found.force, found.gap, found.residual)
        approach[load] = float(found.rigid[0])
    return Pressed(mesh, maps, approach)


def _require_solved(scene: Scene, load: float | None, found: LCPSolution) -> None:
    if found.reason:
        raise NotSolvedError(f"{_said(scene, load)}: {found.reason}")


def hertz_radius(scene: Scene, load: float) -> float:
    """Contact radius or half width [m] under a whole load [N], in the plane [N/m]."""
    width = point_radius if scene.hertz.dimension == 3 else line_width
    return width(
        load, scene.hertz.radius, contact_modulus(scene.material.blade, scene.material.damper)
    )


def hertz_load(scene: Scene, a: float) -> float:
    """The whole load [N], in the plane [N/m], that gives a contact radius [m]."""
    R = scene.hertz.radius
    E = contact_modulus(scene.material.blade, scene.material.damper)
    return 4 * E * a**3 / (3 * R) if scene.hertz.dimension == 3 else np.pi * E * a**2 / (4 * R)


def hertz_pressure(
    scene: Scene,
    load: float,
    r: np.ndarray,
) -> np.ndarray:
    """Pressure [Pa] at the radii r [m], zero outside of the contact."""
    a = hertz_radius(scene, load)
    peak = 1.5 * load / (np.pi * a**2) if scene.hertz.dimension == 3 else 2 * load / (np.pi * a)
    return peak * np.sqrt(np.clip(1 - (np.asarray(r) / a) ** 2, 0.0, None))


def second_moment_radius(scene: Scene, seat: PressureMap) -> float:
    """Contact radius [m] from the second moment of the pressure: the pressed area itself jumps from
    node to node.
    """
    dimension = scene.hertz.dimension
    r = np.linalg.norm(seat.patch.points[:, : dimension - 1], axis=1)
    return float(np.sqrt((2.5 if dimension == 3 else 4.0) * (seat.force @ r**2) / seat.force.sum()))


def refuse_loads(scene: Scene) -> None:
    """Refuse loads whose contact does not fit the mesh; an interference has none.

    Raises:
        InputError: the load, and those that the mesh is made for.
    """
    if scene.hertz.interference is None:
        check_loads(scene)


def check_loads(scene: Scene) -> tuple[float, ...]:
    """The loads of the study, or the one that gives the expected contact radius.

    Raises:
        InputError: a load whose contact does not fit the mesh.
    """
    loads = scene.study.loads or (hertz_load(scene, scene.hertz.contact_radius),)
    for load in loads:
        _check_load(scene, load)
    return loads


def _check_load(scene: Scene, load: float) -> None:
    """Its contact must fit the mesh."""
    expected = scene.hertz.contact_radius
    fine = scene.mesh.scale * (scene.mesh.contact_size or expected / 10)
    low, high = (
        hertz_load(scene, a) for a in (MIN_ELEMENTS_PER_RADIUS * fine, MAX_RADIUS_RATIO * expected)
    )
    # of larger ones no load would do
    if largest := unless_at_most(fine, MAX_RADIUS_RATIO * expected / MIN_ELEMENTS_PER_RADIUS):
        raise InputError(
            f"hertz.contact_radius = {show(expected, 'm')}: too small for elements of "
            f"{show(fine, 'm')} on the contact, expected {largest}; choose a smaller "
            "mesh.contact_size or mesh.scale"
        )
    if unless_at_least(load, low, "N") or unless_at_most(load, high, "N"):
        raise InputError(
            f"{_said(scene, load)}: the contact radius would be "
            f"{show(hertz_radius(scene, load), 'm')}, hertz.contact_radius and mesh.contact_size "
            f"are made for {show_least(low, 'N')} to {show_most(high, 'N')}"
        )


def _said(scene: Scene, load: float | None) -> str:
    """What was given, and the load that it means."""
    given = scene.hertz.interference
    meant = "" if load is None else show(load, "N")
    if given is None:
        return f"study.loads = {meant}"
    return f"hertz.interference = {show(given, 'm')}" + (f" (a load of {meant})" if meant else "")

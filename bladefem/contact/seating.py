"""Seating a damper: quasi-static, frictionless contact between two platforms and the damper that
floats between them.

The wheel is at rest in the rotating frame and all blades move alike (nodal diameter 0), so the next
blade's seat_left is this blade's seat_left in its own axes. With f >= 0 the pressing forces at the
normal ports of both seats,

    opening = clearance - u_blade + u_damper = g0 + (C_blade + C_damper) f + B q,
    B^T f + load = 0,

where q is the damper's rigid motion, found from equilibrium: no spring holds it. Directions that
frictionless seats can't hold (the engine axis for a wedge, the circumference for a flat damper)
drop out of both. Where opening < 0 the interface layer is closed by c = -opening and carries f(c)
(``interface_law``), so that the complementarity holds between f and

    gap = opening + c(f) >= 0,

whose flexibility is that of the bodies and of the layer in series.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from geometry.mesh import Mesh, spin_axis

from ..data import Patch, PressureMap
from ..errors import InputError, NotSolvedError
from ..fem.body import Body
from ..fem.flexibility import Flexibility
from ..fem.loads import body_mass, centrifugal
from ..scene.units import newtons
from .as_array import as_float_array
from .complementarity import LCPSolution, held_directions, solve_lcp
from .condensed_bodies import (
    CondensedBodies,
    condense_blade,
    condense_body,
    held_motions,
    rigid_and_load,
)
from .interface_law import InterfaceLaw, closure_of, compliance_at, rigid_faces
from .patch import initial_gap, normal_ports, port_matrix

# gaps over elastic displacements beyond which a load is too light to be solved for
MAX_GAP_OVER_DISPLACEMENT = 1e4
# steps of Newton's method on a layer that stiffens, and the relative change of force that ends them
MAX_LAYER_STEPS = 50
LAYER_TOLERANCE = 1e-12
# what rounding may leave of that change where gaps are far wider than displacements
ROUNDED_LAYER_TOLERANCE = 1e-8


@dataclass(frozen=True)
class ContactProblem(CondensedBodies):
    """Two bodies at the normal ports of their patches alone, m = n, and the layer between."""

    # (n,) of the interface layer; rigid faces when None
    layer: InterfaceLaw | None = None

    @property
    def law(self) -> InterfaceLaw:
        """The interface law of all ports."""
        return rigid_faces(len(self.clearance)) if self.layer is None else self.layer


def contact_problem(
    mesh: Mesh,
    patches: Sequence[Patch],
    blade: Flexibility,
    damper: Flexibility | Body,
    clearance: float | np.ndarray = 0.0,
    pull: np.ndarray | None = None,
    swell: np.ndarray | None = None,
) -> ContactProblem:
    """Condense two bodies onto the normal ports of their patches.

    Args:
        blade: the factorised blade or cyclic sector in nodal diameter 0.
        damper: the factorised floating damper, or its Body for a damper that does not deform.
        clearance: gap before seating [m] on top of the one that the mesh has
            (``patch.initial_gap``), one number or (n,) values (means over the ports' weights, see
            ``patch.patch_means``); negative for an interference.
        pull: (n_points*dim,) load on the damper [N] instead of its centrifugal load;
            ``solve_seating`` it with ``normal``.
        swell: (n_points, dim) displacement of the blade for unit rotation [m s^2] instead of the
            linear one.

    Raises:
        InputError: the blade is not in nodal diameter 0, or the clearance does not fit the ports.
    """
    if blade.con.nodal_diameter not in (None, 0):
        raise InputError(
            f"nodal_diameter is {blade.con.nodal_diameter}, expected 0: a static load moves all "
            "alike"
        )
    ports = normal_ports(patches, mesh)
    body = damper if isinstance(damper, Body) else damper.con.body
    pull = centrifugal(body, 1.0, spin_axis(mesh)) if pull is None else pull
    C, blade_swell = condense_blade(blade, port_matrix(patches, mesh)[:, ports], mesh, swell)
    damper_swell = np.zeros(len(ports))
    if not isinstance(damper, Body):
        C_damper, damper_swell = condense_body(
            damper, port_matrix(patches, mesh, "damper")[:, ports], pull
        )
        C = C + C_damper
    rigid, load = rigid_and_load(mesh, patches, body, pull)
    gap = np.concatenate([initial_gap(p, mesh) for p in patches])
    gap = gap + as_float_array("clearance", clearance, gap.shape if np.ndim(clearance) else ())
    return ContactProblem(
        tuple(patches), C, gap, -blade_swell, damper_swell, rigid[ports], load, body_mass(body)
    )


def solve_seating(
    problem: ContactProblem,
    speed: float,
    normal: float | None = None,
    damper_mass: float | None = None,
    start: Sequence[PressureMap] | None = None,
    approach: np.ndarray | None = None,
    bedded: bool = False,
) -> list[PressureMap]:
    """Pressure maps of one load state.

    Args:
        speed: rotational speed [rad/s]; moves the blade, and loads the damper unless `normal` is
            given.
        normal: wanted mean normal load of a seat [N]; the damper's load is scaled to give it.
        damper_mass: mass of the damper [kg] instead of the meshed one.
        start: maps of a neighbouring state, for a warm start.
        approach: (n,) further displacement of the blades at the normal ports, pressing > 0 [m]:
            means over the ports' weights (``patch.patch_means``), as the clearance, not values at
            the nodes.
        bedded: the faces have worn until they fit at this speed: gaps, and displacements by the
            rotation, open nothing.

    Raises:
        InputError: no load at all, a negative one, or one that is not finite; an approach of
            another shape.
        NotSolvedError: the load lifts the damper off, slides it out sideways, or the iteration
            stopped.
    """
    _check_load(speed, normal, damper_mass)
    active = None if start is None else np.concatenate([m.force > 0 for m in start])
    problem = _fitted(problem) if bedded else problem
    moved = (
        0.0 if approach is None else as_float_array("approach", approach, problem.clearance.shape)
    )
    g0 = problem.clearance + speed**2 * problem.blade_swell - moved
    if normal is None:
        scale = speed**2 * (1.0 if damper_mass is None else damper_mass / problem.mass)
        return _maps(problem, _state(problem, g0, scale, active))
    try:
        return _maps(problem, _wanted(problem, g0, normal, active))
    except NotSolvedError as error:
        raise NotSolvedError(f"normal load {newtons(normal)} on each seat: {error}") from error


def _check_load(
    speed: float,
    normal: float | None,
    damper_mass: float | None,
) -> None:
    """A finite load that presses."""
    if not np.isfinite(speed):
        raise InputError(f"speed is {speed} rad/s, expected a finite number")
    if normal is not None and not 0 < normal < np.inf:
        raise InputError(f"normal load is {normal} N, expected a positive, finite one")
    if normal is None and not speed**2 > 0:
        raise InputError(
            f"speed is {speed} rad/s, expected a positive one, or a normal load, to seat the damper"
        )
    if damper_mass is not None and not 0 < damper_mass < np.inf:
        raise InputError(f"damper_mass is {damper_mass} kg, expected a positive, finite one")


def _fitted(problem: ContactProblem) -> ContactProblem:
    """The problem with faces that fit each other whatever the rotation."""
    none = np.zeros_like(problem.clearance)
    return replace(problem, clearance=none, blade_swell=none, damper_swell=none)


def _state(
    problem: ContactProblem,
    g0: np.ndarray,
    scale: float,
    active: np.ndarray | None,
) -> LCPSolution:
    """One contact solve with `scale` times the unit load on the damper."""
    held = held_motions(problem.rigid, problem.load)
    load = held @ (held.T @ problem.load)
    solution = _on_layer(problem, g0 + scale * problem.damper_swell, -scale * load, active)
    if solution.reason:
        raise NotSolvedError(
            f"the damper could not be seated{_too_light(problem, g0, scale, load)}: "
            f"{solution.reason}"
        )
    return solution


def _on_layer(
    problem: ContactProblem,
    g0: np.ndarray,
    load: np.ndarray,
    active: np.ndarray | None,
) -> LCPSolution:
    """The complementarity problem with the layer in series; Newton's method where it stiffens."""
    law = problem.law
    force = np.zeros(len(g0))
    for _ in range(MAX_LAYER_STEPS):
        slope = compliance_at(law, force)
        solution = solve_lcp(
            problem.flexibility + np.diag(slope),
            g0 + closure_of(law, force) - slope * force,
            problem.rigid,
            load,
            active,
        )
        change = np.abs(solution.force - force).max()
        force = solution.force
        active = solution.active
        settled = change <= LAYER_TOLERANCE * np.abs(force).max()
        if solution.reason or settled or not np.isfinite(law.doubling).any():
            return solution
    if change <= ROUNDED_LAYER_TOLERANCE * np.abs(force).max():
        return solution
    return replace(
        solution,
        reason=f"the stiffening interface layer changed by {change:.1e} N in its last step",
    )


def _too_light(
    problem: ContactProblem,
    g0: np.ndarray,
    scale: float,
    load: np.ndarray,
) -> str:
    """Empty, or that the load cannot bring faces together that the damper's travel alone leaves
    apart.
    """
    U, S, held = held_directions(problem.rigid)
    misfit = float(np.ptp(g0 - U @ (U.T @ g0)))
    yielding = problem.flexibility.diagonal() + compliance_at(problem.law, np.zeros(len(g0)))
    bent = float(yielding.max() * np.linalg.norm(scale * (held.T @ load) / S))
    if misfit <= MAX_GAP_OVER_DISPLACEMENT * bent:
        return ""
    return (
        " and rests on single points: the load presses bodies and layer together by some "
        f"{1e6 * bent:.1g} um, while the gaps of the seats differ by {1e6 * misfit:.3g} um, so it "
        "hardly touches; expected a larger study.loads, faces that fit, or contact.bedded = true"
    )


def _wanted(
    problem: ContactProblem,
    g0: np.ndarray,
    normal: float,
    active: np.ndarray | None,
) -> LCPSolution:
    """Scale the damper's load until the mean normal load of a seat is `normal`; one step where
    seats are flat.
    """
    total = normal * len(problem.patches)
    _, _, held = held_directions(problem.rigid)
    guess, _ = nnls((problem.rigid @ held).T, -held.T @ problem.load)
    scale = total / guess.sum() if guess.sum() > 0 else 1.0
    for _ in range(30):
        solution = _state(problem, g0, scale, active)
        error = solution.force.sum() / total - 1
        if abs(error) < 1e-12:
            return solution
        scale = scale / (1 + error)
        active = solution.active
        if abs(error) < 1e-10:
            return _state(problem, g0, scale, active)
    raise NotSolvedError(
        f"no damper load was found that presses with {newtons(normal)} on each seat, "
        f"{error:.1e} is left"
    )


def _maps(problem: ContactProblem, solution: LCPSolution) -> list[PressureMap]:
    """Cut the solution into one map a patch."""
    forces = problem.by_patch(solution.force)
    gaps = problem.by_patch(solution.gap.clip(min=0.0))
    return [
        PressureMap(p, f, g, solution.residual)
        for p, f, g in zip(problem.patches, forces, gaps, strict=True)
    ]

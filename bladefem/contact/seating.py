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
import scipy.sparse as sp
from scipy.optimize import nnls

from geometry.mesh import Mesh

from ..data import Patch, PressureMap
from ..errors import InputError, NotSolvedError
from ..fem.body import Body
from ..fem.constraint import restrict_load
from ..fem.flexibility import Flexibility, compliance
from ..fem.linalg import inner_products
from ..fem.loads import body_mass, centrifugal
from ..scene.units import newtons
from ..util.arrays import RealArray
from .as_array import as_float_array
from .complementarity import LCPSolution, held_directions, solve_lcp
from .interface_law import InterfaceLaw, closure_of, compliance_at, rigid_faces
from .patch import initial_gap, normal_ports, port_matrix, rigid_ports

# gaps over elastic displacements beyond which a load is too light to be solved for
MAX_GAP_OVER_DISPLACEMENT = 1e4
# accepted part of the load along directions that frictionless seats can't hold
UNHELD_LOAD_SHARE = 0.01
# steps of Newton's method on a layer that stiffens, and the relative change of force that ends them
MAX_LAYER_STEPS = 50
LAYER_TOLERANCE = 1e-12
# what rounding may leave of that change where gaps are far wider than displacements
ROUNDED_LAYER_TOLERANCE = 1e-8


@dataclass(frozen=True)
class ContactProblem:
    """All that a new load state needs: dense matrices over the n normal ports of the patches, one
    after the other.

    "For unit rotation" means for a speed of 1 rad/s; multiply by the speed squared.
    """

    patches: tuple[Patch, ...]
    # (n, n) blade and damper, elastic [m/N]
    flexibility: RealArray
    # (n,) gap before anything moves [m]
    clearance: RealArray
    # (n,) gap opened by the blade's centrifugal displacement, for unit rotation [m s^2]
    blade_swell: RealArray
    # (n,) gap opened by the damper's deformation under its load, for unit rotation [m s^2]
    damper_swell: RealArray
    # (n, d) gap opened by unit rigid motions of the damper [1]; rotations times a length
    rigid: RealArray
    # (d,) centrifugal load on the damper along these motions, for unit rotation [N s^2]
    load: RealArray
    # of the damper as meshed [kg]
    mass: float
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


def spin_axis(mesh: Mesh) -> tuple[float, float, float]:
    """The engine axis z; for an endless row of plane blades the y axis, so that the pull is along x
    only.
    """
    endless = mesh.sector is not None and mesh.sector.count == 0
    return (
        (0.0, 1.0, 0.0)
        if endless or (mesh.dimension == 2 and mesh.sector is None)
        else (0.0, 0.0, 1.0)
    )


def counting_sense(mesh: Mesh) -> int:
    """+1 where sectors are counted in the sense of a positive rotation about z, else -1."""
    if mesh.sector is None or not mesh.sector.count:
        return 1
    return 1 if mesh.sector.rotation[1, 0] >= 0 else -1


def _fitted(problem: ContactProblem) -> ContactProblem:
    """The problem with faces that fit each other whatever the rotation."""
    none = np.zeros_like(problem.clearance)
    return replace(problem, clearance=none, blade_swell=none, damper_swell=none)


def condense_blade(
    blade: Flexibility,
    P: sp.spmatrix,
    mesh: Mesh,
    swell: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Flexibility (n, n) of the blade at its ports, and their displacement (n,) for unit rotation.

    Args:
        swell: as in :func:`contact_problem`.
    """
    C, moved = condense_body(blade, P, centrifugal(blade.con.body, 1.0, spin_axis(mesh)))
    return C, moved if swell is None else P.T @ swell.ravel()


def condense_body(
    flex: Flexibility,
    P: sp.spmatrix,
    load: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Flexibility (n, n) at the ports, and their displacement (n,) under a load in mesh
    numbering.
    """
    columns = restrict_load(flex.con, sp.hstack([P, sp.csc_matrix(load[:, None])], format="csc"))
    G = inner_products(flex.con.body.comm, columns[:, :-1], compliance(flex, columns)).real
    return (G[:, :-1] + G[:, :-1].T) / 2, G[:, -1]


def rigid_and_load(
    mesh: Mesh,
    patches: Sequence[Patch],
    body: Body,
    pull: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Rigid motions at all damper ports (ports, d) and the load that goes with them (d,), rotations
    times a length.
    """
    inside = np.unique(np.concatenate([mesh.bodies[name].ravel() for name in body.material]))
    origin = mesh.points[inside].mean(axis=0)
    length = np.linalg.norm(mesh.points[inside] - origin, axis=1).max()
    d = mesh.dimension
    scale = np.r_[np.ones(d), np.full(1 if d == 2 else 3, 1 / length)]
    force = pull.reshape(-1, d)
    arm = mesh.points - origin
    full = np.zeros((len(force), 3))
    full[:, :d] = force
    moment = np.cross(arm, full).sum(axis=0)
    load = np.r_[force.sum(axis=0), moment[2:] if d == 2 else moment]
    return rigid_ports(patches, mesh, origin) * scale, load * scale


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


def held_motions(rigid: np.ndarray, load: np.ndarray) -> np.ndarray:
    """(d, r) motions of the damper that frictionless seats hold, orthonormal.

    Args:
        rigid: (n, d) gap opened by unit rigid motions.
        load: (d,) on the damper along these.

    Raises:
        NotSolvedError: too much of the load is along the other motions.
    """
    _, _, held = held_directions(rigid)
    sideways = np.linalg.norm(load - held @ (held.T @ load)) / np.linalg.norm(load)
    if sideways > UNHELD_LOAD_SHARE:
        raise NotSolvedError(
            f"{sideways:.1%} of the damper's load is along a direction in which frictionless seats "
            f"can't hold it, expected below {UNHELD_LOAD_SHARE:.0%}"
        )
    return held


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
    cuts = np.cumsum([len(p.area) for p in problem.patches])[:-1]
    gaps = np.split(solution.gap.clip(min=0.0), cuts)
    return [
        PressureMap(p, f, g, solution.residual)
        for p, f, g in zip(problem.patches, np.split(solution.force, cuts), gaps, strict=True)
    ]

"""The blade's whole motion at a damped resonance: all modes, damper forces and harmonics.

The balance knows the forces of the contacts and the excitation; with these as loads the finite
elements give the displacement of every node, harmonic by harmonic, and the stress that decides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from geometry.mesh import Mesh, sector_of

from ...contact.joined_points import element_labels, joined_motion
from ...contact.patch import rigid_motions, rigid_ports
from ...data import ModeSet, Patch, RigidBody
from ...friction.fourier import to_complex
from ...hbm.solution import Solution
from ...reduction.assemble import folded_diameter
from ...scene.support import area_springs, held_letters
from ...util.arrays import ComplexArray, RealArray
from .assemble_model import LoadCase
from .bodies import Bodies, is_wheel
from .coriolis import response_damping
from .flow import family_modes, flowing_modes, scene_flow
from .ports import blade_ports

# highest harmonic's frequency over the highest mode's: beyond it the inertia series is too slow
MAX_FREQUENCY_RATIO = 0.8


@dataclass(frozen=True)
class SolvedPoint:
    """A solved point of a response, and what it was solved for."""

    case: LoadCase
    solution: Solution
    # friction elements on each patch that the solution was made with; None for all
    points: int | None = None


@dataclass(frozen=True)
class DampedMotion:
    """Displacements of this blade at one point of a response."""

    # of harmonic 1 [Hz]
    frequency: float
    # (H, n_points, dim) complex displacements of harmonics 1..H [m]; the damper is at rest
    harmonics: ComplexArray
    # (H,) complex, the same at the probe [m]
    probe: ComplexArray
    # |probe of the balance - probe| over the largest amplitude: what the reduction leaves out,
    # and harmonics beyond the modes, whose displacements are left at zero
    mismatch: float


@dataclass(frozen=True)
class DampedStress:
    """The stress at the resonance of one load, of all modes, harmonics and damper forces."""

    # of the curve [N]
    load: float
    # of the damper [kg]; as meshed when None
    mass: float | None
    # largest von Mises stress in a period [Pa]
    largest: float
    # (3,) where [m]
    place: RealArray
    # (H,) of each harmonic alone at that place [Pa]
    by_harmonic: RealArray
    # estimated relative error by the mesh
    mesh_error: float
    # of the motion at the probe against the balance, relative
    mismatch: float
    # (n_points,) largest von Mises stress at each node [Pa], see AlternatingStress.field
    field: RealArray
    # (H, n_points, dim) complex displacements of blade and damper in harmonics 1..H [m], single
    # precision: for pictures
    motion: ComplexArray


def damped_motion(
    bodies: Bodies,
    patches: Sequence[Patch],
    modes: Sequence[ModeSet],
    point: SolvedPoint,
    factorised: Callable[[int], Any] | None = None,
) -> DampedMotion:
    """The field of displacements that belongs to a solved point.

    Args:
        modes: of the nodal diameters that the harmonics excite; a harmonic whose diameter is not
            among them borrows the nearest one, as in the balance.
        factorised: nodal diameter to fem.flexibility.Flexibility, kept from load to load; made anew
            when left out.
    """
    parts = [
        motion_in_diameter(bodies, patches, modes, i, point, factorised) for i in range(len(modes))
    ]
    return sum_of_parts(bodies, patches, point.solution, parts)


@dataclass(frozen=True)
class MotionPart:
    """The harmonics of a motion that are in one nodal diameter."""

    # (k,) indices of the harmonics, 0 for harmonic 1
    harmonics: list[int]
    # (k, n_points, dim) complex displacements [m]
    fields: ComplexArray


def motion_in_diameter(
    bodies: Bodies,
    patches: Sequence[Patch],
    modes: Sequence[ModeSet],
    number: int,
    point: SolvedPoint,
    factorised: Callable[[int], Any] | None = None,
) -> MotionPart:
    """What `damped_motion`, which has the other arguments, needs of one nodal diameter.

    Args:
        number: of the modes of that diameter.
    """
    from ...fem.forced_motion import forced_motion

    scene = bodies.scene
    mesh = bodies.mesh
    ports = blade_ports(mesh, list(patches), scene.excitation)
    solution = point.solution
    loads = blade_loads(bodies, patches, point)
    waves = [_diameter(bodies, h) for h in range(1, solution.harmonics + 1)]
    flow = scene_flow(scene, sector_of(mesh).count if is_wheel(mesh) else 0)
    found = modes[number]
    highest = MAX_FREQUENCY_RATIO * 2 * np.pi * found.frequencies[-1]
    own = [
        h
        for h, (n, _) in enumerate(waves)
        if _nearest(modes, n) is found and (h + 1) * solution.omega < highest
    ]
    fields = np.zeros((len(own), len(mesh.points), mesh.dimension), complex)
    if not own:
        return MotionPart(own, fields)
    damping = response_damping(bodies, modes)[number]
    n = found.nodal_diameter or 0
    family = family_modes(ports, modes, flow).get(n, 0)
    flex = (factorised or bodies.factorised)(n)
    # harmonics of the same nodal diameter together, but for what a flow does to each wave
    every = list(range(len(own)))
    for rows in [every] if flow is None else [[row] for row in every]:
        group = [own[row] for row in rows]
        mirrored = np.array([waves[h][1] for h in group])
        # a wave of diameter -n is the conjugate of one of diameter n at the negative frequency
        omega = (np.array(group) + 1) * solution.omega * np.where(mirrored, -1.0, 1.0)
        seen_loads = np.where(mirrored, loads[group].conj().T, loads[group].T)
        wave = (group[0] + 1) * scene.excitation.engine_order
        part = flowing_modes(flow, found, damping, scene.operation.damping, wave, family)
        u = forced_motion(flex, part[0], seen_loads, omega, part[1]).displacement
        fields[rows] = np.where(mirrored, u.conj(), u).transpose(2, 0, 1)
    return MotionPart(own, fields)


def sum_of_parts(
    bodies: Bodies, patches: Sequence[Patch], solution: Solution, parts: Sequence[MotionPart]
) -> DampedMotion:
    """The motion at a solved point from its parts in all nodal diameters."""
    mesh = bodies.mesh
    ports = blade_ports(mesh, list(patches), bodies.scene.excitation)
    seen = ports.matrix[:, ports.names["probe"]].toarray()[:, 0]
    fields = np.zeros((solution.harmonics, len(mesh.points), mesh.dimension), complex)
    for part in parts:
        fields[part.harmonics] = part.fields
    probe = np.array([seen @ u.reshape(-1) for u in fields])
    known = solution.probe[1:, 0]
    mismatch = float(abs(probe - known).max() / max(abs(known).max(), np.finfo(float).tiny))
    return DampedMotion(solution.frequency, fields, probe, mismatch)


def stress_of_motion(
    bodies: Bodies,
    case: LoadCase,
    motion: DampedMotion,
    shown: ComplexArray | None = None,
) -> DampedStress:
    """The largest alternating stress of a motion of the blade.

    Args:
        shown: the same motion with the damper's nodes, for pictures.
    """
    from ...fem.alternating_stress import alternating_stress

    found = alternating_stress(bodies.still_blade, motion.harmonics, touched_nodes(bodies))
    return DampedStress(
        case.load,
        case.mass,
        found.largest,
        found.place,
        found.by_harmonic,
        found.mesh_error,
        motion.mismatch,
        found.field,
        (motion.harmonics if shown is None else shown).astype(np.complex64),
    )


def damper_motion(
    mesh: Mesh,
    patches: Sequence[Patch],
    point: SolvedPoint,
    damper: RigidBody,
) -> ComplexArray:
    """(H, n_points, dim) complex displacements of the damper's nodes in harmonics 1..H [m]: its
    inertia in balance with the contact forces on it, without its deformation.

    Args:
        damper: on the ports of all contact nodes, see `assemble_model.rigid_body`.
    """
    case, solution = point.case, point.solution
    inside = np.unique(mesh.bodies["damper"])
    origin = mesh.points[inside].mean(axis=0)
    # which rigid motions of the mesh the generalised displacements are
    share = np.linalg.lstsq(rigid_ports(patches, mesh, origin), damper.B, rcond=None)[0]
    unit = rigid_motions(mesh, origin)[inside] @ share
    forces = node_forces(case, patches, solution.f, point.points)
    moved = np.zeros((solution.harmonics, len(mesh.points), mesh.dimension), complex)
    for h in range(1, solution.harmonics + 1):
        on_damper = damper.B.T @ (case.selection @ forces[h].ravel())
        w = h * solution.omega
        impedance = -(w**2) * damper.mass
        if damper.gyroscopic is not None:
            impedance = impedance + 1j * w * damper.gyroscopic
        moved[h - 1, inside] = unit @ np.linalg.solve(impedance, on_damper)
    return moved


def touched_nodes(bodies: Bodies) -> np.ndarray:
    """(n_points,) True where the blade is held, cut, seated or excited: all else is a free face."""
    mesh = bodies.mesh
    support = bodies.scene.support
    names = [
        support.clamp,
        *(face for face, *_ in area_springs(support)),
        *(face for face, _ in held_letters(support)),
        bodies.scene.excitation.at,
        *(name for pair in mesh.pairs.values() for name in (pair.master, pair.slave)),
    ]
    touched = np.zeros(len(mesh.points), bool)
    for name in names:
        if name in mesh.faces:
            touched[np.unique(mesh.faces[name])] = True
        if name in mesh.nodes:
            touched[mesh.nodes[name]] = True
    return touched


def blade_loads(
    bodies: Bodies,
    patches: Sequence[Patch],
    point: SolvedPoint,
) -> np.ndarray:
    """(H, n_points*dim) complex loads on one blade in harmonics 1..H [N]: excitation and contacts.

    The damper on the other side of this blade does what the one on this side does to the next
    blade, an interblade phase earlier.
    """
    scene = bodies.scene
    case, solution = point.case, point.solution
    ports = blade_ports(bodies.mesh, list(patches), scene.excitation)
    contact = ports.matrix[:, ports.names["contact"]]
    excitation = ports.matrix[:, ports.names["load"]].toarray()[:, 0] * scene.excitation.force
    forces = node_forces(case, patches, solution.f, point.points)
    rows = len(forces[0]) if len(forces) else 0
    dim = bodies.mesh.dimension
    following = np.zeros(contact.shape[1], bool)
    following[len(patches[0].area) * dim :] = True
    result = np.zeros((solution.harmonics, contact.shape[0]), complex)
    for h in range(1, solution.harmonics + 1):
        on_ports = case.selection @ forces[h].reshape(rows * forces.shape[2])
        turned = np.where(following, np.exp(-1j * h * _interblade_phase(bodies)), 1.0) * on_ports
        result[h - 1] = -(contact @ turned)
    result[0] += excitation
    return result


def node_forces(
    case: LoadCase,
    patches: Sequence[Patch],
    f: np.ndarray,
    points: int | None,
) -> np.ndarray:
    """(H+1, elements, 1 + tangents) complex forces of the case's own elements [N].

    Args:
        f: (n, d, 2H+1) forces of the balance's elements [N].
        points: friction elements on each patch that they were found with; None for all.
    """
    elements = case.elements
    if len(f) != len(elements.kt):
        groups = element_labels(patches, points)
        pick = joined_motion(patches, groups, elements.kt)
        f = np.einsum("mn,mdk->ndk", pick, f)
    missing = 1 + elements.tangents - f.shape[1]
    f = np.concatenate([np.zeros((len(f), missing, f.shape[2])), f], axis=1)
    n, d, K = f.shape
    return to_complex(f.reshape(n * d, K)).T.reshape(-1, n, d)


def _diameter(bodies: Bodies, harmonic: int) -> tuple[int, bool]:
    """Nodal diameter of a harmonic, and whether the conjugate wave is meant."""
    if not is_wheel(bodies.mesh):
        return 0, False
    order = bodies.scene.excitation.engine_order
    return folded_diameter(harmonic, order, sector_of(bodies.mesh).count)


def _nearest(modes: Sequence[ModeSet], diameter: int) -> ModeSet:
    """The modes of a nodal diameter, or of the nearest one that is there."""
    return min(modes, key=lambda one: abs((one.nodal_diameter or 0) - diameter))


def _interblade_phase(bodies: Bodies) -> float:
    """Phase from blade to blade of harmonic 1 [rad]."""
    if not is_wheel(bodies.mesh):
        return float(bodies.scene.excitation.phase)
    return 2 * pi * bodies.scene.excitation.engine_order / sector_of(bodies.mesh).count

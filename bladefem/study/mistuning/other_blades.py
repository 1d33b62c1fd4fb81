"""Blades of another shape in a wheel: their aerofoil's stiffness and mass minus those of the tuned
one, in the coordinates of the tuned blade-alone modes and of the motions of the root.

Both aerofoils stand on the same root. The other one's modes Phi' at their own frequencies are
written as Phi T by the tuned modes at the same places, so that the coordinates y = T y' of both
mean the same motion. With Psi the aerofoil's static motions by those of its root, L = Phi^T M Psi,

    dK = [T^-T Omega'^2 T^-1 - Omega^2, 0; 0, Psi'^T K' Psi' - Psi^T K Psi],
    dM = [T^-T T^-1 - 1, T^-T L' - L; ., Psi'^T M' Psi' - Psi^T M Psi].

The root moves rigidly and as the wheel's modes bend it: with rigid motions alone the deviation of a
stubby blade is off by half, with eight more by 2 % (`tests/wheel/test_other_blades.py`).
The other aerofoil's frequencies are exact whatever its mesh; what is left out are its families
beyond those kept, and what of its shapes the tuned ones cannot show, which is reported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator, RBFInterpolator

from geometry.mesh import Mesh

from ...data import ModeSet
from ...errors import InputError
from ...scene.tables import Scene
from ...wheel.model import Pattern
from ..modes.comparison import blade_root
from ..pipeline.bodies import Bodies, blade_parts
from ..pipeline.scene_mesh import build_mesh

if TYPE_CHECKING:
    from ...fem.held_part import HeldPart

# faces by which a blade meets the rest of the wheel
COMMON_FACES = ("clamp", "cyclic_low", "cyclic_high", "seat_left", "seat_right")
# relative difference of their areas and places, which curved faces of other meshes have
FACE_TOLERANCE = 0.01
# modal assurance below which a mode is not the tuned one any more
LOWEST_ASSURANCE = 0.7


@dataclass(frozen=True)
class Foot:
    """The root of an aerofoil and p motions of it."""

    # (k,) numbers, and their places (k, 3) [m]
    nodes: np.ndarray
    places: np.ndarray
    # (p, k, 3)
    motions: np.ndarray

    def at(self, places: np.ndarray) -> np.ndarray:
        """(p, m, 3) the same motions at the nodes of another mesh of this root, (m, 3)."""
        values = self.motions.transpose(1, 0, 2).reshape(len(self.places), -1)
        found = RBFInterpolator(self.places, values, kernel="linear", degree=0)(places)
        return found.reshape(len(places), len(self.motions), 3).transpose(1, 0, 2)


@dataclass(frozen=True)
class BladeChange:
    """One other shape: q families, their deviations in q readings and p of the root."""

    # (q + p, q + p), see `wheel.model.Pattern`
    stiffness: np.ndarray
    mass: np.ndarray
    # (q,) relative deviations of the blade-alone frequencies
    frequency: np.ndarray
    # (q,) share of each mode's mass that the tuned modes show [1]
    assurance: np.ndarray


@dataclass(frozen=True)
class OtherBlades:
    """All blades of another shape: number from 0 to what it changes."""

    changes: Mapping[int, BladeChange]

    def added(self, pattern: Pattern, count: int) -> Pattern:
        """A pattern of the q families (N, q, q), also with the root's motions, or a tuned one, with
        these blades' deviations.
        """
        size = len(next(iter(self.changes.values())).stiffness)
        stiffness = np.zeros((count, size, size))
        mass = np.zeros((count, size, size))
        for total, given in ((stiffness, pattern.stiffness), (mass, pattern.mass)):
            if given is not None:
                own = given.shape[1]
                total[:, :own, :own] = given
        for number, change in self.changes.items():
            stiffness[number] += change.stiffness
            mass[number] += change.mass
        return replace(pattern, stiffness=stiffness, mass=mass)

    def shapes(self) -> list[tuple[BladeChange, list[int]]]:
        """Each shape with the numbers of its blades, ascending."""
        found: dict[bytes, tuple[BladeChange, list[int]]] = {}
        for number, change in sorted(self.changes.items()):
            key = change.stiffness.tobytes() + change.mass.tobytes()
            found.setdefault(key, (change, []))[1].append(number)
        return list(found.values())

    def frequencies(self, count: int, families: int) -> np.ndarray:
        """(N, q) relative deviations of the blade-alone frequencies."""
        found = np.zeros((count, families))
        for number, change in self.changes.items():
            found[number] = change.frequency
        return found


def changed_blades(
    scene: Scene,
    mesh: Mesh,
    clamped: ModeSet | None,
    modes: Sequence[ModeSet],
    given: Mapping[int, Scene],
) -> OtherBlades:
    """The deviations of the blades of another shape; on one rank.

    Args:
        clamped: modes of the tuned aerofoil.
        modes: of the tuned wheel, which say how the root moves.
        given: number of a blade from 0 to the scene of its shape.

    Raises:
        InputError: a blade cannot be drawn or does not fit the wheel.
    """
    families = scene.mistuning.families
    foot = foot_of(mesh, modes, families)
    tuned = held_aerofoil(scene, mesh, foot, families, clamped)
    made: dict[int, BladeChange] = {}
    for number, other in given.items():
        if id(other) in made:
            continue
        name = f"mistuning.blades, blade {number + 1}"
        drawn = build_mesh(other)
        check_common_faces(mesh, drawn, name)
        part = held_aerofoil(other, drawn, foot, families)
        made[id(other)] = blade_change(tuned, part, name)
    return OtherBlades({number: made[id(other)] for number, other in given.items()})


def aerofoil_part(scene: Scene, mesh: Mesh) -> tuple[Bodies, np.ndarray]:
    """The aerofoil alone on this rank, and the numbers of its nodes at the root."""
    from ...fem.compat import MPI
    from ...fem.held_part import part_above

    part, root = part_above(mesh, blade_root(mesh))
    return Bodies(scene, part, MPI.COMM_SELF), root


def foot_of(mesh: Mesh, modes: Sequence[ModeSet], families: int) -> Foot:
    """The root of the aerofoil, and how it moves in the wheel's modes of some families."""
    from ...fem.held_part import part_above, section_motions

    _, nodes = part_above(mesh, blade_root(mesh))
    fields = []
    for found in modes:
        count = min(families, len(found.frequencies))
        # by velocity: stiff families bend the root more than they move it
        shapes = found.shapes[:count, nodes] * found.frequencies[:count, None, None]
        fields.extend([shapes.real, shapes.imag])
    return Foot(
        nodes, mesh.points[nodes], section_motions(mesh.points[nodes], np.concatenate(fields))
    )


def held_aerofoil(
    scene: Scene,
    mesh: Mesh,
    foot: Foot,
    families: int,
    known: ModeSet | None = None,
) -> HeldPart:
    """The aerofoil's modes at rest, those known or solved, and its motions by those of the root."""
    from ...fem.body import assemble
    from ...fem.held_part import held_part

    bodies, root = aerofoil_part(scene, mesh)
    named, materials = blade_parts(scene, bodies.mesh)
    heat = bodies.heat(materials.values())
    body = assemble(named, tuple(materials), materials, bodies.comm, heat=heat)
    motions = foot.at(mesh.points[root])
    if known is None:
        return held_part(body, root, motions, families)
    omega = 2 * np.pi * known.frequencies[:families]
    return held_part(body, root, motions, families, known.shapes[:families], omega)


def blade_change(tuned: HeldPart, other: HeldPart, name: str) -> BladeChange:
    """What another aerofoil on the same root changes.

    Args:
        name: of the input, for the message.

    Raises:
        InputError: one of its modes is none of the tuned ones.
    """
    q = len(tuned.omega)
    T, mass = by_tuned_modes(tuned, other)
    assurance = np.einsum("ij,ij->j", T, mass[:q, q:])
    worst = int(np.argmin(assurance))
    if assurance[worst] < LOWEST_ASSURANCE:
        raise InputError(
            f"{name}: mode {worst + 1} of this blade is none of the first {q} of the others "
            f"(assurance {assurance[worst]:.2f}, expected {LOWEST_ASSURANCE} or more); expected a "
            f"smaller change, or mistuning.families other than {q}"
        )
    # modes change places where two families cross
    order = np.argmax(T**2 * np.diag(mass)[:q, None], axis=1)
    back = np.linalg.inv(T)
    size = q + len(tuned.inertia)
    stiffness = np.zeros((size, size))
    stiffness[:q, :q] = back.T @ (other.omega[:, None] ** 2 * back) - np.diag(tuned.omega**2)
    change = np.zeros((size, size))
    change[:q, :q] = back.T @ back - np.eye(q)
    change[:q, q:] = back.T @ other.coupling - tuned.coupling
    change[q:, :q] = change[:q, q:].T
    change[q:, q:] = other.inertia - tuned.inertia
    stiffness[q:, q:] = other.stiffness - tuned.stiffness
    return BladeChange(stiffness, change, other.omega[order] / tuned.omega - 1, assurance)


def by_tuned_modes(tuned: HeldPart, other: HeldPart) -> tuple[np.ndarray, np.ndarray]:
    """(q, q) the other aerofoil's modes by the tuned ones at the same places, and the products
    (2q, 2q) of the tuned and the other modes with the other aerofoil's mass.
    """
    q = len(tuned.omega)
    seen = _at_places(tuned, other.points)
    mass = other.mass_products(np.concatenate([seen, other.shapes]))
    return np.linalg.solve(mass[:q, :q], mass[:q, q:]), mass


def _at_places(tuned: HeldPart, places: np.ndarray) -> np.ndarray:
    """(q, p, 3) tuned modes at places of another aerofoil: linear between nodes, those of the
    nearest one outside; heights count as shares of the span.
    """
    given = _by_span(tuned.points)
    wanted = _by_span(places)
    values = tuned.shapes.transpose(1, 0, 2).reshape(len(given), -1)
    found = LinearNDInterpolator(given, values)(wanted)
    outside = np.isnan(found[:, 0])
    if outside.any():
        found[outside] = NearestNDInterpolator(given, values)(wanted[outside])
    return found.reshape(len(places), len(tuned.shapes), 3).transpose(1, 0, 2)


def _by_span(points: np.ndarray) -> np.ndarray:
    span = np.ptp(points[:, 0])
    return (points - [points[:, 0].min(), 0.0, 0.0]) / span


def check_common_faces(mesh: Mesh, other: Mesh, name: str) -> None:
    """Another blade meets the wheel as the others do.

    Raises:
        InputError: its cut faces, its clamp, its seats or its root are elsewhere.
    """
    for face in COMMON_FACES:
        if face not in mesh.faces:
            continue
        if face not in other.faces:
            raise InputError(f"{name}: the mesh has no face '{face}', expected that of the others")
        area, centre = _size_of_face(mesh, face)
        own, at = _size_of_face(other, face)
        far = float(np.linalg.norm(at - centre))
        if abs(own / area - 1) > FACE_TOLERANCE or far > FACE_TOLERANCE * area**0.5:
            raise InputError(
                f"{name}: face '{face}' of {1e6 * own:.4g} mm^2, {1e3 * far:.3g} mm from that of "
                f"the other blades, which has {1e6 * area:.4g} mm^2, expected the same"
            )
    root, own_root = blade_root(mesh), blade_root(other)
    if abs(own_root - root) > FACE_TOLERANCE * float(np.ptp(mesh.points[:, 0])):
        raise InputError(
            f"{name}: its aerofoil begins at x = {1e3 * own_root:.4g} mm, expected "
            f"{1e3 * root:.4g} mm as of the other blades"
        )


def _size_of_face(mesh: Mesh, face: str) -> tuple[float, np.ndarray]:
    """Area [m^2] and centroid [m] of a face, flat between its corners."""
    corners = 4 if mesh.faces[face].shape[1] in (4, 8, 9) else 3
    x = mesh.points[mesh.faces[face][:, :corners]]
    triangles = [x[:, [0, 1, 2]]] + ([x[:, [0, 2, 3]]] if corners == 4 else [])
    t = np.concatenate(triangles)
    areas = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) / 2
    return float(areas.sum()), (areas[:, None] * t.mean(axis=1)).sum(axis=0) / areas.sum()


def other_blade_sentences(found: OtherBlades) -> Sequence[str]:
    """What a reader has to know, one sentence a shape."""
    said = []
    for change, blades in found.shapes():
        numbers = [number + 1 for number in blades]
        who = f"blade{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"
        shift = ", ".join(f"{100 * x:+.3g} %" for x in change.frequency)
        said.append(
            f"{who} of another shape: blade-alone frequencies {shift} off the others'; "
            f"{max(100 * (1 - change.assurance.min()), 0.0):.2g} % of a mode's mass at most moves "
            "as no tuned mode does; its higher families count as tuned"
        )
    return said

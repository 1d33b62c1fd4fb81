"""Motion of one blade of a mistuned wheel, for its stress: of all modes, nodal diameters, harmonics
and damper forces.

The forces of all contacts, of the excitation and of the deviations act on the tuned wheel, which
falls into nodal diameters: each is one solve with the sector's finite elements, and one blade's
motion is the sum of all waves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from geometry.mesh import sector_of

from ...data import ModeSet, Patch
from ...util.arrays import ComplexArray
from ...wheel.linear_motion import deviation_forces
from ...wheel.model import Pattern, Wheel
from ...wheel.solution import WheelSolution
from ..pipeline.assemble_model import LoadCase
from ..pipeline.bodies import Bodies
from ..pipeline.coriolis import response_damping
from ..pipeline.damped_motion import (
    MAX_FREQUENCY_RATIO,
    DampedMotion,
    node_forces,
)
from ..pipeline.flow import family_modes, flowing_modes, scene_flow
from ..pipeline.normal_modes import MODES_SHOWN, wheel_modes
from ..pipeline.ports import Ports, blade_ports

# name of the modes that bodies keep
SHAPES_KEY = "modes of all nodal diameters"


@dataclass(frozen=True)
class WheelShapes:
    """What the motion of every node of a wheel takes."""

    bodies: Bodies
    patches: list[Patch]
    # of all nodal diameters 0..N/2
    modes: Sequence[ModeSet]
    # (n_points*dim, q) columns of the blade-alone modes' coordinates
    readings: np.ndarray


@dataclass(frozen=True)
class SolvedWheel:
    """A motion of a wheel, and what the motion of its nodes follows from."""

    shapes: WheelShapes
    wheel: Wheel
    # that the solution was made with
    pattern: Pattern
    case: LoadCase
    solution: WheelSolution
    # friction elements on each patch that it was made with; None for all
    points: int | None = None


def all_modes(bodies: Bodies, reduced: int = 0) -> list[ModeSet]:
    """The modes of all nodal diameters, found once.

    Args:
        reduced: modes that a reduction of the wheel will need, solved with them.
    """
    if SHAPES_KEY not in bodies.kept:
        bodies.kept[SHAPES_KEY] = wheel_modes(bodies, MODES_SHOWN, reduced=reduced)
    return bodies.kept[SHAPES_KEY]


def blade_motion(solved: SolvedWheel, blade: int) -> DampedMotion:
    """The displacements of one blade, numbered from 0, of all waves.

    Raises:
        NotSolvedError: the modes do not cover a harmonic.
    """
    shapes, solution = solved.shapes, solved.solution
    ports = wheel_ports(shapes)
    forces = port_forces(solved, ports)
    omega = solution.omega * np.arange(1, forces.shape[1] + 1)
    return seen_motion(ports, wave_fields(shapes, ports, forces, omega, blade), solution, blade)


def wheel_ports(shapes: WheelShapes) -> Ports:
    """The ports of each blade, with "blade"."""
    bodies = shapes.bodies
    return blade_ports(bodies.mesh, shapes.patches, bodies.scene.excitation, shapes.readings)


def wave_fields(
    shapes: WheelShapes,
    ports: Ports,
    forces: np.ndarray,
    omega: np.ndarray,
    blade: int,
) -> ComplexArray:
    """(H, n_points, dim) displacements of one blade [m], the sum of all waves; zero where the modes
    do not reach a frequency.

    Args:
        forces: (N, H, P) complex, on each blade at its ports [N].
        omega: (H,) circular frequency of each [rad/s]; 0 for a steady one.
    """
    from ...fem.forced_motion import forced_motion

    bodies = shapes.bodies
    by_diameter = np.fft.fft(forces, axis=0)
    count, H, _ = forces.shape
    fields = np.zeros((H, len(bodies.mesh.points), bodies.mesh.dimension), complex)
    factorised = lru_cache(maxsize=1)(bodies.factorised)
    dampings = response_damping(bodies, shapes.modes)
    ratio = bodies.scene.operation.damping
    flow = scene_flow(bodies.scene, count)
    numbers = family_modes(ports, shapes.modes, flow)
    for found, damping in zip(shapes.modes, dampings, strict=True):
        n = found.nodal_diameter or 0
        highest = MAX_FREQUENCY_RATIO * 2 * np.pi * found.frequencies[-1]
        harmonics = np.flatnonzero(omega < highest)
        if not len(harmonics):
            continue
        flex = factorised(n)
        # forward and backward waves feel another flow
        for d in sorted({n, -n % count}):
            mirrored = d != n
            loads = by_diameter[d, harmonics].T
            loads = ports.matrix @ (loads.conj() if mirrored else loads)
            # a wave of diameter -n is the conjugate of one of diameter n at the negative frequency
            own = omega[harmonics] * (-1.0 if mirrored else 1.0)
            part = flowing_modes(flow, found, damping, ratio, d, numbers.get(n, 0))
            u = forced_motion(flex, part[0], loads, own, part[1]).displacement
            u = u.conj() if mirrored else u
            turn = np.exp(2j * np.pi * d * blade / count) / count
            fields[harmonics] += turn * u.transpose(2, 0, 1)
    return fields


def seen_motion(
    ports: Ports, fields: ComplexArray, solution: WheelSolution, blade: int
) -> DampedMotion:
    """The fields (H, n_points, dim) of one blade [m] beside the probe of the balance."""
    seen = ports.matrix[:, ports.names["probe"]].toarray()[:, 0]
    probe = fields.reshape(len(fields), -1) @ seen
    known = solution.probe[blade, 1:, 0]
    mismatch = float(abs(probe - known).max() / max(abs(known).max(), np.finfo(float).tiny))
    return DampedMotion(solution.frequency, fields, probe, mismatch)


def port_forces(solved: SolvedWheel, ports: Ports) -> ComplexArray:
    """(N, H, P) forces on each blade at its ports in harmonics 1..H [N].

    Damper s presses blade s with its patch "this" and blade s + 1 with its patch "next".
    """
    shapes, case, solution = solved.shapes, solved.case, solved.solution
    count = sector_of(shapes.bodies.mesh).count
    H = solution.probe.shape[1] - 1
    forces = np.zeros((count, H, ports.matrix.shape[1]), complex)
    dim = shapes.bodies.mesh.dimension
    contact = ports.names["contact"]
    following = np.arange(contact.start, contact.stop)[len(shapes.patches[0].area) * dim :]
    for s in range(count):
        by_harmonic = node_forces(case, shapes.patches, solution.f[s], solved.points)[1:]
        forces[s, :, contact] = -(case.selection @ by_harmonic.reshape(H, -1).T).T
    forces[:, :, following] = np.roll(forces[:, :, following], 1, axis=0)
    for h, amplitudes in solved.wheel.excitation.items():
        if 1 <= h <= H:
            forces[:, h - 1, ports.names["load"]] = amplitudes
    deviating = deviation_forces(solved.wheel, solved.pattern, solution)
    forces[:, :, ports.names["blade"]] = deviating[:, :, 1:].swapaxes(1, 2)
    return forces

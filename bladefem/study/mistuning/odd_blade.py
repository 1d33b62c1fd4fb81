"""From a solved wheel to the stress of a blade of another shape in it."""

from __future__ import annotations

import numpy as np

from ...scene.tables import Scene
from ..modes.linear_response import steady_state
from ..pipeline.damped_motion import DampedMotion
from ..pipeline.run_records import ReducedRun
from ..pipeline.scene_mesh import build_mesh
from .blade_stress import SolvedWheel, port_forces, seen_motion, wave_fields, wheel_ports
from .other_blades import foot_of, held_aerofoil
from .own_stress import KnownMotion, OwnStress, own_stress, steady_root_forces


def odd_blade_stress(
    run: ReducedRun,
    solved: SolvedWheel,
    blade: int,
    scene: Scene,
) -> tuple[DampedMotion, OwnStress]:
    """The motion of a blade of another shape on the mesh of the others, and its stress on its own.

    Args:
        solved: whose readings have the motions of the root after those of the families.
        blade: number of the blade, from 0.
        scene: of that blade.
    """
    shapes, solution = solved.shapes, solved.solution
    families = run.scene.mistuning.families
    foot = foot_of(run.mesh, run.modes, families)
    tuned = held_aerofoil(run.scene, run.mesh, foot, families, run.clamped)
    mesh = build_mesh(scene)
    other = held_aerofoil(scene, mesh, foot, families)
    state = steady_state(shapes.bodies)
    offset = state.displacement
    read = shapes.readings.T @ offset.ravel()
    pull = steady_root_forces(tuned, other, run.scene.operation.speed, read[families:])
    ports = wheel_ports(shapes)
    forces = port_forces(solved, ports)
    # the steady pull as one more column, of no frequency
    steady = np.zeros_like(forces[:, :1])
    root = ports.names["blade"]
    steady[blade, 0, root.start + families : root.stop] = pull
    H = forces.shape[1]
    omega = solution.omega * np.append(np.arange(1, H + 1), 0)
    every = np.concatenate([forces, steady], axis=1)
    fields = wave_fields(shapes, ports, every, omega, blade)
    motion = seen_motion(ports, fields[:H], solution, blade)
    contact = ports.names["contact"]
    known = KnownMotion(
        run.mesh,
        motion,
        forces[blade][:, contact] @ ports.matrix[:, contact].T,
        forces[blade][:, ports.names["load"].start],
        motion.harmonics.reshape(H, -1) @ shapes.readings[:, :families],
        offset + fields[H].real,
        state.large,
    )
    return motion, own_stress(scene, mesh, tuned, other, known)

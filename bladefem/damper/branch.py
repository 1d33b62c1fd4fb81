"""Stability along a path of periodic solutions: the balance follows the path, Floquet multipliers
judge each point.

With prescribed normal loads and damping the periodic motion is unique (friction with a given limit
is monotone in the displacement), and its multipliers stay within the unit circle. Where the normal
load follows the motion and the contact can open, the stuck and the rocking motion coexist between
two folds, with an unstable one between them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bladefem.data import Elements, PortModel
from bladefem.friction.fourier import synthesis, to_complex
from bladefem.hbm.continuation import follow
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.solution import Solution
from bladefem.hbm.solve import solve

from ..time.event_integrator import State
from ..time.shooting import Periodic, floquet_multipliers, periodic_solution, probe_harmonics
from ..time.system import System

# relative distance beyond which shooting has left the solution of the balance
SAME_SOLUTION = 0.02


@dataclass(frozen=True)
class BranchPoint:
    """A point of the path."""

    # [Hz]
    frequency: float
    # of the first harmonic at the probe, by shooting [m]
    amplitude: float
    # the same by the balance of harmonics [m]
    balance: float
    # largest modulus [1]; 1 for a contact that sticks all the time (neutral slider)
    multiplier: float
    # the path turned back before this point
    fold: bool
    # "periodic", or why shooting did not confirm the point
    reason: str


def inclined_contact() -> tuple[ReducedModel, System]:
    """One mass, 100 Hz, 0.5 % damping, on an inclined contact whose normal load follows it and can
    open: 10 N press it, and 2 N excite it.

    Returns:
        The same system for the balance and for integration in time.
    """
    omega = 200 * np.pi
    angle = 1.2
    load = 10.0
    force = 2.0
    kn = 8e5
    kt = 1e5
    shapes = np.array([[np.sin(angle)], [np.cos(angle)], [1.0], [1.0]])
    body = PortModel(
        np.array([omega]),
        shapes,
        np.zeros((4, 4)),
        {"contact": slice(0, 2), "load": slice(2, 3), "probe": slice(3, 4)},
    )
    elements = Elements(np.array([kt]), np.array([kn]), np.array([0.3]), np.array([load]), 1)
    model = ReducedModel((body,), elements, {1: np.array([force], complex)}, Damping(ratio=0.005))
    R = shapes[:1]
    system = System(
        np.array([omega**2]),
        np.array([[0.01 * omega]]),
        shapes[1:2],
        elements.kt,
        elements.mu,
        np.array([[0.0, force, 0.0]]),
        np.zeros((1, 3)),
        np.array([[load, 0.0, 0.0]]),
        kn * R,
        np.ones((1, 1)),
        R,
    )
    return model, system


def branch(
    model: ReducedModel,
    system: System,
    band: tuple[float, float],
    H: int = 15,
    samples: int = 512,
) -> Iterator[BranchPoint]:
    """The path in frequency that starts at the upper end of a band [Hz] and runs down, round its
    folds.

    Raises:
        NotSolvedError: the path could not be followed to an end of the band.
    """
    low, high = (2 * np.pi * f for f in band)
    start = solve(model, high, H, samples)
    for point in follow(model, "omega", start, (low, high), forward=False, steps=(0.005, 0.02)):
        shot = periodic_solution(system, point.solution.omega, state_of(point.solution, system))
        amplitude = float(abs(probe_harmonics(shot, system, 1)[0, 1]))
        wanted = float(abs(point.solution.probe[1, 0]))
        yield BranchPoint(
            point.solution.frequency,
            amplitude,
            wanted,
            float(np.abs(floquet_multipliers(shot)[0])),
            point.fold,
            _stability_verdict(shot, amplitude, wanted),
        )


def _stability_verdict(
    shot: Periodic,
    amplitude: float,
    wanted: float,
) -> str:
    if shot.converged and abs(amplitude / wanted - 1) > SAME_SOLUTION:
        return "shooting went to another solution"
    return shot.reason


def state_of(solution: Solution, system: System) -> State:
    """State at t = 0 of a solution of the balance.

    Args:
        system: the solution's model in time, without residual flexibility
            (`bladefem.hbm.time_model.time_system`).
    """
    omega = solution.omega
    orders = np.arange(solution.harmonics + 1)
    f = to_complex(solution.f.reshape(-1, solution.f.shape[2])).reshape(*solution.f.shape[:2], -1)
    load = -system.W.T @ f[:, -1]
    inputs = to_complex(system.force)
    load[:, : inputs.shape[1]] += inputs[:, : len(orders)]
    if solution.f.shape[1] == 2:
        normal = f[:, 0].copy()
        normal[:, 0] -= system.normal[:, 0]
        load -= system.R.T @ normal
    q = np.zeros_like(load)
    for h in orders[1:]:
        q[:, h] = np.linalg.solve(
            np.diag(system.stiffness - (h * omega) ** 2) + 1j * h * omega * system.damping,
            load[:, h],
        )
    held = system.stiffness > 0
    q[held, 0] = load[held, 0] / system.stiffness[held]
    readings = np.concatenate([system.R, system.W][-solution.w.shape[1] :])
    rest = np.concatenate(solution.w[:, :, 0].T) - (readings[:, held] @ q[held, 0]).real
    # rigid motions close the mean
    q[~held, 0] = np.linalg.lstsq(readings[:, ~held], rest, rcond=None)[0]
    first = synthesis(solution.harmonics, solution.samples)[0]
    slider = solution.w[:, -1] @ first - solution.f[:, -1] @ first / system.kt
    return State(q.sum(axis=1).real, (q @ (1j * orders * omega)).real, slider)

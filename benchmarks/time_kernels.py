"""What marches and verdicts gain by their fast paths, as ratios of CPU time in one run.

    python benchmarks/time_kernels.py

A ring of four blades in a wave, whose modes and contacts are as many as those of the shipped wedge:
the map of disturbances in single precision against double, and the readings of the contacts by
groups of modes that turn alike against the matrix of all blades and modes by BLAS. Alternating, the
best of REPEATS, so that other work on the machine counts little.

Recorded in four runs beside other work: maps 0.71 to 0.75 of the time, multipliers 4e-6 off;
readings and forces in modes 0.86 to 0.94 with 8 contact points a blade, 0.52 to 0.58 with 16, 0.32
to 0.42 with 64. Maps of the shipped wedge, whose normal springs join the bodies: 0.55 to 0.63.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numba import njit

from bladefem.data import Elements
from bladefem.hbm.flow_map import flow_map
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.ring_contacts import in_places, places_of_directions
from bladefem.hbm.ring_readings import push, read, reading_room, ring_readings
from bladefem.hbm.sector_modes import sector_modes
from bladefem.hbm.solution import Solution
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import linearised_contacts
from bladefem.reduction.matrices import port_model_from_matrices

BLADES = 4
MODES = 26
NODES = (8, 16, 64)
INSTANTS = 256
REPEATS = 12
CALLS = 2000


def ring_model(nodes: int) -> ReducedModel:
    """A body of MODES modes on contacts that slip and lift off, in a wave of BLADES blades."""
    rng = np.random.default_rng(0)
    dofs = 3 * nodes + 2
    root = rng.standard_normal((dofs, dofs)) / np.sqrt(dofs)
    K = root @ root.T + 2 * np.eye(dofs)
    ports = {"contact": np.arange(dofs - 2), "load": [dofs - 2], "probe": [dofs - 1]}
    body = port_model_from_matrices(np.eye(dofs), K, ports, C=0.02 * K, count=min(MODES, dofs))
    turns = np.exp(2j * np.pi / BLADES * np.arange(2 * BLADES + 1))
    own = np.arange(len(body.omega)) % 2 == 0
    sides = tuple(replace(body, shapes=body.shapes * np.where(own, t, 1.0)) for t in turns)
    values = ((1.0, 0.8), (2.0, 1.6), (0.4, 0.3), (0.15, 0.3))
    contact = Elements(*(np.linspace(*ends, nodes) for ends in values), tangents=2)
    return ReducedModel(sides, contact, {1: np.array([3.0])})


def seconds_of_each(*actions: Callable[[], object]) -> list[float]:
    """Least CPU time of each action, taken in turn; the first calls compile."""
    for action in actions:
        action()
    best = [np.inf] * len(actions)
    for _ in range(REPEATS):
        for k, action in enumerate(actions):
            begun = time.process_time()
            action()
            best[k] = min(best[k], time.process_time() - begun)
    return best


def print_maps(model: ReducedModel, point: Solution) -> None:
    """Single precision over double."""
    system = sector_modes(model)
    contacts, nodes = linearised_contacts(model, point, system, INSTANTS)
    dt = 2 * np.pi / point.omega / INSTANTS
    carried = partial(flow_map, contacts, nodes, dt, INSTANTS // BLADES)
    double, single = seconds_of_each(carried, partial(carried, single=True))
    largest = [abs(np.linalg.eigvals(carried(single=one))).max() for one in (False, True)]
    print(
        f"map of {len(contacts.stiffness)} modes, {contacts.push.shape[1]} forces: single over "
        f"double {single / double:.2f}, multiplier off by {abs(largest[1] / largest[0] - 1):.1e}"
    )


@njit
def grouped(readings, q, forces, moved, modal, room):
    """Displacements and modal forces, CALLS times."""
    total = 0.0
    for _ in range(CALLS):
        read(readings, q, moved, room)
        push(readings, forces, modal, room)
        total += moved[0, 0] + modal[0]
    return total


@njit
def by_matrix(matrix, transposed, q, forces):
    """The same by the matrix of all blades and its transpose."""
    total = 0.0
    for _ in range(CALLS):
        total += np.dot(matrix, q)[0] + np.dot(transposed, forces)[0]
    return total


def print_readings(model: ReducedModel, nodes: int) -> None:
    """Groups of modes over BLAS."""
    system = sector_modes(model)
    places = places_of_directions(nodes, 3)
    readings = ring_readings(system, places)
    moved, modal = np.empty((system.blades, len(places))), np.empty(len(system.stiffness))
    room = reading_room(readings)
    rng = np.random.default_rng(1)
    q = rng.standard_normal(len(system.stiffness))
    forces = rng.standard_normal((BLADES, 3 * nodes))
    matrix = np.ascontiguousarray(system.contact)
    plain, fast = seconds_of_each(
        partial(by_matrix, matrix, matrix.T.copy(), q, forces.ravel()),
        partial(grouped, readings, q, in_places(forces, places), moved, modal, room),
    )
    print(f"readings, {nodes} nodes a blade: groups of modes over BLAS {fast / plain:.2f}")


def main() -> None:
    """Print the ratios."""
    model = ring_model(NODES[0])
    print_maps(model, solve(model, 1.3, 7, 256))
    for nodes in NODES:
        print_readings(ring_model(nodes), nodes)


if __name__ == "__main__":
    main()

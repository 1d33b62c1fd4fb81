"""Displacements in contact of all blades from the modes of their ring, and forces in these modes.

What a blade sees of a motion is what the first one sees of it handed back so many blades, which
turns the two modes of a pair into each other by the angle of their nodal diameter. Modes that turn
alike are read together, once, and handed to all blades after that: of r blades with as many modes
each that takes at most 2 / r of the operations of a product with the readings of all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..util.numba_options import INNER_KERNEL, KERNEL
from .linear.array_copy import clear_vector
from .ring_contacts import in_places
from .sector_modes import SectorModes

# entries of a hand-over that are no more than rounding
ROUNDING = 1e-9


class RingReadings(NamedTuple):
    """Of the k displacements of each of r blades in M modes, which are sorted by how they turn into
    G groups.
    """

    # (M, k) displacements of the first blade by each mode [kg^-1/2]
    by_mode: np.ndarray
    # (G + 1,) place of the first mode of each group
    starts: np.ndarray
    # (2, M) number of the mode in each place, and of the other one of its pair
    modes: np.ndarray
    # (2, G, r): a blade sees of the modes of a group as much of their own coordinates, and of those
    # of the others of their pairs
    turns: np.ndarray
    # (G,) 2, or 1 where modes have no pair
    parts: np.ndarray


def ring_readings(system: SectorModes, places: np.ndarray) -> RingReadings:
    """Of the contact displacements of a blade in these places of a row; -1: none."""
    r, M = system.blades, len(system.stiffness)
    own = np.arange(M)
    apart = abs(system.turn - np.diag(np.diag(system.turn)))
    paired = apart.max(axis=1) > ROUNDING
    partner = np.where(paired, apart.argmax(axis=1), own)
    back = np.array([np.linalg.matrix_power(system.turn.T, b) for b in range(r)])
    along, across = back[:, own, own], np.where(paired, back[:, own, partner], 0.0)
    alike = np.round(np.concatenate([along, across]) / ROUNDING)
    _, first, group = np.unique(alike, axis=1, return_index=True, return_inverse=True)
    order = np.argsort(group, kind="stable")
    by_mode = in_places(system.contact[: len(system.contact) // r].T, places)[order]
    return RingReadings(
        by_mode,
        np.searchsorted(group[order], np.arange(len(first) + 1)),
        np.array([order, partner[order]]),
        np.array([along.T[first], across.T[first]]),
        1 + paired[first].astype(int),
    )


class ReadingRoom(NamedTuple):
    """Where sums of a reading are kept on their way."""

    # (M,) of modes, (k,) of displacements or forces of a blade
    modes: np.ndarray
    blade: np.ndarray


def reading_room(readings: RingReadings) -> ReadingRoom:
    """For `read` and `push`."""
    M, size = readings.by_mode.shape
    return ReadingRoom(np.empty(M), np.empty(size))


def displacements(readings: RingReadings, q: np.ndarray) -> np.ndarray:
    """(r, k) displacements of modal coordinates q (M,)."""
    moved = np.empty((readings.turns.shape[2], readings.by_mode.shape[1]))
    read(readings, q, moved, reading_room(readings))
    return moved


def modal_forces(readings: RingReadings, forces: np.ndarray) -> np.ndarray:
    """(M,) forces in the modes of forces (r, k) on the blades."""
    total = np.empty(len(readings.by_mode))
    push(readings, forces, total, reading_room(readings))
    return total


@njit(_nrt=False, **KERNEL)
def read(readings, q, moved, room):
    """moved (r, k) becomes the displacements of modal coordinates q (M,)."""
    blades = len(moved)
    sorted_q, seen = room.modes, room.blade
    for b in range(blades):
        clear_vector(moved[b])
    for group in range(len(readings.parts)):
        first, last = readings.starts[group], readings.starts[group + 1]
        for part in range(readings.parts[group]):
            for i in range(first, last):
                sorted_q[i] = q[readings.modes[part, i]]
            clear_vector(seen)
            _add_product(sorted_q[first:last], readings.by_mode[first:last], seen)
            for b in range(blades):
                _add_multiple(readings.turns[part, group, b], seen, moved[b])


@njit(_nrt=False, **KERNEL)
def push(readings, forces, total, room):
    """total (M,) becomes the forces in the modes of forces (r, k) on the blades."""
    seen, joined = room.modes, room.blade
    clear_vector(total)
    for group in range(len(readings.parts)):
        first, last = readings.starts[group], readings.starts[group + 1]
        for part in range(readings.parts[group]):
            clear_vector(joined)
            for b in range(len(forces)):
                _add_multiple(readings.turns[part, group, b], forces[b], joined)
            _product(readings.by_mode[first:last], joined, seen[first:last])
            for i in range(first, last):
                total[readings.modes[part, i]] += seen[i]


@njit(_nrt=False, **INNER_KERNEL)
def _add_multiple(factor, values, target):
    """target (k,) becomes target + factor * values (k,)."""
    if factor != 0.0:
        for k in range(len(target)):
            target[k] += factor * values[k]


# BLAS takes longer for matrices this small, see `benchmarks/time_kernels.py`. Sums may be taken in
# another order and in one instruction with a product, so that they are vectorised.


@njit(fastmath={"contract"}, _nrt=False, **INNER_KERNEL)
def _add_product(x, matrix, target):
    """target (k,) becomes target plus x (n,) times the matrix (n, k), four of its rows at a time:
    the target is read and written once for all of them.
    """
    together = len(x) // 4 * 4
    for i in range(0, together, 4):
        a, b, c, d = x[i], x[i + 1], x[i + 2], x[i + 3]
        for k in range(len(target)):
            target[k] += (
                a * matrix[i, k]
                + b * matrix[i + 1, k]
                + c * matrix[i + 2, k]
                + d * matrix[i + 3, k]
            )
    for i in range(together, len(x)):
        for k in range(len(target)):
            target[k] += x[i] * matrix[i, k]


@njit(fastmath={"contract", "reassoc"}, _nrt=False, **INNER_KERNEL)
def _product(matrix, x, target):
    """target (n,) becomes the matrix (n, k) times x (k,), four of its rows at a time."""
    together = len(target) // 4 * 4
    for i in range(0, together, 4):
        a = b = c = d = 0.0
        for k in range(len(x)):
            a += matrix[i, k] * x[k]
            b += matrix[i + 1, k] * x[k]
            c += matrix[i + 2, k] * x[k]
            d += matrix[i + 3, k] * x[k]
        target[i], target[i + 1], target[i + 2], target[i + 3] = a, b, c, d
    for i in range(together, len(target)):
        total = 0.0
        for k in range(len(x)):
            total += matrix[i, k] * x[k]
        target[i] = total

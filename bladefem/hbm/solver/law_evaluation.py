"""Forces of Coulomb elements with one or two tangents, their derivative, and the residual of the
balance, for compiled loops.

Which of both laws is compiled into a loop follows from the type of the patterns: None with one
tangent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import overload

from ...friction.kernel_1d import jenkins_batch
from ...friction.kernel_1d_exact import exact_batch
from ...friction.simd.kernel_2d import disc_batch
from .balance_residual import balance_residual

# marched until the force of an element is periodic, at most; no Python number, for whose value
# kernels would be compiled once more
PERIODS = np.int64(4000)


class Room(NamedTuple):
    """Of one evaluation at n nodes with a directions of motion, m of their degrees of freedom in
    the balance.
    """

    # (n, a, K) motion of all directions, forces, (n, a, K, a, K) their derivative
    full: np.ndarray
    F: np.ndarray
    J: np.ndarray
    # (n, 3) shares of the period in stick, slip and separation, (n,) periods marched, below zero
    # where the force was not periodic
    shares: np.ndarray
    cycles: np.ndarray
    # (m, K) forces beyond preload and springs, residual
    p: np.ndarray
    residual: np.ndarray


@njit(cache=True, error_model="numpy", inline="always")
def empty_room(m, d, K, patterns):
    """A new `Room`."""
    n = m // d
    a = 2 if patterns is None else 3
    return Room(
        np.zeros((n, a, K)),
        np.zeros((n, a, K)),
        np.zeros((n, a, K, a, K)),
        np.zeros((n, 3)),
        np.zeros(n, np.int64),
        np.zeros((m, K)),
        np.zeros((m, K)),
    )


@njit(cache=True, error_model="numpy", inline="always")
def evaluate(w, d, linear, contact, patterns, room):
    """Fill the room at displacements w (m, K), of which d a node are in the balance; returns the
    error as `balance_residual` does.
    """
    preload, offset = contact[5:]
    a = room.full.shape[1]
    for i in range(w.shape[0]):
        for k in range(w.shape[1]):
            room.full[i // d, a - d + i % d, k] = w[i, k]
        room.full[i // d, a - d + i % d, 0] += offset[i]
    _law_forces(contact, patterns, room)
    return balance_residual(w, linear, preload, room.F, room.p, room.residual)


def _law_forces(contact, patterns, room):
    """Fill forces, their derivative, shares and periods of a room from its motion."""
    raise NotImplementedError("for compiled loops only")


# only the law of the type is compiled, where a branch would compile both
@overload(_law_forces, jit_options={"cache": True, "error_model": "numpy"})
def _choose_law(contact, patterns, room):
    return _forces_1d if isinstance(patterns, types.NoneType) else _forces_2d


def _forces_1d(contact, patterns, room):
    load, base, nodes, tab, brackets, _, _ = contact
    if brackets:
        room.F[:] = 0.0
        room.J[:] = 0.0
        exact_batch(room.full, base, nodes, brackets, room.F, room.J, room.shares, room.cycles)
    else:
        jenkins_batch(room.full, load, nodes, tab, room.F, room.J, room.shares)


def _forces_2d(contact, patterns, room):
    load, _, nodes, tab, _, _, _ = contact
    n, a, K = room.full.shape
    disc_batch(
        room.full,
        np.zeros((n, 2)),
        load,
        nodes,
        tab,
        patterns,
        PERIODS,
        room.F,
        room.J.reshape((n, a, K, a * K)),
        room.shares,
        room.cycles,
    )

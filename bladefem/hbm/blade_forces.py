"""Contact forces at the end of a step in time, blade by blade: all nodes of a blade at once.

Nodes of a stiff layer push each other to and fro, those of different blades hardly: on the shipped
wedge with 1e4 N/mm^3 sweeps over the nodes gain a fifth each time, sweeps over the blades a factor
of fifty. A Newton step of a blade takes the LU factors of 1 + B F, B the derivatives of the law at
its nodes and F its own flexibility; factors are kept from step to step for as long as they take
most of the violation away, and steps with new ones are shortened until they take their share of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..friction.simd.codegen import LANES_PER_VECTOR
from ..friction.simd.node_steps import node_steps
from ..util.numba_options import INNER_KERNEL
from .linear.array_copy import clear_vector, copy_matrix, copy_vector
from .ring_contacts import (
    NODE_OPERATIONS,
    displace,
    of_blade,
    subtract_moved,
    violation,
)
from .solver.dense_lu import back_substitute, factorise_small

# most sweeps over the blades in a step, and new factors of a blade
BLADE_SWEEPS = 30
RENEWALS = 6
# most steps that are taken blade by blade before one node by node is tried again
MOST_STEPS = 256
# share of the violation that a step with kept factors has to take away, else they are renewed; that
# a whole step with new ones has to take away, and shares of it that are tried, each half of the one
# before
KEPT_FALL = 0.8
FALL = 0.5
HALVINGS = 5
# share of the limit within which changes by kept factors count as none
OF_KEPT = 0.05
# operations of the law and its derivatives at a node, by numbers alone
VIOLATION_OPERATIONS = 500.0


class _BladeRoom(NamedTuple):
    """What the steps of a blade fill anew, kept so that none makes arrays."""

    # (3 width,) violations, those after a trial, a Newton step and what it moves
    gap: np.ndarray
    left: np.ndarray
    step: np.ndarray
    moved: np.ndarray
    # (3 width,) displacements and (3, width) forces of a trial, and those that the law wants
    displacements: np.ndarray
    forces: np.ndarray
    wanted: np.ndarray
    # (9, width) flexibilities of nodes that nothing moves, (3, LANES_PER_VECTOR) their steps
    rigid: np.ndarray
    block: np.ndarray


class BladeFactors(NamedTuple):
    """What is kept from step to step of a march."""

    # (r, 3 width, 3 width) LU factors of 1 + B F, and (r, 3 width) rows exchanged for them: -1
    # where there are none yet
    factors: np.ndarray
    pivots: np.ndarray
    # (r,) times that factors were renewed in the present step
    renewals: np.ndarray
    # (2,) steps that are still taken blade by blade before one node by node is tried again, and how
    # many it will be the next time that such a step is not found
    steps: np.ndarray
    room: _BladeRoom


def no_factors(blades: int, size: int) -> BladeFactors:
    """At the beginning of a march of r blades with 3 width = size forces each."""
    width = size // 3
    return BladeFactors(
        factors=np.zeros((blades, size, size)),
        pivots=np.full((blades, size), -1),
        renewals=np.zeros(blades, dtype=int),
        steps=np.array([0, 1]),
        room=_BladeRoom(
            gap=np.zeros(size),
            left=np.zeros(size),
            step=np.zeros(size),
            moved=np.zeros(size),
            displacements=np.zeros(size),
            forces=np.zeros((3, width)),
            wanted=np.zeros((3, width)),
            rigid=np.zeros((9, width)),
            block=np.zeros((3, LANES_PER_VECTOR)),
        ),
    )


@njit(_nrt=False, **INNER_KERNEL)
def note_step(kept, found):
    """A step was tried node by node: the next ones are taken blade by blade where it was not found,
    each time twice as many, and half as many where it was.
    """
    if found:
        kept.steps[1] = max(kept.steps[1] // 2, 1)
    else:
        kept.steps[0] = kept.steps[1]
        kept.steps[1] = min(2 * kept.steps[1], MOST_STEPS)


@njit(_nrt=False, **INNER_KERNEL)
def by_blades(c, contacts, kept, w, f, before, load1, limit, work):
    """Sweeps over the blades until no force changes by more than a limit; False where they do not
    settle. Arguments as those of `bladefem.hbm.step_forces.contact_forces`.
    """
    blades, _, width = f.shape
    m = 3 * width
    room = kept.room
    forces = room.step.reshape(3, width)
    displace(c, contacts, f, w, work)
    clear_vector(kept.renewals)
    last = 0.0
    for _ in range(BLADE_SWEEPS):
        largest = 0.0
        by_kept = bool(0)
        for b in range(blades):
            start = of_blade(before, b)
            blade = contacts.table[b], start, load1[b], w[b], f[b]
            size = _violations(*blade, room, room.gap)
            work[0] += 2.0 * m**2 + NODE_OPERATIONS * width
            if size <= limit:
                continue
            share = 0.0
            if kept.pivots[b, 0] >= 0:
                share = _shortened(*blade, contacts.flexibility, kept, b, KEPT_FALL, 1)
            if share == 0.0 and kept.renewals[b] < RENEWALS:
                kept.renewals[b] += 1
                work[0] += 0.7 * m**3 + VIOLATION_OPERATIONS * width
                if not _renew(*blade, contacts.flexibility, kept.factors[b], kept.pivots[b]):
                    return False
                share = _shortened(*blade, contacts.flexibility, kept, b, FALL, HALVINGS)
            if share == 0.0:
                # a kink may have to be passed before it gets better
                share = 1.0
            by_kept = by_kept or kept.renewals[b] == 0
            for a in range(3):
                for i in range(width):
                    largest = max(largest, abs(forces[a, i]))
                    forces[a, i] *= share
                    f[b, a, i] += forces[a, i]
            for first in range(0, width, LANES_PER_VECTOR):
                subtract_moved(contacts.columns, b, first, forces, first, w, work)
        ahead = largest * min(largest / last, 1.0) if last > 0.0 else largest
        if ahead <= (OF_KEPT * limit if by_kept else limit):
            return True
        if not np.isfinite(largest):
            return False
        last = largest
    return False


@njit(_nrt=False, **INNER_KERNEL)
def _shortened(table, start, load1, w, f, flexibility, kept, b, fall, tries):
    """The largest share of a Newton step of blade b in so many halvings that takes away as large a
    share of FALL of its violation; 0.0 where none does. The step is in ``kept.room``.
    """
    room = kept.room
    width = f.shape[1]
    copy_vector(room.gap, room.step)
    back_substitute(kept.factors[b], kept.pivots[b], room.step)
    _multiply(flexibility, room.step, room.moved)
    size = _size(room.gap)
    share = 1.0
    for _ in range(tries):
        for k in range(3 * width):
            room.displacements[k] = w[k] - share * room.moved[k]
            room.forces[k // width, k % width] = f[k // width, k % width] + share * room.step[k]
        found = _violations(table, start, load1, room.displacements, room.forces, room, room.left)
        if found <= (1.0 - fall * share) * size:
            return share
        share /= 2.0
    return 0.0


# the order of the sums is free, so that they are vectorised
@njit(_nrt=False, fastmath={"reassoc", "contract"}, **INNER_KERNEL)
def _multiply(matrix, x, target):
    """target (n,) becomes the matrix (n, k) times x (k,)."""
    for i in range(len(target)):
        total = 0.0
        for k in range(len(x)):
            total += matrix[i, k] * x[k]
        target[i] = total


@njit(_nrt=False, **INNER_KERNEL)
def _size(gap):
    total = 0.0
    for k in range(len(gap)):
        total += gap[k] ** 2
    return np.sqrt(total)


@njit(_nrt=False, **INNER_KERNEL)
def _violations(table, start, load1, w, f, room, gap):
    """What the law wants more of each force of a blade fills gap (3 width,); the norm of it.

    Args:
        start: forces, displacements and loads before the step.
    """
    width = f.shape[1]
    copy_matrix(f, room.wanted)
    for first in range(0, width, LANES_PER_VECTOR):
        node_steps(first, width, table, room.rigid, *start, load1, w, room.wanted, room.block)
        for a in range(3):
            for lane in range(LANES_PER_VECTOR):
                gap[a * width + first + lane] = room.block[a, lane]
    return _size(gap)


@njit(_nrt=False, **INNER_KERNEL)
def _renew(table, start, load1, w, f, F, factors, pivots):
    """Factors and pivots become those of 1 + B F of a blade at its forces; False where that is
    singular.
    """
    width = f.shape[1]
    for i in range(width):
        _, (b00, b10, b20, b11, b12, b22) = violation(w, f, i, table, start, load1)
        for k in range(3 * width):
            normal, x, y = F[i, k], F[width + i, k], F[2 * width + i, k]
            factors[i, k] = b00 * normal
            factors[width + i, k] = b10 * normal + b11 * x + b12 * y
            factors[2 * width + i, k] = b20 * normal + b12 * x + b22 * y
        for k in range(3):
            factors[k * width + i, k * width + i] += 1.0
    if factorise_small(factors, pivots):
        return True
    pivots[0] = -1
    return False

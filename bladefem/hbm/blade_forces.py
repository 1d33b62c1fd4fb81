"""Contact forces at the end of a step in time, blade by blade: all nodes of a blade at once.

Nodes of a stiff layer push each other to and fro, those of different blades hardly: on the shipped
wedge with 1e4 N/mm^3 sweeps over the nodes gain a fifth each time, sweeps over the blades a factor
of fifty. A Newton step of a blade takes the inverse of 1 + B F, B the derivatives of the law at its
nodes and F its own flexibility; an inverse is kept from step to step for as long as it halves the
violation, and steps with a new one are shortened until they bring their share of that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..friction.simd.codegen import LANES_PER_VECTOR
from ..friction.simd.node_steps import node_steps
from ..util.numba_options import INNER_KERNEL
from .ring_contacts import (
    NODE_OPERATIONS,
    displace,
    of_blade,
    subtract_moved,
    violation,
)

# most sweeps over the blades in a step, and new inverses of a blade
BLADE_SWEEPS = 30
RENEWALS = 6
# most steps that are taken blade by blade before one node by node is tried again
MOST_STEPS = 256
# share of the violation that a whole step has to take away, else its inverse is renewed; shares of
# the step that are tried then, each half of the one before
FALL = 0.5
HALVINGS = 5
# share of the limit within which changes by kept inverses count as none
OF_KEPT = 0.05
# operations of the law and its derivatives at a node, by numbers alone
VIOLATION_OPERATIONS = 500.0


class BladeInverses(NamedTuple):
    """What is kept from step to step of a march."""

    # (r, 3 width, 3 width) of 1 + B F
    inverse: np.ndarray
    # (2,) steps that are still taken blade by blade before one node by node is tried again, and how
    # many it will be the next time that such a step is not found
    steps: np.ndarray


def no_inverses(blades: int, size: int) -> BladeInverses:
    """At the beginning of a march of r blades with 3 width = size forces each.

    An inverse of zeros makes no step, and is renewed.
    """
    return BladeInverses(np.zeros((blades, size, size)), np.array([0, 1]))


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


@njit(_nrt=True, **INNER_KERNEL)
def by_blades(c, contacts, kept, w, f, before, load1, limit, work):
    """Sweeps over the blades until no force changes by more than a limit; False where they do not
    settle. Arguments as those of `bladefem.hbm.step_forces.contact_forces`.
    """
    blades, _, width = f.shape
    m = 3 * width
    displace(c, contacts, f, w, work)
    renewals = np.zeros(blades, dtype=np.int64)
    gap = np.empty(m)
    last = 0.0
    for _ in range(BLADE_SWEEPS):
        largest = 0.0
        by_kept = bool(0)
        for b in range(blades):
            start = of_blade(before, b)
            table = contacts.table[b]
            size = _violations(table, start, load1[b], w[b], f[b], gap)
            work[0] += 2.0 * m**2 + NODE_OPERATIONS * width
            if size <= limit:
                continue
            blade = table, contacts.flexibility, start, load1[b], w[b], f[b]
            step, share = _shortened(*blade, kept.inverse[b], gap, 1)
            if share == 0.0 and renewals[b] < RENEWALS:
                renewals[b] += 1
                kept.inverse[b] = _inverse(*blade)
                work[0] += 2.0 * m**3 + VIOLATION_OPERATIONS * width
                step, share = _shortened(*blade, kept.inverse[b], gap, HALVINGS)
            if share == 0.0:
                # a kink may have to be passed before it gets better
                share = 1.0
            by_kept = by_kept or renewals[b] == 0
            for a in range(3):
                for i in range(width):
                    largest = max(largest, abs(step[a, i]))
                    step[a, i] *= share
                    f[b, a, i] += step[a, i]
            for first in range(0, width, LANES_PER_VECTOR):
                subtract_moved(contacts.columns, b, first, step, first, w, work)
        ahead = largest * min(largest / last, 1.0) if last > 0.0 else largest
        if ahead <= (OF_KEPT * limit if by_kept else limit):
            return True
        if not np.isfinite(largest):
            return False
        last = largest
    return False


@njit(**INNER_KERNEL)
def _shortened(table, flexibility, start, load1, w, f, inverse, gap, tries):
    """A Newton step (3, width) of a blade, and the largest share of it in so many halvings that
    takes away as large a share of FALL of its violation; 0.0 where none does.
    """
    step = np.dot(inverse, gap)
    moved = np.dot(flexibility, step)
    forces = step.reshape(f.shape)
    size = _size(gap)
    left = np.empty_like(gap)
    share = 1.0
    for _ in range(tries):
        found = _violations(table, start, load1, w - share * moved, f + share * forces, left)
        if found <= (1.0 - FALL * share) * size:
            return forces, share
        share /= 2.0
    return forces, 0.0


@njit(_nrt=False, **INNER_KERNEL)
def _size(gap):
    total = 0.0
    for k in range(len(gap)):
        total += gap[k] ** 2
    return np.sqrt(total)


@njit(**INNER_KERNEL)
def _violations(table, start, load1, w, f, gap):
    """What the law wants more of each force of a blade fills gap (3 width,); the norm of it.

    Args:
        start: forces, displacements and loads before the step.
    """
    width = f.shape[1]
    wanted = f.copy()
    # the steps of nodes that nothing moves
    rigid = np.zeros((9, width))
    step = np.empty((3, LANES_PER_VECTOR))
    for first in range(0, width, LANES_PER_VECTOR):
        node_steps(first, width, table, rigid, *start, load1, w, wanted, step)
        for a in range(3):
            for lane in range(LANES_PER_VECTOR):
                gap[a * width + first + lane] = step[a, lane]
    return _size(gap)


@njit(**INNER_KERNEL)
def _inverse(table, F, start, load1, w, f):
    """(3 width, 3 width) inverse of 1 + B F of a blade at its forces."""
    width = f.shape[1]
    A = np.eye(3 * width)
    for i in range(width):
        _, (b00, b10, b20, b11, b12, b22) = violation(w, f, i, table, start, load1)
        normal, x, y = F[i], F[width + i], F[2 * width + i]
        for k in range(3 * width):
            A[i, k] += b00 * normal[k]
            A[width + i, k] += b10 * normal[k] + b11 * x[k] + b12 * y[k]
            A[2 * width + i, k] += b20 * normal[k] + b12 * x[k] + b22 * y[k]
    return np.linalg.inv(A)

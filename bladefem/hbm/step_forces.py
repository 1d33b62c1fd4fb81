"""Contact forces at the end of a step in time: those that the friction law gives for their motion.

With the displacements w = c - F f_extra, F the flexibility of the bodies for forces at the end of a
step, each node wants f = law(w). First eight nodes at a time take Newton steps of their own, until
none changes, which is cheap and nearly always enough (`bladefem.friction.simd.node_steps`). Where
that does not settle, those of a blade take a Newton step together (`bladefem.hbm.blade_forces`).
Where that does not either, all nodes do, with the exact derivative of the law or one of its sides
(a semi-smooth Newton method: Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353, DOI
10.1016/0045-7825(91)90022-X), shortened until the violation falls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..friction.simd.codegen import LANES_PER_VECTOR
from ..friction.simd.node_steps import KN, node_steps
from ..util.numba_options import INNER_KERNEL, KERNEL
from .blade_forces import by_blades, note_step
from .linear.array_copy import clear_vector, copy_vector
from .ring_contacts import (
    NODE_OPERATIONS,
    displace,
    of_blade,
    subtract_from_others,
    subtract_from_own,
    subtract_moved,
    violation,
)

# most sweeps over the nodes in a step; ten of them take the time of one Newton step of each blade
SWEEPS = 30
# change of a force in a sweep that counts as none, over the largest force
SETTLED = 1e-6
# sweeps in a step beyond which blades are taken one by one in the next, and the change of a blade's
# forces over its first one with which the others follow
SWEEPS_TOGETHER = 6
NEARLY_SETTLED = 0.02

# Newton steps of all nodes together, and halvings of one
NEWTON_STEPS = 40
HALVINGS = 10
# decrease of the violation that a step has to bring, over its share
DECREASE = 1e-4


class StepRoom(NamedTuple):
    """What a step of a march fills anew, kept so that none makes arrays."""

    # (r, 3, width) contact forces and (r, 3 width) displacements before the step
    forces: np.ndarray
    displacements: np.ndarray
    # (r, 3, width) forces that were guessed
    ahead: np.ndarray
    # changes of the forces of a block of nodes (3, LANES_PER_VECTOR), and of a blade (3, width)
    block: np.ndarray
    total: np.ndarray
    # (1,) blades are taken one by one
    apart: np.ndarray
    # of a layer that stiffens: (r, width) forces at which tangents are taken, and (2, r, width)
    # normal loads at zero displacement by them
    tangents: np.ndarray
    loads: np.ndarray


def step_room(blades: int, width: int) -> StepRoom:
    """Of r blades with nodes in rows of ``width``."""
    return StepRoom(
        forces=np.zeros((blades, 3, width)),
        displacements=np.zeros((blades, 3 * width)),
        ahead=np.zeros((blades, 3, width)),
        block=np.zeros((3, LANES_PER_VECTOR)),
        total=np.zeros((3, width)),
        apart=np.zeros(1, dtype=bool),
        tangents=np.zeros((blades, width)),
        loads=np.zeros((2, blades, width)),
    )


@njit(_nrt=False, **KERNEL)
def contact_forces(c, contacts, kept, w, f, change, extra, load0, load1, work, room):
    """Forces at the end of a step, of w = c - F extra: f, extra and w are those before, and then
    those after. False where they were not found.

    The steps start from a parabola through the last forces.

    Args:
        c: (r, 3 width) displacements without extra forces.
        kept: from step to step of a march, changed.
        w: (r, 3 width) relative displacements; f: (r, 3, width) contact forces; extra: (r, 3 width)
            those less preload.
        change: (2, r, 3, width) of the forces in the last step and the one before; those of this
            step and the last afterwards.
        load0, load1: (r, width) normal loads at zero displacement before and after the step,
            negative where there is no node.
        work: (1,) takes the operations.
        room: `StepRoom`; has forces and displacements before the step afterwards.
    """
    note_start(f, w, room)
    limit = SETTLED * largest_force(contacts.preload, f)
    add_parabola(change.reshape(2, f.size), f.reshape(f.size))
    found = settled_forces(c, contacts, kept, w, f, load0, load1, limit, work, room)
    note_forces(contacts.preload, f, change, extra, room)
    return found


@njit(_nrt=False, **INNER_KERNEL)
def note_start(f, w, room):
    """Forces and displacements before a step are kept."""
    copy_vector(f.reshape(f.size), room.forces.reshape(f.size))
    copy_vector(w.reshape(w.size), room.displacements.reshape(w.size))


@njit(_nrt=False, **INNER_KERNEL)
def settled_forces(c, contacts, kept, w, f, load0, load1, limit, work, room):
    """The forces f, which are guesses before, until none changes by more than a limit, and their
    displacements w; False where they were not found. Other arguments as those of `contact_forces`.
    """
    before = room.forces, room.displacements, load0
    copy_vector(f.reshape(f.size), room.ahead.reshape(f.size))
    found = False
    if kept.steps[0] > 0:
        kept.steps[0] -= 1
    else:
        if room.apart[0]:
            found = _by_blocks_apart(c, contacts, w, f, before, load1, limit, work, room)
        else:
            found = _by_blocks(c, contacts, w, f, before, load1, limit, work, room)
        note_step(kept, found)
    if not found:
        # steps that do not settle lead away
        copy_vector(room.ahead.reshape(f.size), f.reshape(f.size))
        found = by_blades(c, contacts, kept, w, f, before, load1, limit, work)
    if not found:
        copy_vector(room.forces.reshape(f.size), f.reshape(f.size))
        found = _together(c, contacts, w, f, before, load1, limit, work)
    return found


@njit(_nrt=False, **INNER_KERNEL)
def largest_force(preload, f):
    """Of the preload (3 width,) and of forces f (r, 3, width) [N]."""
    return max(_largest(preload), _largest(f.reshape(f.size)))


@njit(_nrt=False, **INNER_KERNEL)
def note_forces(preload, f, change, extra, room):
    """Extra forces and changes of a step that ended on forces f."""
    for b in range(len(f)):
        less_preload(f[b].reshape(extra.shape[1]), preload, extra[b])
    _shift_changes(f.reshape(f.size), room.forces.reshape(f.size), change.reshape(2, f.size))


# the order of a maximum is free, so that it is vectorised
@njit(fastmath={"nnan", "nsz", "reassoc"}, _nrt=False, **INNER_KERNEL)
def _largest(values):
    found = 0.0
    for k in range(len(values)):
        found = max(found, abs(values[k]))
    return found


@njit(_nrt=False, **INNER_KERNEL)
def add_parabola(change, target):
    """target (k,) goes on as by the changes (2, k) in the last step and the one before."""
    last, before = change[0], change[1]
    for k in range(len(target)):
        target[k] += 2.0 * last[k] - before[k]


@njit(_nrt=False, **INNER_KERNEL)
def less_preload(f, preload, extra):
    for k in range(len(extra)):
        extra[k] = f[k] - preload[k]


@njit(_nrt=False, **INNER_KERNEL)
def _shift_changes(f, start, change):
    """change (2, k) of forces becomes that from start (k,) to f (k,), and what it was."""
    last, before = change[0], change[1]
    for k in range(len(f)):
        before[k] = last[k]
        last[k] = f[k] - start[k]


@njit(_nrt=False, **INNER_KERNEL)
def _by_blocks(c, contacts, w, f, before, load1, limit, work, room):
    """Sweeps over the nodes of all blades, each with a Newton step of its own; False where they do
    not settle.

    Displacements follow each force that changes: nodes that are open, most of them where a damper
    comes off, cost nothing but their displacement.
    """
    displace(c, contacts, f, w, work)
    # a first sweep says nothing of how fast they settle
    last = 0.0
    for sweep in range(SWEEPS):
        largest = 0.0
        for b in range(len(f)):
            largest = max(largest, _sweep(b, contacts, w, f, before, load1, work, room, False))
        if _settle(largest, last, limit):
            room.apart[0] = sweep >= SWEEPS_TOGETHER
            return True
        last = largest
    room.apart[0] = True
    return False


@njit(_nrt=False, **INNER_KERNEL)
def _by_blocks_apart(c, contacts, w, f, before, load1, limit, work, room):
    """As `_by_blocks`, where many sweeps are needed: the displacements of the other blades, which
    a blade hardly moves, follow when its nodes are nearly settled.
    """
    blades, _, width = f.shape
    displace(c, contacts, f, w, work)
    last = 0.0
    most = SWEEPS * blades
    sweeps = 0
    while sweeps < most:
        largest = 0.0
        for b in range(blades):
            clear_vector(room.total.reshape(3 * width))
            first_step = 0.0
            settled = False
            while not settled:
                step = _sweep(b, contacts, w, f, before, load1, work, room, True)
                sweeps += 1
                first_step = max(first_step, step)
                enough = max(limit, NEARLY_SETTLED * first_step)
                settled = step <= enough or sweeps >= most
            largest = max(largest, first_step)
            for first in range(0, width, LANES_PER_VECTOR):
                subtract_from_others(contacts.columns, b, first, room.total, first, w, work)
        if _settle(largest, last, limit):
            room.apart[0] = sweeps > SWEEPS_TOGETHER * blades
            return True
        last = largest
    return False


# written into its callers: arguments of so many arrays take as long as a block of nodes
@njit(inline="always", _nrt=False, **INNER_KERNEL)
def _sweep(b, contacts, w, f, before, load1, work, room, apart):
    """A Newton step of each node of blade b, eight at a time; the largest change of a force.

    Args:
        apart: displacements of the blade alone follow, and ``room.total`` takes the changes.
    """
    old = of_blade(before, b)
    table, step = contacts.table[b], room.block
    largest = 0.0
    for first in range(0, f.shape[2], LANES_PER_VECTOR):
        if not _are_open(table[KN], w[b], f[b], load1[b], first):
            work[0] += NODE_OPERATIONS * LANES_PER_VECTOR
            node_steps(first, f.shape[2], table, contacts.own, *old, load1[b], w[b], f[b], step)
            largest = max(largest, _largest(step.reshape(step.size)))
            if apart:
                subtract_from_own(contacts.columns, b, first, step, 0, w, work)
                _add_block(step, first, room.total)
            else:
                subtract_moved(contacts.columns, b, first, step, 0, w, work)
    return largest


@njit(_nrt=False, **INNER_KERNEL)
def _settle(step, last, limit):
    """The next sweep would change no force by more than a limit, if that falls again as it did."""
    return (step * min(step / last, 1.0) if last > 0.0 else step) <= limit


@njit(_nrt=False, **INNER_KERNEL)
def _add_block(step, first, total):
    """Changes (3, LANES_PER_VECTOR) of a block of nodes are added to those (3, width) of all."""
    for k in range(3):
        for lane in range(LANES_PER_VECTOR):
            total[k, first + lane] += step[k, lane]


@njit(_nrt=False, **INNER_KERNEL)
def _are_open(kn, w, f, load1, first):
    """The nodes of a block have no force, and get none."""
    for i in range(first, first + LANES_PER_VECTOR):
        if f[0, i] != 0.0 or f[1, i] != 0.0 or f[2, i] != 0.0 or load1[i] + kn[i] * w[i] > 0.0:
            return False
    return True


@njit(_nrt=True, **INNER_KERNEL)
def _together(c, contacts, w, f, before, load1, limit, work):
    """Newton steps of all nodes at once, shortened until the violation falls; False where it does
    not vanish.
    """
    F = _whole_flexibility(contacts.columns)
    size = len(F)
    blades, _, width = f.shape
    B = np.zeros((blades, width, 3, 3))
    gap = np.empty(size)
    A = np.empty((size, size))
    start, target = np.empty(size), f.reshape(size)
    total = _violations(c, contacts, F, w, f, before, load1, B, gap)
    for _ in range(NEWTON_STEPS):
        worst = 0.0
        for row in range(size):
            worst = max(worst, abs(gap[row]))
        if worst <= limit:
            return True
        copy_vector(f.reshape(size), start)
        for row in range(size):
            b, a, i = row // (3 * width), row // width % 3, row % width
            for column in range(size):
                A[row, column] = 0.0
            for k in range(3):
                gain, moved = B[b, i, a, k], F[(3 * b + k) * width + i]
                for column in range(size):
                    A[row, column] += gain * moved[column]
            A[row, row] += 1.0
        step = np.linalg.solve(A, gap)
        work[0] += 0.7 * size**3 + 6.0 * size**2
        share = 1.0
        for halving in range(HALVINGS + 1):
            if halving == HALVINGS:
                # a kink may have to be passed before it gets better
                share = 1.0
            for row in range(size):
                target[row] = start[row] + share * step[row]
            found = _violations(c, contacts, F, w, f, before, load1, B, gap)
            work[0] += 2.0 * size**2
            if found < (1.0 - DECREASE * share) * total:
                break
            share /= 2.0
        total = found
        if not np.isfinite(total):
            return False
    return False


@njit(**INNER_KERNEL)
def _whole_flexibility(columns):
    """(r 3 width, r 3 width) flexibility of all blades."""
    m, size = columns.shape
    F = np.empty((size, size))
    for b in range(size // m):
        for k in range(m):
            for row in range(size):
                F[(b * m + row) % size, b * m + k] = columns[k, row]
    return F


@njit(**INNER_KERNEL)
def _violations(c, contacts, F, w, f, before, load1, B, gap):
    """Norm of what the law wants more of each force; gap (r 3 width,) and its derivatives B (r,
    width, 3, 3) by the displacements of each node are filled, as is w of the forces f.
    """
    blades, _, width = f.shape
    m = 3 * width
    extra = np.empty(blades * m)
    for b in range(blades):
        for k in range(m):
            extra[b * m + k] = f[b, k // width, k % width] - contacts.preload[k]
    for b in range(blades):
        for k in range(m):
            w[b, k] = c[b, k] - inner_product(F[b * m + k], extra)
    total = 0.0
    for b in range(blades):
        table = contacts.table[b]
        for i in range(width):
            own, (b00, b10, b20, b11, b12, b22) = violation(
                w[b], f[b], i, table, of_blade(before, b), load1[b]
            )
            slopes = ((b00, 0.0, 0.0), (b10, b11, b12), (b20, b12, b22))
            for a in range(3):
                gap[b * m + a * width + i] = own[a]
                total += own[a] ** 2
                for k in range(3):
                    B[b, i, a, k] = slopes[a][k]
    return np.sqrt(total)


# the order of the sum is free, so that it is vectorised
@njit(fastmath={"reassoc", "contract"}, _nrt=False, **INNER_KERNEL)
def inner_product(a, b):
    """Sum of the entries of a (n,) times the first n of b."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total

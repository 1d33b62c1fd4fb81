"""Contact forces at the end of a step in time: those that the friction law gives for their motion.

With the displacements w = c - F f_extra, F the flexibility of the bodies for forces at the end of a
step, each node wants f = law(w). First eight nodes at a time take Newton steps of their own, until
none changes, which is cheap and nearly always enough (`bladefem.friction.simd.node_steps`). Nodes
of a stiff layer, or with few of them pressed, push each other to and fro; there all take a Newton
step together, with the exact derivative of the law or one of its sides (a semi-smooth Newton
method: Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353, DOI
10.1016/0045-7825(91)90022-X), shortened until the violation falls.

All r blades are alike, and forces on one move the others the same way wherever it is: what is kept
is of one blade. Its nodes are in rows of a multiple of eight numbers, three rows one after the
other: normal, first and second tangential direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..friction.simd.codegen import LANES_PER_VECTOR
from ..friction.simd.node_steps import KN, KT, MU, node_steps, subtract_block, subtract_node
from ..util.numba_options import INNER_KERNEL, KERNEL
from .linearised_flow import slopes_2d

# most sweeps over the nodes in a step
SWEEPS = 60
# change of a force in a sweep that counts as none, over the largest force
SETTLED = 1e-6

# nodes of a block whose forces change from which on it is faster to take all of them at once
FULL_BLOCK = 6
# of the friction law and the step of one node
NODE_OPERATIONS = 100.0
# Newton steps of all nodes together, and halvings of one
NEWTON_STEPS = 40
HALVINGS = 10
# decrease of the violation that a step has to bring, over its share
DECREASE = 1e-4


class RingContacts(NamedTuple):
    """What does not change from step to step, of a blade with nodes in rows of ``width``."""

    # (3, width) kt, kn, mu
    table: np.ndarray
    # (3 width, r 3 width) displacements that each force on a blade makes on itself and, one after
    # the other, on those after it
    columns: np.ndarray
    # (9, width) those of each node's forces on itself, direction by direction
    own: np.ndarray
    # (3 width,) forces under which nothing moves, and displacements by those of all blades
    preload: np.ndarray
    pressed: np.ndarray


def places_of_nodes(nodes: int) -> np.ndarray:
    """(width,) number of the node in each place of a row; -1: none.

    Nodes that take their steps together are far from each other, so that they hardly push each
    other.
    """
    blocks = -(-nodes // LANES_PER_VECTOR)
    number = np.arange(blocks * LANES_PER_VECTOR).reshape(LANES_PER_VECTOR, blocks).T.ravel()
    return np.where(number < nodes, number, -1)


def places_of_directions(nodes: int, directions: int) -> np.ndarray:
    """(3 width,) number of each contact degree of freedom, counted node by node; -1: none."""
    node = places_of_nodes(nodes)
    rows = [np.where(node < 0, -1, node * directions + k) for k in range(directions)]
    return np.concatenate([*rows, *[np.full_like(node, -1)] * (3 - directions)])


def in_places(values: np.ndarray, places: np.ndarray, empty: float = 0.0) -> np.ndarray:
    """(..., places) values of the last axis in these places, and a number where there is none."""
    found = values[..., places]
    found[..., places < 0] = empty
    return np.ascontiguousarray(found)


def ring_contacts(table: np.ndarray, flexibility: np.ndarray, preload: np.ndarray) -> RingContacts:
    """From what is counted node by node.

    Args:
        table: (n, 3) kt, kn, mu and preload: (n d,) of one blade.
        flexibility: (r n d, n d) of all blades by the forces on the first.
    """
    places = places_of_directions(len(table), len(preload) // len(table))
    m, width = len(preload), len(places) // 3
    # (forces, blades, displacements)
    by_force = in_places(flexibility.T.reshape(m, -1, m), places)
    columns = in_places(by_force.transpose(1, 2, 0), places).transpose(2, 0, 1)
    own = columns[:, 0].T.reshape(3, width, 3, width).diagonal(axis1=1, axis2=3)
    load = in_places(preload, places)
    return RingContacts(
        in_places(table.T, places_of_nodes(len(table))),
        columns.reshape(3 * width, -1).copy(),
        own.reshape(9, width).copy(),
        load,
        load @ columns.sum(axis=1),
    )


@njit(**KERNEL)
def contact_forces(c, contacts, w, f, change, extra, load0, load1, work):
    """Forces at the end of a step, of w = c - F extra: f, extra and w are those before, and then
    those after. False where they were not found.

    The steps start from a parabola through the last forces.

    Args:
        c: (r, 3 width) displacements without extra forces.
        w: (r, 3 width) relative displacements; f: (r, 3, width) contact forces; extra: (r, 3 width)
            those less preload.
        change: (2, r, 3, width) of the forces in the last step and the one before; those of this
            step and the last afterwards.
        load0, load1: (r, width) normal loads at zero displacement before and after the step,
            negative where there is no node.
        work: (1,) takes the operations.
    """
    before = f.copy(), w.copy(), load0
    largest = max(_largest(contacts.preload), _largest(f.reshape(f.size)))
    _add_parabola(change.reshape(2, f.size), f.reshape(f.size))
    found = _by_blocks(c, contacts, w, f, before, load1, largest, work)
    if not found:
        # from the forces before the step: steps that do not settle lead away
        f[:] = before[0]
        found = _together(c, contacts, w, f, before, load1, largest, work)
    for b in range(len(w)):
        _less_preload(f[b].reshape(w.shape[1]), contacts.preload, extra[b])
    _shift_changes(f.reshape(f.size), before[0].reshape(f.size), change.reshape(2, f.size))
    return found


# the order of a maximum is free, so that it is vectorised
@njit(fastmath={"nnan", "nsz", "reassoc"}, **INNER_KERNEL)
def _largest(values):
    found = 0.0
    for k in range(len(values)):
        found = max(found, abs(values[k]))
    return found


@njit(**INNER_KERNEL)
def _add_parabola(change, target):
    """target (k,) goes on as by the changes (2, k) in the last step and the one before."""
    last, before = change[0], change[1]
    for k in range(len(target)):
        target[k] += 2.0 * last[k] - before[k]


@njit(**INNER_KERNEL)
def _less_preload(f, preload, extra):
    for k in range(len(extra)):
        extra[k] = f[k] - preload[k]


@njit(**INNER_KERNEL)
def _shift_changes(f, start, change):
    """change (2, k) of forces becomes that from start (k,) to f (k,), and what it was."""
    last, before = change[0], change[1]
    for k in range(len(f)):
        before[k] = last[k]
        last[k] = f[k] - start[k]


@njit(**INNER_KERNEL)
def _by_blocks(c, contacts, w, f, before, load1, largest, work):
    """Sweeps over the nodes, each with a Newton step of its own; False where they do not settle.

    Displacements follow each force that changes: nodes that are open, most of them where a damper
    comes off, cost nothing but their displacement.
    """
    blades, _, width = f.shape
    step = np.zeros((3, LANES_PER_VECTOR))
    for b in range(blades):
        for k in range(3 * width):
            w[b, k] = c[b, k] + contacts.pressed[k]
    for b in range(blades):
        for first in range(0, width, LANES_PER_VECTOR):
            _subtract(contacts.columns, b, first, f[b], first, w, work)
    # a first sweep says nothing of how fast they settle
    last = 0.0
    for _ in range(SWEEPS):
        largest_step = 0.0
        for b in range(blades):
            old = before[0][b], before[1][b], before[2][b]
            for first in range(0, width, LANES_PER_VECTOR):
                if _are_open(contacts.table[KN], w[b], f[b], load1[b], first):
                    continue
                work[0] += NODE_OPERATIONS * LANES_PER_VECTOR
                node_steps(
                    first, width, contacts.table, contacts.own, *old, load1[b], w[b], f[b], step
                )
                largest_step = max(largest_step, _largest(step.reshape(step.size)))
                _subtract(contacts.columns, b, first, step, 0, w, work)
        # by how much the next one would change a force, if it falls again as it did
        ahead = largest_step * min(largest_step / last, 1.0) if last > 0.0 else largest_step
        if ahead <= SETTLED * largest:
            return True
        last = largest_step
    return False


@njit(**INNER_KERNEL)
def _are_open(kn, w, f, load1, first):
    """The nodes of a block have no force, and get none."""
    for i in range(first, first + LANES_PER_VECTOR):
        if f[0, i] != 0.0 or f[1, i] != 0.0 or f[2, i] != 0.0 or load1[i] + kn[i] * w[i] > 0.0:
            return False
    return True


@njit(**INNER_KERNEL)
def _subtract(columns, b, first, forces, place, target, work):
    """target (r, 3 width) becomes less what the forces of a block of nodes of blade b move.

    Args:
        first: place of the block in a row of nodes; place: that of its forces in their rows.
    """
    blades, m = target.shape
    size = blades * m
    stride = forces.shape[1]
    moving = 0
    for i in range(place, place + LANES_PER_VECTOR):
        moving += forces[0, i] != 0.0 or forces[1, i] != 0.0 or forces[2, i] != 0.0
    if moving >= FULL_BLOCK:
        work[0] += 6.0 * LANES_PER_VECTOR * size
        subtract_block(columns, first, m // 3, b * m, size, forces, stride, place, target)
        return
    work[0] += 6.0 * moving * size
    for lane in range(LANES_PER_VECTOR):
        i = place + lane
        if forces[0, i] != 0.0 or forces[1, i] != 0.0 or forces[2, i] != 0.0:
            subtract_node(columns, first + lane, m // 3, b * m, size, forces, stride, i, target)


@njit(**INNER_KERNEL)
def _together(c, contacts, w, f, before, load1, largest, work):
    """Newton steps of all nodes at once, shortened until the violation falls; False where it does
    not vanish.
    """
    F = _whole_flexibility(contacts.columns)
    size = len(F)
    blades, _, width = f.shape
    B = np.zeros((blades, width, 3, 3))
    gap = np.empty(size)
    A = np.empty((size, size))
    start = np.empty_like(f)
    total = _violations(c, contacts, F, w, f, before, load1, B, gap)
    for _ in range(NEWTON_STEPS):
        worst = 0.0
        for row in range(size):
            worst = max(worst, abs(gap[row]))
        if worst <= SETTLED * largest:
            return True
        start[:] = f
        for row in range(size):
            b, a, i = row // (3 * width), row // width % 3, row % width
            A[row] = 0.0
            for k in range(3):
                A[row] += B[b, i, a, k] * F[(3 * b + k) * width + i]
            A[row, row] += 1.0
        _solve_small(A, gap)
        work[0] += size**3 + 6.0 * size**2
        step = gap.copy().reshape(f.shape)
        share = 1.0
        for halving in range(HALVINGS + 1):
            if halving == HALVINGS:
                # a kink may have to be passed before it gets better
                share = 1.0
            f[:] = start + share * step
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
            w[b, k] = c[b, k] - _product(F[b * m + k], extra)
    total = 0.0
    for b in range(blades):
        for i in range(width):
            own, (b00, b10, b20, b11, b12, b22) = _violation(
                w[b], f[b], i, contacts.table, (before[0][b], before[1][b], before[2][b]), load1[b]
            )
            slopes = ((b00, 0.0, 0.0), (b10, b11, b12), (b20, b12, b22))
            for a in range(3):
                gap[b * m + a * width + i] = own[a]
                total += own[a] ** 2
                for k in range(3):
                    B[b, i, a, k] = slopes[a][k]
    return np.sqrt(total)


@njit(**INNER_KERNEL)
def _violation(w, f, i, table, before, load1):
    """What the friction law wants more of the forces of node i at its displacements: normal and two
    tangential ones.

    Returns:
        these, and their derivatives by the displacements: normal by normal, tangential by normal,
        and xx, xy, yy of the tangential ones.
    """
    width = f.shape[1]
    forces, old, load0 = before
    kt, kn, mu = table[KT, i], table[KN, i], table[MU, i]
    N0 = load0[i] + kn * old[i]
    N1 = load1[i] + kn * w[i]
    dx = kt * (w[width + i] - old[width + i])
    dy = kt * (w[2 * width + i] - old[2 * width + i])
    force, _, across, by = slopes_2d(forces[1, i], forces[2, i], dx, dy, N0, N1, mu)
    _, by_motion, _, by_load = by
    stiff = kt * by_motion
    gap = (max(N1, 0.0) - f[0, i], force[0] - f[1, i], force[1] - f[2, i])
    normal = kn if N1 > 0.0 else 0.0
    xx, xy, yy = stiff * across[0], stiff * across[1], stiff * across[2]
    return gap, (normal, by_load[0] * kn, by_load[1] * kn, xx, xy, yy)


# the order of the sum is free, so that it is vectorised
@njit(fastmath={"reassoc", "contract"}, **INNER_KERNEL)
def _product(a, b):
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@njit(**INNER_KERNEL)
def _solve_small(A, b):
    """Solve A x = b by elimination with pivots, in place."""
    n = len(b)
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        if p != k:
            for j in range(n):
                A[k, j], A[p, j] = A[p, j], A[k, j]
            b[k], b[p] = b[p], b[k]
        for i in range(k + 1, n):
            share = A[i, k] / A[k, k]
            for j in range(k, n):
                A[i, j] -= share * A[k, j]
            b[i] -= share * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]

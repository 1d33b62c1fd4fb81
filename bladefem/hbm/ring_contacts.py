"""Contacts of all blades of a ring, in the order in which the steps of a march take them.

All r blades are alike, and forces on one move the others the same way wherever it is: what is kept
is of one blade. Its nodes are in rows of a multiple of eight numbers, three rows one after the
other: normal, first and second tangential direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..friction.simd.codegen import LANES_PER_VECTOR
from ..friction.simd.node_steps import KN, KT, MU, subtract_block, subtract_node
from ..util.numba_options import INNER_KERNEL
from .linearised_flow import slopes_2d

# nodes of a block whose forces change from which on it is faster to take all of them at once
FULL_BLOCK = 6
# operations of the friction law and the step of one node
NODE_OPERATIONS = 100.0


class RingContacts(NamedTuple):
    """What does not change from step to step, of a blade with nodes in rows of ``width``; but for
    the stiffness of a layer that stiffens (`bladefem.hbm.stiffening_layer`).
    """

    # (r, 3, width) kt, kn, mu of each blade
    table: np.ndarray
    # (3 width, r 3 width) displacements that each force on a blade makes on itself and, one after
    # the other, on those after it
    columns: np.ndarray
    # (9, width) those of each node's forces on itself, direction by direction
    own: np.ndarray
    # (3 width, 3 width) displacements of a blade by its own forces
    flexibility: np.ndarray
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
    own_table = in_places(table.T, places_of_nodes(len(table)))
    return RingContacts(
        np.tile(own_table, (by_force.shape[1], 1, 1)),
        columns.reshape(3 * width, -1).copy(),
        own.reshape(9, width).copy(),
        columns[:, 0].T.copy(),
        load,
        load @ columns.sum(axis=1),
    )


def forces_in_places(forces: np.ndarray, blades: int) -> np.ndarray:
    """(r, 3, width) contact forces from those of all nodes (r n, 3), blade by blade."""
    of_blades = forces.reshape(blades, -1, 3).swapaxes(1, 2)
    return in_places(of_blades, places_of_nodes(of_blades.shape[2]))


def forces_of_nodes(forces: np.ndarray, nodes: int) -> np.ndarray:
    """(r n, 3) contact forces of the n nodes of each blade from those in places (r, 3, width)."""
    place = np.argsort(places_of_nodes(nodes))[-nodes:]
    return forces[:, :, place].swapaxes(1, 2).reshape(-1, 3)


# written into its callers: it gives arrays, which those without counts of references cannot take
@njit(inline="always", _nrt=False, **INNER_KERNEL)
def of_blade(before, b):
    """Forces, displacements and loads of one blade from those of all."""
    forces, displacements, loads = before
    return forces[b], displacements[b], loads[b]


@njit(_nrt=False, **INNER_KERNEL)
def displace(c, contacts, f, w, work):
    """w (r, 3 width) becomes c less what the contact forces f (r, 3, width) beyond the preload
    move.
    """
    blades, _, width = f.shape
    for b in range(blades):
        for k in range(3 * width):
            w[b, k] = c[b, k] + contacts.pressed[k]
    for b in range(blades):
        for first in range(0, width, LANES_PER_VECTOR):
            subtract_moved(contacts.columns, b, first, f[b], first, w, work)


@njit(_nrt=False, **INNER_KERNEL)
def subtract_moved(columns, b, first, forces, place, target, work):
    """target (r, 3 width) becomes less what the forces of a block of nodes of blade b move.

    Args:
        first: place of the block in a row of nodes; place: that of its forces in their rows.
    """
    last_blade = target.size - b * target.shape[1]
    _subtract(columns, b, first, forces, place, target, work, (0, last_blade, target.size))


@njit(_nrt=False, **INNER_KERNEL)
def subtract_from_own(columns, b, first, forces, place, target, work):
    """As `subtract_moved`, of blade b alone."""
    m = target.shape[1]
    _subtract(columns, b, first, forces, place, target, work, (0, m, m))


@njit(_nrt=False, **INNER_KERNEL)
def subtract_from_others(columns, b, first, forces, place, target, work):
    """As `subtract_moved`, of all blades but b."""
    m = target.shape[1]
    last_blade = target.size - b * m
    _subtract(columns, b, first, forces, place, target, work, (m, last_blade, target.size))


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _subtract(columns, b, first, forces, place, target, work, which):
    """As `subtract_moved`, of displacements from the first to the last of three numbers, counted
    from blade b on; with the second one begins the first blade.
    """
    begin, middle, end = which
    size, m = target.size, target.shape[1]
    shift, width = b * m, m // 3
    stride = forces.shape[1]
    moving = 0
    for i in range(place, place + LANES_PER_VECTOR):
        moving += forces[0, i] != 0.0 or forces[1, i] != 0.0 or forces[2, i] != 0.0
    of = width, size, begin, middle, end, shift, forces, stride
    if moving >= FULL_BLOCK:
        work[0] += 6.0 * LANES_PER_VECTOR * (end - begin)
        subtract_block(columns, first, *of, place, target)
        return
    work[0] += 6.0 * moving * (end - begin)
    for lane in range(LANES_PER_VECTOR):
        i = place + lane
        if forces[0, i] != 0.0 or forces[1, i] != 0.0 or forces[2, i] != 0.0:
            subtract_node(columns, first + lane, *of, i, target)


@njit(_nrt=False, **INNER_KERNEL)
def violation(w, f, i, table, before, load1):
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

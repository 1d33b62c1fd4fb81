"""The map of disturbances of a periodic motion over part of a period.

Bodies step exactly between two instants (`bladefem.hbm.linearised_flow.group_steps`), the contact
forces follow implicitly from the derivatives of the friction law's own steps
(`bladefem.hbm.linearised_flow.contact_steps`). All disturbances are carried at once, so that nearly
all operations are products of matrices, which single precision makes 1.3 to 1.8 times as fast
(`benchmarks/time_kernels.py`, the shipped wedge): maps and multipliers are 1e-5 off there. The
small systems of the contacts are solved in double precision in any case.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from ..util.arrays import IntegerArray
from ..util.numba_options import INNER_KERNEL, KERNEL
from .closed_contacts import OpenContacts
from .linear.array_copy import copy_matrix
from .linearised_flow import group_steps, longest_linear_step

# modes of a group up to which plain loops are faster than a product of matrices
SMALL_GROUP = 3


class NodeSteps(NamedTuple):
    """Derivatives of the steps of a period, step k to instant k, of n nodes with d directions."""

    # (S, n, d, d) of the force by the force before
    before: np.ndarray
    # (S, n, d, d) by the displacements after and before the step [N/m]
    after_motion: np.ndarray
    before_motion: np.ndarray
    # (S, n) of each step for which the force before it acts
    share: np.ndarray


class _Bodies(NamedTuple):
    """Steps of the bodies on states (q, v) group by group, and of forces in contact."""

    # (groups + 1,) first mode of each group
    starts: np.ndarray
    # E of the groups one after the other
    flow: np.ndarray
    # (2M, m) of forces from an instant on until half the step after: what the step before it left,
    # and the step after it
    carried: np.ndarray
    # (2M, m) parts of it: forces after the step before, and before the step after
    old: np.ndarray
    new: np.ndarray
    # (2M, m) states at the end of a step by the forces after it
    ended: np.ndarray
    # (n d, M) readings in the order of the groups; (n d, m) flexibility, and what the forces after
    # a step move at its end
    reading: np.ndarray
    flexibility: np.ndarray
    moved: np.ndarray
    # (n d,) number of the force in each direction, -1: none
    force: np.ndarray


def flow_map(
    contacts: OpenContacts, nodes: NodeSteps, dt: float, steps: int, *, single: bool = False
) -> np.ndarray:
    """(2M+m, 2M+m) map of disturbances of (q, v, f) over the first steps of a period.

    Args:
        nodes: of the nodes of the contacts.
        dt: of a step [s]; steps: at most those of a period.
        single: carried in single precision.
    """
    bodies, order = _bodies(contacts, dt, dt > _longest_step(contacts, nodes))
    precision = np.dtype(np.float32 if single else np.float64)
    carried = _in_precision(bodies, precision), _in_precision(nodes, precision)
    found = _carry(*carried, _acting_nodes(nodes), steps).astype(float)
    M = len(contacts.stiffness)
    state = np.concatenate([order, np.arange(2 * M, len(found))])
    mapped = np.empty_like(found)
    mapped[np.ix_(state, state)] = found
    return mapped


def acting_forces(contacts: OpenContacts, nodes: NodeSteps) -> IntegerArray:
    """(S,) number of forces that there are after each step: open nodes have none."""
    n, d = nodes.before.shape[1:3]
    each = np.count_nonzero(contacts.force.reshape(n, d) >= 0, axis=1)
    return _acting_nodes(nodes) @ each


def _acting_nodes(nodes: NodeSteps) -> np.ndarray:
    """(S, n) whether a node has a force after each step."""
    parts = nodes.before, nodes.after_motion, nodes.before_motion
    return np.logical_or.reduce([part.any(axis=(2, 3)) for part in parts])


def _in_precision(parts: Any, precision: np.dtype) -> Any:
    """Arrays of a named tuple, contiguous, their numbers in this precision; those that count stay
    as they are.
    """
    return parts._replace(
        **{
            name: np.ascontiguousarray(part, precision if part.dtype.kind == "f" else part.dtype)
            for name, part in parts._asdict().items()
        }
    )


def _longest_step(contacts: OpenContacts, nodes: NodeSteps) -> float:
    """Step [s] up to which forces may be linear in between: with the springs that the nodes have
    where they stick or press.
    """
    rows = np.flatnonzero(contacts.force >= 0)
    most = np.diagonal(nodes.after_motion, axis1=2, axis2=3).max(axis=0).ravel()
    springs = np.zeros(contacts.push.shape[1])
    flexibility = np.zeros((len(springs), len(springs)))
    springs[contacts.force[rows]] = most[rows]
    flexibility[contacts.force[rows]] = contacts.flexibility[rows]
    return longest_linear_step(contacts.stiffness, contacts.push, flexibility, springs)


def _bodies(contacts: OpenContacts, dt: float, mean: bool) -> tuple[_Bodies, np.ndarray]:
    """Bodies for `_carry`, and which of the states (q, v) each of theirs is.

    Args:
        mean: forces are constant between two instants, not linear.
    """
    M = len(contacts.stiffness)
    starts = [0]
    flows = []
    parts: tuple[list[np.ndarray], ...] = ([], [], [])
    modes = []
    order = []
    for group, (E, G0, G1) in group_steps(
        contacts.stiffness, contacts.damping, contacts.groups, dt, mean
    ):
        starts.append(starts[-1] + len(group))
        flows.append(E.ravel())
        push = -contacts.push[group]
        for part, found in zip(parts, (G0 @ push, E @ (G1 @ push), G1 @ push), strict=True):
            part.append(found)
        modes.append(group)
        order.extend([group, M + group])
    new, old, ended = (np.concatenate(part) for part in parts)
    by_group = np.concatenate(modes)
    reading = np.ascontiguousarray(contacts.reading[:, by_group])
    states = np.concatenate(order)
    displaced = np.empty((M, contacts.push.shape[1]))
    # rows of the displacements among the states
    displaced[states[states < M]] = ended[states < M]
    moved = contacts.reading @ displaced
    bodies = _Bodies(
        np.array(starts),
        np.concatenate(flows),
        old + new,
        old,
        new,
        ended,
        reading,
        np.ascontiguousarray(contacts.flexibility),
        moved,
        contacts.force,
    )
    return bodies, states


@njit(**KERNEL)
def _carry(bodies, nodes, acts, steps):
    """(2M+m, 2M+m) map, states in the order of the groups; zero for forces that are none.

    The state between two steps is kept without the forces after the first one, which act in
    ``carried`` together with those before the second. The two differ where a node changes its state
    inside a step. An open node has no force, and its motion is not asked for: what is kept of
    forces F and displacements W are the rows of the nodes that act.

    Args:
        acts: (S, n) whether a node has a force after each step.
    """
    S, _n, d, _ = nodes.before.shape
    node_of = _nodes_of_forces(bodies.force, d, bodies.carried.shape[1])
    acting = _forces_of(bodies.force, d, acts[0])
    begun = acting
    rows = _rows_of(d, acts[0], acts[1 % S])
    carried = _columns(bodies.carried, acting)
    reading = _rows(bodies.reading, rows)
    X, F = _unit_disturbances(bodies, nodes.share[0], node_of, acting)
    next_X = np.empty_like(X)
    Q = np.empty((bodies.reading.shape[1], X.shape[1]), X.dtype)
    flexible = _flexibility(bodies, nodes.share[0], node_of, rows, acting)
    inverse = np.empty((0, 0), X.dtype)
    _displacements(bodies.starts, X, Q)
    W = _product(reading, Q)
    _take_product(flexible, F, W)
    for k in range(1, steps + 1):
        j = k % S
        last = k - 1
        _free_step(bodies, X, next_X)
        X, next_X = next_X, X
        _add_matrix(_product(carried, F), X)
        shares = nodes.share[last], nodes.share[j]
        _changed_forces(bodies, shares, node_of, acting, F, X)
        _displacements(bodies.starts, X, Q)
        before = acting, rows, F, W
        # copies of what acts are kept while that stays
        changed = _differ(nodes, j, last) or k == 1
        if not np.array_equal(acts[j], acts[last]):
            acting = _forces_of(bodies.force, d, acts[j])
            carried = _columns(bodies.carried, acting)
            changed = True
        following = _rows_of(d, acts[j], acts[(j + 1) % S])
        if not np.array_equal(following, rows):
            rows = following
            reading = _rows(bodies.reading, rows)
            changed = True
        free = _product(reading, Q)
        rhs = _known_forces(bodies.force, nodes, j, before, acting, rows, free)
        if changed:
            flexible = _flexibility(bodies, nodes.share[j], node_of, rows, acting)
            B = nodes.after_motion[j]
            inverse = _inverse_of_contact(B, bodies.force, rows, acting, flexible)
        F = _product(inverse, rhs)
        _take_product(flexible, F, free)
        W = free
    return _whole_map(bodies, nodes.share[steps % S], node_of, begun, acting, X, F)


@njit(**INNER_KERNEL)
def _forces_of(force, d, acts):
    """Numbers of the forces of the nodes that act."""
    found = np.empty(len(force), np.int64)
    count = 0
    for row in range(len(force)):
        if force[row] >= 0 and acts[row // d]:
            found[count] = force[row]
            count += 1
    return found[:count]


@njit(**INNER_KERNEL)
def _rows_of(d, acts, acts_next):
    """Numbers of the displacements of the nodes that act after a step or the next one."""
    found = np.empty(d * len(acts), np.int64)
    count = 0
    for row in range(len(found)):
        if acts[row // d] or acts_next[row // d]:
            found[count] = row
            count += 1
    return found[:count]


@njit(**INNER_KERNEL)
def _places(numbers, size):
    """(size,) place of each number, -1 where it is none of them."""
    place = np.full(size, -1)
    for i in range(len(numbers)):
        place[numbers[i]] = i
    return place


@njit(**INNER_KERNEL)
def _nodes_of_forces(force, d, m):
    """(m,) node of each force."""
    node_of = np.zeros(m, dtype=np.int64)
    for row in range(len(force)):
        if force[row] >= 0:
            node_of[force[row]] = row // d
    return node_of


@njit(**INNER_KERNEL)
def _unit_disturbances(bodies, share, node_of, acting):
    """Each state and each acting force disturbed by one: states (2M, 2M+k) without the forces after
    the step, and forces (k, 2M+k).
    """
    states = bodies.ended.shape[0]
    size = states + len(acting)
    X = np.zeros((states, size), bodies.ended.dtype)
    F = np.zeros((len(acting), size), bodies.ended.dtype)
    for i in range(states):
        X[i, i] = 1.0
    for c in range(len(acting)):
        F[c, states + c] = 1.0
        weight = 2.0 * (1.0 - share[node_of[acting[c]]])
        for i in range(states):
            X[i, states + c] = -weight * bodies.ended[i, acting[c]]
    return X, F


@njit(**INNER_KERNEL)
def _whole_map(bodies, share, node_of, begun, acting, X, F):
    """(2M+m, 2M+m) from the states X (2M, 2M+k) without the forces F (l, 2M+k) after the last step.

    Args:
        begun: (k,) forces that were disturbed; acting: (l,) forces after the last step.
    """
    states, m = bodies.ended.shape
    for c in range(len(acting)):
        weight = 2.0 * (1.0 - share[node_of[acting[c]]])
        for i in range(states):
            _add_row(weight * bodies.ended[i, acting[c]], F[c], X[i])
    full = np.zeros((states + m, states + m), X.dtype)
    for c in range(X.shape[1]):
        column = c if c < states else states + begun[c - states]
        for i in range(states):
            full[i, column] = X[i, c]
        for i in range(len(acting)):
            full[states + acting[i], column] = F[i, c]
    return full


@njit(**INNER_KERNEL)
def _free_step(bodies, X, target):
    """target (2M, k) becomes E X, group by group."""
    first = 0
    for g in range(len(bodies.starts) - 1):
        start = 2 * bodies.starts[g]
        end = 2 * bodies.starts[g + 1]
        b = end - start
        E = bodies.flow[first : first + b * b].reshape((b, b))
        first += b * b
        if b > 2 * SMALL_GROUP:
            np.dot(E, X[start:end], out=target[start:end])
            continue
        for i in range(b):
            for c in range(X.shape[1]):
                target[start + i, c] = E[i, 0] * X[start, c]
            for k in range(1, b):
                _add_row(E[i, k], X[start + k], target[start + i])


@njit(**INNER_KERNEL)
def _displacements(starts, X, Q):
    """Q (M, k) becomes the displacements among the states X (2M, k)."""
    for g in range(len(starts) - 1):
        for i in range(starts[g], starts[g + 1]):
            for c in range(X.shape[1]):
                Q[i, c] = X[starts[g] + i, c]


@njit(**INNER_KERNEL)
def _changed_forces(bodies, shares, node_of, acting, F, X):
    """Add to the states what forces of nodes that change inside a step do more than for half of it.

    Args:
        shares: (n,) of the step before, and of this one.
    """
    before, after = shares
    for c in range(len(acting)):
        own = acting[c]
        more_before = 1.0 - 2.0 * before[node_of[own]]
        more_after = 2.0 * after[node_of[own]] - 1.0
        if more_before != 0.0 or more_after != 0.0:
            for i in range(X.shape[0]):
                weight = more_before * bodies.old[i, own] + more_after * bodies.new[i, own]
                _add_row(weight, F[c], X[i])


@njit(**INNER_KERNEL)
def _known_forces(force, nodes, j, before, acting, rows, free):
    """(k, 2M+...) what the forces after a step do not decide themselves.

    Args:
        before: forces that acted, rows, forces and displacements before the step.
        acting: (k,) forces after it; rows: of the displacements ``free``.
    """
    acted, known_rows, F, W = before
    d = nodes.before.shape[2]
    force_before = _places(acted, len(force))
    row_before = _places(known_rows, len(force))
    row_now = _places(rows, len(force))
    place = _places(acting, len(force))
    rhs = np.zeros((len(acting), free.shape[1]), free.dtype)
    for row in range(len(force)):
        own = force[row]
        if own < 0 or place[own] < 0:
            continue
        target = rhs[place[own]]
        i = row // d
        a = row - i * d
        for b in range(d):
            other = i * d + b
            if force[other] >= 0 and force_before[force[other]] >= 0:
                _add_row(nodes.before[j, i, a, b], F[force_before[force[other]]], target)
            _add_row(nodes.after_motion[j, i, a, b], free[row_now[other]], target)
            _add_row(nodes.before_motion[j, i, a, b], W[row_before[other]], target)
    return rhs


@njit(**INNER_KERNEL)
def _flexibility(bodies, share, node_of, rows, acting):
    """(l, k) displacements of rows at the end of a step for the acting forces after it."""
    flexible = np.empty((len(rows), len(acting)), bodies.flexibility.dtype)
    for c in range(len(acting)):
        own = acting[c]
        weight = 2.0 * (1.0 - share[node_of[own]])
        for i in range(len(rows)):
            row = rows[i]
            flexible[i, c] = bodies.flexibility[row, own] - weight * bodies.moved[row, own]
    return flexible


@njit(**INNER_KERNEL)
def _inverse_of_contact(B, force, rows, acting, flexible):
    """(k, k) inverse of 1 + B times the flexibility, for node blocks B (n, d, d), found in double
    precision.
    """
    d = B.shape[1]
    place = _places(acting, len(force))
    row_now = _places(rows, len(force))
    matrix = np.eye(len(acting))
    for row in range(len(force)):
        if force[row] >= 0 and place[force[row]] >= 0:
            i = row // d
            target = matrix[place[force[row]]]
            for b in range(d):
                _add_row(B[i, row - i * d, b], flexible[row_now[i * d + b]], target)
    inverse = np.empty(matrix.shape, flexible.dtype)
    if len(acting):
        copy_matrix(np.linalg.inv(matrix), inverse)
    return inverse


@njit(**INNER_KERNEL)
def _rows(matrix, numbers):
    """(k, m) some rows of a matrix."""
    chosen = np.empty((len(numbers), matrix.shape[1]), matrix.dtype)
    for i in range(len(numbers)):
        chosen[i] = matrix[numbers[i]]
    return chosen


@njit(**INNER_KERNEL)
def _columns(matrix, numbers):
    """(n, k) some columns of a matrix."""
    chosen = np.empty((matrix.shape[0], len(numbers)), matrix.dtype)
    for c in range(len(numbers)):
        for i in range(matrix.shape[0]):
            chosen[i, c] = matrix[i, numbers[c]]
    return chosen


@njit(**INNER_KERNEL)
def _take_product(matrix, X, target):
    """target becomes target - matrix X."""
    product = _product(matrix, X)
    for i in range(target.shape[0]):
        for c in range(target.shape[1]):
            target[i, c] -= product[i, c]


@njit(**INNER_KERNEL)
def _product(matrix, X):
    """matrix X; zero where there is nothing to sum."""
    out = np.zeros((matrix.shape[0], X.shape[1]), X.dtype)
    if matrix.size and X.size:
        np.dot(matrix, X, out=out)
    return out


@njit(**INNER_KERNEL)
def _differ(nodes, j, last):
    """Whether the derivatives of two steps differ."""
    n, d = nodes.before.shape[1:3]
    for i in range(n):
        if nodes.share[j, i] != nodes.share[last, i]:
            return True
        for a in range(d):
            for b in range(d):
                if nodes.after_motion[j, i, a, b] != nodes.after_motion[last, i, a, b]:
                    return True
    return False


# Sums of matrices by plain loops, see `bladefem.hbm.linear.array_copy`.


@njit(cache=True, error_model="numpy", inline="always")
def _add_matrix(part, target):
    """target (n, k) becomes target + part (n, k)."""
    for i in range(part.shape[0]):
        for j in range(part.shape[1]):
            target[i, j] += part[i, j]


@njit(cache=True, error_model="numpy", inline="always")
def _add_row(factor, row, target):
    """target (k,) becomes target + factor * row (k,)."""
    if factor != 0.0:
        for c in range(target.size):
            target[c] += factor * row[c]

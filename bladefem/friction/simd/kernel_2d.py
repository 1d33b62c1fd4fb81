"""Sampled 2-D elements: harmonics of the periodic force and the exact Jacobian of the periodic
state.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.simd.codegen import zeros
from bladefem.friction.simd.derivative_rows import (
    add_period,
    close_period,
    empty_rows,
    start_rows,
    to_carry,
    unit_rows,
)
from bladefem.friction.simd.periodic_state import (
    REPEAT_TOLERANCE,
    empty_trail,
    follow_period,
    forces_along,
    periodic_force,
    start_force,
)
from bladefem.friction.simd.time_kernels import find_edges
from bladefem.friction.trigonometric_tables import Node, empty_gram, gram_matrix
from bladefem.util.numba_options import INNER_KERNEL, KERNEL

# nodes whose motion and harmonics are one matrix product
NODES_AT_ONCE = 8
# Longest step, over the largest friction limit, by which a linearised period is finished: its
# square is the error of the force, the step itself that of the derivative, which is summed in
# double or in single precision.
STEP_TOLERANCE = 1e-11
STEP_TOLERANCE_SINGLE = 1e-8


@njit(**INNER_KERNEL)
def _paths_at_knots(w, ramp, load, nodes, tab, path):
    """path (n, 3, width) = (kt w_1, kt w_2, N) at the knots [N], with the ramps (n, 2) added, by
    which the motion goes on in each period [m].
    """
    n = w.shape[0]
    S = tab.at.shape[0]
    K = w.shape[2]
    scaled = np.empty((n, 3, K))
    for e in range(n):
        for k in range(K):
            scaled[e, 0, k], scaled[e, 1, k] = nodes[e, 0] * w[e, 1, k], nodes[e, 0] * w[e, 2, k]
            scaled[e, 2, k] = nodes[e, 1] * w[e, 0, k]
        scaled[e, 2, 0] += 0.0 if load.shape[1] else nodes[e, 3]
    np.dot(
        scaled.reshape((3 * n, K)),
        tab.along,
        path.reshape((3 * path.shape[0], path.shape[2]))[: 3 * n],
    )
    for e in range(n):
        for c in range(2):
            step = nodes[e, 0] * ramp[e, c] / S
            if step != 0.0:
                for i in range(path.shape[2]):
                    path[e, c, i] += i * step
    if load.shape[1]:
        for e in range(n):
            for i in range(path.shape[2]):
                path[e, 2, i] += 0.5 * (load[e, i % S] + load[e, i % S - 1])


@njit(_nrt=False, **INNER_KERNEL)
def _load_at_sample(N, load, i):
    """Normal load at sample i from those at the knots N (width,) [N], where prescribed not the mean
    over both knots.
    """
    if load.size == 0:
        return 0.5 * (N[i] + N[i + 1])
    after = load[i + 1 if i + 1 < load.size else 0]
    return 0.5 * (N[i] + N[i + 1]) + 0.25 * (2.0 * load[i] - load[i - 1] - after)


@njit(_nrt=False, **INNER_KERNEL)
def _contact_means(N, load, tab, mean):
    """Basis means (4H+1,) of the samples in contact."""
    S = tab.at.shape[0]
    a = 0
    mean[:] = 0.0
    while a < S:
        b = a
        closed = _load_at_sample(N, load, a) > 0.0
        while b < S and (_load_at_sample(N, load, b) > 0.0) == closed:
            b += 1
        if closed:
            for p in range(mean.size):
                mean[p] += tab.sums[b, p] - tab.sums[a, p]
        a = b


@njit(_nrt=False, **INNER_KERNEL)
def _normal_force(w, load, el, N, least, tab, spare, F, J):
    """Normal force F (K,) and its Jacobian J[0], J (3, K, 3K) or (0, 0, 0); returns the share in
    contact.

    N (width,) is the load at the knots, at least ``least`` [N]; spare is scratch: mean (4H+1,),
    block (K, K), around.
    """
    K = F.size
    for k in range(J.shape[1]):
        for l in range(J.shape[2]):
            J[0, k, l] = 0.0
    if load.size == 0 and least > 0.0:
        for k in range(K):
            F[k] = el.kn * w[k]
        F[0] += el.n0
        for k in range(J.shape[1]):
            J[0, k, k] = el.kn
        return 1.0
    mean, block, around = spare
    _contact_means(N, load, tab, mean)
    gram_matrix(mean, around, block)
    for k in range(K):
        F[k] = 0.0 if load.size else el.n0 * block[k, 0]
        for l in range(K):
            F[k] += el.kn * block[k, l] * w[l]
    for k in range(J.shape[1]):
        for l in range(K):
            J[0, k, l] = el.kn * block[k, l]
    for i in range(load.size):
        if _load_at_sample(N, load, i) > 0.0:
            for k in range(K):
                F[k] += load[i] * tab.analysis[i, k]
    return mean[0]


@njit(_nrt=False, **INNER_KERNEL, fastmath=True)
def _value_range(x):
    """Least and largest of x."""
    least = x[0]
    largest = x[0]
    for i in range(x.size):
        least = x[i] if x[i] < least else least
        largest = x[i] if x[i] > largest else largest
    return least, largest


@njit(_nrt=False, **INNER_KERNEL)
def _within_limit(path, mu):
    """Whether kt w stays within the limit at all knots; if the load lasts all the time, then f = kt
    w.
    """
    beyond = 0
    for i in range(path.shape[1]):
        R = mu * path[2, i]
        beyond += path[0, i] * path[0, i] + path[1, i] * path[1, i] > R * R
    return beyond == 0


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _node_forces(
    w, walks, load, el, path, tab, near, limit, trail, phi, spare, trace, F, J, shares
):
    """Normal force of one node, and its last period as periodic returns it; 0 cycles where it
    sticks or stays open.

    There F (3, K) and J (3, K, 3K) are complete; elsewhere F is missing the harmonics of trace (2,
    width), J the tangents.
    """
    linear = J.shape[0] > 0
    found, (least, largest) = (True, 0.0, 0.0, 0.0, 0.0, 0, 0, 0), _value_range(path[2])
    closed = _normal_force(w[0], load, el, path[2], least, tab, spare, F[0], J)
    if largest > 0.0 and (walks or not (least > 0.0 and _within_limit(path, el.mu))):
        find_edges(path, path.shape[1], el.mu, trail.form)
        found = periodic_force(path, walks, el.mu, largest, near, limit, trail, phi)
        if not linear:
            forces_along(path, el.mu, found[6], trail, trace)
    else:
        _stuck_forces(w, el.kt if largest > 0.0 else 0.0, F, J)
    shares[1] = found[5] / tab.at.shape[0]
    shares[2] = 1.0 - closed
    shares[0] = 1.0 - shares[1] - shares[2]
    return found


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _stuck_forces(w, kt, F, J):
    """Tangential forces of springs kt."""
    K, J[1:] = F.shape[1], 0.0
    for c in range(1, 3):
        for k in range(K):
            F[c, k] = kt * w[c, k]
            if J.shape[0]:
                J[c, k, c * K + k] = kt


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _derivative_rows(path, walks, found, el, tab, trail, scratch, trace, phi, F, J):
    """Rows J (2, K, 3K) of the tangential forces in the state that was found.

    F (3, K) takes what trace (2, width), zero on entry, is missing of the periodic force. A motion
    that walks leaves no memory of the start.
    """
    unique, fx, fy, gx, gy, _, pieces, cycles = found
    if unique or walks:
        unit_rows(el.kt, tab, scratch.C)
        # a literal True would compile add_period twice
        add_period(path, gx, gy, pieces, el, tab, trail, scratch, trace, bool(1))
    else:
        gx, gy = fx, fy = start_force(path[0, 0], path[1, 0], path[2, 0], el.mu)
        start_rows(path[0, 0], path[1, 0], path[2, 0], el, tab, scratch.C)
        for cycle in range(cycles):
            if cycle > 0:
                to_carry(scratch.C, 0, el.kt, tab)
            fx = gx
            fy = gy
            gx, gy, _, _, _, pieces = follow_period(path, el.mu, fx, fy, trail, phi)
            add_period(path, gx, gy, pieces, el, tab, trail, scratch, trace, cycle + 1 == cycles)
    close_period(gx - fx, gy - fy, el.kt, tab, scratch, F, J)


@njit(_nrt=False, **INNER_KERNEL)
def _some_nodes(
    w,
    ramp,
    load,
    nodes,
    path,
    tab,
    near,
    limit,
    trail,
    scratch,
    phi,
    spare,
    trace,
    F,
    J,
    shares,
    cycles,
):
    """disc_batch for some nodes but for the harmonics of trace (n, 2, width); returns whether any
    moves.
    """
    moving = False
    for e in range(w.shape[0]):
        el = Node(nodes[e, 0], nodes[e, 1], nodes[e, 2], nodes[e, 3])
        walks = tab.at.shape[0] if ramp[e, 0] != 0.0 or ramp[e, 1] != 0.0 else 0
        found = _node_forces(
            w[e],
            walks,
            load[e],
            el,
            path[e],
            tab,
            near,
            limit,
            trail,
            phi,
            spare,
            trace[e],
            F[e],
            J[e],
            shares[e],
        )
        if found[7] and J.shape[1]:
            _derivative_rows(
                path[e], walks, found, el, tab, trail, scratch, trace[e], phi, F[e], J[e, 1:]
            )
        cycles[e], moving = found[7] or 1, moving or found[7] != 0
    return moving


@njit(**INNER_KERNEL)
def _add_harmonics(trace, tab, F):
    """Add the harmonics of trace (n, 2, width) to F (n, 3, K)."""
    n = F.shape[0]
    width = trace.shape[2]
    forces = np.dot(trace.reshape((2 * trace.shape[0], width))[: 2 * n], tab.analysis)
    for e in range(n):
        for k in range(F.shape[2]):
            F[e, 1, k] += forces[2 * e, k]
            F[e, 2, k] += forces[2 * e + 1, k]


@njit(**KERNEL)
def disc_batch(w, ramp, load, nodes, tab, patterns, limit, F, J, shares, cycles):
    """Forces F (n, 3, K), Jacobian J (n, 3, K, 3K), shares (n, 3) of stick, slip and separation,
    cycles (n,).

    w (n, 3, K) [m]; ramp (n, 2) by which the tangential motion goes on in each period [m]; load
    (n, S) [N] in place of n0, or (n, 0); nodes (n, 4): kt, kn, mu, n0; patterns in the precision in
    which the derivative is summed. If J is (n, 0, 0, 0), no derivative is made. Cycles are negative
    where the force was not periodic after ``limit``.
    """
    n = w.shape[0]
    width = tab.along.shape[1]
    path = zeros(3 * NODES_AT_ONCE * width, np.float64).reshape((NODES_AT_ONCE, 3, width))
    trace = zeros(2 * NODES_AT_ONCE * width, np.float64).reshape((NODES_AT_ONCE, 2, width))
    phi = np.empty((2, 2))
    spare = (
        np.empty(tab.sums.shape[1]),
        np.empty((w.shape[2], w.shape[2])),
        empty_gram(w.shape[2] // 2),
    )
    near = (
        (STEP_TOLERANCE if patterns.at.itemsize == 8 else STEP_TOLERANCE_SINGLE)
        if J.shape[1]
        else REPEAT_TOLERANCE
    )
    trail, scratch, F[:] = empty_trail(tab.at.shape[0], width), empty_rows(tab, patterns), 0.0
    for first in range(0, n, NODES_AT_ONCE):
        last = min(first + NODES_AT_ONCE, n)
        some = slice(first, last)
        _paths_at_knots(w[some], ramp[some], load[some], nodes[some], tab, path)
        trace[:] = 0.0
        if _some_nodes(
            w[first:last],
            ramp[first:last],
            load[first:last],
            nodes[first:last],
            path,
            tab,
            near,
            limit,
            trail,
            scratch,
            phi,
            spare,
            trace,
            F[first:last],
            J[first:last],
            shares[first:last],
            cycles[first:last],
        ):
            _add_harmonics(trace, tab, F[first:last])

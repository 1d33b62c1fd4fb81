"""Sampled 2-D elements: harmonics of the periodic force and the exact Jacobian of the periodic state."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from bladefem.friction.disc_rows import add_period, close, empty_rows, start_rows, to_carry, unit_rows
from bladefem.friction.lane_kernels import find_edges, find_forces
from bladefem.friction.orbit import TOLERANCE, empty_trail, follow, periodic, start
from bladefem.friction.tables import Node, add_gram

__all__ = ["disc_batch"]

NODES = 8           # whose motion and harmonics are one matrix product
EXACT = 1e-11       # of the largest limit: longest step by which a linearised period is finished


@njit(cache=True, error_model="numpy")
def _paths(w, load, nodes, tab, path):
    """path (n, 3, width) = (kt w_1, kt w_2, N) at the knots [N]."""
    n, S, K = w.shape[0], tab.at.shape[0], w.shape[2]
    scaled = np.empty((n, 3, K))
    for e in range(n):
        for k in range(K):
            scaled[e, 0, k], scaled[e, 1, k] = nodes[e, 0] * w[e, 1, k], nodes[e, 0] * w[e, 2, k]
            scaled[e, 2, k] = nodes[e, 1] * w[e, 0, k]
        scaled[e, 2, 0] += 0.0 if load.shape[1] else nodes[e, 3]
    np.dot(scaled.reshape((3 * n, K)), tab.along, path.reshape((3 * path.shape[0], path.shape[2]))[:3 * n])
    if load.shape[1]:
        for e in range(n):
            for i in range(path.shape[2]):
                path[e, 2, i] += 0.5 * (load[e, i % S] + load[e, i % S - 1])


@njit(_nrt=False, cache=True, error_model="numpy")
def _load(N, load, i):
    """Normal load at sample i from those at the knots N (width,) [N], where prescribed not the mean over both knots."""
    if load.size == 0:
        return 0.5 * (N[i] + N[i + 1])
    after = load[i + 1 if i + 1 < load.size else 0]
    return 0.5 * (N[i] + N[i + 1]) + 0.25 * (2.0 * load[i] - load[i - 1] - after)


@njit(_nrt=False, cache=True, error_model="numpy")
def _contact(N, load, tab, mean):
    """Basis means (4H+1,) of the samples in contact."""
    S, a = tab.at.shape[0], 0
    mean[:] = 0.0
    while a < S:
        b, closed = a, _load(N, load, a) > 0.0
        while b < S and (_load(N, load, b) > 0.0) == closed:
            b += 1
        if closed:
            for p in range(mean.size):
                mean[p] += tab.sums[b, p] - tab.sums[a, p]
        a = b


@njit(_nrt=False, cache=True, error_model="numpy")
def _normal(w, load, el, N, least, tab, mean, block, F, J):
    """Normal force F (K,) and its Jacobian J (K, K) or (0, 0); returns the share of the samples in contact.

    N (width,) is the load at the knots, at least ``least`` [N]; mean (4H+1,) and block (K, K) are scratch.
    """
    K = F.size
    if load.size == 0 and least > 0.0:
        for k in range(K):
            F[k] = el.kn * w[k]
        F[0] += el.n0
        for k in range(J.shape[0]):
            J[k, k] = el.kn
        return 1.0
    _contact(N, load, tab, mean)
    block[:, :] = 0.0
    add_gram(1.0, mean, block)
    for k in range(K):
        F[k] = 0.0 if load.size else el.n0 * block[k, 0]
        for l in range(K):
            F[k] += el.kn * block[k, l] * w[l]
    for k in range(J.shape[0]):
        for l in range(K):
            J[k, l] = el.kn * block[k, l]
    for i in range(load.size):
        if _load(N, load, i) > 0.0:
            for k in range(K):
                F[k] += load[i] * tab.analysis[i, k]
    return mean[0]


@njit(_nrt=False, cache=True, error_model="numpy", fastmath=True)
def _range(x):
    """Least and largest of x."""
    least, largest = x[0], x[0]
    for i in range(x.size):
        least = x[i] if x[i] < least else least
        largest = x[i] if x[i] > largest else largest
    return least, largest


@njit(_nrt=False, cache=True, error_model="numpy")
def _within(path, mu):
    """Whether kt w stays within the limit at all knots; if the load lasts all the time, then f = kt w."""
    beyond = 0
    for i in range(path.shape[1]):
        R = mu * path[2, i]
        beyond += path[0, i] * path[0, i] + path[1, i] * path[1, i] > R * R
    return beyond == 0


@njit(_nrt=False, cache=True, error_model="numpy")
def _march(path, el, largest, tab, limit, trail, scratch, normal, trace, phi, linear):
    """Periodic force by marching from kt w, reproducible where it is not unique, with its rows: (slips, cycles).

    Cycles are negative if it is not periodic after ``limit``.
    """
    fx, fy = start(path[0, 0], path[1, 0], path[2, 0], el.mu)
    scale, slips, cycle, done = el.mu * largest, 0, 0, False
    if linear:
        start_rows(path[0, 0], path[1, 0], path[2, 0], el, tab, scratch.C)
    while not done and cycle < limit:
        gx, gy, events, _, slips, pieces = follow(path, el.mu, fx, fy, trail, trace, phi)
        done = events == 0 or sqrt((gx - fx) ** 2 + (gy - fy) ** 2) <= TOLERANCE * scale
        if linear:
            if cycle > 0:
                to_carry(scratch.C, 0, el.kt, tab)
            add_period(path, gx, gy, pieces, el, tab, trail, scratch, normal, trace, done or cycle + 1 == limit)
        fx, fy, cycle = gx, gy, cycle + 1
    return slips, cycle if done else -cycle


@njit(_nrt=False, cache=True, error_model="numpy")
def _tangential(path, el, largest, tab, limit, trail, scratch, normal, trace, phi, F, J):
    """Rows of the periodic tangential force in J (3, K, 3K), normal (2, width) and trace (2, width): (slips, cycles).

    Cycles are negative if it is not periodic. F (3, K) takes what trace lacks of the periodic force.
    """
    rx, ry = 0.0, 0.0
    unique, fx, fy, gx, gy, slips, pieces, cycles = periodic(path, el.mu, largest, EXACT, limit, trail, trace, phi)
    if unique:
        rx, ry = gx - fx, gy - fy
        unit_rows(el.kt, tab, scratch.C)
        add_period(path, gx, gy, pieces, el, tab, trail, scratch, normal, trace, True)
    else:
        slips, cycles = _march(path, el, largest, tab, limit, trail, scratch, normal, trace, phi, True)
    close(rx, ry, scratch, F, J[1:])
    return slips, cycles


@njit(_nrt=False, cache=True, error_model="numpy")
def _force_only(path, el, largest, tab, limit, trail, scratch, trace, phi):
    """Periodic tangential force at the samples, trace (2, width) [N]: (slips, cycles, negative if not periodic)."""
    unique, _, _, _, _, slips, _, cycles = periodic(path, el.mu, largest, TOLERANCE, limit, trail, trace, phi)
    if not unique:
        slips, cycles = _march(path, el, largest, tab, limit, trail, scratch, trace, trace, phi, False)
    find_forces(path, trail.form, trail.knots, trail.slips, path.shape[1], el.mu, trace)
    return slips, cycles


@njit(_nrt=False, cache=True, error_model="numpy")
def _node(w, load, el, path, tab, limit, trail, scratch, spare, normal, trace, F, J, shares):
    """Cycles of one node; F (3, K) and J (3, K, 3K) lack what the harmonics of trace and normal (2, width) give.

    Cycles are 0 where these are none, since it sticks or stays open.
    """
    K, linear, cycles, slips, (mean, block, phi) = F.shape[1], J.shape[0] > 0, 0, 0, spare
    least, largest = _range(path[2])
    closed = _normal(w[0], load, el, path[2], least, tab, mean, block, F[0], J[0, :, :K] if linear else J[:, :, 0])
    if least > 0.0 and _within(path, el.mu):
        for c in range(1, 3):
            for k in range(K):
                F[c, k] = el.kt * w[c, k]
                if linear:
                    J[c, k, c * K + k] = el.kt
    elif largest > 0.0:
        find_edges(path, path.shape[1], el.mu, trail.form)
        if linear:
            slips, cycles = _tangential(path, el, largest, tab, limit, trail, scratch, normal, trace, phi, F, J)
            for c in range(1, 3):
                add_gram(el.kt, scratch.stick, J[c, :, c * K:(c + 1) * K])
        else:
            slips, cycles = _force_only(path, el, largest, tab, limit, trail, scratch, trace, phi)
    shares[1] = slips / tab.at.shape[0]
    shares[2] = 1.0 - closed
    shares[0] = 1.0 - shares[1] - shares[2]
    return cycles


@njit(cache=True, error_model="numpy")
def _harmonics(trace, normal, tab, F, J):
    """Add the harmonics of trace (n, 2, width) to F (n, 3, K), and the rows n p_0 of normal (n, 2, width) to J."""
    n, width, K = F.shape[0], trace.shape[2], F.shape[2]
    forces = np.dot(trace.reshape((2 * trace.shape[0], width))[:2 * n], tab.analysis)
    for e in range(n):
        for k in range(K):
            F[e, 1, k] += forces[2 * e, k]
            F[e, 2, k] += forces[2 * e + 1, k]
    if J.shape[1]:
        means = np.dot(normal.reshape((2 * trace.shape[0], width))[:2 * n], tab.means)
        for e in range(n):
            for c in range(2):
                add_gram(1.0, means[2 * e + c], J[e, 1 + c, :, :K])


@njit(cache=True, error_model="numpy")
def disc_batch(w, load, nodes, tab, limit, F, J, shares, cycles):
    """Forces F (n, 3, K), Jacobian J (n, 3, K, 3K), shares (n, 3) of stick, slip and separation, cycles (n,).

    w (n, 3, K) [m]; load (n, S) [N] in place of n0, or (n, 0); nodes (n, 4): kt, kn, mu, n0. J holds zeros, or is
    (n, 0, 0, 0): then no derivative is made. Cycles are negative where the force was not periodic after ``limit``.
    """
    n, width = w.shape[0], tab.along.shape[1]
    path, trace, normal = np.empty((NODES, 3, width)), np.empty((NODES, 2, width)), np.empty((NODES, 2, width))
    spare = np.empty(tab.sums.shape[1]), np.empty((w.shape[2], w.shape[2])), np.empty((2, 2))
    trail, scratch, F[:] = empty_trail(tab.at.shape[0], width), empty_rows(tab), 0.0
    for first in range(0, n, NODES):
        last, moving = min(first + NODES, n), False
        _paths(w[first:last], load[first:last], nodes[first:last], tab, path)
        trace[:], normal[:] = 0.0, 0.0
        for e in range(first, last):
            el, q = Node(nodes[e, 0], nodes[e, 1], nodes[e, 2], nodes[e, 3]), e - first
            marched = _node(w[e], load[e], el, path[q], tab, limit, trail, scratch, spare, normal[q], trace[q], F[e],
                            J[e], shares[e])
            cycles[e], moving = marched if marched else 1, moving or marched != 0
        if moving:
            _harmonics(trace, normal, tab, F[first:last], J[first:last])

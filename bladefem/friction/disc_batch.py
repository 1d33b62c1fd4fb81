"""Sampled 2-D elements: harmonics of the periodic force and the exact Jacobian of the periodic state."""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.disc_rows import close, linear_period, start_rows, to_carry
from bladefem.friction.orbit import EDGE_ROWS, TOLERANCE, edges, march, period, periodic, record, start
from bladefem.friction.tables import Node, gram, values

__all__ = ["disc_batch"]

NEAR = 1e-8         # of the largest limit: marching stops and one linearised period finishes
EXACT = 1e-7        # of the largest limit: longest step of that period, whose error is of the order of its square
SINGULAR = 1e-6     # of det(I - Phi): below it the state keeps a memory of its start


@njit(cache=True, error_model="numpy")
def _loads(w, load, el, tab, Ns, N):
    """Normal load at the samples Ns (S,) and at the knots N (S,) half a step before them [N]; returns the least Ns."""
    S = N.size
    values(tab.knots_transposed, w, el.kn, 0.0 if load.size else el.n0, N)
    for i in range(S - 1):
        Ns[i] = 0.5 * (N[i] + N[i + 1])
    Ns[S - 1] = 0.5 * (N[S - 1] + N[0])
    if load.size:
        Ns += load
        for i in range(S):
            N[i] += 0.5 * (load[i] + load[i - 1])
    least = Ns[0]
    for i in range(S):
        least = min(least, Ns[i])
    return least


@njit(cache=True, error_model="numpy")
def _contact(Ns, tab, mean):
    """Add the basis means (4H+1,) of the samples in contact."""
    S, a = Ns.size, 0
    while a < S:
        b = a
        while b < S and (Ns[b] > 0.0) == (Ns[a] > 0.0):
            b += 1
        if Ns[a] > 0.0:
            mean += tab.sums[b] - tab.sums[a]
        a = b


@njit(cache=True, error_model="numpy")
def _normal(w, load, el, Ns, tab, mean, F, J):
    """Normal force F (K,), its Jacobian J (K, 3K) or (0, 0), with the basis means (4H+1,) of the samples in contact."""
    S, K = tab.at.shape
    block = np.empty((K, K))
    gram(mean, block)
    for k in range(K):
        F[k] = 0.0 if load.size else el.n0 * block[k, 0]
        for l in range(K):
            F[k] += el.kn * block[k, l] * w[l]
            if J.size:
                J[k, l] = el.kn * block[k, l]
    for i in range(load.size):
        if Ns[i] > 0.0:
            for k in range(K):
                F[k] += load[i] * tab.at[i, k] / S * (1.0 if k == 0 else 2.0)


@njit(cache=True, error_model="numpy")
def _always_stuck(path, mu):
    """Whether kt w stays within the limit at all knots, under load all the time: then f = kt w."""
    for i in range(path.shape[1]):
        R = mu * path[2, i]
        if path[2, i] <= 0.0 or path[0, i] ** 2 + path[1, i] ** 2 > R * R:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _add_stick(w, kt, mean, F, J):
    """Add kt w over the set with basis means ``mean`` to both tangential directions."""
    K = w.shape[1]
    block = np.empty((K, K))
    gram(mean, block)
    for c in range(1, 3):
        for k in range(K):
            for l in range(K):
                F[c, k] += kt * block[k, l] * w[c, l]
                if J.size:
                    J[c, k, c * K + l] += kt * block[k, l]


@njit(cache=True, error_model="numpy")
def _implicit(path, fx, fy, el, tab, form, C, sums):
    """One linearised period from near the periodic state, which it finishes: (usable, missing fx, fy, slips).

    Not usable where the state keeps a memory of its start, or where the linearised step is too long to be exact.
    """
    K = tab.at.shape[1]
    _clear(sums)
    C[:] = 0.0
    C[0, 3 * K] = C[1, 3 * K + 1] = 1.0
    to_carry(C, 0, el.kt, tab.knots)
    ex, ey, slips = linear_period(path, fx, fy, el, tab, form, C, sums)
    a, b, c, d = 1.0 - C[0, 3 * K], -C[0, 3 * K + 1], -C[1, 3 * K], 1.0 - C[1, 3 * K + 1]
    det, rx, ry = a * d - b * c, ex - fx, ey - fy
    if abs(det) < SINGULAR:
        return False, rx, ry, slips
    step = np.hypot(d * rx - b * ry, a * ry - c * rx) / abs(det)
    return step <= EXACT * el.mu * path[2].max(), rx, ry, slips


@njit(cache=True, error_model="numpy")
def _remembered(path, count, el, tab, form, C, sums):
    """Slips of a state that keeps a memory of its start, after carrying its derivative through ``count`` periods."""
    fx, fy = start(path[0, 0], path[1, 0], path[2, 0], el.mu)
    start_rows(path[0, 0], path[1, 0], path[2, 0], el, tab.knots, C)
    slips = 0
    for cycle in range(count):
        if cycle > 0:
            to_carry(C, 0, el.kt, tab.knots)
        _clear(sums)
        fx, fy, slips = linear_period(path, fx, fy, el, tab, form, C, sums)
    return slips


@njit(cache=True, error_model="numpy")
def _keeps_memory(phi):
    """Whether the period map, derivative phi (2, 2), leaves a part of its start as it was."""
    return abs((1.0 - phi[0, 0]) * (1.0 - phi[1, 1]) - phi[0, 1] * phi[1, 0]) < SINGULAR


@njit(cache=True, error_model="numpy")
def _marched(path, el, limit, phi):
    """Periodic force by marching alone from the start: (fx, fy, cycles, done, False); not unique, but reproducible."""
    fx, fy = start(path[0, 0], path[1, 0], path[2, 0], el.mu)
    fx, fy, count, done, _ = periodic(path, el.mu, fx, fy, False, limit, phi)
    return fx, fy, count, done, False


@njit(cache=True, error_model="numpy")
def _settle(path, el, limit, fx, fy, phi):
    """Periodic force by Newton from (fx, fy), or by marching where it is not unique: (fx, fy, cycles, done, unique)."""
    fx, fy, count, done, _ = periodic(path, el.mu, fx, fy, True, limit, phi)
    if _keeps_memory(phi):
        return _marched(path, el, limit, phi)
    _, _, events = period(path, el.mu, fx, fy, phi)
    if events == 0 or _keeps_memory(phi):
        return _marched(path, el, limit, phi)
    return fx, fy, count, done, True


@njit(cache=True, error_model="numpy")
def _tangential(path, el, tab, limit, form, C, sums, F, J):
    """Offsets and slip parts of the periodic tangential force; returns (cycles, negative if not periodic; slips)."""
    K, phi, scale = tab.at.shape[1], np.empty((2, 2)), el.mu * path[2].max()
    fx, fy = start(path[0, 0], path[1, 0], path[2, 0], el.mu)
    before = np.inf
    for cycle in range(1, 16):
        gx, gy, events, memory = march(path, el.mu, form, fx, fy)
        change = np.hypot(gx - fx, gy - fy)
        fx, fy = gx, gy
        if events == 0:
            slips = _remembered(path, cycle, el, tab, form, C, sums)
            close(C, K, 0.0, 0.0, sums, F, J)
            return cycle, slips
        if min(change, 2.0 * memory * scale) <= NEAR * scale:
            usable, rx, ry, slips = _implicit(path, fx, fy, el, tab, form, C, sums)
            if usable:
                close(C, K, rx, ry, sums, F, J)
                return cycle + 1, slips
            break
        if cycle > 2 and change > 0.1 * before:     # marching is slow here: Newton
            break
        before = change
    fx, fy, count, done, unique = _settle(path, el, limit, fx, fy, phi)
    rx, ry = 0.0, 0.0
    if unique:
        unique, rx, ry, slips = _implicit(path, fx, fy, el, tab, form, C, sums)
        if not unique:
            fx, fy, count, done, unique = _marched(path, el, limit, phi)
    if not unique:
        slips = _remembered(path, count, el, tab, form, C, sums)
        rx = ry = 0.0
    close(C, K, rx, ry, sums, F, J)
    return (count if done else -count), slips


@njit(cache=True, error_model="numpy")
def _force_only(path, el, tab, limit, form, trace, F):
    """Tangential harmonics F (3, K) of the periodic force without a derivative; trace (2, S) is scratch."""
    phi, scale = np.empty((2, 2)), el.mu * path[2].max()
    fx, fy = start(path[0, 0], path[1, 0], path[2, 0], el.mu)
    count, done, before, change = 0, False, np.inf, 0.0
    while not done and (count < 3 or change <= 0.1 * before):
        before = change
        gx, gy, events, memory = march(path, el.mu, form, fx, fy)
        change = np.hypot(gx - fx, gy - fy)
        done = events == 0 or min(change, 2.0 * memory * scale) <= TOLERANCE * scale
        fx, fy, count = gx, gy, count + 1
    if not done:
        fx, fy, count, done, _ = _settle(path, el, limit, fx, fy, phi)
    slips = record(path, el.mu, form, fx, fy, trace)
    np.dot(trace, tab.analysis, F[1:])
    return (count if done else -count), slips


@njit(cache=True, error_model="numpy")
def _clear(sums):
    sums.J[:], sums.stick[:] = 0.0, 0.0


@njit(cache=True, error_model="numpy")
def disc_batch(w, load, nodes, tab, sums, limit, F, J, shares, cycles):
    """Forces F (n, 3, K), Jacobian J (n, 3, K, 3K), shares (n, 3) of stick, slip and separation, cycles (n,).

    w (n, 3, K) [m]; load (n, S) [N] in place of n0, or (n, 0); nodes (n, 4): kt, kn, mu, n0; sums is scratch. J may be
    (n, 0, 0, 0): then no derivative is made. Cycles are negative where the force was not periodic after ``limit``.
    """
    n, S, linear = w.shape[0], tab.at.shape[0], J.shape[1] > 0
    path, Ns, form, trace = np.empty((3, S)), np.empty(S), np.empty((EDGE_ROWS, S)), np.empty((2, S))
    contact, C = np.empty(tab.sums.shape[1]), np.empty((2, sums.row.size))
    for e in range(n):
        el = Node(nodes[e, 0], nodes[e, 1], nodes[e, 2], nodes[e, 3])
        values(tab.knots_transposed, w[e, 1], el.kt, 0.0, path[0])
        values(tab.knots_transposed, w[e, 2], el.kt, 0.0, path[1])
        F[e], J[e], contact[:], slips = 0.0, 0.0, 0.0, 0
        if _loads(w[e, 0], load[e], el, tab, Ns, path[2]) > 0.0:
            contact += tab.sums[S]
        else:
            _contact(Ns, tab, contact)
        _normal(w[e, 0], load[e], el, Ns, tab, contact, F[e, 0], J[e, 0] if linear else J[e].reshape((0, 0)))
        sums.stick[:] = 0.0
        cycles[e] = 1
        if _always_stuck(path, el.mu):
            sums.stick[:] = tab.sums[S]
        elif path[2].max() > 0.0:
            edges(path, el.mu, form)
            if linear:
                cycles[e], slips = _tangential(path, el, tab, limit, form, C, sums, F[e], J[e])
            else:
                cycles[e], slips = _force_only(path, el, tab, limit, form, trace, F[e])
        _add_stick(w[e], el.kt, sums.stick, F[e], J[e])
        shares[e, 1] = slips / S
        shares[e, 2] = 1.0 - contact[0]
        shares[e, 0] = 1.0 - shares[e, 1] - shares[e, 2]

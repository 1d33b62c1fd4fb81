"""Sampled 2-D elements: harmonics of the periodic force and the exact Jacobian of the periodic state."""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.disc_rows import close, linear_period, start_rows, to_carry
from bladefem.friction.orbit import periodic, start
from bladefem.friction.tables import Node, gram, values

__all__ = ["disc_batch"]


@njit(cache=True)
def _loads(w, load, el, tab, Ns, N):
    """Normal load at the samples Ns (S,) and at the knots N (S,) half a step before them [N]."""
    values(tab.transposed, w, el.kn, Ns)
    values(tab.knots_transposed, w, el.kn, N)
    if load.size == 0:
        Ns += el.n0
        N += el.n0
        return
    Ns += load
    for i in range(N.size):
        N[i] += 0.5 * (load[i] + load[i - 1])


@njit(cache=True)
def _normal(w, load, el, Ns, tab, mean, F, J):
    """Normal force F (K,), its Jacobian J (K, 3K) and the basis means (4H+1,) of the samples in contact."""
    S, K = tab.at.shape
    a = 0
    while a < S:
        b = a
        while b < S and (Ns[b] > 0.0) == (Ns[a] > 0.0):
            b += 1
        if Ns[a] > 0.0:
            mean += tab.sums[b] - tab.sums[a]
        a = b
    block = np.empty((K, K))
    gram(mean, block)
    for k in range(K):
        F[k] = 0.0 if load.size else el.n0 * block[k, 0]
        for l in range(K):
            F[k] += el.kn * block[k, l] * w[l]
            J[k, l] = el.kn * block[k, l]
    for i in range(load.size):
        if Ns[i] > 0.0:
            for k in range(K):
                F[k] += load[i] * tab.at[i, k] / S * (1.0 if k == 0 else 2.0)


@njit(cache=True)
def _stick(w, kt, mean, F, J):
    """Add kt w over the set with basis means ``mean`` to both tangential directions."""
    K = w.shape[1]
    block = np.empty((K, K))
    gram(mean, block)
    for c in range(1, 3):
        for k in range(K):
            for l in range(K):
                F[c, k] += kt * block[k, l] * w[c, l]
                J[c, k, c * K + l] += kt * block[k, l]


@njit(cache=True)
def _tangential(path, el, tab, limit, means, F, J, acc, C, rows):
    """Offsets and slip parts of the periodic tangential force; returns (cycles, negative if not periodic; slips)."""
    vx, vy, N = path
    phi = np.empty((2, 2))
    fx, fy, _, count, done, guesses = periodic(vx, vy, N, el.mu, True, limit, phi)
    memory = abs((1.0 - phi[0, 0]) * (1.0 - phi[1, 1]) - phi[0, 1] * phi[1, 0]) < 1e-9
    if memory and guesses > 0:              # a stuck state is not unique: take the one that marching finds
        fx, fy, _, count, done, guesses = periodic(vx, vy, N, el.mu, False, limit, phi)
    if not memory:
        C[:] = 0.0
        C[0, -2] = C[1, -1] = 1.0
        to_carry(C, 0, el.kt, tab.knots)
    else:                                   # the state keeps a memory of its start: carry the derivative from there
        fx, fy = start(vx[0], vy[0], N[0], el.mu)
        start_rows(vx[0], vy[0], N[0], el, tab.knots, C)
        for _ in range(count - 1):
            fx, fy, _ = linear_period(path, fx, fy, el, tab, C, means, F, acc, rows)
        means[:2], F[1:], acc[:] = 0.0, 0.0, 0.0
    fx, fy, slips = linear_period(path, fx, fy, el, tab, C, means, F, acc, rows)
    close(C, el.kt, tab.knots, acc, J)
    return (count if done else -count), slips


@njit(cache=True)
def disc_batch(w, load, nodes, tab, limit, F, J, shares, cycles):
    """Forces F (n, 3, K), Jacobian J (n, 3, K, 3K), shares (n, 3) of stick, slip and separation, cycles (n,).

    w (n, 3, K) [m]; load (n, S) [N] in place of n0, or (n, 0); nodes (n, 4): kt, kn, mu, n0. Cycles are negative where
    the force was not periodic after ``limit`` cycles.
    """
    n, S, K = w.shape[0], tab.at.shape[0], tab.at.shape[1]
    path, Ns = np.empty((3, S)), np.empty(S)
    means = np.empty((3, tab.sums.shape[1]))
    acc, C, rows = np.empty((2, K, 3 * K + 2)), np.empty((2, 3 * K + 2)), np.empty((3, 3 * K + 2))
    for e in range(n):
        el = Node(nodes[e, 0], nodes[e, 1], nodes[e, 2], nodes[e, 3])
        values(tab.knots_transposed, w[e, 1], el.kt, path[0])
        values(tab.knots_transposed, w[e, 2], el.kt, path[1])
        _loads(w[e, 0], load[e], el, tab, Ns, path[2])
        F[e], J[e], means[:], acc[:] = 0.0, 0.0, 0.0, 0.0
        _normal(w[e, 0], load[e], el, Ns, tab, means[2], F[e, 0], J[e, 0])
        cycles[e], slips = _tangential(path, el, tab, limit, means, F[e], J[e], acc, C, rows)
        _stick(w[e], el.kt, means[0], F[e], J[e])
        shares[e, 1] = slips / S
        shares[e, 2] = 1.0 - means[2, 0]
        shares[e, 0] = 1.0 - shares[e, 1] - shares[e, 2]

"""Sampled 1-D Jenkins elements with varying normal load: states first, then harmonics from the stretches of one state.

The return map f = clamp(f_old + kt dw, -mu N, mu N) over one period is itself a clamp, so that the second period is
the steady state. Within a stretch of stick or slip the force is linear in the coefficients, so that force and
Jacobian follow from trigonometric sums over the stretches; no sum over samples and no running derivative is needed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.tables import Node, gram, values, weighted

__all__ = ["SEPARATED", "SLIP_DOWN", "SLIP_UP", "STICK", "assemble", "jenkins_batch", "march_states", "stretches"]

SEPARATED, STICK, SLIP_UP, SLIP_DOWN = 0, 1, 2, 3


@njit(cache=True, inline="always")
def _advance(f, g0, g1, N0, N1, mu):
    """One step of the return map: (force, state); an element that closes within the step is stretched from there."""
    if N1 <= 0.0:
        return 0.0, SEPARATED
    dg = g1 - g0
    if N0 <= 0.0:
        dg *= N1 / (N1 - N0)
    trial = f + dg
    limit = mu * N1
    if trial > limit:
        return limit, SLIP_UP
    if trial < -limit:
        return -limit, SLIP_DOWN
    return trial, STICK


@njit(cache=True)
def march_states(g, N, mu, state):
    """Fill the states (S,) of the steady period for kt w = g (S,) and normal load N (S,) [N], started from f = g.

    Returns index and sign of the last slip (index -1: none) and whether the steady period has no event at all.
    """
    S = g.size
    last, sign, f = -1, 0.0, g[S - 1]
    limit = mu * max(N[S - 1], 0.0)
    if abs(f) > limit:
        sign = 1.0 if f > 0 else -1.0
        last, f = S - 1, sign * limit
    g0, N0 = g[S - 1], N[S - 1]
    for i in range(S):
        f, state[i] = _advance(f, g0, g[i], N0, N[i], mu)
        g0, N0 = g[i], N[i]
        if state[i] != STICK:
            last, sign = i, 1.0 if state[i] == SLIP_UP else -1.0
    stuck = True
    for i in range(S):          # second period, until it meets the first
        f, code = _advance(f, g0, g[i], N0, N[i], mu)
        g0, N0 = g[i], N[i]
        stuck = stuck and code == STICK
        if code != STICK and code == state[i]:
            break
        state[i] = code
    return last, sign, stuck


@njit(cache=True)
def _origin(i, state, g, N, el, at, rows):
    """Rows (2, K) of d(f - kt w) by normal and tangential coefficients in the stick after event i; f - kt w [N]."""
    S = g.size
    j = (i + 1) % S
    if state[i] != SEPARATED:
        sign = 1.0 if state[i] == SLIP_UP else -1.0
        rows[0] = sign * el.mu * el.kn * at[i]
        rows[1] = -el.kt * at[i]
        return sign * el.mu * N[i] - g[i]
    gap = N[j] - N[i]
    part, dg = N[j] / gap, g[j] - g[i]
    rows[0] = dg * el.kn / gap ** 2 * (N[j] * at[i] - N[i] * at[j])
    rows[1] = -el.kt * (part * at[i] + (1.0 - part) * at[j])
    return part * dg - g[j]


@njit(cache=True)
def _stuck(last, sign, g, N, el, tab, means, F, J):
    """A period without events; a slip of the first period leaves its offset."""
    S = g.size
    means[0] += tab.sums[S]
    means[2] += tab.sums[S]
    if last >= 0:
        F[1, 0] += sign * el.mu * max(N[last], 0.0) - g[last]
        J[1, 0, 1] -= el.kt * tab.at[last]
        if N[last] > 0.0:
            J[1, 0, 0] += sign * el.mu * el.kn * tab.at[last]


@njit(cache=True)
def stretches(state, g, N, el, tab, means, F, J):
    """Add to the basis means (3, 4H+1) of stick, signed slip and contact, and the offsets of sticking to F and J."""
    S, K = g.size, F.shape[1]
    rows, weight = np.empty((2, K)), np.empty(K)
    first = 0
    while state[first] == STICK:
        first += 1
    i = first
    while i < first + S:
        code, a = state[i % S], i
        while i < first + S and state[i % S] == code:
            i += 1
        if code == SEPARATED:
            continue
        mean = tab.sums[i] - tab.sums[a]
        means[2] += mean
        if code != STICK:
            means[1] += mean if code == SLIP_UP else -mean
            continue
        means[0] += mean
        c = _origin((a - 1) % S, state, g, N, el, tab.at, rows)
        weighted(mean, weight)
        for k in range(K):
            F[1, k] += weight[k] * c
            for d in range(2):
                for l in range(K):
                    J[1, k, d, l] += weight[k] * rows[d, l]


@njit(cache=True)
def assemble(w, n0, el, means, F, J):
    """Add the parts that are linear in the coefficients w (2, K): kt M_stick, mu (n0 + kn w) M_slip and M_contact."""
    K = w.shape[1]
    block = np.empty((K, K))
    for row, factor, column, of in ((1, el.kt, 1, 0), (1, el.mu * el.kn, 0, 1), (0, el.kn, 0, 2)):
        gram(means[of], block)
        constant = 0.0 if of == 0 else n0 * (el.mu if of == 1 else 1.0)
        for k in range(K):
            F[row, k] += constant * block[k, 0]
            for l in range(K):
                F[row, k] += factor * block[k, l] * w[column, l]
                J[row, k, column, l] += factor * block[k, l]


@njit(cache=True)
def _add_series(load, state, mu, tab, F):
    """Add the harmonics of a prescribed normal load (S,) and of its friction limit where the element slips."""
    S, K = tab.at.shape
    for i in range(S):
        if state[i] != SEPARATED:
            part = load[i] / S
            slip = mu * part if state[i] == SLIP_UP else (-mu * part if state[i] == SLIP_DOWN else 0.0)
            for k in range(K):
                double = tab.at[i, k] if k == 0 else 2.0 * tab.at[i, k]
                F[0, k] += part * double
                F[1, k] += slip * double


@njit(cache=True)
def jenkins_batch(w, load, nodes, tab, F, J, shares):
    """Forces F (n, 2, K), Jacobian J (n, 2, K, 2, K), shares (n, 3) of stick, slip and separation; zeroed here.

    w (n, 2, K) [m]; load (n, S) [N] in place of n0, or (n, 0); nodes (n, 4): kt, kn, mu, n0.
    """
    n, S = w.shape[0], tab.at.shape[0]
    g, N, state = np.empty(S), np.empty(S), np.empty(S, np.int8)
    means = np.empty((3, tab.sums.shape[1]))
    for e in range(n):
        el = Node(nodes[e, 0], nodes[e, 1], nodes[e, 2], nodes[e, 3])
        values(tab.transposed, w[e, 1], el.kt, g)
        values(tab.transposed, w[e, 0], el.kn, N)
        n0 = 0.0 if load.shape[1] else el.n0
        N += n0
        if load.shape[1]:
            N += load[e]
        last, sign, stuck = march_states(g, N, el.mu, state)
        means[:], F[e], J[e] = 0.0, 0.0, 0.0
        if stuck:
            _stuck(last, sign, g, N, el, tab, means, F[e], J[e])
        else:
            stretches(state, g, N, el, tab, means, F[e], J[e])
        assemble(w[e], n0, el, means, F[e], J[e])
        if load.shape[1]:
            _add_series(load[e], state, el.mu, tab, F[e])
        shares[e, 0] = means[0, 0]
        shares[e, 1] = means[2, 0] - means[0, 0]
        shares[e, 2] = 1.0 - means[2, 0]

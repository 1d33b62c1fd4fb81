"""Sampled 1-D Jenkins elements whose motion goes on by a step in each period: the contacts of a
damper that walks.

The same return map as `bladefem.friction.kernel_1d`, sample by sample, with the derivative carried
along. An element that walks slips in every period and forgets its start, so that the period after
the one in which it has slipped for the first time is the steady one. Few points need it, so that it
is written plainly.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# of the largest friction limit: how well the force must repeat itself
REPEAT_TOLERANCE = 1e-12


@njit(cache=True, error_model="numpy")
def _march_forces(f, g, N, step, node, friction, states):
    """The force after one period of the motion g and loads N (S,) from the force f [N].

    Fills the forces friction (S,) and states (S,): -1 open, 0 stick, 1 slip.
    """
    mu = node[2]
    for i in range(g.size):
        if N[i] <= 0.0:
            f = 0.0
            states[i] = -1
        else:
            dg = g[i] - g[i - 1] + step
            f = f + dg if N[i - 1] > 0.0 else N[i] / (N[i] - N[i - 1]) * dg
            states[i] = 0
            if abs(f) > mu * N[i]:
                f = mu * N[i] if f > 0.0 else -mu * N[i]
                states[i] = 1
        friction[i] = f
    return f


@njit(cache=True, error_model="numpy")
def _carry_rows(row, g, N, step, node, at, friction, states, rows):
    """Carry the derivative row (2K,) of the force, by normal and tangential coefficients, through
    the period that `_march_forces` found; fills rows (S, 2K).
    """
    kt, kn, mu = node
    K = at.shape[1]
    for i in range(g.size):
        if states[i] == 0:
            part = 1.0
            if N[i - 1] <= 0.0:
                # closes within the step: the slider is where the motion was at contact
                part = N[i] / (N[i] - N[i - 1])
                rise = kn * (g[i] - g[i - 1] + step) / (N[i] - N[i - 1]) ** 2
                for l in range(K):
                    row[l] = rise * (N[i] * at[i - 1, l] - N[i - 1] * at[i, l])
                    row[K + l] = 0.0
            for l in range(K):
                row[K + l] += part * kt * (at[i, l] - at[i - 1, l])
        else:
            slope = 0.0
            if states[i] == 1:
                slope = mu * kn if friction[i] > 0.0 else -mu * kn
            for l in range(K):
                row[l] = slope * at[i, l]
                row[K + l] = 0.0
        rows[i] = row


@njit(cache=True, error_model="numpy")
def _start_row(row, g, last, node, at):
    """Fill the derivative row (2K,) of the force with which an element that rests begins, at the
    motion g and the friction limit last [N].
    """
    kt, kn, mu = node
    clipped = abs(g) >= last
    for l in range(at.size):
        row[l] = mu * kn * np.sign(g) * at[l] if clipped else 0.0
        row[at.size + l] = 0.0 if clipped else kt * at[l]


@njit(cache=True, error_model="numpy")
def walking_batch(w, ramp, load, nodes, tab, limit, jacobian, F, J, shares, cycles):
    """Forces F (n, 2, K), Jacobian J (n, 2, K, 2, K), shares (n, 3) of stick, slip and separation,
    cycles (n,), negative where the force was not periodic after ``limit``.

    w (n, 2, K) [m]; ramp (n,) by which the tangential motion goes on in each period [m]; load
    (n, S) [N] in place of n0, or (n, 0); nodes (n, 4): kt, kn, mu, n0. J is not filled unless the
    jacobian is wanted.
    """
    S, K = tab.at.shape
    weights = np.ascontiguousarray(tab.analysis[:S].T)
    friction = np.empty(S)
    states = np.empty(S, np.int64)
    row = np.zeros(2 * K)
    rows = np.empty((S, 2 * K))
    for e in range(w.shape[0]):
        kt, kn, mu, n0 = nodes[e]
        node = (kt, kn, mu)
        N = np.dot(tab.at, kn * w[e, 0]) + (load[e] if load.shape[1] else np.full(S, n0))
        g = np.dot(tab.at, kt * w[e, 1])
        step = kt * ramp[e] / S
        last = mu * max(N[S - 1], 0.0)
        # a walk drags the force to its limit
        f = last * np.sign(step) if step != 0.0 else min(max(g[S - 1], -last), last)
        # one that rests beside those that walk remembers where its motion began
        rests = step == 0.0
        row[:] = 0.0
        if rests and N[S - 1] > 0.0:
            _start_row(row, g[S - 1], last, node, tab.at[S - 1])
        cycles[e] = -limit
        for cycle in range(1, limit + 1):
            before = f
            f = _march_forces(before, g, N, step, node, friction, states)
            if rests and jacobian:
                _carry_rows(row, g, N, step, node, tab.at, friction, states, rows)
            if cycle > 1 and abs(f - before) <= REPEAT_TOLERANCE * mu * max(N.max(), 0.0):
                cycles[e] = cycle
                break
        closed = states >= 0
        F[e, 0] = np.dot(weights, N * closed)
        F[e, 1] = np.dot(weights, friction)
        shares[e, 1] = np.mean(states == 1)
        shares[e, 2] = 1.0 - np.mean(closed)
        shares[e, 0] = 1.0 - shares[e, 1] - shares[e, 2]
        if not jacobian:
            continue
        # the row of the period's start is that of its end
        for _ in range(2):
            _carry_rows(row, g, N, step, node, tab.at, friction, states, rows)
        by_motion = np.dot(weights, rows)
        for i in range(S):
            for l in range(K):
                rows[i, l] = kn * tab.at[i, l] if closed[i] else 0.0
        by_normal = np.dot(weights, rows)
        J[e] = 0.0
        for k in range(K):
            for l in range(K):
                J[e, 0, k, 0, l] = by_normal[k, l]
                J[e, 1, k, 0, l] = by_motion[k, l]
                J[e, 1, k, 1, l] = by_motion[k, K + l]

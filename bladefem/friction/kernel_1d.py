"""Sampled 1-D Jenkins elements with varying normal load: states first, then harmonics from the
stretches of one state.

With g = kt w the return map f = clamp(f_old + dg, -mu N, mu N) is a play: f = g - b, where the
slider b [N] is clamped between g - mu N and g + mu N. A period of clamps is itself a clamp, so that
the second period is the steady state. Within a stretch of stick or slip the force is linear in the
coefficients, so that force and Jacobian follow from trigonometric sums over the stretches; no sum
over samples and no running derivative is needed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.simd.codegen import zeros
from bladefem.friction.states import SEPARATED, SLIP_DOWN, SLIP_UP, STICK
from bladefem.friction.trigonometric_tables import (
    Node,
    empty_gram,
    gram_matrix,
    indicator_coefficients,
    motion_values,
)
from bladefem.util.numba_options import INNER_KERNEL, KERNEL


@njit(_nrt=False, **INNER_KERNEL)
def slider_bounds(g, N, mu, low, high):
    """Fill the bounds low, high (S,) of the slider, g -+ mu N [N]; returns the smallest N."""
    least = N[0]
    for i in range(g.size):
        limit = mu * max(N[i], 0.0)
        low[i] = g[i] - limit
        high[i] = g[i] + limit
        least = min(least, N[i])
    return least


@njit(_nrt=False, **INNER_KERNEL)
def _scan_period(b, g, N, low, high, opens, first, state):
    """States of one period from slider b: (slider, last event, its sign, period without event).

    The first period writes all states, a later one only until it meets the period before.
    """
    last = -1
    sign = 0.0
    unchanged = True
    for i in range(g.size):
        if opens:
            if N[i] <= 0.0:
                unchanged = False
                if not first and state[i] == SEPARATED:
                    break
                state[i], last, b = SEPARATED, i, g[i]
                continue
            # closes within the step: the slider is where the motion was at contact
            if N[i - 1] <= 0.0:
                b = (N[i] * g[i - 1] - N[i - 1] * g[i]) / (N[i] - N[i - 1])
        code = STICK
        if b < low[i]:
            b = low[i]
            code = SLIP_UP
            last = i
            sign = 1.0
        elif b > high[i]:
            b = high[i]
            code = SLIP_DOWN
            last = i
            sign = -1.0
        if code != STICK:
            unchanged = False
            if not first and state[i] == code:
                break
        state[i] = code
    return b, last, sign, unchanged


@njit(_nrt=False, **INNER_KERNEL)
def march_states(g, N, low, high, opens, state):
    """Fill the states (S,) of the steady period for g = kt w, normal load N and slider bounds (S,),
    all [N].

    The march starts from f = g. Returns index and sign of the last slip before a steady period
    without any event (index -1: the element never slipped), and whether it is such a period.
    """
    S = g.size
    b = 0.0
    last = -1
    sign = 0.0
    if b < low[S - 1]:
        b = low[S - 1]
        last = S - 1
        sign = 1.0
    elif b > high[S - 1]:
        b = high[S - 1]
        last = S - 1
        sign = -1.0
    b, event, way, unchanged = _scan_period(b, g, N, low, high, opens, True, state)
    if unchanged:
        return last, sign, True
    b, _, _, unchanged = _scan_period(b, g, N, low, high, opens, False, state)
    return event, way, unchanged


@njit(_nrt=False, **INNER_KERNEL)
def _stick_origin(i, state, g, N, el, at, rows):
    """Rows (2, K) of d(f - kt w) by normal and tangential coefficients in the stick after event i;
    f - kt w [N].
    """
    S = g.size
    j = i + 1 if i + 1 < S else 0
    if state[i] != SEPARATED:
        sign = 1.0 if state[i] == SLIP_UP else -1.0
        for l in range(rows.shape[1]):
            rows[0, l] = sign * el.mu * el.kn * at[i, l]
            rows[1, l] = -el.kt * at[i, l]
        return sign * el.mu * N[i] - g[i]
    gap = N[j] - N[i]
    part = N[j] / gap
    dg = g[j] - g[i]
    for l in range(rows.shape[1]):
        rows[0, l] = dg * el.kn / gap**2 * (N[j] * at[i, l] - N[i] * at[j, l])
        rows[1, l] = -el.kt * (part * at[i, l] + (1.0 - part) * at[j, l])
    return part * dg - g[j]


@njit(**INNER_KERNEL)
def _stuck_period(last, sign, g, N, el, tab, means, F, J):
    """A period without events; a slip of the first period leaves its offset."""
    means[0] += tab.sums[g.size]
    means[2] += tab.sums[g.size]
    if last >= 0:
        F[1, 0] += sign * el.mu * max(N[last], 0.0) - g[last]
        J[1, 0, 1] -= el.kt * tab.at[last]
        if N[last] > 0.0:
            J[1, 0, 0] += sign * el.mu * el.kn * tab.at[last]


@njit(_nrt=False, **INNER_KERNEL)
def _add_stretches(state, g, N, el, tab, means, F, J, rows, weight):
    """Add to the basis means (3, 4H+1) of stick, signed slip and contact, and the offsets of
    sticking to F and J.
    """
    S = g.size
    K = F.shape[1]
    P = means.shape[1]
    first = 0
    while state[first] == STICK:
        first += 1
    i = first
    while i < first + S:
        code = state[i % S]
        a = i
        while i < first + S and state[i if i < S else i - S] == code:
            i += 1
        if code == SEPARATED:
            continue
        sign = 1.0 if code == SLIP_UP else (-1.0 if code == SLIP_DOWN else 0.0)
        stick = 1.0 if code == STICK else 0.0
        for p in range(P):
            mean = tab.sums[i, p] - tab.sums[a, p]
            means[0, p] += stick * mean
            means[1, p] += sign * mean
            means[2, p] += mean
            means[3, p] = mean
        if code != STICK:
            continue
        c = _stick_origin((a - 1) % S, state, g, N, el, tab.at, rows)
        indicator_coefficients(means[3], weight)
        for k in range(K):
            F[1, k] += weight[k] * c
            for d in range(2):
                for l in range(K):
                    J[1, k, d, l] += weight[k] * rows[d, l]


@njit(_nrt=False, **INNER_KERNEL)
def assemble_linear_parts(w, base, el, means, F, J, around, block):
    """Add the parts linear in w (2, K): kt M_stick, mu M_slip and M_contact of base (K,) + kn w.

    around as empty_gram makes it and block (K, K) are scratch.
    """
    K = w.shape[1]
    for row, factor, column, of in ((1, el.kt, 1, 0), (1, el.mu, 0, 1), (0, 1.0, 0, 2)):
        gram_matrix(means[of], around, block)
        stiffness = factor if of == 0 else factor * el.kn
        for k in range(K):
            total = 0.0
            fixed = 0.0
            for l in range(K):
                total += block[k, l] * w[column, l]
                fixed += block[k, l] * base[l]
                J[row, k, column, l] += stiffness * block[k, l]
            F[row, k] += stiffness * total + (0.0 if of == 0 else factor * fixed)


@njit(**INNER_KERNEL)
def _add_series(load, state, mu, tab, F):
    """Add the harmonics of a prescribed normal load (S,) and of its friction limit where the
    element slips.
    """
    S, K = tab.at.shape
    for i in range(S):
        if state[i] != SEPARATED:
            part = load[i] / S
            slip = (
                mu * part if state[i] == SLIP_UP else (-mu * part if state[i] == SLIP_DOWN else 0.0)
            )
            for k in range(K):
                double = tab.at[i, k] if k == 0 else 2.0 * tab.at[i, k]
                F[0, k] += part * double
                F[1, k] += slip * double


@njit(**KERNEL)
def jenkins_batch(w, load, nodes, tab, F, J, shares):
    """Forces F (n, 2, K), Jacobian J (n, 2, K, 2, K), shares (n, 3) of stick, slip and separation;
    zeroed here.

    w (n, 2, K) [m]; load (n, S) [N] in place of n0, or (n, 0); nodes (n, 4): kt, kn, mu, n0.
    """
    n = w.shape[0]
    S = tab.at.shape[0]
    K = w.shape[2]
    g = zeros(S, np.float64)
    N = zeros(S, np.float64)
    low = zeros(S, np.float64)
    high = zeros(S, np.float64)
    state = np.empty(S, np.int8)
    means = np.empty((4, tab.sums.shape[1]))
    block = np.empty((K, K))
    rows = np.empty((2, K))
    weight = np.empty(K)
    base = np.zeros(K)
    around = empty_gram(K // 2)
    for e in range(n):
        el = Node(nodes[e, 0], nodes[e, 1], nodes[e, 2], nodes[e, 3])
        motion_values(tab.transposed, w[e, 1], el.kt, 0.0, g)
        base[0] = 0.0 if load.shape[1] else el.n0
        motion_values(tab.transposed, w[e, 0], el.kn, base[0], N)
        if load.shape[1]:
            N += load[e]
        opens = slider_bounds(g, N, el.mu, low, high) <= 0.0
        last, sign, stuck = march_states(g, N, low, high, opens, state)
        means[:] = 0.0
        F[e] = 0.0
        J[e] = 0.0
        if stuck:
            _stuck_period(last, sign, g, N, el, tab, means, F[e], J[e])
        else:
            _add_stretches(state, g, N, el, tab, means, F[e], J[e], rows, weight)
        assemble_linear_parts(w[e], base, el, means, F[e], J[e], around, block)
        if load.shape[1]:
            _add_series(load[e], state, el.mu, tab, F[e])
        shares[e, 0] = means[0, 0]
        shares[e, 1] = means[2, 0] - means[0, 0]
        shares[e, 2] = 1.0 - means[2, 0]

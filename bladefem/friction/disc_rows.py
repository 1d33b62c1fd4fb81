"""Running derivative of a 2-D element: rows of d(force)/d(coefficients) over one period.

Rows have M = 3K+2 columns: normal, first and second tangential coefficients, and the force at the start of the period.
The derivative is carried as C = D - kt V, so that C stays while an element sticks and a whole stretch of stick costs
one rank-one update. The last two columns carry the derivative Phi of the period map; the derivative of the periodic
state follows from D_start = Phi D_start + d.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.disc import CLOSING, SLIP, STICK, edge, sensitivity
from bladefem.friction.tables import weighted

__all__ = ["close", "linear_period", "start_rows", "to_carry"]

FAST = {"contract", "reassoc", "nsz"}


@njit(cache=True, fastmath=FAST)
def _slip_rows(C, i, j, by, fx, fy, m, el, R, knots, rows):
    """Rows (3, M) 0 and 1 of the force (fx, fy), |f| = R, that slips with N = (1-m) N_i + m N_j; row 2 is the angle's.

    by (6,): derivative of the angle by the force before (2), the increment (2), N_i and N_j.
    """
    K = knots.shape[1]
    p0, p1, q0, q1, r0, r1 = by
    for l in range(rows.shape[1]):
        rows[2, l] = p0 * C[0, l] + p1 * C[1, l]
    for l in range(K):
        V, dV = knots[i, l], knots[j, l] - knots[i, l]
        rows[2, l] += el.kn * (r0 * V + r1 * knots[j, l])
        rows[2, K + l] += el.kt * (p0 * V + q0 * dV)
        rows[2, 2 * K + l] += el.kt * (p1 * V + q1 * dV)
    for l in range(rows.shape[1]):
        rows[0, l] = -fy * rows[2, l]
        rows[1, l] = fx * rows[2, l]
    if R > 0.0:
        for l in range(K):
            dN = el.mu * el.kn / R * ((1.0 - m) * knots[i, l] + m * knots[j, l])
            rows[0, l] += fx * dN
            rows[1, l] += fy * dN


@njit(cache=True)
def _closing_rows(i, j, dx, dy, N0, N1, part, el, knots, rows):
    """Rows 0 and 1 of f = part d, part = N / (N_j - N_i), of an element that closes in this edge and sticks."""
    K = knots.shape[1]
    rows[:] = 0.0
    for l in range(K):
        change = el.kn * (N1 * knots[i, l] - N0 * knots[j, l]) / (N1 - N0) ** 2
        rows[0, l], rows[1, l] = dx * change, dy * change
        rows[0, K + l] = rows[1, 2 * K + l] = el.kt * part * (knots[j, l] - knots[i, l])


@njit(cache=True)
def to_carry(C, j, kt, knots):
    """C (2, M) from D to D - kt V at knot j."""
    K = knots.shape[1]
    for l in range(K):
        C[0, K + l] -= kt * knots[j, l]
        C[1, 2 * K + l] -= kt * knots[j, l]


@njit(cache=True)
def _add_stretch(a, b, cx, cy, C, tab, means, F, acc):
    """Add samples a <= i < b, which stick with f = kt w + (cx, cy)."""
    weight = np.empty(F.shape[1])
    mean = tab.sums[b] - tab.sums[a]
    means[0] += mean
    weighted(mean, weight)
    for k in range(weight.size):
        F[1, k] += weight[k] * cx
        F[2, k] += weight[k] * cy
        for d in range(2):
            for l in range(C.shape[1]):
                acc[d, k, l] += weight[k] * C[d, l]


@njit(cache=True, fastmath=FAST)
def _add_sample(at, i, fx, fy, rows, F, acc):
    """Add sample i with force (fx, fy) and its rows."""
    S = at.shape[0]
    for k in range(at.shape[1]):
        P = at[i, k] / S * (1.0 if k == 0 else 2.0)
        F[1, k] += P * fx
        F[2, k] += P * fy
        for d in range(2):
            for l in range(rows.shape[1]):
                acc[d, k, l] += P * rows[d, l]


@njit(cache=True)
def linear_period(path, fx, fy, el, tab, C, means, F, acc, rows):
    """One period of path (3, S) = (kt w_1, kt w_2, N) at the knots from (fx, fy): (fx, fy, samples that slip).

    C (2, M) is carried on; means (3, 4H+1), F (3, K) and acc (2, K, M) collect; rows (3, M) is scratch.
    """
    S, knots, slips = path.shape[1], tab.knots, 0
    run, cx, cy = -1, 0.0, 0.0              # first sample of the present stretch of stick, -1 outside
    for i in range(S):
        j = i + 1 if i + 1 < S else 0
        dx, dy, N0, N1 = path[0, j] - path[0, i], path[1, j] - path[1, i], path[2, i], path[2, j]
        end, ex, ey, mid, mx, my = edge(fx, fy, dx, dy, N0, N1, el.mu)
        if mid == STICK and run < 0:
            run, cx, cy = i, fx - path[0, i], fy - path[1, i]
        elif mid != STICK and run >= 0:
            _add_stretch(run, i, cx, cy, C, tab, means, F, acc)
            run = -1
        if mid == SLIP:
            by = sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 0.5)
            _slip_rows(C, i, j, by, mx, my, 0.5, el, 0.5 * el.mu * (N0 + N1), knots, rows)
            slips += 1
        elif mid == CLOSING:
            _closing_rows(i, j, dx, dy, N0, N1, 0.5 * (N0 + N1) / (N1 - N0), el, knots, rows)
        if mid == SLIP or mid == CLOSING:
            _add_sample(tab.at, i, mx, my, rows, F, acc)
        if end != STICK:
            if run >= 0:
                _add_stretch(run, i + 1, cx, cy, C, tab, means, F, acc)
                run = -1
            if end == SLIP:
                by = sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 1.0)
                _slip_rows(C, i, j, by, ex, ey, 1.0, el, el.mu * N1, knots, rows)
            elif end == CLOSING:
                _closing_rows(i, j, dx, dy, N0, N1, N1 / (N1 - N0), el, knots, rows)
            else:
                rows[:] = 0.0
            C[:] = rows[:2]
            to_carry(C, j, el.kt, knots)
        fx, fy = ex, ey
    if run >= 0:
        _add_stretch(run, S, cx, cy, C, tab, means, F, acc)
    return fx, fy, slips


@njit(cache=True)
def start_rows(vx, vy, N, el, knots, C):
    """Carried rows C (2, M) of the force at the first knot: kt w = (vx, vy) drawn back onto the circle mu N."""
    K = knots.shape[1]
    C[:] = 0.0
    R = el.mu * max(N, 0.0)
    length = np.hypot(vx, vy)
    if length <= R:
        return
    ex, ey = vx / length, vy / length
    for l in range(K):
        turned = el.kt * R / length * knots[0, l]
        C[0, K + l], C[0, 2 * K + l] = ey * ey * turned, -ex * ey * turned
        C[1, K + l], C[1, 2 * K + l] = -ex * ey * turned, ex * ex * turned
        if R > 0.0:
            C[0, l], C[1, l] = ex * el.mu * el.kn * knots[0, l], ey * el.mu * el.kn * knots[0, l]
    to_carry(C, 0, el.kt, knots)


@njit(cache=True, fastmath=FAST)
def close(C, kt, knots, acc, J):
    """Jacobian J (3, K, 3K) of the periodic state from the sums acc and the rows C at the end of the period."""
    K = knots.shape[1]
    to_carry(C, 0, -kt, knots)
    a, b, c, d = 1.0 - C[0, 3 * K], -C[0, 3 * K + 1], -C[1, 3 * K], 1.0 - C[1, 3 * K + 1]
    det = a * d - b * c
    for l in range(3 * K):      # D at the start of the period takes the place of C
        x, y = C[0, l], C[1, l]
        C[0, l], C[1, l] = (d * x - b * y) / det, (a * y - c * x) / det
    for e in range(2):
        for k in range(K):
            for l in range(3 * K):
                J[1 + e, k, l] += acc[e, k, l] + acc[e, k, 3 * K] * C[0, l] + acc[e, k, 3 * K + 1] * C[1, l]

"""Running derivative of a 2-D element: rows of d(force)/d(coefficients) over one period.

Rows have M columns: normal, first and second tangential coefficients (K each), the force at the start of the period
(2), zeros up to a multiple of 4, and in what is summed the force itself in the last column. In stick the derivative is
carried as C = D - kt V, which stays, so that a whole stretch of stick costs one rank-one update. In slip only the row
of the angle is carried. The two columns of the start carry the derivative Phi of the period map; the derivative of the
periodic state follows from D = Phi D + d.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.disc import CLOSING, SLIP, STICK, edge, sensitivity
from bladefem.friction.orbit import (
    DIRECTION_X,
    DIRECTION_Y,
    GROWTH,
    HALF,
    INVERSE_LENGTH,
    INVERSE_LIMIT,
    SLOPE,
    half_angle,
    turned,
)

__all__ = ["close", "linear_period", "start_rows", "to_carry"]

FAST = {"contract", "reassoc", "nsz"}


@njit(cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _angle_row(C, i, by, el, tab, row):
    """Row (M,) of the angle of a slipping force, from by (6,): by force (2), increment (2), N_i and N_j."""
    K, p0, p1, q0, q1, r0, r1 = tab.at.shape[1], *by
    j = i + 1 if i + 1 < tab.at.shape[0] else 0
    for l in range(row.size):
        row[l] = p0 * C[0, l] + p1 * C[1, l]
    for l in range(K):
        V, W = tab.knots[i, l], tab.knots[j, l]
        row[l] += el.kn * (r0 * V + r1 * W)
        row[K + l] += el.kt * (p0 * V + q0 * (W - V))
        row[2 * K + l] += el.kt * (p1 * V + q1 * (W - V))


@njit(cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _force_rows(row, ex, ey, R, slope, normal, out):
    """Rows out (2, M) of R (ex, ey) from the row of its angle, slope = kn dR/dN and the row ``normal`` (K,) of N."""
    for l in range(row.size):
        out[0, l] = -R * ey * row[l]
        out[1, l] = R * ex * row[l]
    for l in range(normal.size):
        out[0, l] += slope * ex * normal[l]
        out[1, l] += slope * ey * normal[l]


@njit(cache=True, error_model="numpy", forceinline=True)
def _closing_rows(i, dx, dy, N0, N1, part, el, knots, out):
    """Rows out (2, M) of f = part d, part = N / (N1 - N0), of an element that closes in edge i and sticks."""
    K, j = knots.shape[1], i + 1 if i + 1 < knots.shape[0] else 0
    out[:] = 0.0
    for l in range(K):
        change = el.kn * (N1 * knots[i, l] - N0 * knots[j, l]) / (N1 - N0) ** 2
        out[0, l], out[1, l] = dx * change, dy * change
        out[0, K + l] = out[1, 2 * K + l] = el.kt * part * (knots[j, l] - knots[i, l])


@njit(cache=True, error_model="numpy", forceinline=True)
def to_carry(C, j, kt, knots):
    """C (2, M) from D to D - kt V at knot j."""
    K = knots.shape[1]
    for l in range(K):
        C[0, K + l] -= kt * knots[j, l]
        C[1, 2 * K + l] -= kt * knots[j, l]


@njit(cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _add_stick(a, b, cx, cy, C, tab, sums):
    """Add samples a <= i < b, which stick with f = kt w + (cx, cy)."""
    M, mean, J = C.shape[1], sums.mean, sums.J
    C[0, M - 1], C[1, M - 1] = cx, cy
    for p in range(mean.size):
        mean[p] = tab.sums[b, p] - tab.sums[a, p]
        sums.stick[p] += mean[p]
    for k in range(J.shape[0]):
        weight = mean[k] if k == 0 else 2.0 * mean[k]
        for l in range(M):
            J[k, l] += weight * C[0, l]
        for l in range(M):
            J[k, M + l] += weight * C[1, l]


@njit(cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _add_slip(i, count, tab, sums):
    """Add samples i <= . < i + count, whose rows and forces stand in sums.rows."""
    J, product = sums.J, sums.product
    np.dot(tab.analysis[i:i + count].T, sums.rows[:count], product)
    for k in range(J.shape[0]):
        for l in range(J.shape[1]):
            J[k, l] += product[k, l]


@njit(cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _slip_steps(first, count, P, Q, path, el, form, turns):
    """Follow the slip from knot ``first`` over ``count`` edges at most: (edges done, P, Q).

    turns (.., 12) takes for each edge the weights of the old row of the angle and of the pattern's rows (normal, first,
    second tangent) for the angle in the middle (4) and at the end (4), and the factors from it to force rows (4).
    """
    S, mu, kt, mukn = path.shape[1], el.mu, el.kt, el.mu * el.kn
    for c in range(count):
        i = first + c
        N0, N1 = path[2, i], path[2, i + 1 if i + 1 < S else 0]
        ux, uy, h = form[DIRECTION_X, i], form[DIRECTION_Y, i], form[HALF, i]
        size = P * P + Q * Q
        if N1 <= 0.0 or (P * P - Q * Q) * ux + 2.0 * P * Q * uy < form[GROWTH, i] * size:
            return c, P, Q
        P1, Q1 = turned(P, Q, ux, uy, h * h)
        P, Q = turned(P, Q, ux, uy, h)
        inverse1, inversem = 1.0 / (P1 * P1 + Q1 * Q1), 1.0 / (P * P + Q * Q)
        ex, ey = (P * P - Q * Q) * inversem, 2.0 * P * Q * inversem
        a1, am = h * h * size * inverse1, h * size * inversem
        y1 = 2.0 * form[SLOPE, i] * (ux * 2.0 * P1 * Q1 - uy * (P1 * P1 - Q1 * Q1)) * inverse1
        ym = form[SLOPE, i] * (ux * ey - uy * ex)
        R, kl, kn = 0.5 * mu * (N0 + N1), kt * form[INVERSE_LENGTH, i], mukn * form[INVERSE_LIMIT, i]
        kx, ky = kl * ux, kl * uy
        turns[c, 0], turns[c, 1] = am, -ym * kn
        turns[c, 2], turns[c, 3] = ym * kx - (1.0 - am) * ky, ym * ky + (1.0 - am) * kx
        turns[c, 4], turns[c, 5] = a1, -y1 * kn
        turns[c, 6], turns[c, 7] = y1 * kx - (1.0 - a1) * ky, y1 * ky + (1.0 - a1) * kx
        turns[c, 8], turns[c, 9], turns[c, 10], turns[c, 11] = -R * ey, R * ex, mukn * ex, mukn * ey
        P, Q = P1, Q1
    return count, P, Q


@njit(cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _turn_rows(first, count, start, pattern, turns, row, middle, rows):
    """Turn the row (M,) of the angle along ``count`` edges; rows (.., 2M) of their samples, force last."""
    M = row.size
    for c in range(count):
        i = first + c
        am, m0, m1, m2 = turns[c, 0], turns[c, 1], turns[c, 2], turns[c, 3]
        a1, t0, t1, t2 = turns[c, 4], turns[c, 5], turns[c, 6], turns[c, 7]
        gx, gy, nx, ny = turns[c, 8], turns[c, 9], turns[c, 10], turns[c, 11]
        for l in range(M):
            middle[l] = am * row[l] + m0 * pattern[i, 0, l] + m1 * pattern[i, 1, l] + m2 * pattern[i, 2, l]
        for l in range(M):
            row[l] = a1 * row[l] + t0 * pattern[i, 0, l] + t1 * pattern[i, 1, l] + t2 * pattern[i, 2, l]
        for l in range(M):
            rows[c, l] = gx * middle[l] + nx * pattern[i, 0, l]
        for l in range(M):
            rows[c, M + l] = gy * middle[l] + ny * pattern[i, 0, l]
        rows[c, M - 1], rows[c, 2 * M - 1] = gy, -gx
        for l in range(start, M):           # forget the start before it becomes denormal and slow
            if abs(row[l]) < 1e-60:
                row[l] = 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def _slide(i, P, Q, path, el, tab, form, sums):
    """Follow the slip from knot i, half-angle vector (P, Q), to where it ends: (i, P, Q) there; samples are added."""
    S, full = path.shape[1], sums.rows.shape[0]
    while i < S:
        most = min(full, S - i)
        count, P, Q = _slip_steps(i, most, P, Q, path, el, form, sums.turns)
        if count == 0:
            break
        _turn_rows(i, count, 3 * tab.at.shape[1], tab.pattern, sums.turns, sums.row, sums.middle, sums.rows)
        _add_slip(i, count, tab, sums)
        i += count
        if count < most:
            break
    return i, P, Q


@njit(cache=True, error_model="numpy", forceinline=True)
def _add_mixed(i, mid, fx, fy, dx, dy, N0, N1, mx, my, el, tab, C, sums):
    """Add sample i, force (mx, my), of an edge that changes state; 1 if it slips."""
    if mid != SLIP and mid != CLOSING:
        return 0
    M, rows = sums.row.size, np.zeros((2, sums.row.size))
    if mid == SLIP:
        _angle_row(C, i, sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 0.5), el, tab, sums.middle)
        R = max(0.5 * el.mu * (N0 + N1), 1e-300)
        _force_rows(sums.middle, mx / R, my / R, R, el.mu * el.kn, tab.at[i], rows)
    else:
        _closing_rows(i, dx, dy, N0, N1, 0.5 * (N0 + N1) / (N1 - N0), el, tab.knots, rows)
    rows[0, M - 1], rows[1, M - 1] = mx, my
    sums.rows[0, :M] = rows[0]
    sums.rows[0, M:] = rows[1]
    _add_slip(i, 1, tab, sums)
    return int(mid == SLIP)


@njit(cache=True, error_model="numpy", forceinline=True)
def _after_mixed(i, j, end, fx, fy, dx, dy, N0, N1, el, tab, C, sums):
    """Bring C (2, M), and in slip the row of the angle, from knot i to knot j over an edge that changes state."""
    if end == STICK:
        return
    if end == SLIP:
        _angle_row(C, i, sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 1.0), el, tab, sums.row)
    if end == CLOSING:
        _closing_rows(i, dx, dy, N0, N1, N1 / (N1 - N0), el, tab.knots, C)
    else:
        C[:] = 0.0
    to_carry(C, j, el.kt, tab.knots)


@njit(cache=True, error_model="numpy", forceinline=True)
def _leave_slip(P, Q, i, N, el, tab, C, sums):
    """Force at knot i from the half-angle vector; D from the row of the angle goes to C (2, M)."""
    size = P * P + Q * Q
    ex, ey, R = (P * P - Q * Q) / size, 2.0 * P * Q / size, el.mu * N
    _force_rows(sums.row, ex, ey, R, el.mu * el.kn, tab.knots[i], C)
    return R * ex, R * ey


@njit(cache=True, error_model="numpy")
def linear_period(path, fx, fy, el, tab, form, C, sums):
    """One period of path (3, S) = (kt w_1, kt w_2, N) at the knots from (fx, fy): (fx, fy, samples that slip).

    C (2, M) is carried on and ends as D at the first knot; sums collects.
    """
    S, slips, i, mu = path.shape[1], 0, 0, el.mu
    run, cx, cy = -1, 0.0, 0.0              # first sample of the present stretch of stick, -1 outside
    slipping, P, Q = False, 1.0, 0.0
    while i < S:
        if slipping:
            a = i
            i, P, Q = _slide(i, P, Q, path, el, tab, form, sums)
            slips += i - a
            if i == S:
                break
            slipping = False
            fx, fy = _leave_slip(P, Q, i, path[2, i], el, tab, C, sums)
            to_carry(C, i, el.kt, tab.knots)
        j = i + 1 if i + 1 < S else 0
        dx, dy, N0, N1 = path[0, j] - path[0, i], path[1, j] - path[1, i], path[2, i], path[2, j]
        ex, ey, R1 = fx + dx, fy + dy, mu * N1
        if N0 > 0.0 and N1 > 0.0 and ex * ex + ey * ey <= R1 * R1:
            if run < 0:
                run, cx, cy = i, fx - path[0, i], fy - path[1, i]
        elif N0 > 0.0 or N1 > 0.0:
            end, ex, ey, mid, mx, my = edge(fx, fy, dx, dy, N0, N1, mu)
            if mid == STICK and run < 0:
                run, cx, cy = i, fx - path[0, i], fy - path[1, i]
            if run >= 0:
                _add_stick(run, i + (mid == STICK), cx, cy, C, tab, sums)
                run = -1
            slips += _add_mixed(i, mid, fx, fy, dx, dy, N0, N1, mx, my, el, tab, C, sums)
            _after_mixed(i, j, end, fx, fy, dx, dy, N0, N1, el, tab, C, sums)
            slipping = end == SLIP and R1 > 0.0
            if slipping:
                P, Q = half_angle(ex / R1, ey / R1)
        else:
            ex = ey = 0.0
        fx, fy, i = ex, ey, i + 1
    if run >= 0:
        _add_stick(run, S, cx, cy, C, tab, sums)
    if slipping:
        fx, fy = _leave_slip(P, Q, 0, path[2, 0], el, tab, C, sums)
    elif path[2, 0] > 0.0:
        to_carry(C, 0, -el.kt, tab.knots)
    else:
        C[:] = 0.0
    return fx, fy, slips


@njit(cache=True, error_model="numpy")
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
        turn = el.kt * R / length * knots[0, l]
        C[0, K + l], C[0, 2 * K + l] = ey * ey * turn, -ex * ey * turn
        C[1, K + l], C[1, 2 * K + l] = -ex * ey * turn, ex * ex * turn
        if R > 0.0:
            C[0, l], C[1, l] = ex * el.mu * el.kn * knots[0, l], ey * el.mu * el.kn * knots[0, l]
    to_carry(C, 0, el.kt, knots)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def close(C, K, rx, ry, sums, F, J):
    """Periodic F (3, K) and J (3, K, 3K) from the sums, the rows C (2, M) at the end and its misfit (rx, ry).

    The start of the period is moved to the fixed point of the linearised map.
    """
    a, b, c, d = 1.0 - C[0, 3 * K], -C[0, 3 * K + 1], -C[1, 3 * K], 1.0 - C[1, 3 * K + 1]
    det = a * d - b * c
    mx, my = (d * rx - b * ry) / det, (a * ry - c * rx) / det
    for l in range(3 * K):      # D at the start of the period takes the place of C
        x, y = C[0, l], C[1, l]
        C[0, l], C[1, l] = (d * x - b * y) / det, (a * y - c * x) / det
    M = C.shape[1]
    for e in range(2):
        for k in range(K):
            px, py = sums.J[k, e * M + 3 * K], sums.J[k, e * M + 3 * K + 1]
            F[1 + e, k] += sums.J[k, e * M + M - 1] + px * mx + py * my
            for l in range(3 * K):
                J[1 + e, k, l] += sums.J[k, e * M + l] + px * C[0, l] + py * C[1, l]

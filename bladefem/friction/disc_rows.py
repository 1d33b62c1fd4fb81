"""Running derivative of a 2-D element: rows of d(force)/d(coefficients) over one period.

Rows have M columns: normal, first and second tangential coefficients (K each), and the force at the start of the period
(2), then zeros up to a multiple of 8. In stick the derivative is carried as C = D - kt V, which stays, so that a whole
stretch of stick costs one rank-one update. In slip only the row of the angle is carried. The two columns of the start
carry the derivative Phi of the period map; the derivative of the periodic state follows from D = Phi D + d.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.disc import CLOSING, SLIP, STICK, edge, sensitivity
from bladefem.friction.orbit import DIRECTION_X, DIRECTION_Y, GROWTH, HALF, LENGTH, half_angle, turned

__all__ = ["close", "linear_period", "start_rows", "to_carry"]

FAST = {"contract", "reassoc", "nsz"}


@njit(cache=True, error_model="numpy", fastmath=FAST)
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _force_rows(row, ex, ey, R, slope, normal, out):
    """Rows out (2, M) of R (ex, ey) from the row of its angle, slope = kn dR/dN and the row ``normal`` (K,) of N."""
    for l in range(row.size):
        out[0, l] = -R * ey * row[l]
        out[1, l] = R * ex * row[l]
    for l in range(normal.size):
        out[0, l] += slope * ex * normal[l]
        out[1, l] += slope * ey * normal[l]


@njit(cache=True, error_model="numpy")
def _closing_rows(i, dx, dy, N0, N1, part, el, knots, out):
    """Rows out (2, M) of f = part d, part = N / (N1 - N0), of an element that closes in edge i and sticks."""
    K, j = knots.shape[1], i + 1 if i + 1 < knots.shape[0] else 0
    out[:] = 0.0
    for l in range(K):
        change = el.kn * (N1 * knots[i, l] - N0 * knots[j, l]) / (N1 - N0) ** 2
        out[0, l], out[1, l] = dx * change, dy * change
        out[0, K + l] = out[1, 2 * K + l] = el.kt * part * (knots[j, l] - knots[i, l])


@njit(cache=True, error_model="numpy")
def to_carry(C, j, kt, knots):
    """C (2, M) from D to D - kt V at knot j."""
    K = knots.shape[1]
    for l in range(K):
        C[0, K + l] -= kt * knots[j, l]
        C[1, 2 * K + l] -= kt * knots[j, l]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _add_stretch(a, b, cx, cy, C, tab, sums):
    """Add samples a <= i < b, which stick with f = kt w + (cx, cy)."""
    K, M, mean = tab.at.shape[1], C.shape[1], sums.mean
    for p in range(mean.size):
        mean[p] = tab.sums[b, p] - tab.sums[a, p]
        sums.stick[p] += mean[p]
    for k in range(K):
        weight = mean[k] if k == 0 else 2.0 * mean[k]
        sums.F[1, k] += weight * cx
        sums.F[2, k] += weight * cy
        for l in range(M):
            sums.J[k, l] += weight * C[0, l]
        for l in range(M):
            sums.J[k, M + l] += weight * C[1, l]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _add_samples(count, sums):
    """Add the samples that wait in sums.weights and sums.rows; returns their new number, 0."""
    if count:
        np.dot(sums.weights[:count].T, sums.rows[:count], sums.product)
        for k in range(sums.product.shape[0]):
            for l in range(sums.product.shape[1]):
                sums.J[k, l] += sums.product[k, l]
    return 0


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _keep(i, fx, fy, count, tab, sums):
    """Force and weights of sample i, whose rows stand at ``count``; returns the number that wait."""
    for k in range(tab.analysis.shape[1]):
        P = tab.analysis[i, k]
        sums.weights[count, k] = P
        sums.F[1, k] += P * fx
        sums.F[2, k] += P * fy
    return _add_samples(count + 1, sums) if count + 1 == sums.rows.shape[0] else count + 1


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _turn_rows(am, m, a1, t, i, tab, row, middle):
    """middle = am row + m . pattern and row = a1 row + t . pattern, from (3,) weights of edge i's pattern rows."""
    M, on = row.size, tab.pattern
    m0, m1, m2 = m
    t0, t1, t2 = t
    for l in range(M):
        middle[l] = am * row[l] + m0 * on[i, 0, l] + m1 * on[i, 1, l] + m2 * on[i, 2, l]
    for l in range(M):
        row[l] = a1 * row[l] + t0 * on[i, 0, l] + t1 * on[i, 1, l] + t2 * on[i, 2, l]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _sample_rows(gx, gy, nx, ny, i, tab, middle, count, sums):
    """Rows of sample i in slip: (gx, gy) middle + (nx, ny) times the row of the normal motion."""
    M, on, out = middle.size, tab.pattern, sums.rows
    for l in range(M):
        out[count, l] = gx * middle[l] + nx * on[i, 0, l]
    for l in range(M):
        out[count, M + l] = gy * middle[l] + ny * on[i, 0, l]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _slip_step(P, Q, i, N0, N1, el, tab, form, row, middle, count, sums):
    """One edge in slip throughout: keeps its sample, turns the row of the angle in place; new (P, Q) and count."""
    ux, uy, L, h = form[DIRECTION_X, i], form[DIRECTION_Y, i], form[LENGTH, i], form[HALF, i]
    Rm, size = 0.5 * el.mu * (N0 + N1), P * P + Q * Q
    x = L / Rm
    slope = -0.5 * x / np.sqrt(1.0 + 0.25 * x * x)          # x d(ln h)/dx
    P1, Q1 = turned(P, Q, ux, uy, h * h)
    Pm, Qm = turned(P, Q, ux, uy, h)
    inverse1, inversem = 1.0 / (P1 * P1 + Q1 * Q1), 1.0 / (Pm * Pm + Qm * Qm)
    ex, ey = (Pm * Pm - Qm * Qm) * inversem, 2.0 * Pm * Qm * inversem
    a1, am = h * h * size * inverse1, h * size * inversem
    y1 = 2.0 * slope * (ux * 2.0 * P1 * Q1 - uy * (P1 * P1 - Q1 * Q1)) * inverse1
    ym = slope * (ux * ey - uy * ex)
    kx, ky, kn = el.kt * ux / L, el.kt * uy / L, el.mu * el.kn / Rm
    m = (-ym * kn, ym * kx - (1.0 - am) * ky, ym * ky + (1.0 - am) * kx)
    t = (-y1 * kn, y1 * kx - (1.0 - a1) * ky, y1 * ky + (1.0 - a1) * kx)
    _turn_rows(am, m, a1, t, i, tab, row, middle)
    _sample_rows(-Rm * ey, Rm * ex, el.mu * el.kn * ex, el.mu * el.kn * ey, i, tab, middle, count, sums)
    return P1, Q1, _keep(i, Rm * ex, Rm * ey, count, tab, sums)


@njit(cache=True, error_model="numpy")
def _forget(row, start):
    """Clear what is left of the force at the start of the period before it becomes slow denormal numbers."""
    if abs(row[start]) + abs(row[start + 1]) < 1e-60:
        row[start] = row[start + 1] = 0.0


@njit(cache=True, error_model="numpy")
def _keep_mixed(i, mid, fx, fy, dx, dy, N0, N1, mx, my, el, tab, C, count, sums):
    """Keep sample i of an edge that changes state, with force (mx, my) in the middle; returns slips and the count."""
    if mid != SLIP and mid != CLOSING:
        return 0, count
    M, rows = sums.row.size, np.empty((2, sums.row.size))
    if mid == SLIP:
        _angle_row(C, i, sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 0.5), el, tab, sums.middle)
        R = max(0.5 * el.mu * (N0 + N1), 1e-300)
        _force_rows(sums.middle, mx / R, my / R, R, el.mu * el.kn, tab.at[i], rows)
    else:
        _closing_rows(i, dx, dy, N0, N1, 0.5 * (N0 + N1) / (N1 - N0), el, tab.knots, rows)
    sums.rows[count, :M] = rows[0]
    sums.rows[count, M:] = rows[1]
    return int(mid == SLIP), _keep(i, mx, my, count, tab, sums)


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def linear_period(path, fx, fy, el, tab, form, C, sums):
    """One period of path (3, S) = (kt w_1, kt w_2, N) at the knots from (fx, fy): (fx, fy, samples that slip).

    C (2, M) is carried on and ends as D at the first knot; sums collects.
    """
    S, knots, slips, count = path.shape[1], tab.knots, 0, 0
    run, cx, cy = -1, 0.0, 0.0              # first sample of the present stretch of stick, -1 outside
    slipping, P, Q, row, middle = False, 1.0, 0.0, sums.row, sums.middle
    for i in range(S):
        j = i + 1 if i + 1 < S else 0
        N0, N1 = path[2, i], path[2, j]
        if slipping:
            size, ex, ey = P * P + Q * Q, P * P - Q * Q, 2.0 * P * Q
            ahead = ex * form[DIRECTION_X, i] + ey * form[DIRECTION_Y, i]
            if N1 > 0.0 and ahead >= form[GROWTH, i] * size:
                P, Q, count = _slip_step(P, Q, i, N0, N1, el, tab, form, row, middle, count, sums)
                _forget(row, 3 * knots.shape[1])
                slips += 1
                continue
            slipping = False
            ex, ey = ex / size, ey / size
            fx, fy = el.mu * N0 * ex, el.mu * N0 * ey
            _force_rows(row, ex, ey, el.mu * N0, el.mu * el.kn, knots[i], C)
            to_carry(C, i, el.kt, knots)
        dx, dy = path[0, j] - path[0, i], path[1, j] - path[1, i]
        if N0 > 0.0 and N1 > 0.0:
            ex, ey, R1 = fx + dx, fy + dy, el.mu * N1
            if ex * ex + ey * ey <= R1 * R1:
                if run < 0:
                    run, cx, cy = i, fx - path[0, i], fy - path[1, i]
                fx, fy = ex, ey
                continue
        elif N0 <= 0.0 and N1 <= 0.0 and run < 0:
            continue
        end, ex, ey, mid, mx, my = edge(fx, fy, dx, dy, N0, N1, el.mu)
        if mid == STICK and run < 0:
            run, cx, cy = i, fx - path[0, i], fy - path[1, i]
        if run >= 0:
            _add_stretch(run, i + (mid == STICK), cx, cy, C, tab, sums)
            run = -1
        slip, count = _keep_mixed(i, mid, fx, fy, dx, dy, N0, N1, mx, my, el, tab, C, count, sums)
        _after_mixed(i, j, end, fx, fy, dx, dy, N0, N1, el, tab, C, sums)
        slips += slip
        slipping = end == SLIP and el.mu * N1 > 0.0
        if slipping:
            P, Q = half_angle(ex / (el.mu * N1), ey / (el.mu * N1))
        fx, fy = ex, ey
    if run >= 0:
        _add_stretch(run, S, cx, cy, C, tab, sums)
    _add_samples(count, sums)
    if slipping:
        size, R = P * P + Q * Q, el.mu * path[2, 0]
        ex, ey = (P * P - Q * Q) / size, 2.0 * P * Q / size
        fx, fy = R * ex, R * ey
        _force_rows(row, ex, ey, R, el.mu * el.kn, knots[0], C)
    elif path[2, 0] > 0.0:
        to_carry(C, 0, -el.kt, knots)
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
            F[1 + e, k] += sums.F[1 + e, k] + px * mx + py * my
            for l in range(3 * K):
                J[1 + e, k, l] += sums.J[k, e * M + l] + px * C[0, l] + py * C[1, l]

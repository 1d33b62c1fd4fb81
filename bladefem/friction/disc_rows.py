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
from bladefem.friction.tables import weighted

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


@njit(cache=True, error_model="numpy")
def _add_stretch(a, b, cx, cy, C, tab, sums):
    """Add samples a <= i < b, which stick with f = kt w + (cx, cy)."""
    K, mean, weight = tab.at.shape[1], sums.mean, sums.weight
    for p in range(mean.size):
        mean[p] = tab.sums[b, p] - tab.sums[a, p]
        sums.stick[p] += mean[p]
    weighted(mean, weight)
    for k in range(K):
        sums.F[1, k] += weight[k] * cx
        sums.F[2, k] += weight[k] * cy
        for d in range(2):
            for l in range(C.shape[1]):
                sums.J[d, k, l] += weight[k] * C[d, l]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def add_samples(count, tab, sums):
    """Add the samples kept in sums.which, with their forces and rows, four at a time."""
    K, M = tab.analysis.shape[1], sums.J.shape[2]
    for m in range(count, (count + 3) // 4 * 4):
        sums.which[m] = sums.which[0]
        sums.rows[m] = 0.0
        sums.force[m] = 0.0
    for m in range(0, count, 4):
        i0, i1, i2, i3 = sums.which[m], sums.which[m + 1], sums.which[m + 2], sums.which[m + 3]
        for k in range(K):
            a, b, c, d = tab.analysis[i0, k], tab.analysis[i1, k], tab.analysis[i2, k], tab.analysis[i3, k]
            for e in range(2):
                sums.F[1 + e, k] += (a * sums.force[m, e] + b * sums.force[m + 1, e] + c * sums.force[m + 2, e]
                                     + d * sums.force[m + 3, e])
                r0, r1, r2, r3 = sums.rows[m, e], sums.rows[m + 1, e], sums.rows[m + 2, e], sums.rows[m + 3, e]
                out = sums.J[e, k]
                for l in range(M):
                    out[l] += a * r0[l] + b * r1[l] + c * r2[l] + d * r3[l]


@njit(cache=True, error_model="numpy", fastmath=FAST)
def _slip_step(P, Q, i, N0, N1, el, tab, form, row, count, sums):
    """One edge in slip throughout: adds the sample, turns the row of the angle in place; returns the new (P, Q)."""
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
    q0, q1, r = -(1.0 - am) * ky + ym * kx, (1.0 - am) * kx + ym * ky, -ym * kn
    s0, s1, t = -(1.0 - a1) * ky + y1 * kx, (1.0 - a1) * kx + y1 * ky, -y1 * kn
    gx, gy = -Rm * ey, Rm * ex
    nx, ny = el.mu * el.kn * ex, el.mu * el.kn * ey
    outx, outy = sums.rows[count, 0], sums.rows[count, 1]
    on, ox, oy = tab.pattern[i, 0], tab.pattern[i, 1], tab.pattern[i, 2]
    for l in range(row.size):
        middle = am * row[l] + r * on[l] + q0 * ox[l] + q1 * oy[l]
        outx[l] = gx * middle + nx * on[l]
        outy[l] = gy * middle + ny * on[l]
        row[l] = a1 * row[l] + t * on[l] + s0 * ox[l] + s1 * oy[l]
    sums.which[count] = i
    sums.force[count, 0], sums.force[count, 1] = Rm * ex, Rm * ey
    return P1, Q1


@njit(cache=True, error_model="numpy")
def linear_period(path, fx, fy, el, tab, form, C, sums):
    """One period of path (3, S) = (kt w_1, kt w_2, N) at the knots from (fx, fy): (fx, fy, samples that slip).

    C (2, M) is carried on and ends as D at the first knot; sums collects.
    """
    S, knots, slips, count = path.shape[1], tab.knots, 0, 0
    run, cx, cy = -1, 0.0, 0.0              # first sample of the present stretch of stick, -1 outside
    slipping, P, Q, row = False, 1.0, 0.0, sums.row
    for i in range(S):
        j = i + 1 if i + 1 < S else 0
        N0, N1 = path[2, i], path[2, j]
        if slipping:
            size, ex, ey = P * P + Q * Q, P * P - Q * Q, 2.0 * P * Q
            ahead = ex * form[DIRECTION_X, i] + ey * form[DIRECTION_Y, i]
            if N1 > 0.0 and ahead >= form[GROWTH, i] * size:
                P, Q = _slip_step(P, Q, i, N0, N1, el, tab, form, row, count, sums)
                slips, count = slips + 1, count + 1
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
        end, ex, ey, mid, mx, my = edge(fx, fy, dx, dy, N0, N1, el.mu)
        if mid == STICK and run < 0:
            run, cx, cy = i, fx - path[0, i], fy - path[1, i]
        if run >= 0:
            _add_stretch(run, i + (mid == STICK), cx, cy, C, tab, sums)
            run = -1
        if mid == SLIP:
            _angle_row(C, i, sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 0.5), el, tab, row)
            R = max(0.5 * el.mu * (N0 + N1), 1e-300)
            _force_rows(row, mx / R, my / R, R, el.mu * el.kn, tab.at[i], sums.rows[count])
            slips += 1
        elif mid == CLOSING:
            _closing_rows(i, dx, dy, N0, N1, 0.5 * (N0 + N1) / (N1 - N0), el, knots, sums.rows[count])
        if mid == SLIP or mid == CLOSING:
            sums.which[count] = i
            sums.force[count, 0], sums.force[count, 1] = mx, my
            count += 1
        if end == SLIP:
            R = max(el.mu * N1, 1e-300)
            _angle_row(C, i, sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 1.0), el, tab, row)
            slipping = el.mu > 0.0
            P, Q = half_angle(ex / R, ey / R)
            C[:] = 0.0
            to_carry(C, j, el.kt, knots)    # kept if the limit is zero
        elif end == CLOSING:
            _closing_rows(i, dx, dy, N0, N1, N1 / (N1 - N0), el, knots, C)
            to_carry(C, j, el.kt, knots)
        else:
            C[:] = 0.0
            to_carry(C, j, el.kt, knots)
        fx, fy = ex, ey
    if run >= 0:
        _add_stretch(run, S, cx, cy, C, tab, sums)
    if slipping:
        size, R = P * P + Q * Q, el.mu * path[2, 0]
        ex, ey = (P * P - Q * Q) / size, 2.0 * P * Q / size
        fx, fy = R * ex, R * ey
        _force_rows(row, ex, ey, R, el.mu * el.kn, knots[0], C)
    else:
        to_carry(C, 0, -el.kt, knots)
    add_samples(count, tab, sums)
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
    for e in range(2):
        for k in range(K):
            px, py = sums.J[e, k, 3 * K], sums.J[e, k, 3 * K + 1]
            F[1 + e, k] += sums.F[1 + e, k] + px * mx + py * my
            for l in range(3 * K):
                J[1 + e, k, l] += sums.J[e, k, l] + px * C[0, l] + py * C[1, l]

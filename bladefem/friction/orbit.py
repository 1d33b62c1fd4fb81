"""Periodic state of 2-D Coulomb elements: fixed point of the period map, by marching and by Newton on its derivative.

In slip the half-angle vector (P, Q) ~ (cos theta/2, sin theta/2) of the force moves by a 2 x 2 matrix on each edge,
A = ((1 + E) I + (1 - E) [[ux, uy], [uy, -ux]]) / 2, so that marching needs no trigonometry and no division. The period
map never expands: marching converges, but slowly near the stick limit, where Newton with the derivative of the map
takes a few periods.
"""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np
from numba import njit

from bladefem.friction.disc import SLIP, STICK, edge, sensitivity

__all__ = ["DIRECTION_X", "DIRECTION_Y", "EDGE_ROWS", "GROWTH", "HALF", "INVERSE_LENGTH", "INVERSE_LIMIT",
           "SLOPE", "TOLERANCE", "edges", "half_angle", "march", "period", "periodic", "record", "start", "turned"]

TOLERANCE = 1e-12       # of the largest friction limit: how well the force must repeat itself in marching
FREE = 30               # periods in which Newton's steps need not pay at once: states of the edges have to settle first
DIRECTION_X, DIRECTION_Y, INVERSE_LENGTH, HALF, GROWTH, SLOPE, INVERSE_LIMIT, EDGE_ROWS = range(8)


@njit(cache=True, error_model="numpy", fastmath={"contract", "nsz", "arcp"})
def edges(path, mu, out):
    """Fill out (7, S): direction (2), 1/length, decay over half an edge, growth of the limit, x dln(decay)/dx, 1/limit.

    Lengths and limits are forces [N]. One array is written in each loop, so that the compiler can use vectors.
    """
    S = path.shape[1]
    for row in range(3):
        for i in range(S - 1):
            out[row, i] = path[row, i + 1] - path[row, i]
        out[row, S - 1] = path[row, 0] - path[row, S - 1]
    for i in range(S):
        out[INVERSE_LIMIT, i] = 1.0 / max(mu * path[2, i] + 0.5 * mu * out[2, i], 1e-300)
    for i in range(S):
        out[GROWTH, i] = mu * out[2, i]
    for i in range(S):
        out[INVERSE_LENGTH, i] = 1.0 / max(sqrt(out[0, i] ** 2 + out[1, i] ** 2), 1e-12 / out[INVERSE_LIMIT, i])
    for i in range(S):
        x = 0.5 * out[INVERSE_LIMIT, i] / out[INVERSE_LENGTH, i]
        out[SLOPE, i] = -x / sqrt(1.0 + x * x)
    for i in range(S):
        x = 0.5 * out[INVERSE_LIMIT, i] / out[INVERSE_LENGTH, i]
        out[HALF, i] = 1.0 / (sqrt(1.0 + x * x) + x)
    for i in range(S):
        out[0, i] *= out[INVERSE_LENGTH, i]
    for i in range(S):
        out[1, i] *= out[INVERSE_LENGTH, i]
    for i in range(S):
        out[GROWTH, i] *= out[INVERSE_LENGTH, i]


@njit(cache=True, error_model="numpy", inline="always")
def half_angle(x, y):
    """A vector along (cos theta/2, sin theta/2) for the direction (x, y) of unit length."""
    return (1.0 + x, y) if x >= 0.0 else (y, 1.0 - x)


@njit(cache=True, error_model="numpy", inline="always")
def turned(P, Q, ux, uy, E):
    """The half-angle vector after tan(psi/2) to the direction (ux, uy) has fallen by E."""
    a, b = 1.0 + E, 1.0 - E
    return 0.5 * ((a + b * ux) * P + b * uy * Q), 0.5 * (b * uy * P + (a - b * ux) * Q)


@njit(cache=True, error_model="numpy")
def start(vx, vy, N, mu):
    """Force at the first knot: k_t w, drawn back onto the circle."""
    R = mu * max(N, 0.0)
    length = sqrt(vx * vx + vy * vy)
    scale = 1.0 if length <= R else R / length
    return scale * vx, scale * vy


@njit(cache=True, error_model="numpy")
def march(path, mu, form, fx, fy):
    """One period of the force alone from (fx, fy) at the first knot: (fx, fy, edges that slip or open, memory).

    memory bounds the length of d f_end / d f_start, as far as sustained slip and separation tell.
    """
    S, events, slipping, P, Q, memory = path.shape[1], 0, False, 1.0, 0.0, 1.0
    for i in range(S):
        j = i + 1 if i + 1 < S else 0
        N0, N1 = path[2, i], path[2, j]
        if slipping:
            ux, uy, h = form[DIRECTION_X, i], form[DIRECTION_Y, i], form[HALF, i]
            size, cx, cy = P * P + Q * Q, P * P - Q * Q, 2.0 * P * Q
            if N1 > 0.0 and cx * ux + cy * uy >= form[GROWTH, i] * size:
                P, Q = turned(P, Q, ux, uy, h * h)
                memory *= h * h
                events += 1
                continue
            slipping = False
            memory *= N0 / size
            fx, fy = mu * N0 * cx / size, mu * N0 * cy / size
        dx, dy = path[0, j] - path[0, i], path[1, j] - path[1, i]
        if N0 > 0.0 and N1 > 0.0:
            ex, ey, R1 = fx + dx, fy + dy, mu * N1
            if ex * ex + ey * ey <= R1 * R1:
                fx, fy = ex, ey
                continue
        end, fx, fy, _, _, _ = edge(fx, fy, dx, dy, N0, N1, mu)
        events += end != STICK
        if end == SLIP and N1 > 0.0 and mu > 0.0:
            P, Q = half_angle(fx / (mu * N1), fy / (mu * N1))
            memory *= (P * P + Q * Q) / N1
            slipping = True
        elif end != STICK:
            memory = 0.0
    if slipping:
        size, R1 = P * P + Q * Q, mu * path[2, 0]
        memory *= path[2, 0] / size
        fx, fy = R1 * (P * P - Q * Q) / size, R1 * 2.0 * P * Q / size
    return fx, fy, events, memory


@njit(cache=True, error_model="numpy")
def record(path, mu, form, fx, fy, trace):
    """Forces at the samples, trace (2, S) [N], over one period from (fx, fy) at the first knot; samples that slip."""
    S, slips, slipping, P, Q = path.shape[1], 0, False, 1.0, 0.0
    for i in range(S):
        j = i + 1 if i + 1 < S else 0
        N0, N1 = path[2, i], path[2, j]
        if slipping:
            ux, uy, h = form[DIRECTION_X, i], form[DIRECTION_Y, i], form[HALF, i]
            size, cx, cy = P * P + Q * Q, P * P - Q * Q, 2.0 * P * Q
            if N1 > 0.0 and cx * ux + cy * uy >= form[GROWTH, i] * size:
                p, q = turned(P, Q, ux, uy, h)
                R = 0.5 * mu * (N0 + N1) / (p * p + q * q)
                trace[0, i], trace[1, i] = R * (p * p - q * q), R * 2.0 * p * q
                P, Q = turned(P, Q, ux, uy, h * h)
                slips += 1
                continue
            slipping = False
            fx, fy = mu * N0 * cx / size, mu * N0 * cy / size
        dx, dy = path[0, j] - path[0, i], path[1, j] - path[1, i]
        if N0 > 0.0 and N1 > 0.0 and (fx + dx) ** 2 + (fy + dy) ** 2 <= (mu * N1) ** 2:
            trace[0, i], trace[1, i] = fx + 0.5 * dx, fy + 0.5 * dy
            fx, fy = fx + dx, fy + dy
            continue
        end, fx, fy, mid, trace[0, i], trace[1, i] = edge(fx, fy, dx, dy, N0, N1, mu)
        slips += mid == SLIP
        slipping = end == SLIP and mu * N1 > 0.0
        if slipping:
            P, Q = half_angle(fx / (mu * N1), fy / (mu * N1))
    return slips


@njit(cache=True, error_model="numpy")
def period(path, mu, fx, fy, phi):
    """One period from (fx, fy) [N] at the first knot: (fx, fy, edges that slip or open); phi (2, 2) = df_end/df."""
    vx, vy, N = path
    S, events = vx.size, 0
    phi[:] = 0.0
    phi[0, 0] = phi[1, 1] = 1.0
    for i in range(S):
        j = i + 1 if i + 1 < S else 0
        dx, dy = vx[j] - vx[i], vy[j] - vy[i]
        end, ex, ey, _, _, _ = edge(fx, fy, dx, dy, N[i], N[j], mu)
        if end == SLIP and N[i] > 0.0:
            p0, p1, _, _, _, _ = sensitivity(fx, fy, dx, dy, N[i], N[j], mu, 1.0)
            a, b = p0 * phi[0, 0] + p1 * phi[1, 0], p0 * phi[0, 1] + p1 * phi[1, 1]
            phi[0, 0], phi[0, 1], phi[1, 0], phi[1, 1] = -ey * a, -ey * b, ex * a, ex * b
        elif end != STICK:
            phi[:] = 0.0
        events += end != STICK
        fx, fy = ex, ey
    return fx, fy, events


@njit(cache=True, error_model="numpy")
def newton(fx, fy, gx, gy, R, phi):
    """(usable, fx, fy): the fixed point of the linearised period map f -> g, drawn back onto the circle of radius R."""
    a, b, c, d = 1.0 - phi[0, 0], -phi[0, 1], -phi[1, 0], 1.0 - phi[1, 1]
    det = a * d - b * c
    if abs(det) < 1e-9:
        return False, gx, gy
    rx, ry = gx - fx, gy - fy
    x, y = fx + (d * rx - b * ry) / det, fy + (a * ry - c * rx) / det
    length = hypot(x, y)
    if length > R:
        x, y = x * R / length, y * R / length
    return True, x, y


@njit(cache=True, error_model="numpy")
def periodic(path, mu, fx, fy, guessing, limit, phi):
    """(fx, fy, cycles, converged, guesses) of the periodic force for path (3, S) [N], from (fx, fy); fills phi."""
    scale, R = mu * max(path[2].max(), 0.0), mu * max(path[2, 0], 0.0)
    guess, guesses, before, sx, sy = False, 0, np.inf, 0.0, 0.0
    for cycle in range(1, limit + 1):
        gx, gy, events = period(path, mu, fx, fy, phi)
        residual = hypot(gx - fx, gy - fy)
        if events == 0 or residual <= TOLERANCE * scale:
            if guessing and events > 0:                 # a small residual leaves residual / (1 - contraction)
                _, gx, gy = newton(fx, fy, gx, gy, R, phi)
            return gx, gy, cycle, True, guesses
        if guess and cycle > FREE and residual > 0.5 * before:      # no better than marching: go back and march on
            fx, fy, guess = sx, sy, False
            continue
        before, sx, sy = residual, gx, gy
        guess = False
        if guessing:
            guess, gx, gy = newton(fx, fy, gx, gy, R, phi)
            guesses += guess
        fx, fy = gx, gy
    return fx, fy, limit, False, guesses

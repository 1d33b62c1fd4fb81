"""Periodic state of 2-D Coulomb elements: fixed point of the period map, by marching and by Newton on its derivative.

The force at the first knot maps to the force one period later. The map never expands, so that marching converges,
but slowly near the stick limit; there Newton with the 2 x 2 derivative of the map takes a few periods.
"""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np
from numba import njit

from bladefem.friction.disc import SLIP, STICK, edge, sensitivity

__all__ = ["period", "periodic", "start"]

TOLERANCE = 1e-12       # of the largest friction limit: how well the force must repeat itself


@njit(cache=True)
def start(vx, vy, N, mu):
    """Force at the first knot: k_t w, drawn back onto the circle."""
    R = mu * max(N, 0.0)
    length = sqrt(vx * vx + vy * vy)
    scale = 1.0 if length <= R else R / length
    return scale * vx, scale * vy


@njit(cache=True)
def period(vx, vy, N, mu, fx, fy, phi):
    """One period from f = (fx, fy) [N] at the first knot: (fx, fy, edges that slip or open); phi (2, 2) = df_end/df."""
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


@njit(cache=True)
def _newton(fx, fy, gx, gy, R, phi):
    """(usable, fx, fy): the fixed point of the linearised period map, drawn back onto the circle of radius R."""
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


@njit(cache=True)
def periodic(vx, vy, N, mu, newton, limit, phi):
    """(fx, fy, events, cycles, converged, guesses) for kt w = (vx, vy) (S,) and N (S,) at the knots [N]; fills phi."""
    fx, fy = start(vx[0], vy[0], N[0], mu)
    scale, R = mu * max(N.max(), 0.0), mu * max(N[0], 0.0)
    guess, guesses, before, sx, sy, events = False, 0, np.inf, 0.0, 0.0, 0
    for cycle in range(1, limit + 1):
        gx, gy, events = period(vx, vy, N, mu, fx, fy, phi)
        residual = hypot(gx - fx, gy - fy)
        if events == 0 or residual <= TOLERANCE * scale:
            return gx, gy, events, cycle, True, guesses
        if guess and residual > 0.5 * before:           # no better than marching: go back and march on
            fx, fy, guess = sx, sy, False
            continue
        before, sx, sy = residual, gx, gy
        guess = False
        if newton and cycle > 1:
            guess, gx, gy = _newton(fx, fy, gx, gy, R, phi)
            guesses += guess
        fx, fy = gx, gy
    return fx, fy, events, limit, False, guesses

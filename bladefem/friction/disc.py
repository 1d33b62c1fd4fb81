"""One edge of a 2-D Coulomb element: the force turns on the circle |f| = mu N along a straight motion.

The path is a polygon whose edges touch the motion at the samples and whose knots lie half-way between them. Along an
edge in slip the angle psi between force and motion obeys R psi' = -k |w'| sin psi, so that tan(psi/2) falls by a
factor E (Krieg & Krieg 1977, doi:10.1115/1.3454568, for von Mises plasticity). With E = (sqrt(1 + x^2/4) - x/2)^2,
x = k |dw| / R, in place of exp(-x), a circular orbit is exact at any number of samples (while its lag exceeds half a
step), and the error is second order from soft to rigid Coulomb friction; plain radial return lags by half a step.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

__all__ = ["crossing", "decay", "edge", "sensitivity", "turn"]

SEPARATED, STICK, SLIP, CLOSING = 0, 1, 2, 3


@njit(cache=True, error_model="numpy", inline="always")
def decay(x):
    """Factor of tan(psi/2) over half an edge, tends to exp(-x/2) for small x and to 1/x for large x."""
    return 1.0 / (sqrt(1.0 + 0.25 * x * x) + 0.5 * x)


@njit(cache=True, error_model="numpy", inline="always")
def crossing(fx, fy, dx, dy, R0, dR):
    """Share of the edge after which |f + s d| reaches R0 + s dR; 0 if it starts on the circle and leaves it."""
    A = dx * dx + dy * dy - dR * dR
    B = fx * dx + fy * dy - R0 * dR
    C = min(fx * fx + fy * fy - R0 * R0, 0.0)
    root = sqrt(max(B * B - A * C, 0.0))
    if B > 0.0:
        return min(-C / (B + root), 1.0)
    return min(max((root - B) / A, 0.0), 1.0) if A > 0.0 else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def turn(c, s, E):
    """(cos, sin, d psi_1 / d psi) of the angle after tan(psi/2) has fallen by E, from cos psi = c, sin psi = s."""
    e = E * E * (1.0 - c)
    D = 1.0 + c + e
    return (1.0 + c - e) / D, 2.0 * E * s / D, 2.0 * E / D


@njit(cache=True, error_model="numpy", inline="always")
def _direction(dx, dy, hx, hy, R):
    """(length, ux, uy) of the increment; a vanishing one is taken along the force."""
    L = sqrt(dx * dx + dy * dy)
    tiny = 1e-12 * R
    if tiny < L:
        return L, dx / L, dy / L
    H = sqrt(hx * hx + hy * hy)
    return (tiny, hx / H, hy / H) if H > 0.0 else (1e-300, 1.0, 0.0)


@njit(cache=True, error_model="numpy", inline="always")
def _slip_on(fx, fy, dx, dy, R0, R1, Rm, share, power):
    """(fx, fy) of unit length at share = 1 (end, power 2) or 0.5 (mid, power 1) of an edge that slips."""
    alpha = crossing(fx, fy, dx, dy, R0, R1 - R0)
    hx, hy = fx + alpha * dx, fy + alpha * dy
    H = sqrt(hx * hx + hy * hy)
    L, ux, uy = _direction(dx, dy, hx, hy, Rm)
    if H <= 0.0:
        return ux, uy, alpha
    E = decay(L / Rm * (1.0 - alpha / share))
    if power == 2:
        E *= E
    c, s, _ = turn((hx * ux + hy * uy) / H, (hy * ux - hx * uy) / H, E)
    return c * ux - s * uy, c * uy + s * ux, alpha


@njit(cache=True, error_model="numpy", inline="always")
def edge(fx, fy, dx, dy, N0, N1, mu):
    """(state at the end, f at the end (2), state at the middle, f there (2)) after one edge from f = (fx, fy) [N]."""
    Nm = 0.5 * (N0 + N1)
    R0, R1, Rm = mu * N0, mu * N1, mu * Nm
    end, ex, ey, mid, mx, my = SEPARATED, 0.0, 0.0, SEPARATED, 0.0, 0.0
    if N0 <= 0.0:
        if N1 > 0.0:                        # closes: from f = 0 and R = 0 the force follows the motion
            rest = N1 / (N1 - N0)
            L = rest * sqrt(dx * dx + dy * dy)
            scale = rest if L <= R1 else rest * R1 / L
            end = CLOSING if L <= R1 else SLIP
            ex, ey = scale * dx, scale * dy
            if Nm > 0.0:
                mid, mx, my = end, Nm / N1 * ex, Nm / N1 * ey
        return end, ex, ey, mid, mx, my
    if Nm > 0.0:
        mid, mx, my = STICK, fx + 0.5 * dx, fy + 0.5 * dy
    if N1 > 0.0:
        end, ex, ey = STICK, fx + dx, fy + dy
        if ex * ex + ey * ey > R1 * R1:
            end = SLIP
            ex, ey, alpha = _slip_on(fx, fy, dx, dy, R0, R1, Rm, 1.0, 2)
            ex, ey = R1 * ex, R1 * ey
            if alpha < 0.5:
                mid = SLIP
                mx, my, alpha = _slip_on(fx, fy, dx, dy, R0, R1, Rm, 0.5, 1)
                mx, my = Rm * mx, Rm * my
    elif Nm > 0.0 and mx * mx + my * my > Rm * Rm:
        mid = SLIP
        mx, my, alpha = _slip_on(fx, fy, dx, dy, R0, R1, Rm, 0.5, 1)
        mx, my = Rm * mx, Rm * my
    return end, ex, ey, mid, mx, my


@njit(cache=True, error_model="numpy", inline="always")
def sensitivity(fx, fy, dx, dy, N0, N1, mu, share):
    """d(angle) of the slipping force at share 1 (end) or 0.5 (middle): by f0 (2), increment (2), N0 and N1."""
    R0, R1, Rm = mu * N0, mu * N1, 0.5 * mu * (N0 + N1)
    if N0 <= 0.0:
        L2 = dx * dx + dy * dy
        return 0.0, 0.0, -dy / L2, dx / L2, 0.0, 0.0
    dR = R1 - R0
    alpha = crossing(fx, fy, dx, dy, R0, dR)
    hx, hy, R = fx + alpha * dx, fy + alpha * dy, R0 + alpha * dR
    L, ux, uy = _direction(dx, dy, hx, hy, Rm)
    if R <= 0.0:
        return 0.0, 0.0, -uy / L, ux / L, 0.0, 0.0
    x, tau = L / Rm, 1.0 - alpha / share
    y = x * tau
    E = decay(y)
    W = -0.5 / sqrt(1.0 + 0.25 * y * y)
    if share == 1.0:
        E *= E
        W *= 2.0
    _, S, a = turn((hx * ux + hy * uy) / R, (hy * ux - hx * uy) / R, E)
    nx, ny = -hy / (R * R), hx / (R * R)        # d(angle of h)/dh
    p0, p1 = a * nx, a * ny
    q0 = alpha * p0 - (1.0 - a) * uy / L + S * W * y * ux / L
    q1 = alpha * p1 + (1.0 - a) * ux / L + S * W * y * uy / L
    r0 = r1 = -0.5 * mu * S * W * y / Rm
    den = hx * dx + hy * dy - R * dR
    if alpha > 0.0 and den > 0.0:
        G = (a * (nx * dx + ny * dy) - S * W * x / share) / den
        p0, p1 = p0 - G * hx, p1 - G * hy
        q0, q1 = q0 - G * alpha * hx, q1 - G * alpha * hy
        r0 += G * R * mu * (1.0 - alpha)
        r1 += G * R * mu * alpha
    return p0, p1, q0, q1, r0, r1

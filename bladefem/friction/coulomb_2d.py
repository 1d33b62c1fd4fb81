"""One edge of a 2-D Coulomb element: the force turns on the circle |f| = mu N along a straight
motion.

The path is a polygon whose edges touch the motion at the samples and whose knots lie half-way
between them. Along an edge in slip the angle psi between force and motion obeys
R psi' = -k |w'| sin psi, so that tan(psi/2) falls by a factor E (Krieg & Krieg 1977,
doi:10.1115/1.3454568, for von Mises plasticity). With E = (sqrt(1 + x^2/4) - x/2)^2,
x = k |dw| / R, in place of exp(-x), a circular orbit is exact at any number of samples (while its
lag exceeds half a step), and the error is second order from soft to rigid Coulomb friction; plain
radial return lags by half a step.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from bladefem.friction.states import CLOSING, SEPARATED, SLIP, STICK


@njit(cache=True, error_model="numpy", inline="always")
def angle_decay(x):
    """Factor of tan(psi/2) over half an edge and the slope of its logarithm.

    The factor tends to exp(-x/2) for small x and to 1/x for large x.
    """
    root = sqrt(1.0 + 0.25 * x * x)
    both = 1.0 / (root * (root + 0.5 * x))
    return root * both, -0.5 * (root + 0.5 * x) * both


@njit(cache=True, error_model="numpy", inline="always")
def limit_crossing(fx, fy, dx, dy, R0, dR):
    """Share of the edge after which |f + s d| reaches R0 + s dR; 0 if it starts on the circle and
    leaves it.
    """
    A = dx * dx + dy * dy - dR * dR
    B = fx * dx + fy * dy - R0 * dR
    C = min(fx * fx + fy * fy - R0 * R0, 0.0)
    root = sqrt(max(B * B - A * C, 0.0))
    if B > 0.0:
        return min(-C / (B + root), 1.0)
    return min(max((root - B) / A, 0.0), 1.0) if A > 0.0 else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def turned_angle(c, s, E):
    """(cos, sin, d psi_1 / d psi) of the angle after tan(psi/2) has fallen by E, from cos psi = c,
    sin psi = s.
    """
    e = E * E * (1.0 - c)
    D = 1.0 + c + e
    return (1.0 + c - e) / D, 2.0 * E * s / D, 2.0 * E / D


@njit(cache=True, error_model="numpy", inline="always")
def _unit_increment(dx, dy, hx, hy, R):
    """(length, ux, uy) of the increment; a vanishing one is taken along the force."""
    L = sqrt(dx * dx + dy * dy)
    tiny = 1e-12 * R
    if tiny < L:
        return L, dx / L, dy / L
    H = sqrt(hx * hx + hy * hy)
    return (tiny, hx / H, hy / H) if H > 0.0 else (1e-300, 1.0, 0.0)


@njit(cache=True, error_model="numpy", inline="always")
def _slipping_force(fx, fy, dx, dy, N0, N1, mu, share):
    """Unit force (2) at share 1 (end) or 0.5 (middle) of an edge that slips there, and share after
    which it slips.

    Then d(angle) of that force by f0 (2), increment (2), N0 and N1.
    """
    R0 = mu * N0
    dR = mu * (N1 - N0)
    Rm = 0.5 * mu * (N0 + N1)
    alpha = limit_crossing(fx, fy, dx, dy, R0, dR)
    hx = fx + alpha * dx
    hy = fy + alpha * dy
    R = R0 + alpha * dR
    H = sqrt(hx * hx + hy * hy)
    L, ux, uy = _unit_increment(dx, dy, hx, hy, Rm)
    if H <= 0.0:
        return ux, uy, alpha, 0.0, 0.0, -uy / L, ux / L, 0.0, 0.0
    x = L / Rm
    y = x * (1.0 - alpha / share)
    inverse = 1.0 / H
    E, fall = angle_decay(y)
    if share == 1.0:
        E = E * E
        fall = 2.0 * fall
    C, S, a = turned_angle((hx * ux + hy * uy) * inverse, (hy * ux - hx * uy) * inverse, E)
    # n: d(angle of h)/dh
    nx = -hy * inverse * inverse
    ny = hx * inverse * inverse
    SW = S * fall
    p0 = a * nx
    p1 = a * ny
    along = SW * y / L
    across = (1.0 - a) / L
    q0 = alpha * p0 - across * uy + along * ux
    q1 = alpha * p1 + across * ux + along * uy
    r0 = -0.5 * mu * along * x
    r1 = r0
    den = hx * dx + hy * dy - R * dR
    if alpha > 0.0 and den > 0.0:
        G = (a * (nx * dx + ny * dy) - SW * x / share) / den
        p0 = p0 - G * hx
        p1 = p1 - G * hy
        q0 = q0 - G * alpha * hx
        q1 = q1 - G * alpha * hy
        r0 = r0 + G * R * mu * (1.0 - alpha)
        r1 = r1 + G * R * mu * alpha
    return C * ux - S * uy, C * uy + S * ux, alpha, p0, p1, q0, q1, r0, r1


@njit(cache=True, error_model="numpy", inline="always")
def _closing_force(dx, dy, N0, N1, mu):
    """State and force at the end of an edge that closes: from f = 0 and R = 0 the force follows the
    motion.
    """
    rest = N1 / (N1 - N0)
    R1 = mu * N1
    length = sqrt(dx * dx + dy * dy)
    if rest * length <= R1:
        return CLOSING, rest * dx, rest * dy
    return SLIP, R1 / length * dx, R1 / length * dy


@njit(cache=True, error_model="numpy", inline="always")
def march_edge(fx, fy, dx, dy, N0, N1, mu):
    """(state at the end, f there (2), state in the middle, by (6)) after one edge from f = (fx, fy)
    [N].

    In slip, by is d(angle) at the end by f0 (2), increment (2), N0 and N1.
    """
    end = SEPARATED
    ex = 0.0
    ey = 0.0
    mid = SEPARATED
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if N0 <= 0.0:
        if N1 > 0.0:
            end, ex, ey = _closing_force(dx, dy, N0, N1, mu)
            mid = end if N0 + N1 > 0.0 else SEPARATED
            if end == SLIP:
                L2 = dx * dx + dy * dy
                none = (0.0, 0.0, -dy / L2, dx / L2, 0.0, 0.0)
        return end, ex, ey, mid, none
    Rm = 0.5 * mu * (N0 + N1)
    R1 = mu * N1
    if N1 > 0.0:
        ex = fx + dx
        ey = fy + dy
        if ex * ex + ey * ey <= R1 * R1:
            return STICK, ex, ey, STICK, none
        ex, ey, alpha, p0, p1, q0, q1, r0, r1 = _slipping_force(fx, fy, dx, dy, N0, N1, mu, 1.0)
        return SLIP, R1 * ex, R1 * ey, SLIP if alpha < 0.5 else STICK, (p0, p1, q0, q1, r0, r1)
    if N0 + N1 > 0.0:
        mid = SLIP if (fx + 0.5 * dx) ** 2 + (fy + 0.5 * dy) ** 2 > Rm * Rm else STICK
    return end, ex, ey, mid, none


@njit(cache=True, error_model="numpy", inline="always")
def force_at_middle(fx, fy, dx, dy, N0, N1, mu, mid):
    """f (2) in the middle, where the state is mid, of an edge from f = (fx, fy) [N]; by (6) as edge
    has it.
    """
    Rm = 0.5 * mu * (N0 + N1)
    by = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if mid == SEPARATED:
        return 0.0, 0.0, by
    if mid == STICK:
        return fx + 0.5 * dx, fy + 0.5 * dy, by
    if mid == CLOSING:
        part = 0.5 * (N0 + N1) / (N1 - N0)
        return part * dx, part * dy, by
    if N0 <= 0.0:
        L2 = dx * dx + dy * dy
        scale = Rm / sqrt(L2)
        return scale * dx, scale * dy, (0.0, 0.0, -dy / L2, dx / L2, 0.0, 0.0)
    ux, uy, _, p0, p1, q0, q1, r0, r1 = _slipping_force(fx, fy, dx, dy, N0, N1, mu, 0.5)
    return Rm * ux, Rm * uy, (p0, p1, q0, q1, r0, r1)

"""Periodic state of 2-D Coulomb elements: fixed point of the period map, by marching and by Newton
on its derivative.

In slip the half-angle vector (P, Q) ~ (cos theta/2, sin theta/2) of the force moves by a 2 x 2
matrix on each edge, A = ((1 + E) I + (1 - E) [[ux, uy], [uy, -ux]]) / 2, so that marching needs no
trigonometry and no division. Marching converges, but slowly near the stick limit, where Newton with
the derivative of the period map takes a few periods. The derivative costs next to nothing: stick
leaves it as it is, and along an edge in slip the row of the angle falls by
det A |P, Q|^2 / |A (P, Q)|^2.

Only `empty_trail` makes arrays: elsewhere Numba need not count references (_nrt), which costs as
much as the rest.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from bladefem.friction.coulomb_2d import force_at_middle, march_edge
from bladefem.friction.simd.codegen import zeros
from bladefem.friction.simd.time_kernels import (
    ACROSS,
    AHEAD,
    AWAY,
    EDGE_ROWS,
    FALL,
    LIMIT_AHEAD,
    LIMIT_AWAY,
    PAIR_AHEAD,
    PAIR_AWAY,
    PAIR_TO_P,
    PAIR_TO_Q,
    TWICE_Y,
    find_forces,
    stuck_until,
)
from bladefem.friction.states import SLIP, STICK
from bladefem.util.numba_options import INNER_KERNEL

# of the largest friction limit: how well the force must repeat itself in marching
REPEAT_TOLERANCE = 1e-12
# periods before Newton: load that varies allows several states, and marching chooses
MARCHED_PERIODS = 2
# periods in which Newton's steps need not pay at once: states of the edges have to settle first
FREE_NEWTON_PERIODS = 30
# of det(I - Phi): below it the state keeps a memory of its start
SINGULAR_DETERMINANT = 1e-6
# of the way that is left: how far slow marching leaps
LEAP_SHARE = 0.9
# of the change in the period before: from there on marching is slow
SLOW_CONVERGENCE = 0.7
# of the limit: an edge that reaches no further beyond may be one that only touches it
TOUCH_SHARE = 1e-9
# pieces of a period; a change of state is a piece of one edge
OPEN, STICKING, SLIDING, CHANGING = range(4)


class Trail(NamedTuple):
    """One period of a node along its knots and samples; rows of ``width`` numbers as in
    time_kernels.py.
    """

    # (.., width) edges
    form: np.ndarray
    # (2, width) half-angle vectors of edges that slide
    knots: np.ndarray
    # (width,) 1 where an edge slides
    slips: np.ndarray
    # (S + 1,) of the pieces
    kinds: np.ndarray
    # (S + 1,) their first edges; one more, S, closes the list
    begins: np.ndarray
    # (2, S + 1) at the knots where they begin [N]
    forces: np.ndarray
    # (S + 1, 8) of an edge that changes state: at its end and middle the state; if it slips at
    # its end, d(angle) there by force (2), increment (2), loads at its ends (2)
    changes: np.ndarray


@njit(**INNER_KERNEL)
def empty_trail(S, width):
    """Scratch for one node."""
    form = zeros(EDGE_ROWS * width, np.float64)
    knots = zeros(2 * width, np.float64)
    return Trail(
        form.reshape((EDGE_ROWS, width)),
        knots.reshape((2, width)),
        zeros(width, np.float64),
        np.zeros(S + 1, np.int64),
        np.zeros(S + 1, np.int64),
        np.zeros((2, S + 1)),
        np.zeros((S + 1, 8)),
    )


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def half_angle(x, y):
    """A vector along (cos theta/2, sin theta/2) for the direction (x, y) of unit length."""
    return (1.0 + x, y) if x >= 0.0 else (y, 1.0 - x)


@njit(_nrt=False, **INNER_KERNEL)
def start_force(vx, vy, N, mu):
    """Force at the first knot: k_t w, drawn back onto the circle."""
    R = mu * max(N, 0.0)
    length = sqrt(vx * vx + vy * vy)
    scale = 1.0 if length <= R else R / length
    return scale * vx, scale * vy


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _begin_piece(trail, pieces, kind, i, fx, fy):
    """Note a piece of the period that begins at knot i under the force (fx, fy); the number of
    pieces.
    """
    trail.kinds[pieces] = kind
    trail.begins[pieces] = i
    trail.forces[0, pieces] = fx
    trail.forces[1, pieces] = fy
    return pieces + 1


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _changing_edge(path, i, mu, fx, fy, phi, change):
    """One edge on which the state may change: (state at its end, force there, sample slips, it is
    more than a touch).

    Fills change (8,) and carries on phi (2, 2), of which in slip the first row is that of the
    angle.
    """
    dx = path[0, i + 1] - path[0, i]
    dy = path[1, i + 1] - path[1, i]
    N0 = path[2, i]
    N1 = path[2, i + 1]
    end, ex, ey, mid, by = march_edge(fx, fy, dx, dy, N0, N1, mu)
    change[0] = end
    change[1] = mid
    if end == SLIP:
        p0, p1, change[4], change[5], change[6], change[7] = by
        change[2] = p0
        change[3] = p1
        phi[0, 0], phi[0, 1] = p0 * phi[0, 0] + p1 * phi[1, 0], p0 * phi[0, 1] + p1 * phi[1, 1]
    elif end != STICK:
        phi[:, :] = 0.0
    touch = (1.0 + TOUCH_SHARE) * mu * N1
    return end, ex, ey, mid == SLIP, end == SLIP and (fx + dx) ** 2 + (fy + dy) ** 2 > touch * touch


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _leave_slip(P, Q, R, fade, phi):
    """Force of size R along the half-angle vector; phi (2, 2) from the row of the angle, which fell
    by fade.
    """
    size = P * P + Q * Q
    fx = R * (P * P - Q * Q) / size
    fy = R * 2.0 * P * Q / size
    fall = fade / size
    for c in range(2):
        phi[0, c], phi[1, c] = -fy * fall * phi[0, c], fx * fall * phi[0, c]
    return fx, fy


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _slip_ends(P, Q, form, i):
    """Whether slip under the half-angle vector (P, Q) ends on edge i."""
    return P * (P * form[LIMIT_AHEAD, i] + Q * form[TWICE_Y, i]) < Q * Q * form[LIMIT_AWAY, i]


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _moved_half_angle(P, Q, form, i):
    """Half-angle vector after edge i."""
    return form[AHEAD, i] * P + form[ACROSS, i] * Q, form[ACROSS, i] * P + form[AWAY, i] * Q


@njit(_nrt=False, **INNER_KERNEL, forceinline=True, fastmath={"contract", "nsz"})
def _follow_slip(first, S, P, Q, form, knots):
    """Follow slip from a knot to where it ends: (knot, P, Q) there; by two edges at once, as a
    product is slow.
    """
    form = form[:, first:]
    p = knots[0, first:]
    q = knots[1, first:]
    for i in range(0, S - first - 1, 2):
        if _slip_ends(P, Q, form, i):
            return first + i, P, Q
        p[i] = P
        q[i] = Q
        P1, Q1 = _moved_half_angle(P, Q, form, i)
        if _slip_ends(P1, Q1, form, i + 1):
            return first + i + 1, P1, Q1
        p[i + 1] = P1
        q[i + 1] = Q1
        P, Q = (
            form[PAIR_AHEAD, i] * P + form[PAIR_TO_P, i] * Q,
            form[PAIR_TO_Q, i] * P + form[PAIR_AWAY, i] * Q,
        )
    i = S - first - 1
    if i % 2 == 0:
        if _slip_ends(P, Q, form, i):
            return S - 1, P, Q
        p[i] = P
        q[i] = Q
        P, Q = _moved_half_angle(P, Q, form, i)
    return S, P, Q


@njit(_nrt=False, **INNER_KERNEL, forceinline=True, fastmath={"reassoc"})
def _determinant_product(a, b, form, slips):
    """Note that the edges a <= i < b slide: the product of the determinants of their maps."""
    fall = 1.0
    falls = form[FALL, a:b]
    slips = slips[a:b]
    for i in range(slips.size):
        fall *= falls[i]
        slips[i] = 1.0
    return fall


@njit(_nrt=False, **INNER_KERNEL)
def follow_period(path, mu, fx, fy, trail, phi):
    """One period from (fx, fy) at the first knot: (fx, fy, edges that slip or open, that surely
    slip, samples, pieces).

    The samples are those that slip. path (3, width) is (kt w_1, kt w_2, N) at the knots [N]. Fills
    the trail and phi (2, 2) = df_end/df_start.
    """
    S = trail.kinds.size - 1
    events = 0
    sure = 0
    slips = 0
    pieces = 0
    i = 0
    phi[0, 0] = phi[1, 1] = 1.0
    phi[0, 1] = phi[1, 0] = 0.0
    trail.slips[:] = 0.0
    while i < S:
        if path[2, i] > 0.0:
            cx = fx - path[0, i]
            cy = fy - path[1, i]
            stop = stuck_until(path, path.shape[1], i, S, cx, cy, mu)
            if stop > i:
                pieces = _begin_piece(trail, pieces, STICKING, i, fx, fy)
                i = stop
                fx = cx + path[0, stop]
                fy = cy + path[1, stop]
                if i == S:
                    break
        elif path[2, i + 1] <= 0.0:
            pieces = _begin_piece(trail, pieces, OPEN, i, 0.0, 0.0)
            fx = 0.0
            fy = 0.0
            phi[:, :] = 0.0
            events = events + 1
            i = i + 1
            continue
        pieces = _begin_piece(trail, pieces, CHANGING, i, fx, fy)
        R = mu * path[2, i + 1]
        end, fx, fy, slipped, slipping = _changing_edge(
            path, i, mu, fx, fy, phi, trail.changes[pieces - 1]
        )
        events = events + (end != STICK)
        sure = sure + slipping
        slips = slips + slipped
        i = i + 1
        if end == SLIP and R > 0.0:
            begin, (P, Q) = i, half_angle(fx / R, fy / R)
            fade = P * P + Q * Q
            i, P, Q = _follow_slip(i, S, P, Q, trail.form, trail.knots)
            if i > begin:
                pieces = _begin_piece(trail, pieces, SLIDING, begin, fx, fy)
                fade *= _determinant_product(begin, i, trail.form, trail.slips)
            events = events + i - begin
            sure = sure + i - begin
            slips = slips + i - begin
            fx, fy = _leave_slip(P, Q, mu * path[2, i], fade, phi)
        elif end == SLIP:
            phi[:, :] = 0.0
    trail.begins[pieces] = S
    return fx, fy, events, sure, slips, pieces


@njit(_nrt=False, **INNER_KERNEL, forceinline=True, fastmath={"contract", "nsz"})
def stuck_forces(a, b, fx, fy, path, trace):
    """Forces trace (2, width) at the samples a <= i < b, which stick from the force (fx, fy) at
    knot a on.
    """
    for c, f in ((0, fx), (1, fy)):
        v = path[c, a : b + 1]
        out = trace[c, a:b]
        first = f - path[c, a]
        for i in range(out.size):
            out[i] = first + 0.5 * (v[i] + v[i + 1])


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def middle_force(i, mid, fx, fy, path, mu, trace):
    """Force trace (2, width) at sample i of an edge from (fx, fy) on that changes state; by as
    middle has it.
    """
    dx = path[0, i + 1] - path[0, i]
    dy = path[1, i + 1] - path[1, i]
    N0 = path[2, i]
    N1 = path[2, i + 1]
    trace[0, i], trace[1, i], by = force_at_middle(fx, fy, dx, dy, N0, N1, mu, mid)
    return by


@njit(_nrt=False, **INNER_KERNEL)
def forces_along(path, mu, pieces, trail, trace):
    """Forces trace (2, width) at all samples of a period [N], zero on entry."""
    for piece in range(pieces):
        i = trail.begins[piece]
        kind = trail.kinds[piece]
        fx = trail.forces[0, piece]
        fy = trail.forces[1, piece]
        if kind == STICKING:
            stuck_forces(i, trail.begins[piece + 1], fx, fy, path, trace)
        elif kind == CHANGING:
            middle_force(i, int(trail.changes[piece, 1]), fx, fy, path, mu, trace)
    find_forces(path, trail.form, trail.knots, trail.slips, path.shape[1], mu, trace)


@njit(_nrt=False, **INNER_KERNEL)
def newton_step(fx, fy, gx, gy, R, phi):
    """det(I - Phi) and the fixed point of the linearised period map f -> g, in the circle of radius
    R.
    """
    a = 1.0 - phi[0, 0]
    b = -phi[0, 1]
    c = -phi[1, 0]
    d = 1.0 - phi[1, 1]
    det = a * d - b * c
    if abs(det) < 1e-9:
        return det, gx, gy
    rx = gx - fx
    ry = gy - fy
    x = fx + (d * rx - b * ry) / det
    y = fy + (a * ry - c * rx) / det
    length = sqrt(x * x + y * y)
    if length > R:
        x = x * R / length
        y = y * R / length
    return det, x, y


@njit(_nrt=False, **INNER_KERNEL)
def _has_memory(phi):
    """True if the period map has memory."""
    return phi[0, 0] != 0.0 or phi[0, 1] != 0.0 or phi[1, 0] != 0.0 or phi[1, 1] != 0.0


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _first_force(path, walks, mu):
    """Force at the first knot from which the march begins: k_t w, drawn back onto the circle.

    A motion that walks by path[:, S] - path[:, 0] in each period drags the force to its limit that
    way, where the march would come from kt w as well, after many periods if the walk is short.
    """
    x = path[0, walks] - path[0, 0]
    y = path[1, walks] - path[1, 0]
    R = mu * max(path[2, 0], 0.0)
    length = sqrt(x * x + y * y)
    if not walks or length == 0.0:
        return start_force(path[0, 0], path[1, 0], path[2, 0], mu)
    return R * x / length, R * y / length


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _iterate_newton(path, walks, mu, largest, near, limit, trail, phi):
    """Periodic force by Newton from `_first_force`, returned as by periodic.

    Not unique is also where it ended on the rim of stick, at forces that touch the limit and no
    more.
    """
    scale = mu * largest
    R = mu * max(path[2, 0], 0.0)
    fx, fy = _first_force(path, walks, mu)
    guess = False
    before = np.inf
    sx = 0.0
    sy = 0.0
    for cycle in range(1, limit + 1):
        gx, gy, events, sure, slips, pieces = follow_period(path, mu, fx, fy, trail, phi)
        residual = sqrt((gx - fx) ** 2 + (gy - fy) ** 2)
        det, x, y = newton_step(fx, fy, gx, gy, R, phi)
        still = events == 0 and not walks
        if still or (residual <= REPEAT_TOLERANCE * scale and abs(det) < SINGULAR_DETERMINANT):
            return False, fx, fy, gx, gy, slips, pieces, cycle
        if abs(det) >= SINGULAR_DETERMINANT and sqrt((x - fx) ** 2 + (y - fy) ** 2) <= near * scale:
            return sure > 0 or not _has_memory(phi), fx, fy, gx, gy, slips, pieces, cycle
        # no better than marching: go back and march on
        if guess and cycle > FREE_NEWTON_PERIODS and residual > 0.5 * before:
            fx = sx
            fy = sy
            guess = False
            continue
        before = residual
        sx = gx
        sy = gy
        guess = cycle >= MARCHED_PERIODS and abs(det) >= 1e-9
        fx, fy = (x, y) if guess else (gx, gy)
    return True, fx, fy, gx, gy, slips, pieces, -limit


@njit(_nrt=False, **INNER_KERNEL)
def _state_hash(trail, pieces):
    """A number by which to tell the states of one period from those of another."""
    order = pieces
    for piece in range(pieces):
        order = 31 * order + 4 * trail.begins[piece] + trail.kinds[piece]
        if trail.kinds[piece] == CHANGING:
            order = 31 * order + int(8.0 * trail.changes[piece, 0] + trail.changes[piece, 1])
    return order


@njit(_nrt=False, **INNER_KERNEL)
def _march_with_leaps(path, walks, mu, largest, leap, limit, trail, phi):
    """Periodic force by marching from `_first_force`, with leaps (their share of the way left)
    where it is slow.

    Returned as by periodic.

    The force may approach the corner between the limits of two instants by a little in each period.
    Where two periods in turn have the same states, it leaps along Newton's step, but not all the
    way, so that it keeps coming from the same side; where the states differ after the leap it goes
    back and leaps half as far.
    """
    scale = mu * largest
    R = mu * max(path[2, 0], 0.0)
    fx, fy = _first_force(path, walks, mu)
    bx = fx
    by = fy
    share = leap
    leapt = False
    last = 0
    before = 0.0
    for cycle in range(1, limit + 1):
        gx, gy, events, _, slips, pieces = follow_period(path, mu, fx, fy, trail, phi)
        residual = sqrt((gx - fx) ** 2 + (gy - fy) ** 2)
        order = _state_hash(trail, pieces)
        det, x, y = newton_step(fx, fy, gx, gy, R, phi)
        if leapt and order != last:
            fx = bx
            fy = by
            share = 0.5 * share
            leapt = False
            last = 0
            continue
        if (events == 0 and not walks) or residual <= REPEAT_TOLERANCE * scale:
            return (
                events > 0 and abs(det) >= SINGULAR_DETERMINANT,
                fx,
                fy,
                gx,
                gy,
                slips,
                pieces,
                cycle,
            )
        share = min(2.0 * share, leap) if leapt else share
        leapt = (
            leap > 0.0
            and order == last
            and residual > SLOW_CONVERGENCE * before
            and det >= SINGULAR_DETERMINANT
        )
        bx = gx
        by = gy
        last = order
        before = residual
        fx, fy = (gx + share * (x - gx), gy + share * (y - gy)) if leapt else (gx, gy)
    return True, fx, fy, gx, gy, slips, pieces, -limit


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def periodic_force(path, walks, mu, largest, near, limit, trail, phi):
    """Periodic force: (unique, fx, fy, gx, gy, slips, pieces, cycles), cycles negative if none was
    found in ``limit``.

    walks is the number of samples S where the path goes on by path[:, S] - path[:, 0] in each
    period, else 0.

    The last period went from f to g, and Newton's step from f is at most ``near`` times the limit
    under the largest load: the trail is that of the periodic state but for what is linear in the
    step. Not unique: the state keeps a memory of its start, and so many periods of marching from kt
    w lead there.
    """
    found = _iterate_newton(path, walks, mu, largest, near, limit, trail, phi)
    if not found[0] and found[7] > MARCHED_PERIODS:
        found = _march_with_leaps(path, walks, mu, largest, LEAP_SHARE, limit, trail, phi)
        if not found[0]:
            found = _march_with_leaps(path, walks, mu, largest, 0.0, limit, trail, phi)
    return found

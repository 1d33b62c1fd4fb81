"""Sampled 2-D Coulomb elements, written plainly: the definition of what `bladefem.friction.simd`
computes in vectors, its judge in the tests, and its fallback.

The force is marched from edge to edge of the polygon round the motion (`coulomb_2d.march_edge`),
the force at a sample is that in the middle of its edge (`coulomb_2d.force_at_middle`). Its
derivative by the coefficients is carried along as two rows, with two more columns by the force at
the start. Marching ends when the force repeats itself; the derivative of the periodic force then
follows from that of the period map, where it has one, else from the march itself. Some ten times as
slow as the vector kernel, as it carries the derivative through every period that it marches. Loops
over single numbers take the place of array expressions, which numba compiles for half a minute.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bladefem.friction.coulomb_2d import force_at_middle, march_edge
from bladefem.friction.states import CLOSING, SLIP, STICK
from bladefem.util.numba_options import INNER_KERNEL, KERNEL

# of the largest friction limit: how well the force must repeat itself
REPEAT_TOLERANCE = 1e-12
# of det(I - Phi): below it the state keeps a memory of its start
SINGULAR_DETERMINANT = 1e-6


@njit(**INNER_KERNEL)
def _fill_rows(rows, before, change, state, force, limit, by, mu, closing, part):
    """Fill the rows (2, M) of a force (2,) in its state, after a part of an edge.

    Args:
        before: (2, M) rows of the force at the beginning of the edge.
        change: (4, M) rows of the increment (2), and of the loads at both ends of the edge (2).
        limit: mu N after the part [N].
        by: d(angle) by force (2), increment (2), loads at both ends of the edge.
        closing: share of the increment that a closing contact has felt, its derivatives by the
            loads at both ends, and the increment (2).
        part: of the edge, 0.5 or 1.
    """
    fx, fy = force
    share, by_first, by_last, dx, dy = closing
    growth = mu / limit if limit > 0.0 else 0.0
    for m in range(rows.shape[1]):
        gx = before[0, m]
        gy = before[1, m]
        moved_x = change[0, m]
        moved_y = change[1, m]
        first = change[2, m]
        last = change[3, m]
        if state == STICK:
            rows[0, m] = gx + part * moved_x
            rows[1, m] = gy + part * moved_y
        elif state == CLOSING:
            by_share = by_first * first + by_last * last
            rows[0, m] = share * moved_x + dx * by_share
            rows[1, m] = share * moved_y + dy * by_share
        elif state == SLIP:
            angle = by[0] * gx + by[1] * gy + by[2] * moved_x + by[3] * moved_y
            angle += by[4] * first + by[5] * last
            pressed = growth * ((1.0 - part) * first + part * last)
            rows[0, m] = fx * pressed - fy * angle
            rows[1, m] = fy * pressed + fx * angle
        else:
            rows[0, m] = 0.0
            rows[1, m] = 0.0


@njit(**INNER_KERNEL)
def _fill_change(change, first, last, kt, kn):
    """Fill the rows (4, 3K + 2) of increment and loads from the knots' basis (K,) at both ends of
    an edge; all other columns stay 0.
    """
    K = first.shape[0]
    for k in range(K):
        step = kt * (last[k] - first[k])
        change[0, K + k] = step
        change[1, 2 * K + k] = step
        change[2, k] = kn * first[k]
        change[3, k] = kn * last[k]


@njit(**INNER_KERNEL)
def _add_harmonics(sums, weights, rows):
    """Add the rows (2, M) at one sample to their harmonics sums (2, K, M) by weights (K,)."""
    for c in range(2):
        for k in range(weights.shape[0]):
            for m in range(rows.shape[1]):
                sums[c, k, m] += weights[k] * rows[c, m]


@njit(**INNER_KERNEL)
def _march_period(path, basis, node, weights, f, work, F, sums):
    """One period from the force f (2,) with its rows, both changed to those at its end.

    Fills F (2, K) and sums (2, K, 3K + 2) with the harmonics of the forces at the samples and of
    their rows; returns the number of samples that slip.

    Args:
        work: (8, 3K + 2): the force's rows (2), those at a sample (2), of an edge's change (4).
    """
    kt, kn, mu = node
    S, K = basis.shape
    rows = work[:2]
    at_sample = work[2:4]
    change = work[4:]
    slips = 0
    F[:] = 0.0
    sums[:] = 0.0
    for i in range(S):
        dx = path[0, i + 1] - path[0, i]
        dy = path[1, i + 1] - path[1, i]
        N0 = path[2, i]
        N1 = path[2, i + 1]
        _fill_change(change, basis[i], basis[(i + 1) % S], kt, kn)
        end, ex, ey, mid, by = march_edge(f[0], f[1], dx, dy, N0, N1, mu)
        mx, my, by_mid = force_at_middle(f[0], f[1], dx, dy, N0, N1, mu, mid)
        rise = N1 - N0 if mid == CLOSING or end == CLOSING else 1.0
        by_first = N1 / rise**2
        by_last = -N0 / rise**2
        closing = ((N0 + N1) / (2.0 * rise), by_first, by_last, dx, dy)
        limit = mu * (N0 + N1) / 2.0
        _fill_rows(at_sample, rows, change, mid, (mx, my), limit, by_mid, mu, closing, 0.5)
        closing = (N1 / rise, by_first, by_last, dx, dy)
        _fill_rows(rows, rows, change, end, (ex, ey), mu * N1, by, mu, closing, 1.0)
        for k in range(K):
            F[0, k] += weights[i, k] * mx
            F[1, k] += weights[i, k] * my
        _add_harmonics(sums, weights[i], at_sample)
        slips += mid == SLIP
        f[0] = ex
        f[1] = ey
    return slips


@njit(**INNER_KERNEL)
def _start_force(path, basis, node, f, rows):
    """The force k_t w at the first knot, drawn back onto the circle, and its rows; where the path
    goes on from period to period, the limit that way.
    """
    kt, kn, mu = node
    S, K = basis.shape
    rows[:] = 0.0
    f[0] = path[0, 0]
    f[1] = path[1, 0]
    limit = mu * max(path[2, 0], 0.0)
    way_x = path[0, S] - path[0, 0]
    way_y = path[1, S] - path[1, 0]
    way = np.hypot(way_x, way_y)
    if way > 0.0:
        f[0] = limit / way * way_x
        f[1] = limit / way * way_y
        return
    for k in range(K):
        rows[0, K + k] = kt * basis[0, k]
        rows[1, 2 * K + k] = kt * basis[0, k]
    size = np.hypot(f[0], f[1])
    if size > limit:
        ux = f[0] / size
        uy = f[1] / size
        for m in range(3 * K):
            across = (ux * rows[1, m] - uy * rows[0, m]) * limit / size
            pressed = mu * kn * basis[0, m] if m < K and limit > 0.0 else 0.0
            rows[0, m] = ux * pressed - uy * across
            rows[1, m] = uy * pressed + ux * across
        f[0] = ux * limit
        f[1] = uy * limit


@njit(**INNER_KERNEL)
def _fill_jacobian(J, sums, rows, before):
    """Fill J (2, K, M) of the periodic force: harmonics sums (2, K, M + 2) of a march's rows, with
    those of the periodic start, x, in place of the march's, before (2, M).

    The rows (2, M + 2) at the end are  Phi x + q,  Phi their last two columns; x = Phi x + q  where
    the period map has such a state.
    """
    K, M = J.shape[1:]
    for c in range(2):
        for k in range(K):
            for m in range(M):
                J[c, k, m] = sums[c, k, m]
    a = 1.0 - rows[0, M]
    b = -rows[0, M + 1]
    c = -rows[1, M]
    d = 1.0 - rows[1, M + 1]
    determinant = a * d - b * c
    if abs(determinant) <= SINGULAR_DETERMINANT:
        return
    for m in range(M):
        q0 = rows[0, m] - before[0, m]
        q1 = rows[1, m] - before[1, m]
        x0 = (d * q0 - b * q1) / determinant
        x1 = (a * q1 - c * q0) / determinant
        for k in range(K):
            J[0, k, m] += sums[0, k, M] * x0 + sums[0, k, M + 1] * x1
            J[1, k, m] += sums[1, k, M] * x0 + sums[1, k, M + 1] * x1


@njit(**INNER_KERNEL)
def _periodic_force(path, basis, node, weights, limit, F, J):
    """Fill F (2, K) and J (2, K, 3K) of the periodic state; returns samples that slip, and cycles,
    negative where the force does not repeat itself.
    """
    S, K = basis.shape
    M = 3 * K
    f = np.empty(2)
    work = np.zeros((8, M + 2))
    before = np.empty((2, M + 2))
    sums = np.empty((2, K, M + 2))
    rows = work[:2]
    _start_force(path, basis, node, f, rows)
    largest = 0.0
    for i in range(S + 1):
        largest = max(largest, path[2, i])
    for cycle in range(1, limit + 1):
        fx = f[0]
        fy = f[1]
        for c in range(2):
            for m in range(M):
                before[c, m] = rows[c, m]
            for column in range(2):
                rows[c, M + column] = 1.0 if c == column else 0.0
        slips = _march_period(path, basis, node, weights, f, work, F, sums)
        if np.hypot(f[0] - fx, f[1] - fy) <= REPEAT_TOLERANCE * node[2] * largest:
            _fill_jacobian(J, sums, rows, before)
            return slips, cycle
    return slips, -limit


@njit(**INNER_KERNEL)
def _fill_path(path, w, ramp, load, knots, node, n0):
    """Fill the path (3, S + 1) at the knots: k_t times the tangential motion, and the normal load;
    arguments are those of one element of `plain_batch`.
    """
    kt, kn, _ = node
    S, K = knots.shape
    for i in range(S + 1):
        path[0, i] = ramp[0] * i / S
        path[1, i] = ramp[1] * i / S
        path[2, i] = 0.0
        for k in range(K):
            for c in range(2):
                path[c, i] += knots[i % S, k] * w[1 + c, k]
            path[2, i] += knots[i % S, k] * w[0, k]
        path[0, i] *= kt
        path[1, i] *= kt
        path[2, i] *= kn
        path[2, i] += 0.5 * (load[i % S] + load[i - 1]) if load.shape[0] else n0


@njit(**INNER_KERNEL)
def _normal_force(w, load, tab, kn, n0, F, J):
    """Fill F (K,) and J (K, K) of the normal force from the normal motion w (K,); returns the
    number of samples that are closed.
    """
    S, K = tab.at.shape
    F[:] = 0.0
    J[:] = 0.0
    closed = 0
    for i in range(S):
        force = 0.0
        for k in range(K):
            force += tab.at[i, k] * w[k]
        force = kn * force + (load[i] if load.shape[0] else n0)
        if force <= 0.0:
            continue
        closed += 1
        for k in range(K):
            F[k] += tab.analysis[i, k] * force
            for l in range(K):
                J[k, l] += kn * tab.analysis[i, k] * tab.at[i, l]
    return closed


@njit(**KERNEL)
def plain_batch(w, ramp, load, nodes, tab, limit, F, J, shares, cycles):
    """Forces F (n, 3, K), Jacobian J (n, 3, K, 3K), shares (n, 3) of stick, slip and separation,
    cycles (n,): arguments as `bladefem.friction.simd.kernel_2d.disc_batch` has them, but for the
    patterns.
    """
    S, K = tab.at.shape
    path = np.empty((3, S + 1))
    for e in range(w.shape[0]):
        kt, kn, mu, n0 = nodes[e]
        node = (kt, kn, mu)
        J[e] = 0.0
        _fill_path(path, w[e], ramp[e], load[e], tab.knots, node, n0)
        closed = _normal_force(w[e, 0], load[e], tab, kn, n0, F[e, 0], J[e, 0, :, :K])
        slips, cycles[e] = _periodic_force(
            path, tab.knots, node, tab.analysis, limit, F[e, 1:], J[e, 1:]
        )
        shares[e, 1] = slips / S
        shares[e, 2] = 1.0 - closed / S
        shares[e, 0] = 1.0 - shares[e, 1] - shares[e, 2]

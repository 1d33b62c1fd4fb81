"""Sampled 2-D Coulomb elements, written plainly: the definition of what `bladefem.friction.simd`
computes in vectors, its judge in the tests, and its fallback.

The force is marched from edge to edge of the polygon round the motion (`coulomb_2d.march_edge`),
the force at a sample is that in the middle of its edge (`coulomb_2d.force_at_middle`). Its
derivative by the coefficients is carried along as two rows, with two more columns by the force at
the start. Marching ends when the force repeats itself; the derivative of the periodic force then
follows from that of the period map, where it has one, else from the march itself. Some 35 to 70
times as slow as the vector kernel, as it carries the derivative through every period that it
marches.
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
def _rows_at(state, f, limit, rise, by, before, change, mu, pressed):
    """Rows (2, M) of the force f (2,) in its state, after a change of the motion.

    Args:
        limit: mu N there [N], and pressed (M,) the row of N there.
        rise: share of the change that a closing contact has felt, with its derivative's row (M,).
        by: d(angle) by force (2), increment (2), loads at both ends of the edge.
        before: (2, M) rows of the force at the beginning of the edge.
        change: (2, M) rows of the increment, then the loads at both ends (2, M).
    """
    rows = np.zeros(before.shape)
    moved, loads, increment = change
    if state == STICK:
        rows[:] = before + moved
    elif state == CLOSING:
        share, by_share = rise
        for c in range(2):
            rows[c] = share * moved[c] + increment[c] * by_share
    elif state == SLIP:
        angle = by[0] * before[0] + by[1] * before[1]
        angle += by[2] * moved[0] + by[3] * moved[1] + by[4] * loads[0] + by[5] * loads[1]
        growth = mu / limit if limit > 0.0 else 0.0
        rows[0] = -f[1] * angle + f[0] * growth * pressed
        rows[1] = f[0] * angle + f[1] * growth * pressed
    return rows


@njit(**KERNEL)
def _march_period(path, basis, node, weights, f, rows, F, sums):
    """One period from the force f (2,) with its rows (2, 3K + 2), both changed to those at its end.

    Fills F (2, K) and sums (2, K, 3K + 2) with the harmonics of the forces at the samples and of
    their rows; returns the number of samples that slip.
    """
    kt, kn, mu = node
    S, K = weights.shape
    M = rows.shape[1]
    slips = 0
    F[:] = 0.0
    sums[:] = 0.0
    for i in range(S):
        dx = path[0, i + 1] - path[0, i]
        dy = path[1, i + 1] - path[1, i]
        N0 = path[2, i]
        N1 = path[2, i + 1]
        moved = np.zeros((2, M))
        loads = np.zeros((2, M))
        after = (i + 1) % S
        moved[0, K : 2 * K] = kt * (basis[after] - basis[i])
        moved[1, 2 * K : 3 * K] = kt * (basis[after] - basis[i])
        loads[0, :K] = kn * basis[i]
        loads[1, :K] = kn * basis[after]
        change = (moved, loads, (dx, dy))
        end, ex, ey, mid, by = march_edge(f[0], f[1], dx, dy, N0, N1, mu)
        mx, my, by_mid = force_at_middle(f[0], f[1], dx, dy, N0, N1, mu, mid)
        # in the middle half of the increment is felt, or what a closing contact has felt of it
        rise = N1 - N0 if mid == CLOSING or end == CLOSING else 1.0
        half = (loads[0] + loads[1]) / 2
        shares = ((N1 * loads[0] - N0 * loads[1]) / rise**2, (N0 + N1) / (2 * rise))
        if mid == STICK:
            at_sample = rows + moved / 2
        else:
            at_sample = _rows_at(
                mid,
                (mx, my),
                mu * (N0 + N1) / 2,
                (shares[1], shares[0]),
                by_mid,
                rows,
                change,
                mu,
                half,
            )
        for k in range(K):
            F[0, k] += weights[i, k] * mx
            F[1, k] += weights[i, k] * my
            sums[0, k] += weights[i, k] * at_sample[0]
            sums[1, k] += weights[i, k] * at_sample[1]
        slips += mid == SLIP
        rows[:] = _rows_at(
            end, (ex, ey), mu * N1, (N1 / rise, shares[0]), by, rows, change, mu, loads[1]
        )
        f[0] = ex
        f[1] = ey
    return slips


@njit(**INNER_KERNEL)
def _start_force(path, basis, node, f, rows):
    """The force k_t w at the first knot, drawn back onto the circle, and its rows; where the path
    goes on from period to period, the limit that way.
    """
    kt, kn, mu = node
    K = basis.shape[1]
    rows[:] = 0.0
    f[:] = path[:2, 0]
    limit = mu * max(path[2, 0], 0.0)
    way = path[:2, -1] - path[:2, 0]
    if np.hypot(way[0], way[1]) > 0.0:
        f[:] = limit / np.hypot(way[0], way[1]) * way
        return
    size = np.hypot(f[0], f[1])
    rows[0, K : 2 * K] = kt * basis[0]
    rows[1, 2 * K : 3 * K] = kt * basis[0]
    if size > limit:
        ux = f[0] / size
        uy = f[1] / size
        across = (ux * rows[1] - uy * rows[0]) * limit / size
        pressed = np.zeros(rows.shape[1])
        if limit > 0.0:
            pressed[:K] = mu * kn * basis[0]
        rows[0] = -uy * across + ux * pressed
        rows[1] = ux * across + uy * pressed
        f[0] = ux * limit
        f[1] = uy * limit


@njit(**INNER_KERNEL)
def _periodic_force(path, basis, node, weights, limit, F, J):
    """Fill F (2, K) and J (2, K, 3K) of the periodic state; returns samples that slip, and cycles,
    negative where the force does not repeat itself.
    """
    K = basis.shape[1]
    M = 3 * K
    f = np.empty(2)
    rows = np.zeros((2, M + 2))
    sums = np.empty((2, K, M + 2))
    _start_force(path, basis, node, f, rows)
    scale = node[2] * max(path[2].max(), 0.0)
    for cycle in range(1, limit + 1):
        fx = f[0]
        fy = f[1]
        rows[:, M:] = np.eye(2)
        before = rows[:, :M].copy()
        slips = _march_period(path, basis, node, weights, f, rows, F, sums)
        if np.hypot(f[0] - fx, f[1] - fy) <= REPEAT_TOLERANCE * scale:
            left = np.eye(2) - rows[:, M:]
            J[:] = sums[:, :, :M]
            if abs(left[0, 0] * left[1, 1] - left[0, 1] * left[1, 0]) > SINGULAR_DETERMINANT:
                # the periodic start's rows x fulfil  x = Phi x + q,  those of the march were before
                shift = np.linalg.solve(left, rows[:, :M].copy() - before)
                for c in range(2):
                    J[c] += np.dot(np.ascontiguousarray(sums[c, :, M:]), shift)
            return slips, cycle
    return slips, -limit


@njit(**KERNEL)
def plain_batch(w, ramp, load, nodes, tab, limit, F, J, shares, cycles):
    """Forces F (n, 3, K), Jacobian J (n, 3, K, 3K), shares (n, 3) of stick, slip and separation,
    cycles (n,): arguments as `bladefem.friction.simd.kernel_2d.disc_batch` has them, but for the
    patterns.
    """
    S, K = tab.at.shape
    weights = np.ascontiguousarray(tab.analysis[:S])
    path = np.empty((3, S + 1))
    for e in range(w.shape[0]):
        kt, kn, mu, n0 = nodes[e]
        sampled = np.dot(tab.at, kn * w[e, 0])
        for i in range(S + 1):
            knot = tab.knots[i % S]
            path[0, i] = kt * np.dot(knot, w[e, 1])
            path[1, i] = kt * np.dot(knot, w[e, 2])
            path[2, i] = kn * np.dot(knot, w[e, 0])
            path[0, i] += kt * ramp[e, 0] * i / S
            path[1, i] += kt * ramp[e, 1] * i / S
            path[2, i] += 0.5 * (load[e, i % S] + load[e, i - 1]) if load.shape[1] else n0
        if load.shape[1]:
            sampled += load[e]
        else:
            sampled += n0
        F[e] = 0.0
        J[e] = 0.0
        closed = sampled > 0.0
        for k in range(K):
            F[e, 0, k] = np.sum(weights[:, k] * np.maximum(sampled, 0.0))
            for l in range(K):
                J[e, 0, k, l] = kn * np.sum(weights[:, k] * closed * tab.at[:, l])
        slips, cycles[e] = _periodic_force(
            path, tab.knots, (kt, kn, mu), weights, limit, F[e, 1:], J[e, 1:]
        )
        shares[e, 1] = slips / S
        shares[e, 2] = 1.0 - np.mean(closed)
        shares[e, 0] = 1.0 - shares[e, 1] - shares[e, 2]

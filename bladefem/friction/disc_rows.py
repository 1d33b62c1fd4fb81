"""Running derivative of a 2-D element: rows of d(force)/d(coefficients) over one period.

Rows have W columns for each of normal, first and second tangential coefficients, W the K = 2H+1 coefficients filled up
to a multiple of 8, and M in all. The columns K and W + K take the derivative with the force at the start of the period;
they carry the derivative Phi of the period map, and that of the periodic state follows from D = Phi D + d. In stick the
derivative is carried as C = D - kt V, which stays, so that a whole stretch of stick costs one rank-one update. In slip
only the row of the angle is carried; the rows of all samples are kept, and summed at the end of the period.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from bladefem.friction.disc import CLOSING, SLIP, STICK, sensitivity
from bladefem.friction.lane_kernels import TURNS, add_folded, find_turns, join_rows, turn_rows
from bladefem.friction.lanes import BLOCK
from bladefem.friction.orbit import CHANGING, SLIDING, STICKING
from bladefem.friction.tables import Patterns

__all__ = ["Rows", "add_period", "close", "empty_rows", "start_rows", "to_carry", "unit_rows"]

FAST = {"contract", "reassoc", "nsz"}
LOT = 64            # samples after which a row is looked at for faint numbers
FAINT, SHORT_FAINT = 1e-60, 1e-30       # of 8 and of 4 bytes: forgotten before they become denormal and slow


class Rows(NamedTuple):
    """Scratch of one 2-D element, rows in the precision of the patterns; M and width as in lane_kernels.py."""

    J: np.ndarray           # (2, tiled, M) summed rows, first and second tangent
    stick: np.ndarray       # (4H+1,) basis means of the samples in stick
    C: np.ndarray           # (2, M) carried rows
    closing: np.ndarray     # (2, M) rows at a sample in which the element closes
    row: np.ndarray         # (M,) row of the angle in slip
    rows: np.ndarray        # (S + 1, M) rows of the angle at the samples; the last stands for none and is zero
    turns: np.ndarray       # (7, width) how the row turns
    g: np.ndarray           # (2, width) factors from a sample's row to those of the force [N]
    chosen: np.ndarray      # numbers of the fours with samples that slip
    patterns: Patterns


@njit(cache=True, error_model="numpy")
def empty_rows(tab, patterns):
    """Scratch for one node."""
    (S, W), tile, width, dtype = patterns.at.shape, patterns.weights.shape[1], tab.along.shape[1], patterns.at.dtype
    lanes = BLOCK // patterns.at.itemsize
    M = (3 * W + lanes - 1) // lanes * lanes
    return Rows(np.zeros((2, tile, M), dtype), np.zeros(tab.sums.shape[1]), np.zeros((2, M), dtype),
                np.zeros((2, M), dtype), np.zeros(M, dtype), np.zeros((S + 1, M), dtype),
                np.zeros((TURNS, width), dtype), np.zeros((2, width), dtype), np.zeros(tab.fours.shape[0], np.int64),
                patterns)


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _angle_row(C, i, by, el, tab, row):
    """Row (M,) of the angle of a slipping force, from by (6,): by force (2), increment (2), N_i and N_j."""
    K, W, p0, p1, q0, q1, r0, r1 = tab.at.shape[1], tab.W, *by
    j = i + 1 if i + 1 < tab.at.shape[0] else 0
    for l in range(row.size):
        row[l] = p0 * C[0, l] + p1 * C[1, l]
    for l in range(K):
        V, U = tab.knots[i, l], tab.knots[j, l]
        row[l] += el.kn * (r0 * V + r1 * U)
        row[W + l] += el.kt * (p0 * V + q0 * (U - V))
        row[2 * W + l] += el.kt * (p1 * V + q1 * (U - V))


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True)
def _closing_rows(i, dx, dy, N0, N1, part, el, tab, out):
    """Rows out (2, M) of f = part d, part = N / (N1 - N0), of an element that closes in edge i and sticks."""
    K, W, j = tab.at.shape[1], tab.W, i + 1 if i + 1 < tab.at.shape[0] else 0
    out[:] = 0.0
    for l in range(K):
        change = el.kn * (N1 * tab.knots[i, l] - N0 * tab.knots[j, l]) / (N1 - N0) ** 2
        out[0, l], out[1, l] = dx * change, dy * change
        out[0, W + l] = out[1, 2 * W + l] = el.kt * part * (tab.knots[j, l] - tab.knots[i, l])


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True)
def to_carry(C, j, kt, tab):
    """C (2, M) from D to D - kt V at knot j."""
    W = tab.W
    for l in range(tab.at.shape[1]):
        C[0, W + l] -= kt * tab.knots[j, l]
        C[1, 2 * W + l] -= kt * tab.knots[j, l]


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _add_stick(a, b, tab, scratch):
    """Add samples a <= i < b, which stick with the carried rows C."""
    C, J, stick = scratch.C, scratch.J, scratch.stick
    for p in range(stick.size):
        stick[p] += tab.sums[b, p] - tab.sums[a, p]
    for k in range(tab.at.shape[1]):
        weight = (tab.sums[b, k] - tab.sums[a, k]) * (2.0 if k else 1.0)
        for e in range(2):
            for l in range(C.shape[1]):
                J[e, k, l] += weight * C[e, l]


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True)
def _slide(a, b, scratch):
    """Turn the row of the angle along the edges a <= i < b."""
    row, patterns, faint = scratch.row, scratch.patterns, FAINT if scratch.row.itemsize == 8 else SHORT_FAINT
    while a < b:
        stop = min(b, a + LOT)
        turn_rows(scratch.turns, patterns.at, patterns.change, a, stop, row, scratch.rows)
        for l in range(row.size):
            if abs(row[l]) < faint:
                row[l] = 0.0
        a = stop


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True)
def _add_mixed(i, mid, fx, fy, path, el, tab, scratch, slips, normal, trace):
    """Add sample i of an edge that changes state and slips there or closes, from the force (fx, fy) at its begin."""
    dx, dy, N0, N1 = path[0, i + 1] - path[0, i], path[1, i + 1] - path[1, i], path[2, i], path[2, i + 1]
    if mid == SLIP:
        _angle_row(scratch.C, i, sensitivity(fx, fy, dx, dy, N0, N1, el.mu, 0.5), el, tab, scratch.rows[i])
        N = max(0.5 * (N0 + N1), 1e-300)
        scratch.g[0, i], scratch.g[1, i], slips[i] = -trace[1, i], trace[0, i], 1.0
        normal[0, i], normal[1, i] = el.kn * trace[0, i] / N, el.kn * trace[1, i] / N
    elif mid == CLOSING:
        rows = scratch.closing
        _closing_rows(i, dx, dy, N0, N1, 0.5 * (N0 + N1) / (N1 - N0), el, tab, rows)
        for e in range(2):
            for k in range(tab.at.shape[1]):
                for l in range(rows.shape[1]):
                    scratch.J[e, k, l] += tab.analysis[i, k] * rows[e, l]


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True)
def _after_mixed(i, end, by, path, el, tab, scratch):
    """Bring C (2, M), and in slip the row of the angle, from knot i over an edge that changes state."""
    C = scratch.C
    if end == SLIP:
        _angle_row(C, i, (by[0], by[1], by[2], by[3], by[4], by[5]), el, tab, scratch.row)
        return
    C[:] = 0.0
    if end == CLOSING:
        dx, dy, N0, N1 = path[0, i + 1] - path[0, i], path[1, i + 1] - path[1, i], path[2, i], path[2, i + 1]
        _closing_rows(i, dx, dy, N0, N1, N1 / (N1 - N0), el, tab, C)
        to_carry(C, i + 1 if i + 1 < tab.at.shape[0] else 0, el.kt, tab)


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True, fastmath=FAST)
def _leave_slip(fx, fy, i, N, el, tab, scratch):
    """D from the row of the angle goes to C (2, M), at knot i under the force (fx, fy)."""
    C, row = scratch.C, scratch.row
    for l in range(row.size):
        C[0, l] = -fy * row[l]
        C[1, l] = fx * row[l]
    for l in range(tab.at.shape[1]):
        C[0, l] += el.kn * fx / N * tab.knots[i, l]
        C[1, l] += el.kn * fy / N * tab.knots[i, l]


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True)
def _turns(path, pieces, el, trail, scratch, normal, trace):
    """How the row of the angle turns along all edges that slide; their forces and factors."""
    scratch.g[:], normal[:] = 0.0, 0.0
    for piece in range(pieces):
        if trail.kinds[piece] == SLIDING:
            find_turns(trail.begins[piece], trail.begins[piece + 1], path, trail.form, trail.knots, trail.slips,
                       path.shape[1], el.kt, el.kn, el.mu, scratch.turns, scratch.g, normal, trace)


@njit(_nrt=False, cache=True, error_model="numpy")
def add_period(path, fx, fy, pieces, el, tab, trail, scratch, normal, trace, summing):
    """Carry the derivative C (2, M) through the period of the trail, which ends with the force (fx, fy).

    If it is summing, it fills J and stick of the scratch, trace (2, width) where edges slide and normal (2, width),
    which is n in rows n p_0 of the force (find_turns).
    """
    C, forces, run, slipping = scratch.C, trail.forces, -1, False   # run: first sample of the present stretch of stick
    _turns(path, pieces, el, trail, scratch, normal, trace)
    if summing:
        scratch.J[:], scratch.stick[:] = 0.0, 0.0
    for piece in range(pieces):
        i, kind, ax, ay = trail.begins[piece], trail.kinds[piece], forces[0, piece], forces[1, piece]
        if kind == SLIDING:
            _slide(i, trail.begins[piece + 1], scratch)
            continue
        if slipping:
            _leave_slip(ax, ay, i, path[2, i], el, tab, scratch)
            to_carry(C, i, el.kt, tab)
            slipping = False
        if kind == STICKING and run < 0:
            run = i
        if kind == CHANGING:
            change = trail.changes[piece]
            end, mid = int(change[0]), int(change[1])
            if mid == STICK and run < 0:
                run = i
            if summing:
                if run >= 0:
                    _add_stick(run, i + (mid == STICK), tab, scratch)
                _add_mixed(i, mid, ax, ay, path, el, tab, scratch, trail.slips, normal, trace)
            run, slipping = -1, end == SLIP
            if end != STICK:
                _after_mixed(i, end, change[2:], path, el, tab, scratch)
    if run >= 0 and summing:
        _add_stick(run, tab.at.shape[0], tab, scratch)
    if slipping:
        _leave_slip(fx, fy, 0, path[2, 0], el, tab, scratch)
    elif path[2, 0] > 0.0:
        to_carry(C, 0, -el.kt, tab)
    else:
        C[:] = 0.0
    if summing:
        _add_slip(trail.slips, tab, scratch)


@njit(_nrt=False, cache=True, error_model="numpy", forceinline=True)
def _add_slip(slips, tab, scratch):
    """Add the samples that slip, fours without one left out."""
    count, fours = 0, tab.fours
    for q in range(fours.shape[0]):
        if slips[fours[q, 0]] + slips[fours[q, 1]] + slips[fours[q, 2]] + slips[fours[q, 3]] > 0.0:
            scratch.chosen[count] = q
            count += 1
    add_folded(scratch.rows, scratch.g, fours, scratch.chosen, count, scratch.patterns.weights, scratch.J)


@njit(_nrt=False, cache=True, error_model="numpy")
def unit_rows(kt, tab, C):
    """Carried rows C (2, M) of a force at the first knot that is given."""
    K, W = tab.at.shape[1], tab.W
    C[:] = 0.0
    C[0, K] = C[1, W + K] = 1.0
    to_carry(C, 0, kt, tab)


@njit(_nrt=False, cache=True, error_model="numpy")
def start_rows(vx, vy, N, el, tab, C):
    """Carried rows C (2, M) of the force at the first knot: kt w = (vx, vy) drawn back onto the circle mu N."""
    K, W = tab.at.shape[1], tab.W
    C[:] = 0.0
    R = el.mu * max(N, 0.0)
    length = np.hypot(vx, vy)
    if length <= R:
        return
    ex, ey = vx / length, vy / length
    for l in range(K):
        turn = el.kt * R / length * tab.knots[0, l]
        C[0, W + l], C[0, 2 * W + l] = ey * ey * turn, -ex * ey * turn
        C[1, W + l], C[1, 2 * W + l] = -ex * ey * turn, ex * ex * turn
        if R > 0.0:
            C[0, l], C[1, l] = ex * el.mu * el.kn * tab.knots[0, l], ey * el.mu * el.kn * tab.knots[0, l]
    to_carry(C, 0, el.kt, tab)


@njit(_nrt=False, cache=True, error_model="numpy", fastmath=FAST, forceinline=True)
def close(rx, ry, tab, scratch, F, J):
    """J (2, K, 3K) and what F (3, K) lacks, from the sums, the rows C (2, M) at the end and its misfit (rx, ry).

    The start of the period is moved to the fixed point of the linearised map.
    """
    C, K, W = scratch.C, F.shape[1], tab.W
    a, b, c, d = 1.0 - C[0, K], -C[0, W + K], -C[1, K], 1.0 - C[1, W + K]
    det = a * d - b * c
    mx, my = (d * rx - b * ry) / det, (a * ry - c * rx) / det
    for l in range(C.shape[1]):      # D at the start of the period takes the place of C
        x, y = C[0, l], C[1, l]
        C[0, l], C[1, l] = (d * x - b * y) / det, (a * y - c * x) / det
    for e in range(2):
        for k in range(K):
            px, py = scratch.J[e, k, K], scratch.J[e, k, W + K]
            F[1 + e, k] += px * mx + py * my
    join_rows(scratch.J, scratch.J.shape[1], C.shape[1], C, K, W, J)
    for l in range(K):      # the last row, which blocks of eight would leave
        for part in range(3):
            m = part * W + l
            J[1, K - 1, part * K + l] = (scratch.J[1, K - 1, m] + scratch.J[1, K - 1, K] * C[0, m]
                                         + scratch.J[1, K - 1, W + K] * C[1, m])

"""Running derivative of a 2-D element: rows of d(force)/d(coefficients) over one period.

Rows have W columns for each of normal, first and second tangential coefficients, W the K = 2H+1
coefficients filled up to a multiple of 8, and M in all. The columns K and W + K take the derivative
with the force at the start of the period; they carry the derivative Phi of the period map, and that
of the periodic state follows from D = Phi D + d. In stick the derivative is carried as C = D - kt
V, which stays, so that a whole stretch of stick costs one rank-one update. In slip only the row of
the angle is carried; the rows of all samples are kept, and summed at the end of the period.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from bladefem.friction.simd.codegen import zeros
from bladefem.friction.simd.periodic_state import (
    CHANGING,
    SLIDING,
    STICKING,
    middle_force,
    stuck_forces,
)
from bladefem.friction.simd.row_kernels import (
    add_folded,
    add_products,
    combine_rows,
    join_rows,
    turn_rows,
)
from bladefem.friction.simd.time_kernels import TURN_ROWS, find_turns
from bladefem.friction.states import CLOSING, SLIP, STICK
from bladefem.friction.trigonometric_tables import Patterns, empty_gram, gram_matrix
from bladefem.util.numba_options import INNER_KERNEL

FAST_MATH_FLAGS = {"contract", "reassoc", "nsz"}
# samples after which a row is searched for nearly denormal numbers
SAMPLES_BETWEEN_FLUSHES = 64
# of 8 and of 4 bytes: flush-to-zero thresholds: smaller numbers would become denormal and slow
FLUSH_TO_ZERO = 1e-60
FLUSH_TO_ZERO_SINGLE = 1e-30


class Rows(NamedTuple):
    """Scratch of one 2-D element, rows of M = 3 W numbers in the precision of the patterns, as in
    row_kernels.py.
    """

    # (2, tiled, M) summed rows, first and second tangent
    J: np.ndarray
    # (4H+1,) basis means of the samples in stick
    stick: np.ndarray
    # (K, W) their Gram matrix
    gram: np.ndarray
    # (2, ..) scratch of gram
    around: np.ndarray
    # (K,) coefficients of the samples of one stretch of stick
    share: np.ndarray
    # (2, M) carried rows
    C: np.ndarray
    # (2, M) rows at a sample in which the element closes
    closing: np.ndarray
    # (M,) row of the angle in slip
    row: np.ndarray
    # (S + 1, M) rows of the angle at the samples; the last is no sample and is zero
    rows: np.ndarray
    # (7, width) how the row turns
    turns: np.ndarray
    # (2, width) factors from a sample's row to those of the force [N]
    g: np.ndarray
    # (2, width) n in the rows n p_0 of the force, p_0 the pattern of the normal load [N/m]
    normal: np.ndarray
    # numbers of the fours with samples that slip
    chosen: np.ndarray
    patterns: Patterns


@njit(**INNER_KERNEL)
def empty_rows(tab, patterns):
    """Scratch for one node."""
    (S, W), tile, width, dtype = (
        patterns.change.shape,
        patterns.weights.shape[1],
        tab.along.shape[1],
        patterns.at.dtype,
    )
    K = tab.at.shape[1]
    M = 3 * W
    return Rows(
        zeros(2 * tile * M, dtype).reshape((2, tile, M)),
        np.zeros(tab.sums.shape[1]),
        np.zeros((K, W), dtype),
        empty_gram(K // 2),
        np.zeros(K),
        zeros(2 * M, dtype).reshape((2, M)),
        np.zeros((2, M), dtype),
        zeros(M, dtype),
        zeros((S + 1) * M, dtype).reshape((S + 1, M)),
        zeros(TURN_ROWS * width, dtype).reshape((TURN_ROWS, width)),
        zeros(2 * width, dtype).reshape((2, width)),
        zeros(2 * width, dtype).reshape((2, width)),
        np.zeros(tab.fours.shape[0], np.int64),
        patterns,
    )


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _angle_row(i, by, el, scratch, row):
    """Row (M,) of the angle of a slipping force, from by (6,): by force (2), increment (2), N_i and
    N_j.
    """
    C, knots, (p0, p1, q0, q1, r0, r1) = scratch.C, scratch.patterns.knots, by
    parts = el.kn * r0, el.kt * (p0 - q0), el.kt * (p1 - q1), el.kn * r1, el.kt * q0, el.kt * q1
    combine_rows(
        p0,
        C[0],
        p1,
        C[1],
        parts,
        i,
        i + 1 if i + 1 < knots.shape[0] else 0,
        knots,
        knots.shape[1],
        row,
    )


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _closing_rows(i, dx, dy, N0, N1, part, el, tab, out):
    """Rows out (2, M) of f = part d, part = N / (N1 - N0), of an element that closes in edge i and
    sticks.
    """
    K = tab.at.shape[1]
    W = tab.W
    j = i + 1 if i + 1 < tab.at.shape[0] else 0
    out[:] = 0.0
    for l in range(K):
        change = el.kn * (N1 * tab.knots[i, l] - N0 * tab.knots[j, l]) / (N1 - N0) ** 2
        out[0, l], out[1, l] = dx * change, dy * change
        out[0, W + l] = out[1, 2 * W + l] = el.kt * part * (tab.knots[j, l] - tab.knots[i, l])


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def to_carry(C, j, kt, tab):
    """C (2, M) from D to D - kt V at knot j."""
    W = tab.W
    for l in range(tab.at.shape[1]):
        C[0, W + l] -= kt * tab.knots[j, l]
        C[1, 2 * W + l] -= kt * tab.knots[j, l]


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _add_stick(a, b, tab, scratch):
    """Add samples a <= i < b, which stick with the carried rows C."""
    stick = scratch.stick
    share = scratch.share
    J = scratch.J
    for p in range(stick.size):
        mean = tab.sums[b, p] - tab.sums[a, p]
        stick[p] += mean
        if p < share.size:
            share[p] = 2.0 * mean if p else mean
    add_products(share, share.size, scratch.C, J.shape[2], J, J.shape[1])


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _slide_row(a, b, scratch):
    """Turn the row of the angle along the edges a <= i < b."""
    row = scratch.row
    patterns = scratch.patterns
    flush_below = FLUSH_TO_ZERO if scratch.row.itemsize == 8 else FLUSH_TO_ZERO_SINGLE
    while a < b:
        stop = min(b, a + SAMPLES_BETWEEN_FLUSHES)
        turn_rows(scratch.turns, patterns.at, patterns.change, a, stop, row, scratch.rows)
        for l in range(row.size):
            if abs(row[l]) < flush_below:
                row[l] = 0.0
        a = stop


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _add_mixed(i, mid, fx, fy, path, el, tab, scratch, slips, trace):
    """Add sample i of an edge that changes state and slips there or closes, from the force (fx, fy)
    at its begin.
    """
    by = middle_force(i, mid, fx, fy, path, el.mu, trace)
    N0 = path[2, i]
    N1 = path[2, i + 1]
    if mid == SLIP:
        _angle_row(i, by, el, scratch, scratch.rows[i])
        N = max(0.5 * (N0 + N1), 1e-300)
        scratch.g[0, i], scratch.g[1, i], slips[i] = -trace[1, i], trace[0, i], 1.0
        scratch.normal[0, i], scratch.normal[1, i] = (
            el.kn * trace[0, i] / N,
            el.kn * trace[1, i] / N,
        )
    elif mid == CLOSING:
        dx = path[0, i + 1] - path[0, i]
        dy = path[1, i + 1] - path[1, i]
        rows = scratch.closing
        _closing_rows(i, dx, dy, N0, N1, 0.5 * (N0 + N1) / (N1 - N0), el, tab, rows)
        for e in range(2):
            for k in range(tab.at.shape[1]):
                for l in range(rows.shape[1]):
                    scratch.J[e, k, l] += tab.analysis[i, k] * rows[e, l]


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _after_mixed(i, end, by, path, el, tab, scratch):
    """Bring C (2, M), and in slip the row of the angle, from knot i over an edge that changes
    state.
    """
    C = scratch.C
    if end == SLIP:
        _angle_row(i, (by[0], by[1], by[2], by[3], by[4], by[5]), el, scratch, scratch.row)
        return
    C[:] = 0.0
    if end == CLOSING:
        dx = path[0, i + 1] - path[0, i]
        dy = path[1, i + 1] - path[1, i]
        N0 = path[2, i]
        N1 = path[2, i + 1]
        _closing_rows(i, dx, dy, N0, N1, N1 / (N1 - N0), el, tab, C)
        to_carry(C, i + 1 if i + 1 < tab.at.shape[0] else 0, el.kt, tab)


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _leave_slip(fx, fy, i, N, kt, kn, scratch):
    """D - kt V goes to C (2, M), from the row of the angle, at knot i under the force (fx, fy)."""
    C = scratch.C
    row = scratch.row
    knots = scratch.patterns.knots
    for e, across, along in ((0, -fy, fx), (1, fx, fy)):
        parts = kn * along / N, -kt * (1 - e), -kt * e, 0.0, 0.0, 0.0
        combine_rows(across, row, 0.0, row, parts, i, i, knots, knots.shape[1], C[e])


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _find_turns(path, pieces, el, trail, scratch, trace):
    """How the row of the angle turns along all edges that slide; their forces and factors."""
    scratch.g[:] = 0.0
    scratch.normal[:] = 0.0
    for piece in range(pieces):
        if trail.kinds[piece] == SLIDING:
            find_turns(
                trail.begins[piece],
                trail.begins[piece + 1],
                path,
                trail.form,
                trail.knots,
                trail.slips,
                path.shape[1],
                el.kt,
                el.kn,
                el.mu,
                scratch.turns,
                scratch.g,
                scratch.normal,
                trace,
            )


@njit(_nrt=False, **INNER_KERNEL)
def add_period(path, fx, fy, pieces, el, tab, trail, scratch, trace, summing):
    """Carry the derivative C (2, M) through the period of the trail, which ends with the force (fx,
    fy).

    If it is summing, it fills J and stick of the scratch and the forces trace (2, width) at the
    samples, zero on entry.
    """
    # run: first sample of the present stretch of stick
    C = scratch.C
    forces = trail.forces
    run = -1
    slipping = False
    _find_turns(path, pieces, el, trail, scratch, trace)
    if summing:
        scratch.J[:] = 0.0
        scratch.stick[:] = 0.0
    for piece in range(pieces):
        i = trail.begins[piece]
        kind = trail.kinds[piece]
        ax = forces[0, piece]
        ay = forces[1, piece]
        if kind == SLIDING:
            _slide_row(i, trail.begins[piece + 1], scratch)
            continue
        if slipping:
            _leave_slip(ax, ay, i, path[2, i], el.kt, el.kn, scratch)
            slipping = False
        if kind == STICKING and summing:
            run = run if run >= 0 else i
            stuck_forces(i, trail.begins[piece + 1], ax, ay, path, trace)
        if kind == CHANGING:
            change = trail.changes[piece]
            end = int(change[0])
            mid = int(change[1])
            if mid == STICK and run < 0:
                run = i
            if summing:
                if run >= 0:
                    _add_stick(run, i + (mid == STICK), tab, scratch)
                _add_mixed(i, mid, ax, ay, path, el, tab, scratch, trail.slips, trace)
            run = -1
            slipping = end == SLIP
            if end != STICK:
                _after_mixed(i, end, change[2:], path, el, tab, scratch)
    if run >= 0 and summing:
        _add_stick(run, tab.at.shape[0], tab, scratch)
    if slipping:
        _leave_slip(fx, fy, 0, path[2, 0], 0.0, el.kn, scratch)
    elif path[2, 0] > 0.0:
        to_carry(C, 0, -el.kt, tab)
    else:
        C[:] = 0.0
    if summing:
        _add_slip(trail.slips, tab, scratch)


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def _choose_slipping_fours(slips, fours, chosen):
    """Number of fours in which a sample slips; chosen takes their numbers."""
    count = 0
    for q in range(fours.shape[0]):
        if slips[fours[q, 0]] + slips[fours[q, 1]] + slips[fours[q, 2]] + slips[fours[q, 3]] > 0.0:
            chosen[count] = q
            count += 1
    return count


@njit(_nrt=False, cache=True, error_model="numpy", inline="always")
def _add_slip(slips, tab, scratch):
    """Add the samples that slip, fours without one left out."""
    add_folded(
        scratch.rows,
        scratch.g,
        scratch.normal,
        scratch.patterns.at,
        tab.fours,
        scratch.chosen,
        _choose_slipping_fours(slips, tab.fours, scratch.chosen),
        scratch.patterns.weights,
        scratch.J,
    )


@njit(_nrt=False, **INNER_KERNEL, forceinline=True)
def unit_rows(kt, tab, C):
    """Carried rows C (2, M) of a force at the first knot that is given."""
    K = tab.at.shape[1]
    W = tab.W
    C[:] = 0.0
    C[0, K] = C[1, W + K] = 1.0
    to_carry(C, 0, kt, tab)


@njit(_nrt=False, **INNER_KERNEL)
def start_rows(vx, vy, N, el, tab, C):
    """Carried rows C (2, M) of the force at the first knot: kt w = (vx, vy) drawn back onto the
    circle mu N.
    """
    K = tab.at.shape[1]
    W = tab.W
    C[:] = 0.0
    R = el.mu * max(N, 0.0)
    length = np.hypot(vx, vy)
    if length <= R:
        return
    ex = vx / length
    ey = vy / length
    for l in range(K):
        turn = el.kt * R / length * tab.knots[0, l]
        C[0, W + l], C[0, 2 * W + l] = ey * ey * turn, -ex * ey * turn
        C[1, W + l], C[1, 2 * W + l] = -ex * ey * turn, ex * ex * turn
        if R > 0.0:
            C[0, l], C[1, l] = (
                ex * el.mu * el.kn * tab.knots[0, l],
                ey * el.mu * el.kn * tab.knots[0, l],
            )
    to_carry(C, 0, el.kt, tab)


@njit(_nrt=False, **INNER_KERNEL, fastmath=FAST_MATH_FLAGS, forceinline=True)
def close_period(rx, ry, kt, tab, scratch, F, J):
    """J (2, K, 3K) and what F (3, K) is missing, from the sums, the rows C (2, M) at the end and
    its misfit (rx, ry).

    The start of the period is moved to the fixed point of the linearised map.
    """
    C = scratch.C
    K = F.shape[1]
    W = tab.W
    a = 1.0 - C[0, K]
    b = -C[0, W + K]
    c = -C[1, K]
    d = 1.0 - C[1, W + K]
    inverse = 1.0 / (a * d - b * c)
    a = a * inverse
    b = b * inverse
    c = c * inverse
    d = d * inverse
    mx = d * rx - b * ry
    my = a * ry - c * rx
    # D at the start of the period takes the place of C
    for l in range(C.shape[1]):
        x = C[0, l]
        y = C[1, l]
        C[0, l], C[1, l] = d * x - b * y, a * y - c * x
    for e in range(2):
        for k in range(K):
            px = scratch.J[e, k, K]
            py = scratch.J[e, k, W + K]
            F[1 + e, k] += px * mx + py * my
    if scratch.stick[0] > 0.0:
        gram_matrix(scratch.stick, scratch.around, scratch.gram)
    else:
        scratch.gram[:] = 0.0
    join_rows(scratch.J, scratch.J.shape[1], W, C, kt, scratch.gram, K, J)

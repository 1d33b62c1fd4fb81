"""Contact forces at the end of a step in time: those that the friction law gives for their motion.

With the displacements w = c - F f_extra, F the flexibility of the bodies for forces at the end of a
step, each node wants f = law(w). First each node in turn takes a Newton step of its own, until none
changes, which is cheap and nearly always enough. Nodes of a stiff layer, or with few of them
pressed, push each other to and fro; there all take a Newton step together, with the exact
derivative of the law or one of its sides (a semi-smooth Newton method: Alart, Curnier, Comput.
Methods Appl. Mech. Eng. 92 (1991) 353, DOI 10.1016/0045-7825(91)90022-X), shortened until the
violation falls.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..util.numba_options import INNER_KERNEL, KERNEL
from .linearised_flow import _step_2d

# most sweeps over the nodes in a step
SWEEPS = 60
# change of a force in a sweep that counts as none, over the largest force
SETTLED = 1e-6

# of the friction law and the step of one node
NODE_OPERATIONS = 300.0
# Newton steps of all nodes together, and halvings of one
NEWTON_STEPS = 40
HALVINGS = 10
# decrease of the violation that a step has to bring, over its share
DECREASE = 1e-4


@njit(**KERNEL)
def contact_forces(c, flexibility, w, f, change, extra, table, load0, load1, preload, work):
    """Forces at the end of a step, of w = c - F extra: f, extra and w are those before, and then
    those after. False where they were not found.

    The sweeps start from a parabola through the last forces.

    Args:
        c: (m,) displacements without extra forces.
        flexibility: F (m, m), its transpose, and F preload (m,).
        w: (m,) relative displacements; f: (n, 3) contact forces; extra: (m,) those less preload.
        change: (2, n, 3) of the forces in the last step and the one before; those of this step and
            the last afterwards.
        table: (n, 3) kt, kn, mu; load0, load1: (n,) normal loads at zero displacement before and
            after the step.
        work: (1,) takes the operations.
    """
    m = len(c)
    d = m // len(f)
    old = (f.copy(), w.copy())
    largest = 0.0
    for row in range(m):
        largest = max(largest, abs(extra[row] + preload[row]), abs(preload[row]))
    for i in range(len(f)):
        for a in range(d):
            ahead = 2.0 * change[0, i, a] - change[1, i, a]
            f[i, a] += ahead
            extra[i * d + a] += ahead
    found = _in_turn(c, flexibility, w, f, extra, table, load0, load1, preload, old, largest, work)
    if not found:
        # from the forces before the step: sweeps that do not settle lead away
        for i in range(len(f)):
            for a in range(d):
                f[i, a] = old[0][i, a]
        found = _together(
            c, flexibility[0], w, f, extra, table, load0, load1, preload, old, largest, work
        )
    for i in range(len(f)):
        for a in range(d):
            change[1, i, a] = change[0, i, a]
            change[0, i, a] = f[i, a] - old[0][i, a]
    return found


@njit(**INNER_KERNEL)
def _in_turn(c, flexibility, w, f, extra, table, load0, load1, preload, old, largest, work):
    """Sweeps over the nodes, each with a Newton step of its own; False where they do not settle.

    Displacements follow each force that changes: nodes that are open, most of them where a damper
    comes off, cost nothing but their displacement.
    """
    F, columns, pressed = flexibility
    n = len(f)
    m = len(c)
    d = m // n
    B = np.zeros((3, 3))
    gap = np.zeros(3)
    tangents = (np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    w[:] = c + pressed
    for i in range(n):
        for a in range(d):
            if f[i, a] != 0.0:
                _subtract(columns[i * d + a], f[i, a], w)
    # a first sweep says nothing of how fast they settle
    before = 0.0
    for _ in range(SWEEPS):
        change = 0.0
        for i in range(n):
            first = i * d
            if _stays_open(f[i], load1[i] + table[i, 1] * w[first]):
                continue
            loads = (load0[i] + table[i, 1] * old[1][first], load1[i])
            _violation(w, f[i], first, d, old[1], old[0][i], (table[i], loads), B, gap, tangents)
            _own_step(F, first, d, B, gap)
            work[0] += NODE_OPERATIONS + 2.0 * d * m
            for a in range(d):
                f[i, a] += gap[a]
                extra[first + a] = f[i, a] - preload[first + a]
                change = max(change, abs(gap[a]))
                _subtract(columns[first + a], gap[a], w)
        # by how much the next one would change a force, if it falls again as it did
        ahead = change * min(change / before, 1.0) if before > 0.0 else change
        if ahead <= SETTLED * largest:
            return True
        before = change
    return False


@njit(**INNER_KERNEL)
def _stays_open(f, load):
    """A node without force whose normal load is none either."""
    return load <= 0.0 and f[0] == 0.0 and f[1] == 0.0 and f[2] == 0.0


@njit(**INNER_KERNEL)
def _subtract(column, factor, target):
    """target (m,) becomes target less the factor times the column (m,)."""
    for k in range(len(target)):
        target[k] -= factor * column[k]


@njit(**INNER_KERNEL)
def _own_step(F, first, d, B, gap):
    """The solution of (1 + B F) x = gap with a node's own flexibility replaces gap (3,), whose last
    entry is zero where there is one tangent, as are the last row and column of B (3, 3).

    By Cramer's rule in scalars: most of a march is spent in such steps.
    """
    last = first + d - 1
    n0, n1, n2 = F[first, first], F[first, first + 1], F[first, last]
    s0, s1, s2 = F[first + 1, first], F[first + 1, first + 1], F[first + 1, last]
    t0, t1, t2 = F[last, first], F[last, first + 1], F[last, last]
    a00 = 1.0 + B[0, 0] * n0
    a01 = B[0, 0] * n1
    a02 = B[0, 0] * n2
    a10 = B[1, 0] * n0 + B[1, 1] * s0 + B[1, 2] * t0
    a11 = 1.0 + B[1, 0] * n1 + B[1, 1] * s1 + B[1, 2] * t1
    a12 = B[1, 0] * n2 + B[1, 1] * s2 + B[1, 2] * t2
    a20 = B[2, 0] * n0 + B[2, 1] * s0 + B[2, 2] * t0
    a21 = B[2, 0] * n1 + B[2, 1] * s1 + B[2, 2] * t1
    a22 = 1.0 + B[2, 0] * n2 + B[2, 1] * s2 + B[2, 2] * t2
    c0 = a11 * a22 - a12 * a21
    c1 = a12 * a20 - a10 * a22
    c2 = a10 * a21 - a11 * a20
    scale = 1.0 / (a00 * c0 + a01 * c1 + a02 * c2)
    x, y, z = gap
    gap[0] = scale * (x * c0 + y * (a02 * a21 - a01 * a22) + z * (a01 * a12 - a02 * a11))
    gap[1] = scale * (x * c1 + y * (a00 * a22 - a02 * a20) + z * (a02 * a10 - a00 * a12))
    gap[2] = scale * (x * c2 + y * (a01 * a20 - a00 * a21) + z * (a00 * a11 - a01 * a10))


@njit(**INNER_KERNEL)
def _together(c, F, w, f, extra, table, load0, load1, preload, old, largest, work):
    """Newton steps of all nodes at once, shortened until the violation falls; False where it does
    not vanish.
    """
    n = len(f)
    m = len(c)
    d = m // n
    B = np.zeros((n, d, d))
    gap = np.empty(m)
    A = np.empty((m, m))
    start = np.empty((n, d))
    size = _violations(c, F, w, f, extra, table, load0, load1, preload, old, B, gap)
    for _ in range(NEWTON_STEPS):
        worst = 0.0
        for row in range(m):
            worst = max(worst, abs(gap[row]))
        if worst <= SETTLED * largest:
            return True
        for i in range(n):
            start[i] = f[i, :d]
            for a in range(d):
                A[i * d + a] = 0.0
                for k in range(d):
                    A[i * d + a] += B[i, a, k] * F[i * d + k]
                A[i * d + a, i * d + a] += 1.0
        _solve_small(A, gap)
        work[0] += m**3 + 2.0 * d * m**2
        step = gap.copy()
        share = 1.0
        for halving in range(HALVINGS + 1):
            if halving == HALVINGS:
                # a kink may have to be passed before it gets better
                share = 1.0
            for i in range(n):
                for a in range(d):
                    f[i, a] = start[i, a] + share * step[i * d + a]
            found = _violations(c, F, w, f, extra, table, load0, load1, preload, old, B, gap)
            work[0] += 2.0 * m**2
            if found < (1.0 - DECREASE * share) * size:
                break
            share /= 2.0
        size = found
        if not np.isfinite(size):
            return False
    return False


@njit(**INNER_KERNEL)
def _violations(c, F, w, f, extra, table, load0, load1, preload, old, B, gap):
    """Norm of what the law wants more of each force; gap (m,) and its derivatives B (n, d, d) by
    the displacements of each node are filled, as are extra and w of the forces f.
    """
    n = len(f)
    d = len(c) // n
    tangents = (np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    for i in range(n):
        for a in range(d):
            extra[i * d + a] = f[i, a] - preload[i * d + a]
    total = 0.0
    for i in range(n):
        first = i * d
        for a in range(first, first + d):
            w[a] = c[a] - _product(F[a], extra)
        loads = (load0[i] + table[i, 1] * old[1][first], load1[i])
        own = gap[first : first + d]
        _violation(w, f[i], first, d, old[1], old[0][i], (table[i], loads), B[i], own, tangents)
        for a in range(d):
            total += own[a] ** 2
    return np.sqrt(total)


@njit(**INNER_KERNEL)
def _violation(w, f, first, d, old_w, old_f, node, B, gap, tangents):
    """What the friction law wants more of the forces f of a node at its displacements w: gap (d,),
    and its derivative B (d, d) by them.
    """
    parameters, loads = node
    kt, kn, mu = parameters
    N0, load = loads
    _, now, by_load = tangents
    N1 = load + kn * w[first]
    dx = kt * (w[first + 1] - old_w[first + 1])
    dy = kt * (w[first + 2] - old_w[first + 2]) if d > 2 else 0.0
    x, y, _ = _step_2d(old_f[1], old_f[2], dx, dy, (N0, N1, 0.0, 0.0), mu, tangents)
    gap[0] = max(N1, 0.0) - f[0]
    gap[1] = x - f[1]
    if d > 2:
        gap[2] = y - f[2]
    B[0, 0] = kn if N1 > 0.0 else 0.0
    for a in range(1, d):
        B[a, 0] = by_load[a - 1, 1] * kn
        for b in range(1, d):
            B[a, b] = now[a - 1, b - 1] * kt


# the order of the sum is free, so that it is vectorised
@njit(fastmath={"reassoc", "contract"}, **INNER_KERNEL)
def _product(a, b):
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@njit(**INNER_KERNEL)
def _solve_small(A, b):
    """Solve A x = b by elimination with pivots, in place."""
    n = len(b)
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        if p != k:
            for j in range(n):
                A[k, j], A[p, j] = A[p, j], A[k, j]
            b[k], b[p] = b[p], b[k]
        for i in range(k + 1, n):
            share = A[i, k] / A[k, k]
            for j in range(k, n):
                A[i, j] -= share * A[k, j]
            b[i] -= share * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]

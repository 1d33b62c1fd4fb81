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
from .linearised_flow import slopes_2d

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
    w[:] = c + pressed
    for i in range(n):
        if f[i, 0] != 0.0 or f[i, 1] != 0.0 or f[i, 2] != 0.0:
            _subtract(columns, i * d, d, f[i, 0], f[i, 1], f[i, 2], w)
    # a first sweep says nothing of how fast they settle
    before = 0.0
    for _ in range(SWEEPS):
        change = 0.0
        for i in range(n):
            first = i * d
            open_before = f[i, 0] == 0.0 and f[i, 1] == 0.0 and f[i, 2] == 0.0
            if open_before and load1[i] + table[i, 1] * w[first] <= 0.0:
                continue
            gap, B = _violation(w, f, i, d, old, table, load0, load1)
            x, y, z = _own_step(F, first, d, B, gap)
            work[0] += NODE_OPERATIONS + 2.0 * d * m
            f[i, 0] += x
            f[i, 1] += y
            f[i, 2] += z
            for a in range(d):
                extra[first + a] = f[i, a] - preload[first + a]
            change = max(change, abs(x), abs(y), abs(z))
            _subtract(columns, first, d, x, y, z, w)
        # by how much the next one would change a force, if it falls again as it did
        ahead = change * min(change / before, 1.0) if before > 0.0 else change
        if ahead <= SETTLED * largest:
            return True
        before = change
    return False


@njit(**INNER_KERNEL)
def _subtract(columns, first, d, x, y, z, target):
    """target (m,) becomes target less the columns of a node's forces times these; z is zero where
    there is one tangent.
    """
    last = first + d - 1
    for k in range(len(target)):
        target[k] -= columns[first, k] * x + columns[first + 1, k] * y + columns[last, k] * z


@njit(**INNER_KERNEL)
def _own_step(F, first, d, B, gap):
    """The solution of (1 + B F) x = gap with a node's own flexibility; gap, B as of `_violation`.

    By Cramer's rule in numbers alone.
    """
    last = first + d - 1
    n0, n1, n2 = F[first, first], F[first, first + 1], F[first, last]
    s0, s1, s2 = F[first + 1, first], F[first + 1, first + 1], F[first + 1, last]
    t0, t1, t2 = F[last, first], F[last, first + 1], F[last, last]
    b00, b10, b20, b11, b12, b22 = B
    a00 = 1.0 + b00 * n0
    a01 = b00 * n1
    a02 = b00 * n2
    a10 = b10 * n0 + b11 * s0 + b12 * t0
    a11 = 1.0 + b10 * n1 + b11 * s1 + b12 * t1
    a12 = b10 * n2 + b11 * s2 + b12 * t2
    a20 = b20 * n0 + b12 * s0 + b22 * t0
    a21 = b20 * n1 + b12 * s1 + b22 * t1
    a22 = 1.0 + b20 * n2 + b12 * s2 + b22 * t2
    c0 = a11 * a22 - a12 * a21
    c1 = a12 * a20 - a10 * a22
    c2 = a10 * a21 - a11 * a20
    scale = 1.0 / (a00 * c0 + a01 * c1 + a02 * c2)
    x, y, z = gap
    return (
        scale * (x * c0 + y * (a02 * a21 - a01 * a22) + z * (a01 * a12 - a02 * a11)),
        scale * (x * c1 + y * (a00 * a22 - a02 * a20) + z * (a02 * a10 - a00 * a12)),
        scale * (x * c2 + y * (a01 * a20 - a00 * a21) + z * (a00 * a11 - a01 * a10)),
    )


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
    for i in range(n):
        for a in range(d):
            extra[i * d + a] = f[i, a] - preload[i * d + a]
    total = 0.0
    for i in range(n):
        first = i * d
        for a in range(first, first + d):
            w[a] = c[a] - _product(F[a], extra)
        own, (b00, b10, b20, b11, b12, b22) = _violation(w, f, i, d, old, table, load0, load1)
        rows = ((b00, 0.0, 0.0), (b10, b11, b12), (b20, b12, b22))
        for a in range(d):
            gap[first + a] = own[a]
            total += own[a] ** 2
            for k in range(d):
                B[i, a, k] = rows[a][k]
    return np.sqrt(total)


@njit(**INNER_KERNEL)
def _violation(w, f, i, d, old, table, load0, load1):
    """What the friction law wants more of the forces of node i at its displacements: normal and two
    tangential ones, the second zero where there is one tangent.

    Returns:
        these, and their derivatives by the displacements: normal by normal, tangential by normal,
        and xx, xy, yy of the tangential ones.
    """
    first = i * d
    old_f, old_w = old
    kt, kn, mu = table[i, 0], table[i, 1], table[i, 2]
    N0 = load0[i] + kn * old_w[first]
    N1 = load1[i] + kn * w[first]
    dx = kt * (w[first + 1] - old_w[first + 1])
    dy = kt * (w[first + 2] - old_w[first + 2]) if d > 2 else 0.0
    force, _, across, by = slopes_2d(old_f[i, 1], old_f[i, 2], dx, dy, N0, N1, mu)
    _, by_motion, _, by_load = by
    stiff = kt * by_motion
    gap = (max(N1, 0.0) - f[i, 0], force[0] - f[i, 1], force[1] - f[i, 2])
    normal = kn if N1 > 0.0 else 0.0
    xx = stiff * across[0]
    if d == 2:
        return gap, (normal, by_load[0] * kn, 0.0, xx, 0.0, 0.0)
    xy, yy = stiff * across[1], stiff * across[2]
    return gap, (normal, by_load[0] * kn, by_load[1] * kn, xx, xy, yy)


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

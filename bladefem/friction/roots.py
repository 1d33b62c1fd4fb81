"""First upward crossing of zero by a trigonometric polynomial within a bracket: safeguarded Newton.

No root is lost where a bracket holds at most one maximum, which is found from its slope, or one and
a minimum.
"""

from __future__ import annotations

from math import cos, sin

from numba import njit

from bladefem.util.numba_options import INNER_KERNEL

# time of an event that does not happen
NO_ROOT = 1e300


@njit(**INNER_KERNEL)
def motion_value(c, tau):
    """(value, slope, curvature) at tau of the motion with coefficients c (K,)."""
    q = c[0]
    d = 0.0
    e = 0.0
    c1 = cos(tau)
    s1 = sin(tau)
    ch = 1.0
    sh = 0.0
    for h in range(1, (c.size + 1) // 2):
        ch, sh = ch * c1 - sh * s1, sh * c1 + ch * s1
        a = c[2 * h - 1]
        b = c[2 * h]
        now = a * ch + b * sh
        q += now
        d += h * (b * ch - a * sh)
        e -= h * h * now
    return q, d, e


@njit(**INNER_KERNEL)
def _bracketed_root(c, level, a, b, order):
    """Zero in [a, b] of c - level (order 0), negative at a and positive at b, or of its slope
    falling through zero.
    """
    x = 0.5 * (a + b)
    sign = 1.0 if order == 0 else -1.0
    for _ in range(80):
        q, d, e = motion_value(c, x)
        f, slope = (q - level, d) if order == 0 else (sign * d, sign * e)
        if f > 0.0:
            b = x
        else:
            a = x
        step = f / slope if slope != 0.0 else 2.0 * (b - a)
        new = x - step
        if not a < new < b:
            new = 0.5 * (a + b)
        if abs(new - x) <= 4e-16 * max(abs(x), 1.0) or b - a <= 4e-16 * max(abs(x), 1.0):
            return new
        x = new
    return x


@njit(**INNER_KERNEL)
def _inflection_time(c, a, b, bend):
    """Time in [a, b] at which the curvature, of the sign ``bend`` at a, changes its sign."""
    for _ in range(50):
        middle = 0.5 * (a + b)
        if motion_value(c, middle)[2] * bend > 0.0:
            a = middle
        else:
            b = middle
    return b


@njit(**INNER_KERNEL)
def first_rise(c, level, a, b, small):
    """Time in [a, b] at which the motion with coefficients c first exceeds ``level``, NEVER if it
    does not.

    ``small`` is the rounding error of values: a touch that is no higher does not count.
    """
    qa, da, ea = motion_value(c, a)
    qb, db, eb = motion_value(c, b)
    if qa - level > small:
        return a
    if qb - level > small:
        return _bracketed_root(c, level, a, b, 0)
    low = a
    high = b
    # the slope may change its sign twice
    if da * ea < 0.0 and db * eb > 0.0 and ea * eb < 0.0:
        middle = _inflection_time(c, a, b, ea)
        if da < 0.0:
            low = middle
            da = motion_value(c, middle)[1]
        else:
            high = middle
            db = motion_value(c, middle)[1]
    if da > 0.0 and db < 0.0:
        peak = _bracketed_root(c, level, low, high, 1)
        if motion_value(c, peak)[0] - level > small:
            return _bracketed_root(c, level, a, peak, 0)
    return NO_ROOT

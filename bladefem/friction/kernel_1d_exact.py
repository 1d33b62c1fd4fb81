"""Exact forces of 1-D elements: transitions located in time, harmonics integrated analytically
between them.

Along a periodic motion of H harmonics the states are stretches of trigonometric polynomials: stick
f = g - b with a resting slider b, slip f = +-mu N, separation f = 0. Stick ends where g - mu N
rises above b (or g + mu N falls below it); slip with sign s ends where s kt w' < mu N'; separation
ends where N rises through zero. The force is continuous at all transitions, so that their times add
nothing to the Jacobian, save the slider position at re-contact.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from numba import njit

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.aft import (
    PERIODIC,
    Forces,
    check_motion,
    convergence_reason,
    dissipated_energy,
    finite_load,
)
from bladefem.friction.fourier import harmonics_of
from bladefem.friction.kernel_1d import assemble_linear_parts
from bladefem.friction.law_table import require_coulomb
from bladefem.friction.roots import NO_ROOT, first_rise, motion_value
from bladefem.friction.states import SEPARATED, SLIP_DOWN, SLIP_UP, STICK
from bladefem.friction.trigonometric_tables import Node, empty_gram, indicator_coefficients
from bladefem.util.numba_options import INNER_KERNEL, KERNEL

# polynomials whose rise ends a state
UP = 0
DOWN = 1
OPEN = 2
STOP_UP = 3
STOP_DOWN = 4
CLOSE = 5
# how the slider got to its place
START = 0
AFTER_UP = 1
AFTER_DOWN = 2
CONTACT = 3
# stretches kept in one period
MOST_EVENTS = 512
# events in one bracket
MOST_EVENTS_IN_BRACKET = 25


def _load_coefficients(load: np.ndarray | None, nodes: np.ndarray, K: int) -> np.ndarray:
    """(n, K) coefficients of the normal load at zero displacement [N].

    Raises:
        InputError: a shape that does not fit, or numbers that are not finite.
    """
    if load is None:
        base = np.zeros((len(nodes), K))
        base[:, 0] = nodes[:, 3]
        return base
    if np.shape(load) != (len(nodes), K):
        raise InputError(f"load: shape {np.shape(load)}, expected coefficients ({len(nodes)}, {K})")
    return finite_load(load)


def evaluate_exact(
    elements: Elements,
    w: np.ndarray,
    *,
    load: np.ndarray | None = None,
    brackets: int | None = None,
) -> Forces:
    """Harmonics of the contact forces of 1-D elements, exact to rounding.

    ``Forces.converged`` is False where a period has more than 512 transitions, a bracket more than
    25, or the motion is not finite.

    Args:
        w: (n, 2, 2H+1) coefficients of the relative motion [m].
        load: (n, 2H+1) coefficients of a prescribed normal load [N] in place of the constant n0.
        brackets: intervals of a period searched for transitions, 12 (H+1) when left out.

    Raises:
        InputError: shapes that do not fit, more than one tangent, a law that is not Coulomb's, or
            fewer than 4H+4 brackets.
    """
    w, nodes = check_motion(elements, w)
    n, d, K = w.shape
    if d != 2:
        raise InputError(
            "elements: events are located for one tangent, expected tangents = 1; use aft.evaluate"
        )
    require_coulomb(elements, "the location of events")
    H = harmonics_of(w)
    base = _load_coefficients(load, nodes, K)
    brackets = 12 * (H + 1) if brackets is None else brackets
    if brackets < 4 * (H + 1):
        raise InputError(
            f"brackets: {brackets} intervals for {H} harmonics, expected at least {4 * (H + 1)}"
        )
    F = np.zeros((n, d, K))
    J = np.zeros((n, d, K, d, K))
    shares = np.empty((n, 3))
    counts = np.empty(n, dtype=np.int64)
    exact_batch(w, base, nodes, brackets, F, J, shares, counts)
    reason = convergence_reason(
        F,
        counts,
        f"have more than {MOST_EVENTS} transitions a period, or {MOST_EVENTS_IN_BRACKET} nearly at "
        "once",
    )
    return Forces(
        F,
        J,
        shares,
        dissipated_energy(F, w),
        np.full(n, 2),
        reason == PERIODIC,
        reason,
    )


@njit(**INNER_KERNEL)
def _motion_derivative(c, out):
    """Coefficients of the derivative of the motion c."""
    out[0] = 0.0
    for h in range(1, (c.size + 1) // 2):
        out[2 * h - 1], out[2 * h] = h * c[2 * h], -h * c[2 * h - 1]


@njit(**KERNEL)
def _event_polynomials(w, base, el):
    """(8, K) coefficients [N]: the six whose rise ends a state, then g = kt w and N."""
    K = w.shape[1]
    q = np.empty((8, K))
    q[6] = el.kt * w[1]
    q[7] = base + el.kn * w[0]
    q[UP] = q[6] - el.mu * q[7]
    q[DOWN] = -q[6] - el.mu * q[7]
    q[OPEN] = -q[7]
    q[CLOSE] = q[7]
    _motion_derivative(-q[UP], q[STOP_UP])
    _motion_derivative(-q[DOWN], q[STOP_DOWN])
    return q


@njit(**INNER_KERNEL)
def _next_event(state, b, q, t, end, small):
    """(time, polynomial) of the first event after t in the bracket up to ``end``; time NEVER for
    none.
    """
    best = NO_ROOT
    which = -1
    if state == SEPARATED:
        return first_rise(q[CLOSE], 0.0, t, end, small[CLOSE]), CLOSE
    if state == STICK:
        best = first_rise(q[UP], b, t, end, small[UP])
        which = UP
        other = first_rise(q[DOWN], -b, t, end, small[DOWN])
        if other < best:
            best = other
            which = DOWN
    else:
        which = STOP_UP if state == SLIP_UP else STOP_DOWN
        best = first_rise(q[which], 0.0, t, end, small[which])
    opening = first_rise(q[OPEN], 0.0, t, end, small[OPEN])
    return (opening, OPEN) if opening < best else (best, which)


@njit(**INNER_KERNEL)
def _enter_state(q, t, which, b):
    """(state, slider, how it got there) after the event of polynomial ``which`` at time t."""
    if which == UP:
        return SLIP_UP, b, AFTER_UP
    if which == DOWN:
        return SLIP_DOWN, b, AFTER_DOWN
    if which == OPEN:
        return SEPARATED, b, CONTACT
    if which == STOP_UP:
        return STICK, motion_value(q[UP], t)[0], AFTER_UP
    if which == STOP_DOWN:
        return STICK, -motion_value(q[DOWN], t)[0], AFTER_DOWN
    if motion_value(q[UP], t)[1] > 0.0:
        return SLIP_UP, b, AFTER_UP
    if motion_value(q[DOWN], t)[1] > 0.0:
        return SLIP_DOWN, b, AFTER_DOWN
    return STICK, motion_value(q[6], t)[0], CONTACT


@njit(**INNER_KERNEL)
def _initial_state(q):
    """(state, slider, how) at tau = 0, where f = g is clamped."""
    low = motion_value(q[UP], 0.0)[0]
    high = -motion_value(q[DOWN], 0.0)[0]
    if motion_value(q[CLOSE], 0.0)[0] <= 0.0:
        return SEPARATED, 0.0, CONTACT
    if low > 0.0:
        return (SLIP_UP if motion_value(q[UP], 0.0)[1] > 0.0 else STICK), low, AFTER_UP
    if high < 0.0:
        return (SLIP_DOWN if motion_value(q[DOWN], 0.0)[1] > 0.0 else STICK), high, AFTER_DOWN
    return STICK, 0.0, START


@njit(**KERNEL)
def _steady_stretches(q, brackets, spans):
    """Stretches of the second period in spans (.., 5): start, end, state, how the slider came,
    when; their number.

    Returns (number, negative if there are too many; slider, how and when at the end).
    """
    state, b, how = _initial_state(q)
    when = 0.0
    count = 0
    small = np.empty(6)
    # rounding of the value, and of the time: slopes are up to h times the coefficients
    for i in range(6):
        small[i] = 4e-15 * abs(q[i, 0])
        for k in range(1, q.shape[1]):
            small[i] += 4e-15 * (1.0 + 2.0 * pi * ((k + 1) // 2)) * abs(q[i, k])
    step = 2.0 * pi / brackets
    for _ in range(2):
        count = 0
        begun = 0.0
        for i in range(brackets):
            t = i * step
            end = (i + 1) * step
            for _ in range(MOST_EVENTS_IN_BRACKET):
                at, which = _next_event(state, b, q, t, end, small)
                if at > end:
                    break
                if count + 1 >= spans.shape[0]:
                    return -1, b, how, when
                if at > begun:
                    spans[count, 0] = begun
                    spans[count, 1] = at
                    spans[count, 2] = state
                    spans[count, 3] = how
                    spans[count, 4] = when
                    count += 1
                state, b, how = _enter_state(q, at, which, b)
                begun = at
                t = at
                when = at
            else:
                return -1, b, how, when
        spans[count, 0], spans[count, 1], spans[count, 2], spans[count, 3] = (
            begun,
            2.0 * pi,
            state,
            how,
        )
        spans[count, 4] = when
        count += 1
    return count, b, how, when


@njit(**INNER_KERNEL)
def _basis_means(a, b, out):
    """Means over the circle of the basis up to 2H (4H+1,), restricted to a < tau < b."""
    out[0] = (b - a) / (2.0 * pi)
    for p in range(1, (out.size + 1) // 2):
        out[2 * p - 1] = (sin(p * b) - sin(p * a)) / (2.0 * pi * p)
        out[2 * p] = (cos(p * a) - cos(p * b)) / (2.0 * pi * p)


@njit(**INNER_KERNEL)
def _slider_position(how, t, q, el, basis, rows):
    """Slider position b [N], set at time t, and its rows (2, K) by normal and tangential
    coefficients.
    """
    rows[:] = 0.0
    if how == START:
        return 0.0
    g, dg, _ = motion_value(q[6], t)
    N, dN, _ = motion_value(q[7], t)
    basis[0] = 1.0
    for h in range(1, (basis.size + 1) // 2):
        basis[2 * h - 1], basis[2 * h] = cos(h * t), sin(h * t)
    if how == CONTACT:
        rows[0] = -dg / dN * el.kn * basis
        rows[1] = el.kt * basis
        return g
    sign = 1.0 if how == AFTER_UP else -1.0
    rows[0] = -sign * el.mu * el.kn * basis
    rows[1] = el.kt * basis
    return g - sign * el.mu * N


@njit(**KERNEL)
def exact_batch(w, base, nodes, brackets, F, J, shares, counts):
    """Forces F (n, 2, K), Jacobian J (n, 2, K, 2, K), shares (n, 3), numbers of stretches (n,); F
    and J come zeroed.
    """
    n = w.shape[0]
    K = w.shape[2]
    spans = np.empty((MOST_EVENTS, 5))
    means = np.empty((4, 2 * K - 1))
    mean = np.empty(2 * K - 1)
    rows = np.empty((2, K))
    weight = np.empty(K)
    basis = np.empty(K)
    block = np.empty((K, K))
    around = empty_gram(K // 2)
    for e in range(n):
        el = Node(nodes[e, 0], nodes[e, 1], nodes[e, 2], nodes[e, 3])
        q = _event_polynomials(w[e], base[e], el)
        count, _, _, _ = _steady_stretches(q, brackets, spans)
        counts[e] = count
        means[:] = 0.0
        for i in range(count):
            a = spans[i, 0]
            b = spans[i, 1]
            state = int(spans[i, 2])
            if state == SEPARATED:
                continue
            _basis_means(a, b, mean)
            means[2] += mean
            if state != STICK:
                means[1] += mean if state == SLIP_UP else -mean
                means[3, 0] += mean[0]
                continue
            means[0] += mean
            slider = _slider_position(int(spans[i, 3]), spans[i, 4], q, el, basis, rows)
            indicator_coefficients(mean, weight)
            for k in range(K):
                F[e, 1, k] -= weight[k] * slider
                for d in range(2):
                    for l in range(K):
                        J[e, 1, k, d, l] -= weight[k] * rows[d, l]
        assemble_linear_parts(w[e], base[e], el, means, F[e], J[e], around, block)
        shares[e, 0], shares[e, 1] = means[0, 0], means[3, 0]
        shares[e, 2] = 1.0 - shares[e, 0] - shares[e, 1]

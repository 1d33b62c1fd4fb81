"""Time integration without time-step error: exact flow between events, events located on the flow.

Between two changes of state (stick, slip, separation) the system is linear with harmonic inputs,
hence its solution is an entire function of time. Each step sums its Taylor series to rounding error
and searches the first event on the polynomials of the contact variables, so accuracy does not
depend on the step. Tangents of the flow (the monodromy matrix) follow exactly: all fields are
continuous across events, therefore only sliders that set anew carry a jump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from bladefem.errors import InputError

from ..friction.states import SIGNED_SEPARATED, SIGNED_STICK
from .system import System

# of the normal force: states change once they are wrong by more than rounding
ROUNDING_SHARE = 1e-12
OUTCOME_WORDS = {0: "done", 1: "too many events in one step: the states chatter"}


@dataclass(frozen=True)
class State:
    """State of the system at an instant."""

    # (d,) [m kg^1/2]
    q: np.ndarray
    # (d,) [m/s kg^1/2]
    v: np.ndarray
    # (n,) sliders: force = k_t (w - z), cut to the friction limit [m]
    z: np.ndarray


@dataclass(frozen=True)
class Trajectory:
    """The motion over one period, or several."""

    # at the end
    state: State
    # (s, d) at equal instants, the first at the start [m kg^1/2]
    q: np.ndarray
    # (s, d) [m/s kg^1/2]
    v: np.ndarray
    # (s, n) friction force on the damper side [N]
    force: np.ndarray
    # (s, n) relative displacement [m]
    w: np.ndarray
    # changes of state on the way
    events: int
    # "done", or why it stopped
    reason: str
    # (2d + n, 2d + n) d(q, v, z) at the end by d(q, v, z) at the start
    tangent: np.ndarray | None

    @property
    def monodromy(self) -> np.ndarray:
        """``tangent`` of a trajectory that was asked for it."""
        if self.tangent is None:
            raise RuntimeError("the flow was integrated without its derivative")
        return self.tangent


def state_at_rest(system: System) -> State:
    """Everything at zero and stuck."""
    d = system.W.shape[1]
    return State(np.zeros(d), np.zeros(d), system.drive[:, 0] + system.drive[:, 1::2].sum(axis=1))


def stuck_start(system: System, omega: float) -> State:
    """The state at t = 0 of the steady motion with all elements stuck, the sliders at zero: the
    best cheap start.
    """
    d = len(system.stiffness)
    H = system.coefficients // 2
    K = np.diag(system.stiffness) + (system.W.T * system.kt) @ system.W + system.R.T @ system.V
    load = system.force - (system.W.T * system.kt) @ system.drive
    q = np.zeros(d)
    v = np.zeros(d)
    for h in range(1, H + 1):
        w = h * omega
        x = np.linalg.solve(
            K - w**2 * np.eye(d) + 1j * w * system.damping, load[:, 2 * h - 1] - 1j * load[:, 2 * h]
        )
        q = q + x.real
        v = v + (1j * w * x).real
    return State(q, v, np.zeros(len(system.kt)))


def integrate_periods(
    system: System,
    omega: float,
    start: State,
    samples: int = 256,
    periods: int = 1,
    tangent: bool = False,
) -> Trajectory:
    """Integrate over whole periods from t = 0, exactly up to rounding.

    Args:
        omega: base circular frequency of the inputs [rad/s].
        samples: equal instants a period in the result; more steps are taken where the fastest
            motion asks for it.
        tangent: also the derivative of the end state by the start state.

    Raises:
        InputError: frequency not above zero, or fewer than 8 samples.
    """
    if not (omega > 0 and samples >= 8):
        raise InputError(
            f"omega = {omega}, samples = {samples}: expected a frequency above zero, at least 8 "
            "samples"
        )
    n, d = system.W.shape
    fastest = max(system.fastest, system.coefficients // 2 * omega)
    parts = int(np.ceil(fastest * 2 * np.pi / omega / samples))
    order = _series_order(fastest * 2 * np.pi / omega / samples / parts)
    arrays = tuple(
        np.ascontiguousarray(a, float)
        for a in (
            system.stiffness,
            system.damping,
            system.W,
            system.V,
            system.kt,
            system.mu,
            system.force,
            system.drive,
            system.normal,
            system.R,
        )
    )
    history = np.full((samples * periods, 2 * d + 2 * n), np.nan)
    size = 2 * d + n if tangent else 0
    T = np.eye(2 * d + n)[:, :size].copy()
    y = np.r_[start.q, start.v, start.z]
    events, code = _integrate_steps(arrays, y, T, history, omega, (samples, parts, order))
    end = State(y[:d].copy(), y[d : 2 * d].copy(), y[2 * d :].copy())
    return Trajectory(
        end,
        history[:, :d],
        history[:, d : 2 * d],
        history[:, 2 * d + n :],
        history[:, 2 * d : 2 * d + n],
        events,
        OUTCOME_WORDS[code],
        T if tangent else None,
    )


def _series_order(x: float) -> int:
    """Terms of the exponential series at x that reach rounding: x^(p+1) / (p+1)! < 1e-17."""
    order = 1
    term = x * x / 2
    while term > 1e-17:
        order += 1
        term *= x / (order + 1)
    return order


@njit(cache=True)
def _input_series(coefficients, omega, t, out):
    """Taylor coefficients in time of rows of Fourier coefficients at t; out (order+1, rows)."""
    out[:] = 0.0
    for h in range(coefficients.shape[1] // 2 + 1):
        w = h * omega
        c = np.cos(w * t)
        s = np.sin(w * t)
        factor = 1.0
        for j in range(out.shape[0] if h else 1):
            for i in range(out.shape[1]):
                out[j, i] += factor * (
                    coefficients[i, 2 * h - 1] * c + coefficients[i, 2 * h] * s
                    if h
                    else coefficients[i, 0]
                )
            factor *= w / (j + 1)
            c, s = -s, c


@njit(cache=True)
def _taylor_series(arrays, y, contact, omega, t, series):
    """Taylor series of q, v, w, N from the present state; contact forces by their law in each
    state.
    """
    L, D, W, V, kt, mu, P, G, Nn, R = arrays
    Q, U, wc, nc, p = series
    n, d = W.shape
    _input_series(P, omega, t, p)
    _input_series(G, omega, t, wc)
    _input_series(Nn, omega, t, nc)
    for k in range(d):
        Q[0, k] = y[k]
        U[0, k] = y[d + k]
    for j in range(Q.shape[0]):
        a = p[j]
        for k in range(d):
            a[k] -= L[k] * Q[j, k]
            for m in range(d):
                a[k] -= D[k, m] * U[j, m]
        for i in range(n):
            for k in range(d):
                wc[j, i] += W[i, k] * Q[j, k]
                nc[j, i] += V[i, k] * Q[j, k]
            f = 0.0
            lift = -Nn[i, 0] if j == 0 else 0.0
            if contact[i] != SIGNED_SEPARATED:
                lift += nc[j, i]
            if contact[i] == SIGNED_STICK:
                f = kt[i] * (wc[j, i] - (y[2 * d + i] if j == 0 else 0.0))
            elif contact[i] != SIGNED_SEPARATED:
                f = contact[i] * mu[i] * nc[j, i]
            for k in range(d):
                a[k] -= f * W[i, k] + lift * R[i, k]
        if j < Q.shape[0] - 1:
            for k in range(d):
                Q[j + 1, k] = U[j, k] / (j + 1)
                U[j + 1, k] = a[k] / (j + 1)


@njit(cache=True)
def _polynomial_value(c, i, x):
    """Polynomial of column i of the coefficients, at x."""
    total = 0.0
    for j in range(c.shape[0] - 1, -1, -1):
        total = total * x + c[j, i]
    return total


@njit(cache=True)
def _polynomial_slope(c, i, x):
    """Derivative of the polynomial of column i, at x."""
    total = 0.0
    for j in range(c.shape[0] - 1, 0, -1):
        total = total * x + j * c[j, i]
    return total


@njit(cache=True)
def _state_margin(state, kt, mu, z, series, i, x, slack):
    """How far element i is from leaving its state, below zero when it is time to; ``slack`` keeps
    rounding out.
    """
    wc = series[2]
    nc = series[3]
    N = _polynomial_value(nc, i, x)
    if state == SIGNED_SEPARATED:
        return slack[0] - N
    # before the limit of stick, which without friction has no sign
    if N < -slack[0]:
        return N
    if state == SIGNED_STICK:
        return mu * (N + slack[0]) - abs(kt * (_polynomial_value(wc, i, x) - z))
    return (
        state * kt * _polynomial_slope(wc, i, x) - mu * _polynomial_slope(nc, i, x) + mu * slack[1]
    )


@njit(cache=True)
def _first_event(arrays, y, contact, series, h, step):
    """(time of the first change of state within h, element), or (h, -1)."""
    W = arrays[2]
    kt = arrays[4]
    mu = arrays[5]
    n, d = W.shape
    best = h
    who = -1
    for i in range(n):
        left = 0.0
        size = ROUNDING_SHARE * np.abs(arrays[8][i]).sum()
        # rounding of k_t (w - z) where the motion is large against the limit
        if mu[i] > 0:
            size += 1e-14 * kt[i] * (abs(series[2][0, i]) + abs(y[2 * d + i])) / mu[i]
        slack = (size, size / step)
        for part in range(1, 5):
            right = min(h * part / 4, best)
            if _state_margin(contact[i], kt[i], mu[i], y[2 * d + i], series, i, right, slack) < 0.0:
                for _ in range(60):
                    middle = 0.5 * (left + right)
                    if (
                        _state_margin(
                            contact[i], kt[i], mu[i], y[2 * d + i], series, i, middle, slack
                        )
                        < 0.0
                    ):
                        right = middle
                    else:
                        left = middle
                    if right - left <= 1e-15 * step:
                        break
                best = right
                who = i
                break
            left = right
            if right >= best:
                break
    return best, who


@njit(cache=True)
def _set_slider_tangent(W, V, T, i, slip):
    """Slider i follows its element at the friction limit: d z = d w - slip d N.

    A loop: products of arrays take seconds to compile wherever they stand.
    """
    d = W.shape[1]
    for m in range(T.shape[1]):
        total = 0.0
        for k in range(d):
            total += (W[i, k] - slip * V[i, k]) * T[k, m]
        T[2 * d + i, m] = total


@njit(cache=True)
def _switch_state(arrays, y, contact, T, i, rates):
    """Change the state of element i; rates: w, N and their time derivatives at this instant."""
    W = arrays[2]
    V = arrays[3]
    kt = arrays[4]
    mu = arrays[5]
    Nn = arrays[8]
    w, N, dw, dN = rates
    d = W.shape[1]
    old = contact[i]
    if old == SIGNED_STICK:
        f = kt[i] * (w - y[2 * d + i])
        contact[i] = (
            SIGNED_SEPARATED if N <= ROUNDING_SHARE * np.abs(Nn[i]).sum() else (1 if f > 0 else -1)
        )
    elif old == SIGNED_SEPARATED:
        contact[i] = SIGNED_STICK if kt[i] * abs(dw) <= mu[i] * dN else (1 if dw > 0 else -1)
        y[2 * d + i] = w
        _set_slider_tangent(W, V, T, i, dw / dN if dN != 0 else 0.0)
    elif N <= 0:
        contact[i] = SIGNED_SEPARATED
    else:
        contact[i] = SIGNED_STICK
        y[2 * d + i] = w - old * mu[i] * N / kt[i]
        _set_slider_tangent(W, V, T, i, old * mu[i] / kt[i])


@njit(cache=True)
def _advance_tangent(arrays, contact, T, x, order, memory):
    """Advance the tangent (columns of T) over x with fixed states; the last matrix is kept for
    equal steps.
    """
    key, flow = memory
    n, d = arrays[2].shape
    new = key[n] != x
    for i in range(n):
        new = new or key[i] != contact[i]
    if new:
        for i in range(n):
            key[i] = contact[i]
        key[n] = x
        _tangent_exponential(arrays, contact, x, order, flow)
    product = flow @ T
    for k in range(2 * d):
        for m in range(T.shape[1]):
            T[k, m] = product[k, m]


@njit(cache=True)
def _tangent_exponential(arrays, contact, x, order, flow):
    """(2d, 2d + n) derivative of (q, v) after x by (q, v, z) before: the homogeneous series."""
    L = arrays[0]
    D = arrays[1]
    W = arrays[2]
    V = arrays[3]
    kt = arrays[4]
    mu = arrays[5]
    R = arrays[9]
    n, d = W.shape
    # acceleration by (q, v, z)
    A = np.zeros((d, 2 * d + n))
    for k in range(d):
        A[k, k] -= L[k]
        for m in range(d):
            A[k, d + m] -= D[k, m]
        for i in range(n):
            if contact[i] != SIGNED_SEPARATED:
                gain = W[i, k] * kt[i] if contact[i] == SIGNED_STICK else 0.0
                lift = R[i, k] + (
                    0.0 if contact[i] == SIGNED_STICK else contact[i] * mu[i] * W[i, k]
                )
                A[k, 2 * d + i] = gain
                for m in range(d):
                    A[k, m] -= gain * W[i, m] + lift * V[i, m]
    flow[:] = 0.0
    row = np.zeros((2 * d, 2 * d + n))
    new = np.zeros((2 * d, 2 * d + n))
    for k in range(2 * d):
        row[k, k] = 1.0
    for j in range(order + 1):
        factor = x / (j + 1)
        for k in range(d):
            for c in range(2 * d + n):
                flow[k, c] += row[k, c]
                flow[d + k, c] += row[d + k, c]
                new[k, c] = factor * row[d + k, c]
                new[d + k, c] = factor * A[k, c] if j == 0 and c >= 2 * d else 0.0
            for m in range(2 * d):
                if A[k, m] != 0.0:
                    gain = factor * A[k, m]
                    for c in range(2 * d + n):
                        new[d + k, c] += gain * row[m, c]
        row, new = new, row


@njit(cache=True)
def _advance_state(arrays, y, contact, T, series, x, memory):
    """Move the state to x on its series; sliders of slipping and open elements follow."""
    W = arrays[2]
    V = arrays[3]
    kt = arrays[4]
    mu = arrays[5]
    wc = series[2]
    nc = series[3]
    n, d = W.shape
    if T.shape[1] > 0:
        _advance_tangent(arrays, contact, T, x, series[0].shape[0] - 1, memory)
    for k in range(d):
        y[k], y[d + k] = _polynomial_value(series[0], k, x), _polynomial_value(series[1], k, x)
    for i in range(n):
        if contact[i] != SIGNED_STICK:
            slip = contact[i] * mu[i] / kt[i] if contact[i] != SIGNED_SEPARATED else 0.0
            y[2 * d + i] = _polynomial_value(wc, i, x) - slip * _polynomial_value(nc, i, x)
            if T.shape[1] > 0:
                _set_slider_tangent(W, V, T, i, slip)


@njit(cache=True)
def _initial_states(arrays, y, contact, T, series):
    """States of the elements that fit the given q, v, z; sliders beyond the friction limit are
    pulled along.
    """
    W = arrays[2]
    V = arrays[3]
    kt = arrays[4]
    mu = arrays[5]
    wc = series[2]
    nc = series[3]
    n, d = W.shape
    for i in range(n):
        w = wc[0, i]
        N = nc[0, i]
        rate = kt[i] * wc[1, i]
        f = kt[i] * (w - y[2 * d + i])
        side = 1 if f > 0 else -1
        slip = 0.0
        contact[i] = SIGNED_STICK
        if N <= 0:
            contact[i] = SIGNED_SEPARATED
        elif side * f >= mu[i] * N * (1 - 1e-13):
            slip = side * mu[i] / kt[i]
            contact[i] = side if side * rate > mu[i] * nc[1, i] else SIGNED_STICK
        if N <= 0 or slip != 0:
            y[2 * d + i] = w - slip * N
            if T.shape[1] > 0:
                _set_slider_tangent(W, V, T, i, slip)


@njit(cache=True)
def _integrate_steps(arrays, y, T, history, omega, parts):
    """All steps; returns the number of events and a code."""
    n, d = arrays[2].shape
    step = 2 * np.pi / omega / (parts[0] * parts[1])
    order = parts[2]
    series = (
        np.empty((order + 1, d)),
        np.empty((order + 1, d)),
        np.empty((order + 1, n)),
        np.empty((order + 1, n)),
        np.empty((order + 1, d)),
    )
    memory = (np.full(n + 1, np.nan), np.empty((2 * d, 2 * d + n)))
    contact = np.zeros(n, np.int64)
    _taylor_series(arrays, y, contact, omega, 0.0, series)
    _initial_states(arrays, y, contact, T, series)
    events = 0
    for k in range(history.shape[0] * parts[1]):
        t = k * step
        left = step
        count = 0
        _taylor_series(arrays, y, contact, omega, t, series)
        if k % parts[1] == 0:
            row = history[k // parts[1]]
            for j in range(2 * d):
                row[j] = y[j]
            for i in range(n):
                row[2 * d + i] = series[2][0, i]
                row[2 * d + n + i] = arrays[4][i] * (series[2][0, i] - y[2 * d + i])
        while True:
            x, who = _first_event(arrays, y, contact, series, left, step)
            _advance_state(arrays, y, contact, T, series, x, memory)
            if who < 0:
                break
            rates = (
                _polynomial_value(series[2], who, x),
                _polynomial_value(series[3], who, x),
                _polynomial_slope(series[2], who, x),
                _polynomial_slope(series[3], who, x),
            )
            _switch_state(arrays, y, contact, T, who, rates)
            events = events + 1
            count = count + 1
            t = t + x
            left = left - x
            if count > 40 * n + 40:
                return events, 1
            if left <= 1e-13 * step:
                break
            _taylor_series(arrays, y, contact, omega, t, series)
    return events, 0

"""Splines of a damper's law and their derivatives, compiled; see `damper_law.DamperLaw`."""

from __future__ import annotations

import numpy as np
from numba import njit

# points beyond the ends of the ratios, by symmetry, so that the splines have no ends there
GHOST_POINTS = 4
# smaller amplitude of a pair over the larger one: its phase means nothing
NEGLIGIBLE_AMPLITUDE_SHARE = 1e-9


@njit(cache=True)
def evaluate_law(
    coefficients: np.ndarray,
    first: float,
    step: float,
    before: np.ndarray,
    after: np.ndarray,
    out: np.ndarray,
    derivative: np.ndarray,
) -> None:
    """Forces out (k, 4) and derivatives (k, 4, 4) by real and imaginary parts of amplitudes (k,).

    With size s, ratio angle v, phase w and the turn t of the first amplitude a force is
    s e^{i t} T(log s, v, w), so that its derivative follows from those of s, v, w and t.
    """
    per_step = np.empty(3)
    per_step[0] = 1 / step
    per_step[1] = (coefficients.shape[2] - 2 * GHOST_POINTS - 1) / (np.pi / 2)
    per_step[2] = coefficients.shape[3] / (2 * np.pi)
    value = np.empty((4, 4))
    by = np.empty((4, 4))
    for k in range(len(before)):
        a = before[k]
        b = after[k]
        size = np.sqrt(a.real**2 + a.imag**2 + b.real**2 + b.imag**2)
        size = max(size, NEGLIGIBLE_AMPLITUDE_SHARE * np.exp(first))
        p = max(abs(a), NEGLIGIBLE_AMPLITUDE_SHARE * size)
        q = max(abs(b), NEGLIGIBLE_AMPLITUDE_SHARE * size)
        turn = np.arctan2(a.imag, a.real)
        other = np.arctan2(b.imag, b.real)
        place = (np.log(size) - first) * per_step[0]
        inside = 0 <= place <= coefficients.shape[1] - 1
        ratio = np.arctan2(q, p) * per_step[1] + GHOST_POINTS
        _interpolate(coefficients, place, ratio, (other - turn) * per_step[2], value)
        ca, sa = np.cos(turn), np.sin(turn)
        cb, sb = np.cos(other), np.sin(other)
        # rows: size, ratio, phase, turn; columns: real and imaginary parts of both
        by[0] = p * ca / size, p * sa / size, q * cb / size, q * sb / size
        by[1] = -q * ca / size**2, -q * sa / size**2, p * cb / size**2, p * sb / size**2
        by[2] = sa / p, -ca / p, -sb / q, cb / q
        by[3] = -sa / p, ca / p, 0.0, 0.0
        for c in range(2):
            re = value[2 * c, 0]
            im = value[2 * c + 1, 0]
            x = size * (ca * re - sa * im)
            y = size * (sa * re + ca * im)
            out[k, 2 * c] = x
            out[k, 2 * c + 1] = y
            for i in range(4):
                # above the table the stiffness stays, below it all contacts stick
                u = by[0, i] * per_step[0] if inside else 0.0
                v = by[1, i] * per_step[1] * size
                w = by[2, i] * per_step[2] * size
                real = value[2 * c, 1] * u + value[2 * c, 2] * v + value[2 * c, 3] * w
                imag = value[2 * c + 1, 1] * u + value[2 * c + 1, 2] * v + value[2 * c + 1, 3] * w
                real += by[0, i] * re
                imag += by[0, i] * im
                derivative[k, 2 * c, i] = ca * real - sa * imag - y * by[3, i]
                derivative[k, 2 * c + 1, i] = sa * real + ca * imag + x * by[3, i]


@njit(cache=True)
def _interpolate(
    coefficients: np.ndarray,
    u: float,
    v: float,
    w: float,
    value: np.ndarray,
) -> None:
    """Value and three derivatives (4, 4) of each spline at a place in steps of the table."""
    _, sizes, _, phases = coefficients.shape
    weight = np.empty((3, 4))
    slope = np.empty((3, 4))
    u = min(max(u, 0.0), sizes - 1.0)
    w = w % phases
    iu = min(int(u), sizes - 2)
    iv = int(v)
    iw = int(w)
    _weights(u - iu, weight[0], slope[0])
    _weights(v - iv, weight[1], slope[1])
    _weights(w - iw, weight[2], slope[2])
    value[:] = 0.0
    for x in range(4):
        i = _mirrored(iu - 1 + x, sizes)
        for y in range(4):
            for z in range(4):
                m = (iw - 1 + z) % phases
                whole = weight[0, x] * weight[1, y] * weight[2, z]
                du = slope[0, x] * weight[1, y] * weight[2, z]
                dv = weight[0, x] * slope[1, y] * weight[2, z]
                dw = weight[0, x] * weight[1, y] * slope[2, z]
                for c in range(4):
                    t = coefficients[c, i, iv - 1 + y, m]
                    value[c, 0] += whole * t
                    value[c, 1] += du * t
                    value[c, 2] += dv * t
                    value[c, 3] += dw * t


@njit(cache=True)
def _weights(x: float, out: np.ndarray, slope: np.ndarray) -> None:
    """Cubic B-spline weights and their derivatives at a fraction x of a step."""
    out[0] = (1 - x) ** 3 / 6
    out[1] = (3 * x**3 - 6 * x**2 + 4) / 6
    out[2] = (-3 * x**3 + 3 * x**2 + 3 * x + 1) / 6
    out[3] = x**3 / 6
    slope[0] = -((1 - x) ** 2) / 2
    slope[1] = (9 * x**2 - 12 * x) / 6
    slope[2] = (-9 * x**2 + 6 * x + 3) / 6
    slope[3] = x**2 / 2


@njit(cache=True)
def _mirrored(i: int, count: int) -> int:
    """Index beyond the ends of a mirrored axis."""
    if i < 0:
        return -i
    if i >= count:
        return 2 * (count - 1) - i
    return i

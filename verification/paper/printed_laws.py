"""Friction laws as the paper prints them, kept for comparison only, and the corrected differential
form.

Each takes a sampled motion and returns the force in our sign (the printed one acts on the
structure). The errors were measured with g = sin x, N = 1, mu = 0.5, k = 5 unless said otherwise;
tests/stability/test_friction_failures.py repeats them. Work ratio: work of one period over that of
the corrected law.

- ``differential``, H(0) = 0 (Eq. 19-21 to the letter): after the first clip |f| = mu N exactly and neither branch is
  active; the force freezes for ever. Work ratio 0, force error 2 mu N.
- ``differential`` with falling N, H(0) = 0 or 1: cannot stick again while N decreases. g = sin 2x,
  N = 1 + 0.6 sin x: work ratio 0.519 to 0.495 for 1e3 to 1e5 steps a period, force error 2.48 mu N;
  g = sin 4x 0.548 to 0.498.
- ``differential`` with N < 0: f flips its sign at every step with amplitude mu |N| (0.25 for N = 0.5 + sin x).
- ``per_axis`` (Eq. 29, kindly read): a square instead of Coulomb's circle. Work ratios 0.498,
  0.449, 0.856 on ellipses 1:1, 1:0.5, 1:0.1; force errors 1.34, 1.38, 0.60 mu N.
- ``per_axis_printed`` (Eq. 28-29): freezes, or runs into the root of a negative number. Work ratio
0 or nan.
- ``corrected_rate``: the right rate, Runge-Kutta without events: first order (9.2e-2 of the work at
  200 steps a period, 6e-3 at 3200), where ``corrected``, the return map, has 9e-4 and 4e-6.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bladefem.friction.time_step import step_1d

Motion = Callable[[float], tuple[float, float]]


def differential(
    g: np.ndarray, N: np.ndarray, kt: float, mu: float, heaviside_at_zero: int = 0
) -> np.ndarray:
    """Force (samples,) [N] by Eq. 21 as printed, explicit steps from f = 0; g (samples,) [m], N
    [N].

    The second branch, with its factor 1/dt, takes the excess off within one step.
    """
    f = 0.0
    forces = [0.0]
    for dg, load in zip(np.diff(g).tolist(), N[:-1].tolist(), strict=True):
        room = mu * load - abs(f)
        sticks = room > 0 or (room == 0 and heaviside_at_zero == 1)
        f += (kt * dg if sticks else 0.0) + (math.copysign(room, -f) if room < 0 and f else 0.0)
        forces.append(f)
    return np.array(forces)


def corrected(g: np.ndarray, N: np.ndarray, kt: float, mu: float, f0: float = 0.0) -> np.ndarray:
    """Force (samples,) [N] of the return map f = clamp(f + kt dg, -mu N+, mu N+), from f0."""
    forces = [f0]
    loads = N.tolist()
    for dg, before, now in zip(np.diff(g).tolist(), loads[:-1], loads[1:], strict=True):
        forces.append(step_1d(forces[-1] + kt * dg, before, now, mu))
    return np.array(forces)


def corrected_rate(
    motion: Motion, load: Motion, kt: float, mu: float, times: np.ndarray
) -> np.ndarray:
    """Force (samples,) [N] of the corrected rate form by classical Runge-Kutta without events, from
    f = 0: first order.

    df/dt = kt dg/dt, but s mu dN/dt where |f| >= mu N with sign s and s kt dg/dt > mu dN/dt; f = 0 where N <= 0.
    motion and load give value and rate at a time.
    """

    def rate(t: float, f: float) -> float:
        (_, dg), (N, dN) = motion(t), load(t)
        s = np.sign(f)
        slides = abs(f) >= mu * N and s * kt * dg > mu * dN
        return 0.0 if N <= 0 else s * mu * dN if slides else kt * dg

    f = np.zeros(times.size)
    for i in range(1, times.size):
        t = times[i - 1]
        h = times[i] - times[i - 1]
        old = f[i - 1]
        k1 = rate(t, old)
        k2 = rate(t + h / 2, old + h / 2 * k1)
        k3 = rate(t + h / 2, old + h / 2 * k2)
        k4 = rate(t + h, old + h * k3)
        f[i] = old + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4) if load(times[i])[0] > 0 else 0.0
    return f


def per_axis(g: np.ndarray, N: np.ndarray, kt: float, mu: float) -> np.ndarray:
    """Force (samples, 2) [N] with the limits of Eq. 29, kindly read: clip on both sides, no
    negative roots.
    """
    f = np.zeros((g.shape[0], 2))
    for i in range(1, g.shape[0]):
        trial = f[i - 1] + kt * (g[i] - g[i - 1])
        limit = np.sqrt(np.maximum((mu * N[i]) ** 2 - f[i - 1, ::-1] ** 2, 0.0))
        f[i] = np.clip(trial, -limit, limit)
    return f


def per_axis_printed(g: np.ndarray, N: np.ndarray, kt: float, mu: float) -> np.ndarray:
    """Force (samples, 2) [N] of Eq. 28-29 as printed: H(f - f_max) without the modulus, negative
    roots nan.
    """
    f = np.zeros((g.shape[0], 2))
    for i in range(1, g.shape[0]):
        old = f[i - 1]
        with np.errstate(invalid="ignore"):
            limit = np.sqrt((mu * N[i - 1]) ** 2 - old[::-1] ** 2)
        room = limit - np.abs(old)
        f[i] = old + kt * (g[i] - g[i - 1]) * np.heaviside(room, 0)
        f[i] -= np.heaviside(old - limit, 0) * np.abs(room) * np.sign(old)
    return f

"""One friction element under a given motion and normal load: the paper's Fig. 1, 3 and 4.

The paper's rate law (Eq. 19-21) hides two choices. With H(0) = 0 as printed (Eq. 20) the force freezes at the first
slip and never moves again: no work at all. With H(0) = 1 it slips, but it cannot stick again while the normal load
falls: at half the frequency of the motion the loop loses half of its area, whatever the step. The corrected law is the
return map f = clamp(f + k_t dg, +-mu N). Signs: f acts on the side that lags, so that f g' > 0 is dissipated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

__all__ = ["Fit", "Loop", "coupled_loop", "linear_fit", "printed_loop", "two_slope_loop", "work"]


@dataclass(frozen=True)
class Loop:
    """One steady period of an element."""

    angle: np.ndarray               # (s + 1,) w t of the period, both ends [rad]
    motion: np.ndarray              # (s + 1,) relative displacement g [m]
    load: np.ndarray                # (s + 1,) normal load [N]
    force: np.ndarray               # (s + 1,) friction force [N]


@dataclass(frozen=True)
class Fit:
    """The best linear force K g + C g' + F0 for a loop, in the least squares of Eq. 8-11."""

    stiffness: float                # K [N/m]
    damping: float                  # w C [N/m]
    mean: float                     # F0 [N]
    force: np.ndarray               # (s + 1,) the linear force [N]


def two_slope_loop(kt: float, limit: float, amplitude: float, samples: int = 1024) -> Loop:
    """The bilinear loop of Fig. 1 and 3: g = amplitude sin wt, constant friction limit."""
    return coupled_loop(kt, 1.0, (limit, 0.0), amplitude, (1, 1), samples)


def coupled_loop(kt: float, mu: float, load: tuple[float, float], amplitude: float, orders: tuple[int, int],
                 samples: int = 1024) -> Loop:
    """Eq. 22: N = N0 + N1 sin(p t), g = amplitude sin(q t) over their common period, friction by the return map.

    Args:
        load: N0 and N1 [N].
        orders: (p, q), cycles of the load and of the motion in the common period.
        samples: steps of the common period.
    """
    angle = 2 * np.pi * np.arange(samples + 1) / samples
    motion = amplitude * np.sin(orders[1] * angle)
    normal = load[0] + load[1] * np.sin(orders[0] * angle)
    bound = mu * np.maximum(normal, 0.0)
    f, force = 0.0, np.empty(samples + 1)
    for _ in range(2):          # the second period is steady: the period map of one element is a clamp
        for m in range(samples + 1):
            step = motion[m] - motion[m - 1] if m else 0.0
            f = min(max(f + kt * step, -bound[m]), bound[m])
            force[m] = f
    return Loop(angle, motion, normal, force)


def linear_fit(loop: Loop) -> Fit:
    """Eq. 11 by the trapezoidal rule; for one harmonic it agrees with Eq. 16, for several with the corrected one."""
    g, f = loop.motion, loop.force
    rate = np.gradient(g, loop.angle, edge_order=2)
    K, mean = np.linalg.lstsq(np.column_stack([g[1:], np.ones(len(g) - 1)]), f[1:], rcond=None)[0]
    C = trapezoid(rate * f, loop.angle) / trapezoid(rate**2, loop.angle)
    return Fit(float(K), float(C), float(mean), K * g + C * rate + mean)


def work(loop: Loop) -> float:
    """Friction work in the period, the area of the loop [J]."""
    return float(trapezoid(loop.force, loop.motion))


def printed_loop(kt: float, mu: float, load: tuple[float, float], amplitude: float, orders: tuple[int, int],
                 samples: int = 1024, at_zero: int = 1) -> Loop:
    """The same by Eq. 21 as printed, stepped forward: a historical variant, for comparison only.

    Args:
        at_zero: value of the Heaviside function at zero; 0 in Eq. 20, which freezes the force at its first slip.
    """
    angle = 2 * np.pi * np.arange(samples + 1) / samples
    motion = amplitude * np.sin(orders[1] * angle)
    normal = load[0] + load[1] * np.sin(orders[0] * angle)
    f, force = 0.0, np.empty(samples + 1)
    for _ in range(4):
        for m in range(samples + 1):
            inside = mu * normal[m - 1] - abs(f)
            sticks = inside > 0 or (inside == 0 and at_zero == 1)
            step = motion[m] - motion[m - 1] if m else 0.0
            f = f + (kt * step if sticks else 0.0) - max(-inside, 0.0) * np.sign(f)
            force[m] = f
    return Loop(angle, motion, normal, force)

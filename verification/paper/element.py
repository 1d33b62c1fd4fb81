"""One friction element under a given motion and normal load: the paper's Fig. 1, 3 and 4.

The laws are those of ``printed_laws``, as printed (Eq. 19-21) and corrected; the best linear force
is that of ``friction.equivalent_linear``. Signs: f acts on the side that lags, so that f g' > 0 is
dissipated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from bladefem.friction.equivalent_linear import Approximation, from_series, linear_force

from .printed_laws import corrected, differential

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Loop:
    """One steady period of an element."""

    # (s + 1,) w t of the period, both ends [rad]
    angle: np.ndarray
    # (s + 1,) relative displacement g [m]
    motion: np.ndarray
    # (s + 1,) normal load [N]
    load: np.ndarray
    # (s + 1,) friction force [N]
    force: np.ndarray


def two_slope_loop(kt: float, limit: float, amplitude: float, samples: int = 1024) -> Loop:
    """The bilinear loop of Fig. 1 and 3: g = amplitude sin wt, constant friction limit."""
    return coupled_loop(kt, 1.0, (limit, 0.0), amplitude, (1, 1), samples)


def coupled_loop(
    kt: float,
    mu: float,
    load: tuple[float, float],
    amplitude: float,
    orders: tuple[int, int],
    samples: int = 1024,
) -> Loop:
    """Eq. 22: N = N0 + N1 sin(p t), g = amplitude sin(q t) over their common period, friction by
    the return map.

    Args:
        load: N0 and N1 [N].
        orders: (p, q), cycles of the load and of the motion in the common period.
        samples: steps of the common period.
    """
    return _last(lambda g, N: corrected(g, N, kt, mu), load, amplitude, orders, samples, periods=2)


def printed_loop(
    kt: float,
    mu: float,
    load: tuple[float, float],
    amplitude: float,
    orders: tuple[int, int],
    samples: int = 1024,
    at_zero: int = 1,
) -> Loop:
    """The same by Eq. 21 as printed, stepped forward: a historical variant, for comparison only.

    Args:
        at_zero: value of the Heaviside function at zero; 0 in Eq. 20, which freezes the force at
            its first slip.
    """
    return _last(
        lambda g, N: differential(g, N, kt, mu, at_zero),
        load,
        amplitude,
        orders,
        samples,
        periods=4,
    )


def _last(
    law: Law,
    load: tuple[float, float],
    amplitude: float,
    orders: tuple[int, int],
    samples: int,
    periods: int,
) -> Loop:
    """The last of several periods, marched from rest; one is enough for the return map to become
    steady.
    """
    angle = 2 * np.pi * np.arange(samples + 1) / samples
    motion = amplitude * np.sin(orders[1] * angle)
    normal = load[0] + load[1] * np.sin(orders[0] * angle)
    force = law(np.tile(motion, periods), np.tile(normal, periods))
    return Loop(angle, motion, normal, force[-samples - 1 :])


def linear_fit(loop: Loop) -> tuple[Approximation, np.ndarray]:
    """K [N/m], w C [N/m] and F0 [N] of the best linear force (Eq. 11), and that force (s + 1,)
    [N].
    """
    fit = from_series(loop.motion[1:], loop.force[1:], 1.0)
    force = linear_force(fit, loop.motion[1:], 1.0)
    return fit, np.r_[force[-1], force]


def work(loop: Loop) -> float:
    """Friction work in the period, the area of the loop [J]."""
    return float(trapezoid(loop.force, loop.motion))

"""One step of friction for time integration: return maps on arrays of nodes, and the limit of explicit integration.

A step takes the force and the relative displacement before, and the new displacement and normal load; it returns the
new force. The slider is implied: w - f / kt. A node that closes within the step is stretched from the contact on, with
the load taken as linear in the step, if the load before is given with its sign.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from bladefem.errors import InputError
from bladefem.friction.disc import edge

__all__ = ["check_step", "stable_step", "step_1d", "step_2d"]


@njit(cache=True, error_model="numpy")
def step_1d(f, dw, N0, N1, kt, mu):
    """New tangential force (n,) [N] from f (n,), increment dw (n,) [m], loads before and now N0, N1 (n,) [N], kt, mu.

    Loads may be negative (open). f = clamp(f + kt dw, -mu N, mu N), exact for a straight motion under constant load.
    """
    new = np.empty_like(f)
    for e in range(f.size):
        if N1[e] <= 0.0:
            new[e] = 0.0
            continue
        limit, trial = mu[e] * N1[e], f[e] + kt[e] * dw[e]
        if N0[e] <= 0.0:
            trial = kt[e] * dw[e] * N1[e] / (N1[e] - N0[e])
        new[e] = min(max(trial, -limit), limit)
    return new


@njit(cache=True, error_model="numpy")
def step_2d(f, dw, N0, N1, kt, mu):
    """New tangential force (n, 2) [N] from f (n, 2), increment dw (n, 2) [m], loads N0, N1 (n,) [N], kt (n,), mu (n,).

    On the circle |f| = mu N the force turns towards the motion, second order in the step for any stiffness.
    """
    new = np.empty_like(f)
    for e in range(f.shape[0]):
        _, new[e, 0], new[e, 1], _, _, _ = edge(f[e, 0], f[e, 1], kt[e] * dw[e, 0], kt[e] * dw[e, 1], N0[e], N1[e],
                                                mu[e])
    return new


def stable_step(kt: float, mass: float, sides: int = 2) -> float:
    """Longest stable step [s] of explicit central differences for a mass [kg] held by ``sides`` springs kt [N/m] each.

    The condition is sqrt(sides kt / m) dt < 2.
    """
    if kt < 0 or mass <= 0:
        raise InputError(f"stable_step: stiffness {kt} N/m and mass {mass} kg, expected kt >= 0 and mass > 0")
    return 2.0 / sqrt(sides * kt / mass) if kt > 0 else np.inf


def check_step(dt: float, kt: float, mass: float, sides: int = 2) -> None:
    """Raise InputError when an explicit step [s] is beyond its limit: friction saturates and would hide the blow-up."""
    limit = stable_step(kt, mass, sides)
    if not dt < limit:
        raise InputError(f"dt: step {dt:.3g} s is unstable for contact stiffness {kt:.3g} N/m on {mass:.3g} kg, "
                         f"expected less than {limit:.3g} s")

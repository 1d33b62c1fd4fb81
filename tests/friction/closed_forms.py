"""Closed forms of one Jenkins element in several harmonics, and of Mindlin's partial slip of a sphere
as an Iwan array.
"""

from __future__ import annotations

import numpy as np


def jenkins_coefficients(
    amplitude: float,
    kt: float,
    limit: float,
    H: int,
) -> np.ndarray:
    """(2H+1,) force coefficients [mean, cos 1, sin 1, ...] for w = A cos tau, integrated by hand
    [N].

    After the reversal at tau = 0, f = F - k A (1 - cos tau) up to theta*, then f = -F up to tau =
    pi; the second half is the negative of the first, so that even harmonics vanish.
    """
    c = np.zeros(2 * H + 1)
    if kt * amplitude <= limit:
        c[1] = kt * amplitude
        return c
    theta = np.arccos(1 - 2 * limit / (kt * amplitude))
    offset = limit - kt * amplitude
    for h in range(1, H + 1, 2):
        both = kt * amplitude * 0.5
        up = h + 1
        down = h - 1
        cos_part = offset * np.sin(h * theta) / h + both * (
            np.sin(up * theta) / up + _sin_over(down, theta)
        )
        sin_part = offset * (1 - np.cos(h * theta)) / h + both * (
            (1 - np.cos(up * theta)) / up + _integral_of_sine(down, theta)
        )
        cos_part += limit * np.sin(h * theta) / h
        sin_part -= limit * (np.cos(h * theta) - np.cos(h * np.pi)) / h
        c[2 * h - 1], c[2 * h] = 2 / np.pi * cos_part, 2 / np.pi * sin_part
    return c


def _sin_over(p: int, theta: float) -> float:
    """Integral of cos(p tau) from 0 to theta."""
    return theta if p == 0 else np.sin(p * theta) / p


def _integral_of_sine(p: int, theta: float) -> float:
    """Integral of sin(p tau) from 0 to theta."""
    return 0.0 if p == 0 else (1 - np.cos(p * theta)) / p


def iwan_limits(
    kt: float,
    limit: float,
    n: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (n,) [N/m] and limits (n,) [N] of parallel elements that make Mindlin's partial
    slip of a sphere.

    Cattaneo-Mindlin: Q = F (1 - (1 - k w / (1.5 F))^{3/2}) with initial stiffness k and limit F =
    mu P in total (Mindlin & Deresiewicz 1953, doi:10.1115/1.4010702). In an Iwan array the
    stiffness that still sticks at the displacement w is dQ/dw, so that limits F_i = k_i w_i with
    w_i uniform over 0..w_max need k_i ~ -d2Q/dw2. Each element carries the exact moments of its
    interval: stiffness and sum of limits agree with the closed form.
    """
    # 1 - w / w_max
    edge = 1 - np.linspace(0, 1, n + 1)
    # dQ/dw
    slope = kt * np.sqrt(edge)
    force = limit * (1 - edge**1.5)
    most = 1.5 * limit / kt
    k = slope[:-1] - slope[1:]
    # integral of w (-Q'') dw over the interval
    moment = np.diff(force - slope * most * (1 - edge))
    return k, moment


def iwan_force(
    w: np.ndarray,
    kt: float,
    limit: float,
) -> np.ndarray:
    """Force [N] of first loading to w [m] by Cattaneo and Mindlin; reversals follow Masing, Q = 2
    Q(w/2).
    """
    edge = np.clip(1 - np.abs(w) * kt / (1.5 * limit), 0, 1)
    return np.sign(w) * limit * (1 - edge**1.5)

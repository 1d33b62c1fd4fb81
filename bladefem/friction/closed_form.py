"""Closed forms for one Jenkins element at constant normal load, one harmonic: the standards that
the kernels must meet.

With A the amplitude, k the stiffness and F = mu N, the element slips when r = F / (k A) < 1; it
then slides from each reversal plus theta* = acos(1 - 2 r) on (Griffin 1980, doi:10.1115/1.3230256).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bladefem.errors import InputError


@dataclass(frozen=True)
class Linearised:
    """f ~ stiffness w + damping dw/dtau for w = A cos tau, and the energy of one cycle."""

    # k_eq [N/m]
    stiffness: np.ndarray
    # omega c_eq [N/m]
    damping: np.ndarray
    # [J]
    energy: np.ndarray


def jenkins(
    amplitude: np.ndarray,
    kt: float,
    limit: float,
) -> Linearised:
    """First-harmonic stiffness, damping and energy of a Jenkins element with |f| <= limit [N] at an
    amplitude [m].

    k_eq = (k/pi) (theta* - sin(2 theta*) / 2), omega c_eq = (k/pi) sin^2 theta*, W = 4 F (A - F/k).
    """
    A = np.abs(np.asarray(amplitude, dtype=float))
    if kt < 0 or limit < 0:
        raise InputError(
            f"jenkins: stiffness {kt} N/m and limit {limit} N, expected both not negative"
        )
    slips = kt * A > limit
    r = np.divide(limit, kt * A, out=np.ones_like(A), where=slips)
    theta = np.where(slips, np.arccos(1 - 2 * r), np.pi)
    stiffness = kt / np.pi * (theta - 0.5 * np.sin(2 * theta))
    damping = kt / np.pi * np.sin(theta) ** 2
    return Linearised(
        stiffness, np.where(slips, damping, 0.0), np.where(slips, 4 * limit * A * (1 - r), 0.0)
    )


def circular_orbit_work(
    radius: float,
    kt: float,
    limit: float,
) -> float:
    """Energy [J] of one circular orbit of a 2-D element, W = 2 pi F sqrt(A^2 - (F/k)^2), 0 in full
    stick.
    """
    inside = radius**2 - (limit / kt) ** 2
    return 2 * np.pi * limit * np.sqrt(inside) if inside > 0 else 0.0

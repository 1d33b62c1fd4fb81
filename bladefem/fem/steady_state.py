"""The steady state of a rotating, heated body that small vibrations are about."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError

AXIS = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class SteadyState:
    """What small vibrations are about, whose stiffness is `linear_tangent` or `tangent`."""

    # (n_points, dim) static displacement [m]
    displacement: np.ndarray
    # [rad/s]
    speed: float
    axis: tuple[float, float, float] = AXIS
    # Green's strain: of a nonlinear preload
    large: bool = False


def check_speed(speed: float) -> None:
    """Raise InputError for a speed [rad/s] below 0 or not finite."""
    if not (np.isfinite(speed) and speed >= 0):
        raise InputError(f"speed is {speed} rad/s, expected a number not below 0")

"""What of a frequency, its settings and a pattern of deviations does not fit a wheel."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .model import Pattern, Wheel


def check_point(
    wheel: Wheel,
    omega: float,
    H: int,
    samples: int,
    pattern: Pattern,
) -> None:
    if not 0 < omega < np.inf:
        raise InputError(f"omega {omega}: expected a positive circular frequency")
    highest = max(wheel.excitation, default=1)
    if max(highest, 1) > H:
        raise InputError(f"H {H}: expected at least {highest}, the highest excited harmonic")
    if samples == 0 and wheel.elements.tangents > 1:
        raise InputError("samples 0: expected samples above 0 for elements with two tangents")
    for name in ("stiffness", "mass"):
        value = getattr(pattern, name)
        if value is None:
            continue
        blade = wheel.sectors[0].ports.get("blade")
        q = 0 if blade is None else len(range(*blade.indices(len(wheel.sectors[0].residual))))
        if np.shape(value) != (wheel.count, q, q):
            raise InputError(
                f"pattern.{name} of shape {np.shape(value)}: expected ({wheel.count}, {q}, {q}), "
                "one square matrix of the port 'blade' for each sector"
            )
        if not np.isfinite(value).all():
            raise InputError(f"pattern.{name}: expected finite numbers")
    _check_dampers(wheel, pattern)


def _check_dampers(wheel: Wheel, pattern: Pattern) -> None:
    mass = pattern.damper_mass
    if mass is not None and (np.shape(mass) != (wheel.count,) or not (np.array(mass) > -1).all()):
        raise InputError(
            f"pattern.damper_mass: expected {wheel.count} relative deviations above -1, one a "
            "damper"
        )
    wanted = (wheel.count * wheel.nodes, wheel.elements.tangents)
    if pattern.start is not None and np.shape(pattern.start) != wanted:
        raise InputError(
            f"pattern.start of shape {np.shape(pattern.start)}: expected {wanted}, forces of the "
            "friction elements of all dampers"
        )

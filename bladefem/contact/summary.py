"""Resultants of a pressure map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import PressureMap

__all__ = ["Resultant", "resultant"]


@dataclass(frozen=True)
class Resultant:
    """What a face carries, as the damper feels it, in the blade's axes."""

    force: np.ndarray               # (3,) [N]
    moment: np.ndarray              # (3,) about the engine's origin [N m]
    normal: float                   # sum of the normal forces [N]
    centre: np.ndarray              # (3,) force-weighted middle [m]
    area: float                     # pressed [m^2]
    share: float                    # pressed over whole area [1]
    peak: float                     # largest pressure [Pa]


def resultant(pressure: PressureMap) -> Resultant:
    """Resultant of one pressure map, with forces at the nodes' own places."""
    patch, f = pressure.patch, pressure.force
    vectors = patch.frame[:, 0] * f[:, None]
    pressed = f > 0
    weight = f if pressed.any() else patch.area
    area = float(patch.area[pressed].sum())
    return Resultant(vectors.sum(axis=0), np.cross(patch.points, vectors).sum(axis=0), float(f.sum()),
                     weight @ patch.points / weight.sum(), area, area / float(patch.area.sum()),
                     float(pressure.pressure.max(initial=0.0)))

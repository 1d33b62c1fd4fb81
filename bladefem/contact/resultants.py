"""Resultants of a pressure map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import PressureMap


@dataclass(frozen=True)
class Resultant:
    """Force and moment of a face on the damper, in the blade's axes."""

    # (3,) [N]
    force: np.ndarray
    # (3,) about the engine's origin [N m]
    moment: np.ndarray
    # sum of the normal forces [N]
    normal: float
    # (3,) force-weighted middle [m]
    centre: np.ndarray
    # pressed [m^2]
    area: float
    # pressed over whole area [1]
    share: float
    # largest pressure [Pa]
    peak: float


def resultant(pressure: PressureMap) -> Resultant:
    """Resultant of one pressure map, with forces at the mean places of what their nodes stand for.

    There, not at the nodes, do the moments of flat faces balance: a node at an edge stands for what
    is inside of it.
    """
    patch = pressure.patch
    f = pressure.force
    places = patch.points if patch.places is None else patch.places
    vectors = patch.frame[:, 0] * f[:, None]
    pressed = f > 0
    weight = f if pressed.any() else patch.area
    area = float(patch.area[pressed].sum())
    return Resultant(
        vectors.sum(axis=0),
        np.cross(places, vectors).sum(axis=0),
        float(f.sum()),
        weight @ places / weight.sum(),
        area,
        area / float(patch.area.sum()),
        float(pressure.pressure.max(initial=0.0)),
    )

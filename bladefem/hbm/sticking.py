"""Points where all contacts stick: friction is linear there, and no more harmonics are needed than are excited."""

from __future__ import annotations

import numpy as np

from ..friction.harmonics import synthesis
from .model import ReducedModel
from .solution import Solution

__all__ = ["INSTANTS", "grips"]

INSTANTS = 64           # a period of the highest harmonic at which full stick is confirmed
SPARE = 4e-3            # share of the friction limit kept in hand: between instants a harmonic rises by 1.2e-3


def grips(model: ReducedModel, solution: Solution) -> bool:
    """All contacts stick, with a little of the friction limit in hand at every instant."""
    if solution.states["stick"] < len(model.elements.kt):
        return False
    e, f, H = model.elements, solution.f, solution.harmonics
    limit = (1 - SPARE) * e.mu
    if f.shape[1] == 1 and not model.normal and H == 1:     # of an alternating force the peak is known
        return bool(np.all(abs(f[:, 0, 0]) + np.hypot(f[:, 0, 1], f[:, 0, 2]) < limit * e.n0))
    instants = INSTANTS * H
    force = f @ synthesis(H, instants).T
    normal = force[:, 0] if model.directions > e.tangents else e.n0[:, None]
    if model.normal and model.directions == e.tangents:
        normal = model.normal_series(instants)
    return bool(np.all(np.linalg.norm(force[:, -e.tangents:], axis=1) < limit[:, None] * normal))

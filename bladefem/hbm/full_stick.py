"""Points where all contacts stick: friction is linear there, and no more harmonics are needed than
are excited.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

import numpy as np

from ..friction.fourier import synthesis
from .model import ReducedModel
from .policy import uses_coulomb_kernels
from .solution import Solution

# a period of the highest harmonic at which full stick is confirmed
INSTANTS_PER_HARMONIC = 64
# share of the friction limit kept in hand: between instants a harmonic rises by 1.2e-3
FRICTION_MARGIN = 4e-3


def sticks_safely(model: ReducedModel, solution: Solution) -> bool:
    """All contacts stick, with a little of the friction limit in hand at every instant."""
    if not uses_coulomb_kernels(model):
        return False
    return solution.states["stick"] == len(model.elements.kt) and bool(
        _within_friction_limit(model, solution.f)
    )


def leading_stuck_points(model: ReducedModel, points: Sequence[Solution | None]) -> list[Solution]:
    """The first of the points, which have the same harmonics, as long as they grip."""
    nodes = len(model.elements.kt)
    stuck: list[Solution] = []
    for point in points:
        if point is None or point.states["stick"] != nodes:
            break
        stuck.append(point)
    if not stuck:
        return []
    holds = _within_friction_limit(model, np.array([p.f for p in stuck]))
    return [p for p, _ in takewhile(lambda pair: pair[1], zip(stuck, holds, strict=True))]


def _within_friction_limit(model: ReducedModel, f: np.ndarray) -> np.ndarray:
    """Whether contact forces (..., n, d, 2H+1) keep within the friction limit, and a little
    more.
    """
    e = model.elements
    H = f.shape[-1] // 2
    limit = (1 - FRICTION_MARGIN) * e.mu
    # of an alternating force the peak is known
    if f.shape[-2] == 1 and not model.normal and H == 1:
        peak = abs(f[..., 0, 0]) + np.hypot(f[..., 0, 1], f[..., 0, 2])
        return np.all(peak < limit * e.n0, axis=-1)
    instants = INSTANTS_PER_HARMONIC * H
    force = f @ synthesis(H, instants).T
    normal = force[..., 0, :] if model.directions > e.tangents else e.n0[:, None]
    if model.normal and model.directions == e.tangents:
        normal = model.normal_series(instants)
    tangential = np.linalg.norm(force[..., -e.tangents :, :], axis=-2)
    return np.all(tangential < limit[:, None] * normal, axis=(-2, -1))

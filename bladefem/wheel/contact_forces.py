"""Friction forces of all dampers of a wheel in one batch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Elements
from ..friction.aft import evaluate
from ..friction.kernel_1d_exact import evaluate_exact
from ..util.arrays import RealArray
from .model import Wheel


@dataclass(frozen=True)
class ContactForces:
    """Forces of all contacts in the directions of the balance; N dampers of n nodes, K = 2H+1."""

    # (N, n, d, K) contact forces [N]
    f: RealArray
    # (N, n, d, K) forces beyond preload and springs of full stick [N]
    p: RealArray
    # (N n, dK, dK) derivative of p [N/m]
    change: np.ndarray | None
    # (N, n, 3) shares of stick, slip, separation
    shares: RealArray
    # (N, n) energy a period [J]
    dissipated: RealArray
    # False: a two-dimensional element found no periodic state
    converged: bool
    reason: str

    @property
    def jacobian(self) -> np.ndarray:
        """``change`` of forces that were evaluated with it."""
        if self.change is None:
            raise RuntimeError("the contact forces were evaluated without their Jacobian")
        return self.change


def contact_forces(
    wheel: Wheel,
    elements: Elements,
    w: np.ndarray,
    start: np.ndarray,
    samples: int,
    jacobian: bool = True,
) -> ContactForces:
    """Forces for relative displacements w (N, n, d, K) [m].

    Args:
        elements: of all dampers.
        start: (N n, tangents) friction forces from which the law starts [N].
        samples: a period; 0 locates transitions exactly, for elements of one tangent.
    """
    count, n, d, K = w.shape
    missing = 1 + elements.tangents - d
    flat = w.reshape(count * n, d, K).copy()
    flat[:, :, 0] += wheel.offset(elements, start).reshape(count * n, d)
    if missing:
        flat = np.concatenate([np.zeros((count * n, missing, K)), flat], axis=1)
    if samples:
        found = evaluate(elements, flat, samples, jacobian, precision="single")
    else:
        found = evaluate_exact(elements, flat)
    f = found.f[:, missing:].reshape(w.shape)
    p = f - wheel.springs[:, :, None] * w
    p[..., 0] -= wheel.preload(elements)
    change = None
    if jacobian:
        blocks = found.jacobian[:, missing:, :, missing:].reshape(count, n, d * K, d * K).copy()
        diagonal = np.arange(d * K)
        blocks[:, :, diagonal, diagonal] -= np.repeat(wheel.springs, K, axis=1)
        change = blocks.reshape(count * n, d * K, d * K)
    return ContactForces(
        f,
        p,
        change,
        found.shares.reshape(count, n, 3),
        found.dissipated.reshape(count, n),
        found.converged,
        found.reason,
    )

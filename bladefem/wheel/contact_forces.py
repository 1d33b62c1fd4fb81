"""Friction forces of all dampers of a wheel in one batch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Elements
from ..friction.aft import evaluate
from ..friction.kernel_1d_exact import evaluate_exact
from ..friction.law_table import select_elements
from ..util.arrays import RealArray
from .model import Wheel


@dataclass(frozen=True)
class ContactForces:
    """Forces of all contacts in the directions of the balance; N dampers of n nodes, K = 2H+1."""

    # (N, n, d, K) contact forces [N]
    f: RealArray
    # (N, n, d, K) forces beyond preload and springs of full stick [N]
    p: RealArray
    # (own n, dK, dK) derivative of p at the dampers of this rank's sectors [N/m]
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
    walk: np.ndarray | None = None,
) -> ContactForces:
    """Forces for relative displacements w (N, n, d, K) [m], each damper's on the rank of its
    sector.

    Args:
        elements: of all dampers.
        start: (N n, tangents) friction forces from which the law starts [N].
        samples: a period; 0 locates transitions exactly, for elements of one tangent.
        walk: (N n, tangents) how far the contacts go on in each period, which needs samples [m].
    """
    count, n, d, K = w.shape
    partition = wheel.partition
    missing = 1 + elements.tangents - d
    flat = w.copy()
    flat[..., 0] += wheel.offset(elements, start)
    flat = flat[partition.sectors].reshape(-1, d, K)
    if missing:
        flat = np.concatenate([np.zeros((len(flat), missing, K)), flat], axis=1)
    own = elements
    if partition.ranks > 1:
        rows = np.arange(count * n).reshape(count, n)[partition.sectors].ravel()
        own = select_elements(elements, rows)
        walk = None if walk is None else walk[rows]
    if samples:
        found = evaluate(own, flat, samples, jacobian, precision="single", walk=walk)
    else:
        found = evaluate_exact(own, flat)
    f = partition.join(found.f[:, missing:].reshape(-1, n, d, K))
    p = f - wheel.springs[:, :, None] * w
    p[..., 0] -= wheel.preload(elements)
    change = None
    if jacobian:
        blocks = found.jacobian[:, missing:, :, missing:].reshape(-1, n, d * K, d * K).copy()
        diagonal = np.arange(d * K)
        blocks[:, :, diagonal, diagonal] -= np.repeat(wheel.springs, K, axis=1)
        change = blocks.reshape(-1, d * K, d * K)
    reasons = partition.gather("" if found.converged else found.reason)
    failed = next(filter(None, reasons), "")
    return ContactForces(
        f,
        p,
        change,
        partition.join(found.shares.reshape(-1, n, 3)),
        partition.join(found.dissipated.reshape(-1, n)),
        not failed,
        failed or found.reason,
    )

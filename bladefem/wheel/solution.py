"""A solved frequency of the wheel: motion, contact forces and how they were reached."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..util.arrays import ComplexArray, RealArray
from .model import Wheel
from .walking import WheelWalk


@dataclass(frozen=True)
class WheelSolution:
    """A point of the wheel's response: converged, or the best that was found, with the reason."""

    # [rad/s]
    omega: float
    samples: int
    # (N, n, d, K) relative displacements: mean, cos 1, sin 1, ... [m]
    w: RealArray
    # (N, n, d, K) contact forces, with the preload in the mean of the normal ones [N]
    f: RealArray
    # (N, H+1, probes) complex amplitudes, Re(q e^{i h omega t}) [m]
    probe: ComplexArray
    converged: bool
    reason: str
    # "newton", or what reached the point
    method: str
    iterations: int
    products: int
    # over the size of the motion [1]
    residual: float
    # (N, n, 3) shares of stick, slip and separation in a period
    shares: RealArray
    # (N,) friction work of each damper in a period [J]
    dissipated: RealArray
    # dampers that walk, whose mean of w along their motions is the step a period; None: none does
    walk: WheelWalk | None = None

    @property
    def drift(self) -> RealArray:
        """(N,) how fast each damper walks, of the contact that goes on fastest [m/s]."""
        if self.walk is None:
            return np.zeros(len(self.w))
        ramp = self.walk.ramp(self.walk.steps(self.w)).reshape(len(self.w), -1, self.walk.tangents)
        return np.asarray(np.linalg.norm(ramp, axis=2).max(axis=1) * self.frequency)

    @property
    def frequency(self) -> float:
        """[Hz]"""
        return self.omega / (2 * np.pi)

    def size(self, probe: int = 0) -> np.ndarray:
        """(N,) root of the sum of squares of the moving harmonics of each blade [m]."""
        return np.linalg.norm(self.probe[:, 1:, probe], axis=1)


def fitted_displacements(
    w: np.ndarray,
    wheel: Wheel,
    H: int,
) -> np.ndarray:
    """Displacements with harmonics cut or filled up with zeros.

    Raises:
        InputError: they belong to another wheel.
    """
    if w.shape[:3] != (wheel.count, wheel.nodes, wheel.directions):
        raise InputError("start: expected a solution of a wheel with the same contacts")
    size = 2 * H + 1
    out = np.zeros((*w.shape[:3], size))
    common = min(size, w.shape[3])
    out[..., :common] = w[..., :common]
    return out

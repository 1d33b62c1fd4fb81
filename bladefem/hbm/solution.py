"""What one solved point knows about itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import RigidBody
from ..friction.harmonics import to_complex
from .bodies import contact_rows, drive, loss, pushed
from .model import ReducedModel

__all__ = ["Solution", "Work", "probe_motion", "works"]


@dataclass(frozen=True)
class Work:
    """Work in one period [J]; in a solved balance  input = damping + friction  for the harmonics that are kept."""

    input: float            # of the excitation on the blades
    damping: float          # lost in the linear bodies
    friction: float         # of the balanced force harmonics on the relative motion
    dissipated: float       # in the contacts, from the sampled motion with all its harmonics

    @property
    def imbalance(self) -> float:
        """|input - damping - friction| over the input work."""
        return abs(self.input - self.damping - self.friction) / max(abs(self.input), np.finfo(float).tiny)


@dataclass(frozen=True)
class Solution:
    """A point of a response: converged, or the best that was found, with the reason."""

    omega: float                    # [rad/s]
    harmonics: int                  # H
    samples: int                    # a period
    w: np.ndarray                   # (n, d, 2H+1) relative displacements: mean, cos 1, sin 1, ... [m]
    f: np.ndarray                   # (n, d, 2H+1) contact forces, with the preload in the mean of the normal ones [N]
    probe: np.ndarray               # (H+1, probes) complex amplitudes, Re(q e^{i h omega t}) [m]
    converged: bool
    reason: str
    method: str                     # "newton" or the fallback that reached the point
    iterations: int                 # Newton steps, of all attempts
    residual: float                 # over the size of the motion [1]
    residual_displacement: float    # largest entry of the residual [m]
    residual_force: float           # the same times the contact stiffness [N]
    drift: float                    # mean load on the springs that hold the damper, over the contacts' load [1]
    states: dict[str, int]          # number of nodes that stick, slip, lift off, are open
    work: Work

    @property
    def amplitude(self) -> np.ndarray:
        """(H+1, probes) amplitude of each harmonic [m]."""
        return abs(self.probe)

    @property
    def frequency(self) -> float:
        """[Hz]"""
        return self.omega / (2 * np.pi)


def probe_motion(model: ReducedModel, omega: float, force: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """(H+1, probes) amplitudes at the probes by the excitation and contact forces (H+1, m) beyond the preload."""
    motion = []
    for h, contact in enumerate(force):
        side = model.side(h)
        probes = side.ports.get("probe", slice(0, 0))
        ports, push = pushed(model, h, contact)
        amplitudes = drive(side, model.damping, h * omega, push)
        if h == 0:
            still = np.flatnonzero(side.omega == 0)
            amplitudes[still] += rigid[:len(still)]
        motion.append(side.shapes[probes] @ amplitudes + side.residual[probes] @ ports)
    return np.array(motion)


def works(model: ReducedModel, omega: float, w: np.ndarray, f: np.ndarray, dissipated: float) -> Work:
    """Work of each kind in a period, for displacements and forces (n, d, K)."""
    force = to_complex(f.reshape(-1, f.shape[2])).T
    motion = to_complex(w.reshape(-1, w.shape[2])).T
    orders = np.arange(len(force))
    friction = np.pi * np.sum(orders[:, None] * (force * (1j * motion).conj()).real)
    put_in = lost = 0.0
    for h in orders[1:]:
        side, w_h = model.side(h), h * omega
        ports, push = pushed(model, h, force[h])
        amplitudes = drive(side, model.damping, w_h, push)
        lost += h * loss(side, model.damping, w_h, amplitudes)
        if h in model.excitation:
            at = side.ports["load"]
            moved = side.shapes[at] @ amplitudes + side.residual[at] @ ports
            put_in += np.pi * h * np.sum((model.excitation[h] * (1j * moved).conj()).real)
        if model.damper is not None and not isinstance(model.damper, RigidBody):
            other = model.damper_side(h)
            push = other.shapes[contact_rows(other, model)].conj().T @ force[h]
            lost += h * loss(other, model.damper_damping, w_h, drive(other, model.damper_damping, w_h, push))
    return Work(float(put_in), float(lost), float(friction), dissipated)

"""What one solved point knows about itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import PortModel, RigidBody
from ..friction.harmonics import to_complex
from .linear import receptance
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
        columns = np.arange(len(side.residual))[side.ports["contact"]][model.rows]
        q = -receptance(side, model.damping, h * omega, probes, columns) @ contact
        if h in model.excitation:
            q = q + receptance(side, model.damping, h * omega, probes, side.ports["load"]) @ model.excitation[h]
        if h == 0:
            free = side.omega == 0
            q = q + side.shapes[probes][:, free] @ rigid[:free.sum()]
        motion.append(q)
    return np.array(motion)


def works(model: ReducedModel, omega: float, w: np.ndarray, f: np.ndarray, dissipated: float) -> Work:
    """Work of each kind in a period, for displacements and forces (n, d, K)."""
    force = to_complex(f.reshape(-1, f.shape[2])).T
    motion = to_complex(w.reshape(-1, w.shape[2])).T
    orders = np.arange(len(force))
    friction = np.pi * np.sum(orders[:, None] * (force * (1j * motion).conj()).real)
    put_in = damped = 0.0
    for h in orders[1:]:
        load, loss = _blade_work(model, h, omega, force[h])
        put_in += load
        damped += loss
        if model.damper is not None and not isinstance(model.damper, RigidBody):
            side = model.damper_side(h)
            damped += _loss(side, model.damper_damping, h, omega, side.shapes[_rows(side, model)].conj().T @ force[h])
    return Work(put_in, damped, float(friction), dissipated)


def _blade_work(model: ReducedModel, h: int, omega: float, force: np.ndarray) -> tuple[float, float]:
    side, rows = model.side(h), _rows(model.side(h), model)
    load = model.excitation.get(h)
    push = -side.shapes[rows].conj().T @ force
    put_in = 0.0
    if load is not None:
        ports = side.ports["load"]
        push = push + side.shapes[ports].conj().T @ load
        motion = receptance(side, model.damping, h * omega, ports, ports) @ load \
            - receptance(side, model.damping, h * omega, ports, rows) @ force
        put_in = np.pi * h * np.sum((load * (1j * motion).conj()).real)
    return put_in, _loss(side, model.damping, h, omega, push)


def _loss(side: PortModel, damping: object, h: int, omega: float, push: np.ndarray) -> float:
    """Work lost in a body's modes under the modal forces `push`."""
    term = damping.term(side.omega, h * omega)
    stiffness = side.omega**2 - (h * omega)**2
    if side.damping is not None and side.damping.ndim == 2:
        term = np.diag(term) + 1j * h * omega * side.damping
        amplitudes = np.linalg.solve(np.diag(stiffness) + term, push)
        return float(np.pi * h * (amplitudes.conj() @ term @ amplitudes).imag)
    if side.damping is not None:
        term = term + 1j * h * omega * side.damping
    return float(np.pi * h * np.sum(term.imag * abs(push / (stiffness + term))**2))


def _rows(side: PortModel, model: ReducedModel) -> np.ndarray:
    return np.arange(len(side.residual))[side.ports["contact"]][model.rows]

"""Linear bodies driven by forces at their ports: modal amplitudes, motions, losses, and their rates with frequency."""

from __future__ import annotations

import numpy as np

from ..data import PortModel
from .model import Damping, ReducedModel

__all__ = ["contact_rows", "drive", "drive_rate", "impedance", "impedance_rate", "loss", "pushed", "receptance"]


def receptance(body: PortModel, damping: Damping, w: float, rows: np.ndarray | slice,
               columns: np.ndarray | slice) -> np.ndarray:
    """(rows, columns) displacement [m] at the ports by unit harmonic forces [N]; at w = 0 without the rigid modes."""
    elastic = body.omega > 0 if w == 0 else np.ones(len(body.omega), dtype=bool)
    left, right = body.shapes[rows][:, elastic], body.shapes[columns][:, elastic]
    Z = impedance(body, damping, w)
    if Z.ndim == 2:
        return left @ np.linalg.solve(Z[np.ix_(elastic, elastic)], right.conj().T) + body.residual[rows][:, columns]
    flexibility = 1 / Z[elastic]
    if np.isrealobj(left):      # two real products cost half of one complex product
        scaled = np.concatenate([left * flexibility.real, left * flexibility.imag]) @ right.T
        result = scaled[len(left):] * 1j
        result += scaled[:len(left)] + body.residual[rows][:, columns]
        return result
    return (left * flexibility) @ right.conj().T + body.residual[rows][:, columns]


def impedance(body: PortModel, damping: Damping, w: float) -> np.ndarray:
    """(m,), or (m, m) where damping couples the modes: omega_r^2 - w^2 + damping [1/s^2]."""
    Z = body.omega**2 - w**2 + damping.term(body.omega, w)
    if body.damping is None or w == 0:
        return Z
    return Z + 1j * w * body.damping if body.damping.ndim == 1 else np.diag(Z) + 1j * w * body.damping


def impedance_rate(body: PortModel, damping: Damping, w: float) -> np.ndarray:
    """Derivative of the impedance with w, of the same shape [1/s]."""
    Z = -2 * w + damping.rate(body.omega)
    if body.damping is None:
        return Z
    return Z + 1j * body.damping if body.damping.ndim == 1 else np.diag(Z) + 1j * body.damping


def drive(body: PortModel, damping: Damping, w: float, push: np.ndarray) -> np.ndarray:
    """(m,) modal amplitudes under the modal forces `push`; rigid modes stay at rest at w = 0."""
    Z = impedance(body, damping, w)
    if w == 0:
        elastic = body.omega > 0
        return np.where(elastic, push / np.where(elastic, Z, 1.0), 0.0)
    return push / Z if Z.ndim == 1 else np.linalg.solve(Z, push)


def drive_rate(body: PortModel, damping: Damping, w: float, amplitudes: np.ndarray) -> np.ndarray:
    """(m,) derivative with w of modal amplitudes under constant forces."""
    rate = impedance_rate(body, damping, w)
    return -drive(body, damping, w, rate * amplitudes if rate.ndim == 1 else rate @ amplitudes)


def loss(body: PortModel, damping: Damping, w: float, amplitudes: np.ndarray) -> float:
    """Work lost in the modes in one cycle of circular frequency w [J]."""
    resisting = impedance(body, damping, w)
    if resisting.ndim == 1:
        return float(np.pi * np.sum(resisting.imag * abs(amplitudes)**2))
    return float(np.pi * (amplitudes.conj() @ resisting @ amplitudes).imag)


def pushed(model: ReducedModel, h: int, force: np.ndarray, load: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Blade under harmonic h: forces at all its ports (p,) and on its modes (m,).

    Args:
        force: (m,) contact forces that the damper feels; the blade feels the opposite [N].
        load: factor of the excitation.
    """
    body = model.side(h)
    ports = np.zeros(len(body.residual), dtype=complex)
    ports[contact_rows(body, model)] = -force
    if h in model.excitation:
        ports[body.ports["load"]] += load * model.excitation[h]
    return ports, body.shapes.conj().T @ ports


def contact_rows(body: PortModel, model: ReducedModel) -> np.ndarray:
    """Rows of the body's ports that enter the balance."""
    return np.arange(len(body.residual))[body.ports["contact"]][model.rows]

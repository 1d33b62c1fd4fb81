"""How the balance changes with a parameter while the displacements stand still: exact, without differences.

The friction law scales: f is homogeneous of degree one in (kt, kn, n0), and a function of kt w_t, kn w_n + n0 and mu N.
Euler's relation therefore gives every derivative with a contact parameter from f and df/dw.

Parameters and their units: "omega" [rad/s]; "force", "load", "mu", "kt", "kn", "mass" are logarithms of factors [1];
"gap" is an opening [m].
"""

from __future__ import annotations

import numpy as np

from ..data import RigidBody
from ..errors import InputError
from .bodies import contact_rows, drive, drive_rate, pushed
from .model import ReducedModel
from .residual import Balance, State, as_amplitudes, as_coefficients
from .vary import check_parameter

__all__ = ["body_rate", "contact_load", "contact_rate", "rate"]


def rate(balance: Balance, state: State, name: str) -> np.ndarray:
    """(n, d, K) derivative of the residual with a parameter at fixed displacements, at a solved state [m]."""
    linear = balance.linear
    check_parameter(name, also=("omega",))
    if name in ("omega", "force", "mass"):
        moved, _ = body_rate(balance.model, linear.omega, as_amplitudes(contact_load(balance.model, state)), name)
        moved[1:] -= (linear.A[1:] @ (linear.springs * moved[1:])[:, :, None])[:, :, 0]
        moved[0] -= linear.A[0] @ (linear.springs * moved[0])
        return -as_coefficients(moved, state.w.shape)
    force = as_amplitudes(contact_rate(balance.model, state, name))
    return as_coefficients((linear.A @ force[:, :, None])[:, :, 0], state.w.shape)


def contact_load(model: ReducedModel, state: State) -> np.ndarray:
    """(n, d, K) contact forces beyond the preload [N]."""
    load = state.forces.f.copy()
    if model.directions > model.elements.tangents:
        load[:, 0, 0] -= np.maximum(model.elements.n0, 0.0)
    return load


def contact_rate(model: ReducedModel, state: State, name: str) -> np.ndarray:
    """(n, d, K) derivative of the contact forces beyond the preload with a contact parameter [N, N/m]."""
    f, D, w, elements = state.forces.f, state.forces.dfdw, state.w, model.elements
    first = model.directions - elements.tangents        # where the tangents begin
    by_tangents = np.einsum("nakbl,nbl->nak", D[:, :, :, first:], w[:, first:])
    by_normal = np.einsum("nakl,nl->nak", D[:, :, :, 0], w[:, 0]) if first else np.zeros_like(f)
    if name == "kt":
        return by_tangents
    if name == "kn":
        return by_normal
    if name == "mu":
        rate = f - by_tangents
        rate[:, :first] = 0.0
        return rate
    if name == "load":
        rate = f - by_tangents - by_normal
        if first:
            rate[:, 0, 0] -= np.maximum(elements.n0, 0.0)
        return rate
    if not first:
        raise InputError("gap: a prescribed normal load has no gap, expected elements.kn > 0")
    rate = -D[:, :, :, 0, 0].copy()                     # an opening is a mean normal displacement the other way
    rate[:, 0, 0] += elements.kn * (elements.n0 > 0)
    return rate


def body_rate(model: ReducedModel, omega: float, force: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the bodies' motion under constant contact forces (H+1, m) with "omega", "force" or "mass".

    Returns:
        (H+1, m) of the relative contact displacements and (H+1, probes) of the probes.
    """
    contact, probe = [], []
    for h, contact_force in enumerate(force):
        side = model.side(h)
        rows, probes = contact_rows(side, model), side.ports.get("probe", slice(0, 0))
        w, moved = h * omega, np.zeros(len(side.residual), dtype=complex)
        if name == "omega" and h:
            _, push = pushed(model, h, contact_force)
            moved = h * side.shapes @ drive_rate(side, model.damping, w, drive(side, model.damping, w, push))
        elif name == "force":
            ports, push = pushed(model, h, np.zeros_like(contact_force))
            moved = side.shapes @ drive(side, model.damping, w, push) + side.residual @ ports
        contact.append(moved[rows] - _damper_rate(model, h, omega, contact_force, name))
        probe.append(moved[probes])
    return np.array(contact), np.array(probe)


def _damper_rate(model: ReducedModel, h: int, omega: float, force: np.ndarray, name: str) -> np.ndarray:
    """(m,) derivative of the damper's contact displacements under constant forces."""
    if model.damper is None or h == 0 or name == "force":
        return np.zeros(len(force), dtype=complex)
    if isinstance(model.damper, RigidBody):
        B = model.damper.B[model.rows]
        motion = -B @ np.linalg.solve(model.damper.mass, B.T @ force) / (h * omega)**2
        return motion * (-2 / omega if name == "omega" else -1.0)
    if name == "mass":
        raise InputError("mass: expected damper to be a RigidBody")
    body = model.damper_side(h)
    rows = contact_rows(body, model)
    amplitudes = drive(body, model.damper_damping, h * omega, body.shapes[rows].conj().T @ force)
    return h * body.shapes[rows] @ drive_rate(body, model.damper_damping, h * omega, amplitudes)

"""The linear bodies at one frequency, condensed to the contact, with and without the contact springs.

With f the contact forces of harmonic h (beyond the preload) the bodies say  w = free - G f + B q,  B^H f = g, where q
are motions without stiffness (harmonic 0 only). Writing f = K w + p, K the springs of full stick, gives the form that
the balance uses,  w = stuck - A p: here p vanishes at every node that sticks, and needs no unknowns there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ..data import RigidBody
from ..errors import NotSolvedError
from .bodies import contact_rows, receptance
from .model import ReducedModel

__all__ = ["Linear", "condense", "receptance"]

UNSEEN = 1e-12         # motions that the contact springs resist less than this, relatively, are left out


@dataclass(frozen=True)
class Linear:
    """Flexibilities of the contact at one frequency, m = nodes * directions, complex amplitudes of e^{i h omega t}."""

    omega: float
    springs: np.ndarray     # (m,) K [N/m]
    G: np.ndarray           # (H+1, m, m) flexibility without contact springs and rigid motions [m/N]
    free: np.ndarray        # (H+1, m) relative displacement without contact forces [m]
    A: np.ndarray           # (H+1, m, m) flexibility with contact springs [m/N]
    stuck: np.ndarray       # (H+1, m) relative displacement in full stick [m]
    B: np.ndarray           # (m, r) motions without stiffness of harmonic 0, scaled to B^T K B = 1
    g: np.ndarray           # (r,) loads on these motions
    rigid: np.ndarray       # (r0, r) the same motions in the rigid coordinates of blade, then damper


def condense(model: ReducedModel, omega: float, harmonics: int) -> Linear:
    """Flexibilities of harmonics 0..H at circular frequency omega [rad/s]."""
    springs = model.springs.ravel()
    m = len(springs)
    G, A = np.zeros((2, harmonics + 1, m, m), dtype=complex)
    free, stuck = np.zeros((2, harmonics + 1, m), dtype=complex)
    for h in range(harmonics + 1):
        G[h], free[h] = _flexibility(model, h, h * omega)
    B, g, rigid = _rigid_motions(model, springs)
    A[0], stuck[0] = _with_springs(G[0].real, free[0].real, springs, B, g, model.hold)
    for h in range(1, harmonics + 1):
        A[h], stuck[h] = _sprung(G[h], free[h], springs)
    return Linear(omega, springs, G, free, A, stuck, B, g, rigid)


def _flexibility(model: ReducedModel, h: int, w: float) -> tuple[np.ndarray, np.ndarray]:
    side, rows = model.side(h), contact_rows(model.side(h), model)
    G = receptance(side, model.damping, w, rows, rows)
    free = np.zeros(len(G), dtype=complex)
    if h in model.excitation:
        free = receptance(side, model.damping, w, rows, side.ports["load"]) @ model.excitation[h]
    if isinstance(model.damper, RigidBody):
        if h > 0:
            B = model.damper.B[model.rows]
            G = G - B @ np.linalg.solve(model.damper.mass, B.T) / w**2
    elif model.damper is not None:
        damper = model.damper_side(h)
        rows = contact_rows(damper, model)
        G = G + receptance(damper, model.damper_damping, w, rows, rows)
    return G, free


def _sprung(G: np.ndarray, free: np.ndarray, springs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(1 + G K)^-1 times G and times free; in Fortran order, which spares LAPACK two copies."""
    m = len(springs)
    right = np.empty((m, m + 1), dtype=complex, order="F")
    right[:, :m], right[:, m] = G, free
    system = np.multiply(G, springs, order="F")
    system[np.diag_indices(m)] += 1.0
    _, _, solved, info = lapack.zgesv(system, right, overwrite_a=True, overwrite_b=True)
    if info:
        raise NotSolvedError("contact flexibility with springs is singular: a resonance without damping is hit exactly")
    return solved[:, :m], solved[:, m]


def _rigid_motions(model: ReducedModel, springs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    side = model.side(0)
    still = side.omega == 0
    motions, loads = [side.shapes[contact_rows(side, model)][:, still].real], np.zeros(still.sum())
    if 0 in model.excitation:
        loads = side.shapes[side.ports["load"]][:, still].real.T @ np.real(model.excitation[0])
    if isinstance(model.damper, RigidBody):
        motions.append(-model.damper.B[model.rows])
    elif model.damper is not None:
        damper = model.damper_side(0)
        motions.append(-damper.shapes[contact_rows(damper, model)][:, damper.omega == 0].real)
    B = np.column_stack(motions)
    loads = np.concatenate([loads, np.zeros(B.shape[1] - len(loads))])
    held = B.T @ (springs[:, None] * B)
    size = np.sqrt(np.where(np.diag(held) > 0, np.diag(held), 1.0))     # metres and radians alike
    values, vectors = np.linalg.eigh(held / np.outer(size, size))
    kept = values > UNSEEN
    rigid = vectors[:, kept] / np.sqrt(values[kept]) / size[:, None]
    return B @ rigid, rigid.T @ loads, rigid


def _with_springs(G: np.ndarray, free: np.ndarray, springs: np.ndarray, B: np.ndarray,
                  g: np.ndarray, hold: float) -> tuple[np.ndarray, np.ndarray]:
    """Flexibility and displacement of harmonic 0 with contact springs, motions without stiffness eliminated."""
    m, r = B.shape
    system = np.block([[np.eye(m) + G * springs, -B], [B.T * springs, hold * np.eye(r)]])
    solved = np.linalg.solve(system, np.block([[G, free[:, None]], [B.T, g[:, None]]]))
    return solved[:m, :m], solved[:m, m]

"""The linear bodies at one frequency, condensed to the contact, with and without the contact
springs.

With f the contact forces of harmonic h (beyond the preload) the bodies say  w = free - G f + B q,
B^H f = g, where q are motions without stiffness (harmonic 0 only). Writing f = K w + p, K the
springs of full stick, gives the form that the balance uses,  w = stuck - A p: here p vanishes at
every node that sticks, and needs no unknowns there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ...data import RigidBody
from ...errors import NotSolvedError
from ...util.arrays import ComplexArray, RealArray
from ..model import ReducedModel
from ..policy import BATCHED_SOLVE_DOFS
from .bodies import (
    modal_amplitudes,
    modal_flexibility,
    port_motion,
    receptance_block,
)
from .woodbury import low_rank, low_rank_update

# motions that the contact springs resist less than this, relatively, are left out
UNRESISTED_SHARE = 1e-12
# Springs on the mean of the motions without stiffness, over the contact stiffness. Where every
# contact on such a motion slips its mean position has no influence, and these springs choose one;
# no accepted point leaves them a load (`bladefem.hbm.solver.walking`).
REGULARISATION = 5e-8


@dataclass(frozen=True)
class Linear:
    """Flexibilities of the contact at one frequency, m = nodes * directions, complex amplitudes of
    e^{i h omega t}.
    """

    omega: float
    # (m,) K [N/m]
    springs: RealArray
    # (H+1, m, m) flexibility without contact springs and rigid motions [m/N]
    G: ComplexArray
    # (H+1, m) relative displacement without contact forces [m]
    free: ComplexArray
    # (H+1, m, m) flexibility with contact springs [m/N]
    A: ComplexArray
    # (H+1, m) relative displacement in full stick [m]
    stuck: ComplexArray
    # (m, r) motions without stiffness of harmonic 0, scaled to B^T K B = 1
    B: RealArray
    # (r,) loads on these motions
    g: RealArray
    # (r0, r) the same motions in the rigid coordinates of blade, then damper
    rigid: RealArray


def condense(
    model: ReducedModel,
    omega: float,
    harmonics: int,
) -> Linear:
    """Flexibilities of harmonics 0..H at circular frequency omega [rad/s]."""
    springs = model.springs.ravel()
    orders = omega * np.arange(harmonics + 1)
    blades = model.blades(harmonics)
    flexible = modal_flexibility(blades, orders)
    G = receptance_block(blades, flexible, blades.contact, blades.contact)
    force = np.zeros((harmonics + 1, blades.shapes.shape[1]), dtype=complex)
    force[:, blades.load] = model.loads(harmonics)
    free = port_motion(blades, modal_amplitudes(blades, flexible, force), force, blades.contact)
    _add_damper(model, orders, G)
    B, g, rigid = model.once("rigid motions", lambda: rigid_motions(model, springs))
    first = 1 if B.shape[1] else 0
    fixed = low_rank(model, harmonics)
    if fixed is None:
        A, stuck = _add_contact_springs(G, free, springs, first)
    else:
        A = low_rank_update(fixed, orders, first)
        stuck = free - (A @ (springs * free)[:, :, None])[:, :, 0]
    if B.shape[1]:
        A[0], stuck[0] = model.once(
            "mean with springs",
            lambda: with_springs(G[0].real, free[0].real, springs, B, g),
        )
    # w_0 = 0
    if not model.coupled:
        G[0] = 0.0
        free[0] = 0.0
        A[0] = 0.0
        stuck[0] = 0.0
        B = B[:, :0]
        g = g[:0]
        rigid = rigid[:, :0]
    return Linear(omega, springs, G, free, A, stuck, B, g, rigid)


def _add_damper(
    model: ReducedModel,
    orders: np.ndarray,
    G: np.ndarray,
) -> None:
    if isinstance(model.damper, RigidBody):
        B = model.damper.B[model.rows]
        G[1:] -= (B @ np.linalg.solve(model.damper.mass, B.T)) / orders[1:, None, None] ** 2
    elif (damper := model.elastic_damper(len(orders) - 1)) is not None:
        G += receptance_block(
            damper, modal_flexibility(damper, orders), damper.contact, damper.contact
        )


def _add_contact_springs(
    G: np.ndarray,
    free: np.ndarray,
    springs: np.ndarray,
    first: int,
) -> tuple[np.ndarray, np.ndarray]:
    """(1 + G K)^-1 times G and times free, from harmonic `first` on."""
    m = len(springs)
    if m < BATCHED_SOLVE_DOFS:
        system = G[first:] * springs + np.eye(m)
        solved = np.zeros((len(G), m, m + 1), dtype=complex)
        solved[first:] = np.linalg.solve(
            system, np.concatenate([G[first:], free[first:, :, None]], axis=2)
        )
        return solved[:, :, :m].copy(), solved[:, :, m].copy()
    A = np.empty_like(G)
    stuck = np.empty_like(free)
    # in Fortran order, which spares LAPACK two copies
    for h in range(first, len(G)):
        right = np.empty((m, m + 1), dtype=complex, order="F")
        right[:, :m], right[:, m] = G[h], free[h]
        system = np.multiply(G[h], springs, order="F")
        system[np.diag_indices(m)] += 1.0
        _, _, solved, info = lapack.zgesv(system, right, overwrite_a=True, overwrite_b=True)
        if info:
            raise NotSolvedError(
                "contact flexibility is singular: a resonance without damping is hit exactly"
            )
        A[h], stuck[h] = solved[:, :m], solved[:, m]
    return A, stuck


def rigid_motions(
    model: ReducedModel, springs: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """B (m, r), g (r,) and rigid (r0, r) of `Linear`, which do not depend on the frequency."""
    if model.damper is None and model.side(0).omega.min(initial=1.0) > 0:
        return np.zeros((len(springs), 0)), np.zeros(0), np.zeros((0, 0))
    blades = model.blades(0)
    still = blades.omega[0] == 0
    motions = [blades.shapes[0, blades.contact][:, still].real]
    loads = blades.shapes[0, blades.load][:, still].real.T @ model.loads(0)[0].real
    if isinstance(model.damper, RigidBody):
        motions.append(-model.damper.B[model.rows])
    elif (damper := model.elastic_damper(0)) is not None:
        loose = damper.omega[0] == 0
        motions.append(-damper.shapes[0, damper.contact][:, loose].real)
    B = np.column_stack(motions)
    if B.shape[1] == 0:
        return B, np.zeros(0), np.zeros((0, 0))
    loads = np.concatenate([loads, np.zeros(B.shape[1] - len(loads))])
    held = B.T @ (springs[:, None] * B)
    # metres and radians alike
    size = np.sqrt(np.where(np.diag(held) > 0, np.diag(held), 1.0))
    values, vectors = np.linalg.eigh(held / np.outer(size, size))
    kept = values > UNRESISTED_SHARE
    rigid = vectors[:, kept] / np.sqrt(values[kept]) / size[:, None]
    return B @ rigid, rigid.T @ loads, rigid


def with_springs(
    G: np.ndarray,
    free: np.ndarray,
    springs: np.ndarray,
    B: np.ndarray,
    g: np.ndarray,
    regularisation: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Flexibility and displacement of harmonic 0 with contact springs, motions without stiffness
    eliminated.
    """
    m, r = B.shape
    regularisation = REGULARISATION if regularisation is None else regularisation
    system = np.block([[np.eye(m) + G * springs, -B], [B.T * springs, regularisation * np.eye(r)]])
    solved = np.linalg.solve(system, np.block([[G, free[:, None]], [B.T, g[:, None]]]))
    return solved[:m, :m], solved[:m, m]

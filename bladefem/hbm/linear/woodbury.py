"""Contact flexibility with its springs for any frequency, from what does not depend on the
frequency.

With G = R + L D L^H, where R are the residual flexibilities, L the modes of both bodies at the
contact and D their inverse modal impedances, the flexibility with springs K is

    (1 + G K)^-1 G = A + U T U^H,    A = (1 + R K)^-1 R,    U = (1 + R K)^-1 L,    T = (1 + D N)^-1
    D,    N = L^H K U

(Sherman, Morrison and Woodbury). Only T, as large as the number of modes, changes with the
frequency: a point costs m^2 k operations for m contact degrees of freedom and k modes, where
solving anew costs m^3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np

from ...data import RigidBody
from ...errors import NotSolvedError
from ..model import ReducedModel
from ..policy import uses_low_rank
from .bodies import Stack, modal_flexibility, rigid_stack


@dataclass(frozen=True)
class LowRank:
    """What stays, for each harmonic (S = H+1) or for all of them (S = 1); m contact degrees of
    freedom, k modes.
    """

    bodies: tuple[Stack, ...]
    # (S, m, m)
    A: np.ndarray
    # (S, m, k)
    U: np.ndarray
    # (S, k, m) its conjugate transpose
    UH: np.ndarray
    # (S, k, k)
    N: np.ndarray


def low_rank(model: ReducedModel, harmonics: int) -> LowRank | None:
    """The parts that stay; None where modes are coupled by damping or too many."""
    bodies = bodies_of(model, harmonics)
    m = model.springs.size
    k = sum(body.omega.shape[1] for body in bodies)
    if any(body.coupled is not None for body in bodies) or not uses_low_rank(m, k):
        return None
    return model.once(
        ("low rank", harmonics), lambda: _constant_parts(bodies, model.springs.ravel())
    )


def low_rank_update(
    fixed: LowRank,
    orders: np.ndarray,
    first: int,
) -> np.ndarray:
    """(H+1, m, m) flexibility with springs at the circular frequencies `orders`, from harmonic
    `first` on.

    Raises:
        NotSolvedError: a resonance without damping is hit exactly.
    """
    D = np.concatenate([modal_flexibility(body, orders) for body in fixed.bodies], axis=1)[first:]
    N, U, UH, A = (
        part[first:] if len(part) > 1 else part for part in (fixed.N, fixed.U, fixed.UH, fixed.A)
    )
    k = D.shape[1]
    try:
        T = np.linalg.solve(np.eye(k) + D[:, :, None] * N, D[:, :, None] * np.eye(k))
    except np.linalg.LinAlgError:
        raise NotSolvedError(
            "contact flexibility is singular: a resonance without damping is hit exactly"
        ) from None
    found = np.zeros((len(orders), *A.shape[1:]), dtype=complex)
    np.matmul(U @ T, UH, out=found[first:])
    found[first:] += A
    return found


def bodies_of(model: ReducedModel, harmonics: int) -> tuple[Stack, ...]:
    """Blades, and the damper where there is one, in the nodal diameters of harmonics 0..H."""
    blades = model.blades(harmonics)
    if isinstance(model.damper, RigidBody):
        body = model.damper
        return blades, model.once("rigid stack", lambda: rigid_stack(body.mass, body.B[model.rows]))
    damper = model.elastic_damper(harmonics)
    return (blades,) if damper is None else (blades, damper)


def _constant_parts(bodies: tuple[Stack, ...], springs: np.ndarray) -> LowRank:
    size = max(len(body.shapes) for body in bodies)
    R = reduce(np.add, [body.residual[:, body.contact, body.contact] for body in bodies])
    L = np.concatenate(
        [
            np.broadcast_to(
                body.shapes[:, body.contact], (size, *body.shapes[:, body.contact].shape[1:])
            )
            for body in bodies
        ],
        axis=2,
    )
    return LowRank(bodies, *frequency_independent_parts(R, L, springs))


def frequency_independent_parts(
    R: np.ndarray,
    L: np.ndarray,
    springs: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """A (S, m, m), U (S, m, k), its conjugate transpose and N (S, k, k) from R (S or 1, m, m) and L
    (S, m, k).
    """
    R = np.broadcast_to(R, (len(L), *R.shape[1:]))
    m = len(springs)
    solved = np.linalg.solve(R * springs + np.eye(m), np.concatenate([R, L], axis=2))
    A = np.ascontiguousarray(solved[:, :, :m])
    U = np.ascontiguousarray(solved[:, :, m:]).astype(complex)
    return A, U, U.conj().swapaxes(1, 2).copy(), L.conj().swapaxes(1, 2) @ (springs[:, None] * U)

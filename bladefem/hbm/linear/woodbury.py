"""Contact flexibility with its springs for any frequency, from what does not depend on the
frequency.

With G = R + L D L^H, where R are the residual flexibilities, L the modes of both bodies at the
contact and D their inverse modal impedances, the flexibility with springs K is

    (1 + G K)^-1 G = A + U T U^H,    A = (1 + R K)^-1 R,    U = (1 + R K)^-1 L,
    T = (1 + D N)^-1 D,              N = L^H K U

(Sherman, Morrison and Woodbury). Only T, as large as the number of modes, changes with the
frequency: a point costs m^2 k operations for m contact degrees of freedom and k modes, where
solving anew costs m^3.
"""

from __future__ import annotations

import numpy as np

from ...data import RigidBody
from ..model import ReducedModel
from .bodies import Stack, rigid_stack


def bodies_of(model: ReducedModel, harmonics: int) -> tuple[Stack, ...]:
    """Blades, and the damper where there is one, in the nodal diameters of harmonics 0..H."""
    blades = model.blades(harmonics)
    if isinstance(model.damper, RigidBody):
        body = model.damper
        return blades, model.once("rigid stack", lambda: rigid_stack(body, model.rows))
    damper = model.elastic_damper(harmonics)
    return (blades,) if damper is None else (blades, damper)


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

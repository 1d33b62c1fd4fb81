"""Harmonic 0: motions without stiffness, which nothing but friction and the holding springs
resists, and the flexibility with them eliminated.
"""

from __future__ import annotations

import numpy as np

from ...data import RigidBody
from ..model import ReducedModel

# motions that the contact springs resist less than this, relatively, are left out
UNRESISTED_SHARE = 1e-12
# Springs on the mean of the motions without stiffness, over the contact stiffness. Where every
# contact on such a motion slips its mean position has no influence, and these springs choose one;
# no accepted point leaves them a load (`bladefem.hbm.solver.walking`).
REGULARISATION = 5e-8


def motions_without_stiffness(
    model: ReducedModel,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """B (m, r), g (r,) and rigid (r0, r) of `Linear`, which do not depend on the frequency; none
    where the mean displacements have no part in the balance.
    """
    B, g, rigid = model.once("rigid motions", lambda: _unheld_motions(model))
    return (B, g, rigid) if model.coupled else (B[:, :0], g[:0], rigid[:, :0])


def _unheld_motions(model: ReducedModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    springs = model.springs.ravel()
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

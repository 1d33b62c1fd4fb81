"""What vibration leaves undetermined: the static friction force of stuck nodes."""

from __future__ import annotations

import numpy as np

from bladefem.data import Elements
from bladefem.friction.fourier import harmonics_of, synthesis
from bladefem.friction.law_table import groups_by_law

# instants of a period at which the vibration is looked at
SAMPLES = 512


def free_static_force(elements: Elements, w: np.ndarray) -> np.ndarray:
    """(n,) size up to which any static friction force is in equilibrium with the vibration w [N]; 0
    where it slips, and nan for laws other than Coulomb's.

    A stuck node may carry any mean force within [-r, r], r = min over the period of
    mu N - k_t |w_t - its mean| (mu N - k_t A where N is constant): its history decides, which
    vibration does not determine. Sampled.
    """
    T = synthesis(harmonics_of(w), SAMPLES)
    load = np.asarray(elements.n0)[:, None] + np.asarray(elements.kn)[:, None] * (w[:, 0] @ T.T)
    swing = (w[:, 1:, 1:] @ T[:, 1:].T) * np.asarray(elements.kt)[:, None, None]
    limit = np.asarray(elements.mu)[:, None] * np.maximum(load, 0.0)
    force = np.clip((limit - np.linalg.norm(swing, axis=1)).min(axis=1), 0.0, None)
    for law, rows in groups_by_law(elements):
        if law is not None:
            force[rows] = np.nan
    return force

"""Energy and wear: dissipated energy, its map over a patch, slip distance, Archard's wear work; free static force."""

from __future__ import annotations

import numpy as np

from bladefem.data import Elements, Patch
from bladefem.errors import InputError
from bladefem.friction.aft import Forces
from bladefem.friction.harmonics import harmonics_of, synthesis

__all__ = ["energy_density", "free_static_force", "slip_distance", "wear_depth"]


def energy_density(forces: Forces, patch: Patch) -> np.ndarray:
    """(n,) dissipated energy a cycle and area [J/m^2]: the wear-work map of a patch."""
    if patch.area.shape != forces.dissipated.shape:
        raise InputError(f"patch: {patch.area.size} nodes do not fit {forces.dissipated.size} elements")
    return forces.dissipated / patch.area


def wear_depth(forces: Forces, patch: Patch, coefficient: float, cycles: float) -> np.ndarray:
    """(n,) worn depth [m] after ``cycles`` cycles, coefficient [m^3/J] times energy an area (Archard)."""
    return coefficient * cycles * energy_density(forces, patch)


def slip_distance(elements: Elements, w: np.ndarray, forces: Forces, samples: int = 512) -> np.ndarray:
    """(n,) length of the slider's path in one cycle [m], from f and w of all harmonics at ``samples`` instants.

    The force of H harmonics has ripples, which the slider w - f/kt follows: a figure for maps, exact as H grows.
    Nodes that never slip give 0.
    """
    T = synthesis(harmonics_of(w), samples)
    slider = (w[:, 1:] - forces.f[:, 1:] / np.asarray(elements.kt)[:, None, None]) @ T.T
    path = np.linalg.norm(np.diff(slider, axis=-1, append=slider[..., :1]), axis=1).sum(-1)
    return np.where(forces.shares[:, 1] > 0, path, 0.0)


def free_static_force(elements: Elements, w: np.ndarray, samples: int = 512) -> np.ndarray:
    """(n,) size up to which any static friction force is in equilibrium with the vibration w [N]; 0 where it slips.

    A stuck node may carry any mean force within [-r, r], r = min over the period of mu N - k_t |w_t - its mean|
    (mu N - k_t A where N is constant): its history decides, and vibration does not tell. Sampled.
    """
    T = synthesis(harmonics_of(w), samples)
    load = np.asarray(elements.n0)[:, None] + np.asarray(elements.kn)[:, None] * (w[:, 0] @ T.T)
    swing = (w[:, 1:, 1:] @ T[:, 1:].T) * np.asarray(elements.kt)[:, None, None]
    limit = np.asarray(elements.mu)[:, None] * np.maximum(load, 0.0)
    return np.clip((limit - np.linalg.norm(swing, axis=1)).min(axis=1), 0.0, None)

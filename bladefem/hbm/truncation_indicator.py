"""What do the harmonics that a solution leaves out move? A cheap look at many points, before a
richer model is asked.

The contact forces of the solution, stepped through two periods, have harmonics above those that
were balanced; what motion they raise in the bodies follows from the modes without contact, which
are the right ones where contacts slip. Over the first harmonic it shows where a higher one meets a
mode: an internal resonance, a few points wide. It is no error estimate: on frequency responses of
beams the true error was 0.1 to 15 times as large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np

from ..errors import InputError
from ..friction.fourier import synthesis, to_complex
from ..friction.time_step import second_period
from .linear.bodies import Stack, modal_flexibility
from .linear.woodbury import bodies_of
from .model import ReducedModel
from .policy import uses_coulomb_kernels
from .solution import Solution
from .solver.residual import contact_forces

# for each harmonic
INSTANTS_PER_HARMONIC = 4
# of a frequency: how far next to it bodies are looked at, which without damping may be hit exactly
OFF_RESONANCE = 1e-7


def truncation_indicator(
    model: ReducedModel,
    points: Sequence[Solution],
    most: int,
) -> np.ndarray:
    """(p,) motion of the contacts with harmonics above the solutions' own up to `most`, over that
    of the first one.

    Args:
        points: of this model, with the same harmonics, fewer than `most`.

    Raises:
        InputError: points of different harmonics.
    """
    H = points[0].harmonics
    if any(p.harmonics != H for p in points) or most <= H:
        raise InputError(
            f"points: harmonics {sorted({p.harmonics for p in points})}, expected the same ones in "
            f"all points, below {most}"
        )
    w = np.array([p.w for p in points])
    forces = _higher_force_harmonics(model, w, most)
    orders = np.arange(H + 1, most + 1)
    omegas = (1 + OFF_RESONANCE) * np.array([p.omega for p in points])
    motions = [_higher_motion(body, orders, omegas, forces) for body in bodies_of(model, most)]
    motion = reduce(np.add, motions)
    first = np.sum(w[..., 1:3] ** 2, axis=(1, 2, 3))
    return np.sqrt(np.sum(abs(motion) ** 2, axis=(0, 2)) / np.maximum(first, np.finfo(float).tiny))


def _higher_force_harmonics(
    model: ReducedModel,
    w: np.ndarray,
    most: int,
) -> np.ndarray:
    """(most - H, p, m) complex harmonics H+1.. of the contact forces at displacements w (p, n, d,
    2H+1) [N].
    """
    if not uses_coulomb_kernels(model):
        return _harmonics_by_law(model, w, most)
    p, n, d, K = w.shape
    S = INSTANTS_PER_HARMONIC * (most + 1)
    motion = (w.reshape(-1, K) @ synthesis(K // 2, S).T).reshape(p, n, d, S)
    forces = _sampled_forces(model, motion)
    high = (2 / S * synthesis(most, S)[:, K:]).T @ forces.reshape(-1, S).T
    return (high[::2] - 1j * high[1::2]).reshape(most - K // 2, p, n * d)


def _sampled_forces(model: ReducedModel, motion: np.ndarray) -> np.ndarray:
    """Contact forces (p, n, d, S) [N] of Coulomb's law at S instants, from the motions there [m];
    the normal force comes first where the normal load follows the motion.
    """
    e = model.elements
    p, n, d, S = motion.shape
    tangents = e.tangents
    given = model.normal_series(S) if model.normal else e.n0[:, None]
    normal = np.array(np.broadcast_to(given, (p, n, S)))
    if d > tangents:
        normal += e.kn[:, None] * motion[:, :, 0]
    offset = model.offset.reshape(n, d)[:, d - tangents :, None]
    stuck = e.kt[:, None, None] * (motion[:, :, d - tangents :] + offset)
    friction = np.empty((p * n, tangents, S))
    second_period(
        stuck.reshape(p * n, tangents, S),
        normal.reshape(p * n, S),
        np.tile(e.mu, p),
        friction,
    )
    friction = friction.reshape(p, n, tangents, S)
    if d == tangents:
        return friction
    return np.concatenate([np.maximum(normal, 0.0)[:, :, None], friction], axis=2)


def _harmonics_by_law(
    model: ReducedModel,
    w: np.ndarray,
    most: int,
) -> np.ndarray:
    """Harmonics of the forces by any law, from its periodic state."""
    p, n, d, K = w.shape
    wide = np.zeros((p, n, d, 2 * most + 1))
    wide[..., :K] = w
    forces = [contact_forces(model, one, INSTANTS_PER_HARMONIC * (most + 1)).f for one in wide]
    high = to_complex(np.array(forces))[..., K // 2 + 1 :]
    return np.moveaxis(high, 3, 0).reshape(most - K // 2, p, n * d)


def _higher_motion(
    body: Stack,
    orders: np.ndarray,
    omegas: np.ndarray,
    forces: np.ndarray,
) -> np.ndarray:
    """(k, p, m) displacements of a body under contact forces (k, p, m) of the harmonics (k,), at
    (p,) [rad/s] [m].
    """
    k, p, _ = forces.shape
    rows = np.minimum(orders, len(body.omega) - 1)
    shapes, residual = (
        part[np.minimum(orders, len(part) - 1)]
        for part in (body.shapes[:, body.contact], body.residual[:, body.contact, body.contact])
    )
    names = ("omega", "viscous", "hysteretic", "coupled", "circulatory")
    each: dict[str, Any] = {
        name: np.repeat(part[rows], p, axis=0)
        for name in names
        if (part := getattr(body, name)) is not None
    }
    flexible = modal_flexibility(replace(body, **each), np.outer(orders, omegas).ravel())
    push = forces @ shapes.conj()
    if flexible.ndim == 2:
        modal = flexible.reshape(k, p, -1) * push
    else:
        modal = (flexible @ push.reshape(k * p, -1, 1)).reshape(k, p, -1)
    return modal @ shapes.swapaxes(1, 2) + forces @ residual.swapaxes(1, 2)

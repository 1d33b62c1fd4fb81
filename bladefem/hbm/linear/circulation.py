"""Unsymmetric stiffness: forces of the displacements that have no energy, as seals, bearings and
the gas flow exert them.

The modes are those of the symmetric part; the rest S couples them as damping may. At one frequency
a force S q is that of a viscous matrix S / (j h omega), so that all that is written for coupled
damping applies, the work included; only the mean needs equations of its own.
"""

from __future__ import annotations

import numpy as np

from ..model import ReducedModel
from .mean_motion import with_springs
from .packed_bodies import Bodies, joined_blocks
from .woodbury import bodies_of


def with_circulation(bodies: Bodies, model: ReducedModel, omega: float, H: int) -> Bodies:
    """The bodies of harmonics 0..H at circular frequency omega, S among what couples their modes,
    and the mean with it.
    """
    S, mean = model.once(("circulation", H), lambda: _circulatory_parts(bodies, model, H))
    orders = np.arange(1, H + 1)[:, None, None]
    coupled = np.zeros((H + 1, *S.shape[1:]), dtype=complex)
    if len(bodies.coupled):
        coupled += bodies.coupled
    coupled[1:] += (S[1:] if len(S) > 1 else S) / (1j * orders * omega)
    A, stuck, G = mean if model.coupled else (bodies.mean_A, bodies.mean_stuck, bodies.mean_G)
    return bodies._replace(coupled=coupled, mean_A=A, mean_stuck=stuck, mean_G=G)


def mean_modal_flexibility(own: np.ndarray, S: np.ndarray) -> np.ndarray:
    """(M, M) modal displacements by static modal forces, rigid modes left out, from frequencies
    (M,) and S (M, M).
    """
    elastic = np.flatnonzero(own > 0)
    flexible = np.zeros(S.shape, dtype=complex)
    block = np.ix_(elastic, elastic)
    flexible[block] = np.linalg.inv(np.diag(own[elastic] ** 2) + S[block])
    return flexible


def joined_circulation(model: ReducedModel, H: int) -> np.ndarray:
    """(1 or H+1, M, M) S of all bodies, the damper's modes after the blades' [1/s^2]."""
    stacks = bodies_of(model, H)
    return joined_blocks(stacks, [stack.circulatory for stack in stacks])


def _circulatory_parts(
    bodies: Bodies, model: ReducedModel, H: int
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """S of all bodies, and A (m, m), stuck (m,) and G (m, m) of the mean."""
    S = joined_circulation(model, H)
    flexible = mean_modal_flexibility(bodies.own[0], S[0])
    shapes = bodies.contact[0]
    # the packed bodies have none where all harmonics share a basis
    residual = sum(stack.residual[0, stack.contact, stack.contact] for stack in bodies_of(model, H))
    G = (residual + shapes @ flexible @ shapes.conj().T).real
    free = (bodies.direct[0] + shapes @ (flexible @ bodies.push[0])).real
    A, stuck = with_springs(G, free, model.springs.ravel(), bodies.B, bodies.g)
    mean = np.ascontiguousarray(A), stuck.astype(complex), np.ascontiguousarray(G)
    return S, mean

"""How the response depends on the static friction forces of the nodes that never slip: their
admissible range, and the derivative of the response by them.

A node that sticks throughout the period carries f(t) = q + u(t), u = kt (w(t) - mean w). Its mean q
is not determined by the vibration but by the loading history; every q of the convex set

    |q + u(t)| <= mu N(t)  for all t

is admissible. It acts on the response through the mean displacements, which change the normal loads
of the nodes that slip.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..friction.fourier import synthesis
from ..friction.law import require_coulomb
from .linear.condensation import condense
from .model import ReducedModel
from .node_gradients import size_by_force, transposed_flexibility
from .solution import Solution
from .solver.residual import Balance, adjoint, evaluate_balance

__all__ = ["Tractions", "farthest", "tractions"]

# instants of a period at which the friction limit is looked at, for each harmonic
INSTANTS = 64
# directions of the polygon round an admissible set of two tangents: 1.2e-3 too wide at most
DIRECTIONS = 64


@dataclass(frozen=True)
class Tractions:
    """The undetermined friction forces of a solved point; m nodes never slip or open."""

    # (m,) their numbers
    nodes: np.ndarray
    # (m, tangents) force at zero displacement: what the model's `start` has to be to stay here [N]
    start: np.ndarray
    # (m, tangents) mean friction force q [N]
    mean: np.ndarray
    # (m, tangents) derivative of the response's size at the probe by the start [m/N]
    gradient: np.ndarray
    # (directions, tangents) unit vectors: normals of the edges of the admissible polygons
    normals: np.ndarray
    # (m, directions) bounds of q along the normals [N]
    bounds: np.ndarray


def tractions(model: ReducedModel, solution: Solution, probe: int = 0) -> Tractions:
    """Admissible friction forces and the derivative of the response by them, from one adjoint
    solve.
    """
    require_coulomb(model.elements, "the range of static friction forces")
    balance = Balance(model, condense(model, solution.omega, solution.harmonics), solution.samples)
    state = evaluate_balance(balance, solution.w)
    shares = state.forces.shares
    nodes = np.flatnonzero((shares[:, 1] == 0) & (shares[:, 2] < 1e-12))
    first = model.directions - model.elements.tangents
    kt = model.elements.kt[nodes, None]
    mean = state.forces.f[nodes, first:, 0]
    normals = _normals(model.elements.tangents)
    return Tractions(
        nodes,
        mean - kt * state.w[nodes, first:, 0],
        mean,
        _gradient(balance, state, solution, nodes, probe),
        normals,
        _bounds(model, state.w, nodes, normals),
    )


def farthest(found: Tractions, direction: np.ndarray) -> np.ndarray:
    """(m, tangents) admissible mean forces that are farthest along a direction (m, tangents) of
    each node [N]; nodes without direction keep theirs.

    The largest  d . q  with  normals q <= bounds  is, by duality, the least sum of bounds over the
    pairs of edges whose normals enclose d, and q is where these two edges meet.
    """
    normals = found.normals
    if normals.shape[1] == 1:
        reached = np.where(direction > 0, found.bounds[:, :1], -found.bounds[:, 1:])
        return np.where(direction == 0, found.mean, reached)
    i, j = np.triu_indices(len(normals), 1)
    cross = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
    apart = abs(cross) > 1e-9
    i, j, cross = i[apart], j[apart], cross[apart]
    reached = found.mean.copy()
    for node in np.flatnonzero(np.any(direction != 0, axis=1)):
        d = direction[node]
        by_i = (d[0] * normals[j, 1] - d[1] * normals[j, 0]) / cross
        by_j = (normals[i, 0] * d[1] - normals[i, 1] * d[0]) / cross
        b = found.bounds[node]
        value = np.where((by_i >= 0) & (by_j >= 0), by_i * b[i] + by_j * b[j], np.inf)
        best = int(np.argmin(value))
        corner = np.array([normals[i[best]], normals[j[best]]])
        reached[node] = np.linalg.solve(corner, [b[i[best]], b[j[best]]])
    return reached


def _normals(tangents: int) -> np.ndarray:
    if tangents == 1:
        return np.array([[1.0], [-1.0]])
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _bounds(
    model: ReducedModel, w: np.ndarray, nodes: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """(m, directions) least of mu N(t) - normal . u(t) over the period [N]."""
    elements = model.elements
    H = w.shape[2] // 2
    instants = INSTANTS * H
    first = model.directions - elements.tangents
    moving = w[nodes].copy()
    moving[:, first:, 0] = 0.0
    moved = moving @ synthesis(H, instants).T
    load = np.broadcast_to(elements.n0[nodes, None], (len(nodes), instants)).copy()
    if model.normal:
        load = model.normal_series(instants)[nodes]
    if first:
        load += elements.kn[nodes, None] * moved[:, 0]
    limit = elements.mu[nodes, None] * np.maximum(load, 0.0)
    force = elements.kt[nodes, None, None] * moved[:, first:]
    return np.array([(limit - np.einsum("mds,d->ms", force, d)).min(axis=1) for d in normals]).T


def _gradient(
    balance: Balance, state: object, solution: Solution, nodes: np.ndarray, probe: int
) -> np.ndarray:
    """(m, tangents) derivative by the start, with these nodes held in stick: their forces follow
    their springs, whatever the march says of a node that just reaches its limit.
    """
    model = balance.model
    n, d, K = state.w.shape
    first = d - model.elements.tangents
    dfdw = state.forces.dfdw.copy()
    dfdw[nodes] = 0.0
    for a in range(d):
        for k in range(K):
            dfdw[nodes, a, k, a, k] = model.springs[nodes, a]
    state = replace(state, forces=replace(state.forces, dfdw=dfdw))
    by_force = size_by_force(model, solution, probe)
    by_motion = dfdw.reshape(n, d * K, d * K).swapaxes(1, 2) @ by_force.reshape(n, d * K, 1)
    back = adjoint(balance, state)(by_motion.reshape(n, d, K), 1e-9)
    weight = by_force - transposed_flexibility(balance.linear.A, back)
    return weight[nodes, first:, 0]

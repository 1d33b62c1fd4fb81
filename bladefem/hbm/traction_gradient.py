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
from scipy.optimize import linprog

from ..errors import NotSolvedError
from ..friction.fourier import synthesis
from ..friction.law_table import require_coulomb
from ..util.arrays import IntegerArray, RealArray
from .linear.condensation import condense
from .linear.contact_flexibility import flexibility_product, transposed_flexibility
from .linear.mean_motion import with_springs
from .model import ReducedModel
from .node_gradients import size_by_force
from .solution import Solution
from .solver.residual import (
    Balance,
    State,
    adjoint_inverse,
    solved_balance,
    transposed_force_change,
)

# instants of a period at which the friction limit is looked at, for each harmonic
INSTANTS_PER_HARMONIC = 64
# directions of the polygon round an admissible set of two tangents: 3.5 % too wide at most; what
# lies outside is returned by the march
POLYGON_DIRECTIONS = 12
# largest change of a force, over the largest friction limit
MAX_FORCE_CHANGE = 20.0


@dataclass(frozen=True)
class Tractions:
    """The friction forces of a solved point, those of m of its n nodes undetermined."""

    # (m,) numbers of the nodes that never slip or open
    nodes: IntegerArray
    # (n, tangents) mean force at zero displacement: a model of this `start` stays here [N]
    start: RealArray
    # (n, tangents) derivative of the response's size at the probe by the start, as if only these
    # m nodes and the node itself stuck [m/N]
    gradient: RealArray
    # (directions, tangents) unit vectors: normals of the edges of the admissible polygons
    normals: RealArray
    # (m, directions) how far the mean force may move along the normals [N]
    room: RealArray


def admissible_tractions(
    model: ReducedModel,
    solution: Solution,
    probe: int = 0,
) -> Tractions:
    """Admissible friction forces and the derivative of the response by them, from one adjoint
    solve.
    """
    require_coulomb(model.elements, "the range of static friction forces")
    balance, state = solved_balance(model, solution)
    shares = state.forces.shares
    nodes = np.flatnonzero((shares[:, 1] == 0) & (shares[:, 2] < 1e-12))
    first = model.directions - model.elements.tangents
    mean = state.forces.f[:, first:, 0]
    normals = _normals(model.elements.tangents)
    return Tractions(
        nodes,
        mean - model.elements.kt[:, None] * state.w[:, first:, 0],
        _gradient(balance, state, solution, nodes, probe),
        normals,
        np.maximum(_bounds(model, state.w, nodes, normals) - mean[nodes] @ normals.T, 0.0),
    )


def farthest_start(
    model: ReducedModel,
    found: Tractions,
    direction: np.ndarray,
) -> np.ndarray:
    """(m, tangents) change of the start that goes farthest along a direction (m, tangents) and
    stays admissible for an unchanged vibration [N].

    The mean displacements follow the change, and the normal loads with them: a linear programme in
    the changes of all nodes, with a polygon for the circle of two tangents. No force grows beyond
    a multiple of the largest friction limit, which bounds seats that jam.
    """
    size = float(np.abs(direction).max(initial=0.0))
    if size == 0.0:
        return np.zeros_like(direction)
    by_mean, by_limit = _mean_change(model, found.nodes)
    m, tangents = direction.shape
    along = np.einsum("dt,mtj->mdj", found.normals, by_mean.reshape(m, tangents, -1))
    rows = along - by_limit[:, None, :]
    elements = model.elements
    scale = float((elements.mu * np.maximum(elements.n0, 0.0)).max())
    solved = linprog(
        -direction.ravel() / size,
        rows.reshape(m * len(found.normals), -1),
        found.room.ravel() / scale,
        bounds=(-MAX_FORCE_CHANGE, MAX_FORCE_CHANGE),
        method="highs",
    )
    if solved.x is None:
        raise NotSolvedError(f"admissible friction forces were not found: {solved.message}")
    return scale * solved.x.reshape(m, tangents)


def _mean_change(model: ReducedModel, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Changes by the starts of these nodes: (m tangents, m tangents) of their mean friction forces
    and (m, m tangents) of their friction limits [1].

    All other nodes slip: their mean friction forces are taken as constant.
    """
    elements = model.elements
    first = model.directions - elements.tangents
    sticks = np.zeros(len(elements.kt), dtype=bool)
    sticks[nodes] = True
    springs = model.springs.copy()
    springs[:, first:] *= sticks[:, None]
    if first:
        springs[:, 0] *= elements.n0 > 0
    # the frequency has no part in the mean
    linear = condense(model, 1.0, 1)
    flexible, _ = with_springs(
        linear.bodies.mean_G,
        np.zeros(springs.size),
        springs.ravel(),
        linear.B,
        np.zeros(linear.B.shape[1]),
    )
    flexible = flexible.reshape(*springs.shape, *springs.shape)[nodes][:, :, nodes][..., first:]
    count = len(nodes) * elements.tangents
    moved = -flexible.reshape(len(nodes), model.directions, count)
    by_mean = elements.kt[nodes, None, None] * moved[:, first:]
    by_limit = np.zeros((len(nodes), count))
    if first:
        by_limit = (elements.mu * elements.kn)[nodes, None] * moved[:, 0]
    return by_mean.reshape(count, count) + np.eye(count), by_limit


def _normals(tangents: int) -> np.ndarray:
    if tangents == 1:
        return np.array([[1.0], [-1.0]])
    angle = 2 * np.pi * np.arange(POLYGON_DIRECTIONS) / POLYGON_DIRECTIONS
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _bounds(
    model: ReducedModel,
    w: np.ndarray,
    nodes: np.ndarray,
    normals: np.ndarray,
) -> np.ndarray:
    """(m, directions) least of mu N(t) - normal . u(t) over the period [N]."""
    elements = model.elements
    H = w.shape[2] // 2
    instants = INSTANTS_PER_HARMONIC * H
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
    balance: Balance,
    state: State,
    solution: Solution,
    nodes: np.ndarray,
    probe: int,
) -> np.ndarray:
    """(n, tangents) derivative by the start, with these nodes held in stick: their forces follow
    their springs, whatever the march says of a node that just reaches its limit.
    """
    model = balance.model
    _, d, K = state.w.shape
    first = d - model.elements.tangents
    dfdw = state.forces.jacobian.copy()
    dfdw[nodes] = 0.0
    for a in range(d):
        for k in range(K):
            dfdw[nodes, a, k, a, k] = model.springs[nodes, a]
    state = replace(state, forces=replace(state.forces, dfdw=dfdw))
    by_force = size_by_force(model, solution, probe)
    by_motion = transposed_force_change(balance, state, by_force)
    back = adjoint_inverse(balance, state)(by_motion, 1e-9)
    turned = transposed_flexibility(balance.linear.condensed.flex)
    weight = by_force - flexibility_product(turned, back)
    return weight[:, first:, 0]

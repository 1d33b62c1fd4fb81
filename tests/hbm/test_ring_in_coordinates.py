"""Rings of blades marched by their modes, against the coordinates of all blades in small explicit
steps: nothing there takes blades to be alike, nodes together, or a step's forces from each other.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from bladefem.data import Elements, RigidBody
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.ring_march import Drive, RingState, march_ring
from bladefem.hbm.sector_modes import sector_modes
from bladefem.reduction.matrices import port_model_from_matrices

# coordinates of a blade and of a damper
SIZE = 4
DAMPER = 2
OMEGA = 1.4
FORCE = 0.25 - 0.1j
# explicit steps between two instants of the march
FINER = 4


@dataclass(frozen=True)
class Ring:
    """A wave on r blades, as the library has it and in the coordinates of blades and dampers."""

    blades: int
    model: ReducedModel
    M: np.ndarray
    K: np.ndarray
    C: np.ndarray
    # (r n d, coordinates) readings at the contacts, (coordinates, r) loads; those of the probes are
    # the same
    contact: np.ndarray
    load: np.ndarray


def ring_of(r, tangents, nodes, kind=""):
    """Blades on springs and to their neighbours; contacts read both sides of a neighbour too.

    Args:
        kind: "unsymmetric": whirl, and forces without energy; "damper": a free one on each blade.
    """
    rng = np.random.default_rng([r, tangents, nodes])
    rows = nodes * (1 + tangents)
    turn = rng.normal(size=(2, SIZE, SIZE))
    turn = (turn - turn.swapaxes(1, 2)) * (kind == "unsymmetric")
    joint = 0.5 * rng.normal(size=(3, 2 * SIZE)) * (r > 1)
    own, next_one = rng.normal(size=(2, rows, SIZE)) / np.sqrt(SIZE)
    K, C = np.zeros((2, r * SIZE, r * SIZE))
    contact = np.zeros((r * rows, r * SIZE))
    springs = np.diag(rng.uniform(1.0, 8.0, SIZE))
    for b in range(r):
        here, there = (np.arange(SIZE) + SIZE * (c % r) for c in (b, b + 1))
        K[np.ix_(here, here)] += springs + 0.05 * turn[0]
        C[np.ix_(here, here)] += 0.2 * turn[1] + 0.04 * np.diag(np.arange(SIZE))
        both = np.concatenate([here, there])
        np.add.at(K, np.ix_(both, both), joint.T @ joint)
        contact[b * rows : (b + 1) * rows, here] += own
        contact[b * rows : (b + 1) * rows, there] += 0.3 * next_one * (r > 1)
    C += 0.02 * (K + K.T)
    elements = Elements(
        rng.uniform(0.5, 1.5, nodes) * 4 / nodes,
        rng.uniform(0.5, 1.5, nodes) * 6 / nodes,
        rng.choice([0.0, 0.3, 0.6], nodes, p=[0.1, 0.5, 0.4]),
        rng.uniform(-0.05, 0.4, nodes) / nodes,
        tangents,
    )
    shape = rng.normal(size=SIZE)

    def body(h):
        phase = np.exp(2j * np.pi * h * np.arange(r) / r)

        def folded(matrix, size):
            parts = matrix[:size].reshape(size, r, SIZE)
            whole = np.einsum("b,sbk->sk", phase, parts)
            return whole.real if 2 * h % r == 0 else whole

        ports = {"contact": folded(contact, rows), "load": shape[None], "probe": shape[None]}
        K_h, C_h = folded(K, SIZE), folded(C, SIZE)
        return port_model_from_matrices(np.eye(SIZE), K_h, ports, C=C_h, unsymmetric=True)

    sides = tuple(body(h) for h in range(r + 1 if r > 1 else 1))
    damper = None
    M = np.eye(len(K))
    if kind == "damper":
        B = rng.normal(size=(rows, DAMPER))
        damper = RigidBody(np.diag([0.3, 0.5]), B)
        contact = np.hstack([contact, -np.kron(np.eye(r), B)])
        more = ((0, r * DAMPER),) * 2
        M, K, C = (np.pad(matrix, more) for matrix in (M, K, C))
        M[r * SIZE :, r * SIZE :] = np.kron(np.eye(r), damper.mass)
    load = np.pad(np.kron(np.eye(r), shape[:, None]), ((0, len(K) - r * SIZE), (0, 0)))
    model = ReducedModel(sides, elements, {1: np.array([FORCE])}, damper=damper)
    return Ring(r, model, M, K, C, contact, load)


def from_steady_motion(ring):
    """The steady motion without contact forces, in which friction forces are other ones on each
    blade.
    """
    r, e = ring.blades, ring.model.elements
    rng = np.random.default_rng(1)
    forces = np.zeros((r * len(e.kt), 3))
    forces[:, 0] = np.tile(np.maximum(e.n0, 0.0), r)
    share = rng.uniform(-0.7, 0.7, (len(forces), e.tangents))
    forces[:, 1 : 1 + e.tangents] = share * (np.tile(e.mu, r) * forces[:, 0])[:, None]
    M = len(sector_modes(ring.model).stiffness)
    return RingState(Drive(OMEGA), np.zeros(2 * M), forces)


def steady_coordinates(ring):
    """Complex amplitudes without contact forces."""
    force = ring.load @ (FORCE * np.exp(2j * np.pi * np.arange(ring.blades) / ring.blades))
    held = np.flatnonzero(ring.K.any(axis=1))
    Z = ring.K - OMEGA**2 * ring.M + 1j * OMEGA * ring.C
    q = np.zeros(len(force), dtype=complex)
    q[held] = np.linalg.solve(Z[np.ix_(held, held)], force[held])
    return q


def marched(ring, start, periods, steps):
    """(periods, steps, r) motion at the probes, by Verlet's steps and plain return maps."""
    r, e = ring.blades, ring.model.elements
    kt, kn, mu, n0 = (np.tile(values, r) for values in (e.kt, e.kn, e.mu, e.n0))
    preload = np.zeros((len(kt), 1 + e.tangents))
    preload[:, 0] = np.maximum(n0, 0.0)
    force = ring.load @ (FORCE * np.exp(2j * np.pi * np.arange(r) / r))
    q = steady_coordinates(ring)
    x, v = q.real, (1j * OMEGA * q).real
    inverse = np.linalg.inv(ring.M)
    dt = 2 * np.pi / OMEGA / steps
    w = (ring.contact @ x).reshape(preload.shape)
    f = start.forces[:, : 1 + e.tangents].copy()

    def rate(k, v):
        push = (force * np.exp(1j * OMEGA * k * dt)).real - ring.contact.T @ (f - preload).ravel()
        return inverse @ (push - ring.C @ v - ring.K @ x)

    motion = np.empty((periods * steps, r))
    a = rate(0, v)
    for k in range(periods * steps):
        motion[k] = ring.load.T @ x
        half = v + dt / 2 * a
        x = x + dt * half
        moved = (ring.contact @ x).reshape(w.shape)
        f[:, 0] = np.maximum(n0 + kn * moved[:, 0], 0.0)
        f[:, 1:] += kt[:, None] * (moved - w)[:, 1:]
        limit = mu * f[:, 0]
        size = np.maximum(np.linalg.norm(f[:, 1:], axis=1), 1e-300)
        f[:, 1:] *= np.minimum(1.0, limit / size)[:, None]
        w = moved
        a = rate(k + 1, half + dt / 2 * a)
        v = half + dt / 2 * a
    return motion.reshape(periods, steps, r)


@pytest.mark.parametrize(
    ("r", "tangents", "nodes", "kind"),
    [
        (1, 1, 9, ""),
        (2, 1, 3, "damper"),
        (3, 1, 5, "unsymmetric"),
        (3, 2, 11, "damper"),
        (4, 2, 1, "unsymmetric"),
        (6, 1, 2, "damper"),
    ],
)
def test_a_march_by_modes_is_that_of_the_coordinates(r, tangents, nodes, kind):
    ring = ring_of(r, tangents, nodes, kind)
    start = from_steady_motion(ring)
    # what kinks inside its steps leave falls with their length: 5e-3 with 384, 1.3e-3 with 1536
    found = march_ring(ring.model, start, 3, 768)
    assert found.settled and found.motion.shape[1] == r
    steps = found.motion.shape[2]
    plain = marched(ring, start, 3, FINER * steps)[:, ::FINER].swapaxes(1, 2)
    largest = abs(plain).max()
    np.testing.assert_allclose(found.motion, plain, atol=4e-3 * largest)
    # the contacts move the blades, each its own way
    assert np.ptp(plain[:, :, 0], axis=0).max() > 0.05 * largest
    if r > 1:
        ahead = np.roll(plain[2, 0], -steps // r)
        assert abs(plain[2, 1] - ahead).max() > 5e-3 * largest

"""Small wheels of plain matrices that the tests share: as sectors by nodal diameters, and as one
dense ring."""

from dataclasses import replace

import numpy as np

from bladefem.data import Elements, RigidBody
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.reduction.assemble import join_bodies
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.wheel.model import engine_order, tuned_wheel

N, EO = 6, 2
# blade along, blade across, disc
OWN = np.array([[6.0, 0.4, -2.0], [0.4, 8.0, -1.0], [-2.0, -1.0, 9.0]])
# of a sector with the next one
LINK = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.3], [0.0, 0.0, -1.5]])
MASS = np.diag([1.0, 1.0, 2.0])
# rows of this sector's damper, then of the one before
FACES = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.7, -0.5, 0.1], [0.5, 0.7, 0.0]])
LOAD = np.array([[0.3, 1.0, 0.0]])
PROBE = np.array([[0.0, 1.0, 0.0]])
# the readings that deviate: both directions of the blade
BLADE = np.eye(3)[:2]
RIGID = RigidBody(np.diag([0.3, 0.4]), np.array([[0.9, 0.1], [-0.2, 0.8], [0.7, -0.3], [0.2, 0.9]]))
# gyroscopic forces of a damper's two motions
SKEW = np.array([[0.0, -0.25], [0.25, 0.0]])
TURNING = replace(RIGID, gyroscopic=SKEW)
DAMPING = Damping(ratio=0.02)
PORTS = {"contact": FACES, "blade": BLADE, "load": LOAD, "probe": PROBE}


def elements(count, kn, n0=0.6, mu=0.4):
    """Friction elements of different stiffness, one tangent."""
    kt = np.tile([2.0, 1.5], count)[:count]
    return Elements(kt, np.full(count, kn), np.full(count, mu), np.full(count, n0), tangents=1)


def sector_bodies(C=None):
    """Nodal diameter to the sector's model, damped by its modes, or also by the matrix of a blade
    with its disc.
    """
    bodies = {}
    for n in range(N // 2 + 1):
        turn = np.exp(2j * np.pi * n / N)
        K = OWN + turn * LINK + turn.conj() * LINK.T
        K = K.real if 2 * n % N == 0 else K
        bodies[n] = port_model_from_matrices(MASS, K, PORTS, C=C, nodal_diameter=n)
    return bodies


def forces(amplitudes):
    """Engine order EO with these harmonics."""
    return {h: engine_order(N, h * EO, np.array([f])) for h, f in amplitudes.items()}


def ring_wheel(own, damper, excitation, damping=DAMPING, C=None, **others):
    """The wheel by nodal diameters."""
    return tuned_wheel(
        N, sector_bodies(C), slice(2, 4), own, excitation, damping=damping, damper=damper, **others
    )


def dense_ring(own, damper, excitation, damping=DAMPING, C=None, dK=None, dM=None):
    """All sectors as one dense body, for the balance of `bladefem.hbm`; contact rows of damper b:
    on blade b, then on blade b + 1.

    Args:
        dK, dM: (N, 2, 2) deviations of the blades.
    """
    following = np.roll(np.eye(N), 1, axis=1)
    K = np.kron(np.eye(N), OWN) + np.kron(following, LINK) + np.kron(following.T, LINK.T)
    M = np.kron(np.eye(N), MASS)
    for matrix, change in ((K, dK), (M, dM)):
        if change is not None:
            for b in range(N):
                part = slice(3 * b, 3 * b + 3)
                matrix[part, part] += BLADE.T @ change[b] @ BLADE
    contact = np.concatenate(
        [
            np.kron(np.eye(N)[[b]], FACES[:2]) if here else np.kron(following[[b]], FACES[2:])
            for b in range(N)
            for here in (True, False)
        ]
    )
    ports = {
        "contact": contact,
        "load": np.kron(np.eye(N), LOAD),
        "probe": np.kron(np.eye(N), PROBE),
    }
    body = port_model_from_matrices(M, K, ports, C=C)
    if isinstance(damper, RigidBody):
        damper = rigid_dampers(damper, np.ones(N))
    elif damper is not None:
        damper = (join_bodies((damper,) * N),)
    whole = {h: amplitudes[:, 0] for h, amplitudes in excitation.items()}
    return ReducedModel((body,), tiled(own), whole, damping, damper)


def rigid_dampers(damper, factors):
    """All dampers as one rigid body, their densities times factors."""
    turning = damper.gyroscopic
    return RigidBody(
        np.kron(np.diag(factors), damper.mass),
        np.kron(np.eye(N), damper.B),
        gyroscopic=None if turning is None else np.kron(np.diag(factors), turning),
    )


def tiled(e):
    """The elements of one damper, on all."""
    return Elements(
        *(np.tile(getattr(e, name), N) for name in ("kt", "kn", "mu", "n0")), tangents=1
    )


def elastic_damper(C=None, density=1.0):
    """A floating damper of two masses with all its modes."""
    K = np.array([[1.5, -1.5], [-1.5, 1.5]])
    return port_model_from_matrices(
        density * np.diag([0.3, 0.2]),
        K,
        {"contact": np.array([[1.0, 0.1], [-0.3, 0.9], [0.8, 0.3], [0.2, -1.0]])},
        C=C,
    )

"""Small models that several tests share."""

import numpy as np

from bladefem.data import Elements, RigidBody
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.reduction.matrices import port_model_from_matrices


def single_mass(kt=1.0, limit=0.5, zeta=0.01, force=1.0):
    """Mass 1, spring 1, dry friction of stiffness kt and limit mu N against the ground."""
    ports = {name: np.array([0]) for name in ("contact", "load", "probe")}
    body = port_model_from_matrices(np.eye(1), np.eye(1), ports)
    elements = Elements(np.array([kt]), np.zeros(1), np.ones(1), np.array([limit]), tangents=1)
    return ReducedModel((body,), elements, {1: np.array([force])}, Damping(ratio=zeta))


def block(nodes=4, *, kn=2.0, n0=1.0, mu=0.4, seed=0, damper=False, dofs=30, force=1.0):
    """A random elastic body with 3-D contacts against the ground or a rigid damper of six
    freedoms.
    """
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(dofs, dofs)) / np.sqrt(dofs)
    K = half @ half.T + 0.5 * np.eye(dofs)
    ports = {
        "contact": np.arange(3 * nodes),
        "load": np.array([dofs - 1]),
        "probe": np.array([dofs - 1, dofs - 2]),
    }
    body = port_model_from_matrices(np.eye(dofs), K, ports)
    elements = Elements(
        rng.uniform(0.5, 1.5, nodes),
        kn * rng.uniform(0.5, 1.5, nodes),
        np.full(nodes, mu),
        n0 * rng.uniform(0.5, 1.5, nodes),
    )
    other = (
        RigidBody(np.diag(rng.uniform(2.0, 4.0, 6)), rng.normal(size=(3 * nodes, 6)))
        if damper
        else None
    )
    return ReducedModel((body,), elements, {1: np.array([force])}, Damping(ratio=0.01), other)

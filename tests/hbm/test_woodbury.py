"""Contact flexibility with springs: the low-rank update against solving with the whole matrix."""

import numpy as np
import pytest
from plain_linear import plain_condense

from bladefem.data import Elements, PortModel, RigidBody
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import Damping, ReducedModel

NODES, MODES = 24, 5


def port_model(rng, lowest):
    """A body with complex modes, as a sector in a nodal diameter has."""
    ports = {
        "contact": slice(0, 3 * NODES),
        "load": slice(3 * NODES, 3 * NODES + 1),
        "probe": slice(3 * NODES, 3 * NODES + 1),
    }
    size = 3 * NODES + 1
    shapes = rng.standard_normal((size, MODES)) + 1j * rng.standard_normal((size, MODES))
    root = rng.standard_normal((size, size)) + 1j * rng.standard_normal((size, size))
    return PortModel(
        np.linspace(lowest, 9.0, MODES), shapes, 1e-3 * root @ root.conj().T / size, ports
    )


def elastic_damper(rng):
    """A floating one: rigid modes first."""
    shapes, root = rng.standard_normal((3 * NODES, 4)), rng.standard_normal((3 * NODES, 3 * NODES))
    return PortModel(
        np.array([0.0, 0.0, 4.0, 7.0]),
        shapes,
        1e-3 * root @ root.T / NODES,
        {"contact": slice(0, 3 * NODES)},
    )


@pytest.mark.parametrize("kind", ["ground", "rigid", "elastic"])
@pytest.mark.parametrize("sides", [1, 4])
def test_update_is_the_solution_of_the_whole_system(kind, sides):
    rng = np.random.default_rng(3)
    bodies = tuple(port_model(rng, 1.0 + 0.1 * h) for h in range(sides))
    springs = rng.uniform(1.0, 20.0, NODES) * (np.arange(NODES) % 5 > 0)  # some nodes are open
    elements = Elements(springs, 1.5 * springs, np.full(NODES, 0.3), np.ones(NODES))
    damper = {
        "ground": None,
        "elastic": (elastic_damper(rng),),
        "rigid": RigidBody(np.diag([1.0, 2.0, 0.5]), rng.standard_normal((3 * NODES, 3))),
    }[kind]
    model = ReducedModel(
        bodies,
        elements,
        {1: np.ones(1, complex)},
        Damping(ratio=0.002),
        damper,
        Damping(ratio=0.002),
    )
    for omega in (0.9, 1.0, 3.3):
        quick = condense(model, omega, 3)
        assert len(quick.bodies.A) > 0
        whole = plain_condense(model, omega, 3)
        system = whole.G[1] * whole.springs + np.eye(
            len(whole.springs)
        )  # 1.0 meets a mode: 6e5, else 1e4
        bound = 4 * np.finfo(float).eps * np.linalg.cond(system)
        assert abs(quick.A - whole.A).max() < bound * abs(whole.A).max()
        assert abs(quick.stuck - whole.stuck).max() < bound * abs(whole.stuck).max()

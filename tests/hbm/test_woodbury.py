"""Contact flexibility with springs: the low-rank update against solving with the whole matrix."""

from dataclasses import replace

import numpy as np
import pytest
from plain_linear import plain_condense, plain_error

from bladefem.data import Elements, PortModel, RigidBody
from bladefem.hbm.linear.condensation import condense, own_flexibility
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.solver.residual import (
    Balance,
    as_amplitudes,
    evaluate_balance,
    start_in_stick,
)

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


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("real", [False, True])
def test_the_flexibility_without_springs_is_that_of_the_whole_bodies(real, coupled):
    """As matrices, its diagonal, and in the error of a state; a real body that serves all harmonics keeps its
    residual flexibility once.
    """
    rng = np.random.default_rng(5)
    body = port_model(rng, 1.0)
    if real:
        body = replace(body, shapes=body.shapes.real, residual=body.residual.real)
    if coupled:
        root = 0.1 * rng.standard_normal((MODES, MODES))
        body = replace(body, damping=root @ root.T)
    one = np.ones(NODES)
    model = ReducedModel(
        (body,),
        Elements(300 * one, 400 * one, 0.3 * one, one),
        {1: np.ones(1, complex)},
        Damping(ratio=0.002),
        (elastic_damper(rng),),
        Damping(ratio=0.002),
    )
    linear, G = condense(model, 0.9, 3), plain_condense(model, 0.9, 3).G
    assert (len(linear.bodies.rest) > 0) == real
    np.testing.assert_allclose(linear.G[1:], G[1:], rtol=0, atol=1e-12 * abs(G).max())
    np.testing.assert_allclose(own_flexibility(linear), np.diagonal(G[1]), rtol=1e-11)
    balance = Balance(model, linear, 64)
    start = start_in_stick(balance)
    state = evaluate_balance(balance, start + abs(start).max() * rng.standard_normal(start.shape))
    flat = (3 * NODES, 7)
    residual, error = plain_error(
        plain_condense(model, 0.9, 3),
        state.w.reshape(flat),
        state.forces.f.reshape(flat),
        model.preload,
    )
    np.testing.assert_allclose(
        as_amplitudes(state.residual), residual, rtol=0, atol=1e-11 * abs(residual).max()
    )
    # what is left without contact springs is the larger part
    assert error > 1.05 * np.linalg.norm(residual) / np.linalg.norm(as_amplitudes(state.w))
    assert state.error == pytest.approx(error, rel=1e-10)

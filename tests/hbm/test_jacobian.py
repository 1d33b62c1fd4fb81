"""The structured derivative against differences of the residual, and against the dense matrix."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass

from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solver import residual
from bladefem.hbm.solver.newton_krylov import Memory
from bladefem.hbm.solver.residual import (
    Balance,
    evaluate_balance,
    linearise_balance,
    start_in_stick,
)
from bladefem.hbm.solver.walking import may_walk, walking_motions


def differences(balance, w, step):
    columns = []
    for e in np.eye(w.size) * step:
        e = e.reshape(w.shape)
        rise = evaluate_balance(balance, w + e).residual - evaluate_balance(balance, w - e).residual
        columns.append(rise / (2 * step))
    return np.array(columns).reshape(w.size, w.size).T


@pytest.mark.parametrize(
    ("model", "omega", "scale"),
    [
        (single_mass(), 0.9, 1.5),
        (block(), 0.9, 3.0),
        (block(kn=0.0), 0.9, 3.0),
        (block(nodes=6, force=4.0), 1.1, 1.0),
        (reference_model(points=2, load=0.3, phase=0.5, harmonics=3), 8000.0, 0.8),
        # by iterations, with a damper that walks
        (reference_model(points=30, load=0.3, phase=0.5, harmonics=3), 8000.0, 0.8),
    ],
)
def test_the_inverse_derivative_undoes_the_differences(model, omega, scale):
    balance = Balance(model, condense(model, omega, 3), 128)
    rng = np.random.default_rng(2)
    w = start_in_stick(balance) * scale
    w = w + 0.05 * abs(w).max() * rng.normal(size=w.shape)
    state = evaluate_balance(balance, w)
    if may_walk(balance.model):
        # every contact slips: a balance at rest does not determine where the damper is
        balance = replace(balance, walk=walking_motions(balance, state.forces.shares))
        state = evaluate_balance(balance, w)
    J = differences(balance, w, 1e-7 * abs(w).max())
    x = rng.normal(size=w.shape)
    undone = linearise_balance(balance, state)((J @ x.ravel()).reshape(w.shape))
    assert (state.forces.shares[:, 1] > 0).any()
    np.testing.assert_allclose(undone, x, rtol=0, atol=2e-6 * abs(x).max())


def test_iterations_with_a_walk_are_those_without_and_its_terms(monkeypatch):
    """One solution a residual, or one more for each term of low rank: the same step; where the
    iterations give up the other way is taken.
    """
    model = reference_model(points=30, load=0.3, phase=0.5, harmonics=3)
    balance = Balance(model, condense(model, 8000.0, 3), 128)
    rng = np.random.default_rng(2)
    w = 0.8 * start_in_stick(balance)
    w = w + 0.05 * abs(w).max() * rng.normal(size=w.shape)
    walk = walking_motions(balance, evaluate_balance(balance, w).forces.shares)
    balance = replace(balance, walk=walk)
    state = evaluate_balance(balance, w)
    memory = Memory()
    iterated = residual._iterate_with_walk(balance, state, memory)
    held = residual._linearise_blocks(residual._held_walk(balance), state)
    plain = residual._low_rank_inverse(held, *residual._walk_terms(balance, state))
    r = rng.normal(size=w.shape)
    expected = plain(r, 1e-10)
    np.testing.assert_allclose(iterated(r, 1e-10), expected, atol=1e-7 * abs(expected).max())
    assert memory.level[0].shape == (60, 2)

    def gives_up(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(residual, "_iterate_with_walk", lambda *_: gives_up)
    found = linearise_balance(balance, state)(r, 1e-10)
    np.testing.assert_allclose(found, expected, atol=1e-7 * abs(expected).max())

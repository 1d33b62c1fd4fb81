"""Compiled evaluations of 2-D elements against the same in NumPy, one step after the other."""

from dataclasses import replace

import numpy as np
import pytest
from models import block

from bladefem.data import Elements, RigidBody
from bladefem.friction.aft import dissipated_energy, evaluate
from bladefem.hbm import policy
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import newton, residual
from bladefem.hbm.solver.newton_compiled import dense_jacobian
from bladefem.hbm.solver.newton_krylov import Memory
from bladefem.hbm.solver.residual import (
    Balance,
    evaluate_balance,
    linearise_balance,
    start_in_stick,
    walk_rates,
)
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.util.newton import halve_step

SAMPLES = 64
ROUNDING = 1e-12


def rubbing(nodes=2):
    """Two unit masses on springs, and a free mass that rubs on them in two directions under loads
    that swing.
    """
    readings = np.tile(np.eye(2), (nodes, 1)) * np.repeat(1 + 0.1 * np.arange(nodes), 2)[:, None]
    ports = {"contact": readings, "load": [0], "probe": [0]}
    body = port_model_from_matrices(np.eye(2), np.array([[1.0, 0.2], [0.2, 1.3]]), ports)
    share = np.full(nodes, 1 / nodes)
    elements = Elements(5.0 * share, np.zeros(nodes), np.full(nodes, 0.5), 0.3 * share, tangents=2)
    damper = RigidBody(0.3 * np.eye(2), np.tile(np.eye(2), (nodes, 1)))
    normal = {1: 0.2j * share}
    return ReducedModel(
        (body,), elements, {1: np.array([0.3])}, Damping(0.01), damper, normal=normal
    )


def walking(nodes=2):
    """A balance whose damper walks along both tangents, and displacements that all contacts slip
    by.
    """
    model = rubbing(nodes)
    balance = Balance(model, condense(model, 1.1, 3), SAMPLES)
    balance = replace(balance, walk=newton.tangential_motions(model))
    assert balance.walk.shape == (2 * nodes, 2)
    w = np.random.default_rng(3).normal(size=(nodes, 2, 7))
    return balance, w


def resting(model, size):
    balance = Balance(model, condense(model, 0.9, 3), SAMPLES)
    start = start_in_stick(balance)
    rng = np.random.default_rng(1)
    return balance, start + size * abs(start).max() * rng.normal(size=start.shape)


CASES = {
    "few contacts": resting(block(), 0.5),
    "all stick": resting(block(n0=1e6), 0.5),
    "rigid damper": resting(block(damper=True), 2.0),
    "prescribed loads": resting(rubbing(3), 1.0),
    "walking": walking(),
}


def plain_state(balance, w):
    """(f, dfdw, shares, dissipated, p, residual, error) with NumPy alone but for the contact law."""
    model = balance.model
    linear = balance.linear
    n, d, K = w.shape
    full = np.zeros((n, 3, K))
    full[:, 3 - d :] = w
    full[:, 3 - d :, 0] += model.offset.reshape(n, d)
    ramp = np.zeros((n, 2))
    if balance.walk is not None:
        steps = balance.walk.T @ (model.springs * w[:, :, 0]).ravel()
        ramp = (balance.walk @ steps).reshape(n, d)[:, d - 2 :]
    load = model.normal_series(SAMPLES) if model.normal else None
    law = evaluate(model.elements, full, SAMPLES, load=load, precision="single", walk=ramp)
    f = law.f[:, 3 - d :]
    springs = model.springs[:, :, None]
    p = f - springs * w
    p[:, :, 0] -= model.preload.reshape(n, d)

    def product(matrices, x):
        q = residual.as_amplitudes(x)
        return residual.as_coefficients(np.einsum("hij,hj->hi", matrices, q), x.shape)

    r = w - residual.as_coefficients(linear.stuck, w.shape) + product(linear.A, p)
    sprung = springs * r
    sprung[:, :, 0] = 0.0
    bare = r + product(linear.G, sprung)
    error = max(
        np.linalg.norm(r) / np.linalg.norm(w), np.linalg.norm(bare) / linear.condensed.scale
    )
    works = dissipated_energy(law.f, full) + np.sum(law.f[:, 1:, 0] * ramp, axis=1)
    return f, law.jacobian[:, 3 - d :, :, 3 - d :], law.shares, works, p, r, error


@pytest.mark.parametrize("name", CASES)
def test_a_compiled_evaluation_is_that_of_numpy(name):
    balance, w = CASES[name]
    assert residual.evaluates_2d(balance)
    state = evaluate_balance(balance, w, "single")
    forces = state.forces
    found = (forces.f, forces.jacobian, forces.shares, forces.dissipated)
    found = (*found, state.p, state.residual, state.error)
    for value, expected in zip(found, plain_state(balance, w), strict=True):
        size = abs(np.asarray(expected)).max()
        np.testing.assert_allclose(value, expected, rtol=0, atol=ROUNDING * max(size, 1e-3))
    assert forces.converged and forces.reason == "periodic"
    np.testing.assert_array_equal(state.w, w)


@pytest.mark.parametrize("name", ["few contacts", "rigid damper", "prescribed loads", "walking"])
@pytest.mark.parametrize("factor", [1.0, 3.0, 20.0, -1.0])
def test_halvings_of_a_step_are_those_of_the_plain_search(name, factor):
    """A step that is too long is halved as often, one that leads uphill is given up."""
    balance, w = CASES[name]
    state = evaluate_balance(balance, w, "single")
    step = factor * linearise_balance(balance, state)(state.residual, 1e-6)
    before = np.linalg.norm(state.residual)
    plain = halve_step(
        lambda share: evaluate_balance(balance, state.w - share * step, "single"),
        lambda trial, share: np.linalg.norm(trial.residual) <= (1 - 1e-4 * share) * before,
        newton.SHORTEST_STEP_SHARE,
    )
    found = newton._search_residual_2d(balance, state, step)
    assert (found is None) == (plain is None)
    if plain is not None:
        np.testing.assert_allclose(found.w, plain.w, rtol=0, atol=ROUNDING * abs(plain.w).max())
        assert abs(found.error - plain.error) <= ROUNDING
        # a shorter step has the derivative, too, which the search makes in a second call
        assert factor < 20.0 or abs(state.w - plain.w).max() <= abs(step).max() / 4
        jacobian = plain.forces.jacobian
        np.testing.assert_allclose(
            found.forces.jacobian, jacobian, rtol=0, atol=1e-5 * abs(jacobian).max()
        )


def test_rates_of_a_walk_are_those_of_forces_one_by_one():
    balance, w = CASES["walking"]
    state = evaluate_balance(balance, w, "single")
    rates = walk_rates(balance, state)
    size = residual.WALK_DIFFERENCE * abs(w[:, :, 1:]).max()
    plain = residual._walk_rates_one_by_one(balance, state, size)
    # forces agree to rounding, which the difference divides by
    rounding = ROUNDING * abs(state.forces.f).max() / size
    assert rates.shape == (2, *w.shape) and abs(plain).max() > 1e3 * rounding
    np.testing.assert_allclose(rates, plain, rtol=0, atol=rounding)


@pytest.mark.parametrize("name", CASES)
def test_a_step_by_one_matrix_solves_the_differences_of_the_residual(name):
    balance, w = CASES[name]
    state = evaluate_balance(balance, w)
    step = linearise_balance(balance, state)(state.residual)
    # forces repeat to some 1e-9, which the difference divides by
    size = 1e-5 / abs(step).max() * abs(w).max()
    ahead, back = (evaluate_balance(balance, w + s * size * step).residual for s in (1, -1))
    np.testing.assert_allclose(
        (ahead - back) / (2 * size), state.residual, rtol=0, atol=1e-4 * abs(state.residual).max()
    )


def test_a_step_of_a_walk_by_one_matrix_is_that_by_terms_of_low_rank():
    balance, w = CASES["walking"]
    state = evaluate_balance(balance, w)
    base = residual._linearise_blocks(residual._held_walk(balance), state)
    plain = residual._low_rank_inverse(base, *residual._walk_terms(balance, state))
    memory = Memory()
    step = linearise_balance(balance, state, memory)(state.residual)
    expected = plain(state.residual)
    np.testing.assert_allclose(step, expected, rtol=0, atol=1e-11 * abs(expected).max())
    assert memory.solvers == {policy.DENSE_LU}


def test_nodes_that_stick_are_left_out_of_the_matrix():
    """The step is that of the whole system."""
    model = block()
    pressed = replace(model.elements, n0=model.elements.n0 * [1.0, 1e5, 1.0, 1e5])
    balance, w = resting(replace(model, elements=pressed), 0.5)
    state = evaluate_balance(balance, w)
    change, nodes, _ = residual._active_nodes(balance, state)
    n, d, K = w.shape
    assert list(nodes) == [0, 2]
    C = np.zeros((n, d * K, d * K))
    C[nodes] = change
    system = dense_jacobian(balance.linear.A, C)
    expected = np.linalg.solve(system, state.residual.ravel()).reshape(w.shape)
    step = linearise_balance(balance, state)(state.residual)
    np.testing.assert_allclose(step, expected, rtol=0, atol=1e-11 * abs(expected).max())


@pytest.mark.parametrize("omega", [0.7, 0.9, 1.1])
def test_a_damper_walks_beside_a_contact_without_stiffness(omega):
    """As beside one without friction."""
    model = rubbing(3)
    e, exact = model.elements, newton.Options(tolerance=1e-10)
    found, without = (
        solve(replace(model, elements=elements), omega, 3, SAMPLES, options=exact)
        for elements in (replace(e, kt=e.kt * [1, 1, 0]), replace(e, mu=e.mu * [1, 1, 0]))
    )
    assert found.converged and found.walk is not None and without.converged
    moved, expected = found.w[:, :, 1:], without.w[:, :, 1:]
    # forces are marched until they repeat, which they do to some 1e-6
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-5 * abs(expected).max())


def test_states_that_newton_begins_with_are_those_at_its_starts():
    balance, w = CASES["walking"]
    resting = replace(balance, walk=None)
    starts = list(newton._likely_starts(resting, w))
    assert any(start.balance.walk is not None and start.state is not None for start in starts)
    for start in starts:
        if start.state is not None:
            state = evaluate_balance(start.balance, start.w, "single")
            np.testing.assert_array_equal(start.state.residual, state.residual)


def test_a_motion_that_is_not_finite_is_said_to_be_none():
    balance, w = CASES["few contacts"]
    w = w.copy()
    w[0, 1, 1] = np.nan
    forces = evaluate_balance(balance, w, "single").forces
    assert not forces.converged and "not finite" in forces.reason

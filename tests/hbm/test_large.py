"""The path of large patches: GMRES steps are those of the dense Jacobian, and no dense Jacobian is
made.
"""

from dataclasses import replace

import numpy as np
import pytest
from hbm_models import patch, sectors
from plain_linear import plain_jacobian

from bladefem.hbm import policy
from bladefem.hbm.linear import condensation
from bladefem.hbm.linear.common_basis import common_basis
from bladefem.hbm.linear.condensation import condense, own_flexibility, truncate_harmonics
from bladefem.hbm.linear.contact_flexibility import by_harmonic, flexibility_product
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import residual as residual_module
from bladefem.hbm.solver.newton_krylov import iterative_inverse
from bladefem.hbm.solver.residual import (
    Balance,
    adjoint_inverse,
    evaluate_balance,
    linearise_balance,
    start_in_stick,
)
from bladefem.reduction.truncate import truncate_modes


def test_iterative_and_dense_steps_agree(monkeypatch):
    model = patch(side=4, inner=6).model
    balance = Balance(model, condense(model, 0.8, 3), 64)
    state = evaluate_balance(balance, 1.2 * start_in_stick(balance))
    assert (state.forces.shares[:, 1] > 0).any() and (state.forces.shares[:, 2] > 0).any()
    dense = linearise_balance(balance, state)(state.residual)
    monkeypatch.setattr(policy, "DENSE_UNKNOWNS", 0)
    for accuracy in (1e-2, 1e-5):
        step = linearise_balance(balance, state)(state.residual, accuracy)
        assert np.linalg.norm(step - dense) < 20 * accuracy * np.linalg.norm(dense)


def test_the_preconditioner_takes_over_where_plain_gmres_is_too_slow(monkeypatch):
    from bladefem.hbm.solver import newton_krylov as iterative

    monkeypatch.setattr(iterative, "conjugate_residuals", lambda *_: -1)
    model = patch(side=4, inner=6).model
    balance = Balance(model, condense(model, 0.8, 3), 64)
    state = evaluate_balance(balance, 1.2 * start_in_stick(balance))
    n, d, K = state.w.shape
    change = state.forces.dfdw.reshape(n, d * K, d * K).copy()
    change[:, np.arange(d * K), np.arange(d * K)] -= np.repeat(model.springs, K, axis=1)
    right = state.residual.reshape(n * d, K)
    full = iterative_inverse(balance.linear.condensed.flex, change)(right, 1e-5)
    monkeypatch.setattr(iterative, "GMRES_BASIS", 12)
    short = iterative_inverse(balance.linear.condensed.flex, change)(right, 1e-3)
    assert np.linalg.norm(short - full) < 0.05 * np.linalg.norm(full)


def nearly_singular() -> tuple[np.ndarray, np.ndarray]:
    """A and change of 12 nodes, 3 directions, 3 harmonics, where 1 + A change has an eigenvalue of
    1e-5.
    """
    random = np.random.default_rng(7)
    half = random.standard_normal((4, 36, 36)) + 1j * random.standard_normal((4, 36, 36))
    A = half @ half.conj().swapaxes(1, 2) / 36
    A[0] = A[0].real
    change = random.standard_normal((12, 21, 21)) - 2 * np.eye(21)
    values = np.linalg.eigvals(plain_jacobian(A, change))
    lowest = values[abs(values.imag) < 1e-9].real.min()
    return A, change * (1e-5 - 1) / lowest


@pytest.mark.parametrize("directions", [True, False])
def test_steps_next_to_a_singular_derivative_reach_their_accuracy(monkeypatch, directions):
    """The step is 10^4 times the residual there: products in single precision leave some percent of
    it behind.
    """
    from bladefem.hbm.solver import newton_krylov as iterative

    if not directions:
        monkeypatch.setattr(iterative, "conjugate_residuals", lambda *_: -1)
    A, change = nearly_singular()
    J = np.eye(252) + plain_jacobian(A, change)
    right = np.random.default_rng(1).standard_normal((36, 7))
    step = iterative_inverse(by_harmonic(A), change)(right, 1e-5)
    assert np.linalg.norm(step) > 100 * np.linalg.norm(right)
    assert np.linalg.norm(J @ step.ravel() - right.ravel()) < 2.1e-5 * np.linalg.norm(right)


def test_conjugate_residuals_start_again_on_what_they_left(monkeypatch):
    """Slopes of a resonance are wanted to 1e-9, which one pass does not reach; GMRES, one solution
    for each vector of a walk, took 0.1 s where passes take 5 ms each.
    """
    from bladefem.hbm.solver import newton_krylov as iterative

    A, change = nearly_singular()
    A, change = A[:, :36, :36], 0.15 * change / abs(1e-5 - 1)
    random = np.random.default_rng(2)
    right, force, reading = random.standard_normal((3, 36, 7))
    ramp = 0.05 * force.reshape(1, -1), 0.05 * reading.reshape(1, -1)
    flex = by_harmonic(A)
    moved = flexibility_product(flex, ramp[0].reshape(36, 7)).ravel()
    J = np.eye(252) + plain_jacobian(A, change) + np.outer(moved, ramp[1])
    plain, passes = iterative.conjugate_residuals, []

    def short(flex, C, ramp, r, accuracy, level, x):
        """A pass that reaches no more than a hundredth."""
        passes.append(accuracy)
        count = plain(flex, C, ramp, r, max(accuracy, 1e-2), level, x)
        return count if accuracy >= 1e-2 else iterative.NOT_FOUND

    monkeypatch.setattr(iterative, "conjugate_residuals", short)
    step = iterative_inverse(flex, change, ramp=ramp)(right, 1e-9)
    assert 4 <= len(passes) <= 1 + iterative.MOST_RESTARTS
    left = J @ step.ravel() - right.ravel()
    assert np.linalg.norm(left) <= 1e-9 * np.linalg.norm(right)


def test_dense_factors_are_the_last_resort(monkeypatch):
    from bladefem.hbm.solver import newton_krylov as iterative

    A, change = nearly_singular()
    right = np.random.default_rng(1).standard_normal((36, 7))
    monkeypatch.setattr(policy, "DENSE_UNKNOWNS", 0)
    monkeypatch.setattr(iterative, "GMRES_PASSES", 0)
    monkeypatch.setattr(iterative, "conjugate_residuals", lambda *_: -1)
    step = residual_module._choose_inverse(by_harmonic(A), change)(right, 1e-5)
    J = np.eye(252) + plain_jacobian(A, change)
    assert np.linalg.norm(J @ step.ravel() - right.ravel()) < 1e-9 * np.linalg.norm(right)


def test_a_patch_with_lift_off_is_solved_and_balances_its_work():
    model = patch(side=6, inner=9).model
    for omega in (0.5, 0.9, 1.3):
        solution = solve(model, omega, 3, 64)
        assert solution.converged and solution.work.imbalance < 1e-8
        lighter = solve(
            replace(model, excitation={1: 0.5 * model.excitation[1]}), omega, 3, 64, start=solution
        )
        assert lighter.converged


@pytest.fixture(scope="module")
def hundred_nodes():
    """100 nodes in space on 60 modes and the residual flexibility of the others."""
    whole = patch(side=10).model
    return replace(whole, sides=(truncate_modes(whole.sides[0], 60),))


def test_a_hundred_nodes_are_solved_as_by_the_dense_jacobian(monkeypatch, hundred_nodes):
    """By products with the residual flexibility and the modes: no matrix of a harmonic is
    formed.
    """
    with monkeypatch.context() as forbidden:
        for module in (residual_module, condensation):
            forbidden.setattr(module, "form_matrices", None)
        lean = solve(hundred_nodes, 0.9, 3, 88)
    assert len(condense(hundred_nodes, 0.9, 3).condensed.flex[0]) == 0
    assert lean.route == "NumPy Newton, iterations"
    assert min(lean.states[name] for name in ("stick", "slip", "lift")) > 0
    monkeypatch.setattr(policy, "DENSE_UNKNOWNS", 10**6)
    monkeypatch.setattr(policy, "SHARED_FLEXIBILITY_DOFS", 10**6)
    dense = solve(replace(hundred_nodes), 0.9, 3, 88)
    assert dense.route == "NumPy Newton, dense LU"
    np.testing.assert_allclose(lean.w, dense.w, rtol=0, atol=1e-8 * abs(dense.w).max())
    np.testing.assert_allclose(lean.probe, dense.probe, rtol=0, atol=1e-8 * abs(dense.probe).max())


@pytest.mark.parametrize("coupled", [False, True])
def test_sectors_share_one_flexibility_too(monkeypatch, hundred_nodes, coupled):
    """Points of contact bodies that differ with the nodal diameter are those of matrices for each
    harmonic; damping may couple their modes.
    """
    few = replace(hundred_nodes, sides=(truncate_modes(hundred_nodes.sides[0], 8),))
    model = sectors(few, 3)
    if coupled:
        random = np.random.default_rng(3).standard_normal((8, 8))
        damping = 0.01 * (np.diag(model.sides[0].omega) + random @ random.T / 8)
        sides = tuple(replace(side, damping=damping) for side in model.sides)
        model = replace(model, sides=sides)
    linear = condense(model, 0.9, 3)
    A, mean, R, U, T = linear.condensed.flex
    assert len(A) == 0 and 24 < U.shape[1] < 100 and np.isrealobj(U)
    lean = solve(model, 0.9, 3, 88)
    assert min(lean.states[name] for name in ("stick", "slip", "lift")) > 0
    monkeypatch.setattr(policy, "SHARED_FLEXIBILITY_DOFS", 10**6)
    plain = replace(model)
    apart = condense(plain, 0.9, 3)
    assert len(apart.condensed.flex[0])
    for name in ("A", "G", "stuck", "free"):
        one, other = getattr(linear, name), getattr(apart, name)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * abs(other).max())
    np.testing.assert_allclose(own_flexibility(linear), own_flexibility(apart), rtol=1e-9)
    less = truncate_harmonics(linear, 1)
    np.testing.assert_allclose(less.A, apart.A[:2], rtol=0, atol=1e-9 * abs(apart.A).max())
    other = solve(plain, 0.9, 3, 88)
    assert lean.converged and other.converged
    np.testing.assert_allclose(lean.w, other.w, rtol=0, atol=1e-8 * abs(other.w).max())
    np.testing.assert_allclose(lean.probe, other.probe, rtol=0, atol=1e-8 * abs(other.probe).max())


def test_bodies_without_likeness_keep_a_matrix_for_each_harmonic(hundred_nodes):
    """A basis would be as large as the contact."""
    random = np.random.default_rng(2).standard_normal((300, 300))
    residual = np.stack([np.eye(300), random @ random.T, random.T @ random])
    assert common_basis(residual.astype(complex), np.ones((3, 300, 2))) is None
    assert common_basis(residual[:, :9, :9], np.ones((3, 9, 2))) is None
    assert common_basis(residual[:1], np.ones((1, 300, 151))) is None
    found = common_basis(residual[:1], np.ones((1, 300, 2)))
    assert found.vectors.shape == (300, 1) and not found.differences.any()


@pytest.mark.parametrize("blocks", [False, True])
def test_gmres_takes_both_forms_of_the_flexibility(monkeypatch, hundred_nodes, blocks):
    """Its products and harmonic blocks by modes are those of the matrices."""
    from bladefem.hbm.solver import newton_krylov as iterative

    monkeypatch.setattr(iterative, "conjugate_residuals", lambda *_: -1)
    balance = Balance(hundred_nodes, condense(hundred_nodes, 0.9, 3), 88)
    state = evaluate_balance(balance, 1.2 * start_in_stick(balance))
    n, d, K = state.w.shape
    change = state.forces.jacobian.reshape(n, d * K, d * K).copy()
    change[:, np.arange(d * K), np.arange(d * K)] -= np.repeat(balance.model.springs, K, axis=1)
    right = state.residual.reshape(n * d, K)
    flex = balance.linear.condensed.flex
    one, other = (
        iterative_inverse(form, change, iterative.Memory(slow=blocks))(right, 1e-8)
        for form in (flex, by_harmonic(balance.linear.A))
    )
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-6 * abs(other).max())


def test_the_adjoint_of_the_second_form_is_the_transposed_inverse(hundred_nodes):
    balance = Balance(hundred_nodes, condense(hundred_nodes, 0.9, 3), 88)
    state = evaluate_balance(balance, 1.2 * start_in_stick(balance))
    x, y = np.random.default_rng(1).normal(size=(2, *state.w.shape))
    step = linearise_balance(balance, state)(x, 1e-10)
    back = adjoint_inverse(balance, state)(y, 1e-10)
    assert np.vdot(y, step) == pytest.approx(np.vdot(back, x), rel=1e-6)


def test_blocks_serve_a_whole_newton_run(monkeypatch):
    """A patch of which all nodes lift off: blocks are made once and then again only where nodes
    change their state.
    """
    from bladefem.hbm.solver import newton_krylov as iterative

    monkeypatch.setattr(iterative, "conjugate_residuals", lambda *_: -1)
    made, model = [], patch(side=6, inner=12, n0=0.1).model
    plain = iterative._harmonic_blocks
    monkeypatch.setattr(iterative, "_harmonic_blocks", lambda *a: made.append(1) or plain(*a))
    monkeypatch.setattr(
        iterative, "RENEWING_PRODUCTS", 40
    )  # where fewer contacts make products cheap, blocks seldom pay
    solution = solve(model, 0.5, 5, 128)
    assert solution.converged and solution.work.imbalance < 1e-8 and solution.states["lift"] == 36
    assert 0 < len(made) < solution.iterations / 2

"""The compiled iterations against a dense solution, and many points at once against one after the
other.
"""

import numpy as np
import pytest
from numba import njit

from bladefem.hbm import policy
from bladefem.hbm.linear import packed_bodies as small_bodies
from bladefem.hbm.linear.contact_flexibility import (
    apply_flexibility,
    apply_matrices,
    by_harmonic,
    flexibility_of_mean,
    flexibility_product,
    form_matrices,
    seen_by,
    select_nodes,
    sizes,
    transposed_flexibility,
)
from bladefem.hbm.linear.row_products import multiply_blocks
from bladefem.hbm.linear_resonances import stuck_resonances
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.response import response
from bladefem.hbm.solve import leading_stuck_solutions, solve
from bladefem.hbm.solver import newton_krylov
from bladefem.hbm.solver.deflation import _leading_directions, no_level, no_ramp, second_level
from bladefem.hbm.solver.dense_lu import back_substitute
from bladefem.hbm.solver.krylov import MOST_DIRECTIONS, NOT_FOUND, conjugate_residuals
from bladefem.hbm.solver.newton import Options
from bladefem.hbm.solver.newton_compiled import dense_jacobian


def system(strength, nodes=6, d=2, H=4):
    """A (H+1, m, m) Hermitian, C (nodes, dK, dK)."""
    rng = np.random.default_rng(3)
    m, K = nodes * d, 2 * H + 1
    A = rng.normal(size=(H + 1, m, m)) + 1j * rng.normal(size=(H + 1, m, m))
    A[0] = A[0].real
    return A / m, strength * rng.normal(size=(nodes, d * K, d * K)) / (d * K)


def test_the_jacobian_is_what_the_product_applies():
    A, C = system(1.0)
    J, K, size = dense_jacobian(A, C), 2 * len(A) - 1, C.shape[1]
    x = np.random.default_rng(4).normal(size=len(J))
    forces = np.concatenate([block @ x[i * size : (i + 1) * size] for i, block in enumerate(C)])
    out = x.reshape(-1, K).copy()
    apply_matrices(A, forces.reshape(-1, K), out)
    np.testing.assert_allclose(J @ x, out.ravel(), atol=1e-13)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-6])
def test_conjugate_residuals_reach_the_accuracy_or_say_no(accuracy):
    A, C = system(1.0)
    J = dense_jacobian(A, C)
    r, x = np.random.default_rng(5).normal(size=len(J)), np.empty(len(J))
    assert conjugate_residuals(by_harmonic(A), C, no_ramp(), r, accuracy, no_level(), x) > 0
    assert np.linalg.norm(J @ x - r) <= 1.01 * accuracy * np.linalg.norm(r)
    A, C = system(100.0)
    # no 60 directions are enough there
    assert (
        conjugate_residuals(by_harmonic(A), C, no_ramp(), r, accuracy, no_level(), x) == NOT_FOUND
    )


@pytest.mark.parametrize("strength", [1.0, 100.0])
def test_conjugate_residuals_leave_the_least_of_all_combinations(strength):
    """Of their directions, found or not: what they leave is what NumPy's least squares leave on the
    Krylov space of as many vectors; restarts go on from there.
    """
    A, C = system(strength)
    J = dense_jacobian(A, C)
    r, x = np.random.default_rng(5).normal(size=len(J)), np.empty(len(J))
    count = conjugate_residuals(by_harmonic(A), C, no_ramp(), r, 1e-6, no_level(), x)
    V = np.empty((len(J), MOST_DIRECTIONS if count == NOT_FOUND else count))
    y = r
    for k in range(V.shape[1]):
        for _ in range(2):
            y = y - V[:, :k] @ (V[:, :k].T @ y)
        V[:, k] = y / np.linalg.norm(y)
        y = J @ V[:, k]
    best = V @ np.linalg.lstsq(J @ V, r, rcond=None)[0]
    assert (count == NOT_FOUND) == (strength > 1)
    left = np.linalg.norm(r - J @ best) / np.linalg.norm(r)
    assert left < 0.9
    assert np.linalg.norm(r - J @ x) / np.linalg.norm(r) == pytest.approx(left, rel=1e-6)


@pytest.mark.parametrize("size", [1, 3, 4, 5, 18, 27, 93])
def test_products_of_blocks_are_those_of_numpy(size):
    """Also where rows are left over from fours."""
    rng = np.random.default_rng(size)
    C, x = rng.normal(size=(3, size, size)), rng.normal(size=(3, size))
    out = np.full(3 * size, np.nan)
    njit(lambda *given: multiply_blocks(*given))(C, x.ravel(), out)
    np.testing.assert_allclose(out, np.einsum("nij,nj->ni", C, x).ravel(), rtol=0, atol=1e-12)


def by_modes(nodes=6, d=2, H=4, M=3):
    """A flexibility of the second form, whose modes are soft and whose rest is stiff."""
    rng = np.random.default_rng(7)
    m, mean, R = nodes * d, *(x @ x.T for x in 0.1 * rng.normal(size=(2, nodes * d, nodes * d)))
    T = 5 * (rng.normal(size=(H + 1, M, M)) + 1j * rng.normal(size=(H + 1, M, M)))
    return np.zeros((0, 0, 0), complex), mean, R, rng.normal(size=(m, M)), T


def test_both_forms_of_a_flexibility_are_the_same():
    flex, x = by_modes(), np.random.default_rng(8).normal(size=(12, 9))
    A = form_matrices(flex)
    np.testing.assert_allclose(A[2], flex[2] + flex[3] @ flex[4][2] @ flex[3].T, atol=1e-13)
    np.testing.assert_array_equal(A[0], flex[1])
    one, other = np.ones((2, 12, 9))
    apply_flexibility(flex, x, one)
    apply_matrices(A, x, other)
    np.testing.assert_allclose(one, other, atol=1e-12)
    Z = x[:, :2].copy()
    np.testing.assert_allclose(seen_by(flex, Z), Z.T @ A, atol=1e-12)
    np.testing.assert_allclose(seen_by(by_harmonic(A), Z), Z.T @ A, atol=1e-12)
    some = np.array([1, 4])
    rows = np.array([2, 3, 8, 9])
    for form in (flex, by_harmonic(A)):
        np.testing.assert_allclose(
            form_matrices(select_nodes(form, some, 2)), A[:, rows[:, None], rows], atol=1e-12
        )
        assert select_nodes(form, np.arange(6), 2)[0] is not None


@pytest.mark.parametrize("first", [True, False])
def test_the_transpose_is_that_of_the_product(first):
    """y . A x = A^T y . x  for real coefficients, in both forms, without forming the second."""
    flex = by_modes()
    A = form_matrices(flex)
    if first:
        A[0] = A[0].real
        flex = by_harmonic(A)
    assert sizes(flex) == (5, 12)
    np.testing.assert_array_equal(flexibility_of_mean(flex), A[0].real)
    x, y = np.random.default_rng(8).normal(size=(2, 6, 2, 9))
    left = np.vdot(y, flexibility_product(flex, x))
    assert left == pytest.approx(np.vdot(flexibility_product(transposed_flexibility(flex), y), x))
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(np.vdot(flexibility_product(flex, y), x), left)


@pytest.mark.parametrize("columns", [0, 6, 40])
def test_leading_directions_are_those_of_the_singular_values(columns):
    """By the Gram matrix of either side; directions that are a hundredth as soft are left out."""
    random = np.random.default_rng(2)
    soft = random.normal(size=(20, columns)) * np.where(np.arange(columns) < 4, 1.0, 1e-4)
    found = _leading_directions(soft, 5)
    assert found.shape == (20, min(columns, 4))
    if columns:
        left, values, _ = np.linalg.svd(soft)
        np.testing.assert_allclose(abs(np.sum(found * left[:, :4], axis=0)), 1.0, rtol=1e-9)
        np.testing.assert_allclose(found.T @ found, np.eye(4), atol=1e-12)


def test_a_second_level_needs_fewer_directions_for_the_same_step():
    """The modes of the flexibility are the motions that contacts have in common: they alone take
    iterations long.
    """
    flex, (_, C) = by_modes(), system(3.0)
    Q, _ = np.linalg.qr(flex[3])
    J, x = dense_jacobian(form_matrices(flex), C), np.empty(C.shape[0] * C.shape[1])
    r = np.random.default_rng(9).normal(size=len(x))
    level = second_level(flex, C, no_ramp(), Q, np.arange(6), 2)
    Z = np.kron(Q, np.eye(9))
    np.testing.assert_allclose(level[0].T @ level[0], np.eye(3), atol=1e-12)
    M = np.linalg.inv(np.eye(len(x)) + Z @ (np.linalg.inv(Z.T @ J @ Z) - np.eye(27)) @ Z.T)
    before, after = (np.sum(abs(np.linalg.eigvals(j) - 1) > 0.5) for j in (J, J @ np.linalg.inv(M)))
    assert after < before / 2, (before, after)
    assert conjugate_residuals(flex, C, no_ramp(), r, 1e-10, level, x) > 0
    np.testing.assert_allclose(J @ x, r, atol=1e-9 * np.linalg.norm(r))


@pytest.mark.parametrize("walks", [False, True])
@pytest.mark.parametrize("d", [1, 2, 3])
def test_a_second_level_solves_for_the_common_motions(walks, d):
    """Its factors are those of  Z^T (1 + A C) Z  with the vectors of a walk, which NumPy inverts."""
    A, C = system(3.0, d=d)
    rng = np.random.default_rng(2)
    Q, _ = np.linalg.qr(rng.normal(size=(6 * d, 3)))
    J = dense_jacobian(A, C)
    ramp = no_ramp()
    if walks:
        ramp = rng.normal(size=(1, len(J))), rng.normal(size=(1, len(J)))
        moved = flexibility_product(by_harmonic(A), ramp[0][0].reshape(6 * d, 9)).ravel()
        J = J + np.outer(moved, ramp[1][0])
    Z, factors, pivots = second_level(by_harmonic(A), C, ramp, Q, np.arange(6), d)
    spread = np.kron(Z, np.eye(9))
    x = rng.normal(size=27)
    y = x.copy()
    back_substitute(factors, pivots, y)
    expected = np.linalg.solve(spread.T @ J @ spread, x)
    np.testing.assert_allclose(y, expected, rtol=0, atol=1e-11 * abs(expected).max())


def test_a_second_level_serves_the_next_derivatives_while_it_is_good(monkeypatch):
    """Formed once for two derivatives that are close to each other, again for one that is not; the
    steps are exact all the same.
    """
    flex, (_, C) = by_modes(), system(1.0)
    Q, _ = np.linalg.qr(flex[3])
    r = np.random.default_rng(9).normal(size=(12, 9))
    formed = []

    def counted(*arguments):
        formed.append(1)
        return second_level(*arguments)

    monkeypatch.setattr(newton_krylov, "second_level", counted)
    memory = newton_krylov.Memory()
    for change, count in ((0.1 * C, 1), (0.101 * C, 1), (-3.0 * C, 1), (-3.0 * C, 2)):
        x = newton_krylov.iterative_inverse(flex, change, memory, Q)(r, 1e-8)
        J = dense_jacobian(form_matrices(flex), change)
        np.testing.assert_allclose(J @ x.ravel(), r.ravel(), atol=1e-6 * np.linalg.norm(r))
        assert len(formed) == count


def test_a_model_that_all_harmonics_share_is_solved_by_its_modes(monkeypatch):
    """As with a matrix for each harmonic; 32 contacts, from full stick to full slip."""
    found = []
    for wide in (1, 1000):
        monkeypatch.setattr(policy, "SHARED_FLEXIBILITY_DOFS", wide)
        model = reference_model(2e6, 0.06, 8.0, points=16, modes=10)
        assert (len(small_bodies.prepared_bodies(model, 7).R) > 0) == (wide == 1)
        found.append(list(response(model, np.linspace(4800, 6200, 30), 7, 256)))
    assert len({point.states["slip"] for point in found[0]}) > 3
    for one, other in zip(*found, strict=True):
        assert one.converged and other.converged and one.states == other.states
        np.testing.assert_allclose(one.w, other.w, atol=1e-9 * abs(other.w).max())
        np.testing.assert_allclose(one.probe, other.probe, atol=1e-9 * abs(other.probe).max())


def test_points_that_stick_are_the_same_at_once_and_one_by_one():
    """Up to the first frequency that slips; a sweep goes on from there, and comes to the same
    points.
    """
    model = reference_model(1e6, 0.06, 8.0, points=2, harmonics=7)
    omegas = stuck_resonances(model)[1] * np.linspace(0.9, 1.1, 60)
    frugal = Options(frugal=True)
    alone = [solve(model, omega, 7, 256, options=frugal) for omega in omegas]
    found = leading_stuck_solutions(model, omegas, 7)
    assert 5 < len(found) < 60 and len(found) == [p.harmonics for p in alone].index(7)
    for one, other in zip(found, alone, strict=False):
        np.testing.assert_allclose(one.probe, other.probe, rtol=1e-12)
    for one, other in zip(response(model, omegas, 7, 256, options=frugal), alone, strict=True):
        np.testing.assert_allclose(one.probe[1], other.probe[1], rtol=1e-6)

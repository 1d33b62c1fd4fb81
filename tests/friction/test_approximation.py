"""The optimal approximation of Eq. 7-16: least squares, equal work, and the two corrections of
print.
"""

from __future__ import annotations

import numpy as np
import pytest
from friction_cases import decay, random_case, single

from bladefem.friction.aft import dissipated_energy
from bladefem.friction.closed_form import jenkins
from bladefem.friction.equivalent_linear import (
    from_harmonics,
    from_series,
    linear_force,
    matrices_by_harmonic,
    work_of,
)
from bladefem.friction.fourier import derivative, synthesis
from bladefem.friction.kernel_1d_exact import evaluate_exact

OMEGA = 3.0


def work(u: np.ndarray, f: np.ndarray) -> np.ndarray:
    """(n,) work of f (n, K) on u (n, K) in one period, as the kernels give it (Eq. 12)."""
    return dissipated_energy(np.stack([0 * f, f], axis=1), np.stack([0 * u, u], axis=1))


@pytest.fixture(scope="module")
def signals() -> tuple[np.ndarray, np.ndarray]:
    """Random motion and force (20, 11) with means: nothing vanishes by symmetry."""
    rng = np.random.default_rng(0)
    return rng.normal(size=(20, 11)) * decay(5), rng.normal(size=(20, 11)) * decay(5)


def test_series_and_harmonics_agree(signals):
    u, f = signals
    T = synthesis(5, 64)
    a, b = from_series(u @ T.T, f @ T.T, OMEGA), from_harmonics(u, f, OMEGA)
    for name in ("stiffness", "damping", "constant"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-12)


def test_it_is_the_least_squares_fit(signals):
    u, f = signals
    T, ours = synthesis(5, 64), from_harmonics(u, f, OMEGA)
    for e in range(20):
        A = np.stack([T @ u[e], OMEGA * T @ derivative(u[e]), np.ones(64)], axis=1)
        K, C, constant = np.linalg.lstsq(A, T @ f[e], rcond=None)[0]
        assert (ours.stiffness[e], ours.damping[e], ours.constant[e]) == pytest.approx(
            (K, C, constant), rel=1e-10
        )


def test_work_is_equal_averaged_and_by_harmonic(signals):
    """Eq. 13. Eq. 16 as printed, without the factor k, misses the work by 3 to 10 times here."""
    u, f = signals
    averaged, each = from_harmonics(u, f, OMEGA), matrices_by_harmonic(u, f, OMEGA)
    np.testing.assert_allclose(work_of(averaged, u, OMEGA), work(u, f), rtol=1e-12)
    h = np.arange(1, 6)
    size = u[:, 1::2] ** 2 + u[:, 2::2] ** 2
    np.testing.assert_allclose(
        (np.pi * OMEGA * each.damping * h**2 * size).sum(1), work(u, f), rtol=1e-12
    )
    turned = u[:, 2::2] * f[:, 1::2] - u[:, 1::2] * f[:, 2::2]
    printed = turned.sum(1) / (OMEGA * (h * size).sum(1))
    wrong = np.pi * OMEGA * printed * (derivative(u)[:, 1:] ** 2).sum(1)
    assert np.median(np.abs(wrong / work(u, f) - 1)) > 0.1


def test_one_harmonic_gives_the_describing_function():
    w = np.zeros((1, 2, 3))
    w[0, 1, 1] = 2.5
    fit = from_harmonics(w[:, 1], evaluate_exact(single(), w).f[:, 1], OMEGA)
    closed = jenkins(2.5, 1.0, 1.0)
    assert fit.stiffness[0] == pytest.approx(closed.stiffness, abs=1e-12)
    assert OMEGA * fit.damping[0] == pytest.approx(closed.damping, abs=1e-12)


def test_friction_elements_have_damping_that_is_not_negative():
    elements, w = random_case(1, 200, 3, 1)
    fit = from_harmonics(w[:, 1], evaluate_exact(elements, w).f[:, 1], OMEGA)
    assert fit.damping.min() > -1e-13


def test_a_mean_displacement_belongs_to_the_constant():
    """K q0 + F_c0 is the mean force: with f_0 in place of F_c0 (Eq. 15) the mean would count K q0
    twice.
    """
    u, f = np.array([[0.7, 1.0, 0.0]]), np.array([[0.2, 0.5, -0.3]])
    fit = from_harmonics(u, f, OMEGA)
    assert fit.stiffness[0] * 0.7 + fit.constant[0] == pytest.approx(0.2, abs=1e-15)


def test_linear_force_of_a_series(signals):
    """K u + C du/dt + F_c0 at every sample; its work is that of the force."""
    u, f = signals
    T, fit = synthesis(5, 64), from_harmonics(u, f, OMEGA)
    expected = fit.stiffness[:, None] * (u @ T.T) + fit.damping[:, None] * OMEGA * (
        derivative(u) @ T.T
    )
    np.testing.assert_allclose(
        linear_force(fit, u @ T.T, OMEGA), expected + fit.constant[:, None], rtol=0, atol=1e-12
    )


def test_an_element_at_rest_has_none_and_leaves_the_others_theirs():
    u, f = (
        np.array([[1.0, 0.0, 0.0], [0.7, 1.0, 0.0]]),
        np.array([[0.3, 0.0, 0.0], [0.2, 0.5, -0.3]]),
    )
    T = synthesis(1, 8)
    for fit in (
        from_harmonics(u, f, OMEGA),
        from_series(u @ T.T, f @ T.T, OMEGA),
        matrices_by_harmonic(u, f, OMEGA),
    ):
        assert np.isnan(fit.stiffness[0]).all()
        assert np.isnan(fit.damping[0]).all()
        assert fit.stiffness[1] == pytest.approx(0.5)
        assert fit.damping[1] == pytest.approx(0.3 / OMEGA)
    np.testing.assert_allclose(
        work_of(from_harmonics(u, f, OMEGA), u, OMEGA), work(u, f), rtol=1e-12
    )


def test_a_harmonic_of_rounding_has_none():
    u, f = np.array([[0.0, 1.0, 0.0, 1e-17, 0.0]]), np.array([[0.0, 0.5, -0.3, 1e-16, 1e-16]])
    fit = matrices_by_harmonic(u, f, OMEGA)
    assert fit.stiffness[0, 0] == pytest.approx(0.5)
    assert np.isnan(fit.stiffness[0, 1])

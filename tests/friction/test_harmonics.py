"""Real and complex coefficients, synthesis and analysis."""

from __future__ import annotations

import numpy as np
import pytest

from bladefem.errors import InputError
from bladefem.friction.fourier import (
    analysis,
    derivative,
    sample_instants,
    synthesis,
    to_complex,
    to_real,
)
from bladefem.friction.trigonometric_tables import (
    empty_gram,
    gram_matrix,
    indicator_coefficients,
    trigonometric_tables,
)


def test_complex_amplitudes_and_back():
    c = np.random.default_rng(0).normal(size=(4, 2, 9))
    q = to_complex(c)
    np.testing.assert_allclose(to_real(q), c, rtol=0, atol=0)
    tau = 0.7
    value = (q * np.exp(1j * np.arange(5) * tau)).sum(-1).real
    phase = np.arange(1, 5) * tau
    expected = c[..., 0] + (c[..., 1::2] * np.cos(phase) + c[..., 2::2] * np.sin(phase)).sum(-1)
    np.testing.assert_allclose(value, expected, rtol=0, atol=1e-14)


def test_analysis_undoes_synthesis():
    np.testing.assert_allclose(analysis(6, 13) @ synthesis(6, 13), np.eye(13), atol=1e-14)


def test_derivative_of_the_motion():
    c = np.random.default_rng(1).normal(size=7)
    T, eps = (synthesis(3, 16, s) for s in (1e-5, -1e-5)), 2 * 2 * np.pi / 16 * 1e-5
    up, down = T
    np.testing.assert_allclose((up - down) @ c / eps, synthesis(3, 16) @ derivative(c), atol=1e-8)


def test_gram_of_a_set_is_analysis_of_synthesis_on_it():
    H, S = 4, 40
    chosen = np.random.default_rng(2).random(S) < 0.4
    wide = synthesis(2 * H, S)
    block, column = np.empty((2 * H + 1, 2 * H + 1)), np.empty(2 * H + 1)
    mean = wide[chosen].sum(0) / S
    gram_matrix(mean, empty_gram(H), block)
    indicator_coefficients(mean, column)
    expected = analysis(H, S)[:, chosen] @ synthesis(H, S)[chosen]
    np.testing.assert_allclose(block, expected, atol=1e-15)
    np.testing.assert_allclose(column, analysis(H, S)[:, chosen].sum(1), atol=1e-15)


def test_knots_have_the_samples_in_the_middle_of_their_edges():
    tab = trigonometric_tables(3, 20)
    np.testing.assert_allclose(
        0.5 * (tab.knots + np.roll(tab.knots, -1, axis=0)), tab.at, atol=1e-15
    )


def test_too_few_samples_and_odd_shapes_are_refused():
    with pytest.raises(InputError, match="samples"):
        trigonometric_tables(5, 20)
    with pytest.raises(InputError, match="2H"):
        to_complex(np.zeros(4))
    assert sample_instants(4)[1] == pytest.approx(np.pi / 2)

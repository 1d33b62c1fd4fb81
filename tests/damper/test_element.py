"""The paper's element figures against closed forms."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from verification.paper.element import coupled_loop, linear_fit, two_slope_loop, work


def test_fit_of_the_two_slope_loop_has_the_closed_form():
    k, limit, A = 5.0, 0.5, 1.0
    loop = two_slope_loop(k, limit, A, 16384)
    (fit, _), theta = linear_fit(loop), np.arccos(1 - 2 * limit / (k * A))
    assert fit.stiffness == pytest.approx(
        k / np.pi * (theta - np.sin(2 * theta) / 2), rel=1e-4
    )  # samples
    assert fit.damping == pytest.approx(k / np.pi * np.sin(theta) ** 2, rel=1e-4)
    assert fit.constant == pytest.approx(0, abs=1e-4)
    assert work(loop) == pytest.approx(4 * limit * (A - limit / k), rel=1e-4)


def test_fit_does_the_same_work():
    loop = coupled_loop(5.0, 0.5, (1.0, 0.6), 1.0, (1, 2), 8192)
    linear = trapezoid(linear_fit(loop)[1], loop.motion)
    assert linear == pytest.approx(work(loop), rel=1e-6)  # Eq. 13


def test_fit_is_the_best_linear_force():
    loop = coupled_loop(5.0, 0.5, (1.0, 0.6), 1.0, (1, 2), 4096)
    fit, linear = linear_fit(loop)
    rate = np.gradient(loop.motion, loop.angle)
    best = np.sum((loop.force - linear)[1:] ** 2)
    for K, C in ((1.02, 1.0), (0.98, 1.0), (1.0, 1.02), (1.0, 0.98)):
        other = K * fit.stiffness * loop.motion + C * fit.damping * rate + fit.constant
        assert np.sum((loop.force - other)[1:] ** 2) > best


def test_load_at_half_the_frequency_has_two_loops():
    loop = coupled_loop(5.0, 0.5, (1.0, 0.6), 1.0, (1, 2), 4096)
    half = loop.force[:2048] - loop.force[2048:4096]
    assert np.abs(half).max() > 0.3  # the two turns differ
    assert work(loop) == pytest.approx(
        2 * 4 * 0.5 * (1 - 0.1), rel=0.02
    )  # 3.55 against 3.6 with the mean load

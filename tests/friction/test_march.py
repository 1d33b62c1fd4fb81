"""Steps for time integration against the periodic kernels, and the limit of explicit integration."""

from __future__ import annotations

import numpy as np
import pytest
from friction_cases import coefficients, random_case

from bladefem.errors import InputError
from bladefem.friction.aft import evaluate
from bladefem.friction.events import evaluate_exact
from bladefem.friction.harmonics import synthesis
from bladefem.friction.march import check_step, stable_step, step_1d, step_2d


def marched(elements, w, samples, periods=4):
    """Tangential harmonics after marching all elements together."""
    T = synthesis(w.shape[2] // 2, samples)
    N, path = elements.n0[:, None] + elements.kn[:, None] * (w[:, 0] @ T.T), w[:, 1:] @ T.T
    flat = elements.tangents == 1
    f = np.zeros(len(N)) if flat else np.zeros((len(N), 2))
    out = np.empty((len(N), elements.tangents, samples))
    for _ in range(periods):
        for i in range(samples):
            dw = path[:, :, i] - path[:, :, i - 1]
            f = (step_1d(f, np.ascontiguousarray(dw[:, 0]), N[:, i - 1], N[:, i], elements.kt, elements.mu) if flat else
                 step_2d(f, np.ascontiguousarray(dw), N[:, i - 1], N[:, i], elements.kt, elements.mu))
            out[:, :, i] = f if not flat else f[:, None]
    return coefficients(out, w.shape[2] // 2)


def test_steps_of_1d_elements_reach_the_exact_harmonics():
    elements, w = random_case(0, 60, 2, 1)
    w[:, 1, 0] = 0
    forces = evaluate_exact(elements, w)
    slips = forces.shares[:, 1] > 0.05
    np.testing.assert_allclose(marched(elements, w, 1024)[slips, 0], forces.f[slips, 1], rtol=0, atol=2e-3)


def test_steps_of_2d_elements_reach_the_periodic_harmonics():
    elements, w = random_case(1, 60, 2, 2)
    forces = evaluate(elements, w, 2048)
    slips = forces.shares[:, 1] > 0.3
    assert slips.sum() > 20
    np.testing.assert_allclose(marched(elements, w, 4096)[slips], forces.f[slips, 1:], rtol=0, atol=5e-3)


def test_the_longest_explicit_step():
    """Central differences of m x'' + 2 k x = 0 stay bounded just below 2 / sqrt(2 k / m) and blow up just above."""
    m, k = 0.005, 1e8
    for factor, grows in ((0.999, False), (1.001, True)):
        dt = factor * stable_step(k, m)
        x = [1.0, 1.0]
        for _ in range(2000):
            x.append(2 * x[-1] - x[-2] - dt ** 2 * 2 * k / m * x[-1])
        assert (np.abs(x).max() > 1e6) == grows
    with pytest.raises(InputError, match="unstable"):
        check_step(1.001 * stable_step(k, m), k, m)
    check_step(0.999 * stable_step(k, m), k, m)

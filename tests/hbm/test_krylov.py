"""The compiled iterations against a dense solution, and many points at once against one after the other."""

import numpy as np
import pytest

from bladefem.hbm.api import solve, sticking
from bladefem.hbm.compiled import _jacobian
from bladefem.hbm.krylov import apply, conjugate_residuals
from bladefem.hbm.newton import Options
from bladefem.hbm.reference import reference_model
from bladefem.hbm.resonance import stuck_resonances
from bladefem.hbm.sweep import response


def system(strength, nodes=6, d=2, H=4):
    """A (H+1, m, m) Hermitian, C (nodes, dK, dK)."""
    rng = np.random.default_rng(3)
    m, K = nodes * d, 2 * H + 1
    A = rng.normal(size=(H + 1, m, m)) + 1j * rng.normal(size=(H + 1, m, m))
    A[0] = A[0].real
    return A / m, strength * rng.normal(size=(nodes, d * K, d * K)) / (d * K)


def test_the_jacobian_is_what_the_product_applies():
    A, C = system(1.0)
    J, K, size = _jacobian(A, C), 2 * len(A) - 1, C.shape[1]
    x = np.random.default_rng(4).normal(size=len(J))
    forces = np.concatenate([block @ x[i * size:(i + 1) * size] for i, block in enumerate(C)])
    out = x.reshape(-1, K).copy()
    apply(A, forces.reshape(-1, K), out)
    np.testing.assert_allclose(J @ x, out.ravel(), atol=1e-13)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-6])
def test_conjugate_residuals_reach_the_accuracy_or_say_no(accuracy):
    A, C = system(1.0)
    J = _jacobian(A, C)
    r, x = np.random.default_rng(5).normal(size=len(J)), np.empty(len(J))
    assert conjugate_residuals(A, C, r, accuracy, x)
    assert np.linalg.norm(J @ x - r) <= 1.01 * accuracy * np.linalg.norm(r)
    assert not conjugate_residuals(*system(100.0), r, accuracy, x)      # no 60 directions are enough there


def test_points_that_stick_are_the_same_at_once_and_one_by_one():
    """Up to the first frequency that slips; a sweep goes on from there, and comes to the same points."""
    model = reference_model(1e6, 0.06, 8.0, points=2, harmonics=7)
    omegas = stuck_resonances(model)[1] * np.linspace(0.9, 1.1, 60)
    frugal = Options(frugal=True)
    alone = [solve(model, omega, 7, 256, options=frugal) for omega in omegas]
    found = sticking(model, omegas, 7)
    assert 5 < len(found) < 60 and len(found) == [p.harmonics for p in alone].index(7)
    for one, other in zip(found, alone, strict=False):
        np.testing.assert_allclose(one.probe, other.probe, rtol=1e-12)
    for one, other in zip(response(model, omegas, 7, 256, options=frugal), alone, strict=True):
        np.testing.assert_allclose(one.probe[1], other.probe[1], rtol=1e-6)

"""An array of Jenkins elements is the partial slip of Cattaneo and Mindlin."""

from __future__ import annotations

import numpy as np
import pytest
from closed_forms import iwan_force, iwan_limits

from bladefem.data import Elements
from bladefem.friction.aft import evaluate
from bladefem.friction.kernel_1d_exact import evaluate_exact
from verification.paper.printed_laws import corrected

KT, LIMIT = 3.0, 2.0
GROSS = 1.5 * LIMIT / KT  # displacement at which the whole sphere slips [m]


def array(n: int) -> Elements:
    k, limit = iwan_limits(KT, LIMIT, n)
    return Elements(kt=k, kn=np.zeros(n), mu=np.full(n, 0.4), n0=limit / 0.4, tangents=1)


def together(elements: Elements, amplitude: float, H: int = 5) -> np.ndarray:
    w = np.zeros((elements.kt.size, 2, 2 * H + 1))
    w[:, 1, 1] = amplitude
    return w


def loop_energy(amplitude: float) -> float:
    """Masing loop of Cattaneo and Mindlin: W = 4 (2 int_0^A Q dw - Q(A) A), with the integral of Q
    by hand.
    """
    part = amplitude / GROSS
    integral = LIMIT * (amplitude - GROSS / 2.5 * (1 - (1 - part) ** 2.5))
    return 4 * (2 * integral - iwan_force(np.array(amplitude), KT, LIMIT) * amplitude)


def test_the_array_has_the_stiffness_and_the_limit_of_the_sphere():
    k, limit = iwan_limits(KT, LIMIT, 50)
    assert k.sum() == pytest.approx(KT)
    assert limit.sum() == pytest.approx(LIMIT)
    assert (limit > 0).all()


def test_first_loading_follows_cattaneo_and_mindlin():
    """200 elements: 2e-5 of the limit; the error falls with the power 1.5 of their number (root at
    gross slip).
    """
    worst = []
    for n in (50, 200):
        elements, path = array(n), np.linspace(0, 0.99 * GROSS, 400)
        total = sum(
            corrected(path, np.full(400, elements.n0[e]), elements.kt[e], elements.mu[e])
            for e in range(n)
        )
        worst.append(np.abs(total - iwan_force(path, KT, LIMIT)).max() / LIMIT)
    assert worst[1] < 3e-5
    assert worst[0] / worst[1] > 6


@pytest.mark.parametrize("part", [0.2, 0.5, 0.9])
def test_loop_energy_of_the_sphere(part):
    """Exact elements, 400 of them: 1e-3 of the closed form at all amplitudes (3 % asked)."""
    elements = array(400)
    forces = evaluate_exact(elements, together(elements, part * GROSS))
    assert forces.dissipated.sum() == pytest.approx(loop_energy(part * GROSS), rel=2e-3)


@pytest.mark.parametrize("part", [0.3, 0.8])
def test_the_stuck_share_is_that_of_the_sphere(part):
    """Radius of the stick zone c/a = (1 - Q/F)^{1/3}: what still sticks carries the tangent
    stiffness k c/a.
    """
    elements = array(400)
    stuck = evaluate_exact(elements, together(elements, part * GROSS)).shares[:, 1] == 0
    radius = (1 - iwan_force(np.array(part * GROSS), KT, LIMIT) / LIMIT) ** (1 / 3)
    assert elements.kt[stuck].sum() / KT == pytest.approx(radius, abs=0.003)


def test_plane_and_solid_arrays_agree():
    elements = array(30)
    w = together(elements, 0.7 * GROSS)
    solid = Elements(elements.kt, elements.kn, elements.mu, elements.n0, tangents=2)
    both = np.concatenate([w, np.zeros_like(w[:, :1])], axis=1)
    np.testing.assert_allclose(
        evaluate(solid, both, 1024).f[:, :2], evaluate_exact(elements, w).f, atol=2e-5
    )

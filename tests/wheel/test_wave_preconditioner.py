"""The preconditioner that couples harmonics: exact where nothing is mistuned and all modes count."""

import numpy as np
import pytest
from rings import EO, RIGID, N, elements, forces, ring_wheel

from bladefem.hbm.solver.newton import Options
from bladefem.wheel.contact_forces import contact_forces
from bladefem.wheel.flexibility import wheel_flexibility
from bladefem.wheel.model import Pattern
from bladefem.wheel.newton import contact_motions
from bladefem.wheel.solve import solve_wheel
from bladefem.wheel.wave_preconditioner import make_wave_preconditioner

H = 3


def product(wheel, flex, change, x):
    moved = (change @ x.reshape(*change.shape[:2], 1)).reshape(x.shape)
    return x + contact_motions(flex, moved)


@pytest.mark.parametrize("flow", [False, True])
@pytest.mark.parametrize("means", ["held", "free"])
def test_exact_inverse_for_a_tuned_wave(flow, means):
    own = elements(2, 0.5, 0.25, 0.3)
    influence = None
    if flow:
        modes = len(ring_wheel(own, RIGID, forces({1: 0.9})).sectors[0].omega)
        influence = np.zeros((N, modes), dtype=complex)
        influence[:, 0] = 0.05j * (1 + np.arange(N)) + 0.02 * np.arange(N)
    wheel = ring_wheel(own, RIGID, forces({1: 0.9}), influence=influence, coupled=means == "free")
    point = solve_wheel(wheel, 2.3, H, 240, options=Options(tolerance=1e-12))
    assert point.converged and (point.shares[..., 1] > 0).any()
    flex = wheel_flexibility(wheel, 2.3, H, Pattern())
    e = wheel.all_elements
    change = contact_forces(wheel, e, point.w, e.traction, 240).jacobian
    made = make_wave_preconditioner(flex, change, EO)
    x = np.random.default_rng(0).normal(size=point.w.shape)
    r = product(wheel, flex, change, x)
    assert np.linalg.norm(r - x) > 0.1 * np.linalg.norm(x)
    found = made.apply(r.reshape(N, -1, 2 * H + 1)).reshape(x.shape)
    np.testing.assert_allclose(found, x, atol=1e-9 * abs(x).max())

"""The preconditioner that couples harmonics and diameters: exact where all modes count and nothing
is flexible beside them.
"""

from dataclasses import replace

import numpy as np
import pytest
from rings import RIGID, N, elements, forces, ring_wheel

from bladefem.hbm.solver.newton import Options
from bladefem.wheel import coupled_preconditioner
from bladefem.wheel.contact_forces import contact_forces
from bladefem.wheel.coupled_preconditioner import make_coupled_preconditioner
from bladefem.wheel.flexibility import wheel_flexibility
from bladefem.wheel.model import Pattern
from bladefem.wheel.newton import contact_motions
from bladefem.wheel.solve import solve_wheel

H = 3


def mistuned_wheel():
    """Without residual flexibility, means held; every blade its own stiffness and mass."""
    wheel = ring_wheel(elements(2, 0.5, 0.25, 0.3), RIGID, forces({1: 0.9}), coupled=False)
    bodies = {
        d: replace(body, residual=np.zeros_like(body.residual)) for d, body in wheel.sectors.items()
    }
    rng = np.random.default_rng(1)
    q = len(range(*bodies[0].ports["blade"].indices(len(bodies[0].residual))))
    scatter = 0.1 * rng.normal(size=(2, N, q, q))
    pattern = Pattern(*(part + part.swapaxes(1, 2) for part in scatter))
    return replace(wheel, sectors=bodies), pattern


def test_exact_inverse_of_a_mistuned_wheel(monkeypatch):
    monkeypatch.setattr(coupled_preconditioner, "AMPLIFIED_MODE_LIMIT", 0.0)
    wheel, pattern = mistuned_wheel()
    point = solve_wheel(wheel, 2.3, H, 240, pattern=pattern, options=Options(tolerance=1e-10))
    assert point.converged and (point.shares[..., 1] > 0).any()
    flex = wheel_flexibility(wheel, 2.3, H, pattern)
    e = wheel.all_elements
    change = contact_forces(wheel, e, point.w, e.traction, 240).jacobian
    made = make_coupled_preconditioner(flex, change)
    x = np.random.default_rng(0).normal(size=point.w.shape)
    # means are held
    x[..., 0] = 0.0
    moved = (change @ x.reshape(*change.shape[:2], 1)).reshape(x.shape)
    r = x + contact_motions(flex, moved)
    assert np.linalg.norm(r - x) > 0.1 * np.linalg.norm(x)
    found = made.apply(r.reshape(N, -1, 2 * H + 1)).reshape(x.shape)
    np.testing.assert_allclose(found, x, atol=1e-9 * abs(x).max())


@pytest.mark.parametrize("means", ["free", "held"])
def test_not_made_where_it_cannot_help(monkeypatch, means):
    wheel, pattern = mistuned_wheel()
    wheel = replace(wheel, coupled=means == "free")
    if means == "held":
        monkeypatch.setattr(coupled_preconditioner, "AMPLIFIED_MODE_LIMIT", 1e9)
    flex = wheel_flexibility(wheel, 2.3, H, pattern)
    change = np.zeros((N * wheel.nodes, *2 * (wheel.directions * (2 * H + 1),)))
    assert make_coupled_preconditioner(flex, change) is None

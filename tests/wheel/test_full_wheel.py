"""The whole wheel against the tuned sector, and against one dense model of all sectors."""

import numpy as np
import pytest
from rings import (
    DAMPING,
    EO,
    MASS,
    RIGID,
    N,
    dense_ring,
    elastic_damper,
    elements,
    forces,
    ring_wheel,
    sector_bodies,
)

from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.reduction.assemble import wheel_models
from bladefem.wheel.model import Pattern
from bladefem.wheel.solve import solve_wheel

TIGHT = Options(tolerance=1e-12)
TURN = np.exp(2j * np.pi * EO / N * np.arange(N))
# tangential contacts with prescribed load; normal springs that stay closed; contacts that lift off
CASES = {
    "prescribed": (4, 0.0, 0.6, 0.4),
    "normal": (2, 2.0, 2.0, 0.1),
    "lift-off": (2, 0.5, 0.25, 0.3),
}
DAMPERS = {"rigid": RIGID, "elastic": elastic_damper(), "none": None}


def patterns(seed=3, scale=0.3):
    rng = np.random.default_rng(seed)
    dK = scale * rng.normal(size=(N, 2, 2))
    return dK + dK.swapaxes(1, 2), 0.1 * np.eye(2) * rng.normal(size=(N, 1, 1))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("damper", DAMPERS)
def test_tuned_wheel_is_the_sector_in_every_blade(case, damper):
    own = elements(*CASES[case])
    excitation = forces({1: 0.9})
    H = 3
    sector = ReducedModel(
        wheel_models(sector_bodies(), slice(2, 4), EO, N, H),
        own,
        {1: np.array([0.9])},
        DAMPING,
        (DAMPERS[damper],) if damper == "elastic" else DAMPERS[damper],
    )
    one = solve(sector, 2.3, H, 240, options=TIGHT)
    wheel = ring_wheel(own, DAMPERS[damper], excitation)
    all_blades = solve_wheel(wheel, 2.3, H, 240, options=TIGHT)
    assert one.converged and all_blades.converged, (one.reason, all_blades.reason)
    assert (all_blades.shares[..., 0] < 1).any()
    h = np.arange(H + 1)
    expected = TURN[:, None] ** h * one.probe[:, 0]
    np.testing.assert_allclose(
        all_blades.probe[:, :, 0], expected, atol=1e-9 * abs(one.probe).max()
    )


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("damper", DAMPERS)
def test_mistuned_wheel_is_the_dense_ring(case, damper):
    """Stiffness and mass deviations, two harmonics of force; the dense ring knows no diameters.

    Odd harmonics push dampers that only friction holds no way in the mean: under an even one they
    walk, which the wheel does not know.
    """
    own = elements(*CASES[case])
    excitation = forces({1: 0.9, 2 if own.kn.any() else 3: 0.3j})
    dK, dM = patterns()
    C = np.kron(np.eye(N), 0.05 * MASS)
    damping = Damping(mass=0.05)
    dense = dense_ring(own, DAMPERS[damper], excitation, Damping(), C, dK, dM)
    wheel = ring_wheel(own, DAMPERS[damper], excitation, damping)
    pattern = Pattern(dK, dM)
    whole = solve(dense, 2.3, 3, 240, options=TIGHT)
    found = solve_wheel(wheel, 2.3, 3, 240, pattern=pattern, options=TIGHT)
    assert whole.converged and found.converged, (whole.reason, found.reason)
    scale = abs(whole.probe).max()
    np.testing.assert_allclose(found.probe[:, :, 0].T, whole.probe, atol=1e-8 * scale)
    assert whole.work.dissipated > 0.01 * whole.work.input
    np.testing.assert_allclose(found.dissipated.sum(), whole.work.dissipated, rtol=1e-7)

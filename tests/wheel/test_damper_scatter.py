"""Dampers of different mass, load and friction forces against wheels that are given them one by
one.
"""

from dataclasses import replace

import numpy as np
import pytest
from rings import (
    RIGID,
    SKEW,
    TURNING,
    N,
    dense_ring,
    elastic_damper,
    elements,
    forces,
    rigid_dampers,
    ring_wheel,
    tiled,
)

from bladefem.data import RigidBody
from bladefem.errors import InputError
from bladefem.hbm.model import Damping, in_series
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.reduction.assemble import join_bodies
from bladefem.wheel.damper_law import scaled_elements
from bladefem.wheel.lumped import LumpedBlades, lumped_pattern, lumped_wheel
from bladefem.wheel.model import Pattern, heavier_damper
from bladefem.wheel.one_body import one_body_model
from bladefem.wheel.scatter import Scatter, drawn_patterns, with_dampers, with_tractions
from bladefem.wheel.solve import solve_wheel

TIGHT = Options(tolerance=1e-12)
OWN = elements(2, 2.0, 2.0, 0.1)
OMEGA, H, SAMPLES = 2.3, 3, 240
# one damper heavier by a half, one lighter
FACTORS = np.array([1.0, 1.5, 1.0, 1.0, 0.7, 1.0])
UNDAMPED = Damping()


def dense_with(damper, factors, loads, start=None):
    """The dense ring whose dampers are given one by one."""
    C = np.kron(np.eye(N), 0.05 * np.diag([1.0, 1.0, 2.0]))
    dense = dense_ring(OWN, None, forces({1: 0.9}), UNDAMPED, C)
    if isinstance(damper, RigidBody):
        bodies = rigid_dampers(damper, factors)
    else:
        bodies = (
            join_bodies(
                tuple(
                    elastic_damper(None if damper.damping is None else f * SKEW, f) for f in factors
                )
            ),
        )
    e = tiled(OWN)
    heavier = replace(e, n0=np.repeat(loads, 2) * e.n0)
    return replace(dense, damper=bodies, elements=heavier, start=start)


def wheel_of(damper):
    return ring_wheel(OWN, damper, forces({1: 0.9}), Damping(mass=0.05))


@pytest.mark.parametrize(
    "damper",
    [RIGID, elastic_damper(), TURNING, elastic_damper(SKEW)],
    ids=["rigid", "elastic", "turning rigid", "turning elastic"],
)
def test_heavier_damper_is_the_one_given_explicitly(damper):
    """Inertia and load of one damper half as high again, of another one lower."""
    wheel = wheel_of(damper)
    pattern = with_dampers(wheel, Pattern(), {"load": FACTORS, "mass": FACTORS})
    found = solve_wheel(wheel, OMEGA, H, SAMPLES, pattern=pattern, options=TIGHT)
    whole = solve(dense_with(damper, FACTORS, FACTORS), OMEGA, H, SAMPLES, options=TIGHT)
    assert found.converged and whole.converged, (found.reason, whole.reason)
    scale = abs(whole.probe).max()
    np.testing.assert_allclose(found.probe[:, :, 0].T, whole.probe, atol=1e-8 * scale)
    one = solve(one_body_model(wheel, pattern, True), OMEGA, H, SAMPLES, options=TIGHT)
    np.testing.assert_allclose(one.probe, whole.probe, atol=1e-8 * scale)
    # inertia counts beside the load
    loads = with_dampers(wheel, Pattern(), {"load": FACTORS})
    light = solve_wheel(wheel, OMEGA, H, SAMPLES, pattern=loads, options=TIGHT)
    assert abs(light.probe - found.probe).max() > 1e-3 * scale


def test_stiffness_of_a_layer_of_which_a_part_is_in_series():
    """Softer elements and the rest of the layer among the sectors: the same wheel, and the same
    scatter of the stiffness of the whole layer.
    """
    stiff = elements(2, 2.0, 6.0, 2.0)
    whole = ring_wheel(stiff, RIGID, forces({1: 0.9}), Damping(mass=0.05))
    soft = replace(stiff, kt=0.4 * stiff.kt, kn=0.7 * stiff.kn)
    series = np.column_stack([1 / stiff.kn - 1 / soft.kn, 1 / stiff.kt - 1 / soft.kt])
    sectors = {d: in_series(body, series) for d, body in whole.sectors.items()}
    split = replace(whole, elements=soft, sectors=sectors, series=series)
    factors = {"stiffness": np.array([1.0, 1.3, 0.8, 1.0, 1.1, 0.9])}
    tuned, found = [], []
    for wheel in (whole, split):
        scattered = with_dampers(wheel, Pattern(), factors)
        tuned.append(solve_wheel(wheel, OMEGA, 1, SAMPLES, options=TIGHT))
        found.append(solve_wheel(wheel, OMEGA, 1, SAMPLES, pattern=scattered, options=TIGHT))
    for one, other in (tuned, found):
        # sticking all along
        assert one.converged and other.converged and one.shares[..., 0].min() > 0.999
        scale = abs(one.probe).max()
        np.testing.assert_allclose(other.probe, one.probe, atol=1e-10 * scale)
    assert abs(found[0].probe - tuned[0].probe).max() > 1e-2 * abs(tuned[0].probe).max()
    law = scaled_elements(split, "stiffness", 1.3)
    np.testing.assert_allclose(1 / law.kt + series[:, 1], 1 / (1.3 * stiff.kt))
    np.testing.assert_allclose(1 / law.kn + series[:, 0], 1 / (1.3 * stiff.kn))
    with pytest.raises(InputError, match=r"series of shape \(2,\): expected \(2, 2\)"):
        replace(split, series=np.zeros(2))


def test_density_of_an_elastic_damper():
    """Its modes are those of matrices whose mass is half as large again."""
    from bladefem.reduction.matrices import port_model_from_matrices

    contact = np.array([[1.0, 0.1], [-0.3, 0.9], [0.8, 0.3], [0.2, -1.0]])
    K = np.array([[1.5, -1.5], [-1.5, 1.5]])
    dense = port_model_from_matrices(1.5 * np.diag([0.3, 0.2]), K, {"contact": contact})
    found = heavier_damper(elastic_damper(), 1.5)
    np.testing.assert_allclose(found.omega, dense.omega, atol=1e-7)
    own, other = (b.shapes[:, 1:] @ b.shapes[:, 1:].T for b in (found, dense))
    np.testing.assert_allclose(own, other, atol=1e-12)


@pytest.mark.parametrize("damper", [RIGID, elastic_damper()], ids=["rigid", "elastic"])
def test_no_scatter_is_the_tuned_wheel(damper):
    """Deviations that are all zero, in every blade."""
    wheel = wheel_of(damper)
    ones = np.ones(N)
    pattern = with_dampers(wheel, Pattern(), {"load": ones, "mass": ones})
    pattern = with_tractions(wheel, pattern, np.zeros((N, 2)))
    # zeros that go all the way through the deviations' system
    pattern = replace(pattern, damper_mass=np.full(N, 1e-300))
    tuned = solve_wheel(wheel, OMEGA, H, SAMPLES, options=TIGHT)
    found = solve_wheel(wheel, OMEGA, H, SAMPLES, pattern=pattern, options=TIGHT)
    assert tuned.converged and found.converged
    scale = abs(tuned.probe).max()
    np.testing.assert_allclose(found.probe, tuned.probe, atol=1e-9 * scale)


def test_friction_forces_of_the_history_are_those_given_explicitly():
    """A damper whose contacts start near their limit slips on one side."""
    wheel = replace(wheel_of(RIGID), coupled=False)
    share = np.zeros((N, 2))
    share[2, 0] = 0.9
    pattern = with_tractions(wheel, Pattern(), share)
    limit = tiled(OWN).mu * tiled(OWN).n0
    np.testing.assert_allclose(pattern.start[4:6, 0], 0.9 * limit[4:6])
    dense = replace(dense_with(RIGID, np.ones(N), np.ones(N), pattern.start), coupled=False)
    found = solve_wheel(wheel, OMEGA, H, SAMPLES, pattern=pattern, options=TIGHT)
    whole = solve(dense, OMEGA, H, SAMPLES, options=TIGHT)
    assert found.converged and whole.converged
    scale = abs(whole.probe).max()
    # means are held: the dense ring reports them, the wheel leaves them out
    np.testing.assert_allclose(found.probe[:, 1:, 0].T, whole.probe[1:], atol=1e-8 * scale)
    # beyond the limit there is nothing
    far = with_tractions(wheel, pattern, share)
    assert np.linalg.norm(far.start, axis=1).max() <= limit.max() * (1 + 1e-12)


def test_mass_scatters_inertia_and_load_alike():
    blades = LumpedBlades()
    wheel = replace(
        lumped_wheel(blades, 9, 1.0, 1e5, 3.0), damper=RigidBody(np.eye(1), np.ones((1, 1)))
    )
    drawn = drawn_patterns(wheel, Scatter(0.0, mass=0.05), 64, lambda d: lumped_pattern(blades, d))
    mass = np.array([p.damper_mass for p in drawn])
    assert abs(mass.std() - 0.05) < 3e-3
    loads = np.array([p.elements.n0 for p in drawn])
    np.testing.assert_allclose(loads, 3.0 * (1 + mass))
    leaning = drawn_patterns(
        wheel, Scatter(0.0, traction=0.5), 64, lambda d: lumped_pattern(blades, d)
    )
    start = np.array([p.start for p in leaning])
    assert 0.4 * 3.0 < abs(start).max() <= 0.5 * 3.0 and abs(start.mean()) < 0.02
    with pytest.raises(InputError, match=r"scatter.traction 1.5: expected a share from 0 to 1"):
        Scatter(traction=1.5)
    with pytest.raises(InputError, match=r"damper_mass: expected 36 relative deviations above -1"):
        solve_wheel(wheel, 2900.0, 1, 16, pattern=Pattern(damper_mass=np.full(36, -1.0)))

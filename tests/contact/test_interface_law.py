"""The interface layer in series with the bodies: its closed forms, its limits, and the seating on
it.
"""

from dataclasses import replace

import numpy as np
import pytest
from seated_wedge import ALPHA, SPEED, condensed
from wedge import wedge_mesh

from bladefem.contact.interface_elements import friction_elements, interface_law, with_interface_law
from bladefem.contact.interface_law import (
    InterfaceLaw,
    closure_of,
    compliance_at,
    force_of,
    rigid_faces,
    stiffness_at,
)
from bladefem.contact.seating import solve_seating
from bladefem.errors import InputError
from bladefem.scene.tables import Contact

LAYERS = {
    "linear": Contact(kn_area=4e10),
    "stiffening": Contact(kn_area=4e10, stiffening=2e5),
    "stiff": Contact(kn_area=1e14),
    "rigid": Contact(stiffness="map"),
}


@pytest.fixture(scope="module")
def problem():
    return condensed(wedge_mesh(ALPHA))


def test_force_and_closure_are_inverse_and_the_stiffness_is_the_slope():
    law = InterfaceLaw(np.array([2.0, 2.0]), np.array([np.inf, 3.0]))
    closure = np.array([1.5, 1.5])
    assert force_of(law, closure) == pytest.approx([3.0, 3.0 * np.expm1(1.0)], rel=1e-15)
    assert closure_of(law, force_of(law, closure)) == pytest.approx(closure, rel=1e-14)
    step = 1e-6
    slope = (force_of(law, closure + step) - force_of(law, closure - step)) / (2 * step)
    assert stiffness_at(law, force_of(law, closure)) == pytest.approx(slope, rel=1e-8)
    assert compliance_at(law, np.array([0.0, 3.0])) == pytest.approx([0.5, 0.25])
    assert (force_of(law, -closure) == 0).all()
    assert (closure_of(rigid_faces(2), closure) == 0).all()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_layer_whose_force_does_not_grow_is_refused(value):
    with pytest.raises(InputError, match="InterfaceLaw.stiffness"):
        InterfaceLaw(np.array([1.0, value]), np.full(2, np.inf))
    with pytest.raises(InputError, match="InterfaceLaw.doubling"):
        InterfaceLaw(np.ones(2), np.array([np.inf, value]))


@pytest.mark.parametrize("name", LAYERS)
def test_the_seated_state_obeys_the_law_and_the_bodies(problem, name):
    """Judged by the equations themselves: what the bodies leave open is what the layer closes."""
    bedded = with_interface_law(problem, LAYERS[name], 0.8)
    maps = solve_seating(bedded, SPEED, normal=80.0)
    force = np.concatenate([m.force for m in maps])
    gap = np.concatenate([m.gap for m in maps])
    opening = gap - closure_of(bedded.law, force)
    # what is left after some rigid motion of the damper and some share of its unit load
    shares = np.column_stack(
        [problem.rigid, problem.damper_swell / np.abs(problem.damper_swell).max()]
    )
    rest = opening - problem.flexibility @ force
    rest -= problem.clearance + SPEED**2 * problem.blade_swell
    motion = np.linalg.lstsq(shares, rest, rcond=None)[0]
    assert np.abs(shares @ motion - rest).max() < 1e-9 * np.abs(opening).max()
    assert force_of(bedded.law, -opening)[gap == 0] == pytest.approx(
        force[gap == 0] if name != "rigid" else np.full((gap == 0).sum(), np.nan),
        rel=1e-6,
        nan_ok=True,
    )
    assert sum(force) == pytest.approx(160.0, rel=1e-9)


def test_rigid_faces_are_the_limit_of_stiff_layers(problem):
    """The map converges in proportion to the compliance of the layer."""
    exact = pressed(problem)
    apart = [
        np.abs(pressed(with_interface_law(problem, Contact(kn_area=k), 0.8)) - exact).max()
        / exact.max()
        for k in (1e15, 1e16, 1e17)
    ]
    assert apart[0] < 0.05
    assert apart[1] / apart[0] == pytest.approx(0.1, rel=0.3)
    assert apart[2] / apart[1] == pytest.approx(0.1, rel=0.3)


def test_a_soft_layer_presses_evenly(problem):
    """E* / kn of 115 m: flat seats whose damper does not tilt share the load by area."""
    soft = with_interface_law(problem, Contact(kn_area=1e9), 0.8)
    for m in solve_seating(soft, 0.0, normal=80.0, bedded=True):
        assert np.ptp(m.pressure) < 2e-3 * m.pressure.mean()


def test_a_layer_that_hardly_stiffens_is_linear(problem):
    linear, almost = (
        pressed(with_interface_law(problem, Contact(kn_area=4e10, stiffening=p), 0.8))
        for p in (None, 1e12)
    )
    assert np.abs(linear - almost).max() < 1e-6 * linear.max()


@pytest.mark.parametrize("name", ["linear", "stiffening", "stiff"])
def test_elements_rest_in_the_seated_state(problem, name):
    """Their force at rest is the seated one, n0 = kn closure about it, open nodes keep their
    gap.
    """
    contact = LAYERS[name]
    bedded = with_interface_law(problem, contact, 0.8)
    maps = solve_seating(bedded, SPEED, normal=80.0)
    force = np.concatenate([m.force for m in maps])
    gap = np.concatenate([m.gap for m in maps])
    e, _ = friction_elements(bedded, maps, contact, 0.8)
    np.testing.assert_array_equal(np.maximum(e.n0, 0.0), force)
    np.testing.assert_allclose(e.kn, stiffness_at(bedded.law, force), rtol=1e-12)
    np.testing.assert_allclose(-e.n0[force == 0] / e.kn[force == 0], gap[force == 0], rtol=1e-12)
    np.testing.assert_allclose(e.kt, 0.8 * e.kn, rtol=1e-12)


def test_values_of_one_seat_reach_its_layer(problem):
    contact = Contact(kn_area=4e10, left=replace(Contact().left, kn=1e6))
    area = [p.area for p in problem.patches]
    law = interface_law(problem.patches, contact, 0.8)
    own, following = np.split(law.stiffness, 2)
    np.testing.assert_allclose(own, 4e10 * area[0], rtol=1e-14)
    np.testing.assert_allclose(following, 1e6 * area[1] / area[1].sum(), rtol=1e-14)


def pressed(problem):
    return np.concatenate([m.force for m in solve_seating(problem, SPEED, normal=80.0)])

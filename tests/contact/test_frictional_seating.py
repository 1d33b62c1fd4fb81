"""A damper seated with friction: statics, the closed form of a wedge, and what a history leaves."""

from dataclasses import replace

import numpy as np
import pytest
from seated_wedge import ALPHA, SPEED, condensed_both_ways

from bladefem.contact.admissible_load import holds_itself, normal_load_bounds
from bladefem.contact.condensed_bodies import hold_axially
from bladefem.contact.frictional_seating import (
    seat_with_friction,
)
from bladefem.contact.interface_law import InterfaceLaw
from bladefem.contact.rough_layer import TOUCHING_PRESSURE, decay_length
from bladefem.contact.seating import solve_seating
from bladefem.errors import InputError, NotSolvedError

MU = 0.3


@pytest.fixture(scope="module", params=[2, 3])
def problems(request):
    return condensed_both_ways(request.param)


def layer(problem, kn=5e13, kt=4e13):
    area = np.concatenate([p.area for p in problem.patches])
    count = len(area)
    return InterfaceLaw(kn * area, np.full(count, np.inf)), kt * area


def pull_of(problem):
    return float(np.linalg.norm(problem.load[:2])) * SPEED**2


def seated(problem, mu=MU, speeds=(SPEED,), bedded=True, normal=None, **stiffness):
    law, kt = layer(problem, **stiffness)
    return seat_with_friction(problem, law, kt, np.full(len(kt), mu), speeds, normal, bedded)


def forces_of(found):
    return np.concatenate([np.column_stack([m.force, m.traction]) for m in found.maps])


def test_without_friction_it_is_the_frictionless_seating(problems):
    rough, smooth = problems
    law, _ = layer(rough)
    plain = solve_seating(replace(smooth, layer=law), SPEED)
    found = seated(rough, mu=1e-4, bedded=False)
    for rubbed, free in zip(found.maps, plain, strict=True):
        assert rubbed.force == pytest.approx(free.force, rel=5e-3, abs=1e-3 * free.force.max())


@pytest.mark.parametrize("speeds", [(SPEED,), (SPEED, 1.2 * SPEED, SPEED)])
def test_no_friction_at_all_is_the_frictionless_seating(problems, speeds):
    """Nothing then holds the damper along the engine axis, and no history remains."""
    rough, smooth = problems
    law, _ = layer(rough)
    plain = solve_seating(replace(smooth, layer=law), SPEED)
    found = seated(rough, mu=0.0, speeds=speeds, bedded=False)
    for rubbed, free in zip(found.maps, plain, strict=True):
        assert rubbed.force == pytest.approx(free.force, rel=1e-7, abs=1e-7 * free.force.max())
    assert found.change == 0.0 and abs(found.share) < 1e-9


def test_the_damper_is_in_equilibrium_and_no_force_exceeds_its_limit(problems):
    rough, _ = problems
    for bedded in (True, False):
        found = seated(rough, bedded=bedded)
        f = forces_of(found)
        unbalanced = rough.rigid.T @ f.ravel() + SPEED**2 * rough.load
        assert np.abs(unbalanced).max() < 1e-8 * pull_of(rough)
        assert (f[:, 0] >= 0).all()
        assert (np.linalg.norm(f[:, 1:], axis=1) <= MU * f[:, 0] * (1 + 1e-7) + 1e-7).all()


def test_a_wedge_that_slides_outwards_carries_the_closed_form(problems):
    """Spin-up of a bedded wedge on a soft layer mobilises friction fully:
    N = F / (2 (sin a + mu cos a)).
    """
    rough, _ = problems
    found = seated(rough, kn=5e10, kt=4e10)
    expected = pull_of(rough) / (2 * (np.sin(ALPHA) + MU * np.cos(ALPHA)))
    for one in found.maps:
        assert one.force.sum() == pytest.approx(expected, rel=2e-3)
    carried = MU * np.cos(ALPHA) / (np.sin(ALPHA) + MU * np.cos(ALPHA))
    assert found.share == pytest.approx(carried, rel=5e-3)
    # mirror images: down the slope on both faces, against the way out; t1 runs up it on this one
    slope = np.array([one.traction[:, 0].sum() for one in found.maps])
    np.testing.assert_allclose(slope, np.array([-MU, MU]) * expected, rtol=3e-3)


def test_a_layer_that_stiffens_a_thousandfold_is_pressed_on(problems):
    """Rough faces under 10 MPa, run up beyond the speed and back, so that the wedge slides inwards:
    N = F / (2 (sin a - mu cos a)).
    """
    rough, _ = problems
    area = np.concatenate([p.area for p in rough.patches])
    kn = TOUCHING_PRESSURE / decay_length(3.2e-6)
    law = InterfaceLaw(kn * area, TOUCHING_PRESSURE * area)
    mu = np.full(len(area), 0.1)
    speeds = (SPEED, 1.5 * SPEED, SPEED)
    found = seat_with_friction(rough, law, 0.8 * kn * area, mu, speeds, bedded=True)
    expected = pull_of(rough) / (2 * (np.sin(ALPHA) - 0.1 * np.cos(ALPHA)))
    for one in found.maps:
        assert one.force.sum() == pytest.approx(expected, rel=1e-3)


def test_every_history_stays_between_the_closed_forms(problems):
    rough, _ = problems
    low = pull_of(rough) / (2 * (np.sin(ALPHA) + MU * np.cos(ALPHA)))
    high = pull_of(rough) / (2 * (np.sin(ALPHA) - MU * np.cos(ALPHA)))
    normal = []
    for overspeed in (1.0, 1.2, 3.0):
        found = seated(rough, speeds=(overspeed * SPEED, SPEED), kn=5e10, kt=4e10)
        load = np.mean([m.force.sum() for m in found.maps])
        assert low * (1 - 1e-6) <= load <= high * (1 + 1e-6)
        normal.append(load)
    # the further beyond, the more friction has turned round on the way back
    assert normal[0] < normal[1] < normal[2]
    assert normal[2] == pytest.approx(high, rel=1e-2)


def test_a_wanted_load_is_met_and_scales(problems):
    rough, _ = problems
    found = seated(rough, normal=100.0)
    twice = seated(rough, normal=200.0)
    assert np.mean([m.force.sum() for m in found.maps]) == pytest.approx(100.0, rel=1e-8)
    assert forces_of(twice) == pytest.approx(2 * forces_of(found), rel=1e-5, abs=1e-4)
    assert twice.scale == pytest.approx(2 * found.scale, rel=1e-6)


def test_histories_that_press_nothing_are_refused(problems):
    rough, _ = problems
    with pytest.raises(InputError, match="all positive: at rest nothing presses"):
        seated(rough, speeds=(SPEED, 0.0))


def test_a_history_that_lifts_the_damper_says_at_which_speed(problems):
    rough, _ = problems
    inwards = replace(rough, load=-rough.load)
    with pytest.raises(NotSolvedError, match=r"at .* rpm on the way to 7639.4 rpm"):
        seated(inwards)


def test_bounds_of_the_load_are_those_of_the_wedge(problems):
    rough, _ = problems
    mu = np.full(len(rough.clearance), MU)
    low, high = normal_load_bounds(rough.rigid, SPEED**2 * rough.load, mu)
    pull = pull_of(rough)
    assert low == pytest.approx(pull / (2 * (np.sin(ALPHA) + MU * np.cos(ALPHA))), rel=1e-3)
    assert high == pytest.approx(pull / (2 * (np.sin(ALPHA) - MU * np.cos(ALPHA))), rel=1e-3)


@pytest.mark.parametrize(("mu", "jams"), [(0.3, False), (0.82, False), (0.86, True)])
def test_seats_jam_beyond_the_self_locking_angle(problems, mu, jams):
    """tan 40 deg = 0.839; the pyramid of 16 edges has one along the slope."""
    rough, _ = problems
    friction = np.full(len(rough.clearance), mu)
    assert holds_itself(rough.rigid, friction) == jams
    if jams:
        assert normal_load_bounds(rough.rigid, rough.load, friction)[1] == np.inf


def test_a_stop_along_the_axis_takes_the_load_along_it(problems):
    """Without an axial load it changes nothing; a tenth of the load along the axis slides a free
    damper out, and leaves a held one as it is. Plane dampers have no such motion.
    """
    rough, smooth = problems
    if len(rough.load) == 3:
        with pytest.raises(InputError, match='damper.axial = "held": a plane damper'):
            hold_axially(smooth)
        return
    plain = np.concatenate([m.force for m in solve_seating(smooth, SPEED)])
    held = np.concatenate([m.force for m in solve_seating(hold_axially(smooth), SPEED)])
    np.testing.assert_allclose(held, plain, rtol=0, atol=1e-9 * plain.max())
    axial = np.zeros(6)
    axial[2] = 0.1 * np.linalg.norm(rough.load[:2])
    pushed = replace(smooth, load=smooth.load + axial)
    with pytest.raises(NotSolvedError, match="frictionless seats can't hold"):
        solve_seating(pushed, SPEED)
    stopped = np.concatenate([m.force for m in solve_seating(hold_axially(pushed), SPEED)])
    np.testing.assert_allclose(stopped, plain, rtol=0, atol=1e-9 * plain.max())
    one, other = (
        forces_of(seated(hold_axially(replace(rough, load=rough.load + x))))
        for x in (0 * axial, axial)
    )
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.abs(one).max())

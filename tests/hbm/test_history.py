"""Static friction forces as the history left them: nodes that never slip keep them, others forget
them; and what they leave open of a resonance.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from models import block, wedge_between_masses
from plain import marched_wedge

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.fourier import synthesis
from bladefem.hbm.history_interval import MONOTONE, POINT, SAMPLED, history_interval
from bladefem.hbm.linear_resonances import stuck_resonances
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.parameters import vary
from bladefem.hbm.peak import find_peak
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.hbm.solver.residual import contact_forces
from bladefem.hbm.traction_gradient import admissible_tractions, farthest_start

LINEAR = Options(tolerance=1e-12)


def on_ground(tangents, t0, n0=1.0):
    """One element between a heavy mass and the ground."""
    model = block(1, damper=False)
    elements = replace(
        model.elements, kt=np.array([2.0]), kn=np.array([3.0]), mu=np.array([0.5]), t0=t0
    )
    elements = replace(elements, n0=np.array([n0]), tangents=tangents)
    if tangents == 2:
        return replace(model, elements=elements)
    side = model.sides[0]
    rows = np.r_[0, 1, 3 : len(side.residual)]
    ports = {"contact": slice(0, 2), "load": slice(2, 3), "probe": slice(3, 5)}
    side = replace(
        side, shapes=side.shapes[rows], residual=side.residual[np.ix_(rows, rows)], ports=ports
    )
    return replace(model, sides=(side,), elements=elements)


def marched(element, start, w, periods=40, samples=4096):
    """(tangents, samples) friction force of the last of some periods by a plain return map."""
    motion = w @ synthesis(w.shape[1] // 2, samples).T
    normal = np.maximum(element.n0[0] + element.kn[0] * motion[0], 0.0)
    force = start + element.kt[0] * motion[1:, 0]
    kept = np.empty((len(motion) - 1, samples))
    for step in range(periods * samples):
        now = step % samples
        if step:
            force = force + element.kt[0] * (motion[1:, now] - motion[1:, now - 1])
        limit = element.mu[0] * normal[now]
        length = np.linalg.norm(force)
        force = force * min(1.0, limit / max(length, 1e-300))
        kept[:, now] = force
    return kept


@pytest.mark.parametrize("tangents", [1, 2])
@pytest.mark.parametrize("travel", [0.02, 0.6])
def test_the_march_starts_from_the_static_friction_force(tangents, travel):
    t0 = np.array([[0.2, -0.1][:tangents]])
    model = on_ground(tangents, t0)
    w = np.zeros((1, 1 + tangents, 5))
    w[0, 0, 1] = 0.05
    w[0, 1, :3] = 0.02, travel, travel
    w[0, -1, 2] += 0.3 * travel
    forces = contact_forces(model, w, 4096)
    plain = marched(model.elements, t0[0], w[0], periods=3 if tangents == 1 else 12)
    mean = plain.mean(axis=1)
    assert forces.f[0, 1:, 0] == pytest.approx(mean, abs=2e-4)
    sticks = forces.shares[0, 1] == 0
    assert sticks == (travel == 0.02)
    if sticks:
        assert forces.f[0, 1:, 0] == pytest.approx(t0[0] + 2.0 * w[0, 1:, 0], abs=1e-12)
    else:
        forgotten = contact_forces(on_ground(tangents, None), w, 4096)
        assert forces.f == pytest.approx(forgotten.f, abs=1e-9)


def test_exact_events_start_from_it_as_well():
    model = on_ground(1, np.array([[0.2]]))
    w = np.zeros((1, 2, 5))
    w[0, 1, :3] = 0.02, 0.02, 0.02
    exact = contact_forces(model, w, 0)
    assert exact.f == pytest.approx(contact_forces(model, w, 256).f, abs=1e-12)


def test_without_excitation_the_model_rests_in_the_preload_state():
    model = wedge_between_masses(excited=False)
    model = replace(model, elements=replace(model.elements, t0=np.array([[20.0], [-15.0]])))
    found = solve(replace(model, excitation={1: np.array([1e-9])}), 200.0)
    assert found.converged
    assert np.abs(found.w[:, :, 0]).max() < 1e-16
    assert found.f[:, 0, 0] == pytest.approx(model.elements.n0, rel=1e-12)
    assert found.f[:, 1, 0] == pytest.approx([20.0, -15.0], rel=1e-12)


@pytest.mark.parametrize("t0", [(-40.0, 30.0), (20.0, 5.0)])
def test_marching_in_time_ends_where_the_balance_with_its_tractions_is(t0):
    model = wedge_between_masses(60.0, damping=200.0)
    model = replace(model, elements=replace(model.elements, t0=np.array(t0)[:, None]))
    omega = 2 * np.pi * 57.0
    moved, carried, slips = marched_wedge(model, omega, periods=50, ramp=15)
    assert slips.sum() == 1
    settled = replace(model, start=model.elements.traction + 0.0)
    sticking = ~slips
    # what the march left in the contact that never slips, counted at zero displacement
    found = solve(settled, omega, 15, 1024)
    for _ in range(20):
        start = settled.start.copy()
        start[sticking, 0] += carried[sticking, 1] - found.f[sticking, 1, 0]
        settled = replace(settled, start=start)
        found = solve(settled, omega, 15, 1024, start=found)
    line = np.fft.rfft(moved)[1] * 2 / len(moved)
    assert found.converged and found.states["slip"] == 1
    assert found.f[:, :, 0] == pytest.approx(carried, rel=2e-3, abs=0.2)
    assert abs(found.probe[1, 0]) == pytest.approx(abs(line), rel=1e-3)
    # the traction matters: without it the same point is elsewhere
    without = replace(model, elements=replace(model.elements, t0=None))
    assert size(solve(without, omega, 15, 1024)) != pytest.approx(abs(line), rel=1e-3)


@pytest.mark.parametrize("name", ["load", "mu", "kt", "kn", "omega"])
def test_sensitivities_know_the_static_friction_force(name):
    model = wedge_between_masses(10.0)
    model = replace(model, elements=replace(model.elements, t0=np.array([[20.0], [-15.0]])))
    omega = 2 * np.pi * 56.6
    point = solve(model, omega, 3, 0, options=LINEAR)
    assert point.states["slip"] == 1 and point.states["stick"] == 1
    exact = sensitivities(model, point, [name])[name].size[0]
    h = 1e-5
    if name == "omega":
        ends = [solve(model, omega + sign * h, 3, 0, options=LINEAR) for sign in (1, -1)]
        width = 2 * h
    else:
        varied = [vary(model, name, factor) for factor in (1 + h, 1 - h)]
        ends = [solve(one, omega, 3, 0, start=point, options=LINEAR) for one in varied]
        width = np.log((1 + h) / (1 - h))
    assert exact == pytest.approx((size(ends[0]) - size(ends[1])) / width, rel=2e-3)


def test_the_derivative_by_the_start_is_that_of_differences():
    model = wedge_between_masses(10.0)
    omega = 2 * np.pi * 56.6
    point = solve(model, omega, 3, 0, options=LINEAR)
    found = admissible_tractions(model, point)
    assert len(found.nodes) == 1
    ends = []
    for step in (0.01, -0.01):
        start = np.zeros((2, 1))
        start[found.nodes] = step
        ends.append(size(solve(replace(model, start=start), omega, 3, 0, options=LINEAR)))
    assert found.gradient[found.nodes[0], 0] == pytest.approx((ends[0] - ends[1]) / 0.02, rel=1e-3)


def test_the_farthest_admissible_forces_keep_every_node_in_stick():
    model = block(3, n0=4.0, force=0.4, mu=0.4)
    point = solve(model, 1.3, 3, 128)
    assert point.states["stick"] == 3
    found = admissible_tractions(model, point)
    for seed in range(4):
        direction = np.random.default_rng(seed).normal(size=(3, 2))
        move = farthest_start(model, found, direction)
        # the polygon is 3.5 % too wide
        inside = solve(replace(model, start=0.93 * move), 1.3, 3, 128)
        assert inside.f[:, 1:, 0] - 0.93 * move == pytest.approx(
            model.elements.kt[:, None] * inside.w[:, 1:, 0], abs=1e-9
        )
        beyond = solve(replace(model, start=1.05 * move), 1.3, 3, 128)
        kept = beyond.f[:, 1:, 0] - model.elements.kt[:, None] * beyond.w[:, 1:, 0]
        assert np.abs(kept - 1.05 * move).max() > 1e-3
        assert np.sum(kept * direction) < 1.02 * np.sum(move * direction)


CASES = [(4.0, 0, 1), (10.0, 0, 0), (20.0, 0, 1), (2.0, 1, 0), (10.0, 1, 0), (30.0, 1, 1)]


@pytest.mark.parametrize(("force", "at", "mode"), CASES)
def test_no_history_of_a_grid_lies_outside_the_interval(force, at, mode):
    model = wedge_between_masses(force, at)
    omega = stuck_resonances(model)[mode]
    peak = find_peak(model, omega, 3, 256)
    found = history_interval(model, peak)
    grid = np.linspace(-70.0, 70.0, 6)
    heights = []
    for pair in itertools.product(grid, repeat=2):
        history = replace(model, start=np.array(pair)[:, None])
        heights.append(find_peak(history, omega, 3, 256).height)
    assert min(heights) >= found.lowest.height * (1 - 2e-4)
    assert max(heights) <= found.highest.height * (1 + 2e-4)
    # and it is not wider than what the grid nearly reaches
    assert min(heights) <= found.lowest.height * 1.01
    assert max(heights) >= found.highest.height * 0.985
    assert found.certificate == MONOTONE
    assert found.highest.height > found.lowest.height * 1.01
    for start, end in (
        (found.lowest_start, found.lowest),
        (found.highest_start, found.highest),
    ):
        again = find_peak(replace(model, start=start), end.omega, 3, 256)
        assert again.height == pytest.approx(end.height, rel=2e-4)


def test_where_every_contact_sticks_or_slips_the_interval_is_a_point():
    for force, at, mode in ((2.0, 0, 0), (10.0, 1, 1)):
        model = wedge_between_masses(force, at)
        peak = find_peak(model, stuck_resonances(model)[mode], 3, 256)
        found = history_interval(model, peak)
        assert found.certificate == POINT
        assert found.highest.height == pytest.approx(found.lowest.height, rel=1e-4)
    fixed = Elements(np.ones(1), np.zeros(1), np.ones(1), np.full(1, 0.5), 1)
    side = on_ground(1, None).sides[0]
    model = ReducedModel((side,), fixed, {1: np.ones(1)}, Damping(ratio=0.02))
    peak = find_peak(model, 1.0, 3, 256)
    assert history_interval(model, peak).certificate == POINT


def test_lift_off_is_never_certified():
    model = wedge_between_masses(20.0, 1)
    peak = find_peak(model, stuck_resonances(model)[0], 3, 256)
    assert history_interval(model, peak).certificate == SAMPLED


def test_tractions_that_no_spring_carries_are_refused():
    model = wedge_between_masses()
    with pytest.raises(InputError, match=r"elements\.t0 of shape \(2,\): expected \(2, 1\)"):
        replace(model, elements=replace(model.elements, t0=np.zeros(2)))
    with pytest.raises(InputError, match=r"start of shape \(1, 1\)"):
        replace(model, start=np.zeros((1, 1)))
    soft = replace(model.elements, kt=np.array([0.0, 1.0]), t0=np.ones((2, 1)))
    with pytest.raises(InputError, match="kt = 0 carries no friction force"):
        replace(model, elements=soft)

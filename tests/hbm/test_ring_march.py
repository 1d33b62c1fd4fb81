"""Blades marched in time by steps, against a plain explicit march and against one blade alone."""

from dataclasses import replace

import numpy as np
import pytest
from models import bouncing, bouncing_wave
from scipy import linalg
from test_stability import marched

from bladefem.hbm.flow_map import flow_map
from bladefem.hbm.ring_march import Drive, driven_anew, march_ring, state_of_solution
from bladefem.hbm.sector_modes import sector_modes
from bladefem.hbm.solution import size
from bladefem.hbm.solve import free_response, solve
from bladefem.hbm.stability import _handed_on, linearised_contacts

PERIODS = 30


def heights(motion):
    """Amplitude of each period from its samples on the last axis."""
    lines = 2 / motion.shape[-1] * np.fft.rfft(motion, axis=-1)[..., 1:8]
    return np.linalg.norm(lines, axis=-1)


@pytest.mark.parametrize("omega", [1.3, 1.75])
def test_a_march_by_steps_is_the_plain_one(omega):
    model = bouncing()
    point = solve(model, omega, 15, 1024)
    plain = heights(marched(model, point, PERIODS))
    found = march_ring(model, state_of_solution(model, point), PERIODS, 512)
    assert found.settled
    own = heights(found.motion[:, 0])
    # where it bounces irregularly, two marches part after some periods
    kept = 5 if abs(plain[-1] / plain[0] - 1) > 0.02 else PERIODS
    assert own[1:kept] == pytest.approx(plain[1:kept], rel=0.02)


@pytest.mark.parametrize("model", [bouncing(), bouncing_wave()])
def test_a_march_does_the_friction_work_of_the_balance(model):
    """The mean of the blades, in stick, slip and lift-off."""
    point = solve(model, 1.3, 8, 1024)
    assert point.converged and point.states["lift"] and point.work.dissipated > 0
    found = march_ring(model, state_of_solution(model, point), 5, 512)
    assert heights(found.motion) == pytest.approx(size(point), rel=0.01)
    assert found.friction_work.shape == (5,)
    assert found.friction_work[1:] == pytest.approx(point.work.dissipated, rel=0.01)


@pytest.mark.parametrize(("omega", "phase"), [(1.3, 1.0), (1.6, 1.0), (1.6, 1.0j)])
def test_a_normal_load_that_varies_is_marched_as_balanced(omega, phase):
    """In stick, slip and lift-off, where its variation changes the amplitude by a half and more."""
    model = replace(bouncing(), normal={1: np.array([0.3 * phase])})
    point = solve(model, omega, 15, 1024)
    assert point.converged
    constant = solve(bouncing(), omega, 15, 1024)
    assert abs(size(point) / size(constant) - 1) > 0.4
    found = march_ring(model, state_of_solution(model, point), PERIODS, 512)
    assert heights(found.motion[1:, 0]) == pytest.approx(size(point), rel=2e-3)


def test_blades_without_coupling_march_as_one_alone():
    alone = bouncing()
    body = alone.sides[0]
    sides = tuple(replace(body, shapes=body.shapes * np.exp(0.5j * np.pi * h)) for h in range(9))
    wave = replace(alone, sides=sides)
    one = march_ring(alone, state_of_solution(alone, solve(alone, 1.3, 7, 256)), 10)
    four = march_ring(wave, state_of_solution(wave, solve(wave, 1.3, 7, 256)), 10)
    assert four.motion.shape[1] == 4
    for blade in range(4):
        found = heights(four.motion[2:, blade])
        assert found == pytest.approx(heights(one.motion[2:, 0]), rel=5e-3)


def test_a_share_of_the_period_has_the_multipliers_of_all_of_it():
    wave = bouncing_wave()
    system = sector_modes(wave)
    point = solve(wave, 1.3, 7, 256)
    S = 128
    contacts, nodes = linearised_contacts(wave, point, system, S)
    dt = 2 * np.pi / point.omega / S
    whole = np.sort(abs(linalg.eigvals(flow_map(contacts, nodes, dt, S))))
    part = _handed_on(system, flow_map(contacts, nodes, dt, S // system.blades))
    shared = np.sort(abs(linalg.eigvals(part)) ** system.blades)
    np.testing.assert_allclose(shared[-12:], whole[-12:], rtol=1e-8)


def test_a_march_that_its_first_period_shows_to_be_too_long_is_left():
    """Contact forces of stiff layers take many sweeps, which no size tells."""
    model = bouncing()
    point = solve(model, 1.3, 7, 256)
    start = state_of_solution(model, point)
    whole = march_ring(model, start, 50)
    left = march_ring(model, start, 50, most=whole.operations / 2)
    assert len(left.motion) == 1 and left.operations == pytest.approx(whole.operations, rel=0.3)
    assert len(march_ring(model, start, 50, most=2 * whole.operations).motion) == 50


def test_a_march_from_no_number_is_not_settled():
    model = bouncing()
    start = state_of_solution(model, solve(model, 1.3, 7, 256))
    assert march_ring(model, start, 1).settled
    for state in (
        replace(start, modal=np.nan * start.modal),
        replace(start, forces=np.nan * start.forces),
    ):
        assert not march_ring(model, state, 1).settled


def test_a_march_that_goes_on_from_its_end_is_one_march():
    model = bouncing()
    start = state_of_solution(model, solve(model, 1.3, 7, 256), 1e-3)
    whole = march_ring(model, start, 6)
    half = march_ring(model, start, 3)
    rest = march_ring(model, driven_anew(model, half.end, start.drive), 3)
    parts = np.concatenate([half.motion, rest.motion])
    np.testing.assert_allclose(parts, whole.motion, atol=1e-5 * abs(whole.motion).max())


def test_another_drive_takes_the_motion_over_and_leads_to_its_own():
    """Without contact the new steady motion is known, and so is what the old one leaves in it."""
    model = bouncing()
    elements = replace(model.elements, n0=np.full(len(model.elements.kt), -1e3))
    model = replace(model, elements=elements)
    point = solve(model, 1.3, 3, 64)
    drive = Drive(1.5, 0.7)
    start = driven_anew(model, state_of_solution(model, point), drive)
    found = march_ring(model, start, 400).motion[:, 0]
    line = 2 / found.shape[-1] * np.fft.rfft(found)[:, 1]
    assert found[0, 0] == pytest.approx(point.probe[:, 0].sum().real, rel=1e-6)
    assert line[-1] == pytest.approx(0.7 * free_response(model, 1.5)[1, 0], rel=1e-6)

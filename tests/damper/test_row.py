"""Plane blades from finite elements, as the paper computes them: limits, methods against each
other, pinned figures.

Figures are those of the default mesh, 41 nodes a seat; with 81 the resonances of these tests move
by 0.02 % and their amplitudes by at most 0.6 % (63 N: 32.4 to 32.6 um; least amplitudes: 0.15 %).
"""

import numpy as np
import pytest

from bladefem.damper.accelerate import Rules, iterate
from bladefem.damper.branch import state_of
from bladefem.damper.paper import platform
from bladefem.errors import InputError
from bladefem.hbm.linear_resonances import free_resonances
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.time_model import time_system
from bladefem.scene.toml import load_scene, vary
from bladefem.study.stability.verdicts import in_one_body
from bladefem.time.shooting import floquet_multipliers, periodic_solution, probe_harmonics
from verification.paper.blades import judge, optimum, peak
from verification.paper.plane_row import paper_model, row_of_blades, whole_model

SOFT = load_scene("scenes/plane.toml", ["contact.kt=1e6 N/m"])


@pytest.fixture(scope="module")
def row():
    return row_of_blades(SOFT)


def test_resonances_and_loads_of_the_scene(row):
    model = paper_model(SOFT, row, 30.0)
    assert free_resonances(model)[:2] / 2 / np.pi == pytest.approx([220.535, 1123.31], rel=1e-4)
    assert model.elements.n0.sum() == pytest.approx(60.0)  # both seats
    assert model.elements.kt[:41].sum() == pytest.approx(1e6)
    assert np.ptp(model.damper.B) == 0  # it moves along the row only


def test_a_static_part_held_lets_no_mean_displacement_in(row):
    """model.static = "uncoupled": mean forces that friction raises are reported, the mean stays
    where it was.
    """
    held = whole_model(vary(SOFT, model__static="uncoupled"), row, 6.0, harmonics=3)
    free = whole_model(SOFT, row, 6.0, harmonics=3)
    assert free.coupled and not held.coupled
    one, other = (solve(model, 2 * np.pi * 1148.7, 3, 128) for model in (free, held))
    assert one.converged and other.converged
    assert abs(other.w[:, :, 0]).max() == 0 < abs(one.w[:, :, 0]).max()
    assert abs(one.probe[1, 0] / other.probe[1, 0] - 1) > 1e-6
    with pytest.raises(InputError, match=r"model\.static"):
        load_scene("scenes/plane.toml", ["model.static=held"])


def test_normal_loads_are_proportional(row):
    a, b = (paper_model(SOFT, row, load).elements.n0 / load for load in (1.0, 100.0))
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_the_contact_mesh_is_fine_enough(row):
    """63 N, between stick and slip: 32.39 um with 41 nodes a seat, 32.57 um with 81; 11 nodes give
    23.4 um (F27).
    """
    finer = row_of_blades(vary(SOFT, mesh__contact_size=SOFT.plane.seat_width / 80))
    default, half = (peak(paper_model(SOFT, r, 63.0), (1050, 1300), 3, 128) for r in (row, finer))
    assert default.amplitude == pytest.approx(half.amplitude, rel=0.02)
    assert default.frequency == pytest.approx(half.frequency, rel=5e-4)


def test_frequency_rises_on_soft_contacts_and_falls_on_stiff_ones(row):
    """Fig. 15 and its exception: 1123.6 to 1176 Hz, and 1123.3 to 1008 Hz."""
    soft = [
        peak(paper_model(SOFT, row, load), (1050, 1300), 3, 128).frequency
        for load in (1.0, 6.0, 200.0)
    ]
    assert soft == sorted(soft)
    assert soft[-1] == pytest.approx(1176.0, rel=1e-3)
    scene = load_scene("scenes/plane.toml", ["contact.kt=1.44e7 N/m"])
    assert (
        peak(paper_model(scene, row_of_blades(scene), 200.0), (850, 1250), 3, 128).frequency < 1015
    )


def test_full_balance_and_the_loop_against_exact_integration(row):
    """6 N at resonance: seven harmonics 1.4e-5, the loop with the damper solved exactly 0.4 %."""
    model = paper_model(SOFT, row, 6.0)
    solution, tip, _ = judge(model, 1148.7)
    assert solution.converged
    assert abs(solve(model, solution.omega, 7, 1024).probe[1, 0] / tip[1] - 1) < 1e-4
    loop = iterate(platform(model, solution.omega, 1), "amplitude", Rules())
    assert loop.converged
    assert abs(loop.probe[1, 0] / tip[1] - 1) < 0.01


def test_marching_the_damper_from_rest_is_accepted_and_wrong(row):
    """F06 on finite elements: 200 N, 1176.3 Hz; the step is small, the answer 99 % off."""
    model = paper_model(SOFT, row, 200.0)
    solution, tip, _ = judge(model, 1176.26)
    found = iterate(platform(model, solution.omega, 1), "amplitude", Rules(damper="march"))
    assert found.converged and found.residual > 0.1
    assert abs(found.probe[1, 0] / tip[1] - 1) > 0.5


@pytest.mark.parametrize(("mass", "amplitude"), [(0.03, 6.62e-6), (0.12, 12.49e-6)])
def test_least_amplitude_grows_with_the_mass_on_soft_contacts(row, mass, amplitude):
    _, best = optimum(
        lambda load: paper_model(SOFT, row, load, mass), (3.0, 12.0), (950, 1500), 3, 128
    )
    assert best.amplitude == pytest.approx(amplitude, rel=0.01)


def test_normal_motion_matters_near_the_optimum(row):
    """3 N: 15.5 um in the paper's model, 38.5 um when the load follows the motion and contacts lift
    off; 20 N: 16.8 um at 1168 Hz, but 5.90 um at 1293 Hz. There most of the change is the seating:
    the paper's model has 6.8 um at 1271 Hz with the normal loads of faces on the same layer.
    """
    light, free = paper_model(SOFT, row, 3.0), whole_model(SOFT, row, 3.0)
    # no higher resonance above 1320 Hz could make the ratio smaller
    one, other = (peak(model, (1100, 1320), 3, 128) for model in (light, free))
    assert other.amplitude > 2 * one.amplitude
    heavy, held = paper_model(SOFT, row, 20.0), whole_model(SOFT, row, 20.0)
    low, high = peak(heavy, (1050, 1700), 3, 128), peak(held, (1270, 1320), 3, 128)
    assert high.amplitude == pytest.approx(5.90e-6, rel=0.01)
    assert high.frequency > 1.1 * low.frequency
    seated = peak(paper_model(SOFT, row, 20.0, layer=True), (1200, 1320), 3, 128)
    assert seated.amplitude == pytest.approx(6.8e-6, rel=0.02)
    assert abs(seated.frequency / high.frequency - 1) < 0.25 * (high.frequency / low.frequency - 1)
    # nowhere else does it move as much
    points = list(response(held, 2 * np.pi * np.linspace(1050, 1700, 66), 3, 128))
    assert all(point.converged for point in points)
    assert max(map(size, points)) <= high.amplitude


def test_two_motions_where_the_normal_load_follows(row):
    """3 N, 1145 Hz: sweeps from below and from above end on different motions; under a constant
    load on one.
    """
    ends = {}
    for name, model in (
        ("follows", whole_model(SOFT, row, 3.0)),
        ("constant", paper_model(SOFT, row, 3.0)),
    ):
        ways = [
            list(response(model, 2 * np.pi * np.linspace(start, 1145.0, 21), 3, 256))
            for start in (1110.0, 1175.0)
        ]
        assert all(s.converged for way in ways for s in way)
        ends[name] = [size(way[-1]) for way in ways]
    assert ends["constant"][1] == pytest.approx(ends["constant"][0], rel=1e-6)
    assert max(ends["follows"]) > 4 * min(ends["follows"])  # 24.3 and 2.1 um


def test_the_whole_plane_model_against_integration_in_time(row):
    """Three freedoms of the damper, normal loads that follow the motion: 1.3e-4 at resonance under
    20 N.

    All points slip and the damper walks: the exact period closes but for its drift, so that the two
    need not agree to the last digit.
    """
    model = in_one_body(whole_model(SOFT, row, 20.0))
    omega = 2 * np.pi * 1292.6
    found, system = solve(model, omega, 5, 512), time_system(model, 1)
    exact = periodic_solution(system, omega, samples=256, most=12)
    assert found.converged
    assert found.states["lift"] + found.states["slip"] > 0
    assert abs(found.probe[1, 0] / probe_harmonics(exact, system, 1)[0, 1] - 1) < 2e-3


def test_the_rocking_motion_of_the_plane_model_is_unstable_in_time(row):
    """3 N, 1145 Hz, all contacts lift off: a solution of the exact flow too (0.1 %), largest
    multiplier 1.95.
    """
    model = in_one_body(whole_model(SOFT, row, 3.0))
    start = list(response(model, 2 * np.pi * np.linspace(1175.0, 1145.0, 21), 5, 256))[-1]
    found, system = solve(model, 2 * np.pi * 1145.0, 9, 512, start=start), time_system(model, 1)
    assert found.converged and found.states["lift"] > 10
    exact = periodic_solution(system, found.omega, state_of(found, system), samples=256, most=12)
    assert abs(found.probe[1, 0] / probe_harmonics(exact, system, 1)[0, 1] - 1) < 5e-3
    assert 1.8 < np.abs(floquet_multipliers(exact)).max() < 2.1

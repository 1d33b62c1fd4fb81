"""Dampers of a mistuned wheel that nothing but friction holds: twelve lumped blades with a free mass
between neighbours, against plain marching in time and the tuned sector.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit
from scipy import linalg
from test_marching import ring_matrices, take_step

from bladefem.data import Elements, RigidBody
from bladefem.hbm.model import Damping
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.study.mistuning import peak_choice
from bladefem.study.mistuning.peak_choice import (
    SearchedWheel,
    chosen_peak,
    pattern_peak,
    with_free_change,
)
from bladefem.wheel.local_peak import (
    FIRST_REACH,
    LocalBalances,
    find_local_peak,
)
from bladefem.wheel.lumped import PLATFORM, TIP, LumpedBlades, lumped_matrices, lumped_pattern
from bladefem.wheel.model import engine_order, tuned_wheel
from bladefem.wheel.resonance import find_wheel_peak
from bladefem.wheel.solve import solve_wheel
from bladefem.wheel.statistics import scatter_statistics, wheel_respond
from bladefem.wheel.tuned import tuned_sector
from bladefem.wheel.walking import slipping_dampers
from bladefem.wheel.walking_search import undecided_dampers

COUNT, ORDER = 12, 3
BLADES = LumpedBlades(count=COUNT, damping=0.02)
KT, MASS = 2e5, 0.02
# of orders 3 and 6, whose phases make the motion other forth than back, and their phase
FORCES, PHASE = (10.0, 40.0), 0.7
LIMITS = np.array([2.0, 1.6])
TIGHT = replace(DEFAULT_OPTIONS, tolerance=1e-13)


def free_dampers(limits=LIMITS, phase=PHASE):
    """Each mass rubs on the platform before it and on the one behind."""
    M, K, to_next = lumped_matrices(BLADES)
    ports = {
        "contact": np.eye(3)[[PLATFORM, PLATFORM]],
        "blade": np.array([[0.0, -1.0, 1.0], [-1.0, 1.0, 0.0]]),
        "load": np.array([TIP]),
        "probe": np.array([TIP]),
    }
    sectors = {}
    for d in range(COUNT // 2 + 1):
        turn = np.exp(2j * np.pi * d / COUNT)
        stiffness = K + to_next * turn + to_next.T * turn.conj()
        stiffness = stiffness.real if 2 * d % COUNT == 0 else stiffness
        sectors[d] = port_model_from_matrices(M, stiffness, ports, nodal_diameter=d)
    excitation = {
        h: engine_order(COUNT, h * ORDER, np.array([force]), phase * (h - 1))
        for h, force in enumerate(FORCES, 1)
    }
    return tuned_wheel(
        COUNT,
        sectors,
        slice(1, 2),
        Elements(np.full(2, KT), np.zeros(2), np.ones(2), limits, tangents=1),
        excitation,
        damping=Damping(ratio=BLADES.damping),
        damper=RigidBody(np.array([[MASS]]), np.ones((2, 1))),
    )


def resonance():
    M, K, _ = lumped_matrices(BLADES)
    return 1.01 * float(np.sqrt(linalg.eigh(K, M)[0][0]))


def march(omega, deviation, limits, periods=80, steps=1000, phase=PHASE):
    """Harmonics 1 to 4 of all tips (N, 4), and how far each damper goes on in the last period.

    Args:
        limits: (2, N) friction limits of the two contacts of each damper.
    """
    mass, C, K = ring_matrices(deviation)
    dt = 2 * np.pi / omega / steps
    platform, tip = 3 * np.arange(COUNT) + PLATFORM, 3 * np.arange(COUNT) + TIP
    following = np.roll(platform, -1)
    around = 2 * np.pi * ORDER * np.arange(COUNT) / COUNT
    left = linalg.inv(np.diag(mass) / dt**2 + C / (2 * dt))
    now_matrix = left @ (2 * np.diag(mass) / dt**2 - K)
    old_matrix = -left @ (np.diag(mass) / dt**2 - C / (2 * dt))
    step_matrix = np.hstack([now_matrix, old_matrix, left])
    limits = np.array(np.broadcast_to(limits, (2, COUNT)))
    instants = omega * dt * np.arange(steps * periods)[:, None]
    drive = FORCES[0] * np.cos(instants + around)
    drive += FORCES[1] * np.cos(2 * (instants + around) + phase)
    contacts = np.array([platform, following])
    tips, places = march_in_loops(step_matrix, contacts, tip, drive, limits, dt, steps)
    turns = np.exp(-1j * instants[-steps:] * np.arange(1, 5))
    return 2 / steps * tips.T @ turns, places[-1] - places[-2]


@njit(cache=True)
def march_in_loops(step_matrix, contacts, tip, drive, limits, dt, steps):
    """Tips (steps, N) in the last period, and where the dampers are when each begins (periods, N).

    Args:
        step_matrix: (m, 3m) the next displacements from the present ones, those before and loads.
        contacts: (2, N) coordinates that the two contacts of each damper are at.
        drive: (periods * steps, N) forces on the tips.
    """
    count, m = len(tip), len(step_matrix)
    # displacements now and before, and loads
    state = np.zeros(3 * m)
    y, before = np.zeros(count), np.zeros(count)
    slider = np.zeros((2, count))
    tips = np.zeros((steps, count))
    places = np.zeros((len(drive) // steps, count))
    for step in range(len(drive)):
        for i in range(m):
            state[2 * m + i] = 0.0
        for s in range(count):
            state[2 * m + tip[s]] = drive[step, s]
            # the last period remains
            tips[step % steps, s] = state[tip[s]]
            if step % steps == 0:
                places[step // steps, s] = y[s]
        for s in range(count):
            push = 0.0
            for side in range(2):
                at = contacts[side, s]
                w = state[at] - y[s]
                reach = limits[side, s] / KT
                slider[side, s] = min(max(slider[side, s], w - reach), w + reach)
                f = KT * (w - slider[side, s])
                state[2 * m + at] -= f
                push += f
            next_place = 2 * y[s] - before[s] + dt * dt / MASS * push
            before[s] = y[s]
            y[s] = next_place
        take_step(step_matrix, state)
    return tips, places


def test_tuned_wheel_walks_as_its_sector():
    wheel = free_dampers()
    one = solve(tuned_sector(wheel, 7), resonance(), 7, 512, options=TIGHT)
    found = solve_wheel(wheel, resonance(), 7, 512, options=TIGHT)
    assert one.converged and found.converged and one.walk is not None
    np.testing.assert_allclose(found.drift, one.drift, rtol=1e-9)
    turn = np.exp(2j * np.pi * ORDER / COUNT * np.outer(np.arange(COUNT), np.arange(8)))
    expected = (one.probe[:, 0] * turn)[:, 1:]
    scale = abs(expected).max()
    np.testing.assert_allclose(found.probe[:, 1:, 0], expected, rtol=0, atol=1e-9 * scale)


@pytest.fixture(scope="module")
def deviation():
    return 0.02 * np.random.default_rng(1).normal(size=COUNT)


def test_walks_of_a_mistuned_wheel_are_those_of_a_march(deviation):
    """Held means are 1.3 % off."""
    wheel, omega = free_dampers(), resonance()
    tips, steps = march(omega, deviation, LIMITS[:, None])
    pattern = lumped_pattern(BLADES, deviation)
    found = solve_wheel(wheel, omega, 15, 1024, pattern=pattern)
    assert found.converged and found.walk.dampers.all()
    assert np.ptp(abs(steps)) > 0.2 * abs(steps).max()
    # blade against damper: the other way
    np.testing.assert_allclose(-found.walk.steps(found.w)[:, 0] * scale_of(found), steps, rtol=2e-3)
    np.testing.assert_allclose(found.drift, abs(steps) * omega / (2 * np.pi), rtol=2e-3)
    largest = abs(tips).max()
    np.testing.assert_allclose(found.probe[:, 1:5, 0], tips, rtol=0, atol=2e-4 * largest)
    # no mean force is left on a damper
    assert abs(found.f[..., 0].sum(axis=(1, 2))).max() < 1e-5 * abs(found.f).max()
    held = solve_wheel(replace(wheel, coupled=False), omega, 15, 1024, pattern=pattern)
    assert abs(held.probe[:, 1, 0] - tips[:, 0]).max() > 0.01 * largest


def scale_of(found):
    """Displacement of the contacts by a unit step."""
    return found.walk.motions[0, 0, 0]


def test_only_dampers_that_slip_everywhere_walk(deviation):
    """Three of them have a contact with friction enough to hold."""
    wheel, omega = free_dampers(), resonance()
    held = [1, 6, 7]
    limits = np.tile(LIMITS[:, None], COUNT)
    limits[1, held] = 200.0
    every = wheel.all_elements
    pattern = replace(
        lumped_pattern(BLADES, deviation), elements=replace(every, n0=limits.T.ravel())
    )
    tips, steps = march(omega, deviation, limits, periods=160)
    found = solve_wheel(wheel, omega, 15, 1024, pattern=pattern)
    assert found.converged, found.reason
    np.testing.assert_array_equal(np.flatnonzero(~found.walk.dampers), held)
    assert abs(steps[held]).max() < 1e-3 * abs(steps).max()
    assert (found.drift[held] == 0).all()
    np.testing.assert_allclose(
        np.delete(found.drift, held),
        np.delete(abs(steps), held) * omega / (2 * np.pi),
        rtol=5e-3,
    )
    np.testing.assert_allclose(found.probe[:, 1:5, 0], tips, rtol=0, atol=5e-4 * abs(tips).max())


def test_searched_peak_is_the_highest_of_marches(deviation):
    """At its frequency and on both sides; held means are 1.1 % higher."""
    limits, phase = np.array([4.0, 2.0]), 1.5
    free = free_dampers(limits, phase)
    held = replace(free, coupled=False)
    pattern = lumped_pattern(BLADES, deviation)
    grid = resonance() * np.linspace(0.95, 1.05, 11)
    first = find_wheel_peak(wheel_respond(held, pattern, 15, 1024), grid, 1e-3)
    found = find_local_peak(LocalBalances(free, pattern, 15, 1024), first, 1e-3)
    around = found.peak.omega * np.array([0.995, 1.0, 1.005])
    marched = np.array(
        [
            np.linalg.norm(march(w, deviation, limits[:, None], phase=phase)[0], axis=1)
            for w in around
        ]
    )
    assert marched.max(axis=1).argmax() == 1
    assert marched[1].argmax() == found.peak.blade == found.solution.size().argmax()
    assert found.peak.height == pytest.approx(marched[1].max(), rel=3e-4)
    assert found.solution.walk.dampers.all()
    assert first.height > 1.008 * marched.max()
    assert found.change == pytest.approx(marched[1].max() / first.height - 1, abs=1e-3)
    # few more than the search with held means took
    assert found.points <= 5 < len(first.omegas)


def test_amplification_with_free_means_is_that_of_marches(deviation):
    """The tuned wheel and one pattern, each at the peak that was searched for it."""
    limits, phase = np.array([4.0, 2.0]), 1.5
    free = free_dampers(limits, phase)
    held = replace(free, coupled=False)
    grid = resonance() * np.linspace(0.95, 1.05, 11)
    found = scatter_statistics(
        {0.0: [lumped_pattern(BLADES, deviation)]},
        lambda _, pattern: pattern_peak(
            SearchedWheel(held, free, pattern, 1, DEFAULT_OPTIONS), grid, (9, 512)
        ),
    )
    tuned, mistuned = (
        np.linalg.norm(march(omega, own, limits[:, None], 60, 512, phase)[0], axis=1).max()
        for omega, own in (
            (found.tuned_omega[0], np.zeros(COUNT)),
            (found.omega[0, 0], deviation),
        )
    )
    assert found.mean_released.all()
    assert found.tuned[0] == pytest.approx(tuned, rel=1e-3)
    assert found.factor[0, 0] == pytest.approx(mistuned / tuned, rel=1e-3)
    assert found.tuned_held[0] > 1.005 * tuned


def test_error_by_harmonics_where_no_richer_balance_walks(monkeypatch):
    """It is put together from held means and from what free ones change, and not below half of the
    true error; the hardest of 36 cases, four patterns with three loads and numbers of harmonics.
    """
    free = free_dampers(2 * LIMITS)
    held = replace(free, coupled=False)
    pattern = lumped_pattern(BLADES, 0.02 * np.random.default_rng(1).normal(size=COUNT))
    grid = resonance() * np.linspace(0.97, 1.03, 13)
    judged_by = peak_choice._judged_by

    def without_walks(balances, *args):
        found = judged_by(balances, *args)
        return found if balances.wheel is held else replace(found, change=np.nan)

    searched = SearchedWheel(held, free, pattern, 1, DEFAULT_OPTIONS)

    def chosen():
        return chosen_peak(searched, grid, (2, 96), None)

    truth = pattern_peak(searched, grid, (15, 1024)).peak.height
    direct = chosen()
    monkeypatch.setattr(peak_choice, "_judged_by", without_walks)
    estimated = chosen()
    error = abs(direct.peak.height / truth - 1)
    assert error > 0.005
    assert direct.truncation == pytest.approx(error, rel=0.1)
    assert 0.5 * error < estimated.truncation < 2 * error
    held_only = chosen_peak(replace(searched, free=None), grid, (2, 96), None)
    whole = with_free_change(held_only.truncation, estimated.free.change)
    assert estimated.truncation == pytest.approx(whole, rel=1e-9)


class Curves:
    """Amplitudes of two blades with a resonance each, in place of balances.

    Args:
        lost: frequencies without a balance; end: none from there on.
    """

    def __init__(self, centres, heights, lost=(), end=np.inf):
        self.centres, self.heights = np.array(centres), np.array(heights)
        self.lost, self.end = lost, end
        self.points = {}

    def __call__(self, omega):
        self.points[float(omega)] = SimpleNamespace(omega=omega)
        if omega > self.end or any(abs(omega - at) < 1e-6 for at in self.lost):
            return np.full(2, np.nan)
        return self.heights / np.hypot(1, (omega - self.centres) / 0.01)


HELD = find_wheel_peak(Curves([1.0, 1.2], [1.0, 0.98]), np.linspace(0.9, 1.3, 21), 1e-4)


@pytest.mark.parametrize(
    ("centres", "heights", "blade"),
    [
        # blade 0 falls below the other resonance
        ([1.0, 1.2], [0.95, 0.97], 1),
        # the other one rises above it
        ([1.0, 1.2], [0.99, 1.0], 1),
        # far outside of the bracket of held means
        ([1.04, 1.2], [1.0, 0.9], 0),
        ([0.96, 1.2], [1.0, 0.9], 0),
    ],
)
def test_free_means_can_make_another_peak_the_highest(centres, heights, blade):
    curves = Curves(centres, heights)
    found = find_local_peak(curves, HELD, 1e-4)
    assert found.peak.blade == blade
    assert found.peak.height == pytest.approx(heights[blade], rel=2e-4)
    assert found.peak.omega == pytest.approx(centres[blade], abs=1e-3)
    assert found.change == pytest.approx(heights[blade] / HELD.height - 1, abs=1e-3)
    assert found.solution.omega == found.peak.omega
    assert found.points < 2 * len(HELD.omegas)
    assert (np.diff(found.peak.omegas) > 0).all() and found.peak.unsolved == 0


def test_a_peak_without_a_balance_is_not_searched_again():
    assert find_local_peak(Curves([1.0, 1.2], [1.0, 0.9], [HELD.omega]), HELD, 1e-4) is None


FAR = HELD.omega * (1 + FIRST_REACH)


def test_a_nearer_point_takes_the_place_of_one_that_is_not_solved():
    found = find_local_peak(Curves([HELD.omega + 1e-4, 1.2], [1.0, 0.9], [FAR]), HELD, 1e-4)
    assert found.peak.height == pytest.approx(1.0, rel=2e-4)
    assert found.peak.closed_in and found.peak.unsolved == 1


def test_a_peak_next_to_points_that_are_not_solved_is_not_closed_in():
    """The resonance is beyond them, and higher."""
    curves = Curves([HELD.omega + 0.02, 1.2], [1.0, 0.1], end=HELD.omega + 0.01)
    found = find_local_peak(curves, HELD, 1e-4)
    assert found.peak.height < 0.75 and not found.peak.closed_in
    # it was followed nearly as far as there are points
    assert found.peak.omega > HELD.omega + 0.0099


def test_a_peak_at_the_end_of_a_curve_is_closed_in_where_hardly_more_can_be_gained():
    """As next to a fold, beyond which there is no such motion."""
    curves = Curves([HELD.omega + 0.02, 1.2], [1.0, 0.1], end=HELD.omega + 0.0195)
    found = find_local_peak(curves, HELD, 1e-4)
    assert found.peak.closed_in and found.peak.unsolved > 0
    assert found.peak.height == pytest.approx(1.0, rel=5e-3)


def test_peak_of_a_blade_that_is_not_the_highest():
    """Its own frequency and height, and what the others do there."""
    curves = Curves([1.013, 1.213], [1.0, 0.5])
    first = find_wheel_peak(curves, np.linspace(0.9, 1.3, 21), 1e-4)
    found = find_local_peak(curves, first, 1e-4, blades=np.array([1]))
    assert found.peak.blade == 1
    assert found.peak.omega == pytest.approx(1.213, abs=1e-3)
    assert found.peak.height == pytest.approx(0.5, rel=2e-4)
    assert found.peak.by_blade == pytest.approx([1.0, 0.5], rel=2e-4)
    # the first search did not close it in
    assert found.change > 0.02


@pytest.mark.parametrize("limit", [8.0, 9.6])
def test_it_is_found_which_dampers_walk_where_some_nearly_do(limit):
    """Between friction that all of them overcome and friction that holds all: exactly those walk on
    which nothing sticks. Newton's method with one damper too few or too many does not converge.
    """
    free = free_dampers(limit * np.array([1.0, 0.5]), 1.5)
    rng = np.random.default_rng(1)
    options = replace(DEFAULT_OPTIONS, fallbacks=False, tolerance=1e-6)
    walking = []
    for _ in range(16):
        pattern = lumped_pattern(BLADES, 0.01 * rng.standard_normal(COUNT))
        omega = resonance() * (1 + 0.02 * rng.standard_normal())
        point = solve_wheel(free, omega, 3, 64, pattern=pattern, options=options)
        assert point.converged
        slips = slipping_dampers(point.shares)
        walks = np.zeros(COUNT, dtype=bool) if point.walk is None else point.walk.dampers
        np.testing.assert_array_equal(slips, walks)
        walking.append(np.count_nonzero(walks))
    assert any(0 < number < COUNT for number in walking)


def test_undecided_dampers_are_those_that_keep_the_residual_alone():
    residual = np.full((12, 2, 2, 7), 1e-3)
    assert not undecided_dampers(residual).any()
    residual[7] = 1.0
    np.testing.assert_array_equal(np.flatnonzero(undecided_dampers(residual)), [7])
    residual[2] = np.nan
    assert not undecided_dampers(residual).any()

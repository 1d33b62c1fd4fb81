"""Exact flow and shooting against closed forms, finite differences, two time-stepping schemes, and
each other.
"""

from dataclasses import replace

import numpy as np
import pytest
from systems import blades, friction_oscillator, rocking, seat

from bladefem.damper.direct import direct
from bladefem.damper.explicit import damper_cycle
from bladefem.data import Elements
from bladefem.time.event_integrator import State, integrate_periods, stuck_start
from bladefem.time.shooting import (
    floquet_multipliers,
    periodic_solution,
    probe_harmonics,
)
from bladefem.time.system import damper_on_platforms

OMEGA = 2 * np.pi * 1340


def pack(state):
    return np.r_[state.q, state.v, state.z]


def fourier(signal, h=1):
    return 2 * np.fft.rfft(signal, axis=0)[h] / len(signal)


def test_result_does_not_depend_on_the_step():
    system = blades(1e6, 1.4, 0.06)
    coarse, fine = (
        integrate_periods(system, OMEGA, stuck_start(system, OMEGA), samples, 10)
        for samples in (64, 512)
    )
    assert coarse.events == fine.events > 100
    assert pack(coarse.state) == pytest.approx(
        pack(fine.state), rel=1e-9, abs=1e-13 * np.abs(pack(fine.state)).max()
    )


@pytest.mark.parametrize("case", ["ring", "rocking"])
def test_tangent_against_finite_differences(case):
    system, omega = (
        (blades(1e6, 1.4, 0.06, nodes=2), OMEGA) if case == "ring" else (rocking(), 2 * np.pi * 130)
    )
    start = integrate_periods(system, omega, stuck_start(system, omega), 64, 3).state
    if case == "rocking":
        start = replace(start, q=start.q - 8e-5)  # opens and closes in this period
    exact, d = integrate_periods(system, omega, start, 64, tangent=True).tangent, len(start.q)
    x, numeric = pack(start), np.zeros_like(exact)
    sizes = np.r_[np.full(d, 1e-10), np.full(d, 1e-10 * omega), np.full(len(start.z), 1e-10)]
    for k, size in enumerate(sizes):
        ends = [
            pack(integrate_periods(system, omega, State(y[:d], y[d : 2 * d], y[2 * d :]), 64).state)
            for y in (x + size * np.eye(len(x))[k], x - size * np.eye(len(x))[k])
        ]
        numeric[:, k] = (ends[0] - ends[1]) / (2 * size)
    scale = sizes / sizes[:, None]
    assert numeric * scale == pytest.approx(
        exact * scale, rel=3e-4, abs=2e-4
    )  # curvature of 1e-4 steps


def test_loop_of_a_held_damper_has_the_closed_form():
    """A damper too heavy to move: W = 4 F (A - F/k) a cycle and each element, harmonics of Jenkins'
    loop.
    """
    k, F, A = 1e6, 12.0, 5e-5
    element = Elements(np.array([k]), np.zeros(1), np.ones(1), np.array([F]), 1)
    system = damper_on_platforms(np.array([[0, A + 0j]]), element, 1e12)
    path = integrate_periods(
        system, OMEGA, integrate_periods(system, OMEGA, stuck_start(system, OMEGA), 64).state, 4096
    )
    theta = np.arccos(1 - 2 * F / (k * A))
    stiffness = k / np.pi * (theta - np.sin(2 * theta) / 2) + 1j * k / np.pi * np.sin(theta) ** 2
    assert fourier(path.force[:, 0]) / A == pytest.approx(
        stiffness, rel=1e-6
    )  # sampling, 4096^-2 of the kinks
    assert np.pi * A * stiffness.imag * A == pytest.approx(4 * F * (A - F / k), rel=1e-12)


def test_load_that_lifts_off_agrees_with_the_return_map():
    """Prescribed N(t) = 10 + 14 cos t, two cycles of motion: the plain return map converges to the
    exact flow.
    """
    element = Elements(np.array([1e6]), np.zeros(1), np.array([0.5]), np.array([10.0]), 1)
    system = damper_on_platforms(np.array([[0, 0, 3e-5j]]), element, 1e12)
    system = replace(system, normal=np.array([[10.0, 14.0, 0, 0, 0]]))
    path = integrate_periods(
        system, OMEGA, integrate_periods(system, OMEGA, stuck_start(system, OMEGA), 64).state, 8192
    )
    z = g = 0.0
    t = np.arange(2 * 8192) / 8192 * 2 * np.pi
    f = np.zeros(len(t))
    for m, (g, limit) in enumerate(
        zip(-3e-5 * np.sin(2 * t), 0.5 * np.maximum(10 + 14 * np.cos(t), 0), strict=True)
    ):
        f[m] = np.clip(1e6 * (g - z), -limit, limit)
        z = g - f[m] / 1e6
    closed = 10 + 14 * np.cos(t[8192:]) > 0
    assert path.force[closed, 0] == pytest.approx(
        f[8192:][closed], abs=5e-3
    )  # 0.07 % of mu N, its step
    assert path.force[~closed, 0] == pytest.approx(0, abs=1e-12)


def test_shooting_against_newmark_and_leapfrog():
    """Both schemes converge to the shooting solution with second order."""
    system, omega = friction_oscillator(200 * np.pi, 0.01, 2e5, 3.0, 5 + 0j), 2 * np.pi * 108
    exact = probe_harmonics(periodic_solution(system, omega, samples=1024), system, 1)[0, 1]
    for explicit in (False, True):
        error = [
            abs(
                fourier(direct(system, omega, steps, tolerance=1e-9, explicit=explicit).q[:, 0])
                / exact
                - 1
            )
            for steps in (256, 512)
        ]
        assert error[0] < 2e-3
        assert np.log2(error[0] / error[1]) == pytest.approx(2, abs=0.3)


def test_newmark_on_the_blade_with_ten_contacts():
    system = blades(1e6, 1.4, 0.06)
    solution = periodic_solution(system, OMEGA)
    cycle = direct(system, OMEGA, 256, solution.start, most=300, tolerance=1e-6)
    probe = cycle.q @ system.probe[0]
    assert (
        abs(fourier(probe) / probe_harmonics(solution, system, 1)[0, 1] - 1) < 2e-3
    )  # 8.3e-4 after 1600 periods


def period_work(solution, system):
    """Work of the excitation and of friction and damping in one period [J]; equal in a periodic
    motion.

    By the trapezoidal rule on the samples, which is spectrally accurate for smooth parts and second
    order for kinks.
    """
    path = solution.trajectory
    t = np.arange(len(path.q)) / len(path.q)
    angles = 2 * np.pi * np.outer(np.arange(1, system.coefficients // 2 + 1), t)
    basis = np.ones((system.coefficients, len(t)))
    basis[1::2], basis[2::2] = np.cos(angles), np.sin(angles)
    step = 2 * np.pi / solution.omega / len(t)
    rate = path.v @ system.W.T
    spent = np.sum(path.force * rate) + np.sum(path.v * (path.v @ system.damping.T))
    return step * float(np.sum((system.force @ basis).T * path.v)), step * float(spent)


def test_work_of_excitation_is_dissipated():
    system = blades(1e6, 1.4, 0.06)
    given, spent = period_work(periodic_solution(system, OMEGA, samples=1024), system)
    assert spent == pytest.approx(given, rel=2e-5)  # kinks of the force, samples^-2


def test_multipliers_of_a_stuck_blade_are_the_linear_ones():
    system = blades(1e6, 1e3, 0.06)
    solution = periodic_solution(system, OMEGA)
    d = len(system.stiffness)
    A = np.block(
        [
            [np.zeros((d, d)), np.eye(d)],
            [-np.diag(system.stiffness) - (system.W.T * system.kt) @ system.W, -system.damping],
        ]
    )
    linear = np.exp(np.linalg.eigvals(A) * 2 * np.pi / OMEGA)
    ours = floquet_multipliers(solution)
    assert np.abs(ours[:10] - 1).max() < 1e-10  # ten sliders, free to sit anywhere
    assert np.sort(np.abs(ours[10:])) == pytest.approx(np.sort(np.abs(linear)), rel=1e-9)


def test_damper_on_moving_platforms_by_two_ways():
    motion = np.tile([0, 5e-6, 0, 1e-6j], (10, 1))
    system = damper_on_platforms(motion, seat(1e6, 5.0), 0.06)
    exact, cycle = periodic_solution(system, OMEGA), damper_cycle(system, OMEGA, 1024)
    assert cycle.reason == exact.reason == "periodic"
    assert fourier(cycle.force) == pytest.approx(fourier(exact.trajectory.force), rel=1e-4)


def test_three_solutions_where_the_normal_load_follows_the_motion():
    """Stuck, an unstable one between, and rocking off the contact, at the same force and
    frequency.
    """
    system, omega = rocking(), 2 * np.pi * 150
    stuck = periodic_solution(system, omega)
    state = None
    for frequency in np.arange(170, 149, -2.0):
        rock = periodic_solution(system, 2 * np.pi * frequency, state)
        state = rock.start
    mix = State(
        *(
            0.625 * a + 0.375 * b
            for a, b in zip(
                (stuck.start.q, stuck.start.v, stuck.start.z),
                (rock.start.q, rock.start.v, rock.start.z),
                strict=True,
            )
        )
    )
    saddle = periodic_solution(system, omega, mix)
    found = [abs(probe_harmonics(s, system, 1)[0, 1]) for s in (stuck, saddle, rock)]
    assert found == pytest.approx([9.316e-6, 23.16e-6, 40.15e-6], rel=1e-3)
    sizes = [np.abs(floquet_multipliers(s)[0]) for s in (stuck, saddle, rock)]
    assert sizes == pytest.approx(
        [1.0, 1.540, 0.979], abs=2e-3
    )  # 1.0: the slider of the stuck contact


def test_solution_is_unique_when_the_load_is_prescribed():
    system = blades(1e6, 1.4, 0.06)
    rng = np.random.default_rng(1)
    d, n, first = len(system.stiffness), len(system.kt), []
    for _ in range(6):
        start = State(
            2e-6 * rng.normal(size=d), 2e-6 * OMEGA * rng.normal(size=d), 2e-6 * rng.normal(size=n)
        )
        solution = periodic_solution(system, OMEGA, start)
        assert solution.converged
        assert np.abs(floquet_multipliers(solution)).max() < 1 + 1e-9
        first.append(probe_harmonics(solution, system, 1)[0, 1])
    assert np.abs(np.array(first) / first[0] - 1).max() < 1e-6

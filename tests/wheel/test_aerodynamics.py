"""Aerodynamic influence against dense matrices; limit cycles in closed form and marched in time."""

from dataclasses import replace
from math import acos, pi, sin

import numpy as np
import pytest
from models import single_mass
from rings import BLADE, EO, LINK, LOAD, MASS, OWN, PROBE, RIGID, N, elements, forces, ring_wheel
from scipy import linalg, optimize

from bladefem.errors import InputError
from bladefem.hbm.model import Damping
from bladefem.hbm.nonlinear_modes import nonlinear_mode
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import Options
from bladefem.wheel.aerodynamics import limit_cycles
from bladefem.wheel.linear_motion import free_wheel
from bladefem.wheel.model import Pattern, engine_order
from bladefem.wheel.solve import solve_wheel
from bladefem.wheel.tuned import tuned_sector


def influence_of_distance(coefficients):
    """(N, 3) `Wheel.influence` on the first of three modes [1/s^2], from places ahead (0: the blade
    itself, -1: the one before) to complex stiffness [1/s^2].
    """
    d = np.arange(N)
    found = np.zeros((N, 3), dtype=complex)
    for distance, value in coefficients.items():
        found[:, 0] += value * np.exp(2j * np.pi * d * distance / N)
    return found


def test_influence_of_neighbours_is_that_of_dense_matrices():
    """Forces on the first mode of each sector by itself and its neighbours, blades mistuned."""
    coefficients = {0: 0.3 + 0.2j, 1: -0.1 + 0.05j, -1: 0.04 - 0.12j}
    influence = influence_of_distance(coefficients)
    damping = Damping(mass=0.02)
    wheel = ring_wheel(elements(2, 0.0), None, forces({1: 1.0}), damping, influence=influence)
    dK = 0.2 * np.random.default_rng(0).normal(size=(N, 1, 1)) * np.eye(2)
    following = np.roll(np.eye(N), 1, axis=1)
    K = np.kron(np.eye(N), OWN) + np.kron(following, LINK) + np.kron(following.T, LINK.T)
    K = K.astype(complex)
    M = np.kron(np.eye(N), MASS)
    C = (0.02 * M).astype(complex)
    # c_d M phi_d phi_d^H M in every nodal diameter, of the tuned sector's first mode: stiffness,
    # and a viscous force
    for d in range(N):
        turn = np.exp(2j * np.pi * d / N)
        own = OWN + turn * LINK + turn.conj() * LINK.T
        squared, shapes = linalg.eigh(own, MASS)
        wave = np.kron(turn ** np.arange(N), MASS @ shapes[:, 0]) / np.sqrt(N)
        K += influence[d, 0].real * np.outer(wave, wave.conj())
        C += influence[d, 0].imag / np.sqrt(squared[0]) * np.outer(wave, wave.conj())
    for b in range(N):
        part = slice(3 * b, 3 * b + 3)
        K[part, part] += BLADE.T @ dK[b] @ BLADE
    omega = 2.2
    F = np.kron(np.eye(N), LOAD.T) @ engine_order(N, EO, np.array([1.0]))[:, 0]
    expected = np.kron(np.eye(N), PROBE) @ np.linalg.solve(K - omega**2 * M + 1j * omega * C, F)
    found = free_wheel(wheel, omega, 1, Pattern(dK))[:, 1, 0]
    np.testing.assert_allclose(found, expected, atol=1e-10 * abs(expected).max())
    # forward and backward waves differ
    ratio = influence[:, 0].imag / 2
    assert abs(ratio[1] - ratio[-1]) > 0.05


@pytest.mark.parametrize("order", [EO, N - EO])
def test_tuned_wheel_in_a_flow_is_the_sector(order):
    """Every blade of the wheel, with forward and with backward waves; friction and two harmonics'
    worth of waves in the flow.
    """
    influence = influence_of_distance({0: 0.1 + 0.1j, 1: -0.1 + 0.15j, -1: 0.04 - 0.12j})
    excitation = {1: engine_order(N, order, np.array([0.9]))}
    wheel = ring_wheel(elements(2, 2.0, 2.0, 0.1), RIGID, excitation, influence=influence)
    tight = Options(tolerance=1e-12)
    one = solve(tuned_sector(wheel, 3), 2.3, 3, 240, options=tight)
    found = solve_wheel(wheel, 2.3, 3, 240, options=tight)
    assert one.converged and found.converged, (one.reason, found.reason)
    turn = np.exp(2j * np.pi * order / N * np.arange(N))
    expected = turn[:, None] ** np.arange(4) * one.probe[:, 0]
    np.testing.assert_allclose(found.probe[:, :, 0], expected, atol=1e-9 * abs(one.probe).max())
    still = solve_wheel(replace(wheel, influence=None), 2.3, 3, 240, options=tight)
    assert abs(still.probe - found.probe).max() > 1e-2 * abs(one.probe).max()


def test_limit_cycle_in_closed_form():
    """One Jenkins element on a mass: (kt / pi) sin^2 theta* = -2 zeta omega^2."""
    kt, limit, damping = 0.4, 0.3, -0.02
    amplitudes = limit / kt * np.geomspace(1.01, 30, 200)
    points = list(nonlinear_mode(single_mass(kt, limit), amplitudes, H=1, samples=0))
    cycles = limit_cycles(points, damping)
    assert [c.stable for c in cycles] == [True, False]

    def balance(a):
        theta = acos(1 - 2 * limit / (kt * a))
        omega2 = 1 + kt / pi * (theta - sin(2 * theta) / 2)
        return kt / pi * sin(theta) ** 2 / (2 * omega2) + damping

    largest = limit / kt * 2
    expected = [
        optimize.brentq(balance, 1.0001 * limit / kt, largest),
        optimize.brentq(balance, largest, 30 * limit / kt),
    ]
    np.testing.assert_allclose([c.amplitude for c in cycles], expected, rtol=1e-3)


def test_limit_cycle_marched_in_time():
    """Self-excited motion marched until it is steady ends on the stable limit cycle."""
    kt, limit, damping = 0.4, 0.3, -0.02
    amplitudes = limit / kt * np.geomspace(1.01, 30, 120)
    points = list(nonlinear_mode(single_mass(kt, limit), amplitudes, H=5, samples=0))
    stable = next(c for c in limit_cycles(points, damping) if c.stable)
    dt = 4e-3
    x, v = 0.95 * stable.amplitude, 0.0
    slider = x - limit / kt
    rate = 2 * damping * stable.omega
    peaks = []
    for _ in range(60000):
        slider = min(max(slider, x - limit / kt), x + limit / kt)
        before = v
        v += dt * (-rate * v - x - kt * (x - slider))
        x += dt * v
        if before > 0 >= v:
            peaks.append(x)
    assert np.ptp(peaks[-5:]) < 1e-3 * peaks[-1]
    middle = (max(peaks[-5:]) + min(peaks[-5:])) / 2
    assert middle == pytest.approx(stable.amplitude, rel=0.02)


def march_fed_ring(net, limit, kt, starts, cycles=900, steps=100):
    """Wheels of eight blades of unit mass and stiffness with Jenkins elements between neighbours.

    Args:
        net: (8,) damping of forward waves of 0..7 nodal diameters, as forces in phase with the
            velocity [1].
        starts: (8, k) complex motion of the blades at rest of their elements.

    Returns:
        (k, 8) amplitude of each wave at the end.
    """
    blades = np.arange(len(net))
    waves = np.exp(2j * np.pi * np.outer(blades, blades) / len(net)) / np.sqrt(len(net))
    back = net[-blades]
    # what forward and backward waves have in common is viscous, the rest circulates
    C = ((waves * (net + back)) @ waves.conj().T).real
    A = np.eye(len(net)) + ((waves * 1j * (net - back)) @ waves.conj().T).real
    dt = 2 * pi / steps
    q, v = starts.real.copy(), -starts.imag
    slider = q - np.roll(q, -1, 0)
    motions = []
    for k in range(cycles * steps):
        relative = q - np.roll(q, -1, 0)
        slider = np.clip(slider, relative - limit / kt, relative + limit / kt)
        force = kt * (relative - slider)
        v += dt * (np.roll(force, 1, 0) - force - A @ q - C @ v)
        q += dt * v
        if k >= (cycles - 60) * steps:
            motions.append(waves.conj().T @ q / np.sqrt(len(net)))
    # a wave turns in its own sense
    spectrum = abs(np.fft.fft(np.array(motions) * np.hanning(len(motions))[:, None, None], axis=0))
    forward = spectrum[: len(motions) // 2].max(axis=0) * 4 / len(motions)
    return forward.T


def test_every_fed_wave_keeps_its_limit_cycle():
    """Two waves are fed: the cycle of either is left by no small motion, that of the wave fed less
    is the larger, and the start decides; against marching from both, and from noise.
    """
    kt, limit = 0.05, 1.0
    net = np.full(8, 0.004)
    fed = {7: -0.002, 5: -0.005}
    net[list(fed)] = list(fed.values())
    expected = {}
    for wave, damping in fed.items():
        # the dampers move by this times the blades
        apart = abs(1 - np.exp(2j * pi * wave / 8))
        mass = single_mass(kt * apart**2, limit * apart)
        amplitudes = limit / (kt * apart) * np.geomspace(1.005, 30, 200)
        points = list(nonlinear_mode(mass, amplitudes, H=1, samples=0))
        expected[wave] = next(c for c in limit_cycles(points, damping) if c.stable).amplitude
    assert expected[7] > 2 * expected[5]
    generator = np.random.default_rng(0)
    noise = generator.normal(size=(8, 3)) + 1j * generator.normal(size=(8, 3))
    turns = np.exp(2j * pi * np.arange(8)[:, None] * np.array([[7, 5, 0]]) / 8)
    starts = turns * [expected[7], expected[5], 0.0] + noise * [1.0, 1.0, 10.0]
    ends = march_fed_ring(net, limit, kt, starts)
    for end, wave in zip(ends[:2], fed, strict=True):
        assert end[wave] == pytest.approx(expected[wave], rel=0.03)
        assert np.delete(end, wave).max() < 0.03 * end[wave]
    # from noise it is one of the two
    survivor = int(np.argmax(ends[2]))
    assert ends[2, survivor] == pytest.approx(expected[survivor], rel=0.03)


def test_flutter_is_refused_in_words():
    points = list(nonlinear_mode(single_mass(0.4, 0.3), [1.0, 1.5, 2.0], H=1, samples=0))
    with pytest.raises(InputError, match="flutter, friction holds .* at most"):
        limit_cycles(points, -0.5)

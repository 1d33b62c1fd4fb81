"""The integrators' steps against the periodic kernels, on bodies too heavy to move, and the limit
of explicit steps.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from friction_cases import coefficients, random_case

from bladefem.damper.explicit import explicit_march
from bladefem.damper.zmass import Footprint, MassOnFoundation, march
from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.aft import evaluate
from bladefem.friction.fourier import synthesis
from bladefem.friction.kernel_1d_exact import evaluate_exact
from bladefem.friction.time_step import stable_step, step_1d, step_2d
from bladefem.time.event_integrator import state_at_rest
from bladefem.time.system import damper_on_platforms

HEAVY = 1e12


def test_explicit_march_reaches_the_exact_harmonics():
    """Sixty elements under their own motions and loads, with stick, slip, gaps and lift-off; second
    order.
    """
    elements, w = random_case(0, 60, 2, 1)
    system = damper_on_platforms(np.zeros((60, 3)), elements, HEAVY)
    load = elements.kn[:, None] * w[:, 0]
    load[:, 0] += elements.n0
    system, exact = replace(system, drive=w[:, 1], normal=load), evaluate_exact(elements, w)
    slips = exact.shares[:, 1] > 0.05  # what sticks keeps the static force of its start
    assert (exact.shares[slips, 2] > 0).sum() > 10
    errors = []
    for steps in (256, 1024):
        period = explicit_march(system, 1.0, steps)
        force = period(period(state_at_rest(system))[0])[-1]
        errors.append(np.abs(coefficients(force.T, 2) - exact.f[:, 1])[slips].max())
    assert errors[1] < 2e-3
    assert np.log2(errors[0] / errors[1]) / 2 > 1.5


def heavy_mass(
    elements: Elements, w: np.ndarray, e: int, samples: int, periods: int = 4
) -> np.ndarray:
    """(2, 2H+1) friction harmonics of element e as the only foot of a mass that stands still."""
    T = synthesis(w.shape[2] // 2, samples)
    body = MassOnFoundation(
        HEAVY, HEAVY, elements.mu[e], elements.kt[e], Footprint(np.zeros((1, 2)), np.ones(1))
    )
    instants = np.arange(periods * samples + 1) % samples
    base, load = (
        (w[e, 1:] @ T.T).T[instants],
        (elements.n0[e] + elements.kn[e] * (T @ w[e, 0]))[instants],
    )
    force = march(body, base, load, 1.0).force[-samples:, :2]
    return coefficients(np.roll(force, 1, axis=0).T, w.shape[2] // 2)  # the last row is at tau = 0


def test_mass_on_its_foundation_reaches_the_periodic_harmonics():
    elements, w = random_case(1, 60, 2, 2)
    forces = evaluate(elements, w, 2048)
    slips = np.flatnonzero(forces.shares[:, 1] > 0.3)
    assert len(slips) > 20
    marched = [heavy_mass(elements, w, e, 4096) for e in slips]
    np.testing.assert_allclose(marched, forces.f[slips, 1:], rtol=0, atol=5e-3)


def test_a_node_that_closes_within_the_step_is_stretched_from_the_contact_on():
    assert step_1d(0.8, -1.0, 3.0, 1.0) == pytest.approx(0.6)
    assert step_2d(0.0, 0.0, 0.8, 0.4, -1.0, 3.0, 1.0)[:2] == pytest.approx((0.6, 0.3))
    assert step_1d(8.0, -1.0, 3.0, 0.5) == pytest.approx(1.5)
    assert step_1d(8.0, 1.0, 0.0, 0.5) == 0.0
    assert step_2d(0.0, 0.0, 8.0, 0.0, 1.0, 1.0, 0.0) == (0.0, 0.0, 0.0)  # no friction


def test_the_longest_explicit_step():
    """Central differences of m x'' + 2 k x = 0 stay bounded just below 2 / sqrt(2 k / m) and blow
    up just above.
    """
    m, k = 0.005, 1e8
    for factor, grows in ((0.999, False), (1.001, True)):
        dt = factor * stable_step(np.sqrt(2 * k / m))
        x = [1.0, 1.0]
        for _ in range(2000):
            x.append(2 * x[-1] - x[-2] - dt**2 * 2 * k / m * x[-1])
        assert (np.abs(x).max() > 1e6) == grows
    assert stable_step(0.0) == np.inf
    with pytest.raises(InputError, match="not negative"):
        stable_step(-1.0)


@pytest.mark.parametrize("path", [1.1, 1.19, 1.2, 1.21, 1.3])
def test_a_force_meets_a_limit_that_falls_about_as_fast_as_it_moves(path):
    """Against ten thousand small steps: the first meeting counts, also where the limit changes
    faster than the force.
    """
    start = np.array([6.99, 0.65])
    way = path * np.array([0.68, -0.73]) / np.hypot(0.68, 0.73)
    loads = np.linspace(23.56, 19.57, 10001)
    fine = start
    for before, after in pairwise(loads):
        fine = np.array(step_2d(*fine, *(way / 10000), before, after, 0.3)[:2])
    found = step_2d(*start, *way, loads[0], loads[-1], 0.3)[:2]
    np.testing.assert_allclose(found, fine, atol=0.05)


def test_a_force_right_against_the_motion_stays_so_in_any_direction():
    """On a line a limit that falls faster than the force is that of one tangent, to rounding."""
    for turn in np.linspace(0.0, 2 * np.pi, 500):
        along = np.array([np.cos(turn), np.sin(turn)])
        for force, way, after in ((2.0, -0.3, 0.9), (1.9, -0.8, 0.5), (2.0, 0.4, 1.1)):
            found = step_2d(*(force * along), *(way * along), 2.0, after, 1.0)[:2]
            line = step_1d(force + way, 2.0, after, 1.0)
            np.testing.assert_allclose(found, line * along, atol=1e-12)

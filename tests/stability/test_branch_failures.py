"""Where a curve of converged points is not what the blade does (F30 to F33): a motion that time
leaves, a damper that walks, a period that doubles, a preload that is not unique. Truth is a plain
march in time. F29, the peak beyond a fold, is in tests/hbm/test_branches.py.
"""

from dataclasses import replace

import numpy as np
import pytest
from models import rebounding, wedge_between_masses
from plain import marched_wedge

from bladefem.data import Elements, RigidBody
from bladefem.friction.fourier import to_complex
from bladefem.hbm.history_interval import history_interval
from bladefem.hbm.linear_resonances import stuck_resonances
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.peak import find_peak
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import STABLE, UNSTABLE, stability_verdict
from bladefem.reduction.matrices import port_model_from_matrices

STEPS = 2000


def bounced(stiffness, gap, loss, omega, q, v, periods):
    """(periods, STEPS) displacement of that mass, by leapfrog."""
    dt = 2 * np.pi / omega / STEPS
    drive = np.cos(2 * np.pi * np.arange(STEPS) / STEPS)
    seen = np.empty((periods, STEPS))
    for period in range(periods):
        for k in range(STEPS):
            seen[period, k] = q
            v += dt * (drive[k] - q - loss * v - stiffness * max(q - gap, 0.0))
            q += dt * v
    return seen


def state_at_start(point):
    h = 1j * np.arange(point.harmonics + 1) * point.omega
    return point.probe[:, 0].sum().real, (h * point.probe[:, 0]).sum().real


@pytest.mark.parametrize(
    ("omega", "verdict", "name"), [(1.5, STABLE, ""), (3.0, UNSTABLE, "period doubling")]
)
def test_F30_a_converged_motion_that_time_leaves(omega, verdict, name):
    """A mass on a stop without gap, driven at twice its own frequency: it answers every second
    period, three times as high.
    """
    model = rebounding(10.0, 0.0, 0.04)
    point = solve(model, omega, 11, 512)
    assert point.converged and point.residual < 1e-9
    found = stability_verdict(model, point)
    assert (found.verdict, found.bifurcation) == (verdict, name)
    q, v = state_at_start(point)
    seen = bounced(10.0, 0.0, 0.04, omega, 1.001 * q, v, 80)
    left = abs(seen[-1] - seen[0]).max() / np.ptp(seen[0])
    if verdict == STABLE:
        assert left < 0.02
    else:
        assert left > 1.0
        assert abs(seen[-1] - seen[-3]).max() < 0.02 * np.ptp(seen[-1])


def mean_friction(point, kt, limit, step):
    """Mean friction force [N] of a motion that goes on by a step in each period, by the return map
    over three of them.

    Args:
        limit: friction coefficient, mean of the normal load [N] and the factor of its sine [N].
    """
    h = np.arange(point.harmonics + 1)
    phase = 2 * np.pi * np.arange(STEPS) / STEPS
    w = (np.exp(1j * np.outer(phase, h)) @ to_complex(point.w)[0, 0]).real
    most = limit[0] * np.maximum(limit[1] + limit[2] * np.sin(phase), 0.0)
    f = np.zeros(STEPS)
    slider = w[0]
    for k in range(3 * STEPS):
        i = k % STEPS
        place = w[i] + step * k / STEPS
        f[i] = np.clip(kt * (place - slider), -most[i], most[i])
        slider = place - f[i] / kt
    return f.mean()


def test_F31_a_damper_that_walks():
    """Friction pushes one way while the load is high: a free damper never comes back, and a balance
    of periodic motions has no place for it. The step that it makes in each period is an unknown,
    and reported as a speed.
    """
    K = np.array([[1.0]])
    body = port_model_from_matrices(
        np.eye(1), K, {"contact": [0], "load": [0], "probe": [0]}, C=0.02 * K
    )
    parts = (20.0, 0.0, 0.5, 0.3)
    element = Elements(*(np.array([x]) for x in parts), tangents=1)
    damper = RigidBody(np.array([[0.3]]), np.array([[1.0]]))
    model = ReducedModel(
        (body,), element, {1: np.array([0.3])}, Damping(), damper, normal={1: np.array([0.25j])}
    )
    omega = 1.3
    point = solve(model, omega, 31, 2048)
    assert point.converged and point.states["slip"] == 1
    # the same motion without the step, which stands in the place of the mean, leaves the damper a
    # mean force that nothing holds
    alone, walking = (
        abs(mean_friction(point, 20.0, (0.5, 0.3, -0.25), step)) for step in (0.0, point.w[0, 0, 0])
    )
    assert alone > 0.02 * 0.5 * 0.3 > 10 * walking
    dt = 2 * np.pi / omega / STEPS
    blade = np.zeros(2)
    rider = np.zeros(2)
    slider = 0.0
    places = []
    for k in range(100 * STEPS):
        phase = 2 * np.pi * (k % STEPS) / STEPS
        limit = 0.5 * max(0.3 - 0.25 * np.sin(phase), 0.0)
        w = blade[0] - rider[0]
        f = min(max(20.0 * (w - slider), -limit), limit)
        slider = w - f / 20.0
        blade[1] += dt * (0.3 * np.cos(phase) - blade[0] - 0.02 * blade[1] - f)
        rider[1] += dt * f / 0.3
        blade[0] += dt * blade[1]
        rider[0] += dt * rider[1]
        if k % STEPS == 0:
            places.append(rider[0])
    steps = np.diff(places[-10:])
    assert abs(steps).min() > 1e-3 * size(point)
    assert len(set(np.sign(steps))) == 1
    # the contact is 60 times as stiff as the blade: the step depends on high harmonics
    assert point.drift * 2 * np.pi / omega == pytest.approx(abs(steps).mean(), rel=0.03)


@pytest.mark.parametrize("omega", [2.8, 3.0])
def test_F32_a_gap_that_answers_every_second_period(omega):
    """A stop that is not touched at rest: the motion of one period, which the balance finds to
    1e-9, is left within a few periods, for one of two periods and another height.
    """
    model = rebounding(10.0, 0.1, 0.04)
    point = solve(model, omega, 15, 1024)
    assert point.converged and point.residual < 1e-9
    found = stability_verdict(model, point)
    assert (found.verdict, found.bifurcation) == (UNSTABLE, "period doubling")
    q, v = state_at_start(point)
    seen = bounced(10.0, 0.1, 0.04, omega, 1.001 * q, v, 120)
    assert abs(seen[0] - seen[1]).max() < 0.02 * np.ptp(seen[0])
    every_second = abs(seen[-1] - seen[-3]).max() / np.ptp(seen[-1])
    every_period = abs(seen[-1] - seen[-2]).max() / np.ptp(seen[-1])
    assert every_second < 0.02 < 0.3 < every_period
    assert np.ptp(seen[-2:]) > 4 * np.ptp(seen[0])


def test_F33_a_preload_that_is_not_unique():
    """A node that never slips keeps the friction force that assembly left: two histories, two
    motions in time. One balance knows one of them; its interval holds both.
    """
    model = wedge_between_masses(10.0)
    peak = find_peak(model, stuck_resonances(model)[0], 3, 256)
    assert peak.solution.converged and peak.solution.residual < 1e-9
    found = history_interval(model, peak)
    heights = []
    for start in (found.lowest_start, found.highest_start):
        moved, _, _ = marched_wedge(replace(model, start=start), peak.omega, 240, 150, 300, 20.0)
        heights.append(2 * abs(np.fft.rfft(moved)[1]) / len(moved))
    assert heights[1] > 1.04 * heights[0]
    assert heights[0] > 0.98 * found.lowest.height
    assert heights[1] < 1.02 * found.highest.height
    assert abs(np.log(heights[0] / peak.height)) > 0.03

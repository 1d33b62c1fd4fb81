"""Nonlinear modes against the closed form of one Jenkins element, a decaying motion in time, and
the resonances of the full balance.
"""

import numpy as np
import pytest
from models import block, single_mass
from scipy import linalg

from bladefem.errors import InputError
from bladefem.friction.closed_form import jenkins
from bladefem.hbm.nonlinear_modes import force_at_resonance, mode_response, nonlinear_mode
from bladefem.hbm.peak import find_peak
from bladefem.hbm.reference_blade import reference_model


def test_one_element_in_closed_form():
    """omega^2 = 1 + k_eq, 2 zeta omega^2 = omega c_eq: what one harmonic of a Jenkins element
    does.
    """
    kt, limit = 0.6, 0.5
    amplitudes = limit / kt * np.array([0.5, 0.99, 1.2, 2.0, 5.0, 50.0])
    found = list(nonlinear_mode(single_mass(kt, limit), amplitudes, H=1, samples=0))
    law = jenkins(amplitudes, kt, limit)
    assert all(p.converged for p in found), [p.reason for p in found]
    omega = np.sqrt(1 + law.stiffness)
    np.testing.assert_allclose([p.omega for p in found], omega, rtol=1e-9)
    np.testing.assert_allclose(
        [p.zeta for p in found], law.damping / (2 * omega**2), rtol=1e-7, atol=1e-12
    )
    # the energy of friction in a cycle is that of the negative damping
    work = [2 * np.pi * p.zeta * p.omega**2 * p.amplitude**2 for p in found]
    np.testing.assert_allclose(work, law.energy, rtol=1e-7, atol=1e-12)


def test_decay_in_time_follows_the_mode():
    """A free decay marched in time loses amplitude at the rate that the mode tells."""
    kt, limit = 0.2, 0.05
    dt = 2e-3
    x, v, slider = 3.0, 0.0, 0.0
    slider = x - limit / kt
    peaks = []
    times = []
    before = v
    for step in range(200000):
        slider = min(max(slider, x - limit / kt), x + limit / kt)
        v += dt * (-x - kt * (x - slider))
        x += dt * v
        if before > 0 >= v:
            peaks.append(x)
            times.append(step * dt)
        before = v
        if len(peaks) > 8:
            break
    peaks = np.array(peaks)
    middle = np.sqrt(peaks[:-1] * peaks[1:])
    rate = np.log(peaks[:-1] / peaks[1:]) / np.diff(times)
    found = list(nonlinear_mode(single_mass(kt, limit), middle, H=5, samples=0))
    np.testing.assert_allclose([p.zeta * p.omega for p in found], rate, rtol=0.02)
    np.testing.assert_allclose([p.omega for p in found], 2 * np.pi / np.diff(times), rtol=0.005)


@pytest.mark.parametrize("load", [0.3, 2.0, 8.0])
def test_resonance_of_the_balance_is_predicted(load):
    """The reference blade with a sliding damper: peaks of the full balance from the mode alone."""
    model = reference_model(load=load, phase=1.0, points=2, modes=8, harmonics=3)
    blades = model.blades(1)
    modal = abs(blades.shapes[-1, blades.load] @ np.eye(8)[0])[0]
    points = list(nonlinear_mode(model, np.geomspace(1e-6, 1e-3, 60), samples=128))
    assert all(p.converged for p in points)
    drive = np.array([force_at_resonance(model, p) for p in points])
    i = int(np.argmax(drive > modal))
    assert i > 0
    share = (modal - drive[i - 1]) / (drive[i] - drive[i - 1])
    height = [np.linalg.norm(p.probe[1:, 0]) for p in points[i - 1 : i + 1]]
    predicted = height[0] + share * (height[1] - height[0])
    omega = points[i - 1].omega + share * (points[i].omega - points[i - 1].omega)
    peak = find_peak(model, omega, 3, 128)
    assert predicted == pytest.approx(peak.height, rel=0.03)
    assert omega == pytest.approx(peak.omega, rel=0.005)
    drawn = mode_response(model, points, np.array([peak.omega]))
    assert drawn[0, i - 1] < 1.1 and drawn[0, i + 1] > 0.9


def test_close_modes_are_followed_from_the_stuck_mode():
    """A body whose modes lie close together, with stiff contacts: from a linear mode of the stuck
    body, through slip and lift-off, to where the contacts hardly matter.
    """
    nodes = 20
    model = block(nodes, dofs=80)
    body = model.side(1)
    # all modes are kept: the body's own stiffness plus the springs of the stuck contacts
    shapes = body.shapes[body.ports["contact"]]
    held = np.diag(body.omega**2) + shapes.T @ (model.springs.reshape(-1, 1) * shapes)
    squared, vectors = linalg.eigh(held)
    stuck = np.sqrt(squared[np.argmax(abs(vectors[0]))])
    largest = abs(shapes[:, 0]).max()
    found = list(nonlinear_mode(model, np.geomspace(0.05, 50, 20) / largest, H=1, samples=64))
    assert all(p.converged for p in found), [p.reason for p in found if not p.converged]
    assert found[0].omega == pytest.approx(stuck, rel=1e-9)
    assert found[-1].omega == pytest.approx(body.omega[0], rel=0.03)


def test_bad_input_is_refused():
    model = single_mass()
    with pytest.raises(InputError, match="mode 3: expected an elastic mode from 0 to 0"):
        next(nonlinear_mode(model, [1.0], mode=3))
    with pytest.raises(InputError, match="amplitude -1"):
        next(nonlinear_mode(model, [-1.0]))

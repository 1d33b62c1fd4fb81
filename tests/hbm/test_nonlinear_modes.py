"""Nonlinear modes against the closed form of one Jenkins element, a decaying motion in time, and
the resonances of the full balance.
"""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass
from scipy import linalg

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.closed_form import jenkins
from bladefem.hbm.mode_equations import (
    amplitude_derivative,
    mode_frame,
    mode_jacobian,
    mode_residual,
)
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.nonlinear_modes import (
    force_at_resonance,
    modal_forces,
    nonlinear_mode,
)
from bladefem.hbm.peak import find_peak
from bladefem.hbm.reference_blade import reference_model
from bladefem.reduction.matrices import port_model_from_matrices


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


def forces_in_time(model, w, samples):
    """(n, 3) complex first harmonics of the contacts' forces by a return map, and their means;
    displacements (n, 3, 2H+1), contacts that lift off.
    """
    e = model.elements
    t = 2 * np.pi * np.arange(samples) / samples
    H = w.shape[2] // 2
    x = np.repeat(w[:, :, :1], samples, axis=2)
    for h in range(1, H + 1):
        x = x + w[:, :, 2 * h - 1, None] * np.cos(h * t) + w[:, :, 2 * h, None] * np.sin(h * t)
    normal = np.maximum(e.n0[:, None] + e.kn[:, None] * x[:, 0], 0.0)
    f = np.zeros_like(x)
    f[:, 0] = normal
    force = e.kt[:, None] * x[:, 1:, 0]
    for step in range(1, 9 * samples):
        k = step % samples
        force = force + e.kt[:, None] * (x[:, 1:, k] - x[:, 1:, k - 1])
        size = np.linalg.norm(force, axis=1)
        limit = e.mu * normal[:, k]
        force = force * np.minimum(1.0, limit / np.maximum(size, 1e-300))[:, None]
        f[:, 1:, k] = force
    turn = np.exp(-1j * t)
    return 2 / samples * (f @ turn), f.mean(axis=2)


def test_corners_of_lifting_contacts_are_passed():
    """Contacts that lift off, three harmonics, 64 samples: the branch turns by more than a right
    angle at corners of the sampled forces. Eight of the twenty amplitudes were not reached before.
    Each motion fulfils the equations of all modes, with forces by a return map in NumPy of 512
    steps, to what 64 samples leave.
    """
    model = block(5, dofs=60)
    body = model.side(1)
    shapes = body.shapes[body.ports["contact"]]
    amplitudes = np.geomspace(0.05, 50, 20) / abs(shapes[:, 0]).max()
    found = list(nonlinear_mode(model, amplitudes, H=3, samples=64))
    assert all(p.converged for p in found), [p.reason for p in found if not p.converged]
    lifted = 0
    for p in found:
        harmonic, mean = forces_in_time(model, p.w, 512)
        lifted += mean[:, 0].min() > 1.01 * model.elements.n0.min()
        assert_of_all_modes(body, p, harmonic, 0)
    assert lifted > 5


def assert_of_all_modes(body, p, harmonic, mode):
    """The motion of a nonlinear mode is that of all modes under its contact forces."""
    shapes = body.shapes[body.ports["contact"]]
    f = shapes.T @ harmonic.ravel()
    Z = body.omega**2 - p.omega**2 * (1 + 2j * p.zeta)
    q = -f / Z
    q[mode] = p.amplitude
    moved = p.w[:, :, 1] - 1j * p.w[:, :, 2]
    np.testing.assert_allclose(shapes @ q, moved.ravel(), atol=1e-2 * abs(moved).max())
    assert abs(Z[mode] * p.amplitude + f[mode]) < 1e-2 * abs(f).max()


def two_modes(own, shapes, kt, limit):
    """Two modes on one Jenkins element, without damping of their own."""
    ports = {"contact": shapes[None], "load": np.array([0]), "probe": np.array([0])}
    body = port_model_from_matrices(np.eye(2), np.diag(own**2), ports)
    elements = Elements(np.array([kt]), np.zeros(1), np.ones(1), np.array([limit]), tangents=1)
    return ReducedModel((body,), elements, {1: np.array([1.0])}, Damping(ratio=0.0))


def closed_branch(own, shapes, kt, limit, displacement):
    """Amplitude of the second mode and squared complex frequency against the contact's own
    displacement: with the element's complex stiffness both modes are a linear eigenproblem.
    """
    law = jenkins(displacement, kt, limit)
    amplitude, squared = [], []
    for x, stiffness in zip(displacement, law.stiffness + 1j * law.damping, strict=True):
        values, vectors = np.linalg.eig(np.diag(own**2) + stiffness * np.outer(shapes, shapes))
        share = abs(vectors[1] / (shapes @ vectors))
        # of the branch that ends as the second mode
        one = int(np.argmin(abs(values - (squared[-1] if squared else own[1] ** 2))))
        amplitude.append(x * share[one])
        squared.append(values[one])
    return np.array(amplitude), np.array(squared)


def test_folds_in_amplitude_are_followed_in_closed_form():
    """A mode above another one: as the contact lets go, their motions at it cancel, and the
    amplitude of the mode falls before it grows again.
    """
    own, shapes, kt, limit = np.array([1.0, 1.2]), np.array([0.9, np.sqrt(0.19)]), 2.0, 0.5
    x = np.geomspace(200, 0.5, 20000) * limit / kt
    amplitude, squared = (part[::-1] for part in closed_branch(own, shapes, kt, limit, x))
    x = x[::-1]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(amplitude)))) + 1
    assert len(turns) == 2
    model = two_modes(own, shapes, kt, limit)
    found = list(nonlinear_mode(model, np.geomspace(1.5, 40, 15), 1, H=1, samples=0))
    assert all(p.converged for p in found)
    folds = [p for p in found if p.fold]
    np.testing.assert_allclose([p.amplitude for p in folds], amplitude[turns], rtol=5e-4)
    # each motion is one of the closed form, in its order
    moved = np.array([np.hypot(*p.w[0, 0, 1:3]) for p in found])
    assert (np.diff(moved) > 0).all()
    for p, size in zip(found, moved, strict=True):
        assert p.amplitude == pytest.approx(np.interp(size, x, amplitude), rel=1e-5)
        value = p.omega**2 * (1 + 2j * p.zeta)
        assert value == pytest.approx(np.interp(size, x, squared), rel=1e-5)
    # both parts between the folds, and on the far side
    between = [p for p in found if folds[0].omega > p.omega and p.amplitude < folds[0].amplitude]
    assert len(between) > 3 and found[-1].amplitude == pytest.approx(40.0)


# readings of the probe of `whirling`
SEEN = np.array([1.0, 0.3, 0.2])


def whirling(turn, kt, limit):
    """Three modes that Coriolis forces couple, on one Jenkins element; the coupling has a loss too,
    which nonlinear modes leave out.
    """
    own = np.array([1.0, 1.3, 2.1])
    shapes = np.array([0.8, 0.5, -0.6])
    coupling = turn * np.array([[0.0, 1.0, 0.4], [-1.0, 0.0, -0.7], [-0.4, 0.7, 0.0]])
    ports = {"contact": shapes[None], "load": np.array([0]), "probe": SEEN[None]}
    C = coupling + 0.01 * np.eye(3)
    body = port_model_from_matrices(np.eye(3), np.diag(own**2), ports, C=C)
    elements = Elements(np.array([kt]), np.zeros(1), np.ones(1), np.array([limit]), tangents=1)
    model = ReducedModel((body,), elements, {1: np.array([1.0])}, Damping(ratio=0.0))
    return model, own, shapes, coupling


@pytest.mark.parametrize("turn", [0.02, 0.15, -0.15])
def test_coriolis_forces_in_closed_form(turn):
    """With the complex stiffness of the element the motion is an eigenvector of a matrix that has
    the frequency in it; amplitude, frequency, damping and the probe for each displacement of the
    contact.
    """
    kt, limit = 0.6, 0.5
    model, own, shapes, coupling = whirling(turn, kt, limit)
    amplitudes = np.geomspace(0.3, 30, 12)
    found = list(nonlinear_mode(model, amplitudes, 0, H=1, samples=0))
    assert all(p.converged for p in found), [p.reason for p in found]
    for p in found:
        x = np.hypot(*p.w[0, 0, 1:3])
        law = jenkins(np.array([x]), kt, limit)
        stiffness = law.stiffness[0] + 1j * law.damping[0]
        omega = p.omega
        matrix = np.diag(own**2) + 1j * omega * coupling + stiffness * np.outer(shapes, shapes)
        values, vectors = np.linalg.eig(matrix)
        one = int(np.argmin(abs(values - omega**2)))
        assert values[one] == pytest.approx(omega**2 * (1 + 2j * p.zeta), rel=1e-8)
        vector = vectors[:, one] * x / abs(shapes @ vectors[:, one])
        assert abs(vector[0]) == pytest.approx(p.amplitude, rel=1e-8)
        assert abs(p.probe[1, 0]) == pytest.approx(abs(SEEN @ vector), rel=1e-7)
    # the forces are felt
    still = list(nonlinear_mode(whirling(0.0, kt, limit)[0], amplitudes, 0, H=1, samples=0))
    assert abs(found[-1].omega / still[-1].omega - 1) > 1e-4


@pytest.mark.parametrize("force", [0.02, 0.08, 0.4])
def test_resonance_with_coriolis_forces_is_predicted(force):
    """The balance of one harmonic, whose modes are damped as well; without Coriolis forces the
    prediction is off by 2.6 % at most.
    """
    model = replace(whirling(0.15, 0.6, 0.5)[0], excitation={1: np.array([force])})
    points = list(nonlinear_mode(model, np.geomspace(0.05, 60, 120), 0, H=1, samples=0))
    drive = np.array([force_at_resonance(model, p) for p in points]) / modal_forces(model, points)
    i = int(np.argmax(drive > 1))
    assert i > 0
    share = -np.log(drive[i - 1]) / np.log(drive[i] / drive[i - 1])
    sizes = [abs(p.probe[1, 0]) for p in points[i - 1 : i + 1]]
    predicted = sizes[0] * (sizes[1] / sizes[0]) ** share
    omega = points[i - 1].omega + share * (points[i].omega - points[i - 1].omega)
    peak = find_peak(model, omega, 1, 0)
    assert predicted == pytest.approx(peak.height, rel=0.03)
    assert omega == pytest.approx(peak.omega, rel=0.005)


def test_derivatives_with_coriolis_forces_are_those_of_differences():
    model, *_ = whirling(0.15, 0.6, 0.5)
    frame = mode_frame(model, 0, 3, 256)
    rng = np.random.default_rng(0)
    w = 2.0 * rng.normal(size=7)
    state = mode_residual(frame, w, 1.7)
    J = mode_jacobian(frame, state, 1.7)
    step = 1e-6
    for k in range(7):
        moved = np.eye(7)[k] * step
        up, down = (mode_residual(frame, w + sign * moved, 1.7).r for sign in (1, -1))
        np.testing.assert_allclose(J[:, k], (up - down) / (2 * step), atol=2e-5)
    up, down = (mode_residual(frame, w, 1.7 + sign * step).r for sign in (1, -1))
    slope = amplitude_derivative(frame, state, 1.7)
    np.testing.assert_allclose(slope, (up - down) / (2 * step), atol=2e-5)


def test_bad_input_is_refused():
    model = single_mass()
    with pytest.raises(InputError, match="mode 3: expected an elastic mode from 0 to 0"):
        next(nonlinear_mode(model, [1.0], mode=3))
    with pytest.raises(InputError, match="amplitude -1"):
        next(nonlinear_mode(model, [-1.0]))


def test_amplitudes_beyond_an_internal_resonance_are_found_by_a_detour():
    """Two amplitudes where the branch leaves with another mode, whose third harmonic nothing damps:
    seven were not reached before on bodies of 5 contacts. Each motion is one of all modes.
    """
    model = block(5, dofs=60)
    body = model.side(1)
    shapes = body.shapes[body.ports["contact"]]
    amplitudes = np.geomspace(0.05, 50, 20) / abs(shapes[:, 2]).max()
    found = list(nonlinear_mode(model, amplitudes, 2, H=3, samples=128))
    assert all(p.converged for p in found), [p.reason for p in found if not p.converged]
    turned = [p for p in found if "by a detour" in p.reason]
    assert turned
    for p in turned:
        harmonic, _ = forces_in_time(model, p.w, 512)
        assert_of_all_modes(body, p, harmonic, 2)


def test_an_amplitude_left_says_which_mode_it_meets():
    """No arcs are allowed: the branch ends before its first fold, and the reason names the mode."""
    own, shapes, kt, limit = np.array([1.0, 1.2]), np.array([0.9, np.sqrt(0.19)]), 2.0, 0.5
    model = two_modes(own, shapes, kt, limit)
    found = list(nonlinear_mode(model, np.geomspace(1.5, 40, 15), 1, H=1, samples=0, arcs=0))
    lost = [p for p in found if not p.converged]
    assert all("1 times its frequency is" in p.reason for p in lost)
    assert all("off mode 1 there" in p.reason for p in lost)

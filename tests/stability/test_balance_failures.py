"""Where harmonic balance itself goes wrong, and what bladefem does there (F05, F07, F08, F10, F11,
F14, F19).

What the older methods do on the same examples stands in test_paper_failures.py. The blade is
`bladefem.hbm.reference_blade`: 220.9 and 1236.6 Hz, a rigid damper of mass m between each two
blades.
"""

from dataclasses import replace

import numpy as np
import pytest

from bladefem.data import Elements
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.parameters import vary
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.fallback import solve_balance
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS, newton
from bladefem.hbm.solver.residual import Balance, evaluate_balance, start_in_stick
from bladefem.hbm.sweep import sweep
from bladefem.reduction.matrices import port_model_from_matrices

HZ = 2 * np.pi


def test_F05_newton_near_the_stick_limit():
    """Where iterations on equivalent stiffnesses wander, for any number of harmonics."""
    model = reference_model(2e7, 0.01, 2.115, points=5, modes=5, harmonics=15)
    solutions = [
        solve(model, HZ * 1213.42, H, samples)
        for H, samples in ((1, 512), (3, 128), (7, 256), (15, 1024))
    ]
    assert all(s.converged and s.method == "newton" and s.states["slip"] == 10 for s in solutions)
    assert max(s.iterations for s in solutions) <= 40


def test_F07_a_pinned_node_is_no_solution():
    """A node held at w = 0 by an infinite stiffness f / w satisfies the quotient form; the additive
    form refuses it.
    """
    model = reference_model(1e6, 0.06, 1.4, points=3, phase=0.6, modes=5, harmonics=3)
    omega = HZ * 1340
    balance = Balance(model, condense(model, omega, 3), 256)
    exact = solve(model, omega, 3, 256)
    pinned = exact.w.copy()
    pinned[0] = 1e-9 * pinned[0]
    state = evaluate_balance(balance, pinned)
    assert state.error > 0.05
    again = solve(model, omega, 3, 256, start=replace(exact, w=pinned))
    assert again.converged
    np.testing.assert_allclose(again.w, exact.w, rtol=0, atol=1e-8 * abs(exact.w).max())


def test_F08_the_stuck_undamped_damper_never_settles_but_its_balance_is_solved():
    """Integrated from rest, the damper on its springs rings for ever at its own frequency."""
    omega, kt, mass = HZ * 1367.8, 1e6, 0.06
    solution = solve(reference_model(kt, mass, 5.0, harmonics=7), omega, 7, 512)
    assert solution.converged and solution.residual < 1e-10
    own = np.sqrt(2 * kt / mass)
    t = np.arange(600 * 64) / 64 * 2 * np.pi / omega
    rest = (
        (np.cos(omega * t) - np.cos(own * t)) * own**2 / (own**2 - omega**2)
    )  # driven by cos(omega t), from rest
    periods = rest.reshape(600, 64)
    drift = abs(np.diff(periods, axis=0)).max(axis=1)
    assert drift[300:].max() > 0.1 * abs(rest).max()


@pytest.mark.parametrize("load", [1.395, 10.3])
def test_F10_one_harmonic_with_stiff_contacts(load):
    """The peak of H = 1 is far off; a Newton step with more harmonics says so without solving
    again.
    """
    peaks = {}
    for H in (1, 7, 15):
        model = reference_model(2e7, 0.06, load, modes=5, harmonics=15)
        points = sweep(model, (HZ * 950, HZ * 1300), H, 512, peak=5e-3, curve=0.1)
        peaks[H] = max((p for p in points if p.converged), key=size)
    off = abs(size(peaks[1]) / size(peaks[15]) - 1)
    assert off > 0.05
    assert abs(size(peaks[7]) / size(peaks[15]) - 1) < 0.2 * off
    richer = solve(model, peaks[1].omega, 15, 512, start=peaks[1])
    assert abs(richer.probe[1, 0] / peaks[1].probe[1, 0] - 1) > 0.02


def test_F11_newton_on_the_residual_stalls_and_the_chain_does_not():
    model = reference_model(2e7, 0.06, 3.05, phase=np.pi / 3, modes=3, harmonics=31)
    omega = HZ * 1355.4
    balance = Balance(model, condense(model, omega, 31), 2048)
    stalled = newton(balance, start_in_stick(balance), DEFAULT_OPTIONS, "residual")
    assert not stalled.converged and "stalled" in stalled.reason
    attempts = solve_balance(balance, None, DEFAULT_OPTIONS)
    assert attempts[-1].end.converged and sum(a.end.iterations for a in attempts) <= 60
    reached = solve(model, omega, 31, 2048)
    for other in (_by_harmonics(model, omega), _by_load(model, omega)):
        assert other.converged and other.method == "newton"
        # every contact slips: the mean position of the free damper is not determined
        moving = abs(other.w - reached.w)[:, :, 1:]
        assert moving.max() < 1e-7 * abs(reached.w).max()
        np.testing.assert_allclose(other.f, reached.f, rtol=0, atol=1e-7 * abs(reached.f).max())


def _by_harmonics(model, omega):
    """3, 7, 15, 31 harmonics, each started from the one before."""
    solution = None
    for H in (3, 7, 15, 31):
        solution = solve(model, omega, H, 2048, start=solution)
    return solution


def _by_load(model, omega):
    """From a load under which all sticks down to the true one in 25 steps, as the catalogue has
    it.
    """
    solution = None
    for factor in np.geomspace(100, 1, 25):
        solution = solve(vary(model, "load", factor), omega, 31, 2048, start=solution)
    return solution


def test_F14_a_stiff_contact_started_in_slip_ends_in_stick():
    """From slip the derivative of the force is zero, and undamped Newton hops; halved steps end in
    the stuck state.
    """
    mass, kt, limit = 0.035, 1e8, 10.0
    ports = {name: np.array([0]) for name in ("contact", "load", "probe")}
    body = port_model_from_matrices(np.eye(1) * mass, np.eye(1), ports)
    model = ReducedModel(
        (body,),
        Elements(np.array([kt]), np.zeros(1), np.ones(1), np.array([limit]), 1),
        {1: np.array([4.0])},
        Damping(ratio=0.01),
    )
    stick = solve(model, HZ * 100, 3, 64)
    again = solve(model, HZ * 100, 3, 64, start=replace(stick, w=20 * stick.w))
    assert stick.states["stick"] == 1 and again.converged
    np.testing.assert_allclose(again.w, stick.w, rtol=0, atol=1e-9 * abs(stick.w).max())


def test_F19_two_coarse_patches_agree_on_a_wrong_answer():
    """With 3 points and with 2 nothing slips, equal to 1e-13; the edges of the finest patch do:
    half the motion.
    """
    omega = HZ * 1385.7 * 1.01
    heights = {
        n: size(
            solve(reference_model(1e6, 0.06, 12.0, points=n, modes=5, harmonics=7), omega, 7, 256)
        )
        for n in (2, 3, 80)
    }
    assert heights[2] == pytest.approx(heights[3], rel=1e-12)
    assert abs(heights[3] / heights[80] - 1) > 0.4

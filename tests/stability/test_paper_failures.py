"""Where the paper's methods fail (F05-F11, F14), and what reaches the right answer there.

Each test has two halves: the fragile method failing as recorded, and a detection or a method that
does not fail.
"""

from dataclasses import replace

import numpy as np
import pytest
from systems import friction_oscillator

from bladefem.damper.accelerate import Rules, iterate
from bladefem.damper.direct import contact_step, direct
from bladefem.damper.explicit import damper_cycle
from bladefem.damper.paper import damper_response, platform
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.sweep import sweep
from bladefem.study.adaptive.check_points import peak_of
from bladefem.study.adaptive.family import Family, Member
from bladefem.study.adaptive.resonance_curve import resonance_curve
from bladefem.study.adaptive.settings import first_for
from bladefem.time.shooting import periodic_solution, probe_harmonics
from bladefem.time.system import blade_ring, damper_on_platforms

HZ = 2 * np.pi


def blade(kt, load, mass, phase=0.0):
    """The reference blade with five contact points a side and five modes; no residual
    flexibility.
    """
    model = reference_model(kt, mass, load, phase=phase, points=5, modes=5)
    return replace(
        model, sides=tuple(replace(side, residual=0 * side.residual) for side in model.sides)
    )


def judged(model, omega):
    """First harmonic at the tip by shooting on the exact flow of the coupled system (phase 0)."""
    system = blade_ring(
        model.side(0), 0.002, model.elements, float(model.damper.mass[0, 0]), 1 + 0j
    )
    solution = periodic_solution(system, omega)
    assert solution.converged
    return probe_harmonics(solution, system, 1)[0, 1]


def test_f05_picard_and_secants_near_the_stick_slip_transition():
    model, omega = blade(2e7, 2.115, 0.01), 2 * np.pi * 1213.42
    side = platform(model, omega, 1)
    for method in ("picard", "complex", "parts"):
        assert not iterate(
            side, method, Rules(criterion="residual", tolerance=1e-6, damper="march")
        ).converged
    newton = iterate(side, "describing", Rules(criterion="residual", tolerance=1e-6))
    assert newton.converged
    assert newton.residual < 1e-4
    full = solve(model, omega, 31, 4096)
    assert full.converged
    assert abs(full.probe[1, 0] / judged(model, omega) - 1) < 1e-4  # 4.5e-5; 1.0e-3 with H = 15


@pytest.mark.parametrize(
    ("method", "load", "frequency"), [("parts", 1.0, 1231.43), ("anderson", 1.58489, 1388.57)]
)
def test_f06_a_small_step_is_no_equilibrium(method, load, frequency):
    """Eq. 35 at 2 % accepts points that are 202 % and 135 % off; the residual of the equilibrium
    refuses them.
    """
    model, omega = blade(1e6, load, 0.06), 2 * np.pi * frequency
    side, true = platform(model, omega, 1), judged(model, omega)
    stopped = iterate(side, method, Rules())
    assert stopped.converged
    assert abs(stopped.probe[1, 0] / true - 1) > 0.5
    assert stopped.false
    accepted = iterate(side, "amplitude", Rules(criterion="residual", tolerance=1e-4))
    assert accepted.converged
    assert abs(accepted.probe[1, 0] / true - 1) < 0.03  # what one harmonic is worth here
    full = solve(model, omega, 15, 1024)
    assert full.converged
    assert abs(full.probe[1, 0] / true - 1) < 1e-4


def torsion(load):
    """The blade with a torsion of the platform, so that the contact points move differently."""
    model = blade(1e6, load, 0.06)
    side, tilt = model.side(0), np.tile(np.linspace(-1, 1, 5), 2)
    shapes = np.column_stack(
        [side.shapes.real, np.r_[5 * tilt, np.full(len(side.shapes) - 10, 5.0)]]
    )
    body = replace(side, omega=np.r_[side.omega, 2 * np.pi * 1400], shapes=shapes)
    return replace(model, sides=(body,))


def test_f07_the_quotient_pins_a_node():
    """At 3 N and 1280 Hz a node is pinned, 16 % off. Where it was first seen (1.4 N, 1340 Hz)
    Anderson here converges rightly: least over largest motion 0.54, 2e-3 off.
    """
    model, omega = torsion(3.0), 2 * np.pi * 1280
    side = platform(model, omega, 1)
    assert len(side.rows) == 2  # translation and torsion
    pinned = iterate(side, "anderson", Rules(tolerance=1e-9, most=150))
    assert pinned.converged
    size = np.abs(pinned.u[0])
    assert size.min() < 1e-9 * size.max()  # one node does not move at all
    assert pinned.false  # and the residual tells: 0.15
    true = iterate(side, "describing", Rules(criterion="residual", tolerance=1e-8, most=200))
    full = solve(model, omega, 15, 1024)
    assert true.converged
    assert full.converged
    assert abs(true.probe[1, 0] / full.probe[1, 0] - 1) < 1e-2
    assert abs(pinned.probe[1, 0] / full.probe[1, 0] - 1) > 0.1


@pytest.mark.parametrize("load", [20.0])
def test_f08_a_stuck_damper_never_settles_from_rest(load):
    model, omega = blade(1e6, load, 0.06), 2 * np.pi * 1367.8
    side, true = platform(model, omega, 1), judged(model, omega)
    motion = np.concatenate([np.zeros((1, 10)), side.free]).T
    cycle = damper_cycle(damper_on_platforms(motion, model.elements, 0.06), omega, 512)
    assert cycle.reason.startswith("not periodic after 300 periods")
    paper = iterate(side, "amplitude", Rules(damper="march"))
    assert paper.converged  # by Eq. 35
    assert abs(paper.probe[1, 0] / true - 1) > 0.7  # 110 %
    assert paper.false  # the residual knows
    exact = damper_response(side, side.free, "shooting")
    assert exact.reason == "periodic"
    robust = iterate(side, "amplitude", Rules(criterion="residual", tolerance=1e-6))
    assert robust.converged
    assert abs(robust.probe[1, 0] / true - 1) < 1e-6


def test_f09_one_stiffness_cannot_serve_two_harmonics():
    """One averaged stiffness: 8.4 % off in the first harmonic, the fifth thirty times its size; one
    for each: 1.2 %.

    By every method and both ways to solve the damper; recorded were 15.6 % and 321 %, with another
    patch.
    """
    model, omega = blade(1e6, 1.0, 0.06), 2 * np.pi * 247.32
    model = replace(model, excitation={1: np.array([1.0]), 5: np.array([1.0])})
    full, side = solve(model, omega, 25, 2048), platform(model, omega, 5)
    assert full.converged
    error = {}
    for averaged in (True, False):
        found = iterate(side, "amplitude", Rules(averaged=averaged, tolerance=1e-3))
        assert found.converged
        error[averaged] = np.abs(found.probe[[1, 5], 0] / full.probe[[1, 5], 0] - 1)
    assert error[True][0] == pytest.approx(0.084, abs=0.003)
    assert error[True][1] > 20
    assert error[False][0] < 2e-3
    assert error[False][1] < 0.05


@pytest.mark.parametrize(
    ("load", "near", "amplitude", "shift"),
    [(1.395, (1113, 1116, 1119), -0.229, -0.019), (10.3, (1083, 1086, 1089), 0.128, 0.002)],
)
def test_f10_peaks_of_the_one_harmonic_iteration(load, near, amplitude, shift):
    """The peak is 23 % too low and 1.9 % too low in frequency, or 13 % too high; the automatic
    choice sees it.
    """
    model = blade(2e7, load, 0.06)
    points = [
        iterate(
            platform(model, HZ * f, 1), "amplitude", Rules(criterion="residual", tolerance=1e-5)
        )
        for f in near
    ]
    assert all(p.converged for p in points)  # each solves its own equations
    heights = [abs(p.probe[1, 0]) for p in points]
    assert max(heights) == heights[1]  # the peak lies between
    true = peak_of([p for p in sweep(model, (HZ * 1000, HZ * 1250), 15, 512, peak=2e-3, curve=0.2)])
    assert heights[1] / size(true) - 1 == pytest.approx(amplitude, abs=0.02)
    assert near[1] / true.frequency - 1 == pytest.approx(shift, abs=3e-3)
    # only harmonics and samples are open: the model itself is the truth here
    family = Family(lambda _: Member(model, np.arange(len(model.elements.kt))), 5)
    first = replace(first_for(5), points=None, chosen=("harmonics", "samples"))
    chosen = resonance_curve(family, first, (1000.0, 1250.0), 2, 0.02)
    assert chosen.settings.harmonics >= 3
    assert size(peak_of(chosen.points)) == pytest.approx(size(true), rel=0.02)
    assert peak_of(chosen.points).frequency == pytest.approx(true.frequency, rel=3e-3)


def test_f10_one_harmonic_of_the_platform_is_not_enough_for_stiff_contacts():
    model, omega = blade(2e7, 2.115, 0.01), 2 * np.pi * 1213.42
    one, full = (
        iterate(platform(model, omega, 1), "describing", Rules(tolerance=1e-4)),
        solve(model, omega, 31, 4096),
    )
    assert one.converged
    assert one.residual < 1e-4  # right within its own model ...
    assert (
        abs(one.probe[1, 0] / full.probe[1, 0] - 1) > 0.05
    )  # ... and 9 % from the truth, which shooting confirms
    assert abs(full.probe[1, 0] / judged(model, omega) - 1) < 1e-4


def test_f11_travelling_wave_by_shooting_and_by_balance():
    """Phase pi/3: six blades of a ring in time against one blade with phased harmonics."""
    model, omega = (
        reference_model(2e7, 0.06, 3.05, phase=np.pi / 3, points=1, modes=3),
        2 * np.pi * 1355.4,
    )
    model = replace(
        model, sides=tuple(replace(side, residual=0 * side.residual) for side in model.sides)
    )
    full = solve(model, omega, 31, 2048)
    assert full.converged
    system = blade_ring(model.side(0), 0.002, model.elements, 0.06, 1 + 0j, blades=6, waves=1)
    ringed = periodic_solution(system, omega, samples=128)
    assert ringed.converged
    assert abs(full.probe[1, 0] / probe_harmonics(ringed, system, 1)[0, 1] - 1) < 2e-4
    side = platform(model, omega, 1)
    assert not iterate(side, "picard", Rules(criterion="residual", tolerance=1e-6)).converged


def test_f14_newton_hops_between_slip_directions():
    """k h^2 / 4 m = 7.14: plain Newton started in slip alternates for ever; the stick predictor
    needs one solve.
    """
    k, c, limit, aim = 1e8, 4 * 0.035 / 1e-8, 15.0, 1e-8  # c (x - aim) + clip(k x) = 0
    assert k / c == pytest.approx(7.14, abs=0.01)
    x, trace = aim + limit / c, []
    for _ in range(50):
        force, stiffness = np.clip(k * x, -limit, limit), k * (abs(k * x) < limit)
        trace.append(c * (x - aim) + force)
        x -= trace[-1] / (c + stiffness)
    assert np.abs(trace[2:]) == pytest.approx(2 * limit, rel=1e-9)
    assert (np.sign(trace[2:-1]) == -np.sign(trace[3:])).all()
    force = np.empty(1)
    one = np.ones((1, 1))
    assert contact_step(
        np.array([k * aim]), np.array([limit]), k / c * one, 0 * one, np.ones(1), force
    )
    assert force[0] == pytest.approx(k * aim / (1 + k / c), rel=1e-12)
    assert c * (force[0] / k - aim) + force[0] == pytest.approx(0, abs=1e-12 * limit)


def test_newmark_follows_a_damped_oscillator_through_stick_and_slip():
    system, omega = friction_oscillator(200 * np.pi, 0.02, 2e7, 3.0, 5 + 0j), 2 * np.pi * 100
    cycle = direct(system, omega, 200)  # k h^2 / 4 m = 12.5
    assert cycle.reason == "periodic"
    exact = probe_harmonics(periodic_solution(system, omega), system, 1)[0, 1]
    assert abs(2 * np.fft.rfft(cycle.q[:, 0])[1] / 200 / exact - 1) < 5e-3

"""Verdicts on single solutions: against the monodromy of the event-exact flow, against marching,
and for models that neither of the two takes.
"""

from dataclasses import replace

import numpy as np
import pytest
from models import bouncing, bouncing_wave, single_mass

from bladefem.damper.branch import inclined_contact, state_of
from bladefem.hbm.continuation import follow
from bladefem.hbm.flow_map import flow_map
from bladefem.hbm.model import Damping
from bladefem.hbm.sector_modes import blades_of_wave, sector_modes
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import (
    STABLE,
    UNIQUE,
    UNKNOWN,
    UNSTABLE,
    linearised_contacts,
    stability_verdict,
    verdict_operations,
)
from bladefem.hbm.time_model import time_system
from bladefem.time.shooting import floquet_multipliers, periodic_solution

HZ = 2 * np.pi


def test_multipliers_are_those_of_the_event_exact_flow():
    """Along a path with two folds, from rocking over the unstable motion to partial slip."""
    model, _ = inclined_contact()
    start = solve(model, HZ * 200, 15, 512)
    path = [
        p.solution
        for p in follow(
            model, "omega", start, (HZ * 110, HZ * 200), forward=False, steps=(0.01, 0.05)
        )
    ]
    system = time_system(model, 1)
    reported = []
    errors = []
    for point in path[20::12]:
        found = stability_verdict(model, point)
        reported.append(found.verdict)
        if point.states["stick"] == len(point.w):
            continue
        shot = periodic_solution(system, point.omega, state_of(point, system), most=8)
        exact = float(abs(floquet_multipliers(shot)).max())
        # sliders that never move have exactly one, and are left out here
        if shot.residual < 1e-6 and abs(exact - 1) > 1e-6:
            errors.append(abs(found.multiplier - exact))
            assert found.verdict == (UNSTABLE if exact > 1.001 else STABLE)
            assert found.bifurcation == ("fold" if exact > 1.001 else "")
    assert {STABLE, UNSTABLE} <= set(reported) and len(errors) > 5
    assert max(errors) < 1e-3


def test_prescribed_loads_have_one_motion_only():
    model = replace(single_mass(), damping=Damping(ratio=0.01))
    point = solve(model, 1.1, 3, 128)
    assert stability_verdict(model, point).verdict == UNIQUE


def marched(model, point, periods, steps=1000):
    """Displacement of the first mass over the last period, from the solution disturbed by 1e-3."""
    body = model.sides[0]
    e = model.elements
    kt, kn, mu, n0 = (float(x[0]) for x in (e.kt, e.kn, e.mu, e.n0))
    U = body.shapes[body.ports["contact"]]
    H = point.harmonics
    f = point.f[0]
    q = np.zeros((3, H + 1), dtype=complex)
    for h in range(H + 1):
        w = h * point.omega
        force = f[:, 2 * h - 1] - 1j * f[:, 2 * h] if h else f[:, 0] - [n0, 0.0, 0.0]
        load = body.shapes[body.ports["load"]].T @ model.loads(H)[h] - U.T @ force
        q[:, h] = load / (body.omega**2 - w**2 + 1j * w * body.damping)
    v = (1j * point.omega * np.arange(H + 1) * q).sum(axis=1).real
    q = q.sum(axis=1).real * (1 + 1e-3)
    slider = (U @ q)[1:] - (f[1:, 0] + f[1:, 1::2].sum(axis=1)) / kt
    dt = 2 * np.pi / point.omega / steps
    push = body.shapes[body.ports["load"]].T @ model.loads(1)[1]
    seen = np.empty((periods, steps))
    probe = body.shapes[body.ports["probe"]][0]
    for k in range(periods * steps):
        seen[k // steps, k % steps] = probe @ q
        w = U @ q
        normal = max(n0 + kn * w[0], 0.0)
        trial = kt * (w[1:] - slider)
        size = np.hypot(*trial)
        if size > mu * normal:
            trial = trial * (mu * normal / size)
        slider = w[1:] - trial / kt
        drive = (push * np.exp(1j * point.omega * k * dt)).real
        rate = drive - body.omega**2 * q - body.damping * v - U.T @ [normal - n0, *trial]
        v = v + dt * rate
        q = q + dt * v
    return seen


@pytest.mark.parametrize("omega", [1.3, 1.75])
def test_two_tangents_that_lift_off(omega):
    model = bouncing()
    point = solve(model, omega, 15, 1024)
    assert point.states["lift"] == 1
    found = stability_verdict(model, point)
    seen = marched(model, point, 40)
    change = abs(seen[-1] - seen[0]).max() / abs(seen[0]).max()
    assert found.verdict == (STABLE if change < 0.02 else UNSTABLE)


def largest_multiplier(model, point, S, **precision):
    """Modulus, by a map over S instants a period that is handed on from blade to blade."""
    system = sector_modes(model)
    contacts, nodes = linearised_contacts(model, point, system, S)
    dt = 2 * np.pi / point.omega / S
    part = flow_map(contacts, nodes, dt, S // system.blades, **precision)
    M, forces = len(system.stiffness), contacts.push.shape[1] // system.blades
    if system.blades > 1:
        moved = [system.turn @ part[:M], system.turn @ part[M : 2 * M]]
        part = np.concatenate([*moved, np.roll(part[2 * M :], forces, axis=0)])
    return abs(np.linalg.eigvals(part)).max() ** system.blades


@pytest.mark.parametrize("made", [bouncing, bouncing_wave])
@pytest.mark.parametrize("omega", [1.3, 1.75])
def test_single_precision_leaves_the_multipliers(made, omega):
    model = made()
    point = solve(model, omega, 7, 256)
    assert point.converged and not point.states["stick"] == len(point.w)
    single, double = (
        largest_multiplier(model, point, 256, single=single) for single in (True, False)
    )
    assert single != double
    assert single == pytest.approx(double, rel=2e-5)


@pytest.mark.parametrize("made", [bouncing, bouncing_wave])
def test_in_full_stick_the_multiplier_is_that_of_the_linear_system(made):
    """Against the map of disturbances over a period, which steps through the instants."""
    model = made()
    model = replace(model, excitation={h: 1e-3 * force for h, force in model.excitation.items()})
    point = solve(model, 1.3, 3, 128)
    assert point.converged and point.states["stick"] == len(point.w)
    assert verdict_operations(model, point) == 0
    found = stability_verdict(model, point)
    assert found.verdict == STABLE
    assert found.multiplier == pytest.approx(largest_multiplier(model, point, 2048), rel=1e-9)


def test_a_wave_is_judged_on_the_blades_after_which_it_repeats():
    """Blades a quarter of a period apart, coupled by their dampers, are a ring of four; without
    coupling its multipliers are those of one blade.
    """
    alone = bouncing()
    ring = replace(alone, sides=tuple(alone.sides[0] for _ in range(9)))
    assert blades_of_wave(ring) == 1
    # the third mode seen with a phase: a similar ring, whose modes are no longer real
    wave = bouncing_wave()
    sides = wave.sides
    assert blades_of_wave(wave) == 4
    system = sector_modes(wave)
    assert system.blades == 4 and len(system.stiffness) == 12
    for h in range(1, 5):
        # forces in a wave move the ring as the body of that harmonic says
        w = h * 0.9
        Z = np.diag(system.stiffness - w**2) + 1j * w * system.damping
        wave_of = np.exp(0.5j * np.pi * h * np.arange(4))[:, None]
        force = np.array([0.3, -0.2j, 0.5 + 0.1j])
        forces = (wave_of * force).ravel()
        moved = system.contact @ np.linalg.solve(Z, system.contact.T @ forces)
        shapes = sides[h].shapes[sides[h].ports["contact"]]
        own = shapes / (sides[h].omega ** 2 - w**2 + 1j * w * sides[h].damping) @ shapes.conj().T
        np.testing.assert_allclose(moved, (wave_of * (own @ force)).ravel(), atol=1e-12)
    point = solve(wave, 1.3, 7, 256)
    assert point.converged
    assert stability_verdict(wave, point).verdict in (STABLE, UNSTABLE)
    odd = replace(alone, sides=sides[:3])
    assert "does not repeat" in stability_verdict(odd, point).reason
    assert stability_verdict(odd, point).verdict == UNKNOWN


def test_uncoupled_blades_in_a_wave_have_the_multipliers_of_one():
    """Modes may carry any phase: four blades without coupling, reported as a wave, are one blade."""
    alone = bouncing()
    body = alone.sides[0]
    sides = tuple(replace(body, shapes=body.shapes * np.exp(0.5j * np.pi * h)) for h in range(8))
    wave = replace(alone, sides=sides)
    models = alone, wave
    points = [solve(model, 1.3, 7, 256) for model in models]
    assert blades_of_wave(wave) == 4
    one, four = map(largest_multiplier, models, points, (256, 256))
    assert four == pytest.approx(one, rel=1e-8)
    # the verdict's first look is one in single precision
    one, four = map(stability_verdict, models, points)
    assert four.verdict == one.verdict
    assert four.multiplier == pytest.approx(one.multiplier, rel=1e-5)

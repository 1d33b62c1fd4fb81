"""Marches by steps of a layer that stiffens with its pressure, against a plain explicit march."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import bouncing
from numba import njit

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.hbm.model import ReducedModel, in_series
from bladefem.hbm.ring_march import march_ring, state_of_solution, steps_are_resolved
from bladefem.hbm.solve import solve
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.study.stability import settled_march

# over which the stiffness grows by e
DECAY = np.array([0.1])
PERIODS = 12


def heights(motion):
    """Amplitude of each period from its samples on the last axis."""
    lines = 2 / motion.shape[-1] * np.fft.rfft(motion, axis=-1)[..., 1:8]
    return np.linalg.norm(lines, axis=-1)


def marched_by_law(model, modal, omega, periods, steps=2000, decay=DECAY[0]):
    """(periods, steps) first mass from modal displacements and velocities beyond those without
    contact forces, in semi-implicit Euler steps; the slider starts where friction is none.
    """
    body, e = model.sides[0], model.elements
    contact = np.array([float(x[0]) for x in (e.kt, e.kn, e.mu, e.n0)])
    U, push = body.shapes[body.ports["contact"]], body.shapes[body.ports["load"]].T
    push = push @ model.loads(1)[1]
    free = push / (body.omega**2 - omega**2 + 1j * omega * body.damping)
    start = modal.reshape(2, -1) + [free.real, (1j * omega * free).real]
    drive = (push * np.exp(2j * np.pi / steps * np.arange(steps)[:, None])).real
    modes = np.array([body.omega**2, body.damping])
    seen = march_in_loops(
        start, modes, U, contact, drive, 2 * np.pi / omega / steps, periods, decay
    )
    return (seen @ body.shapes[body.ports["probe"]][0]).reshape(periods, steps)


@njit(cache=True)
def march_in_loops(start, modes, U, contact, drive, dt, periods, decay):
    """Modal displacements (periods * steps, m).

    Args:
        start: (2, m) modal displacements and velocities.
        modes: (2, m) squared frequencies and damping.
        U: (3, m) displacements of the contact.
        contact: kt, kn, mu, n0.
        drive: (steps, m) modal forces of a period.
    """
    kt, kn, mu, n0 = contact
    m = U.shape[1]
    touch = decay * kn - n0
    seen = np.empty((periods * len(drive), m))
    q, v = start[0].copy(), start[1].copy()
    force, w, before = np.zeros(3), np.zeros(3), np.zeros(3)
    for step in range(len(seen)):
        for a in range(3):
            w[a] = 0.0
            for i in range(m):
                w[a] += U[a, i] * q[i]
        growth = np.exp(w[0] / decay)
        normal = max((touch + n0) * growth - touch, 0.0)
        if step > 0:
            force[1] += growth * kt * (w[1] - before[1])
            force[2] += growth * kt * (w[2] - before[2])
        held = min(1.0, mu * normal / max(np.hypot(force[1], force[2]), 1e-300))
        force[0] = normal - n0
        for a in range(3):
            force[a] *= held if a > 0 else 1.0
            before[a] = w[a]
        for i in range(m):
            seen[step, i] = q[i]
            rate = drive[step % len(drive), i] - modes[0, i] * q[i] - modes[1, i] * v[i]
            for a in range(3):
                rate -= U[a, i] * force[a]
            v[i] += dt * rate
            q[i] += dt * v[i]
    return seen


def at_rest(model, omega):
    """A state without motion of the modes beyond that without contact forces, and without friction."""
    start = state_of_solution(model, solve(model, omega, 7, 256))
    n0 = np.maximum(model.elements.n0, 0.0)
    forces = np.tile([n0[0], 0.0, 0.0], (len(start.forces), 1))
    return replace(start, modal=0.0 * start.modal, forces=forces)


def split(model, share):
    """The model with a softer element and the rest of the layer's compliance among the bodies."""
    e = model.elements
    compliance = -share / np.column_stack([e.kn, e.kt, e.kt])
    soft = replace(e, kn=e.kn / (1 + share), kt=e.kt / (1 + share))
    sides = tuple(in_series(side, compliance) for side in model.sides)
    return replace(model, elements=soft, sides=sides, series=compliance)


@pytest.mark.parametrize("omega", [1.3, 1.6])
@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_march_follows_the_law_of_the_layer(omega, share):
    """Split or not, where the contact lifts off and its stiffness changes hundredfold."""
    whole = bouncing()
    model = replace(split(whole, share) if share else whole, decay=DECAY)
    start = at_rest(model, omega)
    found = march_ring(model, start, PERIODS, 512)
    assert found.settled
    plain = heights(marched_by_law(whole, start.modal, omega, PERIODS))
    assert heights(found.motion[:, 0]) == pytest.approx(plain, rel=0.02)
    tangent = heights(march_ring(replace(model, decay=None), start, PERIODS, 512).motion[:, 0])
    assert abs(tangent / plain - 1).max() > 0.5


# length over which the layer of a stop stiffens
SHARP = 2e-2
BOUNCES = 6


@pytest.fixture(scope="module")
def stop():
    """A unit mass on a unit spring that bounces on a layer some hundred times as stiff in an impact
    as at rest, and the amplitudes of its periods in 4000 plain steps each.
    """
    ports = {"contact": [0, 1, 2], "load": [0], "probe": [0]}
    K = np.diag([1.0, 50.0, 50.0])
    body = port_model_from_matrices(np.eye(3), K, ports, C=0.05 * np.diag([1.0, 7.0, 7.0]))
    values = (1e-3, 1.01 * 0.05 / SHARP, 0.0, 0.05)
    element = Elements(*(np.array([x]) for x in values), tangents=2)
    model = ReducedModel((body,), element, {1: np.array([0.3])}, decay=np.array([SHARP]))
    start = at_rest(model, 1.0)
    plain = heights(marched_by_law(model, start.modal, 1.0, BOUNCES, 4000, SHARP))
    return SimpleNamespace(model=model, start=start, plain=plain)


def test_steps_are_resolved_by_the_stiffness_that_the_layer_reaches(stop):
    """At rest 64 instants a period are enough; with 256 the mass gains from its impacts."""
    few, enough = (march_ring(stop.model, stop.start, BOUNCES, n) for n in (256, 1024))
    assert steps_are_resolved(stop.model, 1.0, 64)
    assert not few.resolved
    assert heights(few.motion[:, 0])[-1] > 2 * stop.plain[-1]
    assert enough.resolved
    assert heights(enough.motion[:, 0]) == pytest.approx(stop.plain, rel=0.02)


def test_a_search_takes_steps_for_the_stiffness_that_the_layer_reaches(stop, monkeypatch):
    """Or none, where these would be too many."""
    work = settled_march.MarchBudget()
    found = settled_march.limited_march(stop.model, stop.start, BOUNCES, work)
    assert found.resolved
    assert work.final_instants == work.instants > settled_march.INSTANTS_PER_PERIOD
    assert heights(found.motion[:, 0]) == pytest.approx(stop.plain, rel=0.15)
    monkeypatch.setattr(settled_march, "MOST_INSTANTS", 256)
    with pytest.raises(settled_march.MarchFailedError):
        settled_march.limited_march(stop.model, stop.start, BOUNCES, settled_march.MarchBudget())


def test_each_blade_of_a_wave_has_the_layer_of_its_own_instant():
    """Four blades without coupling, a quarter of a period apart, move as one alone does under a
    force of their phase.
    """
    alone = replace(bouncing(), decay=DECAY)
    body = alone.sides[0]
    sides = tuple(replace(body, shapes=body.shapes * np.exp(0.5j * np.pi * h)) for h in range(9))
    wave = replace(alone, sides=sides)
    four = march_ring(wave, at_rest(wave, 1.3), 4)
    for blade in range(4):
        force = {1: alone.excitation[1] * np.exp(0.5j * np.pi * blade)}
        one = replace(alone, excitation=force)
        found = march_ring(one, at_rest(one, 1.3), 4).motion[:, 0]
        np.testing.assert_allclose(four.motion[:, blade], found, atol=1e-3 * abs(found).max())


def test_a_layer_of_infinite_length_is_linear():
    model = bouncing()
    start = state_of_solution(model, solve(model, 1.3, 7, 256))
    found = march_ring(replace(model, decay=np.array([np.inf])), start, 3)
    np.testing.assert_array_equal(found.motion, march_ring(model, start, 3).motion)


def test_a_prescribed_load_on_a_layer_that_stiffens_is_refused():
    model = replace(bouncing(), normal={1: np.array([0.1])}, decay=DECAY)
    start = state_of_solution(model, solve(model, 1.3, 7, 256))
    with pytest.raises(InputError, match="prescribed normal load on a layer that stiffens"):
        march_ring(model, start, 1)

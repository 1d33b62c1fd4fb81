"""Dampers that nothing but friction holds along a motion: whether they walk and how fast, against
plain marches in time written here, and no influence of the spring that chooses their mean position.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bladefem.data import Elements, RigidBody
from bladefem.hbm.linear import mean_motion
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.node_gradients import node_gradients
from bladefem.hbm.parameters import vary
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import newton as newton_module
from bladefem.hbm.solver.newton import Newton, Options, newton
from bladefem.reduction.matrices import port_model_from_matrices

OMEGA = 1.3
STIFFNESS = 5.0
# mean load, amplitude of its sine, mass of the damper
LOADS = (0.3, 0.2, 0.3)


def walking_model(stiffness=STIFFNESS, loads=LOADS, shares=(0.5, 0.5)):
    """A unit mass on a unit spring, and a free mass that rubs on it under a load that swings, by
    two contacts.
    """
    mean, swing, mass = loads
    body = port_model_from_matrices(
        np.eye(1), np.eye(1), {"contact": [0, 0], "load": [0], "probe": [0]}, C=0.02 * np.eye(1)
    )
    part = np.array(shares)
    element = Elements(stiffness * part, np.zeros(2), np.full(2, 0.5), mean * part, tangents=1)
    return ReducedModel(
        (body,),
        element,
        {1: np.array([0.3])},
        Damping(),
        RigidBody(np.array([[mass]]), np.ones((2, 1))),
        normal={1: 1j * swing * part},
    )


def marched(steps, periods, loads=LOADS, shares=(0.5, 0.5), limits=(0.5, 0.5)):
    """Walk a period of blade against damper, and size of the blade's motion, in the last period."""
    mean, swing, mass = loads
    dt = 2 * np.pi / OMEGA / steps
    blade = [0.0, 0.0]
    rider = [0.0, 0.0]
    sliders = [0.0, 0.0]
    places = []
    motion = np.zeros(steps)
    phase = 2 * np.pi * np.arange(steps) / steps
    load = np.maximum(mean - swing * np.sin(phase), 0.0)
    force = 0.3 * np.cos(phase)
    for k in range(periods * steps):
        i = k % steps
        apart = blade[0] - rider[0]
        total = 0.0
        for c in range(2):
            stiffness = STIFFNESS * shares[c]
            limit = limits[c] * load[i] * shares[c]
            one = min(max(stiffness * (apart - sliders[c]), -limit), limit)
            sliders[c] = apart - one / stiffness
            total += one
        blade[1] += dt * (force[i] - blade[0] - 0.02 * blade[1] - total)
        rider[1] += dt * total / mass
        blade[0] += dt * blade[1]
        rider[0] += dt * rider[1]
        motion[i] = blade[0]
        if i == steps - 1:
            places.append(blade[0] - rider[0])
    lines = np.abs(np.fft.rfft(motion))[1:16] * 2 / steps
    return abs(places[-1] - places[-2]), float(np.linalg.norm(lines))


def test_the_walk_of_a_free_damper_is_that_of_a_march():
    """First order in the march's step: 1e-3 of the walk, 1e-4 of the amplitude."""
    walk, height = marched(3000, 100)
    point = solve(walking_model(), OMEGA, 23, 1024)
    assert point.converged and point.states["slip"] == 2
    assert point.drift * 2 * np.pi / OMEGA == pytest.approx(walk, rel=5e-3)
    assert size(point) == pytest.approx(height, rel=5e-4)
    # no force is left on the damper in the mean, and none of the work
    assert abs(point.f[:, 0, 0].sum()) < 1e-6 * abs(point.f).max()
    assert point.work.imbalance < 1e-8
    assert point.work.dissipated == pytest.approx(point.work.friction, rel=1e-6)


def test_a_damper_that_one_contact_holds_does_not_walk():
    """One contact with enough friction never slips: it takes what the other one pushes."""
    limits = (0.5, 8.0)
    walk, height = marched(2000, 250, limits=limits)
    assert walk < 1e-5 * height
    model = walking_model()
    model = replace(model, elements=replace(model.elements, mu=np.array(limits)))
    point = solve(model, OMEGA, 15, 1024)
    assert point.converged and point.states["stick"] == 1 and point.states["slip"] == 1
    assert point.drift == 0.0 and point.walk is None
    assert size(point) == pytest.approx(height, rel=5e-4)
    assert abs(point.f[:, 0, 0]).min() > 1e-3 * abs(point.f).max()


@pytest.mark.parametrize("limits", [(0.5, 0.5), (0.5, 8.0)])
def test_the_spring_that_chooses_the_mean_position_has_no_influence(limits, monkeypatch):
    """Peaks of walking dampers do not know it; of resting ones it takes its share of the stiffness,
    far below 1e-5 of the amplitude over four decades.
    """
    heights = []
    for share in (1e-9, 1e-8, 1e-7, 1e-6, 1e-5):
        monkeypatch.setattr(mean_motion, "REGULARISATION", share)
        model = walking_model()
        model = replace(model, elements=replace(model.elements, mu=np.array(limits)))
        point = solve(model, OMEGA, 7, 256)
        assert point.converged
        heights.append(size(point))
    np.testing.assert_allclose(heights, heights[0], rtol=1e-6)


@pytest.mark.parametrize("name", ["omega", "force", "load", "mu", "kt", "mass", "damping"])
def test_derivatives_of_a_walking_damper(name):
    model = walking_model()
    point = solve(model, OMEGA, 5, 256)
    assert point.drift > 0
    step = 1e-4

    def height(change):
        if name == "omega":
            return size(solve(model, OMEGA + change, 5, 256))
        return size(solve(vary(model, name, float(np.exp(change))), OMEGA, 5, 256))

    expected = (height(step) - height(-step)) / (2 * step)
    found = sensitivities(model, point, [name])[name].size[0]
    assert found == pytest.approx(expected, rel=2e-4)
    if name in ("load", "mu", "kt"):
        each = node_gradients(model, point, [name])[name]
        assert each.sum() == pytest.approx(found, rel=1e-6)


def test_exact_events_are_sampled_where_the_damper_walks():
    """The ramp of a walk is not a harmonic: the solution says with how many samples it was made."""
    point = solve(walking_model(), OMEGA, 5, 0)
    assert point.converged and point.drift > 0 and point.samples > 0


@pytest.mark.parametrize(("fallbacks", "kinds", "springs"), [(False, 2, 0), (True, 3, 1)])
def test_searches_without_fallbacks_try_the_two_likeliest_kinds(
    fallbacks, kinds, springs, monkeypatch
):
    """A third one and springs on the mean took a third of the time of what was not found."""
    tried, held = [], []
    balance = SimpleNamespace(walk=None, model=None)

    def failing(start, *_):
        tried.append(start)
        return Newton(SimpleNamespace(error=1.0), 1, False, "made to fail")

    monkeypatch.setattr(newton_module, "may_walk", lambda _: True)
    monkeypatch.setattr(newton_module, "runs_compiled", lambda _: False)
    monkeypatch.setattr(newton_module, "_likely_starts", lambda *_: iter("abc"))
    monkeypatch.setattr(newton_module, "_newton_of_one_kind", failing)
    monkeypatch.setattr(newton_module, "held_balance", lambda _: held.append(1))
    monkeypatch.setattr(newton_module, "newton_as_given", lambda *_: failing("held"))
    end = newton(balance, np.zeros((1, 1, 3)), Options(fallbacks=fallbacks))
    assert not end.converged and end.iterations == kinds + springs
    assert len(held) == springs and tried == [*"abc"[:kinds], *["held"] * springs]

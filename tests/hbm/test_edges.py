"""Cases at the edge: either right, or one sentence that says what is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass
from test_peak import light_block

from bladefem.errors import NotSolvedError
from bladefem.hbm.model import Damping
from bladefem.hbm.parameters import vary
from bladefem.hbm.peak import find_peak
from bladefem.hbm.response import response
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solve import free_response, solve, stuck_response
from bladefem.hbm.sweep import sweep

MODELS = {
    "single mass": (single_mass(), 1.1),
    "block": (block(), 0.9),
    "block with damper": (block(damper=True), 1.3),
}


def changed(model, **elements):
    return replace(model, elements=replace(model.elements, **elements))


@pytest.mark.parametrize("name", MODELS)
def test_without_friction_without_springs_and_far_apart(name):
    """mu = 0 leaves the normal springs alone, all springs 0 and a gap that never closes leave
    nothing.
    """
    model, omega = MODELS[name]
    none = np.zeros_like(model.elements.kt)
    alone = free_response(model, omega, 3)
    for other in (changed(model, kt=none, kn=none), changed(model, n0=none - 1e9)):
        found = solve(other, omega, 3, 64)
        assert found.converged
        np.testing.assert_allclose(
            found.probe[1:], alone[1:], rtol=0, atol=1e-10 * abs(alone).max()
        )
    smooth = solve(changed(model, mu=none), omega, 3, 64)
    exact = stuck_response(changed(model, kt=none), omega, 3)
    assert smooth.converged
    np.testing.assert_allclose(smooth.probe[1:], exact[1:], rtol=0, atol=1e-10 * abs(exact).max())


@pytest.mark.parametrize("name", MODELS)
def test_nothing_moves_without_excitation(name):
    """Against the preload's compression, rounding is no motion; derivatives are zero and there is
    no peak.
    """
    model, omega = MODELS[name]
    still = replace(model, excitation={1: np.zeros(1)})
    found = solve(still, omega, 3, 64)
    assert (
        found.converged
        and abs(found.probe).max() < 1e-15
        and found.states["stick"] == len(model.elements.kt)
    )
    assert abs(sensitivities(still, found, ["kt"])["kt"].size).max() < 1e-14
    if name == "single mass":
        with pytest.raises(NotSolvedError, match="probe 0 does not move"):
            find_peak(still, omega, 3, 64)


@pytest.mark.parametrize("name", MODELS)
def test_a_resonance_without_damping_is_named(name):
    model = replace(MODELS[name][0], damping=Damping())
    omega = float(model.side(1).omega[0])
    for call in (solve, free_response):
        with pytest.raises(
            NotSolvedError, match=f"without damping is hit exactly, at {omega:.10g} rad/s"
        ):
            call(model, omega, 3)


def test_a_sweep_goes_past_a_resonance_without_damping():
    """Even steps and middles of intervals meet the resonance at 1; friction holds it, since 4/pi mu
    N > 1.
    """
    model = replace(single_mass(limit=0.9), damping=Damping())
    points = sorted(sweep(model, (0.5, 2.0), 5, 128), key=lambda p: p.omega)
    assert all(p.converged for p in points)
    beside = list(response(model, [0.9, 1.0, 1.1], 5, 128))
    assert [p.converged for p in beside] == [True] * 3
    assert beside[1].omega == pytest.approx(1.0, abs=2e-7) and beside[1].omega != 1.0


def test_harmonics_with_fewer_modes_have_none_at_one_radian_a_second():
    """The modes that fill them up once had that frequency, and no damping."""
    model = replace(block(), damping=Damping())
    few, side = 12, model.side(1)
    cut = replace(side, omega=side.omega[:few], shapes=side.shapes[:, :few])
    mixed = replace(model, sides=(cut, side, cut, cut))
    near = [solve(mixed, omega, 3, 64).probe for omega in (1.0, 1.0 + 1e-9)]
    assert np.isfinite(near[0]).all()
    np.testing.assert_allclose(near[0], near[1], rtol=0, atol=1e-6 * abs(near[1]).max())


def test_the_same_frequency_twice_is_solved_twice():
    points = list(response(single_mass(), [0.9, 0.9, 0.9, 0.95, 0.95], 3, 64))
    assert all(p.converged for p in points)
    assert abs(points[1].probe - points[0].probe).max() < 1e-9


def test_contacts_a_million_million_times_as_stiff():
    """1-D elements stay right: the mean of stiff Jenkins elements is dry friction. 3-D ones say
    what stands against.
    """
    one, two = (solve(single_mass(kt=kt), 1.1, 3, 64) for kt in (1e9, 1e12))
    assert one.converged and two.converged
    np.testing.assert_allclose(one.probe, two.probe, rtol=0, atol=1e-7 * abs(one.probe).max())
    model = block()
    found = solve(changed(model, kt=1e12 * model.elements.kt), 0.9, 3, 64)
    assert (
        not found.converged
        and "times as stiff as the bodies: expected less than 1e+05" in found.reason
    )


def test_the_path_goes_on_with_more_samples():
    """At lift-off 64 samples interrupt the path in the excitation that 128 let through; 2048 differ
    by 2e-4.
    """
    model = vary(light_block(), "gap", 0.326)
    found = solve(model, 1.3, 3, 64)
    fine = solve(model, 1.3, 3, 2048, start=found)
    assert found.converged and found.samples == 128 and "more samples" in found.method
    np.testing.assert_allclose(found.probe, fine.probe, rtol=0, atol=1e-3 * abs(fine.probe).max())

"""Steps of a path and slopes in one compiled call against the plain way, for every kind of body."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, bouncing, folding_pair
from test_follow import stop, twins
from test_point_compiled import MODELS as POINT_MODELS
from test_turning_damper import turning_model

from bladefem.hbm import continuation, sensitivity
from bladefem.hbm import solve as api
from bladefem.hbm.continuation import follow
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import arclength
from bladefem.hbm.solver.newton import Options
from bladefem.hbm.solver.path_compiled import compiled_path, frequency_slope

# of the frequency: directions of a path are solved for to 1e-5, which moves its points along it
SAME_PLACE = 1e-4
# of the largest displacement, between a point of a path and that point solved again
SAME_POINT = 1e-7
# of points where contacts move
ROUTES = {
    "compiled point, dense LU",
    "compiled point, iterations",
    "compiled point, iterations then dense LU",
}


def gyroscopic():
    """A body whose modes are coupled by forces without work, on 3-D contacts: its flexibility is
    not symmetric, so that iterations do not converge.
    """
    model = block(nodes=3, dofs=12)
    half = np.random.default_rng(5).normal(size=(12, 12))
    coupled = 0.15 * (half - half.T) + 0.02 * np.eye(12)
    return replace(model, sides=(replace(model.side(1), damping=coupled),))


PATHS = {
    "round folds": (stop(), (0.8, 1.6), 5, 128),
    "round folds, transitions located": (stop(), (0.8, 1.6), 5, 0),
    "two masses": (folding_pair(), (200.0, 330.0), 7, 256),
    "crossings": (twins(0.03), (0.8, 1.6), 5, 0),
    "two tangents, lift-off": (bouncing(), (0.9, 1.4), 5, 128),
    "many unknowns": (block(), (0.8, 1.0), 5, 128),
    "unsymmetric flexibility": (gyroscopic(), (0.8, 1.0), 3, 64),
    "rigid damper at rest": (block(damper=True), (1.28, 1.34), 3, 64),
}


def counted(monkeypatch, module, name):
    """Calls of a function and what they gave, in the order in which they are made."""
    found = []
    inner = getattr(module, name)

    def call(*arguments):
        found.append(inner(*arguments))
        return found[-1]

    monkeypatch.setattr(module, name, call)
    return found


@pytest.mark.parametrize("name", PATHS)
def test_a_path_of_compiled_steps_is_that_of_plain_ones(name, monkeypatch):
    model, band, H, samples = PATHS[name]
    start = solve(model, band[0], H, samples)
    steps = counted(monkeypatch, arclength, "correct_step")
    options = Options(tolerance=1e-9)
    fast = list(follow(model, "omega", start, band, options=options))
    compiled = [step for step in steps if step is not None and not isinstance(step, str)]
    # all but the first
    assert len(compiled) >= len(fast) - 1
    monkeypatch.setattr(continuation, "compiled_path", lambda *_: None)
    monkeypatch.setattr(api, "solve_small", lambda *_: None)
    plain = list(follow(model, "omega", start, band, options=options))
    assert len(fast) == len(plain)
    for one, other in zip(fast, plain, strict=True):
        assert one.value == pytest.approx(other.value, rel=SAME_PLACE)
        for flag in ("forward", "fold", "leapt", "branch", "restarted"):
            assert getattr(one, flag) == getattr(other, flag), flag
    for path in (fast, plain):
        for point in path[1::4]:
            again = solve(model, point.value, H, samples, start=point.solution)
            assert again.converged and point.solution.states == again.states
            moves = again.states["slip"] + again.states["lift"] > 0
            if path is fast:
                route = point.solution.route
                assert route in ROUTES if moves else route.startswith("compiled point")
            for field in ("w", "f", "probe"):
                expected = getattr(again, field)
                found = getattr(point.solution, field)
                np.testing.assert_allclose(found, expected, 0, SAME_POINT * abs(expected).max())
            for field in ("input", "damping", "friction", "dissipated"):
                works = getattr(point.solution.work, field), getattr(again.work, field)
                assert works[0] == pytest.approx(works[1], rel=1e-6, abs=1e-12), field


SLOPES = {
    **{name: (model, omega, 5, 128) for name, (model, omega) in POINT_MODELS.items()},
    "two tangents, lift-off": (bouncing(), 1.1, 5, 128),
    "many unknowns": (block(), 0.9, 5, 128),
    "unsymmetric flexibility": (gyroscopic(), 0.9, 3, 64),
}


@pytest.mark.parametrize("name", SLOPES)
def test_a_slope_in_one_call_is_the_plain_one(name, monkeypatch):
    model, omega, H, samples = SLOPES[name]
    point = solve(model, omega, H, samples)
    assert point.converged and point.states["slip"] + point.states["lift"] > 0
    assert frequency_slope(model, point) is not None
    fast = sensitivities(model, point, ["omega"])["omega"]
    monkeypatch.setattr(sensitivity, "frequency_slope", lambda *_: None)
    plain = sensitivities(model, point, ["omega"])["omega"]
    for field in ("w", "probe", "size"):
        expected = getattr(plain, field)
        np.testing.assert_allclose(
            getattr(fast, field), expected, rtol=0, atol=1e-8 * abs(expected).max()
        )


def test_what_the_compiled_steps_do_not_know_is_left_to_the_plain_way():
    """Dampers that circle, for which other bodies are taken next to that frequency; and those that
    walk.
    """
    assert compiled_path(turning_model(), 3, 64) is None
    model = block(damper=True)
    walking = next(
        point
        for point in (solve(model, omega, 3, 64) for omega in np.linspace(1.1, 1.5, 9))
        if point.walk is not None
    )
    assert frequency_slope(model, walking) is None

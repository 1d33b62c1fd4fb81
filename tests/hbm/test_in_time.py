"""The model in time against the balance with many harmonics, and shooting as the last way to a
point.
"""

from dataclasses import replace

import numpy as np
import pytest
from hbm_models import beam, chain
from models import block, single_mass, wedge_between_masses

from bladefem.data import RigidBody
from bladefem.errors import InputError
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import fallback
from bladefem.hbm.solver.newton import newton
from bladefem.hbm.solver.residual import Balance
from bladefem.hbm.time_model import shooting_start, time_system
from bladefem.time.shooting import periodic_solution, probe_harmonics

DAMPER = RigidBody(np.array([[0.5]]), np.ones((1, 1)))
# both contacts slip and forget the static friction forces, which the preload state balances
WEDGE = wedge_between_masses(30.0)
STATIC_FRICTION = replace(WEDGE, elements=replace(WEDGE.elements, t0=np.array([[30.0], [-20.0]])))
SWELLING = replace(single_mass(), normal={1: np.array([0.3]), 2: np.array([0.1 - 0.2j])})


@pytest.mark.parametrize(
    ("model", "omega", "H"),
    [
        (single_mass(), 1.1, 31),
        (SWELLING, 1.1, 31),
        (beam().model, 8300.0, 15),
        (chain(masses=4).model, 1.1, 31),
        (replace(single_mass(), damper=DAMPER), 1.3, 31),
        (STATIC_FRICTION, 2 * np.pi * 56.0, 31),
    ],
)
def test_shooting_and_balance_meet(model, omega, H):
    system = time_system(model, H)
    exact = probe_harmonics(periodic_solution(system, omega, samples=4096), system, 1)[0, 1]
    found = solve(model, omega, H, 0)
    assert found.converged and found.states["slip"] + found.states["lift"]
    # what H harmonics leave out falls with about H^-3
    assert abs(found.probe[1, 0] - exact) < 2e-6 * abs(exact) * (31 / H) ** 3


def test_shooting_reaches_a_point_by_itself():
    model = chain(masses=4).model
    balance = Balance(model, condense(model, 1.1, 7), 256)
    end = newton(balance, shooting_start(balance))
    direct = solve(model, 1.1, 7, 256)
    assert end.converged and direct.converged
    np.testing.assert_allclose(end.state.w, direct.w, rtol=0, atol=1e-8 * abs(direct.w).max())


def test_shooting_is_the_last_link(monkeypatch):
    """With every other way closed the point is still solved, and says how; without a form in time
    it says why not.
    """

    def closed(balance, *_):
        return fallback._failed_attempt(balance, fallback.Newton(None, 0, False, ""), 0, "closed")

    def back(balance, end, iterations, reason):
        w = fallback.start_in_stick(balance)
        return fallback.Newton(fallback.evaluate_balance(balance, w), iterations, False, reason)

    monkeypatch.setattr(fallback, "_failed_attempt", back)
    for way in ("_more_harmonics", "_from_high_load", "_along_excitation"):
        monkeypatch.setattr(fallback, way, closed)
    whole = fallback.newton
    calls = []

    def newton_once_closed(balance, *arguments):
        calls.append(1)
        return whole(balance, *arguments) if len(calls) > 2 else closed(balance)

    monkeypatch.setattr(fallback, "newton", newton_once_closed)
    monkeypatch.setattr("bladefem.hbm.solve.solve_small", lambda *_: None)
    solution = solve(single_mass(), 1.1, 7, 256)
    assert solution.converged and solution.method == "shooting"
    monkeypatch.setattr(fallback, "newton", lambda balance, *_: closed(balance))
    refused = solve(block(), 0.9, 3, 64)
    assert not refused.converged and "shooting: elements with two tangents" in refused.reason


def test_models_without_a_form_in_time_are_refused():
    with pytest.raises(InputError, match="two tangents"):
        time_system(block(), 3)
    side = replace(single_mass().side(0), residual=np.full((3, 3), 0.1))
    with pytest.raises(InputError, match="residual flexibility"):
        time_system(replace(single_mass(), sides=(side,)), 3)

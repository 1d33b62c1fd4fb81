"""The way a point is solved is chosen in one file, and the solution says which way ran."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass

from bladefem.hbm import policy
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve

SLIPPING = replace(block(nodes=2, force=3.0), coupled=True)


@pytest.mark.parametrize(
    ("changed", "route"),
    [
        ({}, "compiled point, dense LU"),
        ({"COMPILED_POINT_DOFS": 0}, "compiled Newton, dense LU"),
        ({"COMPILED_NEWTON_UNKNOWNS": 0}, "NumPy Newton, dense LU"),
        ({"COMPILED_NEWTON_UNKNOWNS": 0, "DENSE_UNKNOWNS": 0}, "NumPy Newton, iterations"),
    ],
)
def test_every_way_gives_the_same_point_and_says_its_name(changed, route, monkeypatch):
    usual = solve(single_mass(), 1.1, 3, 128)
    for name, value in changed.items():
        monkeypatch.setattr(policy, name, value)
    point = solve(single_mass(), 1.1, 3, 128)
    assert point.converged and point.states["slip"] == 1
    assert point.route == route
    np.testing.assert_allclose(point.w, usual.w, rtol=0, atol=1e-8 * abs(usual.w).max())


def test_large_compiled_points_iterate():
    """16 contacts a side with 7 harmonics have 480 unknowns, more than a dense LU pays for."""
    point = solve(reference_model(2e6, 0.06, 1.0, points=16, modes=10), 5500.0, 7, 256)
    assert point.converged and point.states["slip"] > 0
    assert point.route == "compiled point, iterations"


def test_elements_of_two_tangents_are_compiled_in_small_models(monkeypatch):
    """The same point by NumPy; and by NumPy alone where there are more unknowns, or a damper may
    walk.
    """
    fast = solve(SLIPPING, 0.9, 3, 64)
    assert fast.converged and fast.route == "compiled point, dense LU"
    walking = solve(block(damper=True), 1.225, 3, 64)
    assert walking.walk is not None and walking.route == "NumPy Newton, dense LU"
    monkeypatch.setattr(policy, "COMPILED_POINT_UNKNOWNS_2D", fast.w.size - 1)
    plain = solve(SLIPPING, 0.9, 3, 64)
    assert plain.converged and plain.route == "NumPy Newton, dense LU"
    assert plain.states == fast.states and plain.iterations == fast.iterations
    for field in ("w", "f", "probe"):
        expected = getattr(plain, field)
        np.testing.assert_allclose(
            getattr(fast, field), expected, rtol=0, atol=1e-8 * abs(expected).max()
        )
    for field in ("input", "damping", "friction", "dissipated"):
        works = getattr(fast.work, field), getattr(plain.work, field)
        assert works[0] == pytest.approx(works[1], rel=1e-7), field


def test_where_every_contact_sticks_no_system_is_solved():
    point = solve(single_mass(force=1e-3), 1.1, 3, 128)
    assert point.states["stick"] == 1 and point.route == "compiled point"

"""The way a point is solved is chosen in one file, and the solution says which way ran."""

from dataclasses import replace

import numpy as np
import pytest
from models import block, single_mass
from numba import types

from bladefem.data import Elements
from bladefem.hbm import policy
from bladefem.hbm.continuation import follow
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.linear.condensation_compiled import linear_part
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.sensitivity import sensitivities
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import point_compiled
from bladefem.hbm.solver.newton import Options, newton_as_given
from bladefem.hbm.solver.path_compiled import _correct_step
from bladefem.hbm.solver.residual import Balance, start_in_stick
from bladefem.reduction.matrices import port_model_from_matrices

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


def test_iterations_are_tried_where_few_nodes_slip_first_and_many_later():
    """Two stiff contacts of a chain slip first, whose system is too small for iterations; then all.
    A system of 1260 unknowns by LU factors alone took forty times as long, one of 5880 was called
    singular.
    """
    n, H = 60, 10
    K = 3000.0 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) + np.eye(n)
    K[[0, -1], [0, -1]] -= 3000.0
    ports = {"contact": np.arange(n), "load": np.arange(n), "probe": np.array([n - 1])}
    stiffness = np.full(n, 1e-3)
    stiffness[:2] = n
    limits = np.concatenate([np.ones(2), np.linspace(0.002, 0.004, n - 2)])
    contacts = Elements(stiffness, np.zeros(n), np.ones(n), limits, tangents=1)
    body = port_model_from_matrices(np.eye(n), K, ports)
    model = ReducedModel((body,), contacts, {1: np.ones(n)}, Damping(ratio=0.02))
    balance = Balance(model, condense(model, 1.0, H), 4 * H + 4)
    end = newton_as_given(balance, start_in_stick(balance), Options())
    assert end.converged and end.route == "compiled Newton, iterations then dense LU"
    slipping = np.count_nonzero(end.state.forces.shares[:, 1])
    assert slipping * (2 * H + 1) > 10 * policy.COMPILED_ITERATION_UNKNOWNS


def test_whole_numbers_are_no_other_kernels():
    """A kernel for them took 18 s to compile."""
    model = single_mass()
    point = solve(model, 1, 3, 128)
    list(follow(model, "omega", point, (1, 2)))
    sensitivities(model, point, ["omega"])
    for kernel in (linear_part, _correct_step):
        assert all(types.int64 not in kinds[:2] for kinds in kernel.signatures)


def test_full_stick_is_no_start_where_it_is_not_asked_for(monkeypatch):
    """Without fallbacks, from a neighbour that leads nowhere."""
    known = solve(SLIPPING, 0.9, 3, 64)
    far = replace(known, w=1e3 * known.w)
    asked = []
    plain = point_compiled._solve_points

    def recorded(model, omegas, H, samples, known, options, chained=0):
        asked.append(len(known))
        return plain(model, omegas, H, samples, known, options, chained)

    monkeypatch.setattr(point_compiled, "_solve_points", recorded)
    monkeypatch.setattr(point_compiled, "MOST_STEPS_2D", 0)
    options = Options(fallbacks=False)
    solve(SLIPPING, 0.9, 3, 64, start=far, options=options, from_stick=False)
    assert asked == [1]
    solve(SLIPPING, 0.9, 3, 64, start=far, options=options)
    assert asked == [1, 1, 0]

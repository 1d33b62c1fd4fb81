"""Paths against points solved one by one, a fold against the ends of its hysteresis, branch points
by symmetry.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from models import block, single_mass

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.hbm import continuation, frequency_walk, from_neighbours
from bladefem.hbm.continuation import follow
from bladefem.hbm.frequency_walk import walk_in_frequency
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.parameters import vary
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver import arclength as arclength_module
from bladefem.hbm.solver.arclength import path_distance, spot_at
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS, Options
from bladefem.hbm.solver.residual import Balance, evaluate_balance
from bladefem.reduction.matrices import port_model_from_matrices


def stop(gap=1.0):
    """A mass that meets a one-sided elastic stop: it hardens, and its resonance leans over."""
    ports = {"contact": np.array([0, 1]), "load": np.array([0]), "probe": np.array([0])}
    body = port_model_from_matrices(np.eye(2), np.diag([1.0, 50.0]), ports)
    elements = Elements(
        np.array([1e-3]), np.array([1.0]), np.zeros(1), np.array([-gap]), tangents=1
    )
    return ReducedModel((body,), elements, {1: np.array([0.1])}, Damping(ratio=0.02))


@pytest.mark.parametrize(
    ("model", "name", "bounds", "omega"),
    [
        (single_mass(), "omega", (0.6, 1.8), 0.6),
        (single_mass(), "load", (0.2, 4.0), 1.1),
        (block(force=1.0), "mu", (0.5, 2.0), 0.9),
        (block(force=1.0), "force", (0.8, 2.0), 0.9),
        (block(force=1.0), "gap", (0.0, 0.3), 0.9),
        (block(force=1.0), "kt", (0.5, 2.0), 0.9),
        (block(force=1.0), "kn", (0.5, 2.0), 0.9),
        (block(damper=True), "mass", (0.7, 1.5), 1.3),
        (block(damper=True), "damping", (0.5, 2.0), 1.3),
    ],
)
def test_every_point_of_a_path_is_a_solution(model, name, bounds, omega):
    start = solve(model, omega, 3, 128)
    points = list(follow(model, name, start, bounds))
    assert points[-1].value > bounds[1] and all(p.solution.converged for p in points)
    for p in points[1::4]:
        changed = model if name == "omega" else vary(model, name, p.value)
        again = solve(changed, p.value if name == "omega" else omega, 3, 128, start=p.solution)
        np.testing.assert_allclose(
            p.solution.probe, again.probe, rtol=0, atol=1e-8 * abs(again.probe).max()
        )


def test_folds_lie_where_sweeps_up_and_down_jump():
    """A leaning resonance: the path turns back twice; fine sweeps up and down jump at the same two
    frequencies.
    """
    model, H, samples = stop(), 5, 0
    points = list(
        follow(model, "omega", solve(model, 0.8, H, samples), (0.8, 1.6), steps=(0.02, 0.02))
    )
    folds = [
        max(a.value, b.value) if a.forward else min(a.value, b.value)
        for a, b in pairwise(points)
        if b.fold
    ]
    assert len(folds) == 2 and folds[0] > folds[1]
    for sign, fold in zip((1, -1), folds, strict=True):  # sweep across the fold in steps of 2e-4
        omegas = fold + sign * np.arange(-0.01, 0.01, 2e-4)
        branch = [
            p.solution for p in points[1:] if p.forward and (size(p.solution) > 1.02) == (sign > 0)
        ]
        last = min(branch, key=lambda s: abs(s.omega - omegas[0]))
        heights = []
        for omega in omegas:
            last = solve(model, omega, H, samples, start=last)
            heights.append(size(last))
        jump = omegas[int(np.argmax(abs(np.diff(heights))))]
        assert jump == pytest.approx(fold, abs=6e-4)


def test_the_neighbour_beyond_a_fold_is_tried_before_the_fallbacks(monkeypatch):
    """One that leads nowhere costs no fallbacks where another leads to the point, at once or in
    small steps; they are the last resort.
    """
    model, plain, asked = stop(), from_neighbours.solve_off_resonance, []
    walked = []
    near, beyond = (solve(model, omega, 5, 0) for omega in (1.0, 1.3))

    def counted(*arguments):
        start, options = arguments[4:6]
        asked.append((start, options.fallbacks))
        point = plain(*arguments)
        return replace(point, converged=point.converged and any(start is s for s in leading))

    def no_way(*arguments):
        walked.append(arguments[4])
        return []

    monkeypatch.setattr(from_neighbours, "solve_off_resonance", counted)
    monkeypatch.setattr(from_neighbours, "walk_in_frequency", no_way)
    for leading, tried in (
        ([near], [(near, False)]),
        ([beyond], [(near, False), (beyond, False)]),
        ([], [(near, False), (beyond, False), (near, True)]),
    ):
        asked.clear()
        point = from_neighbours.solve_from(model, 1.1, 5, 0, [near, beyond])
        assert point.converged == bool(leading) and [f for _, f in asked] == [f for _, f in tried]
        assert all(one is other for (one, _), (other, _) in zip(asked, tried, strict=True))
    # both neighbours, and only where neither leads there at once
    assert len(walked) == 2 and walked[0] is near and walked[1] is beyond


def test_a_walk_ends_at_the_frequency_or_before_a_fold():
    """The spring with a stop hardens: its upper motion ends at a fold."""
    model = stop()
    omegas = np.linspace(0.9, 1.02, 25)
    *_, low = response(model, omegas, 5, 0)
    way = walk_in_frequency(model, 1.05, 5, 0, low)
    assert way[-1].omega == 1.05 and all(p.converged for p in way)
    # the first step takes half of the way
    begun = walk_in_frequency(model, 1.05, 5, 0, low, enough=0.1)
    assert [p.omega for p in begun] == [pytest.approx((low.omega + 1.05) / 2)]
    beyond = walk_in_frequency(model, 3.0, 5, 0, low, Options(iterations=3))
    assert all(p.converged for p in beyond)


def test_points_of_a_walk_have_no_fallbacks(monkeypatch):
    """Where one is not found its step is shortened, which takes less than all ways of starting it."""
    model, asked = stop(), []
    plain = frequency_walk.solve_near

    def counted(*arguments):
        asked.append(arguments[-1])
        return plain(*arguments)

    monkeypatch.setattr(frequency_walk, "solve_near", counted)
    assert walk_in_frequency(model, 1.05, 5, 0, solve(model, 1.0, 5, 0), Options(fallbacks=True))
    assert asked and not any(options.fallbacks for options in asked)


def twins(coupling):
    """Two of these masses, coupled by a weak spring and driven alike: the motion in step loses its
    symmetry.
    """
    link = 1.0 + coupling * np.array([[1.0, -1.0], [-1.0, 1.0]]) - (1.0 - np.eye(2))
    K = np.kron(link, np.diag([1.0, 0.0])) + np.kron(np.eye(2), np.diag([0.0, 50.0]))
    ports = {"contact": np.arange(4), "load": np.array([0, 2]), "probe": np.array([0, 2])}
    elements = Elements(np.full(2, 1e-3), np.ones(2), np.zeros(2), np.full(2, -1.0), tangents=1)
    return ReducedModel(
        (port_model_from_matrices(np.eye(4), K, ports),),
        elements,
        {1: np.array([0.1, 0.1])},
        Damping(ratio=0.02),
    )


def test_branch_points_of_two_equal_masses():
    """In step both masses are the single one; the derivative against each other is that of a mass
    on 1 + 2 coupling.

    It turns singular between two points of the path where the path in step does not turn: there
    unequal motions begin.
    """
    coupling, H = 0.03, 5
    points = list(
        follow(
            twins(coupling),
            "omega",
            solve(twins(coupling), 0.8, H, 0),
            (0.8, 1.6),
            steps=(0.03, 0.03),
        )
    )
    assert all(abs(p.solution.probe[1, 0] - p.solution.probe[1, 1]) < 1e-9 for p in points)
    assert [p.fold for p in points].count(True) == 2
    body = port_model_from_matrices(
        np.eye(2),
        np.diag([1.0 + 2 * coupling, 50.0]),
        {"contact": np.array([0, 1]), "load": np.array([0]), "probe": np.array([0])},
    )
    apart = replace(stop(), sides=(body,), damping=Damping(ratio=0.02 / np.sqrt(1 + 2 * coupling)))
    signs = []
    for p in points:
        balance, w = Balance(apart, condense(apart, p.value, H), 0), p.solution.w[:1]
        steps = 1e-7 * abs(w).max() * np.eye(w.size).reshape(-1, *w.shape)
        J = [
            (
                evaluate_balance(balance, w + e).residual
                - evaluate_balance(balance, w - e).residual
            ).ravel()
            for e in steps
        ]
        signs.append(np.linalg.slogdet(np.array(J))[0])
    turns = [i for i in range(1, len(signs)) if signs[i] != signs[i - 1]]
    found = [i for i, p in enumerate(points) if p.branch]
    # one point lies on a crossing to 1e-4 of the determinant: differences put it on the other side
    assert len(turns) == len(found) == 2 and max(abs(np.subtract(turns, found))) <= 1
    first = next(p for p in points if p.branch)
    model, unequal = twins(coupling), []
    for push in np.linspace(0.05, 0.5, 10):  # beside the path, just after the crossing
        near = first.solution.w * np.array([1 + push, 1 - push])[:, None, None]
        end = solve(model, first.value - 0.002, H, 0, start=replace(first.solution, w=near))
        unequal.append(end.converged and abs(end.probe[1, 0] - end.probe[1, 1]) > 0.02)
    assert any(unequal)


def test_bad_bounds():
    model = single_mass()
    start = solve(model, 1.0)
    with pytest.raises(InputError, match="bounds"):
        next(follow(model, "load", start, (2.0, 3.0)))
    with pytest.raises(InputError, match="did you mean"):
        next(follow(model, "omegas", start, (0.5, 2.0)))


def test_a_path_that_goes_to_and_fro_is_begun_again_beyond(monkeypatch):
    """Sampled friction jumps at the limit of stick; there a path once spent all of its points."""
    model = single_mass()
    start = solve(model, 0.6, 3, 128)
    whole = list(follow(model, "omega", start, (0.6, 1.8)))
    advance = continuation.advance_path
    held = []

    def stays(task, spot, step, longest):
        if spot.x > 0.8 and len(held) < 2 * continuation.CREEPING_POINTS:
            held.append(spot.x)
            return spot, step, False
        return advance(task, spot, step, longest)

    monkeypatch.setattr(continuation, "advance_path", stays)
    points = list(follow(model, "omega", start, (0.6, 1.8)))
    assert points[-1].value > 1.8
    begun = [p for p in points if p.restarted]
    assert begun and "does not advance" in begun[0].restarted and begun[0].value > held[0]
    assert len(points) < len(whole) + 4 * continuation.CREEPING_POINTS


def test_the_mean_place_of_a_contact_counts_little_in_the_length_of_a_path():
    one = np.zeros((2, 3, 7))
    mean, moving = one.copy(), one.copy()
    mean[:, :, 0] = 1.0
    moving[:, :, 1] = 1.0
    assert path_distance(one, mean) == pytest.approx(0.1 * path_distance(one, moving))


@pytest.mark.filterwarnings("error")
def test_a_corner_without_a_finite_direction_has_no_way_on(monkeypatch):
    """A wedge with ground faces under 1100 N asked for a balance at NaN rad/s there, with a warning
    of NumPy among the messages of the run.
    """
    model = single_mass()
    start = solve(model, 0.6, 3, 128)
    task, x, balance, state = continuation._prepare_path(
        model, "omega", start, (0.5, 1.8), DEFAULT_OPTIONS
    )
    task = replace(task, compiled=None)
    spot = spot_at(task, x, balance, state, 0, 1.0)
    monkeypatch.setattr(
        arclength_module, "linearise_balance", lambda *given: lambda vector: np.nan * vector
    )
    assert arclength_module._around_corner(task, spot, 0.01) is None

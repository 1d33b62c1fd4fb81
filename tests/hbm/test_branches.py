"""Every motion of a band, against a plain march in time that shares nothing with the library."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import FOLDING, folding_pair, rebounding

from bladefem.hbm import band_path as band_path_module
from bladefem.hbm import branches as branches_module
from bladefem.hbm import path_maxima as maxima_module
from bladefem.hbm import sweep as sweep_module
from bladefem.hbm.band_path import PathLimits, follow_path
from bladefem.hbm.branches import find_branches
from bladefem.hbm.continuation import PathPoint
from bladefem.hbm.model import Damping
from bladefem.hbm.response import response
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS
from bladefem.hbm.sweep import sweep

BAND = (249.0, 431.0)
# matrices of the model, for the march
M, K, C = FOLDING["M"], FOLDING["K"], FOLDING["C"]
CONTACT, FORCE = FOLDING["contact"], FOLDING["force"]
KT, KN, MU, N0 = FOLDING["element"]


@pytest.fixture(scope="module")
def folding():
    return folding_pair()


def marched(q, v, slider, omega, periods, steps=1000):
    """(height at the first mass over the last period, change from the one before), by leapfrog."""
    dt = 2 * np.pi / omega / steps
    inverse = np.linalg.inv(M)
    history = np.empty((periods, steps))
    for k in range(periods * steps):
        history[k // steps, k % steps] = q[0]
        w = CONTACT @ q
        normal = max(N0 + KN * w[0], 0.0)
        f = np.clip(KT * (w[1] - slider), -MU * normal, MU * normal)
        slider = w[1] - f / KT
        drive = (FORCE * np.exp(1j * omega * k * dt)).real
        push = CONTACT.T @ [normal - N0, f]
        v = v + dt * (inverse @ (drive - K @ q - C @ v - push))
        q = q + dt * v
    lines = 2 / steps * np.fft.rfft(history[-1])[1:20]
    change = abs(history[-1] - history[-2]).max() / abs(history[-1]).max()
    return np.linalg.norm(lines), change


def state_of(model, point):
    """Displacement, velocity and slider of a solution at the start of a period."""
    H = point.harmonics
    f = np.concatenate([point.f[:, :, :1], point.f[:, :, 1:]], axis=2)[0]
    q = np.zeros((2, H + 1), dtype=complex)
    for h in range(H + 1):
        w = h * point.omega
        forces = f[:, 2 * h - 1] - 1j * f[:, 2 * h] if h else f[:, 0] - [N0, 0.0]
        load = (FORCE if h == 1 else 0.0) - CONTACT.T @ forces
        q[:, h] = np.linalg.solve(K - w**2 * M + 1j * w * C, load)
    start = q.sum(axis=1).real
    speed = (1j * point.omega * np.arange(H + 1) * q).sum(axis=1).real
    force = f[1, 0] + f[1, 1::2].sum()
    return start, speed, (CONTACT @ start)[1] - force / KT


def test_a_sweep_finds_the_peak_that_folds_over_and_time_keeps_it(folding):
    """From either end of the band the motion without lift-off leads past it, 3.2 times too low."""
    notes = []
    points = list(sweep(folding, BAND, 15, 1024, notes=notes))
    top = max((p for p in points if p.converged), key=size)
    assert size(top) == pytest.approx(6.26e-4, rel=2e-3)
    assert top.branch > 0 and not notes
    blind = list(response(folding, np.linspace(*BAND, 60), 15, 1024))
    assert max(map(size, blind)) < 2e-4
    start = state_of(folding, top)
    height, change = marched(*start, top.omega * 1.003, 60)
    assert change < 1e-3
    assert height == pytest.approx(
        size(solve(folding, top.omega * 1.003, 15, 1024, start=top)), rel=0.01
    )


def test_resonances_say_how_they_are_reached(folding):
    known = list(response(folding, np.linspace(*BAND, 13), 7, 256))
    found = find_branches(folding, BAND, known, 7, 256)
    top = found.resonances[0]
    assert top.reached == "down" and top.multiplicity == 3
    others = {r.reached for r in found.resonances if r.height < 0.5 * top.height}
    assert "isolated" not in others
    for piece in found.pieces:
        steps = np.diff([p.omega for p in piece])
        assert np.all(steps > 0) or np.all(steps < 0)


def test_a_sweep_that_does_not_end_says_so(folding, monkeypatch):
    monkeypatch.setattr(sweep_module, "BAND_LIMIT", 16)
    monkeypatch.setattr(sweep_module, "_needs_continuation", lambda *arguments: False)
    notes = []
    points = list(sweep(folding, BAND, 3, 128, notes=notes))
    assert "ended after 16 points" in notes[0]
    assert any(p.branch for p in points)


def test_a_probe_on_a_resonance_without_damping_is_left_out():
    """The middle of the band is the only frequency at which nothing but damping holds the mass."""
    model = replace(rebounding(10.0, 0.2, 0.0), damping=Damping())
    own = float(model.side(1).omega[0])
    band = (0.9 * own, 1.1 * own)
    known = list(response(model, band, 5, 128))
    found = find_branches(model, band, known, 5, 128)
    assert found.pieces and not any(p.omega == own for p in found.points)


def test_motions_that_no_path_reached_are_kept(folding, monkeypatch):
    """Paths that end early must not take the place of what the sweep had found beyond them."""
    monkeypatch.setattr(branches_module, "MIN_POINTS", 4)
    monkeypatch.setattr(branches_module, "MAX_POINTS", 4)
    swept = list(response(folding, np.linspace(*BAND, 15), 3, 128))
    highest = max(size(p) for p in swept if p.converged)
    found = find_branches(folding, BAND, swept, 3, 128)
    assert any("ended after 4 points" in note for note in found.notes)
    assert max(size(p) for p in found.points) >= highest * (1 - 1e-6)
    assert all(p.branch > 0 for p in found.points)


def test_paths_with_an_end_for_points_are_given_up_there(folding):
    """Their points and folds tell; without such an end nothing is given up."""
    swept = list(response(folding, np.linspace(*BAND, 15), 3, 128))
    limits = PathLimits(folds=50, points=6)
    few = find_branches(folding, BAND, swept, 3, 128, limits=limits)
    assert len(few.points) == 6 and limits.given_up(few.points)
    every = find_branches(folding, BAND, swept, 3, 128)
    assert PathLimits(folds=1, points=10000).given_up(every.points)
    assert not PathLimits(folds=50, points=10000).given_up(every.points)
    assert not PathLimits(folds=0).given_up(every.points)


def test_a_path_through_a_maze_of_folds_is_left(folding):
    swept = list(response(folding, np.linspace(*BAND, 15), 3, 128))
    found = find_branches(folding, BAND, swept, 3, 128, limits=PathLimits(folds=0))
    assert any("folds" in note for note in found.notes)


def test_known_points_are_not_solved_again(folding, monkeypatch):
    """They come first; a sweep that knows all of its points solves none."""
    points = list(sweep(folding, BAND, 3, 128, paths=False))
    assert all(p.converged for p in points)
    monkeypatch.setattr(sweep_module, "response", lambda *arguments, **options: iter(()))
    monkeypatch.setattr(sweep_module, "solve_from", None)
    again = list(sweep(folding, BAND, 3, 128, paths=False, known=points))
    assert len(again) == len(points)
    assert all(one is other for one, other in zip(again, points, strict=True))


def test_maxima_are_closed_in_by_their_slope(folding, monkeypatch):
    """Short steps along the path take twice as many points, and find no higher maximum."""
    known = list(response(folding, np.linspace(*BAND, 13), 7, 256))
    by_slope = find_branches(folding, BAND, known, 7, 256, peak=1e-4)
    monkeypatch.setattr(maxima_module, "_by_slope", lambda *arguments: None)
    by_steps = find_branches(folding, BAND, known, 7, 256, peak=1e-4)
    assert 3 * len(by_slope.points) < 2 * len(by_steps.points)
    assert len(by_slope.resonances) == len(by_steps.resonances)
    for one, other in zip(by_slope.resonances, by_steps.resonances, strict=True):
        assert one.height > (1 - 1e-6) * other.height
        assert one.height == pytest.approx(other.height, rel=1e-3)
        assert one.reached == other.reached


def test_only_the_highest_maxima_of_a_path_are_closed_in(folding, monkeypatch):
    """A path with more maxima than are worth it: the highest are closed in, from the end on."""
    heights = [0.01, 1.0, 0.01, 3.0, 0.01, 2.0, 0.01, 1e-4, 0.0, 2.5, 2.4999, 2.5]
    # not one of a fraction of the highest, nor one from which the path hardly falls
    found = maxima_module.maxima_to_close_in(heights, 1e-2)
    assert found == [1, 3, 5, 9]
    assert maxima_module.maxima_to_close_in([], 1e-2) == []
    path = SimpleNamespace(
        points=[
            SimpleNamespace(solution=height, value=float(i)) for i, height in enumerate(heights)
        ]
    )
    closed = []
    monkeypatch.setattr(maxima_module, "size", lambda height, probe: height)
    monkeypatch.setattr(maxima_module, "MAX_CLOSED_IN", 2)
    monkeypatch.setattr(
        maxima_module,
        "_by_slope",
        lambda model, three, peak, options: closed.append(three[1].value) or list(three),
    )
    maxima_module.close_in_maxima(folding, path, BAND, 1e-2, DEFAULT_OPTIONS)
    assert closed == [9.0, 3.0]


@pytest.mark.parametrize(("scale", "said"), [(1.01, False), (1.5, True)])
def test_a_path_begun_again_is_said_where_it_does_not_go_on(folding, scale, said, monkeypatch):
    """The motion after the gap is the one before it, to a hundredth, or another one."""
    start = solve(folding, BAND[0], 3, 64)
    near = replace(start, w=scale * start.w, omega=1.001 * start.omega)
    points = [
        PathPoint(start.omega, start, True, False),
        PathPoint(near.omega, near, True, False, restarted="the path stopped"),
    ]
    monkeypatch.setattr(band_path_module, "follow", lambda *given, **options: iter(points))
    notes = []
    follow_path(folding, start, BAND, True, 10, notes, DEFAULT_OPTIONS)
    assert [("begun again" in note) for note in notes] == [True] * said

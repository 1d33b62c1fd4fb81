"""A sweep of contacts that lift off stands for the path of the response where it has no folds.

The models are those of benchmarks/choice_random.py; the judge is the path itself, followed by
arc length from both ends of the band.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bladefem.hbm import one_path
from bladefem.hbm.branches import find_branches
from bladefem.hbm.one_path import has_jump, joined_path
from bladefem.hbm.solution import size
from bladefem.hbm.sweep import sweep
from bladefem.study.adaptive import band_sweep
from bladefem.study.adaptive.band_sweep import response_points, solver_options
from bladefem.study.adaptive.settings import Settings

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from branch_models import random_case

ACCURACY = 0.02
SETTINGS = Settings(10, 7, 512, "rigid")
NO_FOLDS, FOLDS, JUMPS = (7, 29, 47), (41, 43, 59, 89), (43, 85)


def swept(seed, **given):
    case = random_case(seed)
    options = solver_options(ACCURACY)
    points = sweep(case.model, case.band, 7, 512, peak=2e-3, paths=False, options=options, **given)
    return case, sorted(points, key=lambda p: p.omega)


def joined(case, points):
    return joined_path(case.model, points, 7, 512, solver_options(ACCURACY))


@pytest.mark.parametrize("seed", NO_FOLDS)
def test_a_sweep_without_folds_is_the_path_that_is_followed(seed):
    case, points = swept(seed)
    path = joined(case, points)
    followed = find_branches(case.model, case.band, points[::4], 7, 512, peak=2e-3)
    assert len(followed.pieces) == 1
    piece = sorted(followed.pieces[0], key=lambda p: p.omega)
    one, other = (np.array([[p.omega, size(p)] for p in points]).T for points in (path, piece))
    assert one[0, [0, -1]] == pytest.approx(case.band, rel=1e-9)
    top = other[1].max()
    assert one[1].max() == pytest.approx(top, rel=ACCURACY / 5)
    # chords of the followed curve, whose points are two to three times as many
    assert one[1] == pytest.approx(np.interp(one[0], *other), abs=0.05 * top)


@pytest.mark.parametrize("seed", FOLDS)
def test_a_sweep_over_folds_is_no_path(seed):
    case, points = swept(seed)
    followed = find_branches(case.model, case.band, points, 7, 512, peak=2e-3)
    assert len(followed.pieces) > 1
    assert joined(case, points) is None


def test_a_motion_off_the_path_is_no_part_of_it(monkeypatch):
    case, points = swept(7)
    near = points[len(points) // 2]
    lower = replace(near, w=0.5 * near.w)
    monkeypatch.setattr(one_path, "further_motions", lambda *given: [near])
    assert joined(case, points) is not None
    monkeypatch.setattr(one_path, "further_motions", lambda *given: [near, lower])
    assert joined(case, points) is None


def test_points_that_were_not_solved_leave_it_open():
    case, points = swept(7)
    points[3] = replace(points[3], converged=False)
    assert joined(case, points) is None


@pytest.mark.parametrize("seed", [*NO_FOLDS, *JUMPS])
def test_a_jump_is_seen_by_a_rough_sweep(seed):
    case = random_case(seed)
    options = solver_options(1.0)
    rough = sweep(case.model, case.band, 7, 256, peak=1e-2, curve=0.2, paths=False, options=options)
    assert has_jump(sorted(rough, key=lambda p: p.omega)) == (seed in JUMPS)


@pytest.mark.parametrize(("seed", "follows"), [(7, False), (59, True)])
def test_a_curve_is_followed_only_where_it_may_have_folds(seed, follows, monkeypatch):
    """It names the piece of its points in either case, and has the same peak."""
    case, rough = swept(seed, curve=0.2)
    band = case.band[0] / (2 * np.pi), case.band[1] / (2 * np.pi)
    asked = []
    plain = band_sweep.sweep

    def counted(*args, paths=True, **given):
        asked.append(paths)
        return plain(*args, paths=paths, **given)

    monkeypatch.setattr(band_sweep, "sweep", counted)
    points = response_points(case.model, SETTINGS, band, ACCURACY, similar=rough)
    assert asked == [False, True][: 1 + follows]
    assert all(p.branch for p in points)
    anyway = response_points(case.model, SETTINGS, band, ACCURACY)
    assert asked[-1] is True and all(p.branch for p in anyway)
    assert max(map(size, points)) == pytest.approx(max(map(size, anyway)), rel=ACCURACY / 5)

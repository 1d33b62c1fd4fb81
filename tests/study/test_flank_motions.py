"""Marches from unstable motions beside a resonance."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import rebounding

from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import STABLE, UNSTABLE, stability_verdict
from bladefem.study.adaptive.family import Family, Member
from bladefem.study.adaptive.settings import first_for
from bladefem.study.pipeline.curve import Curve
from bladefem.study.pipeline.load_remarks import load_warnings
from bladefem.study.pipeline.motion_warnings import unmarched_motions, unstable_resonances
from bladefem.study.stability import flank_motions as module
from bladefem.study.stability import judged_resonance
from bladefem.study.stability.error_in_time import Marches
from bladefem.study.stability.flank_motions import FlankMotions, flank_motions
from bladefem.study.stability.kept_band import KeptBand
from bladefem.study.stability.verdicts import Stability

HEIGHTS = (0.95, 0.96, 0.97, 0.98, 1.0, 0.95, 0.6)
VERDICTS = (UNSTABLE,) * 4 + (STABLE, UNSTABLE, UNSTABLE)
MULTIPLIERS = np.array([1.03, 1.04, 1.06, 1.05, 1.0, 1.01, 2.0])


def point_at(omega, height):
    probe = np.array([[0.0], [height]])
    return SimpleNamespace(
        omega=omega, frequency=omega, probe=probe, converged=True, states={"lift": 0}
    )


@pytest.fixture
def curve():
    points = [point_at(float(k), height) for k, height in enumerate(HEIGHTS)]
    return SimpleNamespace(points=points, settings=None)


@pytest.fixture
def marks():
    return Stability(np.array(VERDICTS), MULTIPLIERS, bifurcation=np.full(7, ""))


@pytest.fixture
def kept(monkeypatch):
    """What the blade keeps to after each point, settable; and the points marched from."""
    ends = {float(k): (0.9 * h, h) for k, h in enumerate(HEIGHTS)}
    asked = []

    def band(model, point, counted, known):
        asked.append(point.omega)
        lowest, highest = ends[point.omega]
        reason = "" if np.isfinite(highest) else "a march takes too many operations"
        return KeptBand(point.frequency, lowest, highest, 200, reason, too_long=bool(reason))

    monkeypatch.setattr(module, "model_in_time", lambda *_: None)
    monkeypatch.setattr(module, "settings_in_time", lambda *_: None)
    monkeypatch.setattr(module, "band_by_steps", band)
    return ends, asked


MARCHES = SimpleNamespace(models=None)


def test_the_highest_the_fastest_and_both_ends_are_marched_from(curve, marks, kept):
    found = flank_motions(MARCHES, curve, marks, 1.0)
    assert kept[1] == [3.0, 2.0, 0.0, 5.0]
    assert found.point is curve.points[3] and not found.reason


def test_each_hump_of_a_flat_top_is_marched_from(marks, kept):
    heights = (0.95, 1.0, 0.97, 0.98, 0.96, 0.95, 0.6)
    points = [point_at(float(k), height) for k, height in enumerate(heights)]
    every = replace(marks, verdict=np.full(7, UNSTABLE), multiplier=np.linspace(1.2, 1.1, 7))
    kept[0].update({3.0: (0.9, 1.2)})
    found = flank_motions(
        MARCHES, SimpleNamespace(points=points, settings=None), every, 0.9, points[1]
    )
    assert 3.0 in kept[1] and found.point is points[3]


def test_neighbours_are_marched_from_as_long_as_one_is_better(curve, marks, kept):
    kept[0].update({3.0: (0.5, 1.1), 2.0: (0.5, 1.2), 1.0: (0.5, 1.3), 0.0: (0.5, 1.0)})
    found = flank_motions(MARCHES, curve, marks, 1.0)
    assert kept[1] == [3.0, 2.0, 0.0, 5.0, 1.0]
    assert found.point is curve.points[1]


def test_neighbours_of_a_motion_beyond_the_resonance_are_marched_too(curve, marks, kept):
    kept[0].update({0.0: (0.5, 1.6), 1.0: (0.5, 1.7)})
    found = flank_motions(MARCHES, curve, marks, 1.0)
    assert kept[1] == [3.0, 2.0, 0.0, 5.0, 1.0]
    assert found.point is curve.points[1] and found.highest == 1.7


def test_those_beside_a_motion_that_is_known_are_marched_from(curve, marks, kept):
    """On the shipped wedge under 73 N: 139.5 um from 382.57 Hz, 145.6 um from 382.24 Hz."""
    flank_motions(MARCHES, curve, marks, 1.0, known=curve.points[2])
    assert kept[1] == [3.0, 0.0, 5.0, 1.0]


def test_only_motions_that_are_nearly_as_high_and_not_known_count(curve, marks, kept):
    flank_motions(MARCHES, curve, marks, 1.06, known=curve.points[2])
    assert kept[1] == [3.0, 1.0]
    assert flank_motions(MARCHES, curve, marks, 1.2) == FlankMotions()


def test_marches_that_are_not_known_are_told(curve, marks, kept):
    kept[0][2.0] = (np.nan, np.nan)
    found = flank_motions(MARCHES, curve, marks, 1.0)
    # the first one is known, after the one that takes too long there is none
    assert found.point is curve.points[3] and kept[1] == [3.0, 2.0]
    kept[0][3.0] = (np.nan, np.nan)
    assert flank_motions(MARCHES, curve, marks, 1.0).point is None
    curve = SimpleNamespace(load=4.0, mass=None, flank_march_failure=found.reason)
    (reported,) = load_warnings(unmarched_motions([curve]))
    assert reported.detail == "4 N: a march takes too many operations"
    curve.flank_march_failure = ""
    assert not list(unmarched_motions([curve]))


@pytest.mark.parametrize(
    ("highest", "given", "beside"),
    [(1.7, 1.7, 0.0), (1.03, 1.0, 0.03), (0.99, 1.0, 0.0)],
)
def test_a_motion_beside_the_resonance_is_given_or_counted(
    highest, given, beside, curve, marks, monkeypatch
):
    """Beyond the accuracy it is the resonance; within it, part of the error."""
    flank = FlankMotions(curve.points[0], KeptBand(0.0, 0.5, highest, 300))
    models = {"model_in_time": None, "richer_models": [], "stability_of": marks}
    for name, value in models.items():
        monkeypatch.setattr(judged_resonance, name, lambda *_, value=value: value)
    monkeypatch.setattr(judged_resonance, "unstable_with_more_points", lambda *_: None)
    monkeypatch.setattr(judged_resonance, "flank_motions", lambda *_: flank)
    scene = SimpleNamespace(study=SimpleNamespace(stability=True), accuracy=0.05)
    found = judged_resonance.judged_resonance(MARCHES, curve, scene)
    assert found.amplitude == pytest.approx(given)
    assert found.flank_rise == pytest.approx(beside)
    assert found.march_replaces_balance == (given == highest)
    assert found.unstable_peak(curve) is None


def test_a_higher_march_beside_a_marched_resonance_is_given(curve, marks, monkeypatch):
    """On the shipped wedge under 73 N: 139.5 um at the highest motion, 145.6 um beside it."""
    flank = FlankMotions(curve.points[2], KeptBand(2.0, 0.93, 0.94, 300))
    monkeypatch.setattr(judged_resonance, "flank_motions", lambda *_: flank)
    top = judged_resonance.JudgedResonance(
        curve.points[4], marks, KeptBand(4.0, 0.9, 0.91, 200), march_replaces_balance=True
    )
    found = judged_resonance._with_flanks(MARCHES, curve, top, curve.points[4], 0.05)
    assert found.march_replaces_balance and found.amplitude == 0.94


@pytest.mark.parametrize(("verdict", "said"), [(STABLE, "lasts"), ("unknown", "was not judged")])
def test_the_report_says_where_the_amplitude_was_marched_from(verdict, said):
    curve = SimpleNamespace(
        load=4.0,
        mass=None,
        unstable_peak=None,
        march_replaces_balance=True,
        # what was not solved is no motion
        amplitude=np.array([2.05e-6, 2.149e-6, 9e-6]),
        frequency=np.array([1014.2, 1077.3, 1090.0]),
        converged=np.array([True, True, False]),
        stability=np.array([UNSTABLE, verdict, ""]),
        balance_amplitude=2.05e-6,
        peak_frequency=1014.2,
        march_at_peak=KeptBand(1014.2, 1.15e-6, 3.6e-6, 350),
    )
    (text,) = load_warnings(unstable_resonances([curve], 0.02))
    assert "under 4 N the amplitude given is that of an integration in time" in text
    assert f"the highest periodic motion {said}, and" in text
    assert "2.149 um at 1077.3 Hz; from 2.05 um at 1014.2 Hz" in text.detail
    assert "between 1.15 and 3.6 um" in text.detail
    # 1014.2 Hz is the first point
    assert text.advice.startswith("widen study.band")
    curve.frequency = np.array([1000.0, 1077.3, 1090.0])
    (text,) = load_warnings(unstable_resonances([curve], 0.02))
    assert text.advice == "use it as given"
    assert Curve.marched.fget(curve) == pytest.approx(1 - 1.15 / 3.6)


def test_a_doubled_period_beside_a_resonance_is_found():
    """A mass that rebounds: the motion at 3 rad/s doubles its period, and is four times as high."""
    model = rebounding(10.0, 0.1, 0.04)
    family = Family(lambda s: Member(model, np.arange(1)), 1)
    settings = replace(first_for(1), harmonics=15, samples=1024, points=None)
    lasting = point_at(2.0, 1.05 * size(solve(model, 3.0, 15, 1024)))
    doubled = solve(model, 3.0, 15, 1024)
    reported = stability_verdict(model, doubled)
    assert reported.verdict == UNSTABLE
    marks = Stability(np.array([STABLE, UNSTABLE]), np.array([1.0, reported.multiplier]))
    curve = SimpleNamespace(points=[lasting, doubled], settings=settings)
    found = flank_motions(Marches(family), curve, marks, size(lasting))
    assert found.point is doubled and found.highest > 3.5 * size(lasting)

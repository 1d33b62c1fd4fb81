"""Which points of a curve are judged, on which bodies, and what is said of an unstable peak."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import bouncing, bouncing_wave

from bladefem.hbm import sweep as sweep_module
from bladefem.hbm.model import Damping
from bladefem.hbm.response import response
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import STABLE, UNKNOWN, UNSTABLE, Verdict, stability_verdict
from bladefem.study.adaptive.band_sweep import covered_band
from bladefem.study.adaptive.family import Family, Member
from bladefem.study.adaptive.settings import first_for
from bladefem.study.pipeline.accuracy_warnings import unfinished_searches
from bladefem.study.pipeline.load_remarks import load_warnings
from bladefem.study.pipeline.motion_warnings import unjudged_resonances
from bladefem.study.pipeline.stability_remarks import (
    Disturbances,
    judged_disturbances,
    stability_sentence,
)
from bladefem.study.stability import verdicts as stability
from bladefem.study.stability.highest_stable import highest_lasting, next_to_judge
from bladefem.study.stability.kept_band import KeptBand
from bladefem.study.stability.march_from_motion import kept_band
from bladefem.study.stability.verdicts import RicherModel, judged_above, model_in_time, stability_of


def test_a_wave_of_one_harmonic_is_judged_on_the_bodies_with_which_it_repeats():
    rich = bouncing_wave()

    def build(settings):
        sides = rich.sides[: settings.harmonics + 1]
        return Member(replace(rich, sides=sides), np.arange(1))

    settings = replace(first_for(3), harmonics=1)
    family = Family(build, 3, harmonics=8)
    few = build(settings).model
    point = solve(few, 1.2, 1, 64)
    assert stability_verdict(few, point).verdict == UNKNOWN
    model = model_in_time(family, settings)
    assert len(model.sides) == 8
    assert stability_verdict(model, point).verdict in (STABLE, UNSTABLE)


def test_the_sentence_says_which_disturbances_a_wave_was_judged_against():
    """Those that repeat after as many blades: no verdict on those of other nodal diameters."""
    rich = bouncing_wave()
    settings = first_for(3)
    wave = Family(lambda s: Member(rich, np.arange(1)), 3, harmonics=8)
    alone = Family(lambda s: Member(bouncing(), np.arange(1)), 3, harmonics=8)
    blades = [judged_disturbances(family, settings).blades for family in (wave, alone)]
    assert blades == [4, 1]
    verdicts = [(np.array([STABLE]), np.array([0.5]))]
    said = stability_sentence(verdicts, Disturbances(4)).detail
    assert "repeat after 4 blades" in said and "not those of other nodal diameters" in said
    # engine order 9 of 36: harmonics 0 to 3 are diameters 0, 9, 18 and 9 again
    wheel = judged_disturbances(wave, settings, 9, 36)
    assert wheel.diameters == (0, 9, 18) and wheel.possible == 19
    said = stability_sentence(verdicts, wheel).detail
    assert "(nodal diameters 0, 9, 18), not those of the other 16 nodal diameters" in said
    assert "blades" not in "".join(stability_sentence(verdicts).parts)


def test_the_sentence_says_why_nothing_could_be_judged():
    """A wave that does not repeat within its harmonics, and waves in a flow."""
    short = Family(
        lambda s: Member(replace(bouncing_wave(), sides=bouncing_wave().sides[:3]), np.arange(1)),
        3,
        harmonics=2,
    )
    nothing = [(np.array([UNKNOWN]), np.array([np.nan]))]
    said = stability_sentence(nothing, judged_disturbances(short, first_for(3)))
    assert "since the travelling wave does not repeat within 3 harmonics" in said
    assert "expected more of them (model.harmonics)" in said
    # with the wheel known it says how many there would have to be
    coprime = judged_disturbances(short, first_for(3), 7, 60).reason
    assert "engine order 7 repeats after 60 of 60 blades, which takes as many harmonics" in coprime
    said = stability_sentence(nothing, judged_disturbances(short, first_for(3), 9, 36, True))
    assert "no point could be judged, since the flow's forces differ" in said


def test_a_point_of_one_harmonic_is_judged_by_its_motion_with_more():
    model = bouncing()
    rough = solve(model, 1.2, 1, 64)
    fine = solve(model, 1.2, 7, 128, start=rough)
    reported = stability_of(model, [rough])
    assert reported.multiplier[0] == pytest.approx(
        stability_verdict(model, fine).multiplier, rel=1e-9
    )
    assert reported.multiplier[0] != pytest.approx(
        stability_verdict(model, rough).multiplier, rel=1e-6
    )


def test_where_verdicts_are_dear_the_highest_point_and_some_others_are_judged(monkeypatch):
    model = bouncing()
    points = [solve(model, omega, 7, 256) for omega in np.linspace(0.9, 1.4, 12)]
    everything = stability_of(model, points)
    assert not np.any(everything.verdict == UNKNOWN)
    monkeypatch.setattr(stability, "CURVE_OPERATIONS", 0.0)
    alone = stability_of(model, points)
    heights = [abs(p.probe[1, 0]) for p in points]
    top = int(np.argmax(heights))
    assert alone.verdict[top] == everything.verdict[top]
    judged = alone.verdict != UNKNOWN
    assert judged.sum() == 1
    said = stability_sentence([(alone.verdict, alone.multiplier)])
    assert said.endswith(f"{(~judged).sum()} not judged")
    assert said.detail.startswith("where the verdicts on a curve")


def test_unstable_motions_are_judged_again_with_more_harmonics(monkeypatch):
    """The highest first; motions that stay unstable end it, and lift-off is left alone."""
    model = bouncing()
    points = [
        replace(p, states={**p.states, "slip": 1, "lift": lift})
        for p, lift in zip(response(model, [1.1, 1.2, 1.3, 1.0], 7, 128), (0, 0, 0, 1), strict=True)
    ]
    order = np.argsort([-abs(p.probe[1, 0]) for p in points[:3]])
    lasts = {points[order[0]].omega}
    asked = []

    def verdict(of, motion, *limits):
        if motion.harmonics == 7:
            return Verdict(UNSTABLE, 1.2)
        asked.append(motion.omega)
        return Verdict(STABLE, 1.0) if motion.omega in lasts else Verdict(UNSTABLE, 1.1)

    monkeypatch.setattr(stability, "stability_verdict", verdict)
    monkeypatch.setattr(stability, "CONFIRMED_MOTIONS", 1)
    reported = stability_of(model, points, [RicherModel(model, 15, 256)])
    assert asked == [points[i].omega for i in order[:2]]
    assert reported.verdict[order[0]] == STABLE
    assert [reported.verdict[i] for i in (order[1], order[2], 3)] == [UNSTABLE] * 3
    assert list(stability_of(model, points).verdict) == [UNSTABLE] * 4


def closed_points(model, states):
    points = response(model, [1.1, 1.2, 1.3], 7, 128)
    return [replace(p, states={**p.states, "lift": 0, **states}) for p in points]


def test_the_highest_motion_that_is_not_unstable_is_judged_again_too(monkeypatch):
    """Seven harmonics call motions of the shipped wedge stable that a march leaves."""
    model = bouncing()
    points = closed_points(model, {"slip": 1})
    order = np.argsort([-abs(p.probe[1, 0]) for p in points])
    lost = points[order[0]].omega
    asked = []

    def verdict(of, motion, *limits):
        asked.append((motion.omega, motion.harmonics))
        leaves = motion.harmonics > 7 and motion.omega == lost
        return Verdict(UNSTABLE, 1.1) if leaves else Verdict(STABLE, 1.0)

    monkeypatch.setattr(stability, "stability_verdict", verdict)
    richer = [RicherModel(model, 15, 256), RicherModel(model, 31, 512)]
    reported = judged_above(model, points, richer, stability_of(model, points, richer), 0.0)
    assert reported.verdict[order[0]] == UNSTABLE and reported.multiplier[order[0]] == 1.1
    assert [reported.verdict[i] for i in order[1:]] == [STABLE] * 2
    # the richest motion decides, and lower points are left as they are
    assert [a for a in asked if a[1] > 7] == [(points[i].omega, 31) for i in order[:2]]
    asked.clear()
    stability_of(model, closed_points(model, {"slip": 0}), richer)
    assert all(harmonics == 7 for _, harmonics in asked)


def test_the_richest_motion_that_is_found_decides(monkeypatch):
    model = bouncing()
    point = closed_points(model, {"slip": 1})[0]
    starts = []
    solved = stability.solve_near

    def near(of, omega, harmonics, samples, start, options):
        starts.append(start.harmonics)
        found = solved(of, omega, harmonics, samples, start, options)
        return replace(found, converged=harmonics != 31)

    monkeypatch.setattr(stability, "solve_near", near)
    richer = [RicherModel(model, h, 16 * (h + 1)) for h in (15, 31, 23)]
    reported, spent = stability.judged_again(Verdict(UNSTABLE, 1.2), point, richer)
    # each starts from the richest before that was found
    assert starts == [7, 15, 15]
    exact = solved(model, point.omega, 23, 16 * 24, point)
    assert reported.multiplier == pytest.approx(
        stability_verdict(model, exact).multiplier, rel=1e-4
    )
    assert spent > 0


def test_a_model_with_two_tangents_is_marched_by_steps():
    model = bouncing()
    point = solve(model, 1.2, 7, 256)
    assert stability_verdict(model, point).verdict == STABLE
    found = kept_band(model, point)
    assert found.reason == ""
    assert found.holds(np.linalg.norm(abs(point.probe[1:, 0])), 0.02)


@pytest.mark.parametrize(
    ("lowest", "highest", "reason", "holds"),
    [
        (0.99, 1.01, "", True),
        (0.90, 1.01, "", False),
        (0.99, 1.10, "", False),
        (1.0, 1.0, "x", False),
    ],
)
def test_a_band_holds_where_all_of_it_lies_within_the_accuracy(lowest, highest, reason, holds):
    band = KeptBand(1.0, lowest, highest, 100, reason)
    assert band.holds(1.0, 0.05) is holds


def test_what_a_sweep_left_open_reaches_the_remarks(monkeypatch):
    monkeypatch.setattr(sweep_module, "BAND_LIMIT", 3)
    model = replace(bouncing(), damping=Damping(ratio=0.001))
    hertz = np.array([0.9, 1.5]) / (2 * np.pi)
    notes = []
    covered_band(model, first_for(3), tuple(hertz), 1, 0.05, paths=False, notes=notes)
    assert len(notes) == 1 and "the sweep ended after 3 points" in notes[0]
    curve = SimpleNamespace(load=36.0, mass=None, notes=(*notes, "a", "b", "c"))
    (said,) = load_warnings(unfinished_searches([curve]))
    assert said.startswith("under 36 N the search for all motions")
    assert said.detail.startswith("36 N: the sweep ended after 3 points")
    assert said.detail.endswith(", a, b, 1 more of the kind")
    curve.notes = ()
    assert not list(unfinished_searches([curve]))


def judge(branch, heights, stable, most=99):
    """Verdicts on a curve by the search alone, from that of its highest point on."""
    verdicts = np.full(len(heights), UNKNOWN, dtype=object)
    judged = []
    i = int(np.argmax(heights))
    while i is not None and len(judged) < most:
        verdicts[i] = STABLE if stable[i] else UNSTABLE
        judged.append(i)
        i = next_to_judge(heights, branch, verdicts, judged)
    return judged, highest_lasting(heights, verdicts)


def test_the_highest_motion_that_lasts_is_found_by_bisection():
    """A peak of 41 points with 20 unstable ones, and a lower piece whose top is stable or not."""
    x = np.linspace(-1, 1, 41)
    heights = np.concatenate([1 / (0.05 + x**2), 0.2 / (0.05 + x**2)])
    branch = np.repeat([1, 2], 41)
    for width, lower in ((0.5, True), (0.2, False), (0.9, False)):
        stable = np.concatenate([abs(x) > width, lower | (abs(x) > 0.1)])
        judged, top = judge(branch, heights, stable)
        assert top == max(np.flatnonzero(stable), key=lambda i: heights[i])
        assert len(judged) <= 14
    judged, top = judge(branch, heights, np.zeros(82, bool))
    assert top is None and len(judged) <= 20


def test_no_motion_is_taken_to_last_that_was_not_judged(monkeypatch):
    """Eight verdicts from the highest point down left the ninth, unstable too, as the answer."""
    model = bouncing()
    points = list(response(model, np.linspace(0.9, 1.4, 31), 7, 128))
    heights = np.array([abs(p.probe[1, 0]) for p in points])
    limit = np.sort(heights)[-20]

    def verdict(of, motion, *limits):
        high = abs(motion.probe[1, 0]) >= limit
        return Verdict(UNSTABLE, 1.1) if high else Verdict(STABLE, 0.9)

    monkeypatch.setattr(stability, "stability_verdict", verdict)
    monkeypatch.setattr(stability, "CURVE_OPERATIONS", 0.0)
    alone = stability_of(model, points)
    reported = judged_above(model, points, [], alone, 0.0)
    top = highest_lasting(heights, reported.verdict)
    assert heights[top] == heights[heights < limit].max()
    assert (reported.verdict != UNKNOWN).sum() <= 12
    # one that the blade is known to keep beside them: nothing lower is asked for
    least = np.sort(heights)[-10]
    reported = judged_above(model, points, [], alone, least)
    assert (reported.verdict != UNKNOWN).sum() <= 7 and highest_lasting(
        heights, reported.verdict
    ) is None


def test_a_motion_that_was_not_judged_is_no_lasting_one():
    heights = np.array([3.0, 2.0, 1.0])
    assert highest_lasting(heights, np.array([UNSTABLE, UNKNOWN, STABLE])) == 2
    assert highest_lasting(heights, np.array([UNSTABLE, UNKNOWN, UNKNOWN])) is None
    judged = [0, 1, 2]
    branch = np.ones(3, int)
    verdicts = np.array([UNSTABLE, UNKNOWN, UNSTABLE])
    assert next_to_judge(heights, branch, verdicts, judged) is None
    # a curve says so where that motion is its resonance
    curve = SimpleNamespace(
        load=7.0,
        mass=None,
        is_march=False,
        frequency=np.array([1.0, 1.0, 2.0]),
        amplitude=heights,
        stability=np.array([UNKNOWN, STABLE, STABLE]),
        peak=SimpleNamespace(frequency=1.0, probe=np.array([[0.0], [3.0]])),
    )
    (said,) = load_warnings(unjudged_resonances([curve]))
    assert said.startswith("under 7 N the motion at the resonance was not judged")
    curve.is_march = True
    assert not list(unjudged_resonances([curve]))
    curve.is_march = False
    curve.peak.probe[1] = 2.0
    assert not list(unjudged_resonances([curve]))

"""The band of amplitudes after an unstable motion, against a plain march written here."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import bouncing, rebounding
from numba import njit

from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.ring_march import PERIODS_AT_ONCE, never_enough
from bladefem.hbm.solution import size
from bladefem.hbm.solve import solve
from bladefem.hbm.stability import STABLE, UNSTABLE, Verdict
from bladefem.hbm.time_model import time_system
from bladefem.study.adaptive.family import family_member, family_of
from bladefem.study.adaptive.settings import first_for
from bladefem.study.pipeline.curve import Curve
from bladefem.study.pipeline.load_remarks import load_warnings
from bladefem.study.pipeline.motion_warnings import doubtful_resonances
from bladefem.study.stability import (
    exact_march,
    finer_contacts,
    judged_resonance,
    march_by_steps,
    march_from_motion,
)
from bladefem.study.stability.error_in_time import Marches
from bladefem.study.stability.finer_contacts import FinerMotion, unstable_with_more_points
from bladefem.study.stability.flank_motions import FlankMotions
from bladefem.study.stability.kept_band import KeptBand
from bladefem.study.stability.march_from_motion import kept_band
from bladefem.study.stability.verdicts import Stability, in_one_body
from bladefem.time.event_integrator import integrate_periods, state_at_rest

STEPS = 1000


@njit
def marched_period(q, v, gap, omega, loss):
    """Displacements over a period and the state at its end, by leapfrog."""
    dt = 2 * np.pi / omega / STEPS
    seen = np.empty(STEPS)
    for k in range(STEPS):
        seen[k] = q
        drive = np.cos(2 * np.pi * k / STEPS)
        v += dt * (drive - q - loss * v - 10.0 * max(q - gap, 0.0))
        q += dt * v
    return seen, q, v


def marched_amplitudes(gap, omega, harmonics, periods=240, kept=60, loss=0.04):
    """Amplitude of each of the last periods, from rest."""
    q = v = 0.0
    found = []
    for _ in range(periods):
        seen, q, v = marched_period(q, v, gap, omega, loss)
        lines = 2 / STEPS * np.fft.rfft(seen)[1 : harmonics + 1]
        found.append(np.linalg.norm(lines))
    return np.array(found[-kept:])


def points_of_heights(*heights):
    """Converged points at 0, 1, 2, ... rad/s, of which no contact lifts off."""
    return [
        SimpleNamespace(
            omega=float(k),
            frequency=float(k),
            probe=np.array([[0.0], [height]]),
            states={"lift": 0},
            converged=True,
        )
        for k, height in enumerate(heights)
    ]


def test_band_of_a_doubled_period_is_that_of_a_plain_march():
    omega = 3.0
    model = rebounding(10.0, 0.1, 0.04)
    point = solve(model, omega, 15, 1024)
    found = kept_band(model, point)
    truth = marched_amplitudes(0.1, omega, 15)
    assert found.reason == ""
    assert found.lowest == pytest.approx(truth.min(), rel=0.01)
    assert found.highest == pytest.approx(truth.max(), rel=0.01)
    assert found.highest > 4 * size(point)
    assert "keeps between" in found.sentence or "ends on a motion" in found.sentence


def test_the_way_down_from_an_unstable_motion_is_not_what_the_blade_keeps_to():
    """With half of the damping the band is still narrowing after a hundred periods."""
    omega, gap, loss = 3.0, 0.1, 0.02
    model = rebounding(10.0, gap, loss)
    family = family_of(model)
    settings = replace(first_for(family.modes), harmonics=15, samples=1024, points=None, chosen=())
    point = solve(model, omega, 15, 1024)
    marches = Marches(family)
    on_its_way = marches.band(settings, point)
    assert on_its_way.unsettled
    truth = marched_amplitudes(gap, omega, 15, periods=480, kept=50, loss=loss)
    assert on_its_way.highest > 1.1 * truth.max()
    found = judged_resonance._marched(marches, settings, point)
    assert not found.unsettled and not found.widens
    assert found.highest == pytest.approx(truth.max(), rel=0.01)
    assert found.lowest == pytest.approx(truth.min(), rel=0.01)
    # marched once
    assert judged_resonance._marched(marches, settings, point) is found
    # where a higher motion is known it is not marched on
    short = march_by_steps.band_by_steps(model, point, known=2 * truth.max())
    assert short.periods == on_its_way.periods and short.unsettled


def test_a_contact_without_friction_lifts_off_in_time():
    """Stick without friction has no limit that could end it: the normal force alone does."""
    system = time_system(in_one_body(rebounding(10.0, 0.1, 0.04)), 1)
    assert system.mu[0] == 0
    flow = integrate_periods(system, 3.0, state_at_rest(system), 256, 20)
    assert flow.q[:, 0].max() > 0.2 and flow.events >= 10
    # pushed by one side only, the mass swings farther to the other
    assert abs(flow.q[:, 0].min()) > 1.5 * flow.q[:, 0].max()


def test_a_stable_motion_is_kept():
    model = rebounding(10.0, 0.2, 0.04)
    point = solve(model, 3.0, 15, 1024)
    found = kept_band(model, point)
    assert found.lowest == pytest.approx(size(point), rel=2e-3)
    assert found.highest == pytest.approx(size(point), rel=2e-3)
    assert found.friction_work == pytest.approx(point.work.dissipated, rel=0.01)
    assert "ends on a motion" in found.sentence


def test_what_cannot_be_marched_says_why(monkeypatch):
    monkeypatch.setattr("bladefem.study.stability.exact_march.MAX_STEPS", 10.0)
    model = rebounding(10.0, 0.1, 0.04)
    found = kept_band(model, solve(model, 3.0, 3, 128))
    assert "is not known: a march takes" in found.sentence


def test_a_wave_over_four_blades_is_marched_on_sixteen_contact_points_a_seat(monkeypatch):
    """1.1e11 operations on ground faces; fewer points there end on another motion."""
    monkeypatch.setattr(march_from_motion, "march_operations", lambda model, periods: 1.1e11)
    assert march_from_motion.affordable_march(None)
    monkeypatch.setattr(march_from_motion, "march_operations", lambda model, periods: 3.5e11)
    assert not march_from_motion.affordable_march(None)


@pytest.mark.parametrize(
    ("lowest", "highest", "reason", "share"),
    [(0.9, 1.04, "", 0.04), (0.8, 0.95, "", 0.0), (np.nan, np.nan, "too long", 0.0)],
)
def test_a_band_above_the_resonance_given_is_part_of_its_error(lowest, highest, reason, share):
    band = KeptBand(380.0, lowest, highest, 200, reason)
    elsewhere = SimpleNamespace(
        march_at_peak=band,
        curve_amplitude=1.0,
        error_march=None,
        keeps_unstable=False,
        is_marched_from=False,
        march_replaces_balance=False,
    )
    assert Curve.marched.fget(elsewhere) == pytest.approx(share)
    assert Curve.marched.fget(SimpleNamespace(march_at_peak=None, curve_amplitude=1.0)) == 0.0
    here = SimpleNamespace(**vars(elsewhere) | {"keeps_unstable": True, "is_marched_from": True})
    # an unstable resonance without a known march has no error that holds
    beside = np.inf if reason else max(abs(lowest - 1), abs(highest - 1))
    assert Curve.marched.fget(here) == pytest.approx(beside)
    judged = SimpleNamespace(**vars(here) | {"error_march": band})
    assert Curve.marched.fget(judged) == 0.0
    if not reason:
        instead = SimpleNamespace(**vars(here) | {"march_replaces_balance": True})
        assert Curve.marched.fget(instead) == pytest.approx(1 - lowest / highest)


@pytest.mark.parametrize(
    ("lowest", "highest", "contradicts"),
    [(1.7, 1.9, True), (0.5, 0.6, True), (0.7, 1.3, True), (0.7, 1.04, False)],
)
def test_a_march_contradicts_a_balance_of_another_amplitude_than_its_highest(
    lowest, highest, contradicts
):
    """By more than the accuracy; 247 um under 96 N on an imported wedge go to 408 to 455."""
    point = SimpleNamespace(probe=np.array([[0.0], [1.0]]))
    band = KeptBand(380.0, lowest, highest, 200)
    assert judged_resonance._contradicts(band, point, 0.05) == contradicts
    unknown = KeptBand(380.0, np.nan, np.nan, 0, "too long")
    assert not judged_resonance._contradicts(unknown, point, 0.05)


@pytest.mark.parametrize(
    ("kept_to", "given"), [(0.7, 0.9), (0.95, 1.2), (1.19, 1.2), (1.3, 1.2), (np.nan, 1.2)]
)
def test_an_unstable_resonance_gives_way_where_the_blade_keeps_to_less(monkeypatch, kept_to, given):
    """Else it moves most there: 224.9 um that a march brings to 212.8 are not 204 um elsewhere."""
    points = points_of_heights(0.5, 0.9, 1.2)
    marks = Stability(np.array(["stable", "stable", "unstable"]), np.ones(3))
    reason = "too long" if np.isnan(kept_to) else ""
    band = KeptBand(2.0, kept_to, kept_to, 200, reason)
    curve = SimpleNamespace(points=points, settings=None)
    scene = SimpleNamespace(study=SimpleNamespace(stability=True), accuracy=0.05)
    models = {
        "model_in_time": None,
        "richer_models": [],
        "stability_of": marks,
        "flank_motions": FlankMotions(),
    }
    for name, value in models.items():
        monkeypatch.setattr(judged_resonance, name, lambda *_, value=value: value)
    asked = []
    monkeypatch.setattr(
        judged_resonance, "judged_above", lambda *args: asked.append(args[-1]) or marks
    )
    lasting = KeptBand(1.0, 0.9, 0.9, 200)

    def marched_from(*args):
        return band if size(args[-1]) > 1.0 else lasting

    done = SimpleNamespace(models=None, band=marched_from)
    found = judged_resonance.judged_resonance(done, curve, scene)
    assert size(found.point) == pytest.approx(given) and found.march is band
    # motions are judged only above what the blade keeps to, where that is another amplitude
    assert asked == ([kept_to] if kept_to in (0.7, 0.95, 1.3) else [])
    # where that is not marched by steps at this size
    monkeypatch.setattr(judged_resonance, "kept_of_family", marched_from)
    none = SimpleNamespace(models=None, band=lambda *_: None)
    found = judged_resonance.judged_resonance(none, curve, scene)
    assert size(found.point) == pytest.approx(given) and found.march is band


@pytest.mark.parametrize(("held_to", "given"), [(0.88, 0.9), (0.8, 0.8), (0.6, 0.7)])
def test_a_motion_called_stable_that_the_blade_leaves_is_not_given(monkeypatch, held_to, given):
    """Beside an unstable motion of 1.2 that a march brings to 0.7."""
    points = [
        SimpleNamespace(omega=a, frequency=a, probe=np.array([[0.0], [a]]), converged=True)
        for a in (0.5, 0.9, 1.2)
    ]
    marks = Stability(np.array(["stable", "stable", "unstable"]), np.ones(3))
    curve = SimpleNamespace(points=points, settings=None)
    scene = SimpleNamespace(accuracy=0.05)
    for name, value in (("model_in_time", None), ("richer_models", [])):
        monkeypatch.setattr(judged_resonance, name, lambda *_, value=value: value)
    monkeypatch.setattr(judged_resonance, "judged_above", lambda *args: args[3])
    ends = {1.2: 0.7, 0.9: held_to}

    def marched_from(_, point):
        return KeptBand(point.frequency, ends[point.omega], ends[point.omega], 200)

    marches = SimpleNamespace(models=None, band=marched_from)
    found = judged_resonance._at_the_highest(marches, curve, scene, marks, 2)
    assert found.amplitude == pytest.approx(given)
    assert found.march_replaces_balance == (given < 0.9)


def marches_that_grow(point, instants_that_hold):
    """A march whose motion grows fivefold unless it has so many instants."""

    def march(model, start, periods, instants, enough, most):
        growth = 1.0 if instants >= instants_that_hold else 5.0
        return marched(np.full(periods, growth * size(point)), instants, enough)

    return march


def marched(heights, instants, enough=never_enough):
    """Periods of these heights [m], as far as a march with so many instants goes."""
    wave = np.cos(2 * np.pi * np.arange(instants) / instants)
    motion = heights[:, None, None] * wave
    for done in range(PERIODS_AT_ONCE, len(heights) + 1, PERIODS_AT_ONCE):
        if enough(motion[:done]):
            break
    return SimpleNamespace(
        motion=motion[:done],
        friction_work=np.ones(done),
        settled=True,
        resolved=True,
        operations=1.0,
        end=None,
    )


PERIODS = np.arange(800)


def saturated(growing, most):
    """What grows to a limit."""
    return most * growing / (most + growing)


@pytest.mark.parametrize(
    ("heights", "fewest", "most"),
    [
        # falls to another motion, and stays there
        (0.9 + 0.1 * np.exp(-PERIODS / 12), 100, 100),
        # leaves the unstable motion slowly: a hundred thousandth first, more with each period
        (1.0 - saturated(1e-5 * np.exp(PERIODS / 23), 0.2), 250, 400),
        # a slow ripple that widens, as seen by chance at the same phase of it
        (
            1.0 + saturated(1e-4 * np.exp(0.02 * PERIODS), 0.15) * np.cos(2 * np.pi * PERIODS / 9),
            350,
            650,
        ),
        # goes on falling by a thousandth a period
        (1.0 - 1e-3 * PERIODS, 200, 200),
        # goes on widening
        (1.0 + 1e-5 * np.exp(0.012 * PERIODS) * np.cos(2 * np.pi * PERIODS / 9), 800, 800),
    ],
)
def test_a_march_ends_where_its_band_has_settled(monkeypatch, heights, fewest, most):
    """It is longer while its band widens: plane blades under 4 N seemed to keep to 2.2 um of 3.6."""
    model = rebounding(10.0, 0.1, 0.04)
    point = solve(model, 3.0, 15, 1024)
    begun = []

    def march(model, start, periods, instants, enough=never_enough, most=np.inf):
        done = sum(begun)
        found = marched(size(point) * heights[done : done + periods], instants, enough)
        begun.append(len(found.motion))
        return found

    monkeypatch.setattr(march_by_steps, "march_ring", march)
    found = march_by_steps.band_by_steps(model, point)
    assert fewest <= found.periods <= most
    assert found.widens == (fewest == 800) == ("still widens" in found.sentence)
    kept = size(point) * heights[: found.periods][-march_by_steps.KEPT_BY_STEPS :]
    assert found.highest == pytest.approx(kept.max(), rel=2e-3)
    assert found.lowest == pytest.approx(kept.min(), rel=2e-3)


@pytest.mark.parametrize(("holds", "ratio"), [(256, 1.0), (512, 1.0), (1024, 1.0), (2048, 5.0)])
def test_growth_where_contacts_lift_off_is_marched_with_more_instants(monkeypatch, holds, ratio):
    """Impacts in steps that are too long gain energy: they are no motion of the blade."""
    model = rebounding(10.0, 0.1, 0.04)
    point = solve(model, 3.0, 15, 1024)
    assert point.states["lift"] > 0
    monkeypatch.setattr(march_by_steps, "march_ring", marches_that_grow(point, holds))
    found = march_by_steps.band_by_steps(model, point)
    assert found.highest == pytest.approx(ratio * size(point))
    # where the motion stays as it is three parts will do
    assert found.periods == 75


@pytest.mark.parametrize(
    ("ends", "lowest", "highest", "asked"),
    [
        # 256 instants lead away, more do not
        ((0.9, 0.98), 0.98, 0.98, [256, 512]),
        # two agree
        ((0.9, 0.905), 0.905, 0.905, [256, 512]),
        # none do: what the blade keeps to lies between them as far as is known
        ((0.7, 0.9, 0.95), 0.9, 0.95, [256, 512, 1024]),
        # the first holds
        ((0.99,), 0.99, 0.99, [256]),
    ],
)
def test_steps_too_long_for_the_bodies_are_halved(monkeypatch, ends, lowest, highest, asked):
    """With 256 instants a stiff layer's blade seemed to fall to 398 um of 525."""
    model = rebounding(10.0, 0.1, 0.04)
    point = solve(model, 3.0, 15, 1024)
    seen = []

    def march(model, start, periods, instants, enough, most):
        heights = np.full(periods, ends[len(seen)] * size(point))
        seen.append(instants)
        found = marched(heights, instants, enough)
        return SimpleNamespace(**vars(found) | {"resolved": False})

    monkeypatch.setattr(march_by_steps, "march_ring", march)
    monkeypatch.setattr(march_by_steps, "steps_are_resolved", lambda *_: False)
    found = march_by_steps.band_by_steps(model, point)
    assert seen == asked
    assert found.lowest == pytest.approx(lowest * size(point), rel=1e-6)
    assert found.highest == pytest.approx(highest * size(point), rel=1e-6)


@pytest.mark.parametrize(
    ("enough", "failing", "asked"),
    [
        # begun where steps are short enough, for as many steps in all
        (512, (), [(512, 100)]),
        # the forces of a step were not found: with more instants they are
        (256, (256,), [(256, 200), (512, 100)]),
        (512, (512, 1024), [(512, 100), (1024, 100)]),
    ],
)
def test_a_march_begins_with_steps_short_enough_and_goes_on_to_shorter_ones(
    monkeypatch, enough, failing, asked
):
    """With ground faces under 1100 N the march of four points a seat fails with 512 instants."""
    model = rebounding(10.0, 0.1, 0.04)
    point = solve(model, 3.0, 15, 1024)
    seen = []

    def march(model, start, periods, instants, ended, most):
        seen.append((instants, periods))
        found = marched(np.full(periods, size(point)), instants, ended)
        return SimpleNamespace(**vars(found) | {"settled": instants not in failing})

    monkeypatch.setattr(march_by_steps, "march_ring", march)
    monkeypatch.setattr(
        march_by_steps, "steps_are_resolved", lambda _model, _omega, instants: instants >= enough
    )
    found = march_by_steps.band_by_steps(model, point)
    assert seen == asked
    assert bool(found.reason) == (asked[-1][0] in failing)


def test_a_motion_with_lift_off_that_few_harmonics_call_stable_is_marched(monkeypatch):
    """301 um of ground faces under 580 N, three harmonics: a march ends on 287 um."""
    marks = Stability(np.array(["stable"]), np.ones(1), bifurcation=np.full(1, "", dtype="<U15"))
    for name in ("unstable_with_more_points", "model_in_time"):
        monkeypatch.setattr(judged_resonance, name, lambda *_: None)
    monkeypatch.setattr(judged_resonance, "richer_models", lambda *_: [])
    monkeypatch.setattr(judged_resonance, "judged_above", lambda *args: args[3])
    marches = SimpleNamespace(models=None, band=lambda *_: KeptBand(1.0, 0.8, 0.8, 100))

    def given(lift, harmonics):
        point = SimpleNamespace(
            omega=1.0,
            frequency=1.0,
            probe=np.array([[0.0], [1.0]]),
            converged=True,
            states={"lift": lift},
            harmonics=harmonics,
        )
        curve = SimpleNamespace(points=[point], settings=None)
        scene = SimpleNamespace(accuracy=0.05)
        return judged_resonance._at_the_highest(marches, curve, scene, marks, 0)

    found = given(lift=3, harmonics=3)
    assert found.march_replaces_balance and found.amplitude == 0.8
    assert found.marks.verdict[0] == UNSTABLE
    # nothing lifts off, or a verdict has harmonics enough
    assert given(lift=0, harmonics=3).amplitude == given(lift=3, harmonics=15).amplitude == 1.0
    # what keeps within the accuracy is an error of the balance, to either side
    marches.band = lambda *_: KeptBand(1.0, 0.96, 0.97, 100)
    held = given(lift=3, harmonics=3)
    assert held.amplitude == 1.0 and held.marks.verdict[0] == STABLE
    shown = SimpleNamespace(
        march_at_peak=held.march,
        unstable_peak=None,
        keeps_unstable=False,
        march_replaces_balance=False,
        curve_amplitude=1.0,
        error_march=None,
    )
    shown.is_marched_from = Curve.is_marched_from.fget(shown)
    assert Curve.marched.fget(shown) == pytest.approx(0.04)
    # what could not be marched is said
    marches.band = lambda *_: KeptBand(1.0, np.nan, np.nan, 0, "no march")
    unknown = given(lift=3, harmonics=3)
    shown = SimpleNamespace(
        load=580.0, mass=None, march_at_peak=unknown.march, unstable_peak=None, error_march=None
    )
    (said,) = load_warnings(doubtful_resonances([shown]))
    assert said.startswith("under 580 N it is not known whether") and said.detail == "no march"
    assert load_warnings(doubtful_resonances([shown], "a flow"))[0].detail == "a flow"
    # loads that share a reason say it once
    other = SimpleNamespace(**vars(shown) | {"load": 900.0})
    (said,) = load_warnings(doubtful_resonances([shown, other]))
    assert said.startswith("under 580 N and 900 N it is") and said.detail == "no march"
    # but for the error that fewer contact points tell
    shown.error_march = held.march
    assert not list(doubtful_resonances([shown]))
    shown = SimpleNamespace(march_at_peak=held.march, unstable_peak=None, load=1.0)
    assert not list(doubtful_resonances([shown]))


def test_a_march_with_fewer_points_far_from_the_balance_is_in_doubt():
    """Ground faces, 1100 N: eight points a seat keep 457 um of 536 with 16, which keep 517."""

    def error(points):
        band = KeptBand(446.7, 457e-6, 457e-6, 100, points=points)
        return Curve.marched.fget(
            SimpleNamespace(
                march_at_peak=band,
                march_replaces_balance=True,
                settings=SimpleNamespace(points=16),
                balance_amplitude=536e-6,
            )
        )

    assert error(None) == error(32) == 0.0
    assert error(8) > 0.5 * (517 / 457 - 1)


@pytest.fixture
def family_marches(monkeypatch):
    """Contact points and operations of marches that are all too long with more than 8 points, and
    the points with which the motion at the start is not solved, settable.
    """
    tried, unsolved = [], []

    def band(model, point, counted):
        tried.append((point.points, counted))
        too_long = (
            point.points is not None and counted / point.points < march_by_steps.MAX_COUNTED / 8
        )
        return KeptBand(1.0, 1.0, 1.0, 100, "too long" if too_long else "", None, too_long)

    def moved(models, settings, point, fewer, options):
        return motion(fewer.points, fewer.points not in unsolved)

    monkeypatch.setattr(march_from_motion, "model_in_time", lambda *_: None)
    monkeypatch.setattr(march_from_motion, "settings_in_time", lambda _, settings: settings)
    monkeypatch.setattr(march_from_motion, "affordable_march", lambda _: True)
    monkeypatch.setattr(march_from_motion, "kept_band", band)
    monkeypatch.setattr(march_from_motion, "moved_solution", moved)
    return tried, unsolved


def motion(points, converged=True):
    probe = np.array([[0.0], [1.0]])
    return SimpleNamespace(points=points, converged=converged, probe=probe, frequency=1.0)


def kept_with(points):
    return march_from_motion.kept_of_family(
        None, replace(first_for(3), points=points), motion(points)
    )


@pytest.mark.parametrize(
    ("points", "most"), [(8, "MAX_COUNTED"), (4, "MAX_COUNTED_LAST"), (None, "MAX_COUNTED_LAST")]
)
def test_a_march_without_fewer_points_to_try_may_take_more_operations(points, most, family_marches):
    kept_with(points)
    assert family_marches[0] == [(points, getattr(march_by_steps, most))]


def test_fewer_points_are_marched_where_all_take_too_long(family_marches):
    assert kept_with(32).points == 8
    assert [points for points, _ in family_marches[0]] == [32, 16, 8]


def test_a_march_may_take_more_operations_where_fewer_points_are_not_solved(family_marches):
    """On the shipped wedge with 1e4 N/mm^3 under 80 N: 54.8 um with 8 points, 8.8e10 operations."""
    tried, unsolved = family_marches
    unsolved += [8, 4]
    assert not kept_with(16).reason
    assert tried == [(16, march_by_steps.MAX_COUNTED), (16, march_by_steps.MAX_COUNTED_LAST)]
    unsolved += [16]
    tried.clear()
    assert kept_with(32).too_long
    assert tried == [(32, march_by_steps.MAX_COUNTED), (32, march_by_steps.MAX_COUNTED_LAST)]


def test_no_march_begins_at_a_motion_that_is_not_solved(family_marches, monkeypatch):
    affordable = iter([False, True])
    monkeypatch.setattr(march_from_motion, "affordable_march", lambda _: next(affordable))
    family_marches[1].append(16)
    assert "not solved" in kept_with(32).reason
    assert not family_marches[0]


def test_a_motion_that_more_contact_points_leave_is_marched_with_them(monkeypatch):
    """Plane blades under 8 N: stable with four points a seat, with eight and more a torus, of which
    the blade keeps between 0.9 and 1.15 of the amplitude. The verdicts on the curve, the march and
    the point that is given say so.
    """
    points = points_of_heights(0.5, 1.2, 0.9)
    marks = Stability(np.full(3, "stable"), np.ones(3), bifurcation=np.full(3, "", dtype="<U15"))
    models = {
        "model_in_time": None,
        "richer_models": [],
        "stability_of": marks,
        "flank_motions": FlankMotions(),
    }
    for name, value in models.items():
        monkeypatch.setattr(judged_resonance, name, lambda *_, value=value: value)
    monkeypatch.setattr(judged_resonance, "judged_above", lambda *args: args[3])
    finer = FinerMotion(
        SimpleNamespace(points=8),
        SimpleNamespace(probe=np.array([[0.0], [1.0]])),
        Verdict(UNSTABLE, 1.03, "torus"),
    )
    monkeypatch.setattr(judged_resonance, "unstable_with_more_points", lambda *_: finer)
    curve = SimpleNamespace(points=points, settings=None)
    scene = SimpleNamespace(study=SimpleNamespace(stability=True), accuracy=0.02)
    marches = SimpleNamespace(models=None, band=lambda *_: KeptBand(1.0, 0.9, 1.15, 400))
    found = judged_resonance.judged_resonance(marches, curve, scene)
    assert size(found.point) == pytest.approx(1.2)
    assert found.march_replaces_balance and found.amplitude == pytest.approx(1.38)
    assert found.march.lowest == pytest.approx(1.08) and found.march.highest == pytest.approx(1.38)
    assert found.march.points == 8
    assert list(found.marks.verdict) == ["stable", UNSTABLE, "stable"]
    assert found.marks.multiplier[1] == 1.03 and found.marks.bifurcation[1] == "torus"


def test_stability_is_asked_of_all_contact_points_and_of_the_fewest_that_tell(monkeypatch):
    model = reference_model(points=16, load=1.4, phase=0.0, modes=10, harmonics=31)
    models = family_of(model)
    settings = replace(first_for(10), points=2, harmonics=3, samples=64)
    own = family_member(models, settings).model
    point = solve(own, 2 * np.pi * 1200.0, 3, 64)
    point = replace(point, states=point.states | {"slip": 1})
    asked = []

    def judged(needed):
        def reported(_models, _settings, _point, some):
            asked.append(some.points)
            verdict = UNSTABLE if some.points is None or some.points >= needed else STABLE
            return FinerMotion(some, point, Verdict(verdict, 1.1))

        return reported

    monkeypatch.setattr(finer_contacts, "_judged", judged(8))
    found = unstable_with_more_points(models, settings, point, STABLE)
    assert found.settings.points == 8 and found.settings.harmonics == 7
    assert asked == [None, 4, 8]
    monkeypatch.setattr(finer_contacts, "_judged", lambda *_: None)
    assert unstable_with_more_points(models, settings, point, STABLE) is None
    assert unstable_with_more_points(models, replace(settings, points=None), point, STABLE) is None


def test_a_march_that_is_too_long_is_told_in_seconds_and_what_shortens_it():
    """No count of operations, and no power of ten, which nobody can act on."""
    band = march_by_steps.band_by_steps(bouncing(), solve(bouncing(), 1.3, 7, 256), counted=1e3)
    assert band.too_long
    assert re.search(r"takes (less than|about) \d+ (s|min) of one core", band.reason)
    assert "contact.points" in band.reason and not re.search(r"\de\+\d|operations", band.reason)


def test_steps_of_an_exact_march_that_is_too_long_are_told_alike(monkeypatch):
    monkeypatch.setattr(exact_march, "MAX_STEPS", 1e4)
    model = rebounding(10.0, 0.1, 0.04)
    reason = exact_march.exact_band(model, solve(model, 3.0, 15, 1024)).reason
    assert "of one core" in reason and not re.search(r"\de\+\d|steps", reason)

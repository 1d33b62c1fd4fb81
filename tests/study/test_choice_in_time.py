"""Harmonics chosen by a march in time: enough once the blade keeps the amplitude of the balance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_error_in_time import hopping

from bladefem.errors import NotSolvedError
from bladefem.hbm.peak import find_peak
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.study.adaptive import choice_in_time
from bladefem.study.adaptive.choice_in_time import MarchedBand, choose_in_time, marched_widely
from bladefem.study.adaptive.family import Family, Member, family_of
from bladefem.study.adaptive.peak_errors import PeakErrors
from bladefem.study.adaptive.resonance_curve import resonance_curve
from bladefem.study.adaptive.rough_curve import is_lost
from bladefem.study.adaptive.settings import first_for
from bladefem.study.stability.error_in_time import Marches

ACCURACY = 0.05


@dataclass(frozen=True)
class KnownPeak:
    """A peak whose height is known, without a solve."""

    height: float

    @property
    def solution(self):
        """With a height that `bladefem.hbm.solution.size` reads."""
        lines = np.zeros((4, 1), complex)
        lines[1] = self.height
        states = {"stick": 0, "slip": 0, "lift": 16, "open": 0}
        return SimpleNamespace(probe=lines, states=states, w=np.zeros((16, 3, 7)))


@pytest.fixture
def chosen(monkeypatch):
    """The choice among peaks with known heights by harmonics, and what was asked for."""
    family = family_of(reference_model(points=8, load=1.4, phase=0.7, modes=10, harmonics=31))
    start = replace(first_for(family.modes), harmonics=3, points=8)
    asked = []

    def choice(heights, band, points=0.0, other=None, with_points=None):
        def known(family, old, point, new, accuracy, fallbacks=True):
            asked.append(new)
            if with_points is not None and new.points > old.points:
                return KnownPeak(with_points)
            if new.harmonics not in heights:
                raise NotSolvedError("too rich")
            return KnownPeak(heights[new.harmonics])

        def errors(family, settings, peak, accuracy, known):
            changes = {name: change for name, (change, _) in known.items()}
            changes["points"] = points if settings.points == 8 else 0.0
            return PeakErrors(changes, dict.fromkeys(changes, 0.0))

        monkeypatch.setattr(choice_in_time, "peak_from", known)
        monkeypatch.setattr(choice_in_time, "peak_errors", errors)
        march = lambda settings, point, on=None: band if on is None else other
        return choose_in_time(family, start, KnownPeak(heights[3]), ACCURACY, march), asked

    return choice


def test_harmonics_are_added_until_the_blade_keeps_the_amplitude(chosen):
    """36 N on the shipped wedge: with three harmonics 564 um, marched 619; with seven 655, 661."""
    (settings, peak, errors), _ = chosen({3: 0.56, 7: 0.65, 15: 0.66}, MarchedBand(0.66, 0.67))
    assert settings.harmonics == 7 and peak.height == 0.65
    assert errors.in_time and errors.height["harmonics"] == pytest.approx(1 - 0.65 / 0.67)
    assert settings.error == pytest.approx(1 - 0.65 / 0.67)


def test_no_balance_betters_an_amplitude_inside_the_band(chosen):
    (settings, _, errors), asked = chosen({3: 1.38, 7: 1.3}, MarchedBand(1.24, 1.43))
    assert settings.harmonics == 3 and all(s.harmonics <= 3 for s in asked)
    assert errors.height["harmonics"] == pytest.approx(1.38 / 1.24 - 1)


@pytest.mark.parametrize("heights", [{3: 0.56}, {3: 0.56, 7: 0.5}])
def test_the_nearest_peak_is_kept_where_more_harmonics_fail_or_lead_away(heights, chosen):
    (settings, peak, errors), _ = chosen(heights, MarchedBand(0.66, 0.67))
    assert settings.harmonics == 3 and peak.height == 0.56
    assert errors.height["harmonics"] == pytest.approx(1 - 0.56 / 0.67)


@pytest.mark.parametrize(
    ("band", "asked_for"),
    [(MarchedBand(1.043, 1.046), [7]), (MarchedBand(1.043, 1.068), [])],
)
def test_a_higher_motion_that_the_blade_keeps_is_not_left_for_another(band, asked_for, chosen):
    """18 N on the shipped wedge: three harmonics have 921 um, marched 1043 to 1068 um, and seven
    have 638 um, which the blade keeps as well; no harmonics are tried for a motion that is not
    periodic.
    """
    (settings, peak, errors), asked = chosen({3: 0.921, 7: 0.638}, band)
    assert settings.harmonics == 3 and peak.height == 0.921
    assert [s.harmonics for s in asked if s.harmonics > 3] == asked_for
    assert errors.height["harmonics"] == pytest.approx(1 - 0.921 / band.highest)


@pytest.mark.parametrize(("change", "points"), [(0.04, 8), (0.06, 16)])
def test_contact_points_are_added_beyond_the_accuracy(change, points, chosen):
    heights = {3: 0.66}
    (settings, _, _), _ = chosen(heights, MarchedBand(0.66, 0.67), change)
    assert settings.points == points and settings.harmonics == 3


@pytest.mark.parametrize(
    ("kept", "points", "error"),
    [
        ((1.85, 2.14), 8, 2.08 / 1.83 - 1 + 2.08 / 1.85 - 1),
        ((0.58, 0.62), 16, None),
        (None, 16, None),
    ],
)
def test_another_motion_of_a_richer_model_is_asked_in_time(kept, points, error, chosen):
    """9 N on ground faces: four contact points have 2082 um, eight 603 um; marched with eight, the
    first stays.
    """
    other = None if kept is None else MarchedBand(*kept)
    band = MarchedBand(1.83, 2.09)
    (settings, peak, _), _ = chosen({3: 2.08}, band, 0.7, other, with_points=0.603)
    assert settings.points == points
    assert peak.height == (2.08 if points == 8 else 0.603)
    assert error is None or settings.error == pytest.approx(error)


@pytest.mark.parametrize(("change", "counted"), [(0.065, 0.065), (0.0, 0.04), (0.5, 0.04)])
def test_all_points_with_few_harmonics_judge_the_points_too(change, counted, chosen, monkeypatch):
    """Unless they meet another motion."""
    monkeypatch.setattr(choice_in_time, "_change_with_all_points", lambda *_: change)
    (_, _, errors), _ = chosen({3: 0.66}, MarchedBand(0.66, 0.67), 0.04)
    assert errors.height["points"] == counted


def test_all_points_change_a_peak_as_two_peaks_say():
    family = family_of(reference_model(points=16, load=1.4, phase=0.7, modes=10, harmonics=7))
    settings = replace(first_for(family.modes), harmonics=3, points=1)
    few = find_peak(family.build(replace(settings, harmonics=1)).model, 2 * np.pi * 1320, 1, 64)
    every = replace(settings, harmonics=1, points=4096)
    rich = find_peak(family.build(every).model, few.omega, 1, 64)
    reported = choice_in_time._change_with_all_points(family, settings, few, 0.01)
    assert reported == pytest.approx(abs(few.height / rich.height - 1), abs=2e-3)
    assert reported > 0.02
    given = replace(settings, chosen=("harmonics",))
    assert choice_in_time._change_with_all_points(family, given, few, 0.01) == 0.0


def test_without_a_march_others_choose(chosen):
    assert chosen({3: 0.56}, None)[0] is None


def test_where_less_than_half_lifts_off_no_march_is_asked_for():
    settings = replace(first_for(4), harmonics=3)
    top = KnownPeak(1.0).solution
    march = lambda settings, point: None
    assert marched_widely(march, settings, top)
    assert not marched_widely(None, settings, top)
    assert not marched_widely(march, replace(settings, softened=True), top)
    top.states["lift"] = 7
    assert not marched_widely(march, settings, top)


@pytest.mark.parametrize(
    ("height", "converged", "lost"),
    [(0.4, False, True), (0.4, True, False), (0.6, False, False)],
)
def test_a_resonance_is_lost_where_points_beside_it_are(height, converged, lost):
    """And no other one is nearly as high."""

    def point(omega, height, converged=True):
        return SimpleNamespace(
            omega=omega, probe=KnownPeak(height).solution.probe, converged=converged
        )

    points = [point(0.8, height), point(0.99, 0.9, converged), point(1.1, 0.1), point(1.3, 0.05)]
    if converged:
        points[1] = point(0.99, 0.1)
    assert is_lost(point(1.0, 1.0), points) is lost


def test_a_curve_of_a_mass_that_hops_has_the_error_of_its_march():
    """Against a balance of 31 harmonics at the frequency of its peak."""
    model = hopping()
    family = Family(lambda s: Member(model, np.arange(1)), 3)
    chosen = ("harmonics", "samples")
    start = replace(first_for(3), harmonics=1, points=None, chosen=chosen)
    band = 0.8 / (2 * np.pi), 1.4 / (2 * np.pi)
    marches = Marches(family)
    found = resonance_curve(family, start, band, 1, ACCURACY, marches)
    top = max((p for p in found.points if p.converged), key=lambda p: abs(p.probe[1, 0]))
    assert top.states["lift"] == 1 and marches.done
    truth = solve(model, top.omega, 31, 512, start=top)
    off = abs(abs(top.probe[1, 0]) / abs(truth.probe[1, 0]) - 1)
    assert found.parts["samples"] == 0.0
    assert off - 2e-3 <= found.settings.error <= ACCURACY
    best = find_peak(model, top.omega, 31, 512, near=truth)
    assert abs(best.height / abs(top.probe[1, 0]) - 1) <= ACCURACY

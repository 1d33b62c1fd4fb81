"""The best load: against a search of another kind, and where the data cannot carry a headline."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from bladefem.errors import NotSolvedError
from bladefem.hbm import optimum as optimum_module
from bladefem.hbm.next_parameter import next_value
from bladefem.hbm.optimum import lowest_peak, optimum
from bladefem.hbm.peak import find_peak
from bladefem.hbm.peak_levels import PeakSearch
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solver.newton import DEFAULT_OPTIONS
from bladefem.report.best_load import best_load_table, reasons_against
from bladefem.report.headlines import headlines
from bladefem.report.statements import response_answer
from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene, vary
from bladefem.study.adaptive.family import family_of
from bladefem.study.adaptive.settings import Settings
from bladefem.study.pipeline import best_load_search as search_module
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.best_load import CHART_LOAD_FACTORS, chart_loads
from bladefem.study.pipeline.best_load_search import find_best_load, search_range
from bladefem.study.pipeline.load_variation import load_variation
from bladefem.study.pipeline.loads import default_loads

HZ = 2 * np.pi
PLANE = Path(__file__).parents[2] / "scenes" / "plane.toml"
# force that is needed to close a gap before the seat presses [N]
CLOSING = 0.4
MODEL = reference_model(1e6, 0.06, 1.0, harmonics=7)
SETTINGS = Settings(len(MODEL.sides[0].omega), 3, 0, "mass")


def case_at(load: float) -> LoadCase:
    """A seat whose normal force is what the load leaves after closing a gap: not proportional."""
    elements = replace(MODEL.elements, n0=np.full(2, load - CLOSING))
    return LoadCase(load, elements, np.eye(2))


def family(case: LoadCase):
    return family_of(replace(MODEL, elements=case.elements))


def scene(**study):
    found = load_scene(PLANE, ["accuracy=1 %", "contact.mu=1", "excitation.force=0.05 N"])
    return replace(found, study=replace(found.study, band=(1150.0, 1450.0), **study))


@pytest.fixture(scope="module")
def best():
    return find_best_load(scene(), case_at, family, SETTINGS, None)


def test_the_search_follows_a_seating_that_is_not_proportional_to_the_load(best):
    """The same optimum as of the normal force alone, plus what closes the gap."""
    band = (HZ * 1150, HZ * 1450)
    force = optimum(MODEL, band, (0.3, 6.0), 3, 0)
    assert best.reason == ""
    assert best.amplitude == pytest.approx(force.peak.height, rel=2 * best.tolerance)
    assert best.load == pytest.approx(force.value * MODEL.elements.n0[0] + CLOSING, rel=0.03)
    assert best.between[0] < best.load < best.between[1]
    for load in best.between:
        peak = find_peak(family(case_at(load)).build(SETTINGS).model, HZ * best.frequency, 3, 0)
        assert peak.height == pytest.approx(1.01 * best.amplitude, rel=2e-3)


def test_a_search_near_a_known_load_looks_farther_where_that_was_wrong(best):
    """From three times the best load: outside the neighbourhood that is searched first, or inside,
    the same load is found.
    """
    for factor in (0.9, 20.0):
        again = find_best_load(scene(), case_at, family, SETTINGS, None, start=factor * best.load)
        assert again.reason == ""
        assert again.amplitude == pytest.approx(best.amplitude, rel=3 * best.tolerance)


@pytest.mark.parametrize("failures", [{1}, {1, 2}, {2}, {3}])
def test_a_step_to_a_load_without_a_solved_peak_is_shortened(best, monkeypatch, failures):
    """Also where the first one, or another, already lies between loads that enclose the best one."""
    solve_level = optimum_module.solve_level
    tried = []

    def sometimes(search, value, near):
        tried.append(value)
        if len(tried) in failures:
            raise NotSolvedError("no peak")
        return solve_level(search, value, near)

    monkeypatch.setattr(optimum_module, "solve_level", sometimes)
    found = find_best_load(scene(), case_at, family, SETTINGS, None)
    assert found.reason == "" and len(tried) > max(failures)
    assert found.amplitude == pytest.approx(best.amplitude, rel=3 * best.tolerance)


def test_a_bracket_between_very_different_heights_is_halved(best):
    """No cubic is laid from one branch of a design chart to the other: it makes up a minimum next
    to the lower end, or hides one.
    """
    along = load_variation(case_at, family, SETTINGS)
    search = PeakSearch(along, (HZ * 1150, HZ * 1450), 3, 0, (0.5, 5.0), 1e-3, DEFAULT_OPTIONS)
    peak = find_peak(along.model_at(best.load), HZ * best.frequency, 3, 0)
    low = replace(peak, value=1.0, height=10.0, slope=-6.5)
    high = replace(peak, value=4.0, height=1.0, slope=0.2)
    value, gain = next_value(search, low, high, tangents=False)
    assert value == pytest.approx(2.0) and gain == np.inf
    value, gain = next_value(search, replace(low, height=2.0, slope=-1.0), high, tangents=False)
    assert 2.0 < value < 4.0 and np.isfinite(gain)


@pytest.mark.parametrize(("first", "start"), [(1, 5.0), (2, 0.6), (3, None)])
def test_steps_are_as_long_as_before_after_one_that_is_solved(best, monkeypatch, first, start):
    """Three shortened ones left every later step a 27th of what it should be: 30 values did not
    close the bracket.
    """
    solve_level = optimum_module.solve_level
    tried = []

    def late(search, value, near):
        tried.append(value)
        if first <= len(tried) < first + optimum_module.MOST_SHORTENED:
            raise NotSolvedError("no peak")
        return solve_level(search, value, near)

    monkeypatch.setattr(optimum_module, "solve_level", late)
    found = find_best_load(scene(), case_at, family, SETTINGS, None, start, with_range=False)
    assert found.reason == "" and len(tried) < 15
    assert found.amplitude == pytest.approx(best.amplitude, rel=3 * best.tolerance)


def test_a_bracket_whose_tangents_do_not_meet_is_halved(best):
    """Of a wedge damper, 39.68 um under 15.81 N and 23.95 um under 28.08 N: the cubic promises less
    than 0.4 %, but 23.77 um are left under 25.8 N.
    """
    along = load_variation(case_at, family, SETTINGS)
    search = PeakSearch(along, (HZ * 1150, HZ * 1450), 3, 0, (0.5, 5e4), 4e-3, DEFAULT_OPTIONS)
    peak = find_peak(along.model_at(best.load), HZ * best.frequency, 3, 0)
    low = replace(peak, value=15.8114, height=39.6835, slope=-0.584 * 39.6835)
    high = replace(peak, value=28.079, height=23.9536, slope=0.235 * 23.9536)
    for tangents in (False, True):
        value, gain = next_value(search, low, high, tangents)
        assert value == pytest.approx(np.sqrt(low.value * high.value))
        assert gain > 1 - 23.773 / 23.9536 > search.tolerance
    # what is left is bounded by the slope of the lower end, so that a search ends
    near = replace(high, slope=1e-3 * high.height)
    assert next_value(search, low, near, False)[1] < search.tolerance


def test_a_search_that_runs_out_of_values_says_where_the_minimum_is(best, monkeypatch):
    monkeypatch.setattr(optimum_module, "MOST_LEVELS", 3)
    reason = find_best_load(scene(), case_at, family, SETTINGS, None).reason
    assert reason.startswith("the search did not converge within 3 values; the lowest resonance")
    low, high = (float(word) for word in reason.split("between ")[1].split()[:3:2])
    assert low < best.load < high and reason.endswith(" N")


def test_a_search_that_is_too_large_is_made_with_less(best, monkeypatch):
    """It ends where that does, with the error that the richer settings show."""

    def too_large(family, settings, point, limit):
        return settings.harmonics > 3

    monkeypatch.setattr(search_module, "too_large", too_large)
    poor = replace(SETTINGS, harmonics=1, samples=64, chosen=("harmonics", "samples"))
    found = find_best_load(replace(scene(), accuracy=1e-4), case_at, family, poor, None)
    assert found.reason == "" and found.settings.harmonics == 3
    assert abs(found.amplitude / best.amplitude - 1) < 2 * found.settings.error + best.tolerance


def test_less_means_fewer_contact_points_first(best, monkeypatch):
    """And what the scene gives stays."""

    def too_large(family, settings, point, limit):
        return point.states["lift"] > 0 and settings.points * (2 * settings.harmonics + 1) > 40

    monkeypatch.setattr(search_module, "too_large", too_large)
    lifting, closed = (SimpleNamespace(states={"lift": lift}) for lift in (3, 0))
    rich = replace(SETTINGS, harmonics=15, points=16, chosen=("harmonics", "points"))
    less = search_module._smaller_settings
    assert less(family, rich, lifting) == replace(rich, harmonics=3, points=4)
    assert less(family, rich, closed) == rich
    given = replace(rich, chosen=("harmonics",))
    assert less(family, given, lifting) == replace(given, harmonics=3)


def test_a_search_without_any_solved_neighbour_says_so(monkeypatch):
    def never(search, value, near):
        raise NotSolvedError("no peak at all")

    monkeypatch.setattr(optimum_module, "solve_level", never)
    assert "no peak at all" in find_best_load(scene(), case_at, family, SETTINGS, None).reason


def test_the_slope_of_a_peak_with_the_load_is_the_difference_of_two_peaks():
    along = load_variation(case_at, family, SETTINGS)
    low, middle, high = (
        find_peak(along.model_at(load), HZ * 1350, 3, 0, tolerance=1e-8)
        for load in (1.398, 1.4, 1.402)
    )
    found = along.with_slope(along.model_at(1.4), middle, 1.4).slope
    assert found == pytest.approx((high.height - low.height) / np.log(1.402 / 1.398), rel=0.02)


@pytest.mark.parametrize("solved", [True, False])
def test_a_search_begins_with_few_harmonics_and_ends_with_those_that_are_needed(
    best, monkeypatch, solved
):
    """Settings of another load may be far richer; where few harmonics are not solved, the search
    begins with these.
    """
    search_once = search_module._search_once
    used = []

    def watched(search, settings, *others):
        used.append(settings)
        if settings.harmonics <= 3 and not solved:
            raise NotSolvedError("no peak")
        return search_once(search, settings, *others)

    monkeypatch.setattr(search_module, "_search_once", watched)
    rich = replace(SETTINGS, harmonics=7, samples=256, chosen=("harmonics", "samples"))
    found = find_best_load(scene(), case_at, family, rich, None)
    assert used[0].harmonics == 3 and used[0].samples == 64
    assert any(s.harmonics == 7 for s in used) is not solved
    assert found.reason == "" and found.settings.error < 0.01
    within = 2 * found.settings.error + 3 * best.tolerance
    assert found.amplitude == pytest.approx(best.amplitude, rel=within)


def test_a_repeated_search_begins_at_the_resonance_that_is_known(best):
    """Where a peak next to it is not solved, those of the linear limits are sought as before."""
    along = load_variation(case_at, family, SETTINGS)
    known = find_peak(along.model_at(best.load), HZ * best.frequency, 3, 0)
    band = (HZ * 1150, HZ * 1450)
    points = [
        lowest_peak(along, band, (0.5, 5.0), 3, 0, start=best.load, near=near, rise=0.01)
        for near in (None, known)
    ]
    assert points[1].points < points[0].points
    assert points[1].peak.height == pytest.approx(points[0].peak.height, rel=2e-3)


def test_a_chart_reaches_from_an_eighth_of_the_best_to_thirty_times_it(best):
    loads = chart_loads([best])
    assert len(loads) == len(CHART_LOAD_FACTORS)
    assert loads[0] == pytest.approx(best.load / 8, rel=0.05)
    assert loads[-1] == pytest.approx(30 * best.load, rel=0.05)
    assert float(f"{best.load:.4g}") in loads


def test_a_search_near_a_known_resonance_and_without_a_range_is_short(best):
    """It ends at the same load, and spends fewer points."""
    model = load_variation(case_at, family, SETTINGS).model_at(best.load)
    known = find_peak(model, HZ * best.frequency, 3, 0)
    start = 0.9 * best.load
    with_range, short = (
        find_best_load(scene(), case_at, family, SETTINGS, None, start, **how)
        for how in ({}, {"near": known, "with_range": False})
    )
    assert short.amplitude == pytest.approx(best.amplitude, rel=2 * best.tolerance)
    assert short.load == pytest.approx(with_range.load, rel=0.03)
    assert short.points < with_range.points


def test_a_search_that_fails_says_why():
    def lost(case: LoadCase):
        return family_of(replace(MODEL, elements=case.elements, excitation={1: np.zeros(1)}))

    found = find_best_load(scene(), case_at, lost, SETTINGS, None)
    assert "does not move" in found.reason and np.isnan(found.load)
    assert found.settings.error == np.inf


def tables(best, **changes):
    """Design table and search of a case that a headline may rest on, with changes."""
    table = best_load_table([best]).assign(**changes)
    summary = pd.DataFrame(
        {
            "load": [0.0, best.load, np.inf],
            "peak_frequency": [1200.0, best.frequency, 1400.0],
            "peak_amplitude": [20 * best.amplitude, best.amplitude, 20 * best.amplitude],
            "dissipated": [0.0, best.dissipated, 0.0],
        }
    )
    return summary, table


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"reason": "point lost", "amplitude": np.nan}, "search failed"),
        ({"dissipated": 0.0}, "not lowered by friction"),
        ({"lowest_searched": 1e3}, "falls to the lowest load searched"),
        ({"highest_searched": 1e-3}, "falls to the highest load searched"),
        ({"error": np.inf}, "is unknown"),
        ({"error": 0.97}, "no more than its estimated error"),
    ],
)
def test_a_headline_is_refused_when_its_data_cannot_carry_it(best, changes, said):
    summary, table = tables(best, **changes)
    found = response_answer(summary, searched=table)
    assert found.numbers[0][1] == "not determined"
    assert any(said in caution for caution in found.cautions)


def test_the_lowest_amplitude_found_is_that_of_no_higher_load(best):
    """Where the search's load carries no headline, a load studied may have a lower resonance, whose
    error is the one beside it.
    """
    summary, table = tables(best, error=np.inf)
    lower = {"load": 2 * best.load, "peak_frequency": 1234.5, "error": 0.07, "dissipated": 1.0}
    summary.loc[3] = {**summary.loc[1], "peak_amplitude": 0.9 * best.amplitude, **lower}
    summary["error"] = [0.01, np.inf, 0.01, 0.07]
    for rows, micrometres, error in ((summary, 0.9e6, "± 7 %"), (summary[:3], 1e6, "unknown")):
        answer = response_answer(rows, searched=table)
        [found] = [
            one
            for one in headlines(answer, rows, None, table)
            if one.what == "lowest resonance amplitude found"
        ]
        assert found.value == f"{micrometres * best.amplitude:.4g} µm"
        assert error in found.uncertainty
    assert "1234.5 Hz" in response_answer(summary, searched=table).numbers[1][2]


def test_a_headline_is_refused_beside_a_point_that_was_not_solved(best):
    summary, table = tables(best)
    points = pd.DataFrame(
        {
            "load": best.load,
            "frequency": [1.0, 2.0, 3.0],
            "amplitude": [1.0, 2.0, 1.5],
            "converged": [True, True, False],
        }
    )
    row = summary.iloc[1]
    assert "not solved" in reasons_against(row, summary, points)[0]
    assert not reasons_against(row, summary, points.assign(converged=True))


def test_a_headline_tells_its_tolerance_and_the_loads_that_do_as_well(best):
    summary, table = tables(best)
    found = response_answer(summary, searched=table).numbers
    assert found[0][1] == f"{best.load:.4g} N" and "by exact search" in found[0][2]
    assert "search ended within" in found[1][2] and "estimated error" in found[1][2]


def test_the_range_of_the_search_is_that_of_the_friction_of_the_seats():
    """contact.mu counts only for seats that have no value of their own."""
    own = vary(Scene(), contact__mu=0.0, contact__left__mu=0.2, contact__right__mu=0.4)
    assert search_range(own) == pytest.approx(search_range(vary(Scene(), contact__mu=0.3)))
    assert default_loads(own) == default_loads(vary(Scene(), contact__mu=0.3))

"""Statistics of mistuned wheels: dampers that walk in all of them, and the cheap level calibrated by
wheels that are solved in full.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_walking_dampers import BLADES, free_dampers, resonance

from bladefem.hbm.solver.newton import DEFAULT_OPTIONS
from bladefem.report.scatter_sentences import scatter_headlines, scatter_sentences
from bladefem.report.scatter_tables import (
    optimum_is_known,
    optimum_table,
    scatter_table,
    shown_wheels,
    wheel_table,
)
from bladefem.report.tables import readable_texts
from bladefem.study.mistuning import peak_choice
from bladefem.study.mistuning.law_level import with_checks
from bladefem.study.mistuning.peak_choice import SearchedWheel, chosen_peak, pattern_peak
from bladefem.study.mistuning.sector_comparison import (
    SectorComparison,
    compared_with_sector,
    with_comparison,
)
from bladefem.util.message import Message
from bladefem.wheel.local_peak import LocalPeak
from bladefem.wheel.lumped import lumped_pattern
from bladefem.wheel.model import Pattern
from bladefem.wheel.pattern_peak import PatternPeak, compared_peaks
from bladefem.wheel.resonance import WheelPeak
from bladefem.wheel.scatter import Scatter, drawn_patterns
from bladefem.wheel.statistics import (
    Amplification,
    joined_loads,
    no_checks,
    scatter_statistics,
)


def test_wheels_of_the_statistics_walk_as_one_wheel_does():
    """Amplification is of free means over free means, as a single pattern's is."""
    free = free_dampers(np.array([4.0, 2.0]), 1.5)
    held = replace(free, coupled=False)
    grid = resonance() * np.linspace(0.95, 1.05, 11)
    drawn = drawn_patterns(held, Scatter(0.01), 2, lambda d: lumped_pattern(BLADES, d))
    balance = 3, 128

    def searched(pattern):
        return SearchedWheel(held, free, pattern, 1, DEFAULT_OPTIONS)

    found = scatter_statistics(
        {4.0: drawn}, lambda _, pattern: pattern_peak(searched(pattern), grid, balance)
    )
    alone = [chosen_peak(searched(pattern), grid, balance, None) for pattern in (Pattern(), *drawn)]
    heights = np.array([one.free.peak.height for one in alone])
    assert found.mean_released.all()
    assert found.tuned[0] == pytest.approx(heights[0], rel=1e-6)
    np.testing.assert_allclose(found.peak[0], heights[1:], rtol=1e-6)
    held_heights = np.array([one.held.height for one in alone])
    assert found.tuned_held[0] == pytest.approx(held_heights[0], rel=1e-6)
    np.testing.assert_allclose(found.held_factor[0], held_heights[1:] / held_heights[0], rtol=1e-6)
    assert abs(found.tuned[0] / found.tuned_held[0] - 1) > 0.005
    assert found.released_effect[0] == pytest.approx(
        abs(heights / held_heights - 1).max(), rel=1e-6
    )
    assert any("free mean displacements" in text for text in scatter_sentences(found))


def test_a_free_maximum_beside_a_lost_point_does_not_count(monkeypatch):
    """Its resonance may be higher beyond that point."""
    free = free_dampers(np.array([4.0, 2.0]), 1.5)
    held = replace(free, coupled=False)
    grid = resonance() * np.linspace(0.98, 1.02, 5)
    omegas, sizes = np.array([0.9, 1.0, 1.1]), np.array([[1.0], [2.0], [1.5]])
    closed = WheelPeak(1.0, 2.0, 0, sizes[1], omegas, sizes, 0)
    lost = replace(closed, sizes=np.array([[1.0], [2.0], [np.nan]]), unsolved=1)
    for peak, known in ((closed, True), (lost, False)):
        again = LocalPeak(peak, None, 0.0, 3)
        monkeypatch.setattr(peak_choice, "local_peak", lambda *_, again=again: again)
        searched = SearchedWheel(held, free, Pattern(), 1, DEFAULT_OPTIONS)
        found = pattern_peak(searched, grid, (2, 64))
        assert found.asked and (found.free is not None) == known


def of_one_load(load, tuned, factors, compared):
    """Statistics of whole wheels that were compared with the sector."""
    none = np.zeros((1, len(factors)), dtype=int)
    one = np.ones(1)
    found = Amplification(
        load * one,
        tuned * one,
        one,
        tuned * factors[None],
        none,
        one[None],
        none,
        none,
        *no_checks(1),
    )
    return with_comparison(found, compared)


def agreed(load, tuned, factors):
    return of_one_load(load, tuned, factors, SectorComparison(tuned, tuned, True))


def test_each_wheel_has_a_line():
    """Seed and number find a wheel again; the page has the load with the lowest tuned wheel."""
    found = joined_loads([agreed(load, 1e-6 * load, np.array([1.2, 1.4])) for load in (40.0, 80.0)])
    found = replace(found, omega=2 * np.pi * np.array([[400.0, 401.0], [410.0, 411.0]]))
    table = wheel_table(found, 7)
    assert list(table["wheel"]) == [1, 2, 1, 2] and set(table["seed"]) == {7}
    np.testing.assert_allclose(table["amplification"], [1.2, 1.4, 1.2, 1.4])
    np.testing.assert_allclose(table["highest_amplitude"], [48e-6, 56e-6, 96e-6, 112e-6])
    np.testing.assert_allclose(table["peak_frequency"], [400, 401, 410, 411])
    assert list(shown_wheels(found, 7)["wheel"]) == [2, 1]
    assert (shown_wheels(found, 7)["load"] == 40.0).all()


def test_a_searched_load_is_the_tuned_optimum():
    """A parabola through the loads studied has another minimum than the search, which is one of
    them: one of both is shown.
    """
    factors = np.linspace(1.1, 1.3, 40)
    tuned = {40.0: 3e-4, 70.0: 2e-4, 160.0: 2.9e-4}
    found = joined_loads([agreed(load, height, factors) for load, height in tuned.items()])
    parabola = optimum_table(found)["load"][0]
    assert abs(parabola / 70.0 - 1) > 0.02
    assert optimum_table(found, 70.0)["load"][0] == 70.0
    assert "by search: 70 N, 200 um" in scatter_sentences(found, searched=70.0)[0]
    assert scatter_headlines(found, 70.0)[1].value == "70 N"
    # one that was not studied is not known here
    assert optimum_table(found, 75.0)["load"][0] == parabola


def test_an_open_end_of_few_wheels_is_a_dash():
    found = agreed(40.0, 3e-4, np.linspace(1.1, 1.3, 4))
    assert scatter_table(found)["p50_low"][0] == -np.inf
    shown = readable_texts(scatter_table(found)).iloc[0]
    assert shown["50 % from"] == shown["50 % to"] == "-"


def test_amplification_is_refused_where_the_sector_moves_otherwise():
    """Quantiles, optimum and headlines leave out what the balance of all blades does not describe;
    the tuned amplitude is the sector's.
    """
    factors = np.linspace(1.1, 1.3, 40)
    good = [
        of_one_load(load, tuned, factors, SectorComparison(tuned, 1.02 * tuned, True))
        for load, tuned in ((80.0, 2e-4), (160.0, 3e-4))
    ]
    wrong = of_one_load(40.0, 3e-4, factors, SectorComparison(3e-4, 5e-4, False))
    found = joined_loads([wrong, *good])
    np.testing.assert_allclose(found.tuned, [5e-4, 2e-4, 3e-4])
    np.testing.assert_allclose(found.factor, np.tile(factors, (3, 1)))
    table = scatter_table(found)
    numbers = ["p50", "p95_low", "p99_high", "worst", "highest_amplitude"]
    assert table.loc[0, numbers].isna().all() and table.loc[1:, numbers].notna().all(axis=None)
    assert list(table["amplification_known"]) == [False, True, True]
    (said,) = [text for text in scatter_sentences(found) if "load is not known" in text]
    assert isinstance(said, Message) and said.level == "warning"
    assert "300 um for the tuned wheel" in said and "response 500 um" in said
    assert optimum_is_known(found)
    assert any("counts as high as the tuned one" in text for text in scatter_sentences(found))
    # the lowest wheels of all are those that are not known
    low = of_one_load(40.0, 3e-4, factors, SectorComparison(3e-4, 1e-4, False))
    found = joined_loads([low, *good])
    assert not optimum_is_known(found)
    assert any("no robust optimum" in text for text in scatter_sentences(found))
    optimum, amplification = scatter_headlines(found)
    assert optimum.value == "not determined"
    assert amplification.what.startswith("amplification at 80 N")


@pytest.mark.parametrize("wheels", [10, 40])
def test_what_an_interval_by_the_sample_leaves_out_is_told(wheels):
    """Harmonics of the loads on both sides of the optimum, and too few wheels."""
    factors = np.linspace(1.1, 1.3, wheels)
    parts = [
        replace(
            of_one_load(load, tuned, factors, SectorComparison(tuned, tuned, True)),
            truncation=np.array([truncation]),
        )
        for load, tuned, truncation in (
            (320.0, 4e-4, 0.09),
            (40.0, 3e-4, 0.07),
            (80.0, 2e-4, 0.02),
            (160.0, 3.2e-4, 0.03),
        )
    ]
    found = joined_loads(parts)
    (height,) = [one for one in scatter_headlines(found) if one.what.startswith("highest blade")]
    # the parabola in the logarithms is lower at 40 N than at 160 N: its bottom lies between 40 and
    # 80 N, whose balances leave 7 and 2 %
    assert "estimated to leave, up to 7 %" in height.remark
    said = [text for text in scatter_sentences(found) if "too few for a bootstrap" in text]
    assert len(said) == (wheels < 30) and all(one.level == "warning" for one in said)


@pytest.mark.parametrize(("sector", "agrees"), [(1.09, True), (1.2, False), (0.8, False)])
def test_tuned_wheel_is_compared_within_the_error_of_the_sector(sector, agrees):
    several = free_dampers(np.array([4.0, 2.0]), 1.5)
    wheel = replace(several, excitation={1: several.excitation[1]})
    curve = SimpleNamespace(peak_amplitude=sector, error=0.05)
    found = compared_with_sector(wheel, curve, 1.0, 0.05)
    assert found.agrees == agrees and found.sector == sector
    # the sector's response is that to one engine order
    assert np.isnan(compared_with_sector(several, curve, 1.0, 0.05).sector)


def test_like_is_compared_with_like():
    """A wheel without a balance of free means keeps its amplification with held ones, and where the
    tuned wheel has none all of them do.
    """
    heights = np.array([[2.0, 3.0, 4.0], [1.9, 2.85, np.nan], [1.0, 1.0, 1.0]])
    found = compared_peaks(heights)
    assert found.tuned == 1.9 and found.tuned_held == 2.0
    np.testing.assert_allclose(found.height / found.tuned, [1.5, 2.0])
    np.testing.assert_array_equal(found.mean_released, [True, False])
    heights[1, 0] = np.nan
    without = compared_peaks(heights)
    assert without.tuned == 2.0 and not without.mean_released.any()
    np.testing.assert_array_equal(without.height, [3.0, 4.0])
    heights[2] = 0.0
    assert np.isnan(compared_peaks(heights).tuned_held)


def peak_of(height):
    none = np.zeros(0)
    return PatternPeak(WheelPeak(1.0, height, 0, none, none, none, 0))


def test_a_law_that_is_wrong_by_a_factor_is_calibrated():
    """Amplifications 10 % too low and 2 % scattered: the calibrated ones are right in the mean, and
    the intervals hold the quantiles of all wheels solved in full.
    """
    rng = np.random.default_rng(2)
    truth = 1.2 + 0.1 * rng.standard_normal(500)
    by_law = 0.9 * truth * (1 + 0.02 * rng.uniform(-1, 1, len(truth)))
    zeros = np.zeros((1, len(truth)))
    # the tuned wheel of the law is 3 % off too
    law = Amplification(
        np.array([40.0]),
        np.array([0.97]),
        np.array([1.0]),
        0.97 * by_law[None],
        zeros.astype(int),
        zeros,
        zeros.astype(int),
        zeros.astype(int),
        *no_checks(1),
        law_harmonics=np.array([3]),
    )
    patterns = [Pattern(start=np.array([i])) for i in range(len(truth))]

    def whole_peak(pattern):
        return peak_of(1.0 if pattern.start is None else truth[int(pattern.start[0])])

    found = with_checks(law, patterns, whole_peak, 6, None)
    assert found.tuned[0] == 1.0
    assert found.calibration[0] == pytest.approx(1 / 0.9, rel=0.02)
    np.testing.assert_allclose(found.whole[0], truth[found.checked[0]])
    np.testing.assert_allclose(found.check_errors, by_law[found.checked] / found.whole - 1)
    assert found.check_errors.max() < -0.07
    for share in (0.5, 0.95, 0.99):
        quantile = found.quantile(0, share)
        exact = np.quantile(truth, share)
        # 2 % by the law, and what six wheels leave open in the mean
        assert quantile.value == pytest.approx(exact, rel=0.03)
        assert quantile.low < exact < quantile.high
    # a wheel that is solved in full is its own, and the others are the law times one factor
    np.testing.assert_allclose(found.factor[0, found.checked[0]], truth[found.checked[0]])
    others = np.setdiff1d(np.arange(len(truth)), found.checked)
    expected = found.calibration[0] * by_law[others]
    np.testing.assert_allclose(found.factor[0, others], expected)
    every = with_checks(law, patterns, whole_peak, len(truth), None)
    np.testing.assert_allclose(every.factor[0], truth)
    np.testing.assert_array_equal(every.calibration_bounds, 1.0)
    assert scatter_table(found)["law_error"][0] == abs(found.check_errors).max()
    (said,) = [text for text in scatter_sentences(found) if "law of one damper" in text]
    assert f"multiplied by {found.calibration[0]:.4g}" in said

"""Statistics of mistuned wheels: dampers that walk in all of them, and the cheap level calibrated by
wheels that are solved in full.
"""

from dataclasses import replace

import numpy as np
import pytest
from test_walking_dampers import BLADES, free_dampers, resonance

from bladefem.hbm.solver.newton import DEFAULT_OPTIONS
from bladefem.report.wheel import scatter_sentences, scatter_table
from bladefem.study.mistuning import peak_choice
from bladefem.study.mistuning.law_level import with_checks
from bladefem.study.mistuning.peak_choice import chosen_peak, pattern_peak
from bladefem.util.message import Message
from bladefem.wheel.local_peak import LocalPeak
from bladefem.wheel.lumped import lumped_pattern
from bladefem.wheel.model import Pattern
from bladefem.wheel.pattern_peak import PatternPeak, compared_peaks
from bladefem.wheel.resonance import WheelPeak
from bladefem.wheel.scatter import Scatter, drawn_patterns
from bladefem.wheel.statistics import Amplification, no_checks, scatter_statistics


def test_wheels_of_the_statistics_walk_as_one_wheel_does():
    """Amplification is of free means over free means, as a single pattern's is."""
    free = free_dampers(np.array([4.0, 2.0]), 1.5)
    held = replace(free, coupled=False)
    grid = resonance() * np.linspace(0.95, 1.05, 11)
    drawn = drawn_patterns(held, Scatter(0.01), 2, lambda d: lumped_pattern(BLADES, d))
    balance = 3, 128
    found = scatter_statistics(
        {4.0: drawn},
        lambda _, pattern: pattern_peak(held, free, pattern, grid, balance, 1, DEFAULT_OPTIONS),
    )
    alone = [
        chosen_peak(held, pattern, grid, balance, 1, DEFAULT_OPTIONS, None, free=free)
        for pattern in (Pattern(), *drawn)
    ]
    heights = np.array([one.free.peak.height for one in alone])
    assert found.free.all()
    assert found.tuned[0] == pytest.approx(heights[0], rel=1e-6)
    np.testing.assert_allclose(found.peak[0], heights[1:], rtol=1e-6)
    held_heights = np.array([one.held.height for one in alone])
    assert found.tuned_held[0] == pytest.approx(held_heights[0], rel=1e-6)
    np.testing.assert_allclose(found.held_factor[0], held_heights[1:] / held_heights[0], rtol=1e-6)
    assert abs(found.tuned[0] / found.tuned_held[0] - 1) > 0.005
    assert any("free mean displacements" in text for text in scatter_sentences(found))


def test_a_free_maximum_beside_a_lost_point_does_not_count(monkeypatch):
    """Its resonance may be higher beyond that point."""
    free = free_dampers(np.array([4.0, 2.0]), 1.5)
    held = replace(free, coupled=False)
    grid = resonance() * np.linspace(0.98, 1.02, 5)
    omegas, sizes = np.array([0.9, 1.0, 1.1]), np.array([[1.0], [2.0], [1.5]])
    closed = WheelPeak(1.0, 2.0, 0, sizes[1], omegas, sizes, 0, 0.0)
    lost = replace(closed, sizes=np.array([[1.0], [2.0], [np.nan]]), unsolved=1)
    for peak, known in ((closed, True), (lost, False)):
        again = LocalPeak(peak, None, 0.0, 3)
        monkeypatch.setattr(peak_choice, "local_peak", lambda *_, again=again: again)
        found = pattern_peak(held, free, Pattern(), grid, (2, 64), 1, DEFAULT_OPTIONS)
        assert found.asked and (found.free is not None) == known
        assert np.isnan(found.at_least) if known else found.at_least == 2.0


def test_a_tuned_wheel_that_moves_further_with_free_means_is_told():
    """Where its resonance with free means is not closed in, those that are held count."""
    heights = np.array([[2.0, 3.0], [np.nan, np.nan], [1.0, 1.0], [3.1, np.nan]])
    compared = compared_peaks(heights)
    assert compared.tuned == 2.0 and compared.tuned_at_least == 3.1
    none = np.zeros((1, 1), dtype=int)
    one = np.ones(1)
    found = Amplification(
        one,
        2e-6 * one,
        one,
        np.full((1, 1), 3e-6),
        none,
        np.ones((1, 1)),
        none,
        none,
        *no_checks(1),
        tuned_held=2e-6 * one,
        tuned_at_least=3.1e-6 * one,
        held_factor=compared.held_factor[None],
        free=compared.free[None],
    )
    (said,) = [text for text in scatter_sentences(found) if "held" in text]
    assert isinstance(said, Message) and said.level == "warning"
    assert "it moves 3.1 um or more" in said


def test_like_is_compared_with_like():
    """A wheel without a balance of free means keeps its amplification with held ones, and where the
    tuned wheel has none all of them do.
    """
    nowhere = np.full(3, np.nan)
    heights = np.array([[2.0, 3.0, 4.0], [1.9, 2.85, np.nan], [1.0, 1.0, 1.0], nowhere])
    found = compared_peaks(heights)
    assert found.tuned == 1.9 and found.tuned_held == 2.0
    np.testing.assert_allclose(found.height / found.tuned, [1.5, 2.0])
    np.testing.assert_array_equal(found.free, [True, False])
    heights[1, 0] = np.nan
    without = compared_peaks(heights)
    assert without.tuned == 2.0 and not without.free.any()
    assert np.isnan(without.tuned_at_least)
    np.testing.assert_array_equal(without.height, [3.0, 4.0])
    heights[2] = 0.0
    assert np.isnan(compared_peaks(heights).tuned_held)


def peak_of(height):
    none = np.zeros(0)
    return PatternPeak(WheelPeak(1.0, height, 0, none, none, none, 0, 0.0))


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

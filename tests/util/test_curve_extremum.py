"""Extrema from a few points, against curves whose extremum is known."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from bladefem.util.curve_extremum import (
    cubic_minimum,
    find_maxima,
    parabola_at_middle,
    parabola_minimum,
    tangents_meet,
)


def test_a_parabola_through_three_uneven_points():
    x = np.array([1.0, 1.3, 2.9])
    place, height = parabola_minimum(x, 3.0 * (x - 1.7) ** 2 + 0.25)
    assert place == pytest.approx(1.7, rel=1e-14)
    assert height == pytest.approx(0.25, rel=1e-13)


def test_a_parabola_that_opens_downwards_has_no_minimum():
    x = np.array([0.0, 1.0, 2.0])
    assert parabola_minimum(x, -(x**2)) is None
    assert parabola_minimum(x, x) is None


def test_many_parabolas_at_once_agree_with_polyfit(rng):
    left = rng.uniform(0.5, 2.0, 20)
    right = rng.uniform(0.5, 2.0, 20)
    y = rng.standard_normal((3, 20))
    slope, bend = parabola_at_middle(left, right, y[0] - y[1], y[2] - y[1])
    for i in range(20):
        a, b, _ = np.polyfit([-left[i], 0.0, right[i]], y[:, i], 2)
        assert bend[i] == pytest.approx(a, abs=1e-12)
        assert slope[i] == pytest.approx(b, abs=1e-12)


@pytest.mark.parametrize("down, up, rise", [(-1.0, 2.0, 0.1), (-3.0, 0.5, -0.7), (-1.0, 1.0, 0.0)])
def test_the_cubic_between_two_points(down, up, rise):
    def cubic(x):
        return down * x + (3 * rise - 2 * down - up) * x**2 + (down + up - 2 * rise) * x**3

    share, height = cubic_minimum(down, up, rise)
    found = minimize_scalar(cubic, bounds=(0, 1), method="bounded", options={"xatol": 1e-10})
    assert cubic(1.0) == pytest.approx(rise)
    assert share == pytest.approx(found.x, abs=1e-6)
    assert height == pytest.approx(found.fun, abs=1e-12)


def test_the_tangents_of_a_corner_meet_there():
    """|x - 0.3| between 0 and 1."""
    share, height = tangents_meet(-1.0, 1.0, 0.7 - 0.3)
    assert share == pytest.approx(0.3)
    assert height == pytest.approx(-0.3)


def test_maxima_are_at_least_as_high_as_both_neighbours():
    assert find_maxima(np.array([0.0, 1.0, 1.0, 0.5, 2.0, 0.0, 3.0])).tolist() == [1, 2, 4]
    assert find_maxima(np.zeros(2)).size == 0


@pytest.fixture
def rng():
    return np.random.default_rng(0)

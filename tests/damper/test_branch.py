"""Floquet multipliers along a path with two folds: two seconds, most of them the path by 15
harmonics.
"""

from itertools import pairwise

import numpy as np
import pytest

from bladefem.damper.branch import branch, inclined_contact


@pytest.fixture(scope="module")
def points():
    return list(branch(*inclined_contact(), (110.0, 200.0)))


def test_shooting_confirms_every_point(points):
    """The two agree to 3e-4 where the motion leaves the contact and to rounding where it sticks."""
    assert {p.reason for p in points} == {"periodic"}
    assert max(abs(p.amplitude / p.balance - 1) for p in points) < 2e-3


def test_the_path_is_unstable_between_its_folds(points):
    tip = int(np.argmax([p.amplitude for p in points]))
    turn = next(i for i, p in enumerate(points) if p.fold and p.frequency > 150)
    assert points[turn].frequency == pytest.approx(155.52, abs=0.3)
    assert max(p.multiplier for p in points[:tip]) < 1 + 1e-9  # rocking: stable
    assert (
        min(p.multiplier for p in points[tip : turn - 1] if p.frequency > 128) > 1.02
    )  # between: a saddle
    assert (
        max(p.multiplier for p in points[turn + 1 :]) < 1 + 1e-9
    )  # stuck: stable, one for its slider


def test_three_motions_at_one_frequency(points):
    """At 150 Hz the path passes 40.15, 23.16 and 9.32 um, as shooting from other starts finds
    (test_exact_flow).
    """
    crossed = []
    for a, b in pairwise(points):
        if (a.frequency - 150) * (b.frequency - 150) <= 0:
            share = (150 - a.frequency) / (b.frequency - a.frequency)
            crossed.append(1e6 * (a.amplitude + share * (b.amplitude - a.amplitude)))
    assert crossed == pytest.approx(
        [40.15, 23.16, 9.316], rel=0.01
    )  # linear between points 1 % apart

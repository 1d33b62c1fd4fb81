"""Durations in words."""

import pytest

from bladefem.util.durations import core_time


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.0, "less than 1 s"),
        (0.97, "about 1 s"),
        (1.0, "about 1 s"),
        (59.0, "about 59 s"),
        (170.0, "about 3 min"),
        (3599.0, "about 60 min"),
        (9000.0, "about 2 h"),
    ],
)
def test_durations_have_the_unit_that_people_use(seconds, said):
    assert core_time(seconds) == said

"""Loads are shared over the ranks so that each has light ones, which take long, and heavy ones."""

import pytest

from bladefem.study.pipeline.loads import dealt_to_rank


def test_dealt_to_and_fro():
    assert [dealt_to_rank(8, rank, 2) for rank in range(2)] == [[0, 3, 4, 7], [1, 2, 5, 6]]


@pytest.mark.parametrize(("count", "ranks"), [(8, 1), (8, 3), (3, 4), (0, 2)])
def test_every_load_has_one_rank(count, ranks):
    shares = [dealt_to_rank(count, rank, ranks) for rank in range(ranks)]
    assert sorted(i for share in shares for i in share) == list(range(count))

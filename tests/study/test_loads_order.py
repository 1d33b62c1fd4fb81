"""The order in which loads are solved."""

from bladefem.study.pipeline.loads import longest_first


def test_loads_right_below_the_best_one_come_first():
    loads = [9.0, 150.0, 36.0, 18.0, 73.0]
    assert [loads[i] for i in longest_first(loads, 66.0)] == [36.0, 18.0, 9.0, 73.0, 150.0]


def test_without_a_best_load_the_lightest_come_first():
    loads = [9.0, 150.0, 36.0]
    assert [loads[i] for i in longest_first(loads)] == [9.0, 36.0, 150.0]

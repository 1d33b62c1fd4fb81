"""Iterations that advance together."""

import threading

import pytest

from bladefem.util.lockstep import run_together


def counting(times):
    return lambda ask: [ask(i) for i in range(times)]


def test_questions_are_answered_together_until_each_is_done():
    asked = []

    def answer(some):
        asked.append([i for i, _ in some])
        return [10 * i + q for i, q in some]

    found = run_together([counting(1), counting(3), counting(0)], answer)
    assert found == [[0], [10, 11, 12], []]
    assert asked == [[0, 1], [1], [1]]


def test_answers_come_from_the_callers_thread():
    here = []

    def answer(some):
        here.append(threading.current_thread() is threading.main_thread())
        return [q for _, q in some]

    run_together([counting(2), counting(2)], answer)
    assert all(here)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_failing_answer_ends_all(error):
    before = threading.active_count()

    def answer(_):
        raise error("no")

    with pytest.raises(error):
        run_together([counting(2), counting(2)], answer)
    assert threading.active_count() == before


def test_a_failing_iteration_ends_the_others():
    before = threading.active_count()

    def failing(ask):
        ask(1)
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        run_together([counting(1000), failing], lambda some: [q for _, q in some])
    assert threading.active_count() == before

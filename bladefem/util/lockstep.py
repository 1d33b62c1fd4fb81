"""Iterations that advance together: what they all ask for next is answered in one go.

An iteration is a plain function that calls ``ask(question)`` and goes on with the answer. Each runs
in a thread of its own, but only one thread runs at any moment and control changes hands at the
questions alone: these are coroutines, in a form that works across libraries in C (here SLEPc, which
calls back for each product). Nothing has to be safe for threads, and the order of all steps is the
same in every run.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

Question = TypeVar("Question")
Reply = TypeVar("Reply")
Result = TypeVar("Result")
Ask = Callable[[Question], Reply]


class _StoppedError(Exception):
    """Another iteration failed, or the program is interrupted: this one ends at its question."""


class _Iteration:
    """One iteration: it waits at a question, or is done."""

    def __init__(self, task: Callable[[Ask[Any, Any]], Any]) -> None:
        self.question: Any = None
        self.reply: Any = None
        self.result: Any = None
        self.error: BaseException | None = None
        self.done = False
        self._task = task
        self._stopped = False
        self._go = threading.Semaphore(0)
        self._stands = threading.Semaphore(0)
        self._running = False
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def advance(self) -> None:
        """Let it run to its next question or its end."""
        self._go.release()
        self._running = True
        self.settle()

    def settle(self) -> None:
        """Wait until it pauses; an interrupt may leave this wait."""
        if self._running and not self.done:
            self._stands.acquire()
            self._running = False

    def stop(self) -> None:
        """End it at its question."""
        self._stopped = True
        while not self.done:
            self.settle()
            if not self.done:
                self.advance()
        self._thread.join()

    def _work(self) -> None:
        self._go.acquire()
        try:
            if not self._stopped:
                self.result = self._task(self._ask)
        # whatever it is: the caller raises it again
        except BaseException as error:
            self.error = error
        self.done = True
        self._stands.release()

    def _ask(self, question: Any) -> Any:
        self.question = question
        self._stands.release()
        self._go.acquire()
        if self._stopped:
            raise _StoppedError
        return self.reply


def run_together(
    tasks: Sequence[Callable[[Ask[Question, Reply]], Result]],
    answer: Callable[[list[tuple[int, Question]]], list[Reply]],
) -> list[Result]:
    """Results of all tasks.

    Args:
        tasks: functions of ``ask``.
        answer: replies to the questions of those tasks that are not done, each with the number of
            its task; called in this thread.

    Raises:
        whatever ``answer`` or a task raises; the other tasks are ended first.

    >>> def doubled(ask):
    ...     return ask(1) + ask(2)
    >>> run_together([doubled, lambda ask: ask(5)], lambda some: [2 * q for _, q in some])
    [6, 10]
    """
    if len(tasks) == 1:
        # no other to wait for, so no thread
        return [tasks[0](lambda question: answer([(0, question)])[0])]
    iterations = [_Iteration(task) for task in tasks]
    try:
        for each in iterations:
            each.advance()
        while waiting := _standing(iterations):
            replies = answer([(i, each.question) for i, each in waiting])
            for (_, each), reply in zip(waiting, replies, strict=True):
                each.reply = reply
                each.advance()
    finally:
        for each in iterations:
            each.stop()
    return [each.result for each in iterations]


def _standing(iterations: list[_Iteration]) -> list[tuple[int, _Iteration]]:
    """Processes that wait for a reply; what one of them raised is raised here."""
    for each in iterations:
        if each.error is not None:
            raise each.error
    return [(i, each) for i, each in enumerate(iterations) if not each.done]

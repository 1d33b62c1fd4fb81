"""CPU seconds as they will be next time: without what numba compiles, once for ever, on the way."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from numba.core.event import Event, Listener, install_listener


class Clock(Listener):
    """CPU seconds of this process, those of compilation apart; it hears of compilation from
    ``running_clock``.
    """

    def __init__(self) -> None:
        # seconds, seconds, compilations within each other
        self.compiled = 0.0
        self._begun = 0.0
        self._depth = 0

    def now(self) -> float:
        """CPU seconds since some fixed time."""
        return time.process_time() - self.compiled

    def on_start(self, event: Event) -> None:
        """numba's compiler is entered, which also finds and reads what was compiled before."""
        self._begun = self._begun if self._depth else time.process_time()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """numba's compiler is left; calls for which it was entered before the clock ran do not
        count.
        """
        self._depth = max(self._depth - 1, 0)
        if not self._depth:
            self.compiled += time.process_time() - self._begun


@contextmanager
def running_clock() -> Iterator[Clock]:
    """A clock that takes no notice of compilation while the block runs."""
    clock = Clock()
    with install_listener("numba:compiler_lock", clock):
        yield clock

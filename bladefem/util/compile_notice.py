"""A line on the error stream where numba compiles for longer than two seconds.

Kernels are compiled when they are first called after a change of their sources, all of them in some
minutes of processor time: a script would say nothing meanwhile.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from time import monotonic

from numba.core import event

from .first_rank import is_first_rank

# numba's name of the compilation of one function for one set of types
COMPILATION = "numba:compile"
# of all compilations so far, before it is said [s]
SILENT_SECONDS = 2.0
# whose kernels they are
PACKAGES = ("bladefem", "geometry")
NOTICE = (
    "bladefem: compiling kernels for this machine, which takes some minutes in all; they are kept "
    "for later runs"
)


class CompileNotice(event.Listener):
    """Says once that kernels are compiled, when that has taken more than SILENT_SECONDS."""

    def __init__(self, say: Callable[[str], None], clock: Callable[[], float] = monotonic) -> None:
        self._say = say
        self._clock = clock
        # compilations that have begun and not ended: one asks for those of what it calls
        self._open = 0
        self._begun = 0.0
        self._spent = 0.0
        self._said = False

    def on_start(self, event: event.Event) -> None:
        if not _is_own(event):
            return
        if self._open == 0:
            self._begun = self._clock()
        self._open += 1
        self._look(self._clock())

    def on_end(self, event: event.Event) -> None:
        if not _is_own(event):
            return
        now = self._clock()
        self._look(now)
        self._open = max(self._open - 1, 0)
        if self._open == 0:
            self._spent += now - self._begun

    def _look(self, now: float) -> None:
        if not self._said and self._spent + now - self._begun > SILENT_SECONDS:
            self._said = True
            self._say(NOTICE)


def _is_own(event: event.Event) -> bool:
    """A kernel of this package is compiled, none of the user's own, and no loop without a name."""
    module = getattr(event.data["dispatcher"].py_func, "__module__", None) or ""
    return module.split(".")[0] in PACKAGES


def announce_compilation() -> None:
    """Register the notice of this process, on the first of several ranks."""
    if is_first_rank():
        event.register(COMPILATION, CompileNotice(_on_error_stream))


def _on_error_stream(text: str) -> None:
    print(text, file=sys.stderr, flush=True)

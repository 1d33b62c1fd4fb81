"""Progress of what takes long, one for all ranks: a bar on a terminal, for what takes over two
seconds; elsewhere, as in the log of a batch job, a line as an item begins, at most one a minute. An
item that takes long, such as one factorisation, is silent.

Long loops take a :data:`Progress` that wraps what they go through; :func:`without_progress` shows
nothing and is the default.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sized
from time import monotonic
from typing import Any, TypeVar

T = TypeVar("T")
# seconds between the lines of a log
LINE_INTERVAL = 60.0
# of a terminal that does not know its own
DEFAULT_TERMINAL_SIZE = {"ncols": 80, "nrows": 24}
# progress(items, label, total): see watch
Progress = Callable[..., Iterable[Any]]


def without_progress(
    items: Iterable[T], label: str = "", total: int | None = None, **options: Any
) -> Iterable[T]:
    """The progress display that shows nothing."""
    return items


def progress_wanted(quiet: bool = False, rank: int = 0) -> bool:
    """Whether a bar is shown: not quiet, on rank 0, and the error stream is a terminal (mpirun: the
    starter's was).
    """
    return (
        not quiet
        and rank == 0
        and (sys.stderr.isatty() or os.environ.get("BLADEFEM_TERMINAL") == "1")
    )


def with_progress(
    items: Iterable[T],
    label: str = "",
    total: int | None = None,
    shown: bool = True,
    logged: bool = False,
    **options: Any,
) -> Iterator[T]:
    """The items, with a bar of the remaining time once two seconds have passed, or with a line on
    the error stream as an item begins, :data:`LINE_INTERVAL` after the last one at least.

    Args:
        items: a list or a generator.
        label: what is being done.
        total: number of items, when ``items`` cannot say it.
        shown: answer of :func:`progress_wanted`: a bar.
        logged: lines, where no bar is shown.
        options: passed on to tqdm.
    """
    if not shown:
        yield from _with_lines(items, label, total) if logged else items
        return
    from tqdm import tqdm

    size = DEFAULT_TERMINAL_SIZE if _without_size() else {"dynamic_ncols": True}
    yield from tqdm(
        items, desc=label, total=total, **({"delay": 2.0, "leave": False} | size | options)
    )


def _with_lines(items: Iterable[T], label: str, total: int | None) -> Iterator[T]:
    """The items; "bladefem: reduction: 12 of 40 after 95 s" once in a while."""
    if total is None and isinstance(items, Sized):
        total = len(items)
    started = said = monotonic()
    for done, item in enumerate(items):
        now = monotonic()
        if now - said >= LINE_INTERVAL:
            said = now
            share = f"{done} of {total}" if total is not None else f"{done} done"
            line = f"bladefem: {label}: {share} after {now - started:.0f} s"
            print(line, file=sys.stderr, flush=True)
        yield item


def _without_size() -> bool:
    """Whether the terminal says that it has no columns, as some in containers do; tqdm would show
    nothing there.
    """
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns == 0
    except (OSError, ValueError, AttributeError):
        return False

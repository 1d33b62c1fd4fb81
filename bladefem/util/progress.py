"""Progress bars: on a terminal only, one for all ranks, and only for what takes over two seconds.

Long loops take a :data:`Progress` that wraps what they go through; :func:`without_progress` shows
nothing and is the default.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

T = TypeVar("T")
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
    **options: Any,
) -> Iterator[T]:
    """The items, with a bar of the remaining time once two seconds have passed.

    Args:
        items: a list or a generator.
        label: what is being done.
        total: number of items, when ``items`` cannot say it.
        shown: answer of :func:`progress_wanted`.
        options: passed on to tqdm.
    """
    if not shown:
        yield from items
        return
    from tqdm import tqdm

    size = DEFAULT_TERMINAL_SIZE if _without_size() else {"dynamic_ncols": True}
    yield from tqdm(
        items, desc=label, total=total, **({"delay": 2.0, "leave": False} | size | options)
    )


def _without_size() -> bool:
    """Whether the terminal says that it has no columns, as some in containers do; tqdm would show
    nothing there.
    """
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns == 0
    except (OSError, ValueError, AttributeError):
        return False

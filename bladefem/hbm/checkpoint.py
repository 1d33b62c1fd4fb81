"""Responses kept point by point on disk: a run that was killed goes on where it stopped, with the
same numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from ..io.stage_cache import cached_stage, code_of, key_of
from .model import ReducedModel
from .response import response
from .solution import Solution
from .solver.newton import DEFAULT_OPTIONS, Options


def response_with_checkpoints(
    folder: str | Path,
    model: ReducedModel,
    omegas: Iterable[float],
    H: int = 3,
    samples: int = 128,
    *,
    options: Options = DEFAULT_OPTIONS,
) -> Iterator[Solution]:
    """`response`, whose points are files of a folder, written one by one and read where they are
    there already.

    A point is solved again when the model, a setting, its frequency or the program changed. Memory
    does not grow along the curve: only the last two points are held.
    """
    base = key_of(model, H, samples, options, code_of("bladefem.hbm", "bladefem.friction"))
    count = 0

    def keep(omega: float, compute: Callable[[], Solution]) -> Solution:
        nonlocal count
        count += 1
        return cached_stage(folder, f"point-{count:06d}", key_of(base, float(omega)), compute)[0]

    yield from response(model, omegas, H, samples, options=options, keep=keep)

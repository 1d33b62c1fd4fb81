"""Runs a stage or reads it from the run folder; keeps its time and its messages."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, TypeVar

from ...io.stage_cache import cached_stage, found_remark
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress

Folder: TypeAlias = str | Path | None
Result = TypeVar("Result")


@dataclass(frozen=True)
class StageClock:
    """Times the stages, collects their messages and shows the one at work."""

    # wall-clock time of each stage so far [s]
    seconds: dict[str, float]
    messages: list[str]
    progress: Progress = without_progress

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            for _ in self.progress([name], name, delay=0.0, bar_format="{desc} ..."):
                yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


@dataclass(frozen=True)
class StageRunner:
    """Computes a stage, or reads it from the run folder and reports that."""

    # None keeps nothing
    folder: Folder
    comm: Communicator | None
    clock: StageClock

    def __call__(
        self,
        name: str,
        key: str,
        compute: Callable[[], Result],
    ) -> Result:
        return self._reported(name, *cached_stage(self.folder, name, key, compute, self.comm))

    def alone(
        self,
        name: str,
        key: str,
        compute: Callable[[], Result],
    ) -> Result:
        """The result of a stage that this rank runs by itself."""
        return self._reported(name, *cached_stage(self.folder, name, key, compute))

    def _reported(
        self,
        name: str,
        result: Result,
        seconds: float | None,
    ) -> Result:
        if seconds is not None:
            self.clock.messages.append(found_remark(name, seconds))
        return result

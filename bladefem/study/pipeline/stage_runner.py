"""Runs a stage or reads it from the run folder; keeps its time and its messages."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from ...hbm.parallel import share_work
from ...io.stage_cache import cached_stage, found_remark
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress
from .bodies import Bodies, on_one_rank

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
class StageOfOneRank:
    """A stage that one rank computes with its own bodies."""

    name: str
    key: str
    compute: Callable[[Bodies], Any]


@dataclass(frozen=True)
class StageRunner:
    """Computes a stage, or reads it from the run folder and reports that."""

    # None keeps nothing
    folder: Folder
    comm: Communicator | None
    clock: StageClock
    # stages computed before their call: name to what `cached_stage` gives
    ahead: dict[str, tuple[Any, float | None]] = field(default_factory=dict)

    def __call__(
        self,
        name: str,
        key: str,
        compute: Callable[[], Result],
    ) -> Result:
        """The result of a stage that all ranks compute, or that was computed ahead (collective)."""
        known = self.ahead.pop(name, None)
        if known is None:
            known = cached_stage(self.folder, name, key, compute, self.comm)
        return self._reported(name, *known)

    def of_one_rank(self, stage: StageOfOneRank, bodies: Bodies) -> Any:
        """The result of a stage that rank 0 computes, or that was computed ahead (collective)."""
        return self(stage.name, stage.key, lambda: on_one_rank(bodies, stage.compute))

    def compute_ahead(self, stages: Sequence[StageOfOneRank], bodies: Bodies) -> None:
        """Stages that do not need each other, each on another rank where ranks have the bodies for
        themselves: the call for one of them finds its result (collective).
        """
        if self.comm is None or self.comm.size == 1 or bodies.ranks_of_sector > 1:
            return

        def result_of(one: StageOfOneRank) -> tuple[Any, float | None]:
            return cached_stage(self.folder, one.name, one.key, lambda: one.compute(bodies.alone))

        missing = [one for one in stages if one.name not in self.ahead]
        found = share_work(result_of, missing, self.comm)
        self.ahead.update(zip([one.name for one in missing], found, strict=True))

    def compute_beside_state(self, stage: StageOfOneRank, bodies: Bodies) -> None:
        """The steady state of the blade, which all ranks need, by one of them and a stage that does
        without it by another, where ranks have the bodies for themselves: the call for the stage
        finds its result (collective).
        """
        if self.comm is None or self.comm.size == 1 or bodies.ranks_of_sector > 1:
            return
        alone = bodies.alone
        compute = partial(stage.compute, alone)

        def of_rank(rank: int) -> Any:
            if rank == 0:
                return alone.steady_parts()
            if rank == 1:
                return cached_stage(self.folder, stage.name, stage.key, compute)
            # what follows needs its mesh and matrices
            _ = alone.still_blade
            return None

        found = share_work(of_rank, range(self.comm.size), self.comm)
        alone.take_steady_parts(found[0])
        self.ahead[stage.name] = found[1]

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

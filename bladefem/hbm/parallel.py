"""Sweeps and parameter studies shared over MPI ranks: the same numbers for any number of ranks, one
included.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..util.communicator import Communicator
from .checkpoint import response_with_checkpoints
from .model import ReducedModel
from .response import response
from .solution import Solution
from .solver.newton import DEFAULT_OPTIONS, Options

Item = TypeVar("Item")
Result = TypeVar("Result")
# frequencies that follow each other on one rank; the same for any number of ranks
POINTS_AT_ONCE = 16


class SharedCounter:
    """A number in the memory of rank 0 that all ranks take and raise without its help (collective:
    all of them make it, and free it).
    """

    def __init__(self, comm: Communicator) -> None:
        from mpi4py import MPI

        size = MPI.INT64_T.Get_size()
        self._window = MPI.Win.Allocate(size if comm.rank == 0 else 0, size, comm=comm)
        if comm.rank == 0:
            np.frombuffer(self._window.tomemory(), dtype=np.int64)[:] = 0
        # nobody takes a number before it is zero
        comm.allgather(None)

    def numbers_below(self, count: int) -> Iterator[int]:
        """Numbers below a count, each for the rank that asks first."""
        from mpi4py import MPI

        one = np.ones(1, dtype=np.int64)
        taken = np.zeros(1, dtype=np.int64)
        while True:
            self._window.Lock(0, MPI.LOCK_SHARED)
            self._window.Fetch_and_op(one, taken, 0, op=MPI.SUM)
            self._window.Unlock(0)
            if taken[0] >= count:
                return
            yield int(taken[0])

    def free(self) -> None:
        """Give the memory back."""
        self._window.Free()


def share_work(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    comm: Communicator | None = None,
    shown: Callable[[Iterable[int]], Iterable[int]] = iter,
    on_demand: bool = False,
) -> list[Result]:
    """Results of work on each item, dealt out to the ranks of an mpi4py communicator; every rank
    returns all of them.

    Args:
        shown: wraps the numbers of the items of this rank, to show how far it is.
        on_demand: the next item goes to the rank that is free first: for items of unequal work,
            whose results do not depend on what the rank did before; longest ones first.

    Raises:
        Exception: on every rank, what the first item that failed on any of them raised.
    """
    if comm is None or comm.size == 1:
        return [work(items[i]) for i in shown(range(len(items)))]
    done: dict[int, Result] = {}
    failed: tuple[int, Exception] | None = None
    counter = SharedCounter(comm) if on_demand else None
    own: Iterable[int] = range(comm.rank, len(items), comm.size)
    if counter is not None:
        own = counter.numbers_below(len(items))
    for i in shown(own):
        try:
            done[i] = work(items[i])
        except Exception as error:
            # whatever it is, the other ranks must not wait for ever
            failed = i, error
            break
    if counter is not None:
        counter.free()
    parts = comm.allgather((done, failed))
    failures = [failure for _, failure in parts if failure is not None]
    if failures:
        raise min(failures, key=lambda failure: failure[0])[1]
    results = {i: result for part, _ in parts for i, result in part.items()}
    return [results[i] for i in range(len(items))]


def shared_response(
    model: ReducedModel,
    omegas: Sequence[float],
    H: int = 3,
    samples: int = 128,
    *,
    comm: Communicator | None = None,
    folder: str | Path | None = None,
    options: Options = DEFAULT_OPTIONS,
) -> list[Solution]:
    """The points of `bladefem.hbm.response`, in blocks of neighbours that the ranks share
    out.

    The first point of each block starts from full stick, so that no number depends on which rank
    solved it.

    Args:
        folder: keeps each point on disk as soon as it is solved; a run that was killed goes on
            there.
    """

    def solved(block: int) -> list[Solution]:
        part = omegas[block : block + POINTS_AT_ONCE]
        if folder is None:
            return list(response(model, part, H, samples, options=options))
        return list(
            response_with_checkpoints(
                Path(folder) / f"block-{block:06d}", model, part, H, samples, options=options
            )
        )

    blocks = share_work(solved, range(0, len(omegas), POINTS_AT_ONCE), comm)
    return [point for block in blocks for point in block]

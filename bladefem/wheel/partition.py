"""One wheel dealt out over ranks: nodal diameters for what the tuned wheel does, sectors for what
its dampers do.

Vectors of all sectors are on every rank, the large matrices are not. Every rank works out its part
as one rank alone would, the parts are joined on all, and all take the same decisions from the same
numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..util.communicator import Communicator


@dataclass(frozen=True)
class Partition:
    """The part of this rank in a wheel of N sectors."""

    count: int
    # None: one rank has all
    comm: Communicator | None = None

    @cached_property
    def rank(self) -> int:
        """Number of this rank."""
        return 0 if self.comm is None else self.comm.rank

    @cached_property
    def ranks(self) -> int:
        """How many there are."""
        return 1 if self.comm is None else self.comm.size

    @cached_property
    def sectors(self) -> slice:
        """Sectors of this rank."""
        return _share(self.count, self.rank, self.ranks)

    @cached_property
    def half(self) -> slice:
        """Nodal diameters of this rank among 0..N/2."""
        return self.diameters[0]

    @cached_property
    def paired(self) -> slice:
        """Places in `half` of those with a wave that runs backwards."""
        forward, backward = self.diameters
        first = 1 if forward.start == 0 else 0
        return slice(first, first + backward.stop - backward.start)

    @cached_property
    def diameters(self) -> tuple[slice, slice]:
        """Nodal diameters of this rank among 0..N-1: some of 0..N/2, and N minus these,
        ascending.
        """
        return _diameters(self.count, self.rank, self.ranks)

    def own(self, x: np.ndarray) -> np.ndarray:
        """The rows of this rank's nodal diameters from x (N, ...)."""
        return x if self.ranks == 1 else np.concatenate([x[part] for part in self.diameters])

    def join_diameters(self, part: np.ndarray) -> np.ndarray:
        """(N, ...) of all nodal diameters from this rank's, in the order of `diameters`."""
        if self.comm is None or self.ranks == 1:
            return part
        joined = np.empty((self.count, *part.shape[1:]), dtype=part.dtype)
        for rank, found in enumerate(self.comm.allgather(part)):
            forward, backward = _diameters(self.count, rank, self.ranks)
            first = forward.stop - forward.start
            joined[forward] = found[:first]
            joined[backward] = found[first:]
        return joined

    def gather(self, text: str) -> list[str]:
        """The texts of all ranks, in their order."""
        return [text] if self.comm is None else self.comm.allgather(text)

    def join(self, part: np.ndarray, axis: int = 0) -> np.ndarray:
        """Parts of consecutive ranks along an axis: of `sectors`, or of `half`."""
        if self.comm is None or self.ranks == 1:
            return part
        return np.concatenate(self.comm.allgather(part), axis=axis)


def _share(
    count: int,
    rank: int,
    ranks: int,
) -> slice:
    return slice(count * rank // ranks, count * (rank + 1) // ranks)


def _diameters(
    count: int,
    rank: int,
    ranks: int,
) -> tuple[slice, slice]:
    half = _share(count // 2 + 1, rank, ranks)
    # 0 and N/2 run both ways
    first = max(half.start, 1)
    last = max(first, min(half.stop, (count + 1) // 2))
    return half, slice(count - last + 1, count - first + 1)

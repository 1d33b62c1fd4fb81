"""Which ranks have a processor core of their own.

More ranks than cores do the same work in more pieces: on two cores four ranks take half as long
again as two for the modes of a sector that they share.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Sequence

from .communicator import Communicator

# set to 1 where all ranks are to work, however few cores there are
VARIABLE = "BLADEFEM_OVERSUBSCRIBE"


def ranks_with_cores(
    comm: Communicator,
) -> list[int]:
    """The ranks that are to work, ascending; rank 0 is one of them (collective).

    Of each machine's ranks the first ones, as many as there are cores on which any of them may run.
    """
    everyone = list(range(comm.size))
    asked = os.environ.get(VARIABLE, "0") not in ("", "0")
    places = comm.allgather((asked, os.uname().nodename, _own_cores()))
    if any(asked for asked, _, _ in places):
        return everyone
    return _first_of_machines([(machine, cores) for _, machine, cores in places])


def _first_of_machines(places: Sequence[tuple[str, frozenset[int]]]) -> list[int]:
    """The ranks that have a core.

    Args:
        places: of each rank its machine and the cores on which it may run.
    """
    cores: dict[str, set[int]] = defaultdict(set)
    for machine, allowed in places:
        cores[machine] |= allowed
    taken: dict[str, int] = defaultdict(int)
    working = []
    for rank, (machine, _) in enumerate(places):
        if taken[machine] < len(cores[machine]):
            working.append(rank)
        taken[machine] += 1
    return working


def _own_cores() -> frozenset[int]:
    """Numbers of the cores on which this process may run."""
    if hasattr(os, "sched_getaffinity"):
        return frozenset(os.sched_getaffinity(0))
    return frozenset(range(os.cpu_count() or 1))

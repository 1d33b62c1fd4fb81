"""Ranks split into groups that share out nodal diameters; the mesh is distributed within each
group.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from .compat import MPI
from .memory import available_memory, give_back, modal_solve_memory

Result = TypeVar("Result")
# more ranks on one sector have ever less to do between two exchanges
MAX_RANKS_PER_SECTOR = 4
# Measured in docs/verification.md, "Finite elements by ranks".
# degrees of freedom of a rank from which its share of a sector pays. Below, ranks share out its
# nodal diameters: modes take as long, and each rank has the whole sector's factors for the stresses
MIN_DOFS_PER_RANK = 40_000
# the same where more than two share it, so that none has the whole sector's factors anyway, and
# what all ranks have assembled serves modes and reduction
MIN_DOFS_OF_FURTHER_RANKS = 30_000
# tasks of a group up to which none of them helps another
MAX_UNGROUPED_TASKS = 3
# where nothing but a few nodal diameters is wanted: the common part, which ranks apart do once
# each, is half of the work or more, and three diameters are no even share
MIN_DOFS_PER_RANK_FEW_TASKS = 35_000
# tasks a group up to which they are few
FEW_TASKS = 2.5
# share of the free memory that groups may fill
USABLE_MEMORY_SHARE = 0.8


def group_size(
    comm: MPI.Comm,
    dofs: int,
    free: float | None = None,
    cut: int = 0,
) -> int:
    """Ranks in a group: as many as share a sector well, and as many more as memory asks for; a
    divisor of all ranks.

    Args:
        dofs: degrees of freedom of one sector.
        cut: of both of its cut faces together.
        free: memory of a machine [bytes]; what is available when left out.
    """
    here = comm.Split_type(MPI.COMM_TYPE_SHARED)
    free = comm.allreduce(available_memory() if free is None else free, MPI.MIN)
    together = comm.allreduce(here.size, MPI.MAX)
    here.Free()
    sizes = [size for size in range(1, comm.size + 1) if comm.size % size == 0]
    useful = 1
    if dofs >= 2 * MIN_DOFS_PER_RANK:
        useful = min(MAX_RANKS_PER_SECTOR, max(dofs // MIN_DOFS_OF_FURTHER_RANKS, 2))
    least = max(size for size in sizes if size <= useful)
    for size in sizes:
        memory = modal_solve_memory(dofs, size, cut=cut) * max(together // size, 1)
        if size >= least and memory < USABLE_MEMORY_SHARE * free:
            return size
    return comm.size


def size_for_few(size: int, ranks: int, tasks: int, dofs: int) -> int:
    """Ranks in a group where only the modes of some nodal diameters are wanted: all ranks for few.

    Args:
        size: ranks of a group otherwise, see `group_size`.
        ranks: all of them.
        tasks: number of nodal diameters.
        dofs: degrees of freedom of one sector.
    """
    few = tasks <= FEW_TASKS * (ranks // size)
    large = dofs >= ranks * MIN_DOFS_PER_RANK_FEW_TASKS
    return ranks if few and large and ranks <= MAX_RANKS_PER_SECTOR else size


def fits_one_rank(comm: MPI.Comm, dofs: int, cut: int = 0) -> bool:
    """One rank has memory for a body of so many degrees of freedom, some of them on cut faces
    (collective).
    """
    free = comm.allreduce(available_memory(), MPI.MIN)
    return comm.size == 1 or modal_solve_memory(dofs, cut=cut) < USABLE_MEMORY_SHARE * free


def shared_out(
    comm: MPI.Comm,
    tasks: Sequence[int],
    size: int,
    work: Callable[[MPI.Comm, list[int]], list[Result]],
    cost: Callable[[int], float] = lambda task: 1.0,
) -> list[Result]:
    """Results of all tasks, in their order and on every rank; collective.

    Args:
        size: ranks in a group; those that are left over wait.
        work: results of some tasks by the ranks of one group, the same on each of them.
        cost: of a task, for an even share of few tasks; many go by neighbours in number, which help
            each other.

    Raises:
        whatever a group raised.
    """
    groups = max(min(comm.size // size, len(tasks)), 1)
    colors = [rank * groups // comm.size for rank in range(comm.size)]
    color = colors[comm.rank]
    shares = _even_shares(tasks, groups, cost)
    mine = shares[color]
    whole = comm.Split(color, comm.rank)
    part = whole.Split(0 if whole.rank < size else MPI.UNDEFINED, whole.rank)
    found: dict[int, Result] = {}
    error: Exception | None = None
    if part != MPI.COMM_NULL:
        try:
            found = dict(zip(mine, work(part, mine), strict=True))
        except Exception as problem:
            # the other groups must not wait for ever
            error = problem
        part.Free()
    whole.Free()
    for failure in comm.allgather(error):
        if failure is not None:
            raise failure
    give_back()
    # one by one: all of them as messages would be the peak of memory
    for owner, share in enumerate(shares):
        root = colors.index(owner)
        for task in share:
            result = comm.bcast(found.get(task) if comm.rank == root else None, root)
            if task not in found:
                found[task] = result
            del result
    return [found[n] for n in tasks]


def _even_shares(
    tasks: Sequence[int],
    groups: int,
    cost: Callable[[int], float],
) -> list[list[int]]:
    """The tasks of each group, ascending."""
    some = sorted({int(task) for task in tasks})
    if len(some) > MAX_UNGROUPED_TASKS * groups:
        return [[int(task) for task in share] for share in np.array_split(some, groups)]
    shares: list[list[int]] = [[] for _ in range(groups)]
    # the most expensive first, each to the group that has least to do
    for task in sorted(some, key=lambda task: (-cost(task), task)):
        min(shares, key=lambda share: sum(map(cost, share))).append(task)
    return [sorted(share) for share in shares]

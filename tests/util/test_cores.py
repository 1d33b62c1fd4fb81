"""Ranks beyond the machine's cores wait for the others, and end as they do."""

import sys

import pytest
from processes import run_on_ranks

from bladefem.util.cores import _first_of_machines

TWO_CORES = frozenset({0, 1})
ONE_CORE = """
import os
import sys
from types import SimpleNamespace
from bladefem.cli.ranks import exit_code_of
from bladefem.errors import InputError

os.sched_setaffinity(0, {{min(os.sched_getaffinity(0))}})

def action(comm):
    print("at work", comm.rank, comm.size, flush=True)
    comm.Barrier()
    # PETSc must not wait for those that do not work
    import bladefem.fem.compat
    {end}

sys.exit(exit_code_of(action, SimpleNamespace()))
"""


@pytest.mark.parametrize(
    ("places", "working"),
    [
        ([("a", TWO_CORES)] * 2, [0, 1]),
        ([("a", TWO_CORES)] * 4, [0, 1]),
        # two machines whose ranks come by turns
        ([("a", TWO_CORES), ("b", TWO_CORES)] * 3, [0, 1, 2, 3]),
        ([("a", TWO_CORES)] * 3 + [("b", frozenset({0}))] * 2, [0, 1, 3]),
        # each bound to a core of its own
        ([("a", frozenset({core})) for core in range(4)], [0, 1, 2, 3]),
    ],
)
def test_of_each_machine_as_many_ranks_work_as_it_has_cores(places, working):
    assert _first_of_machines(places) == working


@pytest.mark.parametrize(
    ("variable", "end", "code", "at_work", "said"),
    [
        ("0", "", 0, 1, "3 ranks, of which 1 have a core"),
        ("0", "raise InputError('mu = -1: expected 0 or more')", 2, 1, "bladefem: mu = -1"),
        ("1", "", 0, 3, ""),
    ],
)
def test_ranks_without_a_core_wait(variable, end, code, at_work, said):
    done = run_on_ranks(
        3,
        [sys.executable, "-c", ONE_CORE.format(end=end)],
        timeout=60,
        variables={"BLADEFEM_OVERSUBSCRIBE": variable},
    )
    assert done.returncode == code, done.stderr
    assert done.stdout.count("at work") == at_work
    assert done.stdout.count(f" {at_work}\n") == at_work
    assert said in done.stderr

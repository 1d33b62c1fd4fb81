"""Groups of ranks share out nodal diameters: the same numbers however the ranks are grouped."""

import numpy as np
import pytest
from structured import sector

from bladefem.errors import InputError
from bladefem.fem.compat import MPI
from bladefem.fem.groups import group_size, shared_out, size_for_few
from bladefem.fem.memory import modal_solve_memory
from bladefem.scene.tables import Scene
from bladefem.study.pipeline.bodies import Bodies
from bladefem.study.pipeline.normal_modes import wheel_modes

pytestmark = pytest.mark.mpi


def test_frequencies_do_not_depend_on_groups():
    mesh, ranks = sector(8, (4, 2, 1), bump=0.2), MPI.COMM_WORLD.size
    alone = wheel_modes(Bodies(Scene(), mesh, MPI.COMM_SELF), 8, [4, 0, 1, 3])
    for size in {1, ranks}:
        found = wheel_modes(Bodies(Scene(), mesh), 8, [4, 0, 1, 3], group=size)
        assert [s.nodal_diameter for s in found] == [4, 0, 1, 3]
        for a, b in zip(found, alone, strict=True):
            np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-10)
            np.testing.assert_allclose(
                a.shapes, b.shapes, atol=1e-4 * abs(b.shapes).max()
            )  # see test_wheel


def test_an_error_in_one_group_reaches_all():
    def work(part, some):
        if 0 in some:
            raise InputError("the first group fails")
        return some

    with pytest.raises(InputError, match="the first group fails"):
        shared_out(MPI.COMM_WORLD, [0, 1, 2], 1, work)
    assert shared_out(MPI.COMM_WORLD, [2, 0, 1], 1, lambda part, some: [10 * n for n in some]) == [
        20,
        0,
        10,
    ]


def test_groups_grow_where_memory_is_short():
    comm = MPI.COMM_WORLD
    assert group_size(comm, 1000, free=1e12) == 1
    assert group_size(comm, 1000, free=0.5 * modal_solve_memory(1000)) == comm.size


def test_ranks_share_a_sector_that_is_large_enough():
    comm = MPI.COMM_WORLD
    several = {1: 1, 2: 2, 3: 3, 4: 4}[comm.size]
    assert group_size(comm, 200_000, free=1e12) == several
    # where a pair would still leave each of them a large part
    assert group_size(comm, 139_341, free=1e12) == several
    # two whole sectors before two halves
    assert group_size(comm, 78_000, free=1e12) == 1


def test_few_diameters_are_solved_by_all_ranks_of_a_large_sector():
    """Three are no even share of two ranks; many are, and small sectors are better whole."""
    assert size_for_few(1, 2, 3, 74_000) == 2
    assert size_for_few(1, 2, 5, 74_000) == 2
    assert size_for_few(1, 2, 6, 74_000) == 1
    assert size_for_few(1, 2, 3, 40_000) == 1
    assert size_for_few(1, 4, 3, 74_000) == 1
    assert size_for_few(2, 4, 3, 200_000) == 4
    assert size_for_few(1, 1, 1, 74_000) == 1


def test_results_of_groups_come_one_by_one_and_in_order():
    ranks = MPI.COMM_WORLD.size
    tasks = list(range(7))

    def work(part, some):
        return [np.full(3, 10.0 * n) for n in some]

    for size in {1, ranks}:
        found = shared_out(MPI.COMM_WORLD, tasks, size, work)
        np.testing.assert_array_equal(found, [np.full(3, 10.0 * n) for n in tasks])

"""Points and studies shared over ranks: equal to the last bit on 1, 2 and 4 of them."""

import time

import numpy as np
import pytest
from models import block, single_mass

from bladefem.errors import NotSolvedError
from bladefem.hbm import response as response_module
from bladefem.hbm.optimum import optimum
from bladefem.hbm.parallel import share_work, shared_response
from bladefem.hbm.parameters import vary
from bladefem.hbm.response import response
from bladefem.hbm.solution import size

OMEGAS = np.linspace(0.6, 1.8, 39)


def test_blocks_meet_the_response_of_one_run():
    model = single_mass()
    for one, other in zip(
        shared_response(model, OMEGAS, 5, 128), response(model, OMEGAS, 5, 128), strict=True
    ):
        assert one.converged and one.omega == other.omega
        np.testing.assert_allclose(
            one.probe, other.probe, rtol=0, atol=1e-9 * abs(other.probe).max()
        )


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("model", "omegas"), [(single_mass(), OMEGAS), (block(), np.linspace(0.9, 1.2, 18))]
)
def test_any_number_of_ranks_gives_the_same_numbers(model, omegas, tmp_path):
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    alone = shared_response(model, omegas, 3, 64)
    for together in (
        shared_response(model, omegas, 3, 64, comm=comm),
        shared_response(model, omegas, 3, 64, comm=comm, folder=folder),
        shared_response(model, omegas, 3, 64, comm=comm, folder=folder),
    ):
        assert len(together) == len(omegas)
        for one, other in zip(together, alone, strict=True):
            assert (
                np.array_equal(one.w, other.w)
                and one.iterations == other.iterations
                and one.work == other.work
            )
    comm.Barrier()


@pytest.mark.mpi
def test_a_killed_run_goes_on_with_any_number_of_ranks(tmp_path, monkeypatch):
    """Killed on one rank in its second block; only the points that were not written are solved
    again.
    """
    from mpi4py import MPI

    comm, model, plain, solved = MPI.COMM_WORLD, single_mass(), response_module.solve_along, []
    folder = comm.bcast(tmp_path)
    alone = shared_response(model, OMEGAS, 3, 64)

    def until(most):
        def work(model, omegas, *args):  # one of them at a time
            if len(solved) == most:
                raise KeyboardInterrupt
            solved.append(omegas[0])
            return plain(model, omegas[:1], *args)

        return work

    if comm.rank == 0:
        monkeypatch.setattr(response_module, "solve_along", until(20))
        with pytest.raises(KeyboardInterrupt):
            shared_response(model, OMEGAS, 3, 64, folder=folder)
    comm.Barrier()
    solved.clear()
    monkeypatch.setattr(response_module, "solve_along", until(len(OMEGAS)))
    again = shared_response(model, OMEGAS, 3, 64, comm=comm, folder=folder)
    assert comm.allreduce(len(solved)) == len(OMEGAS) - 20
    assert all(np.array_equal(one.w, other.w) for one, other in zip(again, alone, strict=True))
    comm.Barrier()


@pytest.mark.mpi
def test_a_study_over_loads_is_shared():
    from mpi4py import MPI

    model, loads = single_mass(), np.geomspace(0.3, 3.0, 6)
    study = [
        share_work(
            lambda load: max(size(p) for p in response(vary(model, "load", load), OMEGAS[::4])),
            loads,
            comm,
        )
        for comm in (MPI.COMM_WORLD, None)
    ]
    assert study[0] == study[1] and len(study[0]) == 6


@pytest.mark.mpi
def test_items_on_demand_are_done_once_by_whoever_is_free():
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    done = []

    def work(i):
        done.append(i)
        # the first item takes as long as the others together
        time.sleep(0.3 if i == 0 else 0.05)
        return i * i

    assert share_work(work, range(7), comm, on_demand=True) == [i * i for i in range(7)]
    everything = comm.allgather(done)
    assert sorted(i for part in everything for i in part) == list(range(7))
    if comm.size > 1:
        holder = next(part for part in everything if 0 in part)
        assert len(holder) < 7 - (comm.size - 1)


@pytest.mark.mpi
@pytest.mark.parametrize("on_demand", [False, True])
def test_an_error_on_one_rank_is_raised_on_all(on_demand):
    from mpi4py import MPI

    def work(i):
        if i:
            optimum(single_mass(), (5.0, 6.0), (0.5, 2.0))  # a band without a peak

    with pytest.raises(NotSolvedError, match="no peak"):
        share_work(work, range(4), MPI.COMM_WORLD, on_demand=on_demand)

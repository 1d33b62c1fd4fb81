"""One of several ranks prints, whichever launcher started them."""

from __future__ import annotations

import pytest

from bladefem.util.first_rank import RANK_VARIABLES, SLURM_COUNT, SLURM_RANK, is_first_rank


@pytest.mark.parametrize(
    ("told", "first"),
    [
        ({}, True),
        ({"OMPI_COMM_WORLD_RANK": "0"}, True),
        ({"OMPI_COMM_WORLD_RANK": "3"}, False),
        ({"PMI_RANK": "1"}, False),
        # srun --mpi=pmix
        ({"PMIX_RANK": "1", "SLURM_PROCID": "1", "SLURM_STEP_NUM_TASKS": "2"}, False),
        # srun without MPI
        ({"SLURM_PROCID": "1", "SLURM_STEP_NUM_TASKS": "2"}, False),
        ({"SLURM_PROCID": "0", "SLURM_STEP_NUM_TASKS": "2"}, True),
        # a process of its own within a job
        ({"SLURM_PROCID": "1", "SLURM_STEP_NUM_TASKS": "1"}, True),
        ({"SLURM_PROCID": "1"}, True),
        # mpirun on the second node of a job, which it reaches through srun
        ({"OMPI_COMM_WORLD_RANK": "0", "SLURM_PROCID": "1", "SLURM_STEP_NUM_TASKS": "2"}, True),
    ],
)
def test_it_is_the_launcher_that_tells(told, first, monkeypatch):
    for name in (*RANK_VARIABLES, SLURM_RANK, SLURM_COUNT):
        monkeypatch.delenv(name, raising=False)
    for name, value in told.items():
        monkeypatch.setenv(name, value)
    assert is_first_rank() == first

"""Whether this process is the first of those that a launcher started, told without MPI."""

from __future__ import annotations

import os

# what Open MPI, MPICH and PMIx tell each rank of its number
RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")
# Slurm's number of a process, and of how many: a batch script has the first as well, and so have
# ranks that mpirun starts through Slurm, where it counts nodes
SLURM_RANK = "SLURM_PROCID"
SLURM_COUNT = "SLURM_STEP_NUM_TASKS"


def is_first_rank() -> bool:
    """Whether to print what one of several ranks prints."""
    for name in RANK_VARIABLES:
        if name in os.environ:
            return os.environ[name] == "0"
    if os.environ.get(SLURM_COUNT, "1") == "1":
        return True
    return os.environ.get(SLURM_RANK, "0") == "0"

"""Programs that tests start by themselves, alone or on several ranks."""

from __future__ import annotations

import os
from collections.abc import Sequence

MPI_VARIABLES = ("OMPI_", "PMIX_", "PRTE_", "ORTE_", "PMI_")
USER_SETTINGS = ("OMPI_ALLOW", "OMPI_MCA_mpi_yield", "OMPI_MCA_btl")


def clean_environment() -> dict[str, str]:
    """The environment without what tells a process that it is a rank: mpirun refuses to start
    inside one.
    """
    return {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(MPI_VARIABLES) or name.startswith(USER_SETTINGS)
    }


def on_ranks(ranks: int, command: Sequence[str]) -> list[str]:
    """The command on some ranks, as a process of its own on one."""
    if ranks == 1:
        return list(command)
    return ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks), *command]

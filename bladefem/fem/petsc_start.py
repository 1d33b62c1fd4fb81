"""PETSc starts, on all ranks or on those that work."""

from __future__ import annotations

import petsc4py

from ..io.stage_cache import bind_h5py
from ..util.communicator import Communicator

# else a reader that closes the pipe (| head) aborts MPI
ARGUMENTS = ["bladefem", "-no_signal_handler"]


def start_petsc(comm: Communicator | None = None) -> None:
    """Start PETSc on these ranks, on all of MPI's when left out; nothing where it has started.

    All of them have to call it: the others' absence would be waited for.
    """
    # before anything loads the system's HDF5
    bind_h5py()
    petsc4py.init(ARGUMENTS, comm=comm)

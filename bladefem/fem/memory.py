"""Does a solve fit into memory? Said before anything is assembled, from a model fitted to measured
peaks.

Peak of the modes of one complex nodal diameter [GB], wedge sector, measured and (modelled);
benchmarks/fem_cost.py remakes the first row and draws it, all in core:

    dofs            12 530      45 550      151 000     240 300     395 100
    one core        0.22 (0.21) 0.56 (0.56) 2.05 (2.06) 3.68 (3.61) 6.66 (6.65)

    dofs            28 482      50 514
    doubled         0.79 (0.80) 1.39 (1.37)

The factors grow with dofs^(4/3) as nested dissection of a solid does; solid blocks have about twice
those of blades.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

from ..errors import InputError
from .compat import MPI

# interpreter and libraries of one rank [bytes]
BYTES_PER_RANK = 1.2e8
# bytes: a dofs + b dofs^(4/3)
ONE_CORE = (3.29e3, 180.5)
DOUBLED = (1.9e4, 160.0)


def modal_solve_memory(dofs: int, ranks: int = 1) -> float:
    """Peak memory of a modal solve [bytes], all ranks together.

    Args:
        dofs: degrees of freedom of the body, three a node.
    """
    linear, factors = ONE_CORE if ranks == 1 else DOUBLED
    return ranks * BYTES_PER_RANK + linear * dofs + factors * dofs ** (4 / 3)


def available_memory() -> float:
    """Memory that this machine (or its container) can still give [bytes]; infinite where the system
    does not tell.
    """
    out = float("inf")
    meminfo = Path("/proc/meminfo")
    if meminfo.exists():
        rows = dict(line.split(":", 1) for line in meminfo.read_text().splitlines() if ":" in line)
        out = 1024.0 * int(rows.get("MemAvailable", rows["MemFree"]).split()[0])
    limit = Path("/sys/fs/cgroup/memory.max")
    used = Path("/sys/fs/cgroup/memory.current")
    if limit.exists() and used.exists() and limit.read_text().strip().isdigit():
        out = min(out, float(limit.read_text()) - float(used.read_text()))
    return out


def give_back() -> None:
    """Return freed memory to the system: MPI tells the C library to keep all of it, in pieces that
    do not fit.
    """
    # GNU only
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def check_memory(
    dofs: int,
    comm: MPI.Comm,
    free: float | None = None,
) -> float:
    """The memory that a solve will take [bytes], all ranks together.

    Args:
        free: memory that may be used on this machine [bytes]; what is available when left out.

    Raises:
        InputError: it does not fit; the message says what to change.
    """
    total = modal_solve_memory(dofs, comm.size)
    here = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = total * here.size / comm.size
    here.Free()
    free = available_memory() if free is None else free
    short = comm.allreduce(max(share - free, 0.0), MPI.MAX)
    if short > 0:
        fits = (free / share) ** (3 / 4) * dofs
        raise InputError(
            f"the model has {dofs} degrees of freedom and needs about {share / 1e9:.1f} GB here, "
            f"{free / 1e9:.1f} GB are free; expected at most about {fits:.2g} degrees of freedom "
            "(a larger mesh.size), or ranks on more machines"
        )
    return total

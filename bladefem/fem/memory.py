"""Does a solve fit into memory? Said before anything is assembled, from a model fitted to measured
peaks.

Peak of the modes of one complex nodal diameter [GB], wedge sector, proven by the count of the
inertia, measured and (modelled); benchmarks/fem_cost.py remakes the first row, million.py there
single points of the first two:

    dofs                      49 632         148 773        495 732        1 032 705
    in memory                 0.441 (0.454)  1.32 (1.40)    6.20 (5.87)    - (14.7)
    factors on disk           0.370 (0.348)  0.90 (0.94)    3.41 (3.60)    - (8.7)
    two ranks, both together  0.682 (0.682)  2.01 (2.01)

Factors on disk take 0.53 GB at 148 773 degrees of freedom, and a twentieth more processor time
where the system can keep the file in memory that nobody else needs. MUMPS's block low rank takes no
less memory than exact factors at this size: 748 and 794 MB at thresholds of 1e-6 and 1e-9, 759
without, and its solves are wrong by 4e-3 and 2e-7; so it is not among the ways.

Cut faces that are wide for so many degrees of freedom take more: what is left on them of the
interior is dense. A block-like sector of 47 175 with 3672 on both cut faces takes 1.19 (1.17) GB
in one complex nodal diameter, one of 87 885 with 5544 takes 2.48 (2.47).

The factors grow with dofs^(4/3) as nested dissection of a solid does; solid blocks have about twice
those of blades.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from .compat import MPI

# interpreter and libraries of one rank [bytes]
BYTES_PER_RANK = 1.2e8
# bytes: a dofs + b dofs^(4/3)
ONE_RANK = (2.5e3, 115.0)
SEVERAL_RANKS = (2.18e3, 183.0)
ON_DISK = (2.5e3, 57.0)
# on disk: bytes b dofs^(4/3)
FACTOR_BYTES = 100.0
# bytes: b cut^2, of the dense matrices of both cut faces, and cut^2 over dofs^(4/3) of a bladed
# sector, in the above already
CUT_FACE_BYTES = 60.0
USUAL_CUT_FACE = 0.7
# of a container: limit, memory in use, its parts, and the name of that part which is files nobody
# has used lately; control groups of version 2 and of version 1
_GROUPS = Path("/sys/fs/cgroup")
CONTAINER_FILES = (
    (_GROUPS / "memory.max", _GROUPS / "memory.current", _GROUPS / "memory.stat", "inactive_file"),
    (
        _GROUPS / "memory/memory.limit_in_bytes",
        _GROUPS / "memory/memory.usage_in_bytes",
        _GROUPS / "memory/memory.stat",
        "total_inactive_file",
    ),
)


def modal_solve_memory(
    dofs: int,
    ranks: int = 1,
    on_disk: bool = False,
    cut: int = 0,
) -> float:
    """Peak memory of a modal solve [bytes], all ranks together.

    Args:
        dofs: degrees of freedom of the body, three a node.
        on_disk: factors are not kept in memory.
        cut: those of both cut faces together.
    """
    linear, factors = ON_DISK if on_disk else ONE_RANK if ranks == 1 else SEVERAL_RANKS
    solid = dofs ** (4 / 3)
    dense = CUT_FACE_BYTES * max(0.0, cut**2 - USUAL_CUT_FACE * solid)
    return ranks * BYTES_PER_RANK + linear * dofs + factors * solid + dense


def available_memory() -> float:
    """Memory that this machine (or its container) can still give [bytes]; infinite where the system
    does not tell.
    """
    out = float("inf")
    meminfo = Path("/proc/meminfo")
    if meminfo.exists():
        rows = dict(line.split(":", 1) for line in meminfo.read_text().splitlines() if ":" in line)
        out = 1024.0 * int(rows.get("MemAvailable", rows["MemFree"]).split()[0])
    return min([out, *(_container_memory(*files) for files in CONTAINER_FILES)])


def _container_memory(limit: Path, used: Path, stat: Path, cache: str) -> float:
    """What a container can still give [bytes]; infinite where it has no limit.

    Files that the system keeps in memory count as used there, but make room for whoever needs it.
    """
    if not (limit.exists() and used.exists() and limit.read_text().strip().isdigit()):
        return float("inf")
    rows = dict(line.split() for line in stat.read_text().splitlines()) if stat.exists() else {}
    free = float(limit.read_text()) - float(used.read_text()) + float(rows.get(cache, 0))
    return max(free, 0.0)


def give_back() -> None:
    """Return freed memory to the system: MPI tells the C library to keep all of it, in pieces that
    do not fit.
    """
    # GNU only
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def drop_values(values: np.ndarray) -> None:
    """Give the memory of an array that its owner keeps back to the system; its values are lost."""
    advise = getattr(ctypes.CDLL(None), "madvise", None)
    # Linux only: elsewhere the advice means something else
    if advise is None or not sys.platform.startswith("linux"):
        return
    page = mmap.PAGESIZE
    first = -(-values.ctypes.data // page) * page
    last = (values.ctypes.data + values.nbytes) // page * page
    if last > first:
        advise(ctypes.c_void_p(first), ctypes.c_size_t(last - first), mmap.MADV_DONTNEED)


@dataclass(frozen=True)
class MemoryPlan:
    """How a solve fits into memory, all ranks together."""

    # peak [bytes]
    memory: float
    # factors that are kept on disk [bytes]; 0 where they are kept in memory
    disk: float = 0.0

    @property
    def on_disk(self) -> bool:
        """MUMPS works out of core: factors are written to disk and read again in every solve."""
        return self.disk > 0


def factor_folder() -> Path:
    """Where MUMPS puts factors that are kept on disk: its own environment variable, or /tmp."""
    return Path(os.environ.get("MUMPS_OOC_TMPDIR") or "/tmp")


def check_memory(
    dofs: int,
    comm: MPI.Comm,
    free: float | None = None,
    cut: int = 0,
) -> MemoryPlan:
    """How a solve fits into memory: all of it, or with the factors on disk (collective).

    Args:
        cut: degrees of freedom of both cut faces together.
        free: memory that may be used on this machine [bytes]; what is available when left out.

    Raises:
        InputError: it does not fit; the message says what to change.
    """
    here = comm.Split_type(MPI.COMM_TYPE_SHARED)
    part = here.size / comm.size
    here.Free()
    free = available_memory() if free is None else free
    least = comm.allreduce(free / part, MPI.MIN)
    total = modal_solve_memory(dofs, comm.size, cut=cut)
    if total <= least:
        return MemoryPlan(total)
    smaller = modal_solve_memory(dofs, comm.size, on_disk=True, cut=cut)
    disk = FACTOR_BYTES * dofs ** (4 / 3)
    folder = factor_folder()
    room = shutil.disk_usage(folder).free / part if folder.is_dir() else 0.0
    room = comm.allreduce(room, MPI.MIN)
    if smaller <= least and disk <= room:
        return MemoryPlan(smaller, disk)
    share = smaller * part
    if smaller <= least:
        raise InputError(
            f"the model has {dofs} degrees of freedom and needs about {disk * part / 1e9:.1f} GB "
            f"on disk, {room * part / 1e9:.1f} GB are free in {folder}; expected another folder in "
            "MUMPS_OOC_TMPDIR, a larger mesh.size, or more memory"
        )
    fits = (free / share) ** (3 / 4) * dofs
    raise InputError(
        f"the model has {dofs} degrees of freedom and needs about {share / 1e9:.1f} GB here with "
        f"the factors on disk, {free / 1e9:.1f} GB are free; expected at most about {fits:.2g} "
        "degrees of freedom (a larger mesh.size), or ranks on more machines"
    )


def storage_remark(plan: MemoryPlan) -> list[str]:
    """One sentence where factors are on disk."""
    if not plan.on_disk:
        return []
    return [
        f"factors are kept on disk, about {plan.disk / 1e9:.1f} GB in {factor_folder()}: in memory "
        "they would not fit"
    ]

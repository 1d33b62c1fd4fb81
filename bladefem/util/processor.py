"""Which kernels of linear algebra this processor gets.

OpenBLAS before 0.3.22 (Debian 12 has 0.3.21) knows none of AMD's processors with registers of 512
bits and gives them kernels for 256. Those of Intel's Skylake run there as well: factorisations take
a fifth less time, solves a quarter.
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping
from pathlib import Path

# OpenBLAS reads it once, when the first library that needs it is loaded
VARIABLE = "OPENBLAS_CORETYPE"
WIDE_KERNELS = "SkylakeX"
# what these kernels use
NEEDED = {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl", "fma"}
INFORMATION = Path("/proc/cpuinfo")


def use_wide_registers(
    environment: MutableMapping[str, str] = os.environ,
    information: Path = INFORMATION,
) -> None:
    """Ask for kernels of 512 bits where OpenBLAS may not find them by itself; what the user has
    set stays. Without effect where NumPy was imported before.
    """
    if VARIABLE in environment or not information.exists():
        return
    rows = dict.fromkeys(("vendor_id", "flags"), "")
    for line in information.read_text().splitlines():
        key, _, value = line.partition(":")
        if key.strip() in rows:
            rows[key.strip()] = value
        if all(rows.values()):
            break
    if rows["vendor_id"].strip() == "AuthenticAMD" and set(rows["flags"].split()) >= NEEDED:
        environment[VARIABLE] = WIDE_KERNELS

"""How long a user waits before the first response: import, and the first point with kernels from their cache.

    python -m bladefem.hbm.warm && python benchmarks/hbm_start.py

Each is measured in new processes, the least of five; seconds by the clock of an idle core, and of CPU.

Measured:
    import bladefem.hbm                      0.02 s
    everything that solves (NumPy, numba)    0.00 s
    first point                              0.00 s
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

IMPORT = "import bladefem.hbm"
SOLVER = "import bladefem.hbm.api, bladefem.hbm.sweep, bladefem.hbm.peak, bladefem.hbm.follow"
FIRST = """
from bladefem.hbm.reference import reference_model
from bladefem.hbm.api import solve
assert solve(reference_model(load=1.4), 8300.0, 3, 128).converged
"""
SPACE = """
from hbm_models import patch
from bladefem.hbm.api import solve
assert solve(patch(4, 6).model, 0.9, 3, 128).converged
"""
TIMED = """
import time
wall, cpu = time.perf_counter(), time.process_time()
{}
print(time.perf_counter() - wall, time.process_time() - cpu)
"""


def waited(code: str, rounds: int = 5) -> tuple[float, float]:
    """Least seconds by the clock and of CPU that the code takes in a new process."""
    runs = [subprocess.run([sys.executable, "-c", TIMED.format(code)], cwd=Path(__file__).parent, capture_output=True,
                           text=True, check=True)
            for _ in range(rounds)]
    clocks, cpus = zip(*(map(float, run.stdout.split()) for run in runs), strict=True)
    return min(clocks), min(cpus)


def main() -> None:
    for name, code in {"import bladefem.hbm": IMPORT, "import of what solves": SOLVER,
                       "and first point, 1-D": FIRST, "and first point, 3-D": SPACE}.items():
        print("{:24s} {:6.2f} s {:6.2f} s of CPU".format(name, *waited(code)))


if __name__ == "__main__":
    main()

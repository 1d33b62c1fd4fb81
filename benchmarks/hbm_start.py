"""How long a user waits before the first response, with kernels from their cache; and memory along
a curve.

    python -m bladefem.hbm.precompile && python benchmarks/hbm_start.py

Seconds are the least of five new processes, by the clock and of CPU; memory is the peak of the
whole process, with Python and its libraries.

Measured (seconds of CPU):

    import bladefem.hbm                                    0.001 s
    import of all that solves (NumPy, SciPy, numba)        0.34 s
    the same and the first point, 1-D and 3-D elements     0.62 s
    single mass   167.1 MiB after 100 points, 167.1 after 4000 more
    beam          167.9 MiB after 100 points, 167.9 after 4000 more
    chain         162.5 MiB after 50 points, 162.5 after 1000 more
    3-D patch     215 MiB after 6 points, 231 after 40 more
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

IMPORT = "import bladefem.hbm"
SOLVER = (
    "import bladefem.hbm.solve, bladefem.hbm.sweep, bladefem.hbm.peak, bladefem.hbm.continuation"
)
FIRST = """
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
assert solve(reference_model(load=1.4), 8300.0, 3, 128).converged
"""
SPACE = """
from hbm_models import patch
from bladefem.hbm.solve import solve
assert solve(patch(4, 6).model, 0.9, 3, 128).converged
"""
TIMED = """
import time
wall, cpu = time.perf_counter(), time.process_time()
{}
print(time.perf_counter() - wall, time.process_time() - cpu)
"""
CURVE = """
import resource
import numpy as np
from hbm_models import PROBLEMS
from bladefem.hbm.response import response
model, band = PROBLEMS["{0}"]().model, PROBLEMS["{0}"]().band
for count in ({1}, {2}):
    for point in response(model, np.linspace(*band, count), {3}, {4}):
        pass
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""
CURVES = {
    "single mass": (100, 4000, 7, 256),
    "beam": (100, 4000, 7, 256),
    "chain": (50, 1000, 7, 256),
    "3-D patch": (6, 60, 5, 128),
}  # points of the short and the long curve, harmonics, samples


def memory(name: str, *sizes: int) -> list[float]:
    """Peak memory after a short curve and a long one [MiB]."""
    run = subprocess.run(
        [sys.executable, "-c", CURVE.format(name, *sizes)],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=True,
    )
    return [float(line) for line in run.stdout.split()]


def waited(code: str, rounds: int = 5) -> tuple[float, float]:
    """Least seconds by the clock and of CPU that the code takes in a new process."""
    runs = [
        subprocess.run(
            [sys.executable, "-c", TIMED.format(code)],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=True,
        )
        for _ in range(rounds)
    ]
    clocks, cpus = zip(*(map(float, run.stdout.split()) for run in runs), strict=True)
    return min(clocks), min(cpus)


def main() -> None:
    for name, code in {
        "import bladefem.hbm": IMPORT,
        "import of what solves": SOLVER,
        "and first point, 1-D": FIRST,
        "and first point, 3-D": SPACE,
    }.items():
        print("{:24s} {:6.2f} s {:6.2f} s of CPU".format(name, *waited(code)))
    for name, sizes in CURVES.items():
        print(
            "{:24s} {:6.1f} MiB after {} points, {:.1f} after {} more".format(
                name, *[x for pair in zip(memory(name, *sizes), sizes, strict=False) for x in pair]
            )
        )


if __name__ == "__main__":
    main()

"""What compiled evaluations of 2-D elements save on small models, against the same Newton with
NumPy between the kernels.

    python benchmarks/newton_2d.py [seed ...]

Each seed is a model of `branch_models.py` with two tangents, swept over its band in 41 points with
its own harmonics, at least three. Times are CPU seconds of one process, the least of five sweeps;
the amplitudes of both ways are compared.

Measured, on a machine with other work: 0.14 to 1.9 ms a point, 0.68 to 0.93 of the time with NumPy,
0.77 in all; amplitudes are 3e-15 apart at most. What is left is mostly kernels and the LU: seed 13
factors 189 unknowns each step.
"""

from __future__ import annotations

import sys
import time
from unittest import mock

import numpy as np
from branch_models import random_case

from bladefem import balance as bf
from bladefem.hbm.solver import newton, residual

SEEDS = (8, 13, 15, 16, 23, 30, 36, 49)
POINTS = 41
REPEATS = 5


def swept(seed: int) -> tuple[float, list[bf.Solution]]:
    """Least CPU time of a sweep of a fresh model [s], and its points."""
    times = []
    for _ in range(REPEATS + 1):
        case = random_case(seed)
        harmonics = max((3, *case.model.excitation))
        omegas = np.linspace(*case.band, POINTS)
        begin = time.process_time()
        points = list(bf.response(case.model, omegas, harmonics, 16 * (harmonics + 1)))
        times.append(time.process_time() - begin)
    return min(times[1:]), points


def main(seeds: tuple[int, ...]) -> None:
    print("| seed | nodes, directions | steps | CPU a point [ms] | NumPy [ms] | ratio | apart |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    spent = np.zeros(2)
    for seed in seeds:
        quick, points = swept(seed)
        with (
            mock.patch.object(residual, "evaluates_2d", lambda balance: False),
            mock.patch.object(newton, "evaluates_2d", lambda balance: False),
        ):
            slow, others = swept(seed)
        spent += quick, slow
        sizes = np.array([[bf.size(p) for p in part] for part in (points, others)])
        difference = abs(sizes[0] / sizes[1] - 1).max()
        print(
            f"| {seed} | {points[0].w.shape[:2]} | {sum(p.iterations for p in points)} | "
            f"{1e3 * quick / POINTS:.2f} | {1e3 * slow / POINTS:.2f} | {quick / slow:.2f} | "
            f"{difference:.0e} |",
            flush=True,
        )
    print(f"all: {spent[0] / spent[1]:.2f}")


if __name__ == "__main__":
    main(tuple(int(a) for a in sys.argv[1:]) or SEEDS)

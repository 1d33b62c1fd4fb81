"""Cost of one converged point against contact nodes and harmonics, with the floating-point limit of
each part.

    python benchmarks/hbm_scaling.py [docs/figures/hbm_scaling]   table, and cost as .png and .csv

Square 3-D patches of `hbm_models.patch`. Limits: condensation 8/3 + 8 complex m^3 a harmonic (LU
and m right-hand sides, m = 3 n), or the same with k modes in place of m and 8 m k for the motion in
full stick, at the rate at which this machine multiplies matrices; a dense Jacobian would take
2/3 (m (2H+1))^3 a Newton step.

`set-up` is what the first point of a model makes for all later ones. Memory is the peak of the
resident set from the model's set-up to the point's end, beyond what the model itself takes (Linux).

Measured (CPU seconds, one thread of a busy machine, 57 GFlop/s in matrix products; H = 5):
    all modes
    nodes   point   set-up   condense   forces    limit   one dense step   MiB   dense MiB   steps
        9   0.006    0.003     0.0002   0.0006   0.00002          0.0003     2         0.7       4
       49   0.026    0.008     0.008    0.0010   0.003            0.05      11          20       5
      100   0.13     0.015     0.059    0.0021   0.025            0.42      31          83       7
      196   0.60     0.11      0.38     0.0053   0.19             3.2      150         319       6
      400   5.5      0.15      3.1      0.017    1.6             26        559        1329       9
    60 modes and the residual flexibility of the others
       49   0.017    0.006     0.0007   0.0009                              5                    5
      100   0.038    0.013     0.0007   0.0014                             10                    6
      196   0.083    0.049     0.0008   0.0028                             33                    6
      400   0.48     0.29      0.0010   0.0072                            116                    9
     1024   4.6      4.2       0.0022   0.037                             587                    8
    the latter as sectors of a wheel
      100   0.089     0.006     0.0073   0.0014                             21                    9
      196   0.14      0.35      0.023    0.0028                             96                    6
      400   0.54      1.5       0.025    0.0072                            339                    8
     1024   5.8    10.3         0.038    0.037                           2071                     8
Forces grow linearly. With all modes the condensation grows with the cube, about twice its limit;
the rest are products with a matrix for each harmonic. With few modes a frequency costs a system as
large as the modes; most of a point are products of the residual flexibility, which all harmonics
share, with the forces of all harmonics at once, in the iterations of 5 to 9 Newton steps. Memory
grows with the square of the nodes, time with their power 1.2 from 100 to 196 nodes, 2.5 above,
where the matrix has left the caches. Sectors, whose flexibility differs with the nodal diameter of
each harmonic, share one as well (`bladefem.hbm.linear.common_basis`): a matrix for each harmonic
took 2.2 s and 0.8 GB at 400 nodes.
25 nodes: H 1 to 31 takes 0.006 to 0.27 s and 2 to 42 MiB a point.
"""

from __future__ import annotations

import csv
import ctypes
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
from hbm_models import patch, sectors

from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.solution import Solution
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.residual import Balance, evaluate_balance, start_in_stick
from bladefem.reduction.truncate import truncate_modes

SIDES, HARMONICS, MODES = (3, 5, 7, 10, 14, 20, 32), (1, 3, 7, 15, 31), 60
SECTORS = "sectors"
# harmonics of the second table, and the largest side of a patch with all its modes: at 32 one point
# takes minutes and 3 GB
H_NODES, LARGEST_WHOLE = 5, 20


def rate(size: int = 600) -> float:
    """Floating-point operations a second of a complex matrix product."""
    a = np.random.default_rng(0).normal(size=(size, size)) + 1j
    return 8 * size**3 / min(seconds(lambda: a @ a) for _ in range(5))


def seconds(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def resident(name: str) -> float:
    """Megabytes of the resident set by its name in /proc/self/status."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) / 1024


def models(side: int) -> dict[str, ReducedModel]:
    """The patch with all its modes, and with the lowest few and the residual flexibility of the
    others; and the latter as a sector of a wheel.
    """
    whole = patch(side, max(side**2 // 3, 3)).model
    few = replace(whole, sides=(truncate_modes(whole.sides[0], MODES),))
    return {"all": whole, str(MODES): few, SECTORS: sectors(few, H_NODES)}


def measure(model: ReducedModel, modes: str, H: int, speed: float) -> dict[str, float]:
    """CPU seconds of a point and of its parts."""
    nodes, samples, omega = len(model.elements.kt), 8 * H + 64, 0.9
    # what earlier models left goes back, and the peak of the resident set begins again here
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    before = resident("VmRSS")
    found: list[Solution] = []
    first = seconds(lambda: found.append(solve(model, omega, H, samples)))
    memory = resident("VmHWM") - before
    point = seconds(lambda: solve(model, omega, H, samples))
    balance = Balance(model, condense(model, omega, H), samples)
    m, k = 3 * nodes, len(model.sides[0].omega)
    solved = m if modes == "all" else k
    products = (8 / 3 + 8) * solved**3 + (0 if modes == "all" else 8 * m * k)
    return {
        "sectors": float(modes == SECTORS),
        "nodes": nodes,
        "H": H,
        "modes": k,
        "point": point,
        "set-up": max(first - point, 0.0),
        "condense": seconds(lambda: condense(model, omega, H)),
        "forces": seconds(lambda: evaluate_balance(balance, start_in_stick(balance))),
        "limit": products * H / speed,
        "dense": 2 / 3 * (m * (2 * H + 1)) ** 3 / speed,
        "memory": memory,
        "dense memory": 8 * (m * (2 * H + 1)) ** 2 / 2**20,
        "iterations": found[0].iterations,
        "solved": found[0].converged,
    }


def main(target: str | None = None) -> None:
    speed = rate()
    print(f"matrix products: {speed / 1e9:.1f} GFlop/s")
    small, rows = models(5), []
    for modes, model in small.items():  # kernels read from their cache
        measure(model, modes, 1, speed)
    along = ((small["all"], "all", H) for H in HARMONICS)
    across = (
        (model, modes, H_NODES)
        for side in SIDES
        for modes, model in models(side).items()
        if (side <= LARGEST_WHOLE if modes == "all" else side > 5)
    )
    for part in chain(along, across):
        rows.append(measure(*part, speed))
        if len(rows) == 1:
            print("  ".join(f"{head:>12s}" for head in rows[0]))
        print("  ".join(f"{value:12.4g}" for value in rows[-1].values()), flush=True)
        if target and len(rows) > len(HARMONICS) + 5:
            write(rows, Path(target))


def write(rows: list[dict[str, float]], target: Path) -> None:
    with target.with_suffix(".csv").open("w", newline="") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        table.writerows({key: f"{value:.4g}" for key, value in row.items()} for row in rows)
    draw(rows, target.with_suffix(".png"))


def draw(rows: list[dict[str, float]], file: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(10, 7), sharey="row", sharex="col")
    curves = {
        "point": ("o-", "one point"),
        "condense": ("s-", "flexibilities"),
        "forces": ("^-", "contact forces"),
        "limit": ("--", "floating-point limit"),
        "memory": ("o-", "one point"),
        "dense": (":", "one dense Newton step, at the limit"),
        "dense memory": (":", "its matrix"),
    }
    by_nodes = rows[len(HARMONICS) :]
    few = [row for row in by_nodes if row["modes"] == MODES and not row["sectors"]]
    cyclic = [row for row in by_nodes if row["sectors"]]
    whole = [row for row in by_nodes if row not in few and row not in cyclic]
    for column, along, part, title, colour in (
        (0, "nodes", whole, "all modes", "C0"),
        (0, "nodes", few, f"{MODES} modes", "C1"),
        (0, "nodes", cyclic, f"{MODES} modes, sectors", "C2"),
        (1, "H", rows[: len(HARMONICS)], "all modes", "C0"),
    ):
        for name, (style, label) in curves.items():
            if not name.startswith("dense") or part not in (few, cyclic):
                axis = axes[int("memory" in name), column]
                titled = label if name.startswith("dense") else f"{label}, {title}"
                axis.loglog(
                    [r[along] for r in part],
                    [r[name] for r in part],
                    style,
                    label=titled,
                    color="grey" if name.startswith("dense") else colour,
                )
        axes[1, column].set_xlabel(
            {"nodes": f"contact nodes, H = {H_NODES}", "H": "harmonics, 25 nodes"}[along]
        )
    axes[0, 0].set_ylabel("CPU time [s]")
    axes[1, 0].set_ylabel("memory [MiB]")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), fontsize="small", loc="lower center", ncol=3
    )
    figure.tight_layout(rect=(0, 0.1, 1, 1))
    figure.savefig(file, dpi=120)
    pyplot.close(figure)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Where each method fails on the reference blade: 128 points of (load, frequency), 144 of (load,
contact stiffness).

    python benchmarks/paper_maps.py [folder]   about five minutes, prints the counts and writes
                                               method_map.csv and .png
    BLADEFEM_COARSE=1                          12 points

Recorded on 272 points, 258 s of CPU (docs/paper/method_map.csv), converged / false / none:

    paper                      159/90/23
    picard                     255/3/14
    amplitude                  272/0/0
    complex                    268/4/0
    parts                      250/21/1
    anderson                   264/8/0
    anderson on the residual   271/0/1
    describing                 272/0/0
    Newton without fallbacks   271/0/1
    Newton with fallbacks      272/0/0, at 1e-13
"""

import os
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.reference_blade import reference_model
from bladefem.hbm.solve import solve
from bladefem.hbm.solver.newton import newton
from bladefem.hbm.solver.residual import Balance, start_in_stick
from verification.paper.method_maps import count_outcomes, method_map, write_rows
from verification.paper.view_outcomes import draw_outcomes

COARSE = os.environ.get("BLADEFEM_COARSE") == "1"
H, SAMPLES = 5, 256
FREQUENCY = 1230.0  # of the plane (load, stiffness) [Hz]
PLANES = {
    "frequency": ("frequency", "frequency [Hz]", 1.0),
    "stiffness": ("stiffness", "stiffness [N/µm]", 1e-6),
}


def grid() -> list[tuple[float, float, float]]:
    """(limit, stiffness, frequency): loads over three decades, band of mode 2; stiffness over three
    decades.
    """
    loads = np.geomspace(0.1, 100, 3 if COARSE else 16)
    bands = [(load, 1e6, f) for load in loads for f in np.linspace(1200, 1420, 2 if COARSE else 8)]
    loads = np.geomspace(0.1, 100, 3 if COARSE else 12)
    return bands + [
        (load, kt, FREQUENCY)
        for load in loads
        for kt in np.geomspace(1e5, 1e8, 2 if COARSE else 12)
    ]


def model(load: float, stiffness: float):
    return reference_model(stiffness, 0.06, load, points=5, modes=5)


def plain(body, omega):
    """Newton from full stick, once, without any fallback."""
    balance = Balance(body, condense(body, omega, H), SAMPLES)
    end = newton(balance, start_in_stick(balance))
    return end.converged, end.iterations, end.state.error, end.reason


def chain(body, omega):
    """The same with all fallbacks."""
    solution = solve(body, omega, H, SAMPLES)
    return (
        solution.converged,
        solution.iterations,
        solution.residual,
        f"{solution.method}: {solution.reason}",
    )


def main(folder: Path) -> None:
    started = time.process_time()
    rows = list(method_map(grid(), model, {"newton": plain, "newton, fallbacks": chain}))
    write_rows(rows, folder / "method_map.csv")
    table = pd.DataFrame(rows)
    table["plane"] = np.where(table["frequency"] == FREQUENCY, "stiffness", "frequency")
    draw_outcomes(
        table, PLANES, folder / "method_map.png", title="Where methods fail on the reference blade"
    )
    print(f"{len(grid())} points, {time.process_time() - started:.0f} s of CPU")
    for method, counts in count_outcomes(rows).items():
        print(f"{method:18s}", ", ".join(f"{word} {counts[word]}" for word in sorted(counts)))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("."))

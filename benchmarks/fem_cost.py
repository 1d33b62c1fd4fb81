"""Cost of the modes of one complex nodal diameter against degrees of freedom, 10^4 to 4*10^5, and a
model fitted to it.

    PYTHONPATH=. python benchmarks/fem_cost.py   (4 minutes; docs/figures/fem_cost.png and .csv)

Wedge sector with 24 blades, ten modes of nodal diameter 5 from the mesh on, one process, one
thread, all in core. The largest run also solves nodal diameter 0 with the same factors. Recorded on
two shared cores:

    dofs            12 530  19 990  45 550  87 190  151 000  240 300  395 100
    cpu [s]           1.2     1.5     3.0     7.0     14.2     32.0     61.5
    memory [GB]      0.22    0.28    0.56    1.09     2.05     3.68     6.66
    entries [1e6]     1.7     3.6    13.8    35.7     79.3      155      316

With diameter 0 in addition the largest takes 71.4 s.
Both rows are from before the mass was assembled for one direction and the factors were given back
before the count by inertia: bladefem.fem.memory has today's peaks and model. Processor time grows
with n^1.46 over the four largest. benchmarks/million.py solves a million degrees of freedom.
"""

from __future__ import annotations

import json
import pickle
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from fem_ccx import measured, sector_mesh

FIGURE = Path(__file__).resolve().parent.parent / "docs" / "figures" / "fem_cost"
SIZES = (10e3, 20e3, 45e3, 90e3, 150e3, 250e3, 400e3)
LARGE = 350e3
RUN = """
import json, pickle, sys, time
start = time.process_time()
from bladefem.fem.body import assemble
from bladefem.fem.constraint import at_diameter, transformation
from bladefem.fem.flexibility import flexible
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material
mesh, diameters = pickle.load(open(sys.argv[1], "rb"))
frame = transformation(assemble(mesh, "blade", Material()), "clamp", True)
core = frame.opened.core
out = {"rim": len(core.rim), "entries": core.factor.entries, "flops": core.factor.flops,
       "cpu_factors": time.process_time() - start}
for n in diameters:
    con = at_diameter(frame, n)
    modes(con, 10, flexible(con))
    out[f"cpu_{n}"] = time.process_time() - start
print(json.dumps(out))
"""


def point(dofs: float, folder: Path) -> dict[str, float]:
    """One size."""
    mesh = sector_mesh(dofs)
    found = 3 * len(np.unique(mesh.bodies["blade"]))
    (folder / "mesh.pkl").write_bytes(pickle.dumps((mesh, [5, 0] if found > LARGE else [5])))
    out, cpu, memory = measured([sys.executable, "-c", RUN, "mesh.pkl"], folder)
    row = {
        "dofs": found,
        **json.loads(out.strip().splitlines()[-1]),
        "cpu": cpu,
        "memory_GB": memory,
    }
    print({name: float(f"{value:.4g}") for name, value in row.items()}, flush=True)
    return row


def fitted(table: pd.DataFrame) -> tuple[float, float]:
    """Bytes: 1.2e8 + a dofs + b dofs^(4/3), least squares of relative errors."""
    n, y = table["dofs"].to_numpy(float), 1e9 * table["memory_GB"].to_numpy()
    A = np.stack([n, n ** (4 / 3)], 1) / y[:, None]
    return tuple(np.linalg.lstsq(A, 1 - 1.2e8 / y, rcond=None)[0])


def draw(table: pd.DataFrame, model: tuple[float, float], file: Path) -> None:
    """Memory and processor time on logarithmic axes, with the fits."""
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    n = np.geomspace(9e3, 1e6)
    axes[0].loglog(table["dofs"], table["memory_GB"], "o", label="measured peak")
    axes[0].loglog(
        n,
        (1.2e8 + model[0] * n + model[1] * n ** (4 / 3)) / 1e9,
        "-",
        label=f"0.12 GB + {model[0]:.3g} B n + {model[1]:.3g} B n$^{{4/3}}$",
    )
    slope, level = np.polyfit(np.log(table["dofs"][-4:]), np.log(table["cpu_5"][-4:]), 1)
    axes[1].loglog(table["dofs"], table["cpu_5"], "o", label="mesh to modes")
    axes[1].loglog(table["dofs"], table["cpu_factors"], "s", label="mesh to factors")
    axes[1].loglog(
        n, np.exp(level) * n**slope, "-", label=f"n$^{{{slope:.2f}}}$ through the four largest"
    )
    for ax, label in zip(axes, ("peak memory [GB]", "processor time [s]"), strict=True):
        ax.set(xlabel="degrees of freedom n", ylabel=label)
        ax.grid(alpha=0.3, which="both")
        ax.legend(frameon=False)
    fig.savefig(file, dpi=150)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        table = pd.DataFrame([point(dofs, Path(name)) for dofs in SIZES])
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(FIGURE.with_suffix(".csv"), index=False, float_format="%.5g")
    model = fitted(table)
    draw(table, model, FIGURE.with_suffix(".png"))
    print(f"memory [bytes] = 1.2e8 + {model[0]:.4g} dofs + {model[1]:.4g} dofs^(4/3)")


if __name__ == "__main__":
    main()

"""Does it pay to use more ranks? Modes of all nodal diameters and the reduction on 1, 2 and 4.

    ./run python benchmarks/ranks.py                          (some 5 minutes on an idle machine)
    ./run python benchmarks/ranks.py --write                  and put it into README and docs
    ./run python benchmarks/ranks.py --set mesh.size="6 mm"   a smaller sector

One row a number of ranks: wall-clock times, CPU time of the rank that worked longest (waiting ranks
spin, and it counts), the largest memory of a rank after modes and at the end, and the largest
difference of frequencies and residual flexibilities from those of one rank. Only on a machine that
does nothing else the wall-clock times count. The mesh is drawn first and not counted.
"""

from __future__ import annotations

import argparse
import pickle
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import bladefem
from bladefem.cli.ranks import exit_code_of

HERE = Path(__file__).resolve()
ROOT = HERE.parent.parent
PAGES = ROOT / "README.md", ROOT / "docs" / "verification.md"
SCENE = ROOT / "scenes" / "wedge.toml"
START, END = "<!-- ranks: begin -->", "<!-- ranks: end -->"
# 139 000 degrees of freedom with the wedge scene
SIZE = "2.3 mm"
DIAMETERS = [0, 9, 18]
# kept in the reduction
MODES = 20
RANKS = (1, 2, 4)
HEADER = (
    "| ranks | modes, wall [s] | CPU [s] | reduction, wall [s] | CPU [s] | memory of a rank [GiB] "
    "| difference |\n| ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n"
)


def timed(comm: Any, work: Callable[[], Any]) -> tuple[float, float, Any]:
    """Wall-clock time, the largest CPU time of a rank [s], and what came out."""
    from bladefem.fem.compat import MPI

    comm.Barrier()
    wall = time.perf_counter()
    cpu = time.process_time()
    result = work()
    used = comm.allreduce(time.process_time() - cpu, MPI.MAX)
    comm.Barrier()
    return time.perf_counter() - wall, used, result


def on_ranks(folder: Path, given: Any) -> None:
    """The row of one number of ranks, written by rank 0.

    Args:
        given: the ranks that work, None for one.
    """
    from bladefem.fem.compat import MPI
    from bladefem.study.pipeline.bodies import Bodies
    from bladefem.study.pipeline.damper_contact import contact_patches
    from bladefem.study.pipeline.normal_modes import wheel_modes
    from bladefem.study.pipeline.reduced_sector import reduce_sector
    from geometry.mesh import sector_of

    comm = given or MPI.COMM_WORLD
    scene, mesh = pickle.loads((folder / "mesh.pkl").read_bytes())
    patches = contact_patches(mesh)
    bodies = Bodies(scene, mesh, comm)
    every = list(range(sector_of(mesh).count // 2 + 1))

    def modes() -> list[np.ndarray]:
        return [found.frequencies for found in wheel_modes(bodies, 10, every)]

    def memory() -> float:
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
        return comm.allreduce(own, MPI.MAX)

    row = dict(zip(("modes", "modes_cpu", "frequencies"), timed(comm, modes), strict=True))
    row["memory_modes"] = memory()
    reduction = timed(comm, lambda: reduce_sector(bodies, patches, DIAMETERS, MODES))
    row |= dict(zip(("reduction", "reduction_cpu"), reduction[:2], strict=True))
    row["residual"] = [reduction[2].sector[n].residual for n in DIAMETERS]
    row["memory"] = memory()
    if comm.rank == 0:
        (folder / f"row{MPI.COMM_WORLD.size}.pkl").write_bytes(pickle.dumps(row))


def difference(row: dict[str, Any], one: dict[str, Any]) -> float:
    """Largest relative difference of frequencies and residual flexibilities."""
    pairs = zip(
        [*row["frequencies"], *row["residual"]],
        [*one["frequencies"], *one["residual"]],
        strict=True,
    )
    return max(float(abs(a - b).max() / abs(b).max()) for a, b in pairs)


def line(ranks: int, row: dict[str, Any], one: dict[str, Any]) -> str:
    """A row of the table."""
    cells = [
        f"{ranks}",
        *(f"{row[k]:.1f}" for k in ("modes", "modes_cpu", "reduction", "reduction_cpu")),
        f"{row['memory']:.2f}",
        "-" if row is one else f"{difference(row, one):.0e}",
    ]
    return "| " + " | ".join(cells) + " |\n"


def write_table(text: str, dofs: int) -> None:
    """The table between its marks in each of the pages."""
    for page in PAGES:
        head, rest = page.read_text().split(START)
        tail = rest.split(END)[1]
        lead = f"{dofs} degrees of freedom:\n\n"
        page.write_text(f"{head}{START}\n{lead}{text}{END}{tail}")


def main() -> None:
    """All numbers of ranks, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default=str(SCENE))
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--ranks", type=int, nargs="+", default=RANKS)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        folder = Path(options.child)
        # as the command line does: more ranks than cores wait
        sys.exit(exit_code_of(lambda comm: on_ranks(folder, comm), options))
    from geometry.isolated_process import build_isolated

    scene = bladefem.load_scene(options.scene, [f"mesh.size={SIZE}", *options.set])
    mesh = build_isolated(scene)
    dofs = mesh.dimension * len(np.unique(mesh.bodies["blade"]))
    print(f"{dofs} degrees of freedom", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "mesh.pkl").write_bytes(pickle.dumps((scene, mesh)))
        text = HEADER
        rows: list[dict[str, Any]] = []
        for n in options.ranks:
            start = ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(n)]
            child = [sys.executable, str(HERE), "--child", str(folder)]
            subprocess.run([*start, *child], check=True)
            rows.append(pickle.loads((folder / f"row{n}.pkl").read_bytes()))
            text += line(n, rows[-1], rows[0])
            print(text.splitlines()[-1], f"after modes {rows[-1]['memory_modes']:.2f}", flush=True)
    print(text)
    if options.write:
        write_table(text, dofs)


if __name__ == "__main__":
    main()

"""Does it pay to use more ranks? Modes and reduction of a scene on the ranks that it is started on.

    ./run mpirun 1 benchmarks/ranks.py [--set mesh.size="6 mm"]
    ./run mpirun 2 benchmarks/ranks.py

One row a step: wall-clock time, CPU time of the rank that worked longest, and in the end the
largest memory of a rank. On a machine that does something else as well, the CPU time is what to
compare. The mesh is drawn first and not counted.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from pathlib import Path

import bladefem
from bladefem.fem.compat import MPI
from bladefem.study.modes.clamped_aerofoil import clamped_blade
from bladefem.study.pipeline.stages import (
    Bodies,
    blade_dofs,
    build_mesh,
    condense_contact,
    contact_patches,
    find_modes,
    on_one_rank,
    reduce_sector,
)

SCENE = Path(__file__).parent.parent / "scenes" / "wedge.toml"
DIAMETERS = [0, 9, 18]
# kept in the reduction
MODES = 20


def timed(name: str, work: Callable[[], object]) -> tuple[float, float]:
    """Wall-clock time and the largest CPU time of a rank [s], printed by rank 0."""
    comm = MPI.COMM_WORLD
    comm.Barrier()
    wall = time.perf_counter()
    # waiting ranks spin: what a rank does after its own work is not counted
    cpu = time.process_time()
    work()
    used = comm.allreduce(time.process_time() - cpu, MPI.MAX)
    comm.Barrier()
    elapsed = time.perf_counter() - wall
    if comm.rank == 0:
        print(f"{name:12s} {elapsed:8.1f} {used:8.1f}", flush=True)
    return elapsed, used


def main() -> None:
    """Print the table of one number of ranks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default=str(SCENE))
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    options = parser.parse_args()
    comm = MPI.COMM_WORLD
    scene = bladefem.load_scene(options.scene, options.set)
    mesh = build_mesh(scene, comm)
    patches = contact_patches(mesh)
    bodies = Bodies(scene, mesh, comm)
    if comm.rank == 0:
        print(f"{comm.size} ranks, {blade_dofs(mesh)} degrees of freedom")
        print("step         wall [s]  CPU [s]")
    rows = [
        timed("modes", lambda: find_modes(bodies, DIAMETERS, reduced=MODES)),
        timed("clamped", lambda: on_one_rank(bodies, clamped_blade)),
        timed("contact", lambda: on_one_rank(bodies, lambda b: condense_contact(b, patches))),
        timed("reduction", lambda: reduce_sector(bodies, patches, DIAMETERS, MODES)),
    ]
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    memory = comm.allreduce(own, MPI.MAX)
    if comm.rank == 0:
        print(f"{'sum':12s} {sum(r[0] for r in rows):8.1f} {sum(r[1] for r in rows):8.1f}")
        print(f"memory of the largest rank {memory:.2f} GiB")


if __name__ == "__main__":
    main()

"""A million degrees of freedom: ten modes of one complex nodal diameter of a sector, on one rank.

    python benchmarks/million.py [dofs or a pickled mesh] [core|disk]

The way (factors in memory, or on disk in MUMPS_OOC_TMPDIR) is chosen by the memory model when left
out. Where gmsh's first algorithm fails, the mesh takes twice as long and is finer by a tenth than
asked. Mesh, then solve in a process of its own: time, processor time, peak memory against the
model's, and the certificate of the modes. 1 032 705 degrees of freedom with the factors on disk
took 428 s of processor time beside other work and 10.4 GB, residuals below 2e-8; assembling them
takes 13 s, their mesh 4 minutes; in memory they would take 16 GB. 472 299 took 121 s and 4.05 GB.
"""

from __future__ import annotations

import json
import pickle
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from fem_ccx import SECTORS, measured

from bladefem.scene.tables import Scene
from geometry.isolated_process import build_isolated
from geometry.mesh import Mesh

# element size [m] and degrees of freedom of a sector, and how these grow
KNOWN_SIZE, KNOWN_DOFS, GROWTH = 1.23e-3, 701e3, 2.95
RUN = """
import json, pickle, sys, time
from bladefem.fem import body, memory
if sys.argv[2] != "auto":
    plan = memory.MemoryPlan(1.0, 1.0 if sys.argv[2] == "disk" else 0.0)
    body.check_memory = lambda dofs, comm, cut=0: plan
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.scene.tables import Material
mesh = pickle.load(open(sys.argv[1], "rb"))
start = time.perf_counter()
blade = body.assemble(mesh, "blade", Material())
found = modes(constrain(blade, "clamp", 5), 10)
print(json.dumps({
    "wall": time.perf_counter() - start,
    "on_disk": blade.plan.on_disk,
    "frequencies": found.frequencies.tolist(),
    "residual": float(found.residuals.max()),
}))
"""


def sector_mesh(dofs: float) -> Mesh:
    """The default sector with about this many degrees of freedom."""
    size = KNOWN_SIZE * (KNOWN_DOFS / dofs) ** (1 / GROWTH)
    scene = Scene()
    scene = replace(scene, disc=replace(scene.disc, sectors=SECTORS))
    return build_isolated(replace(scene, mesh=replace(scene.mesh, size=size)))


def main() -> None:
    """Mesh and solve, one line each."""
    from bladefem.fem.memory import modal_solve_memory

    wanted = sys.argv[1] if len(sys.argv) > 1 else "1e6"
    way = sys.argv[2] if len(sys.argv) > 2 else "auto"
    clock = time.perf_counter()
    if Path(wanted).is_file():
        mesh = pickle.loads(Path(wanted).read_bytes())
    else:
        mesh = sector_mesh(float(wanted))
    dofs = 3 * len(np.unique(mesh.bodies["blade"]))
    print(f"{dofs} degrees of freedom, mesh in {time.perf_counter() - clock:.0f} s", flush=True)
    with tempfile.TemporaryDirectory() as name:
        (Path(name) / "mesh.pkl").write_bytes(pickle.dumps(mesh))
        del mesh
        command = [sys.executable, "-c", RUN, "mesh.pkl", way]
        out, cpu, memory = measured(command, Path(name))
    found = json.loads(out.strip().splitlines()[-1])
    model = modal_solve_memory(dofs, on_disk=found["on_disk"]) / 1e9
    print(
        f"factors {'on disk' if found['on_disk'] else 'in memory'}: {found['wall']:.0f} s, "
        f"{cpu:.0f} s of processor time, {memory:.1f} GB (model {model:.1f} GB); "
        f"residuals up to {found['residual']:.0e}"
    )
    print(" ".join(f"{f:.4f}" for f in found["frequencies"]), "Hz")


if __name__ == "__main__":
    main()

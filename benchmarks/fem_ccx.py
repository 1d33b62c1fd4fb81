"""Cyclic sectors against CalculiX (apt install calculix-ccx): frequencies, processor time and
memory in one run.

    python benchmarks/fem_ccx.py [dofs ...]   (45000 when left out; one process, one thread each)
    python benchmarks/fem_ccx.py --golden     writes tests/fem/ccx_sector.json

The mesh is the default wedge sector with 24 blades. Facts about ccx: nodes of the slave face stay
off *BOUNDARY, middle nodes 9 and 10 are swapped against gmsh, numbers have at most 20 characters,
every frequency is printed twice. ccx integrates the mass of C3D10 with degree 2;
``quadrature="ccx"`` copies that.

Recorded with ccx 2.20 on two shared cores, ten modes each, processor time of ccx over that of
bladefem, peak memory of bladefem over that of ccx, largest relative difference of a frequency:

                                                                memory          frequencies with
    dofs     diameters  elements  ccx [s]  bladefem [s]  ratio  [GB]   ratio    ccx's    exact mass
     45 549  5          curved       21.9           3.3    6.7  0.57    1.50   1.8e-07      6.6e-05
     45 549  0          curved       18.3           3.0    6.0  0.55    1.45   3.1e-07      6.8e-05
     45 549  0 to 12    curved      298.3          10.0   29.8  0.83    1.92   3.4e-07      7.1e-05
     45 549  5          straight     18.8           3.1    6.0  0.57    1.51   3.3e-07      7.1e-06
    151 047  5          curved      156.9          13.8   11.4  2.09    1.18   1.4e-07      1.3e-05

The first and third rows, both sides in one run, are from a machine whose other core was busy, the
others from a quiet one. There ccx had taken 19.0 and 240.8 s; bladefem's best of three for all
diameters is 9.0 s of processor time (ratio 26.6 against those 240.8 s) where its Lanczos iteration
without waiting directions took 11.1 s, run by turns.

All of these are of the block Lanczos iteration without a count of the modes. With SLEPc and the
count by inertia, both sides in one run:

     49 632  5          curved       21.3           3.8    5.7  0.56    1.33   3.4e-07      6.4e-05
     49 632  0          curved       20.6           3.6    5.7  0.50    1.21   2.4e-07      6.3e-05
     49 632  0 to 12    curved      302.9           9.4   32.1  0.94    1.98   3.4e-07      6.9e-05
     49 632  5          straight     25.5           4.4    5.8  0.56    1.34   2.4e-07      9.3e-06

Share of the count, bladefem alone on a busy machine:

    dofs     diameters  bladefem [s]  memory [GB]  share of the count in the processor time
     49 632  5                   4.5         0.56  0.15
     49 632  0                   4.1         0.50
     49 632  0 to 12             9.6         0.93  0.08
    148 482  5                  19.5         1.68  0.21

With vectors given back before the last solves, no second copy of the space of guesses, without the
factors of cut faces that nobody needs again, and with large blocks returned to the system, both
sides in one run on another machine:

     49 632  5          curved       20.8           4.4    4.7  0.46    1.10   3.4e-07      6.4e-05
     49 632  0          curved       23.8           4.5    5.3  0.45    1.09   2.4e-07      6.3e-05
     49 632  0 to 12    curved      285.7          11.9   24.0  0.56    1.20   3.4e-07      6.9e-05
     49 632  5          straight     22.2           4.6    4.8  0.46    1.10   2.4e-07      9.3e-06

With nested dissection into halves of more equal size and restarts of SLEPc that keep nearly all of
the basis, both sides in one run beside other work:

     49 632  5          curved       16.8           3.4    4.9  0.44    1.05   3.4e-07      6.4e-05
     49 632  0          curved       18.0           2.8    6.5  0.44    1.05   2.4e-07      6.3e-05
     49 632  0 to 12    curved      214.7           7.8   27.4  0.54    1.15   3.4e-07      6.9e-05
     49 632  5          straight     17.6           3.3    5.3  0.44    1.05   2.4e-07      9.3e-06
    148 773  5          curved       90.2          14.1    6.4  1.32    0.82   3.5e-07      1.3e-05

With rows and columns picked in one pass and cut faces folded from parts, one complex diameter each,
both sides in one run on a machine three times overbooked:

     49 632  5          curved       24.4           4.4    5.6  0.44    1.06   3.4e-07      6.4e-05
    148 773  5          curved      147.7          19.1    7.7  1.33    0.82   3.5e-07      1.3e-05

With one order of elimination for blades at rest and turning, both sides in one run beside little
other work on a faster machine:

     44 892  5          curved       15.9           3.2    4.9  0.42    1.14   1.8e-07      7.6e-05
     44 892  0          curved       16.3           2.8    5.7  0.42    1.13   3.5e-07      7.3e-05
     44 892  0 to 12    curved      185.7           6.7   27.5  0.52    1.23   3.6e-07      8.0e-05
     44 892  5          straight     15.0           3.0    5.1  0.42    1.14   3.4e-07      9.8e-06
    146 769  5          curved       88.8          13.2    6.7  1.32    0.81   2.1e-07      1.6e-05

With the mass of one direction alone and pages that the count takes over, beside other work, with
OpenBLAS's own choice of kernels:

     44 892  5          curved       14.5           2.6    5.5  0.41    1.11   1.8e-07      7.6e-05
     44 892  0          curved       14.9           2.3    6.4  0.41    1.10   3.5e-07      7.3e-05
    148 623  5          curved      100.6          11.2    8.9  1.32    0.79   1.1e-07      1.6e-05

With the order of elimination from the mass, on an idle machine: what others leave of the memory's
speed CalculiX needs more than bladefem does.

     44 892  5          curved       13.9           2.9    4.7  0.44    1.19   1.8e-07      7.6e-05
     44 892  0          curved       13.8           2.4    5.8  0.44    1.17   3.5e-07      7.3e-05
     44 892  0 to 12    curved      173.3           7.3   23.7  0.53    1.26   3.6e-07      8.0e-05
     44 892  5          straight     14.1           2.8    5.0  0.44    1.18   3.4e-07      9.8e-06
    148 623  5          curved       80.0          12.4    6.4  1.32    0.79   1.1e-07      1.6e-05
    148 623  5          curved       86.5          12.5    6.9  1.31    0.79   1.1e-07      1.6e-05

Where 16.8 s at 148 773 go: 3.6 s into the Cholesky factorisation, 3.8 s into the count (another
factorisation, 3.2 s), 3.7 s into 26 sweeps over the factors with SLEPc's one vector. The block
iteration takes 10 sweeps of six vectors, 3.6 s in place of SLEPc's 5.4 s with all around it.

    python benchmarks/fem_ccx.py 45000 151000      both sides in one run, some 12 minutes
"""

from __future__ import annotations

import json
import os
import pickle
import resource
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from bladefem.scene.tables import Scene
from geometry.mesh import Mesh

COUNT, SECTORS = 10, 24
MANY = 60e3  # degrees of freedom from which one nodal diameter is enough waiting
HERE = Path(__file__).resolve()
GOLDEN = HERE.parent.parent / "tests" / "fem" / "ccx_sector.json"
OURS = """
import pickle, sys, json
from bladefem.fem.body import assemble
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.fem.all_diameters import all_diameters
from bladefem.scene.tables import Material
mesh, diameters, quadrature = pickle.load(open(sys.argv[1], "rb"))
body = assemble(mesh, "blade", Material(), quadrature=quadrature)
sets = ([modes(constrain(body, "clamp", diameters[0]), 10)] if len(diameters) == 1
        else all_diameters(body, 10, diameters))
print(json.dumps([s.frequencies.tolist() for s in sets]))
"""


def ccx_input(mesh: Mesh, diameters: list[int], count: int, path: Path, extra: str = "") -> None:
    """Input deck for the modes of some nodal diameters, lowest to highest."""
    cells = mesh.bodies["blade"]
    low, high = mesh.pairs["cyclic"].nodes
    sets = {"CLAMP": np.setdiff1d(np.unique(mesh.faces["clamp"]), high), "LOW": low, "HIGH": high}
    lines = ["*NODE, NSET=ALL"]
    lines += [
        f"{i + 1},{x:.12e},{y:.12e},{z:.12e}"
        for i, (x, y, z) in ((i, mesh.points[i]) for i in np.unique(cells))
    ]
    lines += ["*ELEMENT, TYPE=C3D10, ELSET=E"]
    lines += [
        ",".join(map(str, [e + 1, *nodes]))
        for e, nodes in enumerate((cells[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]] + 1).tolist())
    ]
    for name, nodes in sets.items():
        lines += [f"*NSET, NSET={name}", *[str(i + 1) for i in nodes]]
    lines += [
        "*MATERIAL, NAME=STEEL",
        "*ELASTIC",
        "2.1e11, 0.3",
        "*DENSITY",
        "7850.",
        "*SOLID SECTION, ELSET=E, MATERIAL=STEEL",
        "*BOUNDARY",
        "CLAMP, 1, 3",
        "*SURFACE, NAME=SLAVE, TYPE=NODE",
        "HIGH",
        "*SURFACE, NAME=MASTER, TYPE=NODE",
        "LOW",
        "*TIE, NAME=CUT, CYCLIC SYMMETRY",
        "SLAVE, MASTER",
        f"*CYCLIC SYMMETRY MODEL, N={mesh.sector.count}, NGRAPH=1, TIE=CUT",
        "0, 0, 0, 0, 0, 1",
        extra,
        "*STEP",
        "*FREQUENCY",
        str(count),
        f"*SELECT CYCLIC SYMMETRY MODES, NMIN={diameters[0]}, NMAX={diameters[-1]}",
        "*END STEP",
    ]
    path.write_text("\n".join(line for line in lines if line) + "\n")


def ccx_frequencies(text: str) -> dict[int, np.ndarray]:
    """Frequencies [Hz] of each nodal diameter from a .dat file, the second of each pair dropped."""
    found: dict[int, list[float]] = {}
    for line in text.splitlines():
        words = line.split()
        if (
            len(words) == 6 and words[0].isdigit()
        ):  # diameter, number, eigenvalue, rad/s, Hz, imaginary part
            found.setdefault(int(words[0]), []).append(float(words[4]))
    return {n: np.array(f[::2]) for n, f in found.items()}


def measured(command: list[str], folder: Path) -> tuple[str, float, float]:
    """Output, processor seconds and peak memory [GB] of a child on one thread."""
    pid_file = folder / "usage.json"
    wrapper = (
        "import json, resource, subprocess, sys\n"
        "out = subprocess.run(sys.argv[2:], capture_output=True, text=True)\n"
        "u = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "json.dump([out.stdout, out.stderr, out.returncode, u.ru_utime + u.ru_stime, u.ru_maxrss "
        "/ 1e6], "
        "open(sys.argv[1], 'w'))"
    )
    subprocess.run(
        [sys.executable, "-c", wrapper, str(pid_file), *command],
        check=True,
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(HERE.parent.parent)},
    )
    out, err, code, cpu, memory = json.loads(pid_file.read_text())
    if code:
        raise SystemExit(f"{command[0]} failed: {out[-500:]} {err[-2000:]}")
    return out, cpu, memory


def run_ccx(
    mesh: Mesh, diameters: list[int], folder: Path
) -> tuple[dict[int, np.ndarray], float, float]:
    """CalculiX; it counts every mode twice."""
    ccx_input(mesh, diameters, 2 * COUNT, folder / "job.inp")
    _, cpu, memory = measured(["ccx", "-i", "job"], folder)
    return ccx_frequencies((folder / "job.dat").read_text()), cpu, memory


def run_ours(
    mesh: Mesh, diameters: list[int], folder: Path, quadrature: str
) -> tuple[dict[int, np.ndarray], float, float]:
    """bladefem, from the mesh to frequencies; the interpreter's start and imports are counted
    too.
    """
    (folder / "mesh.pkl").write_bytes(pickle.dumps((mesh, diameters, quadrature)))
    out, cpu, memory = measured([sys.executable, "-c", OURS, "mesh.pkl"], folder)
    lists = json.loads(out.strip().splitlines()[-1])
    return {n: np.array(f) for n, f in zip(diameters, lists, strict=True)}, cpu, memory


def sector_mesh(dofs: float, curved: bool = True) -> Mesh:
    """The default sector with 24 blades and about this many degrees of freedom in the blade."""
    from geometry.isolated_process import build_isolated

    scene = Scene()
    scene = replace(scene, disc=replace(scene.disc, sectors=SECTORS))
    size = 0.0036
    for _ in range(4):
        mesh = build_isolated(replace(scene, mesh=replace(scene.mesh, size=size, curved=curved)))
        found = 3 * len(np.unique(mesh.bodies["blade"]))
        if abs(found / dofs - 1) < 0.04:
            break
        size *= (found / dofs) ** (1 / 2.4)
    return mesh


def compare(mesh: Mesh, diameters: list[int], folder: Path) -> None:
    """One line: agreement with both quadratures, ratio of processor time and of memory."""
    theirs, cpu, memory = run_ccx(mesh, diameters, folder)
    errors, mine, mine_memory = {}, np.inf, 0.0
    for quadrature in ("exact", "ccx"):  # the same work twice: the better time, the worse memory
        ours, seconds, memory_now = run_ours(mesh, diameters, folder, quadrature)
        mine, mine_memory = min(mine, seconds), max(mine_memory, memory_now)
        errors[quadrature] = max(
            abs(ours[n][:COUNT] / theirs[n][:COUNT] - 1).max() for n in diameters
        )
    dofs = 3 * len(np.unique(mesh.bodies["blade"]))
    print(
        f"{dofs:7d} dofs, nodal diameters {diameters[0]}-{diameters[-1]}: ccx {cpu:.1f} s, "
        f"bladefem {mine:.1f} s, ratio {cpu / mine:.1f}; memory {memory:.2f} and {mine_memory:.2f} "
        f"GB, ratio {mine_memory / memory:.2f}; frequencies differ by {errors['ccx']:.1e} with "
        f"ccx's mass, {errors['exact']:.1e} with the exact one",
        flush=True,
    )


def golden(folder: Path) -> None:
    """Frequencies of a small sector for the tests."""
    sys.path.insert(0, str(GOLDEN.parent))
    from structured import sector

    out = {}
    for straight in (False, True):
        mesh = sector(12, (4, 3, 1), bump=0.2, straight=straight)
        theirs = run_ccx(mesh, list(range(7)), folder)[0]
        out["straight" if straight else "curved"] = {
            n: f[:COUNT].tolist() for n, f in theirs.items()
        }
    GOLDEN.write_text(json.dumps(out, indent=1) + "\n")


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "--golden" in sys.argv:
            golden(folder)
            return
        for dofs in [float(a) for a in sys.argv[1:]] or [45000.0]:
            for curved in (True, False) if dofs < MANY else (True,):
                mesh = sector_mesh(dofs, curved)
                compare(mesh, [5], folder)
                if dofs < MANY and curved:
                    compare(mesh, [0], folder)
                    compare(mesh, list(range(SECTORS // 2 + 1)), folder)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    main()

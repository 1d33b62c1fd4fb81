"""Reference frequencies of the decks in tests/fem/decks.py by CalculiX (apt install calculix-ccx).

    python benchmarks/fem_decks.py          writes tests/fem/ccx_decks.json

Modes of three nodal diameters of a ring sector, one of twelve: C3D20, C3D20R, C3D15 with C3D20,
C3D10, and C3D4 promoted to C3D10; displacements and stresses of C3D15 with C3D20 under pressure;
clamped bars of a cubic crystal and an orthotropic solid; a bar
that turns about its axis, with Coriolis forces; and a bar between walls whose properties are tables
of temperature, heated evenly and unevenly.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent / "tests" / "fem"
GOLDEN = TESTS / "ccx_decks.json"
COUNT = 6
DIAMETERS = (0, 1, 2, 3)


def reference(kind: str, element_type: str | None, folder: Path) -> dict[str, list[float]]:
    """Frequencies [Hz] of each nodal diameter."""
    import decks
    from fem_ccx import ccx_frequencies

    mesh = decks.model("c3d10" if kind == "c3d4" else kind)
    if kind == "c3d4":
        mesh = decks.promoted(decks.model("c3d4"))
    (folder / "job.inp").write_text(decks.ccx_job(mesh, DIAMETERS, COUNT, element_type))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run(
        ["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True, env=environment
    )
    found = ccx_frequencies((folder / "job.dat").read_text())
    return {str(n): found[n][:COUNT].tolist() for n in DIAMETERS}


def crystal(kind: str, folder: Path) -> list[float]:
    """Frequencies [Hz] of a clamped bar of a crystal, its axes turned."""
    import decks

    from bladefem.fem.elasticity import crystal_rotation

    given = decks.CRYSTALS[kind]
    constants = given.get("orthotropic")
    if constants is None:
        constants = (*(given["E"],) * 3, *(given["nu"],) * 3, *(given["G"],) * 3)
    _, m = decks.bar()
    axes = crystal_rotation(given["angles"])
    (folder / "job.inp").write_text(decks.crystal_job(m, constants, axes, given["rho"], COUNT))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run(
        ["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True, env=environment
    )
    rows = [line.split() for line in (folder / "job.dat").read_text().splitlines()]
    found = [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()]
    return found[:COUNT]


def heated(kind: str, folder: Path) -> dict[str, object]:
    """Frequencies [Hz] about the linear and the nonlinear state of a heated bar, and the largest
    displacement of the linear one [m].
    """
    import decks
    import numpy as np

    mesh, m = decks.bar()
    m.node_sets["far"] = np.unique(mesh.faces["x1"])
    hot = decks.temperature(m.points)
    uniform = 450.0 if kind == "uniform" else None
    out: dict[str, object] = {}
    for name in ("NLGEOM", "linear"):
        job = decks.heated_job(m, hot, COUNT, uniform, nlgeom=name == "NLGEOM")
        (folder / "job.inp").write_text(job)
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        subprocess.run(
            ["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True, env=environment
        )
        static, _, vibration = (folder / "job.dat").read_text().partition("E I G E N V A L U E")
        rows = [line.split() for line in vibration.splitlines()]
        found = [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()]
        out[name] = found[:COUNT]
    rows = [line.split() for line in static.splitlines()]
    moved = [row[1:] for row in rows if len(row) == 4 and row[0].isdigit()]
    out["largest"] = float(np.abs(np.array(moved, float)).max())
    return out


def heated_crystal(folder: Path) -> dict[str, object]:
    """Largest displacement [m] and frequencies [Hz] of a bar that expands along its crystal's
    axes.
    """
    import decks

    from bladefem.fem.temperature import crystal_rotation

    given = decks.CRYSTALS["orthotropic"]
    _, m = decks.bar()
    hot = decks.temperature(m.points)
    axes = crystal_rotation(given["angles"])
    job = decks.heated_crystal_job(m, given["orthotropic"], axes, given["rho"], hot, COUNT)
    (folder / "job.inp").write_text(job)
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run(
        ["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True, env=environment
    )
    static, _, vibration = (folder / "job.dat").read_text().partition("E I G E N V A L U E")
    rows = [line.split() for line in static.splitlines()]
    moved = [[float(v) for v in row[1:]] for row in rows if len(row) == 4 and row[0].isdigit()]
    lines = [line.split() for line in vibration.splitlines()]
    found = [float(row[3]) for row in lines if len(row) == 5 and row[0].isdigit()]
    last = max(moved, key=lambda u: sum(v * v for v in u))
    return {"largest": last, "frequencies": found[:COUNT]}


def turning(folder: Path) -> dict[str, list[float]]:
    """Frequencies [Hz] of a bar that turns about its axis, without and with Coriolis forces."""
    import decks

    from bladefem.scene.tables import Material

    (folder / "job.inp").write_text(decks.turning_job(Material()))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run(
        ["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True, env=environment
    )
    out: dict[str, list[float]] = {"real": [], "complex": []}
    for line in (folder / "job.dat").read_text().splitlines():
        row = line.split()
        if len(row) in (4, 5) and row[0].isdigit() and int(row[0]) <= decks.TURNING_MODES:
            name = "real" if len(row) == 5 else "complex"
            if len(out[name]) == int(row[0]) - 1:
                out[name].append(float(row[3] if len(row) == 5 else row[2]))
    return out


def halved(folder: Path) -> list[float]:
    """Frequencies [Hz] of nodal diameter 2 of a coarse sector of C3D15 and C3D20, halved twice."""
    import decks
    from fem_ccx import ccx_frequencies

    from geometry.imported import read_mesh

    coarse = decks.model("c3d15_c3d20", (4, 3, 2))
    (folder / "coarse.inp").write_text("\n".join(decks.flat_deck(coarse, {})))
    mesh = read_mesh(folder / "coarse.inp", sectors=decks.SECTORS)
    (folder / "job.inp").write_text(decks.ccx_job(decks.halved_model(mesh, 2), (2, 2), COUNT))
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    subprocess.run(
        ["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True, env=environment
    )
    found = ccx_frequencies((folder / "job.dat").read_text())[2][:COUNT]
    return [float(f) for f in found]


def pressed(folder: Path) -> list[dict[str, object]]:
    """An open sector of C3D20 and C3D15 under pressure, as it is and halved: places [m] of some
    nodes away from the clamp, their displacements [m] and stresses [Pa] (xx, yy, zz, xy, yz, zx).
    """
    import decks
    import numpy as np

    out: list[dict[str, object]] = []
    for halvings in (0, 1):
        mesh = decks.pressed_mesh(halvings)
        used, job = decks.pressed_job(mesh)
        (folder / "job.inp").write_text(job)
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        subprocess.run(
            ["ccx", "-i", "job"], cwd=folder, check=True, capture_output=True, env=environment
        )
        found = nodal_results((folder / "job.frd").read_text(), len(used))
        points = mesh.points[used]
        away = np.flatnonzero(np.hypot(points[:, 0], points[:, 1]) > 0.17)
        chosen = away[:: len(away) // 20]
        out.append(
            {
                "points": points[chosen].tolist(),
                "displacements": found["DISP"][chosen, :3].tolist(),
                "stresses": found["STRESS"][chosen].tolist(),
            }
        )
    return out


def nodal_results(text: str, nodes: int) -> dict[str, np.ndarray]:
    """(nodes, 6) values of each field of a file ``.frd``."""
    import numpy as np

    out: dict[str, np.ndarray] = {}
    values = np.empty((0, 6))
    inside = False
    for line in text.splitlines():
        if line.startswith(" -4"):
            values = out[line.split()[1]] = np.zeros((nodes, 6))
            inside = True
        elif line.startswith(" -3"):
            inside = False
        elif line.startswith(" -1") and inside:
            row = [float(line[i : i + 12]) for i in range(13, len(line) - 11, 12)]
            values[int(line[3:13]) - 1, : len(row)] = row
    return out


def main() -> None:
    """Write the reference file."""
    sys.path[:0] = [str(TESTS), str(HERE), str(HERE.parent)]
    cases = {
        "c3d20": ("c3d20", None),
        "c3d20r": ("c3d20", "C3D20R"),
        "c3d15_c3d20": ("c3d15_c3d20", None),
        "c3d10": ("c3d10", None),
        "c3d4": ("c3d4", None),
    }
    with tempfile.TemporaryDirectory() as name:
        out = {case: reference(*how, Path(name)) for case, how in cases.items()}
        out["crystals"] = {kind: crystal(kind, Path(name)) for kind in ("cubic", "orthotropic")}
        out["heated_crystal"] = heated_crystal(Path(name))
        out["turning"] = turning(Path(name))
        out["pressed"] = pressed(Path(name))
        out["halved"] = halved(Path(name))
        out["heated"] = {kind: heated(kind, Path(name)) for kind in ("uniform", "field")}
    GOLDEN.write_text(json.dumps(out, indent=1) + "\n")


if __name__ == "__main__":
    main()

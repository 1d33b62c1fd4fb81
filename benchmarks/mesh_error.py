"""Is the reported error ever below half of the true one, where the mesh is what is wrong?

    python benchmarks/mesh_error.py [name ...]

Each case is one load on a coarse mesh, and again on a mesh twice as fine in body and seats. "True"
is the change of the resonance amplitude from the first to the second; "reported" is what the
first run says: the balance's own error, what half as many contact points change, and what the
estimated error of the body's elements changes.

Measured on 9 and 4.5 mm elements:

    case               um coarse  um fine   true   reported (balance + body)
    shipped, coarse      159.04    162.43   2.1 %   5.9 %  (1.5 % + 4.4 %)
    soft layer           934.66    903.76   3.4 %   8.6 %  (2.8 % + 5.8 %)
    stiff layer           67.04     67.59   0.8 %   1.9 %  (1.0 % + 0.9 %)
    imported mesh        158.55    161.44   1.8 %   8.2 %  (1.2 % + 7.0 %)
    imported STEP        127.81    129.92   1.6 %   2.3 %  (0.2 % + 2.1 %)

What half the points change is in the balance's error there.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene
from bladefem.study.pipeline import pipeline
from bladefem.study.pipeline.curve import Curve
from bladefem.study.pipeline.scene_mesh import build_mesh
from geometry.export import write_msh

COMMON = ["study.own_load=false", "study.stability=false", "study.influences=false"]
LOAD = "study.loads=80 N"


@dataclass(frozen=True)
class Case:
    """The same scene on a coarse mesh, and on one twice as fine."""

    name: str
    # True: twice as fine
    scene: Callable[[bool, Path], Scene]


def drawn_wedge(*overrides: str) -> Callable[[bool, Path], Scene]:
    """The shipped wedge with elements of 9 and of 4.5 mm; seats of 4 x 6 and 8 x 12 elements."""

    def scene(fine: bool, _: Path) -> Scene:
        size = (
            ["mesh.size=4.5 mm", "mesh.seat_elements=8", "mesh.contact_size=3.33 mm"]
            if fine
            else ["mesh.size=9 mm", "mesh.seat_elements=4"]
        )
        return load_scene("scenes/wedge.toml", [*COMMON, LOAD, *size, *overrides])

    return scene


def imported_wedge(fine: bool, folder: Path) -> Scene:
    """The wedge with free triangles on its seats, written to a file and read as a user's mesh."""
    size = (
        ["mesh.size=4.5 mm", "mesh.contact_size=2 mm"]
        if fine
        else ["mesh.size=9 mm", "mesh.contact_size=4 mm"]
    )
    drawn = load_scene("scenes/wedge.toml", [*size])
    drawn = replace(drawn, mesh=replace(drawn.mesh, seat_elements=None))
    file = folder / f"wedge_{fine}.msh"
    write_msh(build_mesh(drawn), file)
    text = f"""
kind = "imported"
accuracy = "5 %"
[imported]
file = "{file}"
sectors = 36
[material.blade]
E = "210 GPa"
nu = 0.3
rho = "7850 kg/m^3"
[contact]
mu = 0.3
kt_area = "40 N/mm^3"
[operation]
speed = "2550 rpm"
damping = "0.1 %"
[excitation]
engine_order = 9
force = "1.5 N"
at = "tip_mid"
direction = [0, 1, 0]
mode = 1
"""
    path = folder / f"wedge_{fine}.toml"
    path.write_text(text)
    return load_scene(path, [*COMMON, LOAD])


def imported_step(fine: bool, _: Path) -> Scene:
    """The STEP blade of the tutorial with a fitted damper."""
    size = ["mesh.size=4.5 mm"] if fine else ["mesh.size=9 mm"]
    return load_scene("scenes/own_blade.toml", [*COMMON, "study.loads=100 N", *size])


CASES = (
    Case("shipped, coarse", drawn_wedge()),
    Case("soft layer", drawn_wedge("contact.kt_area=4 N/mm^3")),
    Case("stiff layer", drawn_wedge("contact.kt_area=400 N/mm^3")),
    Case("imported mesh", imported_wedge),
    Case("imported STEP", imported_step),
)


def solved(case: Case, fine: bool, folder: Path) -> tuple[Curve, int, float]:
    """Curve, degrees of freedom of the mesh, CPU seconds."""
    start = time.process_time()
    result = pipeline.run(case.scene(fine, folder), None)
    dofs = result.mesh.dimension * len(result.mesh.points)
    return result.response.curves[0], dofs, time.process_time() - start


def main(names: list[str]) -> None:
    """The table."""
    print("case                 dofs -> dofs      um coarse   um fine    true  reported  ratio")
    print("                                       (balance + half the points + body's elements)")
    for case in CASES:
        if names and not any(name in case.name for name in names):
            continue
        with tempfile.TemporaryDirectory(prefix="bladefem-") as folder:
            coarse, few, short = solved(case, False, Path(folder))
            fine, many, long = solved(case, True, Path(folder))
        true = abs(coarse.peak_amplitude / fine.peak_amplitude - 1)
        print(
            f"{case.name:18s} {few:7d} -> {many:7d}  {1e6 * coarse.peak_amplitude:9.2f} "
            f"{1e6 * fine.peak_amplitude:9.2f}  {true:6.2%}  {coarse.error:7.2%}  "
            f"{coarse.error / max(true, 1e-12):6.2f}   ({coarse.settings.error:.2%} + "
            f"{coarse.halved:.2%} + {coarse.body_mesh:.2%}; {short:.0f} and {long:.0f} s CPU)",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1:])

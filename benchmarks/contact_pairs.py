"""Contact in 3-D on gmsh's meshes: Hertz spheres, rigid flat punch, partial slip of Cattaneo and
Mindlin.

    PYTHONPATH=. python benchmarks/contact_pairs.py     (a minute and a half on one core)

Bodies are blocks of ten contact radii (cylinders: 60, plane stress), clamped on the far side; a
quarter is meshed. Recorded results, relative errors:

                                                     peak         L2     radius
    cylinder, steel, h = a/4                       0.19 %     1.23 %     0.32 %
    cylinder, steel, h = a/6                       0.12 %     1.19 %     0.32 %
    cylinder, steel, h = a/8                       0.05 %     0.82 %     0.18 %
    cylinder, steel, h = a/10                      0.01 %     0.40 %     0.04 %
    cylinder, steel: observed order of the peak 2.7, of L2 1.1
                                                     peak         L2     radius
    sphere, steel, h = a/4                         0.79 %     4.17 %     0.47 %
    sphere, steel, h = a/6                         0.32 %     1.84 %     0.18 %
    sphere, steel, h = a/8                         0.11 %     2.21 %     0.05 %
    sphere, steel, h = a/10                        0.08 %     0.85 %     0.08 %
    sphere, steel: observed order of the peak 2.6, of L2 1.5
                                              stick radius, energy of the loop
    partial slip, Q = 0.6 mu P, h = a/10           0.14 %     1.97 %
    partial slip, Q = 0.75 mu P, h = a/10          0.17 %     1.13 %
    partial slip, Q = 0.9 mu P, h = a/10           0.19 %     0.78 %
                                                     peak         L2     radius
    sphere, steel on aluminium, h = a/4            0.78 %     4.24 %     0.49 %
    sphere, steel on aluminium, h = a/6            0.33 %     1.89 %     0.18 %
    sphere, steel on aluminium, h = a/8            0.11 %     2.23 %     0.06 %
    sphere, steel on aluminium, h = a/10           0.07 %     0.89 %     0.08 %
    sphere, steel on aluminium: observed order of the peak 2.7, of L2 1.5
    rigid punch, strip, h = a/5, r < 0.8 a: L2     0.77 %
    rigid punch, strip, h = a/10, r < 0.8 a: L2     0.21 %
    rigid punch, strip, h = a/20, r < 0.8 a: L2     0.33 %
    rigid punch, round, h = a/5, r < 0.8 a: L2     2.48 %
    rigid punch, round, h = a/7, r < 0.8 a: L2     1.50 %
    rigid punch, round, h = a/10, r < 0.8 a: L2     1.49 %
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "contact"))

from pairs import indent, loops, press

from bladefem.scene.tables import Material

STEEL, ALUMINIUM = Material(), Material(E=7e10, nu=0.33, rho=2700.0)
SIZES = (4, 6, 8, 10)


def line(name: str, *errors: float) -> None:
    print(f"    {name:42s}" + "".join(f"{100 * e:9.2f} %" for e in errors), flush=True)


def main() -> None:
    wide = {
        "contact_radius": 5e-4,
        "half_width": 0.03,
    }  # in the plane a block of ten radii is too small
    for name, materials, dimension, more in (
        ("cylinder, steel", (STEEL, STEEL), 2, wide),
        ("sphere, steel", (STEEL, STEEL), 3, {}),
        ("sphere, steel on aluminium", (STEEL, ALUMINIUM), 3, {}),
    ):
        print(f"    {'':42s}       peak         L2     radius")
        found = []
        for n in SIZES:
            found.append(press(n, materials, dimension, **more))
            line(f"{name}, h = a/{n}", *(found[-1][k] for k in ("peak", "L2", "radius")))
        orders = [
            -np.polyfit(np.log(SIZES), np.log([e[k] for e in found]), 1)[0] for k in ("peak", "L2")
        ]
        print(f"    {name}: observed order of the peak {orders[0]:.1f}, of L2 {orders[1]:.1f}")
        if materials == (STEEL, STEEL) and dimension == 3:
            ratios = (0.6, 0.75, 0.9)
            print(f"    {'':42s}stick radius, energy of the loop")
            for ratio, errors in zip(ratios, loops(found[-1], STEEL, ratios), strict=True):
                line(f"partial slip, Q = {ratio} mu P, h = a/10", *errors)
    for dimension, name in ((2, "strip"), (3, "round")):
        for n in (5, 10, 20) if dimension == 2 else (5, 7, 10):
            line(f"rigid punch, {name}, h = a/{n}, r < 0.8 a: L2", indent(n, STEEL, dimension))


if __name__ == "__main__":
    main()

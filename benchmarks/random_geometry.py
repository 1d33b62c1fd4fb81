"""Two hundred random wedge sectors: each gives a valid mesh or one sentence that names the
parameter to change.

A quarter is drawn anywhere in the documented ranges, the rest within a factor exp(+-0.25) of the
defaults (there the shank is cut to the length of disc and platform, else half of the sets would
fall to this one rule). The meshes are coarse, and made as users' are: in a process of their own,
whose crash becomes a sentence.

    python benchmarks/random_geometry.py [count] [seed]

Half of the sets round the defaults have a dovetail or fir-tree root, half a tip shroud or snubber;
half leave the fillet to the rule, the others have one of 0.5 to 3 mm.

Measured (gmsh 4.15.2, two shared cores, filled by HXT), 200 sets of seed 4; nothing crashed, and
every refusal came from a rule of `bladefem check` and named a field; the first 50 sets filled by
Delaunay: 18 meshes of worst quality 0.039, all else refused too:

    meshes, round the defaults / anywhere               73 / 0
    refusals, round the defaults / anywhere             77 / 50
    worst shape quality of all meshes                   0.020
    meshes below 0.05 / 0.1 / 0.15                      16 / 52 / 73
    smallest scaled Jacobian                            0.101
    CPU, all 200 sets                                   8.5 min

Seeds 1 and 2 without roots and shrouds gave 87 and 101 meshes of worst quality 0.030 and 0.021,
all else refused too. Round the defaults most refusals are of the root chord, which overhangs a
platform of nearly its length.

Shape quality is the ratio of inscribed to circumscribed radius, 1 at best; below 0.02 a mesh is
refused. Before the shank's end had to be flush with the disc's or 2 % short of it, the worst cells
were strips of 9e-6 to 3e-3 there. Nearly all sets from the whole ranges break a rule of proportion:
a root chord longer than the platform, a bore larger than the rim.
"""

import sys
import time
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from bladefem.errors import InputError
from geometry.isolated_process import build_isolated
from geometry.parameters import (
    Aerofoil,
    Disc,
    MeshSize,
    Platform,
    Root,
    Shank,
    Shroud,
    Wedge,
)
from geometry.sampling import sample_around, sample_in_range
from geometry.sector_check import check_sector

TABLES = {"aerofoil": Aerofoil, "platform": Platform, "shank": Shank, "disc": Disc, "damper": Wedge}
BINS = (0, 0.02, 0.05, 0.1, 0.15, 0.2, 1)  # of the worst shape quality of a mesh
WORST = 8


def parameters(number, seed):
    """Seven tables; every fourth set comes from the whole ranges."""
    rng = np.random.default_rng((seed, number))
    if number % 4 == 0:
        parts = level_plates({name: sample_in_range(table, rng) for name, table in TABLES.items()})
        return parts | {"root": sample_in_range(Root, rng), "shroud": sample_in_range(Shroud, rng)}
    parts = level_plates(
        {name: sample_around(table(), rng, 0.25) for name, table in TABLES.items()}
    )
    shank, longest = parts["shank"], min(parts["disc"].width, parts["platform"].length)
    parts |= {"shank": replace(shank, length=min(shank.length, longest))}
    # the two tables that change nothing by default: half of the sets each; and half of the
    # fillets are left to the rule
    root = replace(sample_around(Root(), rng, 0.25), lobes=int(rng.integers(1, 4)))
    shroud = replace(
        sample_around(Shroud(thickness=3e-3), rng, 0.25),
        at=1.0 if rng.random() < 0.5 else float(rng.uniform(0.4, 0.8)),
    )
    fillet = float(rng.uniform(5e-4, 3e-3)) if rng.random() < 0.5 else None
    return parts | {
        "aerofoil": replace(parts["aerofoil"], fillet=fillet),
        "root": root if rng.random() < 0.5 else Root(),
        "shroud": shroud if rng.random() < 0.5 else Shroud(),
    }


def level_plates(parts):
    """A plate has seats in one plane, which no random angle gives."""
    damper = parts["damper"]
    if damper.shape != "plate":
        return parts
    return parts | {"damper": replace(damper, angle=np.pi / 2, angle_next=None)}


def attempt(number, seed):
    """The report of the mesh, or the reason of the refusal; and seconds."""
    parts = parameters(number, seed)
    blade = parts["aerofoil"]
    thin = min(
        blade.thickness_tip * blade.chord_tip, parts["platform"].thickness, parts["shank"].width
    )
    size = MeshSize(size=max(1.5 * thin, blade.span / 40))
    start = time.perf_counter()
    try:
        outcome = build_isolated(SimpleNamespace(kind="wedge sector", mesh=size, **parts)).report
    except InputError as error:
        outcome = str(error)
    return outcome, time.perf_counter() - start


def refused_before_meshing(number, seed):
    """Whether the rules of `bladefem check` refuse the set."""
    parts = parameters(number, seed)
    try:
        check_sector(*(parts[name] for name in (*TABLES, "root", "shroud")))
    except InputError:
        return True
    return False


def main(count=200, seed=1):
    """Run all; print the counts, the worst meshes, and every reason that came from the mesher and
    not from a rule.
    """
    kinds, reasons, meshes = Counter(), Counter(), []
    for number in range(count):
        outcome, seconds = attempt(number, seed)
        said = isinstance(outcome, str)
        kinds["anywhere" if number % 4 == 0 else "around", "reason" if said else "mesh"] += 1
        if not said:
            meshes.append(
                (
                    outcome["worst quality"],
                    outcome["min scaled jacobian"],
                    outcome["mean quality"],
                    outcome["cells"],
                    seconds,
                    number,
                )
            )
            continue
        reasons[outcome.split(" ")[0].rstrip(":")] += 1
        if not refused_before_meshing(number, seed):
            print(number, outcome, f"{seconds:.1f} s", flush=True)
    print({" ".join(kind): number for kind, number in kinds.items()})
    print("reasons:", dict(reasons.most_common()))
    table(np.array(sorted(meshes)))


def table(meshes):
    """How good the meshes are."""
    counts, _ = np.histogram(meshes[:, 0], BINS)
    print(
        "worst shape quality:",
        ", ".join(
            f"{low} to {high}: {n}" for low, high, n in zip(BINS, BINS[1:], counts, strict=False)
        ),
    )
    print(
        f"smallest scaled Jacobian {meshes[:, 1].min():.3f}; seconds: median "
        f"{np.median(meshes[:, 4]):.1f}, most {meshes[:, 4].max():.1f}"
    )
    print("worst meshes:\n  set  shape  Jacobian  mean shape  cells")
    for shape, jacobian, mean, cells, _, number in meshes[:WORST]:
        print(f"{number:5.0f}  {shape:.3f}  {jacobian:8.3f}  {mean:10.3f}  {cells:5.0f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

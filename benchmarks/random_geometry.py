"""Two hundred random wedge sectors: each gives a valid mesh or one sentence that names the parameter to change.

A quarter is drawn anywhere in the documented ranges, the rest within a factor exp(+-0.25) of the defaults (there the
shank is cut to the length of disc and platform, else half of the sets would fall to this one rule). The meshes are
coarse, and made in a process of their own, so that a crash of the interpreter would be counted and not suffered.

    python benchmarks/random_geometry.py [count] [seed]
"""

import multiprocessing as mp
import sys
import time
from collections import Counter
from dataclasses import replace

import numpy as np

from bladefem.errors import InputError
from geometry.parameters import Aerofoil, Disc, MeshSize, Platform, Shank, Wedge
from geometry.sampling import anywhere, around
from geometry.sector import wedge_sector

TABLES = (Aerofoil, Platform, Shank, Disc, Wedge)
LIMIT = 120         # seconds for one mesh


def parameters(number, seed):
    """Five tables; every fourth set comes from the whole ranges."""
    rng = np.random.default_rng((seed, number))
    if number % 4 == 0:
        return [anywhere(t, rng) for t in TABLES]
    aerofoil, platform, shank, disc, wedge = (around(t(), rng, 0.25) for t in TABLES)
    return [aerofoil, platform, replace(shank, length=min(shank.length, disc.width, platform.length)), disc, wedge]


def attempt(number, seed):
    """"mesh", or the reason of the refusal, with seconds, worst Jacobian and shape."""
    tables = parameters(number, seed)
    start = time.perf_counter()
    thin = min(tables[0].thickness_tip * tables[0].chord_tip, tables[1].thickness, tables[2].width)
    try:
        mesh = wedge_sector(*tables, MeshSize(size=max(1.5 * thin, tables[0].span / 40)))
    except InputError as error:
        return str(error), time.perf_counter() - start, np.nan, np.nan
    return "mesh", time.perf_counter() - start, mesh.report["min scaled jacobian"], mesh.report["worst quality"]


def serve(connection, seed):
    """Answer one number after the other."""
    while True:
        connection.send(attempt(connection.recv(), seed))


def start(seed):
    """A fresh process and the pipe to it."""
    here, there = mp.Pipe()
    process = mp.get_context("spawn").Process(target=serve, args=(there, seed), daemon=True)
    process.start()
    there.close()
    return process, here


def main(count=200, seed=1):
    """Run all, print the counts, the slowest, and every reason that does not name a field."""
    process, pipe = start(seed)
    kinds, reasons, rows = Counter(), Counter(), []
    for number in range(count):
        pipe.send(number)
        try:
            answer = pipe.recv() if pipe.poll(LIMIT) else ("too slow", LIMIT, np.nan, np.nan)
        except EOFError:
            answer = ("crash", np.nan, np.nan, np.nan)
        if answer[0] in ("too slow", "crash"):
            process.kill()
            process, pipe = start(seed)
        kind = answer[0] if answer[0] in ("mesh", "too slow", "crash") else "reason"
        kinds[kind, "anywhere" if number % 4 == 0 else "around"] += 1
        rows.append((number, *answer))
        if kind == "reason":
            reasons[answer[0].split(" ")[0].rstrip(":")] += 1
        if kind in ("too slow", "crash") or "gmsh" in answer[0] or "\n" in answer[0]:
            print(number, answer[0], f"{answer[1]:.1f} s", flush=True)
    process.kill()
    meshes = [r for r in rows if r[1] == "mesh"]
    print(dict(kinds), flush=True)
    print(dict(reasons))
    if meshes:
        print(f"meshes: slowest {max(r[2] for r in meshes):.1f} s, median {np.median([r[2] for r in meshes]):.1f} s, "
              f"smallest scaled Jacobian {min(r[3] for r in meshes):.3f}, worst shape {min(r[4] for r in meshes):.4f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

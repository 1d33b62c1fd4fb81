"""Speed and agreement against pyHarm (Safran, pyharm-os on PyPI): the same matrices, frequencies,
harmonics, samples.

    python -m venv pyharm && pyharm/bin/pip install -r benchmarks/pyharm-requirements.txt
    python benchmarks/hbm_pyharm.py pyharm/bin/python [names of problems]

Both codes solve every frequency, started from the last one, in CPU seconds of one thread (set
OMP_NUM_THREADS=1). The error of the first harmonic at the probe is measured against bladefem with
15 harmonics and 4096 samples.

pyHarm's only element with friction under varying normal load is three-dimensional: the chain gives
it a third, idle direction, 72 dofs in place of 48. That is its best way to this problem, yet not
like for like.

Measured on two busy cores, ms a solved point, and the error at the points that both solved:

                           bladefem   pyHarm   ratio      solved       error     pyHarm     MB
    single mass                0.05      3.6      70   61  61/61     2.6e-04    2.6e-04    191   302
    beam                       0.04      102    2300   31  31/31     6.1e-05    6.1e-05    191   350
    chain                      5.0       865     174   31  31/31     3.1e-05    3.1e-05    183   529
    chain with lift-off       36       14608     411   31  15/31     5.7e-05    2.8e-01    194   548
    3-D patch                199      112108     563    4    4/4     3.8e-05    2.3e-01    224  2202

H 7 and 256 samples; the patch H 5 and 128. Lost points count in the time. Where contacts lift off
some points that pyHarm accepts are far from the reference: other motions, or its coarse residual. A
dense Newton step of the patch has 24 GFlop, 0.5 s at the machine's limit.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from hbm_models import PROBLEMS, Problem

from bladefem.hbm.solve import solve

RUNS = {
    "single mass": (7, 256, 61),
    "beam": (7, 256, 31),  # harmonics, samples, frequencies
    "chain": (7, 256, 31),
    "chain with lift-off": (7, 256, 31),
    "3-D patch": (5, 128, 4),
}


def write(problem: Problem, omegas: np.ndarray, H: int, samples: int, path: Path) -> None:
    """The problem as pyHarm's half reads it: contacts are dofs of their own, three a node in the
    order normal, t1, t2.

    Its normal displacement opens the contact, so those dofs change sign; the chain's missing second
    tangent becomes a mass at rest. Its 3-D elements run in single precision and cannot meet 1e-8:
    they are let off at 1e-5 of the force.
    """
    e = problem.elements
    tangential = len(problem.contact) == len(e.kt)
    matrices, load = [problem.M, problem.C, problem.K], problem.load
    if not tangential:
        directions = 1 + e.tangents
        count = len(problem.M) // directions
        place = (3 * np.arange(count)[:, None] + np.arange(directions)).ravel()
        signs = np.tile([-1.0, 1.0, 1.0], count)
        full = []
        for matrix, idle in zip(matrices, (1.0, 0.02, 1.0), strict=True):
            wide = idle * np.eye(3 * count)
            wide[np.ix_(place, place)] = matrix
            full.append(signs[:, None] * wide * signs)
        matrices, load = full, int(place[load])
    first = np.argmax(problem.contact, axis=1)[:: 1 if tangential else directions] // (
        1 if tangential else directions
    )
    np.savez(
        path,
        M=matrices[0],
        C=matrices[1],
        K=matrices[2],
        load=load,
        force=problem.force,
        nodes=first,
        directions=1 if tangential else 3,
        kt=e.kt,
        kn=e.kn,
        mu=e.mu,
        n0=e.n0,
        H=H,
        samples=samples,
        omegas=omegas,
        tolerance=1e-8 if tangential else 1e-5 * problem.force,
    )


def ours(
    problem: Problem, omegas: np.ndarray, H: int, samples: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Amplitudes, converged, CPU seconds."""
    model, last, rows = problem.model, None, []
    solve(model, omegas[0], H, samples)  # compiled, or read from the cache
    for omega in omegas:
        begin = time.process_time()
        last = solve(model, omega, H, samples, start=last)
        rows.append((last.probe[1, 0], last.converged, time.process_time() - begin))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


def main(python: str, *names: str) -> None:
    print(
        f"{'problem':22s} {'ms/point':>9s} {'pyHarm':>9s} {'ratio':>6s} {'solved':>9s} "
        f"{'pyHarm':>9s} {'error':>8s} {'pyHarm':>8s} {'MB':>5s} {'pyHarm':>6s}"
    )
    for name in names or PROBLEMS:
        problem, (H, samples, count) = PROBLEMS[name](), RUNS[name]
        omegas = np.linspace(*problem.band, count)
        with tempfile.TemporaryDirectory() as folder:
            write(problem, omegas, H, samples, Path(folder) / "problem.npz")
            script = Path(__file__).with_name("hbm_pyharm_side.py")
            subprocess.run([python, script, "problem.npz", "result.npz"], cwd=folder, check=True)
            with np.load(Path(folder) / "result.npz") as archive:
                theirs = dict(archive)
        amplitude, converged, seconds = ours(problem, omegas, H, samples)
        fine = H if problem.elements.tangents == 2 else 15
        exact = np.array(
            [solve(problem.model, w, fine, 1024 if fine == H else 4096).probe[1, 0] for w in omegas]
        )
        good = converged & theirs["converged"]
        errors = [
            np.max(abs(a - exact)[good], initial=0) / abs(exact).max()
            for a in (amplitude, theirs["amplitude"])
        ]
        # time of all points, lost ones too, over those that were solved
        pairs = (seconds, converged), (theirs["seconds"], theirs["converged"])
        mine, other = (
            spent.sum() / solved.sum() if solved.any() else np.nan for spent, solved in pairs
        )
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{name:22s} {mine * 1e3:9.2f} {other * 1e3:9.1f} {other / mine:6.0f} "
            f"{converged.sum():5d}/{count:<3d} {theirs['converged'].sum():5d}/{count:<3d} "
            f"{errors[0]:8.1e} {errors[1]:8.1e} {memory:5.0f} {float(theirs['memory']):6.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main(*sys.argv[1:])

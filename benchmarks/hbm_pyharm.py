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

Where contacts lift off it does not solve the same problem. Its Penalty3D (pyharm-os 1.2.2) counts
the normal force from the preload N0 and sets the change to zero where the gap is open: an open
contact presses with N0 again, and rubs with mu N0. Results of the two codes then differ, and only
"chain with lift-off" below is left as an example of it; the patch is pressed so that nothing lifts.

Measured in one run on two busy cores, mean CPU ms of the points that each code solved, of those
that it lost, and the error of the first harmonic at the points that both solved:

                         solved  pyHarm   ms solved    pyHarm  ratio  lost     error    pyHarm
    single mass           61/61   61/61        0.06       5.9    100         2.6e-04   2.6e-04
    beam                  31/31   31/31        0.09      94.1   1059         6.1e-05   6.1e-05
    chain                 31/31   31/31        2.15     860.9    401         3.1e-05   3.1e-05
    3-D patch, pressed      1/1     1/1      145.99   80940.6    554         1.1e-04   6.0e-04
    chain with lift-off   11/11    6/11      108.72    3179.7     29  12545  5.7e-05   1.6e-01

Memory of bladefem 204 to 268 MB, of pyHarm 353 to 2195. H 7 and 256 samples; the patch H 5 and 128.
In the last row bladefem's mean is that of all points, those that pyHarm lost included. A dense
Newton step of the patch has 24 GFlop, 0.5 s at the machine's limit.
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

# harmonics, samples, frequencies
RUNS = {
    "single mass": (7, 256, 61),
    "beam": (7, 256, 31),
    "chain": (7, 256, 31),
    "3-D patch, pressed": (5, 128, 1),
    "chain with lift-off": (7, 256, 11),
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


def ours(problem: Problem, omegas: np.ndarray, H: int, samples: int) -> tuple[np.ndarray, ...]:
    """Amplitudes, converged, CPU seconds, number of contacts that lift off."""
    model, last, rows = problem.model, None, []
    solve(model, omegas[0], H, samples)  # compiled, or read from the cache
    for omega in omegas:
        begin = time.process_time()
        last = solve(model, omega, H, samples, start=last)
        spent = time.process_time() - begin
        lifting = last.states["lift"] + last.states["open"]
        rows.append((last.probe[1, 0], last.converged, spent, lifting))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


def solved_apart(seconds: np.ndarray, converged: np.ndarray) -> tuple[float, float]:
    """CPU seconds of a point that was solved, and of one that was lost; NaN where there is none."""
    return tuple(
        float(seconds[of].mean()) if of.any() else np.nan for of in (converged, ~converged)
    )


def main(python: str, *names: str) -> None:
    print(
        f"{'problem':20s} {'solved':>8s} {'pyHarm':>8s} {'ms solved':>10s} {'pyHarm':>9s} "
        f"{'ratio':>6s} {'ms lost':>8s} {'pyHarm':>9s} {'error':>8s} {'pyHarm':>8s} {'MB':>5s} "
        f"{'pyHarm':>6s}  lifting"
    )
    for name in names or RUNS:
        problem, (H, samples, count) = PROBLEMS[name](), RUNS[name]
        omegas = np.linspace(*problem.band, count)
        with tempfile.TemporaryDirectory() as folder:
            write(problem, omegas, H, samples, Path(folder) / "problem.npz")
            script = Path(__file__).with_name("hbm_pyharm_side.py")
            subprocess.run([python, script, "problem.npz", "result.npz"], cwd=folder, check=True)
            with np.load(Path(folder) / "result.npz") as archive:
                theirs = dict(archive)
        amplitude, converged, seconds, lifting = ours(problem, omegas, H, samples)
        fine = H if problem.elements.tangents == 2 else 15
        exact = np.array(
            [solve(problem.model, w, fine, 1024 if fine == H else 4096).probe[1, 0] for w in omegas]
        )
        good = converged & theirs["converged"]
        errors = [
            np.max(abs(a - exact)[good], initial=0) / abs(exact).max()
            for a in (amplitude, theirs["amplitude"])
        ]
        (mine, lost), (other, other_lost) = (
            solved_apart(*pair)
            for pair in ((seconds, converged), (theirs["seconds"], theirs["converged"]))
        )
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        solved = f"{converged.sum():4d}/{count:<3d} {theirs['converged'].sum():4d}/{count:<3d}"
        print(
            f"{name:20s} {solved} {mine * 1e3:10.2f} {other * 1e3:9.1f} {other / mine:6.0f} "
            f"{lost * 1e3:8.2f} {other_lost * 1e3:9.1f} {errors[0]:8.1e} {errors[1]:8.1e} "
            f"{memory:5.0f} {float(theirs['memory']):6.0f}  {lifting.max()}",
            flush=True,
        )


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Speed of quasi-static contact: complementarity solver, new load states, compliance with many
right-hand sides.

    PYTHONPATH=. python benchmarks/contact_speed.py

Recorded in processor time on a shared two-core machine with four to nine other jobs running,
one thread; "idle" are runs of the same code alone on the machine:

    complementarity, 484 nodes (232 pressed):
        cold 1.4 ms, warm 1.1 ms; one Cholesky factor of all nodes 1.5 ms
    complementarity, 2025 nodes (949 pressed):
        cold 55 ms, warm 51 ms; one Cholesky factor of all nodes 87 ms
    wedge sector, 63069 dofs, 90 contact nodes:
        condensed in 2.7 s, then a load state costs 0.89 ms, warm 0.39 ms
    compliance, 146520 dofs (blade's proportions), 1000 right-hand sides:
        factor 7.3 s, contact ports 20.8 s (12.4 s idle), dense columns 21.8 s of CPU
    compliance, 156816 dofs (block), 1000 right-hand sides:
        factor 22.8 s, contact ports 30.2 s (21.0 s idle), dense columns 35.1 s of CPU

The factor is not part of the right-hand sides: modes and reduction need it, too. A blade is within
25 s for 1000 of them on a busy machine; a block only on an idle one, since sweeps over its wide
fronts wait for memory.

Contact ports are sparse: MUMPS leaves out the parts of the first sweep that they do not reach. A
Schur complement of [[K, P], [P^T, 0]] on the ports, which saves the second sweep, was tried: 15 s
instead of 8 + 12 s for the blade, but 60 instead of 25 + 21 s for the block, since MUMPS orders
worse around the ports and their rows travel to the last front.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / name) for name in ("contact", "fem")]

import test_complementarity as half_space  # noqa: E402
from structured import box  # noqa: E402

from bladefem.contact.complementarity import solve_lcp  # noqa: E402
from bladefem.contact.patch import make_patch  # noqa: E402
from bladefem.contact.seating import contact_problem, solve_seating  # noqa: E402
from bladefem.fem.body import assemble  # noqa: E402
from bladefem.fem.constraint import constrain, restrict_load  # noqa: E402
from bladefem.fem.flexibility import compliance, flexible  # noqa: E402
from bladefem.scene.tables import Material, Scene  # noqa: E402
from geometry.isolated_process import build_isolated  # noqa: E402


def best(call, repeats=5):
    """Shortest processor time [ms] and the last result."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        out = call()
        times.append(1e3 * (time.process_time() - start))
    return min(times), out


def lcp():
    for n in (22, 45):
        C, g0, R, _, _ = half_space.sphere(n)
        load = np.array([-half_space.FORCE])
        cold, s = best(lambda: solve_lcp(C, g0, R, load))  # noqa: B023
        warm, w = best(lambda: solve_lcp(C, g0, R, 1.05 * load, start=s.active))  # noqa: B023
        gemm, _ = best(lambda: np.linalg.cholesky(C))  # noqa: B023
        print(
            f"complementarity, {n * n} nodes ({s.active.sum()} pressed): cold {cold:.1f} ms in "
            f"{s.iterations} steps, warm {warm:.1f} ms in {w.iterations}; one Cholesky factor of "
            f"all nodes {gemm:.1f} ms",
            flush=True,
        )


def states():
    mesh = build_isolated(Scene())
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    blade = flexible(constrain(assemble(mesh, "blade", Material()), "clamp", 0))
    damper = flexible(constrain(assemble(mesh, "damper", Material()), None))
    start = time.perf_counter()
    problem = contact_problem(mesh, patches, blade, damper)
    condensing = time.perf_counter() - start
    cold, maps = best(lambda: solve_seating(problem, 838.0, normal=200.0))
    warm, _ = best(lambda: solve_seating(problem, 838.0, normal=210.0, start=maps))
    print(
        f"wedge sector, {len(mesh.points) * 3} dofs, {len(problem.clearance)} contact nodes: "
        f"condensed in {condensing:.1f} s, then a load state costs {cold:.2f} ms, warm {warm:.2f} "
        "ms",
        flush=True,
    )


def right_hand_sides(divisions, size, count=1000):
    """CPU of ``count`` columns: normal ports of the upper face (means over nine nodes), and dense
    random columns.
    """
    mesh = box(divisions, size, "tetra10")
    con = constrain(assemble(mesh, "blade", Material()), "clamp")
    start = time.process_time()
    flex = flexible(con)
    factor = time.process_time() - start
    top = np.flatnonzero(np.isclose(mesh.points[:, 2], size[2]))
    centres = top[np.linspace(0, len(top) - 1, count).astype(int)]
    near = top[cKDTree(mesh.points[top]).query(mesh.points[centres], 9)[1]]
    ports = sp.csc_matrix(
        (np.full(near.size, 1 / 9), (3 * near.ravel() + 2, np.repeat(np.arange(count), 9))),
        shape=(3 * len(mesh.points), count),
    )
    spent = []
    for columns in (
        restrict_load(con, ports),
        np.random.default_rng(0).standard_normal((con.own.stop, count)),
    ):
        start = time.process_time()
        compliance(flex, columns)
        spent.append(time.process_time() - start)
    print(
        f"compliance, {con.own.stop} dofs, {count} right-hand sides: factor {factor:.1f} s, "
        f"contact ports {spent[0]:.1f} s, dense columns {spent[1]:.1f} s of CPU",
        flush=True,
    )


if __name__ == "__main__":
    lcp()
    states()
    right_hand_sides((60, 18, 5), (0.15, 0.045, 0.0125))  # a blade's proportions
    right_hand_sides((24, 16, 16), (0.06, 0.04, 0.04))  # a block: wider fronts, the worst shape

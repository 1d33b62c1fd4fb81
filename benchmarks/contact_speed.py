"""Speed of quasi-static contact: complementarity solver, new load states, compliance with many right-hand sides.

    PYTHONPATH=. python benchmarks/contact_speed.py

Recorded on a shared two-core machine under other load, one thread (trust ratios):

    complementarity, 484 nodes (232 pressed): cold 1.7 ms in 2 steps; one Cholesky factor of all nodes 1.8 ms
    complementarity, 2025 nodes (949 pressed): cold 55 ms in 3 steps; one Cholesky factor of all nodes 95 ms
    wedge sector, 64875 dofs, 90 contact nodes: condensed in 6.6 s, then a load state costs 0.86 ms, warm 0.38 ms
    compliance, 146520 dofs (blade's proportions), 200 right-hand sides: factor 10.5 s, solves 6.4 s of CPU
    compliance, 156816 dofs (block), 1000 right-hand sides: factor 28.7 s, solves 53 s of CPU
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / name) for name in ("contact", "fem")]

import test_lcp as half_space  # noqa: E402
from structured import box  # noqa: E402

from bladefem.contact.lcp import solve_lcp  # noqa: E402
from bladefem.contact.patch import make_patch  # noqa: E402
from bladefem.contact.seat import contact_problem, solve  # noqa: E402
from bladefem.fem.body import assemble  # noqa: E402
from bladefem.fem.constraint import constrain  # noqa: E402
from bladefem.fem.flexibility import compliance, flexible  # noqa: E402
from bladefem.scene import Material, Scene  # noqa: E402
from geometry import build  # noqa: E402


def best(call, repeats=5):
    """Shortest wall time [ms] and the last result."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        out = call()
        times.append(1e3 * (time.perf_counter() - start))
    return min(times), out


def lcp():
    for n in (22, 45):
        C, g0, R, _, _ = half_space.sphere(n)
        load = np.array([-half_space.FORCE])
        cold, s = best(lambda: solve_lcp(C, g0, R, load))                               # noqa: B023
        warm, w = best(lambda: solve_lcp(C, g0, R, 1.05 * load, start=s.active))        # noqa: B023
        gemm, _ = best(lambda: np.linalg.cholesky(C))                                   # noqa: B023
        print(f"complementarity, {n * n} nodes ({s.active.sum()} pressed): cold {cold:.1f} ms in {s.iterations} steps, "
              f"warm {warm:.1f} ms in {w.iterations}; one Cholesky factor of all nodes {gemm:.1f} ms", flush=True)


def states():
    mesh = build(Scene())
    patches = [make_patch(mesh, name) for name in ("this", "next")]
    blade = flexible(constrain(assemble(mesh, "blade", Material()), "clamp", 0))
    damper = flexible(constrain(assemble(mesh, "damper", Material()), None))
    start = time.perf_counter()
    problem = contact_problem(mesh, patches, blade, damper)
    condensing = time.perf_counter() - start
    cold, maps = best(lambda: solve(problem, 838.0, normal=200.0))
    warm, _ = best(lambda: solve(problem, 838.0, normal=210.0, start=maps))
    print(f"wedge sector, {len(mesh.points) * 3} dofs, {len(problem.clearance)} contact nodes: condensed in "
          f"{condensing:.1f} s, then a load state costs {cold:.2f} ms, warm {warm:.2f} ms", flush=True)


def right_hand_sides(divisions, size, count=1000):
    body = assemble(box(divisions, size, "tetra10"), "blade", Material())
    start = time.process_time()
    flex = flexible(constrain(body, "clamp"))
    factor = time.process_time() - start
    B = np.random.default_rng(0).standard_normal((flex.con.own.stop, count))
    start = time.process_time()
    compliance(flex, B)
    print(f"compliance, {B.shape[0]} dofs, {count} right-hand sides: factor {factor:.1f} s, "
          f"solves {time.process_time() - start:.1f} s of CPU", flush=True)


if __name__ == "__main__":
    lcp()
    states()
    right_hand_sides((60, 18, 5), (0.15, 0.045, 0.0125), 200)   # a blade's proportions
    right_hand_sides((24, 16, 16), (0.06, 0.04, 0.04))          # a block: wider fronts, the worst shape

# %% [markdown]
# # Seating the damper: where does the wedge press, and how hard?
#
# The wedge floats between two platforms and is thrown outwards by its centrifugal force $F = m r \Omega^2$. Both seats
# carry normal forces $f_i \ge 0$ at the contact nodes, gaps $g_i \ge 0$ stay open, and never both:
#
# $$ g = g_0 + C f + B q \ge 0, \qquad f \ge 0, \qquad f^\mathsf{T} g = 0, \qquad B^\mathsf{T} f + F = 0 . $$
#
# $C$ is the compliance of platforms and wedge at the contact nodes, found by one factorisation; $q$ is the rigid motion
# of the wedge, held by nothing but the seats. With the flanks at $\alpha$ to the radial plane, equilibrium alone gives
# $N = F / (2 \sin\alpha)$ on each side.

# %%
import math
import os
from pathlib import Path

import numpy as np
from mpi4py import MPI

import bladefem
from bladefem.contact.seating import solve_seating
from bladefem.study.pipeline.damper_contact import contact_patches
from bladefem.util.script_help import help_and_exit

help_and_exit(__file__)

coarse = "BLADEFEM_COARSE" in os.environ
scenes = Path(__file__).resolve().parents[1] / "scenes"
scene = bladefem.load_scene(
    scenes / "wedge.toml", ["mesh.size=10 mm", "mesh.scale=1.5"] if coarse else []
)
comm = MPI.COMM_WORLD
mesh = bladefem.build_mesh(scene, comm)
problem = bladefem.seat_damper(bladefem.Bodies(scene, mesh, comm), contact_patches(mesh))

# %% [markdown]
# The condensed problem is small and dense: each new speed costs milliseconds.

# %%
speed = scene.operation.speed
maps = solve_seating(problem, speed)
pull = np.linalg.norm(problem.load[:2]) * speed**2
expected = pull / (2 * math.sin(scene.damper.angle))

# %%
if comm.rank == 0:
    for seat in maps:
        print(
            f"{seat.patch.seat} seat: {seat.force.sum():.4f} N, {np.count_nonzero(seat.force)} "
            f"of {len(seat.force)} nodes press, peak {seat.pressure.max() / 1e6:.2f} MPa"
        )
    if not coarse:
        from bladefem.view.contact import draw_pressure

        os.makedirs("runs/demos", exist_ok=True)
        draw_pressure(maps, "runs/demos/pressure.png")
        print("written: runs/demos/pressure.png")
    print(f"normal force over F / (2 sin alpha): {maps[0].force.sum() / expected:.6g}")

# %% [markdown]
# # One sector represents the wheel: modes by nodal diameter
#
# In a tuned wheel of $N$ blades every mode has a nodal diameter $n$: the next blade moves as this one does, turned by
# $2\pi/N$ and shifted in phase by $n\,2\pi/N$. One sector with
#
# $$ u_\text{high} = e^{\,\mathrm{j} n 2\pi/N} R\, u_\text{low} $$
#
# on its two cut faces therefore holds all modes of the wheel. With three real matrices built once,
#
# $$ K(n) = K_0 + \cos\!\left(n\tfrac{2\pi}{N}\right) K_c + \mathrm{j} \sin\!\left(n\tfrac{2\pi}{N}\right) K_s . $$
#
# Few diameters are solved; their modes span the others, each of which is certified by its residual.

# %%
import os
from pathlib import Path

from mpi4py import MPI

import bladefem
from bladefem.util.script_help import help_and_exit

help_and_exit(__file__)

coarse = "BLADEFEM_COARSE" in os.environ
scenes = Path(__file__).resolve().parents[1] / "scenes"
scene = bladefem.load_scene(
    scenes / "wedge.toml", ["mesh.size=10 mm", "mesh.scale=1.5"] if coarse else []
)
comm = MPI.COMM_WORLD
mesh = bladefem.build_mesh(scene, comm)
bodies = bladefem.Bodies(scene, mesh, comm)
diameters = [0, 4, 9, 18] if coarse else list(range(scene.disc.sectors // 2 + 1))
sets = bladefem.find_modes(bodies, diameters, count=4)

# %% [markdown]
# Disc-dominated families climb with $n$; blade-dominated ones stay flat. Where two meet they veer.

# %%
if comm.rank == 0:
    print("nodal diameter, frequencies [Hz], largest residual")
    for s in sets:
        print(
            f"{s.nodal_diameter:2d}",
            " ".join(f"{f:10.3f}" for f in s.frequencies),
            f"residual {s.residuals.max():.1e}",
        )
    excited = next(s for s in sets if s.nodal_diameter == scene.excitation.engine_order)
    from bladefem.report.mode_table import mode_table
    from bladefem.view.modes import draw_wheel_mode
    from bladefem.view.speed import draw_nodal_diameters

    os.makedirs("runs/demos", exist_ok=True)
    draw_nodal_diameters(mode_table(sets, mesh), "runs/demos/nodal_diameters.png")
    draw_wheel_mode(mesh, excited, 0, "runs/demos/wheel_mode.png")
    print("written: runs/demos/nodal_diameters.png, runs/demos/wheel_mode.png")
    print(
        f"first frequency of nodal diameter {excited.nodal_diameter} [Hz]: "
        f"{excited.frequencies[0]:.2f}"
    )

# %% [markdown]
# # Changing the geometry
#
# Every parameter of a scene has a name, a unit and a range; `bladefem check scenes/wedge.toml` lists them. A varied
# scene is a new scene, checked as the first one was. Here the shank, the neck between disc and platform, is made
# narrower and wider, and the first frequency follows.

# %%
import os
from pathlib import Path

from mpi4py import MPI

import bladefem
from bladefem.util.script_help import help_and_exit

help_and_exit(__file__)

coarse = "BLADEFEM_COARSE" in os.environ
scenes = Path(__file__).resolve().parents[1] / "scenes"
base = bladefem.load_scene(
    scenes / "wedge.toml",
    ["mesh.size=10 mm", "mesh.scale=1.5"] if coarse else ["mesh.size=6 mm"],
)
comm = MPI.COMM_WORLD
frequencies = {}
for width in ("8 mm", "10 mm", "12 mm"):
    scene = bladefem.vary(base, "shank.width", width)
    bodies = bladefem.Bodies(scene, bladefem.build_mesh(scene, comm), comm)
    frequencies[width] = bladefem.find_modes(bodies, [9], count=1)[0].frequencies[0]

# %% [markdown]
# The bending stiffness of the shank grows with the cube of its width: alone, with the same mass on top, it would raise the
# frequency by $(12/8)^{3/2} = 1.84$. The aerofoil bends as well, and its stiffness stays, so that the frequency grows less.

# %%
if comm.rank == 0:
    for width, f in frequencies.items():
        print(f"shank.width = {width}: first frequency of nodal diameter 9 = {f:.3f} Hz")
    print(f"frequency ratio 12 mm over 8 mm: {frequencies['12 mm'] / frequencies['8 mm']:.4f}")

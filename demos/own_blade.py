# %% [markdown]
# # Your CAD blade, our damper
#
# A CAD system hands over one sector of the wheel as a STEP file: bore to tip, no damper, faces without names. Here
# `scenes/own_blade.step` plays that part; this script drew it with the parametric sector, and draws it again when it
# is run with `REMAKE` set. `bladefem look scenes/own_blade.step` shows which face has which number.

# %%
import os
from pathlib import Path

from mpi4py import MPI

import bladefem
from bladefem.study.pipeline.pipeline import run
from bladefem.util.script_help import help_and_exit

help_and_exit(__file__)

coarse = "BLADEFEM_COARSE" in os.environ
scenes = Path(__file__).resolve().parents[1] / "scenes"
if "REMAKE" in os.environ:
    from geometry.example_step import write_blade_step

    drawn = bladefem.load_scene(
        scenes / "wedge.toml",
        ["aerofoil.span=110 mm", "aerofoil.twist=15 deg", "damper.angle=60 deg"],
    )
    blade = (drawn.aerofoil, drawn.platform, drawn.shank, drawn.disc)
    parts = (*blade, drawn.damper, drawn.root, drawn.shroud)
    write_blade_step(scenes / "own_blade.step", *parts)

# %% [markdown]
# The scene names the two inclined undersides of the platform, first the one towards the next blade. Between it and the
# next blade's other one the damper is drawn, and seats that match its flanks are cut into both. Its angles are those of
# the platforms; `damper.length` and `imported.seat_width` say how much of them it covers.

# %%
scene = bladefem.load_scene(
    scenes / "own_blade.toml", ["mesh.size=12 mm"] if coarse else ["mesh.size=8 mm"]
)
comm = MPI.COMM_WORLD
result = run(scene, None, until="contact", comm=comm)
if comm.rank == 0:
    for name, pair in result.mesh.pairs.items():
        print(f"pair {name}: {pair.nodes.shape[1]} matched nodes")
    print(f"load of a seat by the damper's own mass [N]: {result.contact.own:.3f}")
    print(f"damper's mass [g]: {1e3 * result.contact.problem.mass:.4g}")

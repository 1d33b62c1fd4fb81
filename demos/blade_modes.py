# %% [markdown]
# # Natural modes of a twisted blade
#
# Free vibration of an elastic body clamped at its root: find $\omega$ and $u \neq 0$ with
#
# $$ \int_\Omega \sigma(u) : \varepsilon(v)\,\mathrm{d}x = \omega^2 \int_\Omega \rho\, u \cdot v\,\mathrm{d}x
#    \qquad \text{for all } v \text{ that vanish at the root.} $$
#
# Quadratic tetrahedra carry the displacement: linear ones would be far too stiff in bending. A scene file holds the
# geometry; here its sector is held at the bore of the disc and its cut faces are left free, which is not a wheel yet
# (see `sector_modes.py`) but shows the blade's own families: flap, edge, torsion.

# %%
import os
from pathlib import Path

from mpi4py import MPI

import bladefem
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.study.modes.comparison import family_table
from bladefem.util.script_help import help_and_exit

help_and_exit(__file__)

coarse = "BLADEFEM_COARSE" in os.environ
scenes = Path(__file__).resolve().parents[1] / "scenes"
scene = bladefem.load_scene(
    scenes / "wedge.toml", ["mesh.size=10 mm", "mesh.scale=1.5"] if coarse else []
)
comm = MPI.COMM_WORLD
mesh = bladefem.build_mesh(scene, comm)

# %% [markdown]
# `Bodies` assembles and factorises what is asked for, once; here the blade at rest. The mesh is distributed over the
# ranks; frequencies and shapes come back the same on every rank.

# %%
bodies = bladefem.Bodies(scene, mesh, comm)
found = modes(constrain(bodies.still_blade), 6)

# %% [markdown]
# The families are named by comparing the motion of the aerofoil with pure bending and twisting (MAC, modal assurance
# criterion: 1 where both are alike). A mode is called coupled where another mode resembles the same pure motion more. The
# aerofoil's share is its part of the squared displacements, integrated over the body.

# %%
if comm.rank == 0:
    names = {
        "frequency": "frequency [Hz]",
        "mac": "MAC",
        "aerofoil_share": "aerofoil's share",
    }
    print(
        family_table(found, mesh).rename(columns=names).to_string(index=False, float_format="%.5g")
    )
    if not coarse:
        from bladefem.view.modes import draw_mode_sheet, save_modes_vtu

        os.makedirs("runs/demos", exist_ok=True)
        draw_mode_sheet(mesh, found, "runs/demos/blade_modes.png")
        save_modes_vtu(mesh, found, "runs/demos/blade_modes.vtu")
        print("written: runs/demos/blade_modes.png, runs/demos/blade_modes.vtu")
    print(f"first natural frequency [Hz]: {found.frequencies[0]:.2f}")

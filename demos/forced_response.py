# %% [markdown]
# # Forced response with the damper
#
# The gas excites the wheel with engine order $EO$; harmonic $h$ of the response moves in nodal diameter
# $h\,EO \bmod N$. Blade and damper are reduced to flexibilities $G_h(\omega)$ at the contact nodes, friction acts
# between them, and the balance of harmonics is solved for the relative displacements $w_h$,
#
# $$ w_h - w_{\text{free},h} + G_h(\omega)\, f_h(w) = 0, \qquad h = 0, 1, \dots, H, $$
#
# by Newton's method with the analytic derivative. $f$ is the force of node-to-node elements: stick with stiffness
# $k_t$, slip at $\mu N(t)$, and nothing while the contact is open.

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
small = [
    "mesh.size=10 mm",
    "mesh.scale=1.5",
    "contact.points=6",
    "study.loads=90 N, 200 N",
    "study.own_load=false",
    "study.stability=false",
    "study.influences=false",
    "model.nodal_diameters=0, 9",
    "model.modes=10",
    "model.harmonics=1",
    "model.samples=64",
    "model.damper=rigid",
    "accuracy=5 %",
]
scene = bladefem.load_scene(scenes / "wedge.toml", small if coarse else [])
comm = MPI.COMM_WORLD
result = run(scene, None if coarse else "runs/demos/forced_response", comm=comm)

# %% [markdown]
# A light load slides and dissipates little, a heavy load sticks and dissipates nothing: between them lies the optimum. A
# search looks for it, and it is studied like the loads that were given.

# %%
frequency, undamped = result.response.free_peak
if comm.rank == 0:
    print(f"no damper: {frequency:9.3f} Hz {1e6 * undamped:9.2f} um")
    for c in result.response.curves:
        print(
            f"{c.load:6.0f} N: {c.peak_frequency:12.3f} Hz {1e6 * c.peak_amplitude:9.2f} um, "
            f"{len(c.frequency)} points, {int((~c.converged).sum())} not converged, estimated "
            f"error {100 * c.error:.2g} %"
        )
    best = result.response.curves[result.response.best_curve]
    print(f"resonance amplitude at the best load [um]: {1e6 * best.peak_amplitude:.4g}")

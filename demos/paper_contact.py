# %% [markdown]
# # A flat punch: the paper's Sect. 3.2, Fig. 5 and 6
#
# A rigid round punch of radius $a$ presses on an elastic block. Johnson's solution for the half space, in terms of the
# whole force $P$ (the paper's Eq. 24 means by $P$ the force for each unit of length, $p_0 a$):
#
# $$ p(r) = \frac{P}{2\pi a\sqrt{a^2 - r^2}}, \qquad u_z = \frac{P (1 - \nu^2)}{2 a E}. $$

# %%
import os
from pathlib import Path

import numpy as np
from mpi4py import MPI

import bladefem
from bladefem.study.kinds.punch import (
    indent_punch,
    johnson_approach,
    johnson_pressure,
    ring_stiffness,
    spring_tilt,
)
from bladefem.util.script_help import help_and_exit
from verification.paper.view_contact import draw_punch

help_and_exit(__file__)

coarse, comm = "BLADEFEM_COARSE" in os.environ, MPI.COMM_WORLD
scenes = Path(__file__).resolve().parents[1] / "scenes"
scene = bladefem.load_scene(scenes / "punch.toml", ["mesh.contact_size=0.4 mm"] if coarse else [])
found = indent_punch(scene, comm)  # finite elements on all ranks, a quarter of block and punch
if comm.rank:
    raise SystemExit

# %%
a, block = scene.punch.radius, scene.material.blade
inner = found.radius < 0.8 * a
area, exact = found.patch.area[inner], johnson_pressure(found.radius[inner], a, found.total)
error = np.sqrt(area @ (found.pressure[inner] - exact) ** 2 / (area @ exact**2))
approach = found.approach / johnson_approach(a, found.total, block.E, block.nu)
print(
    f"{len(found.force)} nodes; pressure off by {error:.4f} (L2, r < 0.8 a), approach by "
    f"{approach - 1:+.4f}; a block of {scene.punch.half_width / a:.0f} radii is stiffer than a "
    "half space"
)

# %% [markdown]
# Eq. 25 gives springs $k_n(x)$ whose sum over the radius is $2 a E / (1 - \nu^2)$: it is the stiffness of a ring. Such
# springs reproduce this pressure and this approach exactly, whatever their number. They do not see each other, though:
# tilted by $\varphi$ the half space resists with $M = \tfrac43 a^3 E \varphi / (1 - \nu^2)$, the springs with half.

# %%
edges = np.linspace(0, 1, 11)
springs = ring_stiffness(edges * a, a, block.E, block.nu)
true = 4 / 3 * a**3 * block.E / (1 - block.nu**2)
print(
    f"load of the springs at this approach: {springs.sum() * found.approach / found.total:.4f} of "
    "the punch's"
)
tilt = spring_tilt(edges * a, a, block.E, block.nu)
print(
    f"resistance to tilting over that of a half space: springs {tilt / true:.4f}, finite elements "
    f"{found.tilt_stiffness / true:.4f}"
)
if not coarse:
    r = np.linspace(0, 0.995, 200)
    draw_punch(
        found.radius / a,
        found.pressure / (found.total / np.pi / a**2),
        4 * found.force / found.approach,
        (r, johnson_pressure(r * a, a, 1.0) * np.pi * a**2),
        (edges, springs),
        "runs/demos/paper_contact/fig_5.png",
    )

# %%
print(f"approach over that of a half space: {approach:.4f}")

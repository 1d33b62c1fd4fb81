# %% [markdown]
# # A mass on a vibrating foundation: the paper's Sect. 4, Fig. 7-11, Table 1
#
# A Z-shaped steel plate lies on a foundation that moves by $x_b = x_0 \sin 2\pi f_b t$, pressed down by a load
# $P = P_0 + P_1 \sin 2\pi f_p t$. Friction alone drives it:
#
# $$ m\ddot x = \sum_i f_{ix}, \quad m\ddot y = \sum_i f_{iy}, \quad I\ddot\theta = \sum_i (x_i f_{iy} - y_i f_{ix}), $$
#
# with $|f_i| \le \mu N_i(t)$ at each of 40 points. Sizes, motion and loads are in `scenes/zmass.toml`; the plate has
# the mass and the moment of inertia of Table 1.

# %%
import os
from fractions import Fraction
from pathlib import Path

import numpy as np
from mpi4py import MPI

import bladefem
from bladefem.damper.loops import FoundationMotion, ratio_table, spectrum, steady
from bladefem.report.zmass import draw_motions
from bladefem.scene.toml import vary
from bladefem.study.kinds.zmass import mass_on_foundation, press_mass, steady_motions
from bladefem.util.script_help import help_and_exit
from bladefem.view.paper import draw_footprint

help_and_exit(__file__)

coarse = "BLADEFEM_COARSE" in os.environ
scenes = Path(__file__).resolve().parents[1] / "scenes"
folder, comm = Path("runs/demos/paper_zmass"), MPI.COMM_WORLD
steps = 500 if coarse else 4000  # time steps a cycle of the foundation
scene = bladefem.load_scene(scenes / "zmass.toml", ["mesh.size=7 mm"] if coarse else [])

# %% [markdown]
# ## The pressure on the footprint (Fig. 8)
#
# Plate and foundation are finite elements in unilateral contact, here on all ranks together. On a rigid foundation a
# uniform load on top gives a uniform pressure below; an elastic one presses back harder at the edges. The contact is a
# receding one: its pressure keeps its shape and follows the load in proportion (Eq. 27).

# %%
seat = press_mass(scene, comm=comm).seat
skewed = vary(
    scene,
    foundation__skew=(0.5, 0.3),
    foundation__amplitude=(0.005, 0.003),
    foundation__ratios=(0.5,),
)
skew = press_mass(skewed, comm=comm).seat
if comm.rank:  # the rest is small: rank 0 does it, the others wait at the end
    raise SystemExit
body = mass_on_foundation(scene, seat)
mean = seat.force.sum() / seat.patch.area.sum()
print(
    f"{1e3 * body.mass:.2f} g, {1e6 * body.inertia:.3f}e-6 kg m^2; pressure "
    f"{seat.pressure.min() / mean:.3f} to {seat.pressure.max() / mean:.3f} of its mean at "
    f"{len(seat.force)} nodes"
)
if not coarse:
    draw_footprint(seat, body.footprint, folder / "fig_8.png")

# %% [markdown]
# ## Loops and spectra for four load frequencies
#
# Velocity and friction force become periodic; the displacement need not. The mass drifts at a steady speed unless the
# numerator of the reduced ratio $f_p/f_b$ is even, which the paper does not mention. Loops are counted as reversals
# of the slip, halved, within the smallest period of (velocity, force).

# %%
found = list(steady_motions(scene, body, steps))
results = {f"{float(d.ratio) * d.frequency:g} Hz": result for d, result in found}
for name, result in results.items():
    frequency, lines = spectrum(result)
    main = lines[np.argmin(abs(frequency - 100)), 0]
    print(
        f"load at {name:6s}: {result.loops} loops, drift {result.drift[0]:+.5f} m/s, "
        f"{1e3 * main:.4f} mm at 100 Hz, {result.reason}"
    )

# %%
if not coarse:
    draw_motions(found, folder / "fig_10.png", folder / "fig_11.png")

# %% [markdown]
# ## The rule of the denominator
#
# The paper concludes that the number of open loops equals the denominator of $f_p/f_b$ in lowest terms.

# %%
ratios = [
    Fraction(r) for r in "0 1/5 1/4 1/3 2/5 1/2 3/5 2/3 3/4 4/5 1 6/5 4/3 3/2 2 5/2 3 4 5 6".split()
]
rows = ratio_table(body, ratios, steps // 2)
print(
    f"holds for {sum(row['rule'] for row in rows)} of {len(rows)} ratios at Table 1, where m x_0 "
    f"w^2 / (mu P_0) = {0.035 * 0.005 * (200 * np.pi) ** 2 / 15:.1f}"
)

# %% [markdown]
# It is a rule for gross slip. With a smaller stroke the mass sticks for a part of the common period, slips only while
# the load is low, and the loops merge.

# %%
for stroke in (2e-3, 1.2e-3, 0.8e-3):  # m
    found = {
        r: steady(body, FoundationMotion(r, amplitude=(stroke, 0.0)), steps // 2, most=60)
        for r in ratios[1:16]
    }
    broken = {str(r): s.loops for r, s in found.items() if s.loops != r.denominator}
    print(f"stroke {1e3 * stroke:.1f} mm: {len(broken)} of {len(found)} exceptions {broken}")

# %% [markdown]
# ## Rotation and the coupled plane
#
# A point-symmetric pressure never turns the mass and never uses the coupling of the two directions. A load on top that
# grows towards one corner, on an elliptic foundation motion, does both.

# %%
_, result = next(steady_motions(skewed, mass_on_foundation(skewed, skew), steps // 2))
print(
    f"skewed: drift {result.drift[0]:+.4f}, {result.drift[1]:+.4f} m/s, turning up to "
    f"{np.abs(result.motion.velocity[:, 2]).max():.2f} rad/s, {result.loops} loops"
)

# %%
print(f"drift at 50 Hz [m/s]: {results['50 Hz'].drift[0]:.6f}")

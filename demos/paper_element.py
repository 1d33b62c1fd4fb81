# %% [markdown]
# # One friction element: the paper's Fig. 1, 3 and 4, and Eq. 29
#
# A node-to-node element carries the force $f = k_t (g - z)$ while it sticks and $f = \pm\mu N$ while it slips; the
# slider $z$ follows when the limit is reached. For a motion $g = g_0 \sin\omega t$ under constant load the loop is a
# parallelogram. The best linear force $K g + C \dot g + F_0$ in the least squares of Eq. 8 has the closed form
#
# $$ K = \frac{k_t}{\pi}\left(\theta^* - \tfrac12 \sin 2\theta^*\right), \qquad
#    \omega C = \frac{k_t}{\pi}\sin^2\theta^*, \qquad \theta^* = \arccos\left(1 - \frac{2\mu N}{k_t g_0}\right). $$

# %%
import os
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.integrate import trapezoid

from bladefem.friction.closed_form import circular_orbit_work, jenkins
from bladefem.util.script_help import help_and_exit
from bladefem.view.paper import draw_coupled_loops, draw_fit
from verification.paper.element import coupled_loop, linear_fit, printed_loop, two_slope_loop, work
from verification.paper.printed_laws import per_axis

help_and_exit(__file__)

if MPI.COMM_WORLD.rank:  # small enough for one rank; the others wait at the end
    raise SystemExit
coarse = "BLADEFEM_COARSE" in os.environ
folder = Path("runs/demos/paper_element")
samples = 2048 if coarse else 16384

# %% [markdown]
# Stiffness 1e6 N/m, friction limit 10 N, amplitude 30 µm: the node slips over two thirds of its way.

# %%
kt, limit, amplitude = 1e6, 10.0, 30e-6  # N/m, N, m
loop = two_slope_loop(kt, limit, amplitude, samples)
fit, linear = linear_fit(loop)
closed = jenkins(amplitude, kt, limit)
print(f"K  {fit.stiffness:12.1f} N/m, closed form {closed.stiffness:12.1f}")
print(f"wC {fit.damping:12.1f} N/m, closed form {closed.damping:12.1f}")
if not coarse:
    draw_fit(loop.angle, loop.motion, loop.force, linear, folder / "fig_1.png")

# %% [markdown]
# Eq. 13 says that the linear force does the work of the friction force. It does, for any motion and any load, because
# $u$ and $\dot u$ are orthogonal over a period.

# %%
print(
    f"work {work(loop):.6e} J, of the linear force {trapezoid(linear, loop.motion):.6e} J, closed "
    f"form {closed.energy:.6e} J"
)

# %% [markdown]
# ## Normal load that varies (Fig. 4)
#
# $N = N_0 + N_1 \sin \omega_n t$. The paper integrates a rate law (Eq. 19-21) with a Heaviside function that is zero at
# zero (Eq. 20). Taken at its word, the force under a constant load freezes for ever the first time it meets its limit.
# With $H(0) = 1$ it slips, but cannot stick again while $N$ falls; a load that varies hides the difference. The return map
# $f \leftarrow \mathrm{clamp}(f + k_t\,\Delta g,\pm\mu N)$ has neither fault.

# %%
cases = {
    "constant load": (0, 1),
    "load at half the frequency": (1, 2),
    "at a quarter": (1, 4),
    "at twice": (2, 1),
}
pictures, ratios = {}, {}
print("work over the right one, and the largest error of a force with H(0) = 1:")
for title, orders in cases.items():
    load = (20.0, 12.0 if orders[0] else 0.0)  # N
    right = coupled_loop(kt, 0.5, load, amplitude, orders, samples)
    frozen, sliding = (
        printed_loop(kt, 0.5, load, amplitude, orders, samples, zero) for zero in (0, 1)
    )
    share, ratios[title] = (work(loop) / work(right) for loop in (frozen, sliding))
    # a frozen force does no work: what is left is round-off
    share = 0.0 if abs(share) < 1e-9 else share
    error = np.abs(sliding.force - right.force).max()
    print(f"  {title:26s}  H(0) = 0: {share:.3f}  H(0) = 1: {ratios[title]:.3f}  {error:5.2f} N")
    pictures[title] = [
        ("corrected", right.motion, right.force),
        ("printed, H(0) = 1", sliding.motion, sliding.force),
    ]
if not coarse:
    draw_coupled_loops(pictures, folder / "fig_4.png")

# %% [markdown]
# Where the load falls below zero the contact is open and carries nothing. The printed law, whose limit is then
# negative, flips the sign of the force at every step.

# %%
right, printed = (
    law(kt, 0.5, (10.0, 20.0), amplitude, (1, 1), samples) for law in (coupled_loop, printed_loop)
)
apart = right.load < 0
flips = np.count_nonzero(np.diff(np.sign(printed.force[apart])) != 0) / np.count_nonzero(apart)
print(
    f"open contact: force {np.abs(right.force[apart]).max():.1f} N; printed law "
    f"{np.abs(printed.force[apart]).max():.1f} N, changing sign in {100 * flips:.0f} % of the steps"
)

# %% [markdown]
# ## Two directions (Eq. 29)
#
# On a circular orbit of radius $A$ the force stays on Coulomb's circle and the work is
# $2\pi\mu N\sqrt{A^2 - (\mu N / k_t)^2}$. A limit for each axis, $\sqrt{(\mu N)^2 - f_\perp^2}$, loses more than half
# of it here.

# %%
angle = 2 * np.pi * np.arange(4 * samples + 1) / samples
orbit, steady = (
    amplitude * np.column_stack([np.cos(angle), np.sin(angle)]),
    slice(3 * samples, None),
)
force = per_axis(orbit, np.full(len(orbit), limit), kt, 1.0)[steady]
lost = np.sum((force[1:] + force[:-1]) / 2 * np.diff(orbit[steady], axis=0))
print(
    "circular orbit: limits for each axis do "
    f"{lost / circular_orbit_work(amplitude, kt, limit):.3f} of the work"
)

# %%
print(
    "work lost by the printed law at half the frequency [1]: "
    f"{1 - ratios['load at half the frequency']:.6f}"
)

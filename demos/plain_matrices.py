# %% [markdown]
# # A friction damper on matrices of your own
#
# No finite elements here: mass, damping and stiffness are NumPy arrays. They may as well come from a file,
# `bladefem.balance.read_matrices` reads `.npz`, `.mat`, Matrix Market, Nastran DMIG and Ansys `.full`.
#
# Two blades on soft discs, a spring between them, and a friction element from the first one to the ground.

# %%
import numpy as np

from bladefem import balance as bf
from bladefem.util.script_help import help_and_exit

help_and_exit(__file__)

M = np.diag([1.0, 1.0])  # [kg]
K = np.array([[1.5e6, -0.5e6], [-0.5e6, 1.5e6]])  # [N/m]
ports = {"contact": [0], "load": [0, 1], "probe": [0, 1]}  # numbers of degrees of freedom
body = bf.body_from_matrices(M, K, ports, C=4e-6 * K)
element = bf.Elements(kt=[1e6], kn=[0.0], mu=[0.4], n0=[10.0], tangents=1)
force = {
    1: np.array([1.0, 0.5j]),
    3: np.array([0.0, 0.2]),
}  # amplitude and phase of each harmonic [N]
model = bf.ReducedModel((body,), element, force)
solution = bf.solve(model, omega=1125.0, H=7, samples=256)
print(
    f"{solution.frequency:.1f} Hz: {solution.method}, {solution.iterations} iterations, residual "
    f"{solution.residual_force:.1e} N, nodes {solution.states}"
)
print(
    f"work in {solution.work.input:.4e} J, out by damping {solution.work.damping:.4e} J and "
    f"friction {solution.work.friction:.4e} J"
)
assert solution.converged, solution.reason

# %% [markdown]
# A band of frequencies: points go where the curve needs them, each peak is closed in to one part in a thousand.

# %%
curve = sorted(bf.sweep(model, (800.0, 1600.0), H=7, samples=256), key=lambda point: point.omega)
assert all(point.converged for point in curve)
for top in bf.local_maxima(curve):
    print(f"peak: {top.frequency:8.2f} Hz {1e6 * bf.size(top):8.3f} um, one of {len(curve)} points")

# %% [markdown]
# What does the response depend on? Exact derivatives, one linear solve each, with the logarithm of each parameter.

# %%
highest = max(curve, key=bf.size)
for name, change in bf.sensitivities(model, highest, ["mu", "kt", "damping", "force"]).items():
    print(f"one percent more {name:8s} {1e6 * 0.01 * change.size[0]:+8.4f} um")

# %% [markdown]
# The normal load that makes the highest peak of the band lowest, found along these derivatives.

# %%
best = bf.optimum(model, band=(800.0, 1600.0), bounds=(0.01, 10.0), H=7, samples=256)
print(
    f"best load {10 * best.value:.3f} N, {best.points} points solved, peak at "
    f"{best.peak.omega:.2f} rad/s"
)
print(f"lowest highest peak [um]: {1e6 * best.peak.height:.4g}")

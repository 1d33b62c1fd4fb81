"""The paper's iteration for benchmarks/whole_answer.py: Eq. 34 by amplitude, stopped by Eq. 35.

Each contact and direction has one equivalent stiffness, so that contacts in 3-D are taken as well.
"""

from __future__ import annotations

import numpy as np

from bladefem.damper.accelerate import Rules
from bladefem.errors import NotSolvedError
from bladefem.friction.aft import evaluate
from bladefem.friction.fourier import to_complex, to_real
from bladefem.hbm.linear.condensation import condense
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.solution import probe_motion

# first look at a band, and further ones round the highest point
FIRST_FREQUENCIES = 40
ZOOMS = 3
ZOOM_FREQUENCIES = 8


def loop_resonance(model: ReducedModel, band: tuple[float, float]) -> dict[float, complex]:
    """Frequency [Hz] -> first harmonic at the probe [m], on ever narrower grids round the highest.

    Raises:
        NotSolvedError: the loop did not stop at any frequency.
    """
    found: dict[float, complex] = {}
    grid = np.linspace(*band, FIRST_FREQUENCIES)
    for _ in range(1 + ZOOMS):
        values = {f: paper_loop(model, 2 * np.pi * f) for f in grid}
        found |= {f: value for f, value in values.items() if np.isfinite(value)}
        if not found:
            raise NotSolvedError("the loop did not stop at any frequency")
        best = max(found, key=lambda f: abs(found[f]))
        span = (grid[1] - grid[0]) * 0.8
        grid = np.linspace(best - span, best + span, ZOOM_FREQUENCIES)
    return found


def paper_loop(model: ReducedModel, omega: float) -> complex:
    """First harmonic at the probe by Eq. 34, by amplitude with the phases of the image; NaN where
    Eq. 35 is not met.
    """
    rules = Rules()
    linear = condense(model, omega, 1)
    free, G = linear.free[1], linear.G[1]
    e = model.elements
    n = len(e.kt)
    forces = np.zeros(len(free), dtype=complex)

    def image(w: np.ndarray) -> np.ndarray:
        # the normal direction, the first one, is missing where its load is prescribed
        motion = np.zeros((n, 1 + e.tangents, 3))
        motion[:, -model.directions :] = to_real(np.stack([0 * w, w], axis=1)).reshape(n, -1, 3)
        found = evaluate(e, motion, 512, jacobian=False).f[:, -model.directions :]
        forces[:] = to_complex(found).reshape(-1, 2)[:, 1]
        stiffness = np.where(abs(w) > 0, forces / np.where(abs(w) > 0, w, 1.0), 0.0)
        return np.linalg.solve(np.eye(len(w)) + G * stiffness, free)

    w, before = free, None
    g = image(w)
    for _ in range(rules.most):
        new = g if before is None else _secant(w, before[0], g, before[1])
        step = np.linalg.norm(new - w) / np.linalg.norm(new)
        if not np.isfinite(step):
            return np.nan
        before = w, g
        w, g = new, image(new)
        if step < rules.tolerance:
            both = np.stack([0 * forces, forces])
            return complex(probe_motion(model, omega, both, np.zeros(linear.B.shape[1]))[1, 0])
    return np.nan


def _secant(w1: np.ndarray, w0: np.ndarray, g1: np.ndarray, g0: np.ndarray) -> np.ndarray:
    """Eq. 34 on amplitudes."""
    a1, a0, b1, b0 = (abs(x) for x in (w1, w0, g1, g0))
    below = b1 - a1 - b0 + a0
    safe = np.where(below != 0, below, 1.0)
    return abs(np.where(below != 0, (b1 * a0 - b0 * a1) / safe, b1)) * np.exp(1j * np.angle(g1))

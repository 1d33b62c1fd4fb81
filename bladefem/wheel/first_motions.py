"""Motions of the wheel that Newton starts from: all blades alike, or dampers with held means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import NotSolvedError
from ..hbm.solver.newton import Options
from .model import Wheel
from .newton import WheelBalance, WheelNewton, newton_wheel
from .tuned import tuned_displacements


def solve_held_means(
    balance: WheelBalance, options: Options, first: np.ndarray | None = None
) -> WheelNewton | None:
    """The wheel whose means stay in the preload state, from its full stick or a first motion:
    dampers that slip throughout drift far on nearly no force, which hides the way to the solution.
    """
    key = "held means"
    wheel = balance.wheel
    if key not in wheel.kept:
        wheel.kept[key] = replace(wheel, coupled=False)
    flex = replace(balance.flex, coupled=False)
    stuck = balance.stuck.copy()
    stuck[..., 0] = 0.0
    held = replace(balance, wheel=wheel.kept[key], flex=flex, stuck=stuck)
    starts = [stuck]
    if first is not None:
        starts.insert(0, first * (np.arange(first.shape[3]) > 0))
    for w in starts:
        end = newton_wheel(held, w, replace(options, fallbacks=False))
        if end.converged:
            return end
    return None


def held_motion(balance: WheelBalance, options: Options) -> np.ndarray | None:
    """Displacements of `solve_held_means`, or None."""
    end = solve_held_means(balance, options)
    return None if end is None else end.state.w


def tuned_motion(
    wheel: Wheel,
    omega: float,
    H: int,
    samples: int,
) -> np.ndarray | None:
    """Displacements of the tuned wheel, or None."""
    try:
        return tuned_displacements(wheel, omega, H, samples)
    except NotSolvedError:
        return None

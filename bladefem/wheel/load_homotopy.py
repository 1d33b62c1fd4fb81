"""The wheel's excitation raised from nearly stuck to its own: the last of the attempts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..hbm.solver.newton import Options
from .newton import WheelBalance, WheelNewton, evaluate_wheel, newton_wheel

# of the load homotopy: first share of the excitation, first and last factor to the next one, and
# points before it is given up
FIRST_LOAD_SHARE = 0.02
FIRST_LOAD_FACTOR = 2.0
LAST_LOAD_FACTOR = 1.01
HOMOTOPY_POINTS = 60


def load_homotopy(balance: WheelBalance, options: Options) -> WheelNewton:
    """The excitation raised step by step from nearly stuck to its own, on a secant."""
    iterations = 0
    products = 0
    share = FIRST_LOAD_SHARE
    factor = FIRST_LOAD_FACTOR
    path: list[tuple[float, np.ndarray]] = []
    end: WheelNewton | None = None
    for _ in range(HOMOTOPY_POINTS):
        part = replace(balance, stuck=share * balance.stuck)
        end = newton_wheel(part, _predicted(path, share, part.stuck), options)
        iterations += end.iterations
        products += end.products
        if end.converged:
            if share == 1.0:
                break
            path = [*path[-1:], (share, end.state.w)]
            factor = factor**1.5
        else:
            factor = factor**0.4
        if factor < LAST_LOAD_FACTOR:
            break
        share = min(1.0, factor * (path[-1][0] if path else FIRST_LOAD_SHARE / FIRST_LOAD_FACTOR))
    # HOMOTOPY_POINTS is at least one
    assert end is not None
    if share < 1.0:
        state = evaluate_wheel(balance, end.state.w)
        reason = f"the load homotopy stopped at {share:.3g} of the excitation: {end.reason}"
        end = replace(end, state=state, converged=False, reason=reason)
    return replace(end, iterations=iterations, products=products)


def _predicted(
    path: list[tuple[float, np.ndarray]],
    share: float,
    stuck: np.ndarray,
) -> np.ndarray:
    """Displacements on the secant of the path; proportional or stuck where it has no two points."""
    if not path:
        return stuck
    last, w = path[-1]
    if len(path) == 1:
        return share / last * w
    before, v = path[0]
    return w + (share - last) / (last - before) * (w - v)

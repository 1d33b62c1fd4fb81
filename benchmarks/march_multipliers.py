"""Floquet multipliers of the slow march: Newton's method on the map of one period.

The march of `branch_models.py` shares nothing with the library. Its periodic motion next to a
solution of the balance and the derivative of its map, by central differences, say whether
disturbances of that very motion grow. To march on from it says less: what an unstable motion is
left for may lie within a thousandth of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from branch_models import Case, march

# steps in a period: with 1000 no periodic motion is found where contacts strike and slip for an
# instant (seed 353 of `verdicts.py`), with these its multiplier is that of the library to 1e-4
STEPS = 16_000
# share of each coordinate's size by which it is varied
VARIED = 1e-5
# change over one period, over the size of the state, of a motion that is periodic
PERIODIC = 1e-6
NEWTON_STEPS = 12
HALVINGS = 6


@dataclass(frozen=True)
class PeriodicMarch:
    """The periodic motion of the march next to a state."""

    # q, velocity, sliders at phase zero
    state: np.ndarray
    # what one period changes of it, over its size; no periodic motion where above PERIODIC
    change: float
    # largest modulus of the multipliers, those of contacts that stick throughout (one) included
    multiplier: float


def periodic_march(case: Case, omega: float, state: np.ndarray) -> PeriodicMarch:
    """From a state of about that motion, as `branch_models.state_of` gives it."""
    scale = _sizes(case, omega, state)
    x = state / scale

    def mapped(point: np.ndarray) -> np.ndarray:
        return march(case, omega, point * scale, 1, STEPS).state / scale

    identity = np.eye(len(x))
    for _ in range(NEWTON_STEPS):
        missed = mapped(x) - x
        columns = [mapped(x + VARIED * e) - mapped(x - VARIED * e) for e in identity]
        slope = np.array(columns).T / (2 * VARIED)
        size = float(np.linalg.norm(missed))
        if size < PERIODIC:
            break
        # a stuck contact may rest anywhere
        step = np.linalg.lstsq(identity - slope, missed, rcond=1e-9)[0]
        shares = 0.5 ** np.arange(HALVINGS)
        better = (x + share * step for share in shares)
        found = next((p for p in better if np.linalg.norm(mapped(p) - p) < size), None)
        if found is None:
            break
        x = found
    return PeriodicMarch(x * scale, size, float(abs(np.linalg.eigvals(slope)).max()))


def _sizes(case: Case, omega: float, state: np.ndarray) -> np.ndarray:
    """Of displacements, velocities and sliders: what a share of each is taken of."""
    d = len(case.stiffness)
    moved = abs(state[:d]).max()
    sliders = max(abs(state[2 * d :]).max(), moved)
    return np.repeat([moved, omega * moved, sliders], [d, d, len(state) - 2 * d])

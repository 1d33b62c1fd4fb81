"""The tuned wheel as one sector: where the balance of all blades starts, and what it is measured
by.
"""

from __future__ import annotations

import numpy as np

from ..data import PortModel
from ..friction.fourier import to_complex, to_real
from ..hbm.model import ReducedModel
from ..hbm.solve import solve
from ..reduction.assemble import conjugate_wave
from .model import Wheel

# relative deviation of the forces from a travelling wave
TRAVELLING_WAVE_TOLERANCE = 1e-9


def travelling_order(wheel: Wheel) -> int | None:
    """The engine order of harmonic 1 where all harmonics travel with it; None for other forces."""
    sectors = np.arange(wheel.count)
    for order in range(wheel.count):
        turn = np.exp(2j * np.pi * order * sectors / wheel.count)
        if all(
            np.allclose(
                f, turn[:, None] ** h * f[0], rtol=0, atol=TRAVELLING_WAVE_TOLERANCE * abs(f).max()
            )
            for h, f in wheel.excitation.items()
        ):
            return order
    return None


def tuned_sector(wheel: Wheel, harmonics: int) -> ReducedModel | None:
    """The sector's model for harmonics 0..H; None where the blades do not move alike."""
    order = travelling_order(wheel)
    alike = len(wheel.elements.kt) == wheel.nodes
    if order is None or not alike:
        return None
    sides = tuple(_sector(wheel, h, order) for h in range(harmonics + 1))
    damper = (wheel.damper,) if isinstance(wheel.damper, PortModel) else wheel.damper
    return ReducedModel(
        sides,
        wheel.elements,
        {h: np.asarray(f)[0] for h, f in wheel.excitation.items()},
        wheel.damping,
        damper,
        wheel.damper_damping,
        coupled=wheel.coupled,
        start=wheel.start,
    )


def tuned_displacements(
    wheel: Wheel,
    omega: float,
    harmonics: int,
    samples: int,
) -> np.ndarray | None:
    """(N, n, d, 2H+1) displacements of the tuned wheel, solved in one sector; None where that has
    no solution or no such form.
    """
    key = ("tuned sector", harmonics)
    if key not in wheel.kept:
        wheel.kept[key] = tuned_sector(wheel, harmonics)
    model = wheel.kept[key]
    order = travelling_order(wheel)
    if model is None or order is None:
        return None
    point = solve(model, omega, harmonics, samples)
    if not point.converged:
        return None
    turns = 2j * np.pi * order / wheel.count
    sectors = np.arange(wheel.count)[:, None]
    shift = np.exp(turns * sectors * np.arange(harmonics + 1))
    return to_real(to_complex(point.w) * shift[:, None, None, :])


def _sector(
    wheel: Wheel,
    harmonic: int,
    order: int,
) -> PortModel:
    """The sector in the nodal diameter of a harmonic, without the ports that the balance
    ignores.
    """
    diameter = harmonic * order % wheel.count
    body, mirrored = wheel.wave(diameter)
    # the flow does nothing to the mean
    if harmonic == 0:
        body = wheel.sectors[diameter]
    return conjugate_wave(body) if mirrored else body

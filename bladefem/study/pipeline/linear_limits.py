"""The two linear responses between which friction works: no damper, and a load under which nothing
slips.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from ...data import Elements
from ...hbm.linear_resonances import free_resonances, stuck_partners
from ...hbm.model import ReducedModel
from ...hbm.solve import free_response, stuck_response
from ...util.arrays import ComplexArray, RealArray

# of the resonance frequency, each side: where its height is looked for
SEARCH_HALF_WIDTH = 0.02
# points of that search, before it is refined between the highest and its neighbours
SEARCH_POINTS = 21
# points of a drawn curve that crowd round its resonance
POINTS_AT_RESONANCE = 50


@dataclass(frozen=True)
class Limit:
    """A linear frequency response, under the smallest or the largest load that there is."""

    # 0: no damper, inf: full stick [N]
    load: float
    # (k,) [Hz], ascending
    frequency: RealArray
    # (k,) complex first harmonic at the probe [m]
    first: ComplexArray
    # [Hz]
    peak_frequency: float
    # [m]
    peak_amplitude: float


def linear_limits(
    model: ReducedModel,
    mode: int,
    band: tuple[float, float],
) -> tuple[Limit, Limit]:
    """No damper and full stick, in a frequency band [Hz]; nodes that the static load leaves open
    stay open.
    """
    pressed = replace(model, elements=_pressed(model.elements))
    return (
        _limit(0.0, model, free_response, free_resonances(model)[mode - 1], band),
        _limit(np.inf, pressed, stuck_response, stuck_partners(pressed)[mode - 1], band),
    )


def _pressed(elements: Elements) -> Elements:
    closed = elements.n0 > 0
    return replace(elements, kt=elements.kt * closed, kn=elements.kn * closed)


def _limit(
    load: float,
    model: ReducedModel,
    response: Callable[[ReducedModel, float], np.ndarray],
    omega: float,
    band: tuple[float, float],
) -> Limit:
    def first(frequency: float) -> complex:
        return complex(response(model, 2 * np.pi * frequency)[1, 0])

    near = (
        omega
        / (2 * np.pi)
        * np.linspace(1 - SEARCH_HALF_WIDTH, 1 + SEARCH_HALF_WIDTH, SEARCH_POINTS)
    )
    top = min(max(int(np.argmax([abs(first(f)) for f in near])), 1), SEARCH_POINTS - 2)
    found = minimize_scalar(
        lambda f: -abs(first(f)),
        bounds=(near[top - 1], near[top + 1]),
        method="bounded",
        options={"xatol": 1e-6 * near[top]},
    )
    crowd = (
        found.x
        * (
            1
            + np.outer((-1, 1), np.geomspace(1e-5, 3 * SEARCH_HALF_WIDTH, POINTS_AT_RESONANCE // 2))
        ).ravel()
    )
    frequency = np.unique(
        np.concatenate(
            [np.linspace(*band, 40), crowd[(crowd > band[0]) & (crowd < band[1])], [found.x]]
        )
    )
    return Limit(
        load, frequency, np.array([first(f) for f in frequency]), float(found.x), float(-found.fun)
    )

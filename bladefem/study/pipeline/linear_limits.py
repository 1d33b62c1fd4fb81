"""The two linear responses between which friction works: no damper, and a load under which nothing
slips.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize_scalar

from ...data import Elements
from ...hbm.linear_resonances import free_resonances, stuck_partners
from ...hbm.model import ReducedModel
from ...hbm.solve import free_response, stuck_response
from ...util.arrays import ComplexArray, RealArray
from ..adaptive.family import Family, family_member
from ..adaptive.indicators import richer_settings
from ..adaptive.settings import DIRECTIONS, Settings

Response: TypeAlias = Callable[[ReducedModel, float], np.ndarray]
# a model, its response, and the circular frequency of its mode
LinearModel: TypeAlias = tuple[ReducedModel, Response, float]

# directions that leave nothing out of a linear motion
EXACT = ("harmonics", "samples")
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
    # (k,) estimated relative errors of `first`: what modes, contact points and the damper's
    # elasticity change; NaN: not estimated
    estimated: RealArray
    # estimated relative errors of the peak amplitude: by the same, by half as many contact points,
    # and by the error of the body's mesh; NaN: not estimated. Harmonics, samples and the layer's
    # law leave nothing out of a linear motion
    balance: float = np.nan
    halved: float = np.nan
    body_mesh: float = np.nan
    # of the damper that sticks [kg], where several masses are studied; None without damper
    mass: float | None = None

    @property
    def error(self) -> float:
        """Estimated relative error of the peak amplitude; NaN where nothing was estimated."""
        parts = [self.balance, self.halved, self.body_mesh]
        return float(np.nansum(parts)) if np.isfinite(parts).any() else np.nan


def full_stick(limits: Sequence[Limit], mass: float | None) -> Limit:
    """The limit of the damper of a mass [kg], None where one is studied, among those of a
    response.
    """
    return next(limit for limit in limits[1:] if limit.mass == mass)


def judged_limits(
    family: Family,
    settings: Settings,
    softer: Family | None,
    mode: int,
    band: tuple[float, float],
    open_points: bool,
) -> tuple[Limit, Limit]:
    """The linear limits with what their model leaves out, as of damped resonances.

    Args:
        family, settings: of the loads studied.
        softer: the same on the body less the error of its stiffness; None: not known.
        open_points: the scene leaves the number of contact points open; where more than half of
            the nodes are such, half of them tell the error of the contact mesh.
    """
    # full stick is that of the layer itself, whatever stood for it where contacts lift off
    settings = replace(settings, softened=False)
    limits = linear_limits(family_member(family, settings).model, mode, band)
    others = [richer_settings(family, settings, name) for name in DIRECTIONS if name not in EXACT]
    rich = [family_member(family, other).model for other in others if other is not None]
    changes = [_changes(limits, model, mode) for model in rich]
    nodes = len(family_member(family, settings).groups)
    half = nodes // 4
    judged = []
    for i, limit in enumerate(limits):
        judged.append(
            replace(
                limit,
                estimated=sum((one[i][0] for one in changes), np.zeros(len(limit.first))),
                balance=float(sum(one[i][1] for one in changes)),
            )
        )
    if open_points and half >= 1 and (settings.points is None or settings.points > half):
        coarser = family_member(family, replace(settings, points=half)).model
        coarse = _changes(limits, coarser, mode)
        judged = [replace(limit, halved=c[1]) for limit, c in zip(judged, coarse, strict=True)]
    if softer is not None:
        soft = _changes(limits, family_member(softer, settings).model, mode)
        judged = [replace(limit, body_mesh=c[1]) for limit, c in zip(judged, soft, strict=True)]
    return judged[0], judged[1]


def _changes(
    limits: tuple[Limit, Limit], model: ReducedModel, mode: int
) -> list[tuple[RealArray, float]]:
    """Relative changes by another model, limit by limit: of the first harmonic (k,) and of the
    peak     amplitude.
    """
    found = []
    for limit, (other, response, omega) in zip(limits, _linear_models(model, mode), strict=True):
        first = np.array([_first(other, response, f) for f in limit.frequency])
        _, amplitude = _peak(other, response, omega)
        change = abs(limit.first - first) / np.maximum(abs(first), np.finfo(float).tiny)
        found.append((change, abs(limit.peak_amplitude / amplitude - 1)))
    return found


def linear_limits(
    model: ReducedModel,
    mode: int,
    band: tuple[float, float],
) -> tuple[Limit, Limit]:
    """No damper and full stick, in a frequency band [Hz]; nodes that the static load leaves open
    stay open.
    """
    free, stuck = _linear_models(model, mode)
    return _limit(0.0, *free, band), _limit(np.inf, *stuck, band)


def _linear_models(model: ReducedModel, mode: int) -> tuple[LinearModel, LinearModel]:
    """No damper and full stick."""
    pressed = replace(model, elements=_pressed(model.elements))
    return (
        (model, free_response, free_resonances(model)[mode - 1]),
        (pressed, stuck_response, stuck_partners(pressed)[mode - 1]),
    )


def _pressed(elements: Elements) -> Elements:
    closed = elements.n0 > 0
    return replace(elements, kt=elements.kt * closed, kn=elements.kn * closed)


def _limit(
    load: float,
    model: ReducedModel,
    response: Response,
    omega: float,
    band: tuple[float, float],
) -> Limit:
    top, height = _peak(model, response, omega)
    crowd = (
        top
        * (
            1
            + np.outer((-1, 1), np.geomspace(1e-5, 3 * SEARCH_HALF_WIDTH, POINTS_AT_RESONANCE // 2))
        ).ravel()
    )
    frequency = np.unique(
        np.concatenate(
            [np.linspace(*band, 40), crowd[(crowd > band[0]) & (crowd < band[1])], [top]]
        )
    )
    first = np.array([_first(model, response, f) for f in frequency])
    return Limit(load, frequency, first, top, height, np.full(len(first), np.nan))


def _peak(model: ReducedModel, response: Response, omega: float) -> tuple[float, float]:
    """Frequency [Hz] and height [m] of the resonance near a circular frequency."""
    near = (
        omega
        / (2 * np.pi)
        * np.linspace(1 - SEARCH_HALF_WIDTH, 1 + SEARCH_HALF_WIDTH, SEARCH_POINTS)
    )
    heights = [abs(_first(model, response, f)) for f in near]
    top = min(max(int(np.argmax(heights)), 1), SEARCH_POINTS - 2)
    found = minimize_scalar(
        lambda f: -abs(_first(model, response, f)),
        bounds=(near[top - 1], near[top + 1]),
        method="bounded",
        options={"xatol": 1e-6 * near[top]},
    )
    return float(found.x), float(-found.fun)


def _first(model: ReducedModel, response: Response, frequency: float) -> complex:
    """First harmonic at the probe [m]."""
    return complex(response(model, 2 * np.pi * frequency)[1, 0])

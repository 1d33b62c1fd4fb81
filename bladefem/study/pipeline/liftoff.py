"""Why a light load has no response: the blade moves its seats further than the load presses the
damper onto them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ...contact.numerical_stiffness import physical_stiffness
from ...errors import NotSolvedError
from ...hbm.linear_resonances import free_resonances, stuck_partners
from ...hbm.model import ReducedModel
from ...scene.units import show
from .assemble_model import LoadCase

# travel of the seats over the compression by the load, beyond which the damper is said to lift off
LIFTED_TRAVEL = 10.0


@contextmanager
def naming_the_load(
    case: LoadCase,
    model: ReducedModel,
    mode: int,
    excitation: float,
    band: tuple[float, float] | None = None,
) -> Iterator[None]:
    """A failure inside names the load that it belongs to, and whether the band has no resonance or
    the damper lifts off.

    Args:
        mode: number of the resonance, 1 = lowest.
        excitation: amplitude of the force on each blade [N].
        band: frequencies of `study.band` [Hz].
    """
    try:
        yield
    except NotSolvedError as error:
        if beside := band_beside_resonances(model, mode, band):
            raise NotSolvedError(f"{beside}: {error}") from error
        travel = seat_travel(model, mode, excitation)
        pressed = _compression(case)
        lifts = (
            ""
            if travel <= LIFTED_TRAVEL * pressed
            else (
                f"the damper lifts off, since the seats move by up to {1e6 * travel:.3g} um normal "
                "to themselves at the resonance without damper, and this load presses them "
                f"together by {1e6 * pressed:.3g} um only; expected a larger load, or "
                "contact.normal = 'prescribed': "
            )
        )
        raise NotSolvedError(f"study.loads = {show(case.load, 'N')}: {lifts}{error}") from error


def band_beside_resonances(
    model: ReducedModel,
    mode: int,
    band: tuple[float, float] | None,
) -> str:
    """What says that a band lies beside the resonances of a mode under all loads; empty where it
    does not, or where there is none.
    """
    if band is None:
        return ""
    ends = [both(model)[mode - 1] / (2 * np.pi) for both in (free_resonances, stuck_partners)]
    if band[0] <= max(ends) and band[1] >= min(ends):
        return ""
    return (
        f"study.band = {show(band[0], 'Hz')}, {show(band[1], 'Hz')}: the resonances of mode {mode} "
        f"lie between {ends[0]:.5g} Hz without damper and {ends[1]:.5g} Hz at full stick, expected "
        "a band that holds them"
    )


def seat_travel(
    model: ReducedModel,
    mode: int,
    excitation: float,
) -> float:
    """Largest normal amplitude [m] of a contact point at a resonance without damper; 0 where it
    plays no part.

    Args:
        mode: number of the resonance, 1 = lowest.
        excitation: amplitude of the force on each blade [N].
    """
    if model.loads_prescribed:
        return 0.0
    side = model.side(1)
    omega = free_resonances(model)[mode - 1]
    load = side.shapes[side.ports["load"]].conj().T @ np.full(
        side.shapes[side.ports["load"]].shape[0], excitation
    )
    normal = side.shapes[side.ports["contact"]][:: model.directions]
    loss = 2j * model.damping.ratio * side.omega * omega
    return float(np.abs(normal @ (load / (side.omega**2 - omega**2 + loss))).max())


def _compression(case: LoadCase) -> float:
    """Compression of the contact springs of one seat under the load [m]."""
    stiffness = float(physical_stiffness(case.elements, case.series).kn.sum()) / 2
    return case.load / stiffness if stiffness > 0 else np.inf

"""The blades of a mistuned wheel of which one decides its utilisation: the highest of each shape,
each at the frequency where it moves most.

Blades of one shape move alike, so that of these the one that moves most is strained most. One of
another shape can move less, at a frequency of its own, and be nearer to its endurance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from ...wheel.local_peak import LocalBalances, LocalPeak
from ...wheel.model import Pattern
from ...wheel.solution import WheelSolution
from ...wheel.solve import solve_wheel
from ..pipeline.damped_motion import DampedStress
from .other_blades import OtherBlades
from .own_stress import OwnStress
from .peak_choice import ChosenPeak, SearchedWheel, local_peak

# stress of a blade by pattern, solution and its number: on the mesh of the tuned shape, and of a
# blade of another shape also on its own
BladeStress = Callable[[Pattern, WheelSolution, int], tuple[DampedStress, OwnStress | None]]


@dataclass(frozen=True)
class DecidingBlade:
    """The highest blade of one shape, where it moves most."""

    # number from 0
    blade: int
    # at the probe [m], and where, of the scene's engine order [Hz]
    height: float
    frequency: float
    stress: DampedStress
    # on its own mesh, where it has another shape
    own_stress: OwnStress | None

    @property
    def worst(self) -> DampedStress | OwnStress:
        """The stress on the mesh of its own shape."""
        return self.stress if self.own_stress is None else self.own_stress


def blade_groups(others: OtherBlades | None, count: int) -> list[np.ndarray]:
    """Numbers of the blades of each shape, ascending; the tuned shape first, where there is one."""
    if others is None:
        return [np.arange(count)]
    odd = [np.array(numbers) for _, numbers in others.shapes()]
    tuned = np.setdiff1d(np.arange(count), np.concatenate(odd))
    return [tuned, *odd] if len(tuned) else odd


def deciding_blades(
    searched: SearchedWheel,
    found: ChosenPeak,
    others: OtherBlades | None,
    stress: BladeStress,
) -> tuple[tuple[DecidingBlade, ...], tuple[int, ...]]:
    """The highest blade of each shape, that of the wheel's peak first, and the numbers of blades
    whose own peak was not found.
    """
    highest = found.peak.blade
    turn = 2 * pi
    first = DecidingBlade(
        highest,
        found.peak.height,
        found.peak.omega / turn,
        *stress(searched.pattern, found.solution, highest),
    )
    blades = [first]
    lost: list[int] = []
    for group in blade_groups(others, searched.wheel.count):
        if highest in group:
            continue
        own = group_peak(searched, found, group)
        if own is None:
            lost.extend(group.tolist())
            continue
        peak = own.peak
        blades.append(
            DecidingBlade(
                peak.blade,
                peak.height,
                peak.omega / turn,
                *stress(searched.pattern, own.solution, peak.blade),
            )
        )
    return tuple(blades), tuple(lost)


def group_peak(searched: SearchedWheel, found: ChosenPeak, group: np.ndarray) -> LocalPeak | None:
    """The peak of some blades, with free means where the wheel's peak has them and they are found;
    None where no balance is found at their highest point.
    """
    H, samples = found.harmonics, found.samples
    sizes = found.peak.sizes[:, group].max(axis=1)
    top = found.peak.omegas[np.nanargmax(sizes)]
    # the solution at the wheel's peak may be far away
    start = solve_wheel(
        searched.wheel,
        top / searched.harmonic,
        H,
        samples,
        pattern=searched.pattern,
        options=searched.options,
    )
    ways = [(searched.wheel, searched.options)]
    if found.free is not None and searched.free is not None:
        ways.insert(0, (searched.free, searched.without_fallbacks))
    for wheel, options in ways:
        balances = LocalBalances(wheel, searched.pattern, H, samples, options, start)
        own = local_peak(balances, found.peak, searched.harmonic, group)
        if own is not None:
            return own
    return None

"""What a blade keeps to under a drive, found by marching in time until it has settled.

No two periods of a damper that bounces are alike: what a motion keeps to is the band of the
amplitudes of its last periods, and motions are compared by their mean.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...hbm.envelope import PERIODS_OF_PART, first_amplitudes, way_to_limit
from ...hbm.model import ReducedModel
from ...hbm.ring_march import (
    INSTANTS_PER_PERIOD,
    Drive,
    RingMarch,
    RingState,
    driven_anew,
    march_ring,
    never_enough,
    steps_are_resolved,
)
from ...util.arrays import RealArray
from .kept_band import amplitudes_of_periods

# Figures behind these limits: docs/verification.md, "Limits of marches and balances".
# excitation over its own for these periods, before the blade comes down to what it keeps: from
# above it ends on the higher of two motions, from below it creeps up
OVERDRIVE = 2.0
OVERDRIVEN_PERIODS = 50
# instants of a period of a climb, where steps of that length are short enough for the bodies on
# their contacts; its end has INSTANTS_PER_PERIOD
CLIMBING_INSTANTS = 128
# with a layer that stiffens, most instants of a period: steps are halved until they are short
# enough for the stiffness that it reaches
MOST_INSTANTS = 2048
# after which a motion is taken as it is
MOST_PERIODS = 396
# relative change that is none: of the ends of the band of amplitudes, from one part of a march to
# the next, and on the way to the limit of the mean amplitude
SETTLED_CHANGE = 5e-3
# of the width of a band: change of its ends that bouncing alone makes
SETTLED_BAND_SHARE = 0.25
# periods whose amplitudes count
COUNTED_PERIODS = 50
# half width of a band of amplitudes, over its highest, from which the end of a search is marched on
# for CALMING_PERIODS: no two periods are alike there, and whether such a motion has come down is
# not seen in the parts of a short march
WIDE_BAND = 0.03
CALMING_PERIODS = 300
# harmonics of which the amplitude of a period is made
HARMONICS = 7
# operations of a search, some 40 s
MOST_OPERATIONS = 4e11
# of one march with MOST_PERIODS, of which most need a third
MOST_OF_ONE_MARCH = 8e11


@dataclass(frozen=True)
class SettledMotion:
    """What the blade keeps to under a drive."""

    omega: float
    # amplitudes of single periods [m]; bouncing ones scatter, motions are compared by their mean
    lowest: float
    mean: float
    highest: float
    state: RingState
    # steps were short enough for forces that are linear in them
    resolved: bool
    # relative way that the mean seems to have left
    left: float
    # of a blade's dampers in a period, mean of these periods [J]
    friction_work: float

    @property
    def expected(self) -> float:
        """The mean at the lower end of what it seems to come to [m]."""
        return self.mean * (1 - self.left)


@dataclass
class MarchBudget:
    """What a search has taken so far, and how it marches."""

    # times MOST_OPERATIONS and MOST_OF_ONE_MARCH that it may take
    allowance: float = 1.0
    instants: int = CLIMBING_INSTANTS
    # of the motion that is reported
    final_instants: int = INSTANTS_PER_PERIOD
    operations: float = 0.0
    periods: int = 0
    frequencies: set[float] = field(default_factory=set)

    def shorten_steps(self, instants: int) -> None:
        """March with so many instants a period at least from now on."""
        self.instants = max(self.instants, instants)
        self.final_instants = max(self.final_instants, instants)

    @property
    def exhausted(self) -> bool:
        """No more may be marched."""
        return self.operations > self.allowance * MOST_OPERATIONS


class MarchFailedError(Exception):
    """The forces of a step were not found, or the search was not closed in."""


def settle(
    model: ReducedModel,
    state: RingState,
    work: MarchBudget,
    instants: int | None = None,
) -> SettledMotion:
    """What the blade keeps to from a state on.

    Raises:
        MarchFailedError: the forces of a step were not found, or the march takes too long.
    """
    work.frequencies.add(state.drive.omega)
    return end_of_march(limited_march(model, state, MOST_PERIODS, work, instants, _has_settled))


def settle_at(
    model: ReducedModel, before: SettledMotion, omega: float, work: MarchBudget
) -> SettledMotion:
    """What the blade keeps to when the frequency is moved."""
    return settle(model, driven_anew(model, before.state, Drive(omega)), work)


def settle_after_overdrive(
    model: ReducedModel, state: RingState, omega: float, work: MarchBudget
) -> SettledMotion:
    """What the blade keeps to after it was driven harder."""
    state = driven_anew(model, state, Drive(omega, OVERDRIVE))
    state = limited_march(model, state, OVERDRIVEN_PERIODS, work).end
    return settle(model, driven_anew(model, state, Drive(omega)), work)


def settle_calmly(model: ReducedModel, found: SettledMotion, work: MarchBudget) -> SettledMotion:
    """What the blade keeps to after many more periods, where no period is like another.

    Raises:
        MarchFailedError: the forces of a step were not found, or the march takes too long.
    """
    if half_band(found) < WIDE_BAND:
        return found
    return end_of_march(limited_march(model, found.state, CALMING_PERIODS, work))


def limited_march(
    model: ReducedModel,
    state: RingState,
    periods: int,
    work: MarchBudget,
    instants: int | None = None,
    enough: Callable[[RealArray], bool] = never_enough,
) -> RingMarch:
    """A march with the instants that were asked for, those of the search when None, or with those
    of the motion that is reported where these are too few for the bodies on their contacts; with
    more where a layer becomes too stiff for them.

    Raises:
        MarchFailedError: the forces of a step were not found, or the march takes too long.
    """
    instants = instants or work.instants
    if not steps_are_resolved(model, state.drive.omega, instants):
        instants = max(instants, work.final_instants)
    leaps = enough is not never_enough
    most = work.allowance * MOST_OF_ONE_MARCH
    while True:
        march = march_ring(model, state, periods, instants, enough, most, leaps)
        work.operations += march.operations * march.periods / periods
        work.periods += march.periods
        found = march.settled and bool(np.isfinite(march.motion).all())
        if march.operations > most:
            raise MarchFailedError
        if found and (model.decay is None or march.resolved):
            return march
        if model.decay is None or 2 * instants > MOST_INSTANTS:
            raise MarchFailedError
        instants *= 2
        work.shorten_steps(instants)


def end_of_march(march: RingMarch) -> SettledMotion:
    """What the last periods of a march keep to."""
    heights = amplitudes_of_periods(march.motion, HARMONICS)
    counted = min(COUNTED_PERIODS, len(heights) // 2)
    last = heights[-counted:]
    ends = float(last.min()), float(last.mean()), float(last.max())
    left = _left_to_limit(march.motion)
    spent = float(march.friction_work[-counted:].mean())
    return SettledMotion(march.end.drive.omega, *ends, march.end, march.resolved, left, spent)


def half_band(found: SettledMotion) -> float:
    """Half width of the band of amplitudes, over its highest."""
    return (found.highest - found.lowest) / (2 * found.highest)


def _has_settled(motion: RealArray) -> bool:
    """The last two thirds of a march keep to one band, and the means of all thirds have come to
    their limit.
    """
    if len(motion) < 3 * PERIODS_OF_PART:
        return False
    third = len(motion) // 3
    heights = amplitudes_of_periods(motion[-2 * third :], HARMONICS).reshape(2, -1)
    if not np.isfinite(heights).all():
        return False
    ends = np.column_stack([heights.min(axis=1), heights.max(axis=1)])
    width = float(ends[1, 1] - ends[1, 0])
    steady = max(SETTLED_CHANGE * ends.max(), SETTLED_BAND_SHARE * width)
    moved = float(abs(np.diff(ends, axis=0)).max())
    return moved <= steady and _left_to_limit(motion) <= SETTLED_CHANGE


def _left_to_limit(motion: RealArray) -> float:
    """Relative way from the mean amplitude of the last third of a march to its limit."""
    third = len(motion) // 3
    if third == 0:
        return 0.0
    means = [complex(first_amplitudes(motion[-k * third :][:third]).mean()) for k in (3, 2, 1)]
    return abs(way_to_limit(means) / means[-1])

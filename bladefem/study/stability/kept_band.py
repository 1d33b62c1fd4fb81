"""The amplitudes between which the blade keeps in a march, and whether they stay where they are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...hbm.ring_march import PERIODS_AT_ONCE
from ...hbm.solution import Solution
from ...util.durations import core_time

# disturbance of the unstable motion at the start, relative
DISTURBANCE_SHARE = 1e-3
# relative change of the ends of a band, from one PERIODS_AT_ONCE to the next, that is none
SETTLED_BAND = 2e-3
# of a march, each of PERIODS_AT_ONCE, that tell whether its band stays
PARTS = 3
# growth of the width of a band, in two parts of a march, from which it goes on: slow ripples grow
# by a few per cent a period
GROWING_RATIO = 1.1
# of the amplitude: a width that is none, whatever it was before
NO_WIDTH = 1e-6
# periods of a march whose band widens, at most, over those that it has otherwise
LONGER_WHILE_WIDENING = 4
# relative width of a band that is one periodic motion
ONE_MOTION = 2e-3


@dataclass(frozen=True)
class KeptBand:
    """Amplitudes of single periods, as root of the sum of squares of the harmonics at the probe of
    each blade.
    """

    # [Hz]
    frequency: float
    # [m]
    lowest: float
    highest: float
    # periods marched
    periods: int
    # why nothing was marched; else ""
    reason: str = ""
    # on each patch, where a model with fewer of them was marched
    points: int | None = None
    # nothing was marched because it takes too long
    too_long: bool = False
    # it went on widening to the end of the march
    widens: bool = False
    # its ends did not stay to the end of the march: a way down from an unstable motion, which may
    # bounce without a period for hundreds of periods, or a motion that never settles
    unsettled: bool = False
    # times its own excitation by which the blade was driven before, and the amplitude that it keeps
    # at most without that [m]
    drive: float = 1.0
    without_drive: float = np.nan
    # of a blade's dampers in a period, mean of the periods whose amplitudes count [J]
    friction_work: float = np.nan

    def farthest(self, amplitude: float) -> float:
        """Relative distance of the farther end from an amplitude; NaN where it is not known."""
        return max(abs(end / amplitude - 1) for end in (self.lowest, self.highest))

    def holds(self, amplitude: float, accuracy: float) -> bool:
        """It is known, and within a relative accuracy of an amplitude."""
        return not self.reason and self.farthest(amplitude) <= accuracy

    @property
    def sentence(self) -> str:
        """What is known."""
        if self.reason:
            return f"what the blade does there is not known: {self.reason}"
        coarse = "" if self.points is None else f" with {self.points} contact points a seat"
        more = ", and the band still widens" if self.widens else ""
        if self.drive > 1:
            coarse += f" after {self.drive:g} times its excitation"
            more += f", without such a start {1e6 * self.without_drive:.4g} um at most"
        if self.highest <= (1 + ONE_MOTION) * self.lowest:
            return (
                f"marched in time{coarse}, it ends on a motion of {1e6 * self.highest:.4g} um there"
                f"{more}"
            )
        return (
            f"marched in time{coarse} over {self.periods} periods, it keeps between "
            f"{1e6 * self.lowest:.4g} and {1e6 * self.highest:.4g} um there{more}"
        )


def too_long_reason(seconds: float) -> str:
    """Why a march was not made, in what a user can judge and change."""
    return (
        f"a march takes {core_time(seconds)} of one core, longer than is spent on it; fewer "
        "contact.points or model.modes shorten it"
    )


def has_settled(motion: np.ndarray, point: Solution) -> bool:
    """The last parts of a march keep to one band that they drift to no faster than before and that
    does not widen.
    """
    ends = ends_of_parts(motion, point)
    if len(ends) < PARTS or not np.isfinite(ends).all():
        return False
    before, now = abs(np.diff(ends, axis=0)).max(axis=1)
    return bool(now <= min(before, SETTLED_BAND * ends.max())) and not widens_at_end(motion, point)


def widens_at_end(motion: np.ndarray, point: Solution) -> bool:
    """The band of the last part of a march is wider than two parts before: a ripple that is seen at
    different phases of it need not widen from each part to the next.
    """
    ends = ends_of_parts(motion, point)
    widths = np.diff(ends, axis=1).ravel()
    grows = widths[-1] > max(GROWING_RATIO * widths[0], NO_WIDTH * ends.max())
    return len(ends) == PARTS and bool(grows)


def ends_of_parts(motion: np.ndarray, point: Solution) -> np.ndarray:
    """Lowest and highest amplitude [m] in each of the last PARTS of a march at most."""
    amplitudes = amplitudes_of_periods(motion[-PARTS * PERIODS_AT_ONCE :], point.harmonics)
    parts = amplitudes.reshape(-1, PERIODS_AT_ONCE * amplitudes.shape[-1])
    return np.column_stack([parts.min(axis=1), parts.max(axis=1)])


def amplitudes_of_periods(motion: np.ndarray, harmonics: int) -> np.ndarray:
    """Root of the sum of squares of harmonics 1..H, from motion (..., samples of a period) [m]."""
    lines = 2 / motion.shape[-1] * np.fft.rfft(motion, axis=-1)[..., 1 : harmonics + 1]
    return np.asarray(np.linalg.norm(lines, axis=-1))


def scaled_band(band: KeptBand, ratio: float) -> KeptBand:
    """The band of a model whose amplitudes are larger by a ratio.

    Friction work is in proportion to the amplitude, as is the work of the excitation at a
    resonance.
    """
    return replace(
        band,
        lowest=ratio * band.lowest,
        highest=ratio * band.highest,
        friction_work=ratio * band.friction_work,
    )


def band_of(point: Solution, motion: np.ndarray, periods: int, friction_work: float) -> KeptBand:
    """From motion (..., samples of a period) at the probe."""
    amplitudes = amplitudes_of_periods(motion, point.harmonics)
    ends = float(amplitudes.min()), float(amplitudes.max())
    return KeptBand(point.frequency, *ends, periods, friction_work=friction_work)


def unknown_band(point: Solution, reason: str) -> KeptBand:
    """That nothing is known from a motion on, and why."""
    return KeptBand(point.frequency, np.nan, np.nan, 0, reason)

"""Leaps of a march along its slow envelope.

The amplitude of a lightly damped blade creeps to what it keeps over hundreds of periods, as a
geometric series of the means of equal parts of the march: from three of them its limit is known
(Aitken). The modes next to the excited frequency are moved most of the way at once; everything else
follows within a few periods. Where a march ends it has been marched, not extrapolated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..util.arrays import ComplexArray, RealArray
from .sector_modes import SectorModes

# periods of a part
PERIODS_OF_PART = 12
# changes of the mean amplitude, over the last one, that are at most expected to follow: slower
# series are no geometric ones for so long
MOST_TO_COME = 10.0
# ratio of a change to the one before, real and imaginary part, with which a leap is made
LEAPING_RATIOS = (0.1, 1.2)
LEAPING_TURN = 0.35
# periods in a row that scatter alike, and times the scatter of its means that a change has to be
LIKE_PERIODS = 4
OVER_SCATTER = 3.0
# relative way to the limit that is worth a leap: below it a few parts more are as good
WORTHWHILE = 3e-3
# of the way to the limit: envelopes are not exactly geometric
WAY_SHARE = 0.9
# relative leap that is not exceeded: far away the series is another one
LONGEST = 0.4
# relative distance from the excited frequency of the modes that make the envelope
NEAR = 0.1


def first_amplitudes(motion: RealArray) -> ComplexArray:
    """(periods,) complex amplitude of the first harmonic of a wave, from motion (periods, r, S) at
    each blade [m].
    """
    _, r, S = motion.shape
    wave = np.exp(-2j * np.pi * (np.arange(r)[:, None] / r + np.arange(S) / S))
    return np.asarray(2 / (r * S) * np.tensordot(motion, wave, 2))


def scatter(amplitudes: ComplexArray) -> float:
    """Standard error [m] of the mean amplitude of a part, by its residuals from a straight line."""
    count = len(amplitudes)
    place = np.arange(count) - (count - 1) / 2
    rest = amplitudes - amplitudes.mean()
    rest = rest - place * (place @ rest) / (place @ place)
    # a period is much like its neighbours
    return float(np.linalg.norm(rest) / count * np.sqrt(LIKE_PERIODS))


def way_to_limit(amplitudes: Sequence[complex]) -> complex:
    """From the last of the mean amplitudes of equal parts to their limit; 0 where there are fewer
    than three.
    """
    last, ratio = _last_change(amplitudes)
    if last == 0:
        return 0.0
    # changes that grow have no limit, but lead on
    to_come = ratio / (1 - ratio) if abs(ratio) < 1 else MOST_TO_COME
    return complex(last * to_come * min(1.0, MOST_TO_COME / abs(to_come)))


def _last_change(amplitudes: Sequence[complex]) -> tuple[complex, complex]:
    """The last change of the mean amplitudes, and its ratio to the one before; 0 where there are
    too few.
    """
    if len(amplitudes) < 3:
        return 0.0, 0.0
    before, last = np.diff(amplitudes[-3:])
    return complex(last), complex(last / before if before != 0 else np.inf)


def leap_from_end(amplitudes: Sequence[complex], noise: float) -> complex:
    """How far the amplitude is moved at the end of the last part; 0 where that is not worth it, or
    where the means are no geometric series.

    Args:
        noise: `scatter` of the last mean [m].
    """
    way = way_to_limit(amplitudes)
    if abs(way) < WORTHWHILE * abs(amplitudes[-1]):
        return 0.0
    last, ratio = _last_change(amplitudes)
    if abs(last) < OVER_SCATTER * noise:
        return 0.0
    low, high = LEAPING_RATIOS
    if not low < ratio.real < high or abs(ratio.imag) > LEAPING_TURN * abs(ratio):
        return 0.0
    # the end of a part is ahead of its mean
    rate = -np.log(min(ratio.real, 0.999))
    way *= WAY_SHARE * rate / np.expm1(rate)
    longest = LONGEST * abs(amplitudes[-1])
    return complex(way * min(1.0, longest / abs(way)))


def moved_envelope(
    system: SectorModes,
    probe: RealArray,
    modal: RealArray,
    omega: float,
    leap: complex,
) -> RealArray:
    """The modal state whose modes near the excited frequency have another size and phase.

    Args:
        probe: (r, M) reading of each blade.
        modal: (2M,) displacements and velocities at the beginning of a period.
        leap: change of the wave's complex amplitude at the probe [m].
    """
    M = len(system.stiffness)
    near = abs(np.sqrt(np.maximum(system.stiffness, 0)) - omega) < NEAR * omega
    amplitudes: ComplexArray = np.where(near, modal[:M] - 1j * modal[M:] / omega, 0)
    r = len(probe)
    read = np.exp(-2j * np.pi * np.arange(r) / r) @ (probe @ amplitudes) / r
    # modes that the probe does not see cannot be moved by what it sees
    if abs(read) < abs(leap):
        return modal
    change = amplitudes * (leap / read)
    return modal + np.concatenate([change.real, -omega * change.imag])

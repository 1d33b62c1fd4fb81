"""Steady motion of the mass on its foundation: loops, loop count, drift, spectrum (the paper's Fig.
10 and 11).

The displacement of the mass need not be periodic: only velocity and friction force are, and the
mass drifts at a steady speed unless the numerator of the reduced frequency ratio is even.
Periodicity is therefore tested on (velocity, force), the drift is reported, and loops are counted
as reversals of the slip, halved, in the smallest period of (velocity, force). Where the paper's
rule "number of open loops = denominator of the reduced frequency ratio" holds is listed in
docs/paper.md (Sect. 4.2).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ..util.progress import Progress, without_progress
from .zmass import MassOnFoundation, Motion, ellipse, march, pulsating_load

# reason of a march that ends in a period that repeats
PERIODIC = "periodic"
# difference of two cycles, over the largest velocity and force, that is none
SAME_CYCLE = 1e-5
# relative change of (velocity, force) between two periods up to which the last one has what a
# steady one has to a percent, where friction damps what is left
NEARLY_PERIODIC = 1e-3
# difference of the squared axes of a path, over their sum, that is none
ROUND_PATH = 1e-12


@dataclass(frozen=True)
class FoundationMotion:
    """Foundation motion and normal load of Eq. 30, with an optional second direction."""

    # load frequency over foundation frequency, fp / fb
    ratio: Fraction
    # of the foundation, fb [Hz]
    frequency: float = 100.0
    # of the foundation [m]
    amplitude: tuple[float, float] = (0.005, 0.0)
    # of the y motion against the x motion [rad]
    phase: float = np.pi / 2
    # mean P0 [N]
    load: float = 50.0
    # amplitude P1 [N]; not used when the ratio is zero
    pulsation: float = 30.0
    # steady force on the mass [N]
    pull: tuple[float, float] = (0.0, 0.0)
    # phase of the load behind the foundation, in cycles of the load [1]
    lag: float = 0.0


@dataclass(frozen=True)
class Steady:
    """One steady period of (velocity, force)."""

    # over one common period of foundation and load
    motion: Motion
    # (s,) [s]
    time: np.ndarray
    # (s, 2) foundation displacement [m]
    base: np.ndarray
    # (s,) normal load [N]
    load: np.ndarray
    # foundation cycles in the smallest period of (velocity, force)
    cycles: int
    # reversals of the slip along ``axis``, halved, in that period
    loops: int
    # (3,) mean velocity [m/s, m/s, rad/s]
    drift: np.ndarray
    # change of (velocity, force) over the last period, relative
    residual: float
    # common periods marched
    periods: int
    # "periodic" or why the march stopped
    reason: str
    # (2,) unit vector along which the foundation moves most
    axis: np.ndarray

    @property
    def relative(self) -> np.ndarray:
        """(s, 2) displacement of the foundation relative to the mass, Eq. 31 [m]."""
        return self.base - self.motion.position[:, :2]

    @property
    def slips(self) -> bool:
        """Some of the footprint slips: without it nothing damps the motion from the start."""
        return bool(self.motion.slip.any())

    @property
    def is_known(self) -> bool:
        """The period tells amplitude, loops and drift of the steady motion."""
        return self.reason == PERIODIC or (self.slips and self.residual <= NEARLY_PERIODIC)


def steady(
    body: MassOnFoundation,
    drive: FoundationMotion,
    steps: int = 2000,
    most: int = 200,
    tolerance: float = 1e-7,
    progress: Progress = without_progress,
) -> Steady:
    """March until velocity and force repeat over the common period of foundation and load.

    Args:
        steps: time steps in one cycle of the foundation.
        most: largest number of common periods; the result then says "not periodic".
        tolerance: accepted relative change of (velocity, force) between two periods.
        progress: wraps the loop over periods.
    """
    q = drive.ratio.denominator
    dt = 1 / (drive.frequency * steps)
    time = dt * np.arange(q * steps + 1)
    base = ellipse(drive.amplitude, drive.phase, drive.frequency, time)
    pulsation = drive.pulsation if drive.ratio else 0.0
    beat = float(drive.ratio) * drive.frequency
    load = pulsating_load(drive.load, pulsation, beat, time - drive.lag / beat if beat else time)
    start = None
    last = None
    residual = np.inf
    label = f"motion, load at {beat:g} Hz"
    period = 0
    for _ in progress(range(most), label):
        period += 1
        motion = march(body, base, load, dt, start, drive.pull)
        residual = _relative_change(motion, last)
        start = (motion.position[-1], motion.velocity[-1], motion.springs)
        last = motion
        if residual < tolerance:
            break
    reason = PERIODIC
    if residual >= tolerance:
        reason = f"not periodic after {most} periods, change {residual:.1e}"
        if not motion.slip.any():
            reason += ": the mass never slips, so that nothing damps its motion from the start"
    cycles = _smallest_period(motion, steps, q)
    drift = motion.velocity.mean(axis=0)
    axis = main_axis(drive.amplitude, drive.phase)
    loops = count_loops(motion.slip[: cycles * steps] @ axis)
    return Steady(
        motion, time[1:], base[1:], load[1:], cycles, loops, drift, residual, period, reason, axis
    )


def main_axis(amplitude: tuple[float, float], phase: float) -> np.ndarray:
    """(2,) unit vector of the longest semi-axis of the foundation's path; x where it is a circle or
    at rest.

    Args:
        amplitude: along x and y [m].
        phase: of the y motion against the x motion [rad].
    """
    x, y = amplitude
    stretch = np.array([x**2 - y**2, 2 * x * y * np.cos(phase)])
    # cos(pi / 2) is not zero in floating point; a circle has no longest axis
    if np.hypot(*stretch) <= ROUND_PATH * (x**2 + y**2):
        return np.array([1.0, 0.0])
    angle = np.arctan2(stretch[1], stretch[0]) / 2
    # so that a path along x or y has an axis free of rounding
    axis = np.array([np.cos(angle), np.sin(angle)])
    return np.where(np.abs(axis) < ROUND_PATH, 0.0, axis)


def count_loops(slip: np.ndarray) -> int:
    """Open loops of one period: changes of direction of the slip, halved, cyclic; sticking in
    between does not count.

    Args:
        slip: (s,) signed slip in each step [m].
    """
    sign = np.sign(slip)
    sign = sign[sign != 0]
    return int(np.count_nonzero(sign != np.roll(sign, 1))) // 2


def spectrum(result: Steady) -> tuple[np.ndarray, np.ndarray]:
    """Lines of the displacement without its drift: frequency (l,) [Hz] and amplitude (l, 4) along
    x, y [m], theta [rad] and ``result.axis`` [m].

    From the velocity, which is periodic: amplitude = |v| / (2 pi f).
    """
    velocity = result.motion.velocity
    velocity = np.column_stack([velocity, velocity[:, :2] @ result.axis])
    lines = np.fft.rfft(velocity, axis=0)[1:] * 2 / len(result.time)
    frequency = np.fft.rfftfreq(len(result.time), result.motion.dt)[1:]
    return frequency, np.abs(lines) / (2 * np.pi * frequency[:, None])


def ratio_table(
    body: MassOnFoundation,
    ratios: Iterable[Fraction],
    steps: int = 1000,
) -> list[dict[str, float | str]]:
    """The paper's rule on many frequency ratios: one row each, with loops, denominator, drift and
    whether it holds.
    """
    rows: list[dict[str, float | str]] = []
    for ratio in ratios:
        result = steady(body, FoundationMotion(Fraction(ratio)), steps)
        rows.append(
            {
                "ratio": str(ratio),
                "denominator": ratio.denominator,
                "cycles": result.cycles,
                "loops": result.loops,
                "drift": float(result.drift[0]),
                "rule": result.loops == ratio.denominator,
                "reason": result.reason,
            }
        )
    return rows


def _relative_change(motion: Motion, last: Motion | None) -> float:
    """Largest relative change of velocity or force against the period before."""
    if last is None:
        return np.inf
    pairs = ((motion.velocity, last.velocity), (motion.force, last.force))
    scale = [np.abs(now[:, :2]).max() + 1e-300 for now, _ in pairs]
    return max(
        np.abs(now - then)[:, :2].max() / size
        for (now, then), size in zip(pairs, scale, strict=True)
    )


def _smallest_period(
    motion: Motion,
    steps: int,
    q: int,
) -> int:
    """Foundation cycles after which (velocity, force) repeat: the smallest divisor of q that
    fits.
    """
    # a mass at rest, or without friction, has zeros alone
    signal = np.hstack(
        [
            values[:, :2] / (np.abs(values).max() or 1.0)
            for values in (motion.velocity, motion.force)
        ]
    )
    for cycles in range(1, q):
        if (
            q % cycles == 0
            and np.abs(signal - np.roll(signal, -cycles * steps, axis=0)).max() < SAME_CYCLE
        ):
            return cycles
    return q

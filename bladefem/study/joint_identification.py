"""From measured frequency and damping at several amplitudes to the friction of a joint.

One mode with a patch of friction elements in parallel (Iwan 1966, doi:10.1115/1.3625199): their
whole stiffness is a share of the mode's, and the part (x / x_max)^(1/q) of them slips at amplitudes
below x, as a patch does whose pressure falls towards its edge. Each element answers with its first
harmonic in closed form. Slip softens: what it costs in stiffness is tied to the damping that it
gives. A joint that stiffens again has contacts that close: a stop beyond a clearance, without loss.
Intervals come from the sensitivities of the fit; what the data do not determine is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, linprog

from ..errors import InputError, NotSolvedError
from ..friction.closed_form import jenkins
from .fit_intervals import UNKNOWN_LOG_HALF_WIDTH, half_widths

# frequency with the joint stuck [Hz], damping without friction [1], joint's share of the modal
# stiffness [1], amplitude at which all of it slips [m], exponent of the distribution [1]
PARAMETERS = ("stuck_frequency", "damping", "share", "full_slip", "exponent")
# amplitude at which further contacts close [m], their share of the modal stiffness [1]
STOP_PARAMETERS = ("clearance", "stop_share")
# elements of the patch, graded in their limits; doubling them moves damping by less than 1e-3 of it
PATCH_ELEMENTS = 400
# limit of the first element over the smallest amplitude: below it all slip
FINEST_LIMIT_RATIO = 1e-3
# relative weights: what a frequency and a damping were measured to; frequencies of a joint scatter
# by more than an instrument, with every loading and temperature
FREQUENCY_ERROR = 1e-3
DAMPING_ERROR = 0.05
# slip limits of the patch that may have any distribution, and how far beyond the amplitudes
BOUND_LIMITS = 400
BOUND_REACH = 1e3
# slopes q from which the fit starts; the lowest end wins
START_SLOPES = (0.4, 0.8, 1.6)
# clearances over the largest amplitude, and shares of the stop, from which the fit starts
STOP_STARTS = ((0.5, 0.05), (0.7, 0.05), (0.9, 0.05))


@dataclass(frozen=True)
class JointFit:
    """The best parameters and what they are worth."""

    # (p,) in the order of `names`
    values: np.ndarray
    # (p, 2) 95 % intervals
    intervals: np.ndarray
    # (p,) whether the data determine the parameter
    known: np.ndarray
    # root of the mean square of the weighted misfit [1]
    misfit: float
    # (k,) of the measured amplitudes: used in the fit
    fitted: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """PARAMETERS, with a stop STOP_PARAMETERS after them."""
        return (PARAMETERS + STOP_PARAMETERS)[: len(self.values)]

    def sentence(self) -> str:
        """Which parameters the data determine, and which they do not."""
        unknown = [name for name, known in zip(self.names, self.known, strict=True) if not known]
        if not unknown:
            return "the data determine all parameters of the joint"
        return (
            f"the data do not determine {', '.join(unknown)}: each within a factor of two at best"
        )


def joint_curve(values: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [Hz] and damping [1] at amplitudes [m].

    Args:
        values: (5,) of PARAMETERS, or (7,) with STOP_PARAMETERS.
    """
    stuck, damping, share, full, exponent = values[:5]
    amplitude = np.asarray(amplitude, dtype=float)
    edges = np.geomspace(
        min(FINEST_LIMIT_RATIO * amplitude.min(), 0.5 * full), full, PATCH_ELEMENTS + 1
    )
    # what slips below the first edge is lost to stiffness and gives no loss
    part = np.diff((edges / full) ** (1 / exponent))
    limits = np.sqrt(edges[1:] * edges[:-1])
    # of elements with stiffness and limit 1: each depends on its amplitude over its limit alone
    law = jenkins(amplitude[:, None] / limits, 1.0, 1.0)
    stiffness = share * (law.stiffness @ part)
    loss = share * (law.damping @ part)
    squared = 1 - share + stiffness
    if len(values) > len(PARAMETERS):
        clearance, stop = values[5:]
        squared = squared + stop * stop_stiffness(amplitude, clearance)
    return stuck * np.sqrt(squared), damping + loss / (2 * squared)


def stop_stiffness(amplitude: np.ndarray, clearance: float) -> np.ndarray:
    """First-harmonic stiffness of a spring of stiffness 1 behind a clearance on both sides.

    1 - (2 / pi) (asin r + r sqrt(1 - r^2)), r = clearance / amplitude (Gelb and Vander Velde,
    Multiple-Input Describing Functions, 1968, App. B).
    """
    r = np.clip(clearance / np.asarray(amplitude, dtype=float), 0, 1)
    return 1 - 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r**2))


def fit_joint(
    amplitude: np.ndarray,
    frequency: np.ndarray,
    damping: np.ndarray,
    fitted: np.ndarray | None = None,
    stop: bool = False,
) -> JointFit:
    """Least squares on frequencies and dampings at some of the amplitudes.

    Args:
        amplitude: (k,) [m], frequency (k,) [Hz], damping (k,) share of critical [1].
        fitted: (k,) bool, levels that are used; all when left out.
        stop: also a stop beyond a clearance, for joints that stiffen again.

    Raises:
        InputError: too few levels, or numbers that are not positive.
    """
    measured = np.array([amplitude, frequency, damping], dtype=float)
    if not (np.isfinite(measured).all() and (measured > 0).all()):
        raise InputError("measured levels: expected positive finite numbers")
    used = np.ones(measured.shape[1], dtype=bool) if fitted is None else np.asarray(fitted)
    fewest = 4 if stop else 3
    if used.sum() < fewest:
        raise InputError(f"measured levels: {used.sum()} used, expected at least {fewest}")
    a, f, z = measured[:, used]

    def misfit(x: np.ndarray) -> np.ndarray:
        by_frequency, by_damping = joint_curve(_values(x), a)
        return np.concatenate(
            [(by_frequency / f - 1) / FREQUENCY_ERROR, (by_damping / z - 1) / DAMPING_ERROR]
        )

    starts, (low, high) = _starts(a, f, z, stop)
    ends = [
        least_squares(misfit, np.clip(start, low, high), bounds=(low, high)) for start in starts
    ]
    best = min(ends, key=lambda end: end.cost)
    half = half_widths(best.jac, best.fun)
    return JointFit(
        _values(best.x),
        np.exp(np.column_stack([best.x - half, best.x + half])),
        half < UNKNOWN_LOG_HALF_WIDTH,
        float(np.sqrt(np.mean(best.fun**2))),
        used,
    )


def least_frequency_miss(
    amplitude: np.ndarray,
    frequency: np.ndarray,
    damping: np.ndarray,
    within: float,
) -> float:
    """The smallest relative miss of frequency that any patch of friction elements must have at its
    worst level, whatever the distribution of its slip limits and though it knows all levels, while
    its damping is within a share of each measured one.

    A linear programme in the elements' stiffnesses, which are not negative: squared frequencies and
    losses are linear in them. The loss without friction counts as a constant share of the stuck
    joint's stiffness, which differs from a constant damping by the softening of it, a per cent.

    Args:
        amplitude: (k,) [m], frequency (k,) [Hz], damping (k,) share of critical [1].
        within: of the damping [1].

    Raises:
        NotSolvedError: the linear programme ends without a solution.
    """
    a, f, z = np.array([amplitude, frequency, damping], dtype=float)
    limits = np.geomspace(FINEST_LIMIT_RATIO * a.min(), BOUND_REACH * a.max(), BOUND_LIMITS)
    law = jenkins(a[:, None] / limits, 1.0, 1.0)
    one, none = np.ones((len(a), 1)), np.zeros((len(a), 1))
    # unknowns: the stuck joint, its loss, the elements, the miss; rows: levels, over f^2
    squared = np.hstack([one, none, law.stiffness - 1, none]) / f[:, None] ** 2
    loss = np.hstack([none, one, law.damping, none]) / f[:, None] ** 2
    miss = np.hstack([np.zeros((len(a), 2 + BOUND_LIMITS)), 2 * one])
    upper = loss - 2 * (1 + within) * z[:, None] * squared
    lower = 2 * (1 - within) * z[:, None] * squared - loss
    ones = np.ones(len(a))
    found = linprog(
        miss[0] / 2,
        np.vstack([squared - miss, -squared - miss, upper, lower]),
        np.concatenate([ones, -ones, 0 * ones, 0 * ones]),
        method="highs",
    )
    if not found.success:
        raise NotSolvedError(f"least miss of frequency: {found.message}")
    return float(found.fun)


def _starts(
    a: np.ndarray,
    f: np.ndarray,
    z: np.ndarray,
    stop: bool,
) -> tuple[list[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Logarithms of the parameters from which the fit starts, and their bounds."""
    low = [0.5 * f.min(), 1e-7, 1e-5, 1e-3 * a.min(), 0.05]
    high = [2.0 * f.max(), z.max(), 0.9, 1e4 * a.max(), 8.0]
    own = [[f.max(), 0.9 * z.min(), 0.05, 3 * a.max(), exponent] for exponent in START_SLOPES]
    if not stop:
        return [np.log(start) for start in own], (np.log(low), np.log(high))
    # without clearance it is a part of the stuck joint, beyond the data it is not seen
    low += [a.min(), 1e-5]
    high += [a.max(), 1.0]
    starts = [
        np.log([*start, part * a.max(), share]) for start in own for part, share in STOP_STARTS
    ]
    return starts, (np.log(low), np.log(high))


def _values(x: np.ndarray) -> np.ndarray:
    """Parameters from their logarithms."""
    return np.exp(x)

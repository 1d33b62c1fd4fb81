"""From measured frequency and damping at several amplitudes to the friction of a joint.

One mode with a patch of friction elements in parallel: their whole stiffness is a share of the
mode's, and element i of n starts to slip at the amplitude x_max ((i - 1/2) / n)^q, as a patch does
whose pressure falls towards its edge. Each element answers with its first harmonic in closed form.
Intervals come from the sensitivities of the fit; what the data do not determine is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from ..errors import InputError
from ..friction.closed_form import jenkins

# frequency with the joint stuck [Hz], damping without friction [1], joint's share of the modal
# stiffness [1], amplitude at which all of it slips [m], exponent of the distribution [1]
PARAMETERS = ("stuck_frequency", "damping", "share", "full_slip", "exponent")
# elements of the patch; doubling them moves damping by less than 1e-3 of it
ELEMENTS = 200
# relative weights: what a frequency and a damping were measured to
FREQUENCY_ERROR = 5e-4
DAMPING_ERROR = 0.05
# half width of the 95 % interval of a logarithm from which a parameter counts as unknown: times 2
UNKNOWN = np.log(2.0)
# slopes q from which the fit starts; the lowest end wins
STARTS = (0.4, 0.8, 1.6)


@dataclass(frozen=True)
class JointFit:
    """The best parameters and what they are worth."""

    # (5,) in the order of PARAMETERS
    values: np.ndarray
    # (5, 2) 95 % intervals
    intervals: np.ndarray
    # (5,) whether the data determine the parameter
    known: np.ndarray
    # root of the mean square of the weighted misfit [1]
    misfit: float
    # (k,) of the measured amplitudes: used in the fit
    fitted: np.ndarray

    def sentence(self) -> str:
        """Which parameters the data determine, and which they do not."""
        unknown = [name for name, known in zip(PARAMETERS, self.known, strict=True) if not known]
        if not unknown:
            return "the data determine all parameters of the joint"
        return (
            f"the data do not determine {', '.join(unknown)}: each within a factor of two at best"
        )


def joint_curve(values: np.ndarray, amplitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequency [Hz] and damping [1] at amplitudes [m] for values of PARAMETERS."""
    stuck, damping, share, full, exponent = values
    places = (np.arange(ELEMENTS) + 0.5) / ELEMENTS
    limits = full * places**exponent
    # of elements with stiffness and limit 1: each depends on its amplitude over its limit alone
    law = jenkins(np.asarray(amplitude)[:, None] / limits, 1.0, 1.0)
    stiffness = share * law.stiffness.mean(axis=1)
    loss = share * law.damping.mean(axis=1)
    squared = 1 - share + stiffness
    return stuck * np.sqrt(squared), damping + loss / (2 * squared)


def fit_joint(
    amplitude: np.ndarray,
    frequency: np.ndarray,
    damping: np.ndarray,
    fitted: np.ndarray | None = None,
) -> JointFit:
    """Least squares on frequencies and dampings at some of the amplitudes.

    Args:
        amplitude: (k,) [m], frequency (k,) [Hz], damping (k,) share of critical [1].
        fitted: (k,) bool, levels that are used; all when left out.

    Raises:
        InputError: too few levels, or numbers that are not positive.
    """
    measured = np.array([amplitude, frequency, damping], dtype=float)
    if not (np.isfinite(measured).all() and (measured > 0).all()):
        raise InputError("measured levels: expected positive finite numbers")
    used = np.ones(measured.shape[1], dtype=bool) if fitted is None else np.asarray(fitted)
    if used.sum() < 3:
        raise InputError(f"measured levels: {used.sum()} used, expected at least 3")
    a, f, z = measured[:, used]

    def misfit(x: np.ndarray) -> np.ndarray:
        by_frequency, by_damping = joint_curve(_values(x), a)
        return np.concatenate(
            [(by_frequency / f - 1) / FREQUENCY_ERROR, (by_damping / z - 1) / DAMPING_ERROR]
        )

    low = np.log([0.5 * f.min(), 1e-7, 1e-5, 1e-3 * a.min(), 0.05])
    high = np.log([2.0 * f.max(), z.max(), 0.9, 1e4 * a.max(), 8.0])
    ends = []
    for exponent in STARTS:
        start = np.log([f.max(), 0.9 * z.min(), 0.05, 3 * a.max(), exponent])
        ends.append(least_squares(misfit, np.clip(start, low, high), bounds=(low, high)))
    best = min(ends, key=lambda end: end.cost)
    half = _half_widths(best.jac, best.fun)
    return JointFit(
        _values(best.x),
        np.exp(np.column_stack([best.x - half, best.x + half])),
        half < UNKNOWN,
        float(np.sqrt(np.mean(best.fun**2))),
        used,
    )


def _values(x: np.ndarray) -> np.ndarray:
    """Parameters from their logarithms."""
    return np.exp(x)


def _half_widths(J: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    """(5,) half widths of the 95 % intervals of the logarithms; infinite where the data are blind.

    The scatter is that of the misfit, but at least that of the stated errors of measurement.
    """
    freedom = max(len(misfit) - J.shape[1], 1)
    scatter = max(1.0, float(np.sum(misfit**2)) / freedom)
    _, sizes, V = np.linalg.svd(J, full_matrices=False)
    with np.errstate(divide="ignore", over="ignore"):
        variance = ((V.T / sizes) ** 2).sum(axis=1) * scatter
    return np.minimum(stats.t.ppf(0.975, freedom) * np.sqrt(variance), 50.0)

"""From responses measured at several levels to the contact: friction coefficient, contact stiffness
and normal load as factors on those of a model.

Least squares on the logarithms of the amplitudes, with the exact sensitivities of the balance; the
logarithms of the factors are sought, so that intervals are factors as well. They hold what richer
models change (`fit_truncation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from ..errors import InputError, NotSolvedError
from ..hbm.model import ReducedModel
from ..hbm.parameters import vary
from ..hbm.sensitivity import sensitivities
from ..hbm.solution import Solution
from ..hbm.solve import solve
from ..hbm.solver.newton import DEFAULT_OPTIONS, Options
from ..util.arrays import BooleanArray, RealArray
from .adaptive.indicators import ESTIMATE_OPTIONS
from .fit_intervals import Knowledge, what_is_known
from .fit_truncation import LeftOut, RicherBalance, left_out, richer_balances

# factors that can be fitted: of the friction coefficient, the tangential and the normal stiffness,
# both of these at once, and the normal load; each with its names in `hbm.parameters`
CONTACT_PARAMETERS = {
    "mu": ("mu",),
    "kt": ("kt",),
    "kn": ("kn",),
    "stiffness": ("kt", "kn"),
    "load": ("load",),
}
STIFFNESSES = ("kt", "kn", "stiffness")
# largest factor either way
MAX_FACTOR = 100.0
# factors of the contact stiffness from which the fit may start, the best of them first: resonances
# that lie far from the measured ones have no slope towards them
START_STIFFNESS = np.geomspace(0.1, 10.0, 9)
MAX_STARTS = 3
# ratio to the measured amplitude that stands for one whose motion was not solved
LOST_RATIO = 0.1
# misfit over the stated error with which no other start is tried
ENOUGH_MISFIT = 1.5
# of the half width of an interval by the readings: a shift by a richer model that counts little
SMALL_SHIFT = 0.25
# relative change of the sum of squares and of the logarithms at which a fit ends
FIT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class MeasuredLevel:
    """Amplitudes under one excitation and one normal load."""

    # with this excitation and normal load, and the contact to start from
    model: ReducedModel
    # (k,) circular frequencies of the readings [rad/s]
    omega: RealArray
    # (k,) amplitude at the first probe, root of the sum of squares of the harmonics [m]
    amplitude: RealArray


@dataclass(frozen=True)
class ContactFit:
    """The best factors and what they are worth."""

    names: tuple[str, ...]
    # (p,) factors on the contact of the levels' models
    factors: RealArray
    # intervals in the same units, and what the data leave open
    knowledge: Knowledge
    # root of the mean square of the misfit over the stated error [1]
    misfit: float
    # of each level (k,), by the contact that the fit began with and by the fitted one [m]; NaN
    # where it was not solved
    before: list[RealArray]
    fitted: list[RealArray]
    # half widths (p,) of the 95 % intervals of the logarithms by the readings alone
    half_by_readings: RealArray
    # what richer models change, in the order in which they were given
    left_out: tuple[LeftOut, ...] = ()

    @property
    def held(self) -> tuple[LeftOut, ...]:
        """What is left out of the model and held by the intervals."""
        return tuple(one for one in self.left_out if one.widens)

    @property
    def apart(self) -> RealArray:
        """(p,) shifts of the logarithms by what no interval holds."""
        shifts = [one.shift for one in self.left_out if not one.widens]
        return np.sum([np.zeros(len(self.names)), *shifts], axis=0)

    @property
    def moved_apart(self) -> BooleanArray:
        """(p,) what no interval holds moves the parameter further than the readings tell it."""
        return np.asarray(abs(self.apart) > self.half_by_readings)

    def sentence(self) -> str:
        """What the data determine, and what they do not."""
        return self.knowledge.sentence("contact")


@dataclass
class _Fit:
    """The readings and the motions that belong to them."""

    levels: Sequence[MeasuredLevel]
    names: tuple[str, ...]
    H: int
    samples: int
    error: float
    # of each level, the last motions that were solved
    known: list[list[Solution]] = field(default_factory=list)
    options: Options = DEFAULT_OPTIONS

    def misfit(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) deviations of the logarithms over the error of measurement, and (k, p) derivatives.

        A reading whose motion is not solved is off by LOST_RATIO.
        """
        values, slopes = [], []
        for i, level in enumerate(self.levels):
            model = level.model
            for name, factor in zip(self.names, np.exp(x), strict=True):
                for part in CONTACT_PARAMETERS[name]:
                    model = vary(model, part, float(factor))
            for omega, amplitude in zip(level.omega, level.amplitude, strict=True):
                value, slope = self._reading(i, model, float(omega))
                lost = not value > 0
                ratio = LOST_RATIO if lost else value / amplitude
                values.append(np.log(ratio) / self.error)
                slopes.append(slope / self.error if lost else slope / (value * self.error))
        return np.array(values), np.array(slopes)

    def solved(self, misfit: np.ndarray) -> np.ndarray:
        """(k,) the deviations, NaN where the motion was not solved."""
        lost = np.isclose(np.exp(self.error * misfit), LOST_RATIO, rtol=1e-9, atol=0)
        return np.where(lost, np.nan, misfit)

    def amplitudes(self, misfit: np.ndarray) -> list[RealArray]:
        """Amplitudes [m] that have these deviations, level by level; NaN where not solved."""
        ratios = np.exp(self.error * self.solved(misfit))
        cuts = np.cumsum([len(level.omega) for level in self.levels])[:-1]
        measured = np.concatenate([level.amplitude for level in self.levels])
        return np.split(ratios * measured, cuts)

    def _reading(self, i: int, model: ReducedModel, omega: float) -> tuple[float, np.ndarray]:
        """Amplitude [m] and its derivatives (p,) at one frequency; zeros where it is not solved."""
        start = min(self.known[i], key=lambda s: abs(s.omega - omega), default=None)
        point = solve(model, omega, self.H, self.samples, start=start, options=self.options)
        if not point.converged:
            return 0.0, np.zeros(len(self.names))
        self.known[i] = [s for s in self.known[i] if s.omega != omega] + [point]
        parts = [CONTACT_PARAMETERS[name] for name in self.names]
        by = sensitivities(model, point, {part for few in parts for part in few})
        size = float(np.linalg.norm(point.probe[1:, 0]))
        return size, np.array([sum(by[part].size[0] for part in few) for few in parts])


def fit_contact(
    levels: Sequence[MeasuredLevel],
    names: Sequence[str] = ("mu", "kt", "kn", "load"),
    H: int = 3,
    samples: int = 128,
    error: float = 0.05,
    richer: Sequence[RicherBalance] | None = None,
    start: RealArray | None = None,
) -> ContactFit:
    """Factors on the contact that bring the amplitudes of all levels closest to the measured ones.

    Args:
        names: of CONTACT_PARAMETERS.
        error: to which an amplitude was measured, relative.
        richer: models that have what those of the levels leave out, by which the intervals are
            widened; more harmonics and samples when left out.
        start: (p,) factors to begin with; where a stiffness is sought several are tried when left
            out.

    Raises:
        InputError: unknown names, no readings, or fewer of them than parameters.
        NotSolvedError: no reading could be solved with any contact.
    """
    chosen = tuple(names)
    _check_levels(levels, chosen, error)
    fit = _Fit(levels, chosen, H, samples, error, [[] for _ in levels])
    begun, _ = fit.misfit(np.zeros(len(chosen)))
    ends: list[OptimizeResult] = []
    for first in _starts(fit) if start is None else [np.log(start)]:
        ends.append(_least_squares(fit, first))
        if np.mean(ends[-1].fun ** 2) < ENOUGH_MISFIT**2:
            break
    end = min(ends, key=lambda one: float(one.cost))
    fitted = fit.amplitudes(end.fun)
    if all(np.isnan(part).all() for part in fitted):
        raise NotSolvedError("no measured level could be solved with any contact")
    known = what_is_known(end.x, lambda x: fit.misfit(x)[0], end.jac, chosen)
    if richer is None:
        richer = richer_balances([level.model for level in levels], H, samples)
    left = tuple(_left_out(fit, end, one, SMALL_SHIFT * known.half) for one in richer)
    shifts = [one.shift for one in left if one.widens]
    return ContactFit(
        chosen,
        np.exp(end.x),
        known.widened(np.reshape(shifts, (-1, len(chosen))), chosen),
        float(np.sqrt(np.mean(end.fun**2))),
        fit.amplitudes(begun),
        fitted,
        known.half,
        left,
    )


def _left_out(fit: _Fit, end: OptimizeResult, richer: RicherBalance, small: RealArray) -> LeftOut:
    """What a richer model changes at the end of a fit."""
    models = zip(fit.levels, richer.models, strict=True)
    levels = [replace(level, model=model) for level, model in models]
    starts = [
        [start for point in points if (start := _as_start(point, level.model, richer.H))]
        for level, points in zip(levels, fit.known, strict=True)
    ]
    other = _Fit(levels, fit.names, richer.H, richer.samples, fit.error, starts, ESTIMATE_OPTIONS)

    def deviations(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, J = other.misfit(x)
        return other.solved(values), J

    return left_out(richer, deviations, end.x, np.isfinite(fit.solved(end.fun)), small)


def _as_start(point: Solution, model: ReducedModel, H: int) -> Solution | None:
    """A motion as a start for one of other harmonics on the same contact points; None where the
    points are others.
    """
    if point.w.shape[:2] != (len(model.elements.kt), model.directions):
        return None
    kept = min(point.w.shape[2], 2 * H + 1)
    w = np.zeros((*point.w.shape[:2], 2 * H + 1))
    w[..., :kept] = point.w[..., :kept]
    return replace(point, w=w)


def _starts(fit: _Fit) -> list[np.ndarray]:
    """Logarithms of the factors to start from, those next to the readings first."""
    stiff = np.array([float(name in STIFFNESSES) for name in fit.names])
    if not stiff.any():
        return [0 * stiff]
    starts = [np.log(factor) * stiff for factor in START_STIFFNESS]
    costs = [float(np.sum(fit.misfit(start)[0] ** 2)) for start in starts]
    return [starts[i] for i in np.argsort(costs, kind="stable")[:MAX_STARTS]]


def _least_squares(fit: _Fit, start: np.ndarray) -> OptimizeResult:
    """From logarithms of the factors; each motion is solved once for misfit and derivatives."""
    limit = np.log(MAX_FACTOR)
    known: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def both(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if x.tobytes() not in known:
            known[x.tobytes()] = fit.misfit(x)
        return known[x.tobytes()]

    return least_squares(
        lambda x: both(x)[0],
        start,
        jac=lambda x: both(x)[1],
        bounds=(-limit, limit),
        ftol=FIT_TOLERANCE,
        xtol=FIT_TOLERANCE,
    )


def _check_levels(levels: Sequence[MeasuredLevel], names: tuple[str, ...], error: float) -> None:
    unknown = [name for name in names if name not in CONTACT_PARAMETERS]
    if {"kt", "kn"} & set(names) and "stiffness" in names:
        raise InputError("parameters: 'stiffness' is both kt and kn, expected it or these")
    if unknown or not names:
        raise InputError(f"parameters {list(names)}: expected some of {list(CONTACT_PARAMETERS)}")
    if not 0 < error < np.inf:
        raise InputError(f"error {error}: expected a relative error of measurement above 0")
    for number, level in enumerate(levels, 1):
        if np.shape(level.omega) != np.shape(level.amplitude):
            raise InputError(
                f"level {number}: {np.size(level.omega)} frequencies and "
                f"{np.size(level.amplitude)} amplitudes, expected one amplitude a frequency"
            )
        both = np.concatenate([np.ravel(level.omega), np.ravel(level.amplitude)])
        if not (np.isfinite(both).all() and (both > 0).all()):
            raise InputError(f"level {number}: expected positive finite numbers")
        if "kn" in names and not (level.model.elements.kn > 0).any():
            raise InputError(
                f"kn: the normal load of level {number} is prescribed, expected kn > 0"
            )
    readings = sum(np.size(level.omega) for level in levels)
    if readings < len(names):
        raise InputError(
            f"{readings} readings: expected at least {len(names)}, one for each parameter"
        )

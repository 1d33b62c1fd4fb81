"""From measured hysteresis loops to the contact: friction coefficient, tangential and normal
stiffness, and normal load.

One contact follows the measured motion by Coulomb's law with springs, force by force as measured;
the derivatives go along exactly. Means of forces are left out: a rig measures them against a zero
of its own, and full stick leaves them undetermined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ..errors import InputError
from ..util.arrays import RealArray
from .fit_intervals import Knowledge, what_is_known

# samples of a loop that count as independent readings: neighbours share their errors
INDEPENDENT_SAMPLES = 20
# friction coefficients from which the fit starts, where no normal load tells it
START_FRICTION = 0.3
# of the largest force: limit from which the fit starts
START_LIMIT_SHARE = 0.95
# largest factor either way from the first guess
MAX_FACTOR = 100.0
# periods until the motion of the slider repeats
PERIODS = 2
# of the largest displacement: steps after a reversal from which the stiffness is guessed
STICKING_SHARE = 0.05


@dataclass(frozen=True)
class MeasuredLoop:
    """One period of one contact."""

    # (s,) tangential displacement, in the order of time [m]
    displacement: RealArray
    # (s,) friction force that opposes it [N]
    force: RealArray
    # mean normal load [N]; None where it was not measured
    load: float | None = None
    # (s,) how far the faces approach each other beyond the mean [m]; None: not at all
    approach: RealArray | None = None


@dataclass(frozen=True)
class LoopFit:
    """The best parameters and what they are worth."""

    # of LOOP_PARAMETERS
    names: tuple[str, ...]
    # (p,) in their units
    values: RealArray
    # intervals in the same units, and what the data leave open
    knowledge: Knowledge
    # root of the mean square of the misfit over the stated error [1]
    misfit: float
    # of each loop (s,) force by the fit, without its mean [N]
    fitted: list[RealArray]

    def sentence(self) -> str:
        """What the loops determine, and what they do not."""
        return self.knowledge.sentence("contact")


def fit_loops(loops: Sequence[MeasuredLoop], error: float = 0.02) -> LoopFit:
    """The contact whose forces are closest to the measured ones of all loops.

    kn is fitted where some loop has an approach, the normal load where some loop does not know it
    (one value for all of these).

    Args:
        error: of a measured force, over the largest of its loop.

    Raises:
        InputError: no loops, or numbers that do not fit.
    """
    _check_loops(loops, error)
    names = ["mu", "kt"]
    if any(loop.approach is not None for loop in loops):
        names.append("kn")
    if any(loop.load is None for loop in loops):
        names.append("load")

    def misfit(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = dict(zip(names, np.exp(x), strict=True))
        parts = [_deviation(loop, values, error) for loop in loops]
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])

    start = _first_guess(loops, names)
    limit = np.log(MAX_FACTOR)
    best = least_squares(
        lambda x: misfit(x)[0],
        start,
        jac=lambda x: misfit(x)[1],
        bounds=(start - limit, start + limit),
    )
    values = dict(zip(names, np.exp(best.x), strict=True))
    return LoopFit(
        tuple(names),
        np.exp(best.x),
        what_is_known(best.x, lambda x: misfit(x)[0], best.jac, names),
        float(np.sqrt(np.sum(best.fun**2) / (INDEPENDENT_SAMPLES * len(loops)))),
        [_without_mean(loop_force(loop, values)[0]) for loop in loops],
    )


def loop_force(loop: MeasuredLoop, values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """(s,) friction force [N] of one contact that follows a measured motion, and (s, p) its
    derivatives by the logarithms of the parameters.

    Args:
        values: name of LOOP_PARAMETERS to value; "kn" may be missing, "load" where the loop has
            its own.
    """
    x = np.asarray(loop.displacement, dtype=float)
    names = list(values)
    mu, kt = values["mu"], values["kt"]
    normal, by_normal = _normal_force(loop, values)
    limit = mu * normal
    by_limit = mu * by_normal
    by_limit[:, names.index("mu")] += limit
    f, df = 0.0, np.zeros(len(names))
    force, slope = np.zeros(len(x)), np.zeros((len(x), len(names)))
    for i in list(range(len(x))) * PERIODS:
        step = x[i] - x[i - 1]
        f += kt * step
        df[names.index("kt")] += kt * step
        if abs(f) > limit[i]:
            sign = np.sign(f)
            f, df = sign * limit[i], sign * by_limit[i]
        force[i], slope[i] = f, df
        df = df.copy()
    return force, slope


def _normal_force(loop: MeasuredLoop, values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """(s,) normal force [N], and (s, p) its derivatives by the logarithms."""
    count = len(loop.displacement)
    names = list(values)
    slope = np.zeros((count, len(names)))
    load = loop.load
    if load is None:
        load = values["load"]
        slope[:, names.index("load")] = load
    normal = np.full(count, float(load))
    if loop.approach is not None:
        change = values["kn"] * np.asarray(loop.approach, dtype=float)
        normal = normal + change
        slope[:, names.index("kn")] = change
    closed = normal > 0
    return np.where(closed, normal, 0.0), slope * closed[:, None]


def _deviation(
    loop: MeasuredLoop, values: dict[str, float], error: float
) -> tuple[np.ndarray, np.ndarray]:
    """(s,) differences of the force over its error, weighted as INDEPENDENT_SAMPLES readings, and
    their derivatives.
    """
    measured = _without_mean(np.asarray(loop.force, dtype=float))
    force, slope = loop_force(loop, values)
    weight = np.sqrt(INDEPENDENT_SAMPLES / len(measured)) / (error * abs(measured).max())
    return (
        weight * (_without_mean(force) - measured),
        weight * (slope - slope.mean(axis=0)),
    )


def _without_mean(x: np.ndarray) -> np.ndarray:
    return np.asarray(x - x.mean())


def _first_guess(loops: Sequence[MeasuredLoop], names: Sequence[str]) -> np.ndarray:
    """(p,) logarithms: stiffness by the steepest part after reversals, friction by the largest
    force.
    """
    stiffness, friction, loads = [], [], []
    for loop in loops:
        x, f = np.asarray(loop.displacement, float), _without_mean(np.asarray(loop.force, float))
        stiffness.append(_sticking_stiffness(x, f))
        loads.append(abs(f).max() / START_FRICTION if loop.load is None else loop.load)
        friction.append(abs(f).max() / loads[-1])
    guess = {
        # a limit that nothing reaches has no slope towards the measured one
        "mu": START_LIMIT_SHARE * max(friction),
        "kt": max(stiffness),
        "kn": max(stiffness),
        "load": max(loads),
    }
    return np.log([guess[name] for name in names])


def _sticking_stiffness(x: np.ndarray, f: np.ndarray) -> float:
    """Slope of the force shortly after the displacement turns [N/m]."""
    way = np.ptp(x)
    slopes = []
    for turn in (int(np.argmax(x)), int(np.argmin(x))):
        for k in range(1, len(x)):
            moved = x[(turn + k) % len(x)] - x[turn]
            if abs(moved) > STICKING_SHARE * way:
                slopes.append((f[(turn + k) % len(x)] - f[turn]) / moved)
                break
    best = max(slopes, default=0.0)
    return float(best) if best > 0 else float(np.ptp(f) / way)


def _check_loops(loops: Sequence[MeasuredLoop], error: float) -> None:
    if not loops:
        raise InputError("loops: none given, expected at least one")
    if not 0 < error < np.inf:
        raise InputError(f"error {error}: expected a relative error of measurement above 0")
    for number, loop in enumerate(loops, 1):
        parts = {"displacement": loop.displacement, "force": loop.force, "approach": loop.approach}
        for name, part in parts.items():
            if part is None:
                continue
            if np.shape(part) != np.shape(loop.displacement) or not np.isfinite(part).all():
                raise InputError(
                    f"loop {number}: {name} of shape {np.shape(part)}, expected finite numbers, "
                    "one for each displacement"
                )
        if np.size(loop.displacement) < 8 or not np.ptp(loop.displacement) > 0:
            raise InputError(f"loop {number}: expected a motion of at least 8 samples")
        if not np.ptp(loop.force) > 0:
            raise InputError(f"loop {number}: the force does not change, expected a measured one")
        if loop.load is not None and not 0 < loop.load < np.inf:
            raise InputError(f"loop {number}: normal load {loop.load}, expected a positive one")

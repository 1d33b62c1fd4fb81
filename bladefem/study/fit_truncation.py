"""What the model of a fit leaves out, in the parameters that were fitted.

What a richer model changes in the amplitudes is an error that all readings share, and no scatter of
theirs shows it: a balance of one harmonic moves the friction coefficient of a marched mass by
0.8 %, where readings of 1 % tell it to 0.2 %. The intervals are widened by as far as the parameters
move that fit the richer model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..hbm.model import ReducedModel
from ..util.arrays import BooleanArray, RealArray
from .fit_intervals import BLIND_SHARE, MAX_LOG_HALF_WIDTH

# harmonics up to which the next ones are as important as those taken: judged by four times as many
FEW_HARMONICS = 7
# samples of the model that judges them
MORE_SAMPLES = 4
# towards the best parameters of a richer model; the second corrects what the slope of the first
# missed, 15 % of a shift from one harmonic to seven
STEPS = 2
# of a logarithm: with parameters further off motions are lost
LARGEST_SHIFT = np.log(10.0)


@dataclass(frozen=True)
class RicherBalance:
    """A model that has what the one of a fit leaves out."""

    # in words: "more harmonics"
    what: str
    # of each level, with the contact that the fit begins with
    models: tuple[ReducedModel, ...]
    H: int
    samples: int
    # whether the intervals hold what it changes
    widens: bool = True


@dataclass(frozen=True)
class LeftOut:
    """What one richer model changes."""

    what: str
    # (p,) shifts of the logarithms of the parameters; MAX_LOG_HALF_WIDTH where it is not known
    shift: RealArray
    # readings whose motion the richer model did not solve
    unsolved: int
    # whether the intervals hold the shifts
    widens: bool = True


def richer_balances(
    models: Sequence[ReducedModel], H: int, samples: int
) -> tuple[RicherBalance, ...]:
    """More harmonics and more samples for the same bodies.

    Bodies that have no more harmonics are judged with half as many, which are more wrong than all.

    Args:
        models: of each level.
        samples: 0: slip and lift-off are located exactly.
    """
    most = min((len(model.sides) - 1 for model in models if len(model.sides) > 1), default=None)
    more = 4 * H + 3 if H < FEW_HARMONICS else 2 * H + 1
    if most is not None:
        more = min(more, most) if most > H else max(1, H // 2)
    enough = samples and max(samples, 8 * (more + 1))
    found = [RicherBalance("harmonics", tuple(models), more, enough)]
    if samples:
        found.append(RicherBalance("samples", tuple(models), H, MORE_SAMPLES * samples))
    return tuple(found)


def left_out(
    richer: RicherBalance,
    deviations: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    x: np.ndarray,
    kept: BooleanArray,
    small: RealArray,
) -> LeftOut:
    """How far the best parameters of a richer model lie from those of a fit: Gauss-Newton steps.

    Args:
        deviations: logarithms of the parameters to the deviations (k,) of the richer model over
            the error of measurement, NaN where not solved, and their derivatives (k, p).
        x: (p,) the end of the fit.
        kept: (k,) readings whose motion the model of the fit solved.
        small: (p,) shifts so small that one step is enough.
    """
    shift, lost = np.zeros(len(x)), np.zeros(len(kept), dtype=bool)
    for _ in range(STEPS):
        values, J = deviations(x + shift)
        solved = kept & np.isfinite(values)
        lost |= kept & ~solved
        if solved.sum() < len(x):
            unknown = np.full(len(x), MAX_LOG_HALF_WIDTH)
            return LeftOut(richer.what, unknown, int(lost.sum()), richer.widens)
        step = np.linalg.pinv(J[solved], rcond=BLIND_SHARE) @ values[solved]
        shift = np.clip(shift - step, -LARGEST_SHIFT, LARGEST_SHIFT)
        if (abs(shift) <= small).all():
            break
    # beyond these a linear step tells no more than that it is far
    shift = np.where(abs(shift) >= LARGEST_SHIFT, np.sign(shift) * MAX_LOG_HALF_WIDTH, shift)
    return LeftOut(richer.what, shift, int(lost.sum()), richer.widens)

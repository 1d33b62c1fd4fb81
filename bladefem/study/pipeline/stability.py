"""Are the motions of a curve stable? Floquet multipliers of its points, by shooting on the exact
flow.

Where normal loads are prescribed and the bodies damped there is one periodic motion and every other
one decays to it, so that nothing needs to be computed. Where they follow the motion, each solution
of the balance starts a shooting on the same modes in time; the multipliers of the closed period
tell how disturbances grow from one period to the next. The time form has no massless flexibility,
which costs some per cent of amplitude, and takes elements of one tangent and blades that move in
phase.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...damper.branch import state_of
from ...data import PortModel
from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution
from ...hbm.time_model import time_system
from ...time.shooting import floquet_multipliers, periodic_solution, probe_harmonics
from ...time.system import System

__all__ = ["UNIQUE", "Stability", "in_one_body", "stability_of", "stability_sentence"]

UNIQUE = "unique"
STABLE = "stable"
UNSTABLE = "unstable"
UNKNOWN = "unknown"
# largest multiplier of a stable motion: sliders that never move have exactly 1
ONE = 1 + 1e-5
# of Newton on the period; from a solution of the balance two or three do
STEPS = 8
# accepted change over a period: where 80 contacts rock, Newton stalls at 1e-5 to 4e-4, and the
# multipliers of two such ends differ by 4e-6
CLOSED = 1e-3
# relative distance of the first harmonic beyond which shooting has gone to another motion
NEAR = 0.1


@dataclass(frozen=True)
class Stability:
    """Of each point of a curve."""

    # (k,) "unique", "stable", "unstable" or "unknown"
    verdict: np.ndarray
    # (k,) largest modulus of the Floquet multipliers; NaN where it was not computed
    multiplier: np.ndarray
    # why nothing could be computed
    reason: str = ""


def stability_of(model: ReducedModel, points: Sequence[Solution]) -> Stability:
    """Verdicts on solutions of the balance of one model."""
    unknown = np.full(len(points), UNKNOWN)
    nothing = np.full(len(points), np.nan)
    solved = np.array([p.converged for p in points], dtype=bool)
    if model.directions == model.elements.tangents:
        return Stability(np.where(solved, UNIQUE, UNKNOWN), nothing)
    try:
        system = time_system(in_one_body(model), max(1, *model.excitation, *model.normal))
    except InputError as error:
        return Stability(unknown, nothing, str(error))
    largest = np.array([_largest(system, p) if p.converged else np.nan for p in points])
    verdict = np.where(np.isnan(largest), UNKNOWN, np.where(largest > ONE, UNSTABLE, STABLE))
    return Stability(verdict, largest)


def _largest(system: System, point: Solution) -> float:
    """Largest modulus of the multipliers; NaN where shooting does not confirm the point."""
    shot = periodic_solution(system, point.omega, state_of(point, system), most=STEPS)
    if (
        not shot.residual < CLOSED
        or abs(probe_harmonics(shot, system, 1)[0, 1] / point.probe[1, 0] - 1) > NEAR
    ):
        return np.nan
    return float(np.abs(floquet_multipliers(shot)).max())


def in_one_body(model: ReducedModel) -> ReducedModel:
    """One body for all harmonics, without residual flexibility: what can be integrated in time.

    Raises:
        InputError: blades do not move in phase, or the damper's harmonics are not the same body.
    """
    side = model.side(1)
    same = all(
        s is side or (np.array_equal(s.omega, side.omega) and np.allclose(s.shapes, side.shapes))
        for s in model.sides
    )
    if not same or abs(side.shapes.imag).max() > 1e-9 * abs(side.shapes).max():
        raise InputError(
            "blades in a travelling wave, expected blades that move in phase (engine order 0, or "
            "excitation.phase = 0)"
        )
    damper = model.damper
    if isinstance(damper, tuple):
        damper = (_without_residual(damper[0]),)
    return replace(model, sides=(_without_residual(side),), damper=damper)


def _without_residual(body: PortModel) -> PortModel:
    return replace(body, shapes=body.shapes.real, residual=0 * body.residual.real)


def stability_sentence(parts: Sequence[tuple[np.ndarray, np.ndarray]]) -> str:
    """What was found on all curves, for the report.

    Args:
        parts: verdicts and multipliers of each curve.
    """
    verdict, largest = (np.concatenate(column) for column in zip(*parts, strict=True))
    counts = {name: int((verdict == name).sum()) for name in (UNIQUE, STABLE, UNSTABLE, UNKNOWN)}
    if counts[UNIQUE]:
        return (
            "stability: normal loads are prescribed, so that each periodic motion is the only "
            "one, and stable"
        )
    if counts[UNKNOWN] == len(verdict):
        return (
            "stability is unknown: no point could be closed in time (that takes elements of one "
            "tangent, blades "
            "that move in phase)"
        )
    return (
        f"stability: {counts[STABLE]} points stable, {counts[UNSTABLE]} unstable (largest Floquet "
        "multiplier "
        f"{np.nanmax(largest):.4g}), {counts[UNKNOWN]} not closed in time; without residual "
        "flexibility"
    )

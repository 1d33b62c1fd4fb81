"""Are the motions of a curve stable? The verdicts of `bladefem.hbm.stability` on its points.

Every converged point is judged where that is affordable; of larger models the local maxima alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...data import PortModel
from ...errors import InputError
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution, size
from ...hbm.stability import (
    AFFORDABLE,
    STABLE,
    UNIQUE,
    UNKNOWN,
    UNSTABLE,
    stability_verdict,
)

if TYPE_CHECKING:
    from .loads import Curve

# local maxima of a curve that are judged whatever that takes
MAXIMA = 4


@dataclass(frozen=True)
class Stability:
    """Of each point of a curve."""

    # (k,) "unique", "stable", "unstable" or "unknown"
    verdict: np.ndarray
    # (k,) largest modulus of the Floquet multipliers; NaN where it was not computed
    multiplier: np.ndarray
    # why nothing could be computed
    reason: str = ""
    # (k,) "fold", "period doubling" or "torus" of unstable points, else ""
    bifurcation: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype="<U15"))


def stability_of(model: ReducedModel, points: Sequence[Solution]) -> Stability:
    """Verdicts on solutions of the balance of one model, in the order of a curve."""
    found = [stability_verdict(model, point, AFFORDABLE) for point in points]
    for i in _maxima(points):
        if found[i].verdict == UNKNOWN:
            found[i] = stability_verdict(model, points[i])
    reasons = [v.reason for v, p in zip(found, points, strict=True) if p.converged and v.reason]
    return Stability(
        np.array([v.verdict for v in found]),
        np.array([v.multiplier for v in found]),
        reasons[0] if len(reasons) == len(points) else "",
        np.array([v.bifurcation for v in found], dtype="<U15"),
    )


def _maxima(points: Sequence[Solution]) -> list[int]:
    """Numbers of the local maxima along each piece of the curve, the highest MAXIMA of them."""
    heights = np.array([size(p) if p.converged else 0.0 for p in points])
    branch = np.array([p.branch for p in points])
    found: list[int] = []
    for number in np.unique(branch):
        rows = np.flatnonzero((branch == number) & (heights > 0))
        own = np.concatenate([[0.0], heights[rows], [0.0]])
        found += rows[(own[1:-1] >= own[:-2]) & (own[1:-1] >= own[2:])].tolist()
    return sorted(found, key=lambda i: -heights[i])[:MAXIMA]


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
            "stability is unknown: no point could be judged (it takes Coulomb's law, a wave that "
            "repeats after few blades, and not too many contact nodes that slip)"
        )
    worst = f" (largest Floquet multiplier {np.nanmax(largest):.4g})" if counts[UNSTABLE] else ""
    return (
        f"stability: {counts[STABLE]} points stable, {counts[UNSTABLE]} unstable{worst}, "
        f"{counts[UNKNOWN]} not judged"
    )


def unstable_sentence(curve: Curve) -> str:
    """What became of a resonance that is unstable, or ""."""
    several = int(curve.branch.max(initial=0))
    folded = (
        f"load {curve.load:g} N: several motions at one frequency, the response has {several} "
        "pieces between folds"
        if several > 1
        else ""
    )
    top = curve.unstable_peak
    if top is None:
        return folded
    at = int(np.flatnonzero(curve.frequency == top.frequency)[0])
    named = f" ({curve.bifurcation[at]})" if curve.bifurcation[at] else ""
    lost = (
        f"load {curve.load:g} N: the highest motion, {1e6 * size(top):.4g} um at "
        f"{top.frequency:.5g} Hz, is unstable{named}; the resonance given is the highest one that "
        f"is not, {1e6 * curve.peak_amplitude:.4g} um at {curve.peak_frequency:.5g} Hz"
    )
    if curve.kept is not None:
        lost += f"; {curve.kept.sentence}"
    return f"{folded}; {lost}" if folded else lost

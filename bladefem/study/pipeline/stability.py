"""Are the motions of a curve stable? The verdicts of `bladefem.hbm.stability` on its points.

Every converged point is judged where that is affordable; of larger models the local maxima, the
neighbours of the highest one, and points spread over the curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...data import PortModel
from ...errors import InputError, NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.sector_modes import blades_of_wave
from ...hbm.solution import Solution, size
from ...hbm.solve import solve, solve_near
from ...hbm.solver.newton import DEFAULT_OPTIONS
from ...hbm.stability import (
    MAX_OPERATIONS,
    STABLE,
    UNIQUE,
    UNKNOWN,
    UNSTABLE,
    Verdict,
    stability_verdict,
    verdict_operations,
)
from ..adaptive.family import Family, family_member
from ..adaptive.settings import Settings

if TYPE_CHECKING:
    from .loads import Curve

# local maxima of a curve that are judged first
MAX_JUDGED_MAXIMA = 4
# operations of all verdicts on a curve, some 0.5 s: less than its points take
CURVE_OPERATIONS = 1.2e10
# of solving a point again with JUDGED_HARMONICS; more take as many times more as their square
RICHER_OPERATIONS = 5e8
# points that are judged in addition, as long as the highest one that is not unstable is not judged
POINTS_JUDGED_IN_ADDITION = 8
# with which points of one harmonic are judged
JUDGED_HARMONICS = 7
JUDGED_SAMPLES = 128
# a motion that Newton's method does not reach from the point is not looked for: one such search
# cost twice the verdicts of a curve
JUDGED_OPTIONS = replace(DEFAULT_OPTIONS, iterations=25, fallbacks=False)
# harmonics and samples up to which an unstable motion is followed to be judged again: with seven,
# waves of the shipped wedge under 290 N grow by 28 % a period that a march lets decay, and with
# fifteen under 73 N by 26 %
CONFIRMING = ((15, 256), (31, 512))
# of the amplitude: by which the motion with so many may differ to be the same one
SAME_MOTION = 0.03
# motions that stay unstable, after which no other one of a curve is judged again
CONFIRMED_MOTIONS = 2
# operations of all these verdicts on a curve, some 3.5 s: eight motions of the shipped wedge
CONFIRMING_OPERATIONS = 1e11
# harmonics with whose bodies a travelling wave is asked whether it repeats
RING_HARMONICS = (7, 15, 31)


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


@dataclass(frozen=True)
class RicherModel:
    """The model of a curve with bodies of more harmonics, to judge unstable motions again."""

    model: ReducedModel
    harmonics: int
    samples: int


def stability_of(
    model: ReducedModel,
    points: Sequence[Solution],
    richer: Sequence[RicherModel] = (),
) -> Stability:
    """Verdicts on solutions of the balance of one model, in the order of a curve.

    Every point is judged where CURVE_OPERATIONS allow it. Else the highest point is, and as far as
    they allow the other local maxima, its neighbours, and points spread evenly over the curve; at
    last whichever point is then the highest of those that are not unstable. Unstable ones are
    judged again with more harmonics, from the highest down, as far as CONFIRMING_OPERATIONS allow
    it and until CONFIRMED_MOTIONS of them stay unstable; so is the highest that is not.
    """
    found = [Verdict(UNKNOWN, reason="it was left out for its cost") for _ in points]
    motions = list(points)
    costs = [_judging_operations(model, point) for point in points]
    maxima = _maxima(points)
    budget = CURVE_OPERATIONS
    judged: set[int] = set()
    for i in [*maxima, *_neighbours(maxima, len(points)), *_spread(len(points))]:
        highest = i in maxima[:1]
        if i in judged or (costs[i] > budget and not highest):
            continue
        motions[i] = judged_motion(model, points[i])
        found[i] = stability_verdict(model, motions[i], MAX_OPERATIONS if highest else costs[i])
        judged.add(i)
        budget -= costs[i]
    again = _judge_again(found, motions, richer)
    for _ in range(POINTS_JUDGED_IN_ADDITION):
        lasting = [i for i in range(len(points)) if found[i].verdict != UNSTABLE]
        top = max(lasting, key=lambda i: size(points[i]) * points[i].converged, default=None)
        if top is None or top in again:
            break
        if top not in judged:
            motions[top] = judged_motion(model, points[top])
            found[top] = stability_verdict(model, motions[top])
        stayed = sum(found[i].verdict == UNSTABLE for i in again)
        if found[top].verdict != UNSTABLE or stayed < CONFIRMED_MOTIONS:
            found[top], _ = judged_again(found[top], motions[top], richer)
        judged.add(top)
        again.add(top)
    reasons = [v.reason for v, p in zip(found, points, strict=True) if p.converged and v.reason]
    return Stability(
        np.array([v.verdict for v in found]),
        np.array([v.multiplier for v in found]),
        reasons[0] if len(reasons) == len(points) else "",
        np.array([v.bifurcation for v in found], dtype="<U15"),
    )


def richer_models(models: Family, settings: Settings) -> list[RicherModel]:
    """The models of a curve's settings with the harmonics of CONFIRMING, as far as they are more
    than it has and its bodies are known for them.
    """
    known = max(settings.harmonics, JUDGED_HARMONICS)
    return [
        RicherModel(
            family_member(models, replace(settings, harmonics=harmonics, samples=samples)).model,
            harmonics,
            samples,
        )
        for harmonics, samples in CONFIRMING
        if known < harmonics <= models.harmonics
    ]


def _judge_again(
    found: list[Verdict],
    motions: Sequence[Solution],
    richer: Sequence[RicherModel],
) -> set[int]:
    """Judge unstable motions again, from the highest down, and put the verdicts in their places.

    Args:
        motions: those that were judged.

    Returns:
        numbers of those that were judged again.
    """
    budget = CONFIRMING_OPERATIONS
    stayed = 0
    again: set[int] = set()
    unstable = [i for i in range(len(found)) if found[i].verdict == UNSTABLE]
    for i in sorted(unstable, key=lambda i: -size(motions[i])):
        if budget <= 0 or stayed >= CONFIRMED_MOTIONS:
            break
        found[i], spent = judged_again(found[i], motions[i], richer)
        again.add(i)
        stayed += found[i].verdict == UNSTABLE
        budget -= spent
    return again


def judged_again(
    verdict: Verdict,
    motion: Solution,
    richer: Sequence[RicherModel],
) -> tuple[Verdict, float]:
    """The verdict on a motion with as many more harmonics as it is found with, else the one there
    was; and the operations that it took.

    Where all contacts stick, more harmonics change nothing; where some lift off, they mostly are
    not solved, and it is not tried.

    Args:
        motion: the one that was judged.
        richer: models from poor to rich; the motion with one is the start for the next.
    """
    spent = 0.0
    found = None
    last = motion
    known = verdict.verdict in (STABLE, UNSTABLE)
    for some in richer if known and motion.states["slip"] and not motion.states["lift"] else ():
        spent += RICHER_OPERATIONS * (some.harmonics / JUDGED_HARMONICS) ** 2
        try:
            again = solve_near(
                some.model, motion.omega, some.harmonics, some.samples, last, JUDGED_OPTIONS
            )
        except (InputError, NotSolvedError):
            continue
        if again.converged and abs(size(again) / size(motion) - 1) <= SAME_MOTION:
            found = some.model
            last = again
    if found is None:
        return verdict, spent
    told = stability_verdict(found, last)
    spent += verdict_operations(found, last)
    return told if told.verdict in (STABLE, UNSTABLE) else verdict, spent


def _judging_operations(model: ReducedModel, point: Solution) -> float:
    """Operations of the verdict on a point, with those of `judged_motion`."""
    own = verdict_operations(model, point)
    return own + RICHER_OPERATIONS * (own > 0 and point.harmonics == 1)


def judged_motion(model: ReducedModel, point: Solution) -> Solution:
    """The point itself, or its motion with more harmonics where it has the first one alone: stick
    and slip of that one may be called unstable where the motion is not.
    """
    if not point.converged or point.harmonics > 1 or verdict_operations(model, point) == 0:
        return point
    samples = max(point.samples, JUDGED_SAMPLES)
    try:
        richer = solve(
            model, point.omega, JUDGED_HARMONICS, samples, start=point, options=JUDGED_OPTIONS
        )
    except (InputError, NotSolvedError):
        return point
    return richer if richer.converged else point


def model_in_time(models: Family, settings: Settings) -> ReducedModel:
    """The model with bodies of as many harmonics as its wave needs to repeat; that of the settings
    where none has.
    """
    own = family_member(models, settings).model
    for harmonics in (settings.harmonics, *RING_HARMONICS):
        if harmonics > models.harmonics:
            break
        model = family_member(models, replace(settings, harmonics=harmonics)).model
        try:
            blades_of_wave(model)
        except InputError:
            continue
        return model
    return own


def _neighbours(maxima: Sequence[int], count: int) -> list[int]:
    """Numbers of the points next to the highest maximum."""
    return [i for m in maxima[:1] for i in (m - 1, m + 1) if 0 <= i < count]


def _spread(count: int) -> list[int]:
    """All numbers, each part of them from the first on spread evenly."""
    order = list(dict.fromkeys(k for n in range(1, 12) for k in range(0, count, 2 ** (11 - n))))
    return [*order, *range(count)]


def _maxima(points: Sequence[Solution]) -> list[int]:
    """Numbers of the local maxima along each piece of the curve, the highest MAX_JUDGED_MAXIMA of
    them.
    """
    heights = np.array([size(p) if p.converged else 0.0 for p in points])
    branch = np.array([p.branch for p in points])
    found: list[int] = []
    for number in np.unique(branch):
        rows = np.flatnonzero((branch == number) & (heights > 0))
        own = np.concatenate([[0.0], heights[rows], [0.0]])
        found += rows[(own[1:-1] >= own[:-2]) & (own[1:-1] >= own[2:])].tolist()
    return sorted(found, key=lambda i: -heights[i])[:MAX_JUDGED_MAXIMA]


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


@dataclass(frozen=True)
class Disturbances:
    """Those that the points of a travelling wave were judged against."""

    # after which they repeat, as the wave does; 1 where all move in phase, or no wave can be judged
    blades: int = 1
    # nodal diameters that they are made of, and how many the wheel has; none without a wheel
    diameters: tuple[int, ...] = ()
    possible: int = 0

    @property
    def sentence(self) -> str:
        """What was looked at, and what was not; "" where nothing is left."""
        if self.blades == 1:
            return ""
        found = f"disturbances that repeat after {self.blades} blades, as the wave does, were"
        if not self.diameters:
            return f"{found} looked at, not those of other nodal diameters"
        listed = ", ".join(map(str, self.diameters))
        others = self.possible - len(self.diameters)
        return (
            f"{found} looked at (nodal diameters {listed}), not those of the other {others} nodal "
            "diameters"
        )


def judged_disturbances(
    models: Family,
    settings: Settings,
    engine_order: int = 0,
    sectors: int = 0,
) -> Disturbances:
    """What the verdicts on a family of models look at.

    Args:
        sectors: of the wheel; 0 without one.
    """
    try:
        blades = blades_of_wave(model_in_time(models, settings))
    except InputError:
        return Disturbances()
    if not sectors:
        return Disturbances(blades)
    turned = ((h * engine_order) % sectors for h in range(blades))
    diameters = sorted({min(n, sectors - n) for n in turned})
    return Disturbances(blades, tuple(diameters), sectors // 2 + 1)


def stability_sentence(
    parts: Sequence[tuple[np.ndarray, np.ndarray]],
    judged: Disturbances = Disturbances(),
) -> str:
    """What was found on all curves, for the report.

    Args:
        parts: verdicts and multipliers of each curve.
        judged: what they looked at.
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
    left_out = ""
    if counts[UNKNOWN]:
        left_out = (
            " (of curves whose verdicts would cost more than their points, the local maxima, the "
            "neighbours of the highest and points spread evenly are judged)"
        )
    wave = f"; {judged.sentence}" if judged.sentence else ""
    return (
        f"stability: {counts[STABLE]} points stable, {counts[UNSTABLE]} unstable{worst}, "
        f"{counts[UNKNOWN]} not judged{left_out}{wave}"
    )


def ripple_sentence(curves: Sequence[Curve], accuracy: float) -> str:
    """The resonances that are unstable, but left for a motion of the same amplitude within an
    accuracy, or "".

    A rigid damper on its contacts has no damping at its own frequencies of some kilohertz: there
    small ripples grow, and the blade hardly takes note of them.
    """
    moved = [
        max(abs(end / size(c.unstable_peak) - 1) for end in (c.kept.lowest, c.kept.highest))
        for c in curves
        if c.unstable_peak is not None and c.kept is not None and _rippled(c, accuracy)
    ]
    if not moved:
        return ""
    loads = ", ".join(f"{c.load:g} N" for c in curves if _rippled(c, accuracy))
    return (
        f"under {loads} the motion at the resonance is unstable to a ripple; marched in time from "
        f"there the amplitude stays within {100 * max(moved):.1f} % of the one given"
    )


def _rippled(curve: Curve, accuracy: float) -> bool:
    if not curve.keeps_unstable or curve.kept is None:
        return False
    return curve.kept.holds(size(curve.peak), accuracy)


def folded_sentence(curves: Sequence[Curve]) -> str:
    """The curves with several motions at one frequency, or ""."""
    pieces = {f"{c.load:g} N": int(c.branch.max(initial=0)) for c in curves}
    each = ", ".join(f"{load} ({count} pieces)" for load, count in pieces.items() if count > 1)
    return f"several motions at one frequency, pieces between folds: {each}" if each else ""


def unstable_sentence(curve: Curve, accuracy: float) -> str:
    """What became of a resonance that is unstable and not left for a ripple alone, or ""."""
    top = curve.unstable_peak
    if top is None or _rippled(curve, accuracy):
        return ""
    at = int(np.flatnonzero(curve.frequency == top.frequency)[0])
    named = f" ({curve.bifurcation[at]})" if curve.bifurcation[at] else ""
    lost = (
        f"load {curve.load:g} N: the highest motion, {1e6 * size(top):.4g} um at "
        f"{top.frequency:.5g} Hz, is unstable{named}"
    )
    if curve.marched_instead:
        lost += f"; the amplitude given, {1e6 * curve.peak_amplitude:.4g} um, is of a march"
    elif curve.keeps_unstable and curve.kept is not None and not curve.kept.reason:
        lost += "; it is given as the resonance"
    elif curve.keeps_unstable:
        lost += "; it is given as the resonance, being the larger amplitude"
    else:
        lost += (
            "; the resonance given is the highest one that is not, "
            f"{1e6 * curve.peak_amplitude:.4g} um at {curve.peak_frequency:.5g} Hz"
        )
    return lost if curve.kept is None else f"{lost}; {curve.kept.sentence}"

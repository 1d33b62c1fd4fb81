"""Are the motions of a curve stable? The verdicts of `bladefem.hbm.stability` on its points.

Every converged point is judged where that is affordable; of larger models the local maxima, the
neighbours of the highest one, and points spread over the curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
    UNKNOWN,
    UNSTABLE,
    Verdict,
    stability_verdict,
    verdict_operations,
)
from ..adaptive.check_points import heights_of
from ..adaptive.family import Family, family_member
from ..adaptive.settings import Settings
from .highest_stable import highest_lasting, next_to_judge

# local maxima of a curve that are judged first
MAX_JUDGED_MAXIMA = 4
# operations of all verdicts on a curve, some 0.5 s: less than its points take
CURVE_OPERATIONS = 1.2e10
# over those estimated of a verdict: more instants, four times as many, are not made
ESTIMATE_MARGIN = 2.0
# of solving a point again with JUDGED_HARMONICS; more take as many times more as their square
RICHER_OPERATIONS = 5e8
# points that are judged in addition, until the highest one that is not unstable is known: by
# bisection a curve of thirty points takes six
POINTS_JUDGED_IN_ADDITION = 40
# with which points of one harmonic are judged
JUDGED_HARMONICS = 7
JUDGED_SAMPLES = 128
# a motion that Newton's method does not reach from the point is not looked for: one such search
# cost twice the verdicts of a curve
JUDGED_OPTIONS = replace(DEFAULT_OPTIONS, iterations=25, fallbacks=False)
# harmonics and samples with which unstable motions are judged again, from poor to rich: with few
# harmonics a motion may seem to grow by 28 % a period that a march lets decay
CONFIRMING = ((15, 256), (31, 512))
# of the amplitude: by which the motion with so many may differ to be the same one
SAME_MOTION = 0.03
# motions that stay unstable, after which no other one of a curve is judged again
CONFIRMED_MOTIONS = 2
# operations of all these verdicts on a curve, some 3.5 s: eight motions of the shipped wedge
CONFIRMING_OPERATIONS = 1e11
# modes of marches and of verdicts on the highest motions, where the scene leaves their number to
# the choice: ripples live in modes far above the excitation, of which the motion itself may need
# none
MODES_IN_TIME = 20
# harmonics with whose bodies a travelling wave is asked whether it repeats
RING_HARMONICS = (7, 15, 31)


@dataclass(frozen=True)
class Stability:
    """Stability verdicts on the points of a curve."""

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
    they allow the other local maxima, its neighbours, and points spread evenly over the curve.
    Unstable ones are judged again with more harmonics, from the highest down, as far as
    CONFIRMING_OPERATIONS allow it and until CONFIRMED_MOTIONS of them stay unstable; so is the
    highest point in any case.
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
        most = MAX_OPERATIONS if highest else ESTIMATE_MARGIN * costs[i]
        found[i] = stability_verdict(model, motions[i], most)
        judged.add(i)
        budget -= costs[i]
    again = _judge_again(found, motions, richer)
    top = maxima[0] if maxima else None
    if top is not None and top not in again:
        found[top], _ = judged_again(found[top], motions[top], richer)
    reasons = [v.reason for v, p in zip(found, points, strict=True) if p.converged and v.reason]
    return _marks(found, reasons[0] if len(reasons) == len(points) else "")


def judged_above(
    model: ReducedModel,
    points: Sequence[Solution],
    richer: Sequence[RicherModel],
    marks: Stability,
    least: float,
) -> Stability:
    """The verdicts on a curve with more of them, until the highest motion above an amplitude is
    known that is not unstable, or that there is none: by bisection along each piece of the curve
    between unstable motions and lower ones, with at most POINTS_JUDGED_IN_ADDITION verdicts.

    Args:
        marks: what `stability_of` gives.
        least: the amplitude [m].
    """
    branch = np.array([point.branch for point in points])
    heights = heights_of(points)
    found = [
        Verdict(*each)
        for each in zip(marks.verdict, marks.multiplier, marks.bifurcation, strict=True)
    ]
    judged = set(np.flatnonzero(marks.verdict != UNKNOWN).tolist())
    confirmed: set[int] = set()
    stayed = 0
    for _ in range(POINTS_JUDGED_IN_ADDITION):
        verdicts = np.array([v.verdict for v in found])
        asked = next_to_judge(heights, branch, verdicts, judged, least)
        asked = highest_lasting(heights, verdicts) if asked is None else asked
        if asked is None or asked in confirmed or heights[asked] <= least:
            break
        motion = judged_motion(model, points[asked])
        if asked not in judged:
            found[asked] = stability_verdict(model, motion)
        # a motion that lasts by few harmonics is the answer: it has to last by more of them
        if found[asked].verdict != UNSTABLE or stayed < CONFIRMED_MOTIONS:
            found[asked], _ = judged_again(found[asked], motion, richer)
        stayed += found[asked].verdict == UNSTABLE
        judged.add(asked)
        confirmed.add(asked)
    return _marks(found, marks.reason)


def _marks(found: Sequence[Verdict], reason: str) -> Stability:
    return Stability(
        np.array([v.verdict for v in found]),
        np.array([v.multiplier for v in found]),
        reason,
        np.array([v.bifurcation for v in found], dtype="<U15"),
    )


def settings_in_time(models: Family, settings: Settings) -> Settings:
    """The settings with the modes of marches and of verdicts on the highest motions."""
    if "modes" not in settings.chosen:
        return settings
    return replace(settings, modes=max(settings.modes, min(MODES_IN_TIME, models.modes)))


def richer_models(models: Family, settings: Settings) -> list[RicherModel]:
    """The models of a curve's settings with the harmonics of CONFIRMING, as far as they are more
    than it has and its bodies are known for them.
    """
    settings = settings_in_time(models, settings)
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
    judged = stability_verdict(found, last)
    spent += verdict_operations(found, last)
    return judged if judged.verdict in (STABLE, UNSTABLE) else verdict, spent


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

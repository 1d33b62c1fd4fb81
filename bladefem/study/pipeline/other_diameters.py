"""Is the resonance of a travelling wave left by disturbances in nodal diameters that its own
harmonics never reach?

Only the motion that is given as the resonance is asked (`bladefem.hbm.other_diameters`), with the
bodies that `bladefem.reduction.other_diameters` has for these diameters. What replaces the wave
there is no wave, and is not looked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import gcd, isfinite

from ...errors import InputError, NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.other_diameters import class_angle, class_diameters, class_multiplier
from ...hbm.sector_modes import blades_of_wave
from ...hbm.solution import Solution
from ...hbm.solve import solve
from ...hbm.stability import (
    INSTANT_REFINEMENT,
    INSTANTS_PER_PERIOD,
    UNSTABLE_GROWTH,
    has_one_motion,
)
from ..adaptive.family import Family
from ..adaptive.settings import Settings
from .stability import JUDGED_OPTIONS, Disturbances, judged_motion, model_in_time

# growth from which on more instants are taken not to make a motion stable
NEAR_ONE_GROWTH = 0.02
# with which the motion is judged: with 7 and 128 one that a march of twelve blades keeps to was
# called unstable by 4 % a period
CLASS_HARMONICS = 15
CLASS_SAMPLES = 256
# operations of the verdict on one class, some 0.5 s
CLASS_OPERATIONS = 1.5e10


@dataclass(frozen=True)
class ClassVerdict:
    """Of one motion and one class of disturbances."""

    # 0..N/2, in which they move
    diameters: tuple[int, ...]
    # largest modulus of their Floquet multipliers
    multiplier: float

    @property
    def unstable(self) -> bool:
        """They grow by more than the error of sampled friction."""
        return self.multiplier > 1 + UNSTABLE_GROWTH


def class_verdicts(
    models: Family,
    settings: Settings,
    motion: Solution,
    engine_order: int,
    sectors: int,
) -> tuple[ClassVerdict, ...]:
    """The verdicts on a motion, one for each class of disturbances that could be judged; none
    where the wave does not repeat after few blades, or where its motion is the only one.

    Args:
        sectors: of the wheel; 0 without one.
    """
    classes = range(1, gcd(engine_order, sectors) // 2 + 1) if sectors else range(0)
    if models.disturbed is None or not classes or not motion.converged:
        return ()
    model = model_in_time(models, settings)
    if has_one_motion(model) or model.elements.law is not None:
        return ()
    try:
        blades = blades_of_wave(model)
    except InputError:
        return ()
    harmonics = min(max(settings.harmonics, blades - 1, CLASS_HARMONICS), models.harmonics)
    rich = replace(settings, harmonics=harmonics)
    model = model_in_time(models, rich)
    judged = _richer(model, judged_motion(model, motion), harmonics)
    found = []
    for d in classes:
        angle = class_angle(d, engine_order, sectors)
        largest = _largest(model, judged, models.disturbed(rich, d), angle)
        if isfinite(largest):
            found.append(ClassVerdict(class_diameters(d, engine_order, sectors), largest))
    return tuple(found)


def _richer(model: ReducedModel, motion: Solution, harmonics: int) -> Solution:
    """The motion with more harmonics, or itself where it is not found with them."""
    samples = max(motion.samples, CLASS_SAMPLES)
    try:
        found = solve(model, motion.omega, harmonics, samples, start=motion, options=JUDGED_OPTIONS)
    except (InputError, NotSolvedError):
        return motion
    return found if found.converged else motion


def _largest(model: ReducedModel, motion: Solution, bodies: ReducedModel, angle: float) -> float:
    """The multiplier of a class, with more instants where it is close to one."""
    largest = class_multiplier(model, motion, bodies, angle, most=CLASS_OPERATIONS)
    if not UNSTABLE_GROWTH < largest - 1 < NEAR_ONE_GROWTH:
        return largest
    more = INSTANT_REFINEMENT * INSTANTS_PER_PERIOD
    most = INSTANT_REFINEMENT * CLASS_OPERATIONS
    finer = class_multiplier(model, motion, bodies, angle, more, most)
    return finer if isfinite(finer) else largest


def sentence_of_classes(
    load: str,
    verdicts: Sequence[ClassVerdict],
    judged: Disturbances,
) -> str:
    """What was found on the resonance under a load ("80 N"), or "" where nothing was looked at.

    Args:
        judged: the disturbances that repeat as the wave does.
    """
    if not verdicts:
        return ""
    looked = sorted({n for verdict in verdicts for n in verdict.diameters})
    listed = ", ".join(map(str, looked))
    left = set(range(judged.possible)) - {*looked, *judged.diameters}
    others = f"; not looked at: {', '.join(map(str, sorted(left)))}" if left else ""
    start = f"under {load} the resonance was also judged against disturbances of nodal diameters"
    lost = [verdict for verdict in verdicts if verdict.unstable]
    if not lost:
        return f"{start} {listed}, and is stable against them{others}"
    each = "; ".join(
        f"{', '.join(map(str, v.diameters))} (multiplier {v.multiplier:.4g})" for v in lost
    )
    return (
        f"{start} {listed}, and seems to be left by those of {each}: blades then no longer move "
        "alike; ripples of high frequency may be called growing that more harmonics, or a march of "
        f"the wheel, let decay{others}"
    )

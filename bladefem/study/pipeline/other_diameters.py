"""Is the resonance of a travelling wave left by disturbances in nodal diameters that its own
harmonics never reach?

Only the motion that is given as the resonance is asked (`bladefem.hbm.other_diameters`), with the
bodies that `bladefem.reduction.other_diameters` has for these diameters. What replaces the wave
there is no wave, and is not looked for; the modes that a growing disturbance moves tell a ripple
from a motion of the blade.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import gcd, isfinite, nan, pi

from ...errors import InputError, NotSolvedError
from ...hbm.model import ReducedModel
from ...hbm.other_diameters import Growth, class_angle, class_diameters, class_growth
from ...hbm.sector_modes import blades_of_wave
from ...hbm.solution import Solution
from ...hbm.solve import solve_near
from ...hbm.stability import (
    INSTANT_REFINEMENT,
    INSTANTS_PER_PERIOD,
    UNSTABLE_GROWTH,
    has_one_motion,
)
from ..adaptive.family import Family
from ..adaptive.settings import Settings
from ..stability.verdicts import JUDGED_OPTIONS, judged_motion, model_in_time, settings_in_time
from .stability_remarks import Disturbances

# growth from which on more instants are taken not to make a motion stable
NEAR_ONE_GROWTH = 0.02
# harmonics and samples with which the motion is judged, the second where the first are not solved:
# seven and fifteen call waves unstable that a march keeps, and fifteen call one stable that leaves
CLASS_SETTINGS = ((31, 512), (15, 256))
# operations of the verdict on one class, some 0.5 s
CLASS_OPERATIONS = 1.5e10


@dataclass(frozen=True)
class ClassVerdict:
    """Verdict on one motion and one class of disturbances."""

    # 0..N/2, in which they move
    diameters: tuple[int, ...]
    # largest modulus of their Floquet multipliers
    multiplier: float
    # of the blade modes that have most of the energy of what grows most [Hz]
    frequency: float = nan

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
    settings = settings_in_time(models, settings)
    model = model_in_time(models, settings)
    if has_one_motion(model) or model.elements.law is not None:
        return ()
    try:
        blades = blades_of_wave(model)
    except InputError:
        return ()
    judged, harmonics = _richest(models, settings, judged_motion(model, motion), blades)
    rich = replace(settings, harmonics=harmonics)
    model = model_in_time(models, rich)
    found = []
    for d in classes:
        angle = class_angle(d, engine_order, sectors)
        most = _leading(model, judged, models.disturbed(rich, d), angle)
        if isfinite(most.multiplier):
            diameters = class_diameters(d, engine_order, sectors)
            found.append(ClassVerdict(diameters, most.multiplier, most.omega / (2 * pi)))
    return tuple(found)


def _richest(
    models: Family,
    settings: Settings,
    motion: Solution,
    blades: int,
) -> tuple[Solution, int]:
    """The motion with the first of CLASS_SETTINGS with which it is found, or itself; and how many
    harmonics the bodies need for it and for its wave to repeat.
    """
    for harmonics, samples in CLASS_SETTINGS:
        wanted = min(max(settings.harmonics, blades - 1, harmonics), models.harmonics)
        model = model_in_time(models, replace(settings, harmonics=wanted))
        samples = max(motion.samples, samples)
        try:
            found = solve_near(model, motion.omega, wanted, samples, motion, JUDGED_OPTIONS)
        except (InputError, NotSolvedError):
            continue
        if found.converged:
            return found, wanted
    return motion, max(motion.harmonics, blades - 1)


def _leading(model: ReducedModel, motion: Solution, bodies: ReducedModel, angle: float) -> Growth:
    """The growth of a class, with more instants where its multiplier is close to one."""
    found = class_growth(model, motion, bodies, angle, most=CLASS_OPERATIONS)
    if not UNSTABLE_GROWTH < found.multiplier - 1 < NEAR_ONE_GROWTH:
        return found
    more = INSTANT_REFINEMENT * INSTANTS_PER_PERIOD
    most = INSTANT_REFINEMENT * CLASS_OPERATIONS
    finer = class_growth(model, motion, bodies, angle, more, most)
    return finer if isfinite(finer.multiplier) else found


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
    others = f"; not considered: {', '.join(map(str, sorted(left)))}" if left else ""
    start = f"under {load} the resonance was also judged against disturbances of nodal diameters"
    lost = [verdict for verdict in verdicts if verdict.unstable]
    if not lost:
        return f"{start} {listed}, and is stable against them{others}"
    each = "; ".join(
        f"{', '.join(map(str, v.diameters))} (multiplier {v.multiplier:.4g}, mostly in modes near "
        f"{v.frequency:.4g} Hz)"
        for v in lost
    )
    return (
        f"{start} {listed}, and is left by those of {each}: blades then no longer move alike; the "
        "wheel was not marched from there, and modes far above the excitation mostly put a ripple "
        f"on the same motion{others}"
    )

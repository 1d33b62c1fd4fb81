"""The cheap level of the statistics of a scene's wheels: all of them by the law of one damper, some
of them checked by the whole wheel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...scene.units import newtons
from ...util.communicator import Communicator
from ...util.progress import Progress, without_progress
from ...wheel.damper_law import DamperLaw, damper_law, law_harmonics, scaled_elements
from ...wheel.family import ModeFamily, family_of_modes
from ...wheel.law_response import LawWheels, ScatteredLaw, law_statistics, pattern_deviations
from ...wheel.model import TUNED_PATTERN, Pattern, Wheel, heavier_damper
from ...wheel.pattern_peak import PatternPeak, compared_peaks, peak_heights
from ...wheel.scatter import Scatter, drawn_deviations
from ...wheel.statistics import Amplification
from ...wheel.tuned import travelling_order
from ..pipeline.curve import Curve

# smallest and largest motion of a pair of blades in the table, over the tuned resonance: both
# amplified by 2.8; far beyond, light dampers lift off and have no one motion
MOTION_RANGE = 0.05, 4.0
# scattered parameters but the load, which scales exactly
CHANGED_PARAMETERS = ("friction", "stiffness", "mass")
# standard deviations at which the changed laws are made
DEVIATIONS_OF_CHANGE = 1.5


def law_level(
    wheel: Wheel,
    patterns: list[Pattern],
    scatter: Scatter,
    curve: Curve,
    mode: int,
    harmonics: int,
    band: tuple[float, float],
) -> Amplification:
    """Statistics of all patterns under the load of a curve, by the law of one damper.

    Args:
        scatter: that the patterns were drawn with.
        mode: number of the excited mode, from 0.
        harmonics: of the whole wheels; the law has as many where it can.
        band: ends of the frequencies [rad/s].

    Raises:
        InputError: the damper has too many contact nodes, or the forces are no travelling wave.
        NotSolvedError: the damper's small balance has no solution somewhere.
    """
    harmonics = law_harmonics(len(wheel.rows), harmonics)
    family = family_of_modes(wheel, curve.peak.omega, mode, harmonics)
    law = _scattered_law(wheel, family, scatter, curve, mode)
    draws = drawn_deviations(wheel.count, scatter, len(patterns))
    factors = draws.factors(scatter)
    deviation, mass = pattern_deviations(patterns, family, wheel.count)
    return law_statistics(LawWheels(family, law, deviation, factors, mass), curve.load, band)


def _scattered_law(
    wheel: Wheel,
    family: ModeFamily,
    scatter: Scatter,
    curve: Curve,
    mode: int,
) -> ScatteredLaw:
    """The law of the nominal damper, and of those with more and less of what scatters."""
    order = travelling_order(wheel) or 0
    motion = curve.peak_amplitude / abs(family.probe[order])
    sizes = MOTION_RANGE[0] * motion, MOTION_RANGE[1] * motion
    harmonics = len(family.flexibility)
    samples = max(curve.settings.samples, 8 * (harmonics + 1))
    changed = {}
    for name in CHANGED_PARAMETERS:
        share = DEVIATIONS_OF_CHANGE * getattr(scatter, name)
        if share > 0:
            more, less = (
                changed_law(wheel, family, mode, sizes, samples, name, factor)
                for factor in (1 + share, 1 - share)
            )
            changed[name] = (more, less, share)
    return ScatteredLaw(damper_law(wheel, family, sizes, samples), changed)


def changed_law(
    wheel: Wheel,
    family: ModeFamily,
    mode: int,
    sizes: tuple[float, float],
    samples: int,
    name: str,
    factor: float,
) -> DamperLaw:
    """The law of a damper with another friction coefficient, contact stiffness or mass than the one
    whose law stands on a family.
    """
    elements = None
    if name == "mass":
        # of the same load: that is a parameter of its own
        wheel = replace(wheel, damper=heavier_damper(wheel.damper, factor))
        family = family_of_modes(wheel, family.at, mode, len(family.flexibility))
    else:
        elements = scaled_elements(wheel, name, factor)
    return damper_law(wheel, family, sizes, samples, elements)


def with_checks(
    found: Amplification,
    patterns: list[Pattern],
    whole_peak: Callable[[Pattern], PatternPeak],
    checks: int,
    comm: Communicator | None,
    progress: Progress = without_progress,
) -> Amplification:
    """Statistics of one load with some wheels solved whole, from the lowest to the highest.

    These have their own amplification, and all others that by the law times the mean ratio of both.
    The tuned peak becomes the whole wheel's.

    Args:
        whole_peak: a pattern's highest blade by the whole wheel.
        checks: wheels that are solved, dealt out over the ranks.
    """
    rank, ranks = (comm.rank, comm.size) if comm is not None else (0, 1)
    order = np.argsort(found.factor[0])
    places = np.unique(np.linspace(0, len(order) - 1, checks).round().astype(int))
    chosen = order[places[::-1]]
    solved = [TUNED_PATTERN, *(patterns[i] for i in chosen)]
    heights = np.zeros((3, len(solved)))
    mine = range(rank, len(solved), ranks)
    for i in progress(list(mine), f"checks under {newtons(found.loads[0])}", len(mine)):
        heights[:, i] = peak_heights(whole_peak(solved[i]))
    if comm is not None:
        heights = comm.allreduce(heights)
    compared = compared_peaks(heights)
    whole = compared.height / compared.tuned
    law = found.factor[0, chosen]
    factor = found.factor[0] * (whole / law).mean()
    factor[chosen] = whole
    return replace(
        found,
        tuned=np.array([compared.tuned]),
        peak=compared.tuned * factor[None],
        checked=chosen[None],
        whole=whole[None],
        law=law[None],
        tuned_held=np.array([compared.tuned_held]),
        held_factor=compared.held_factor[None],
        mean_released=compared.mean_released[None],
    )

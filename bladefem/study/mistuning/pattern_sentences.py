"""Sentences on the response of all blades of a wheel with one pattern."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...scene.units import newtons
from ...util.message import warning
from ...util.percent import percent
from .deciding_blades import DecidingBlade
from .other_blades import other_blade_sentences
from .pattern_response import PatternResponse
from .sector_comparison import comparison_words

# relative change of the highest amplitude by free means from which both amplitudes are reported
NOTICEABLE_CHANGE = 0.005


def pattern_sentences(found: Sequence[PatternResponse], held_means: bool) -> list[str]:
    """What a reader has to know.

    Args:
        held_means: of the sector's own curves too, which then say nothing about free ones.
    """
    sentences = []
    for r in found:
        sentences.append(_peak_sentence(r))
        if not r.compared.agrees:
            words = comparison_words(r.compared)
            sentences.append(
                warning(f"{newtons(r.load)}: {words}; the highest blade is as uncertain")
            )
        sentences.extend(_shape_sentences(r))
    if found[0].others is not None:
        sentences.extend(other_blade_sentences(found[0].others))
    sentences.extend(_mean_sentence(r, held_means) for r in found)
    return sentences


def _peak_sentence(r: PatternResponse) -> str:
    """The highest blade, and its stress."""
    error = "unknown" if np.isnan(r.truncation) else f"{percent(r.truncation)}"
    text = (
        f"whole wheel under {newtons(r.load)}: blade {r.peak.blade + 1} moves "
        f"{1e6 * r.peak.height:.4g} um, {r.factor:.3g} times the tuned wheel (without dampers "
        f"{r.free_factor:.3g} times); estimated error by harmonics and samples {error}; "
        f"{r.peak.unsolved} of {len(r.peak.omegas)} frequencies not solved; its alternating "
        f"stress is {_stress_words(r.highest)}"
    )
    if not r.peak.closed_in:
        text += (
            "; the highest point is an end of the band or next to a frequency that was not solved, "
            "the resonance may be higher"
        )
    return text + _near_words(r) + _own_mesh_words(r.highest)


def _near_words(r: PatternResponse) -> str:
    """The blades that are lower by less than the error by harmonics; empty where there are none."""
    if np.isnan(r.truncation):
        return ""
    near = np.flatnonzero(r.peak.by_blade > (1 - r.truncation) * r.peak.height)
    numbers = ", ".join(str(number + 1) for number in near if number != r.peak.blade)
    return f"; within that error of the highest: blade {numbers}" if numbers else ""


def _shape_sentences(r: PatternResponse) -> list[str]:
    """The highest blades of the other shapes, and those whose peak was not found."""
    said = [
        f"of the blades of another shape than blade {r.peak.blade + 1}'s, blade {one.blade + 1} "
        f"moves most, {1e6 * one.height:.4g} um at {one.frequency:.5g} Hz; its alternating stress "
        f"there is {_stress_words(one)}{_own_mesh_words(one)}"
        for one in r.blades[1:]
    ]
    if r.lost_blades:
        numbers = ", ".join(str(number + 1) for number in r.lost_blades)
        said.append(
            warning(
                f"no balance was found at the resonance of blades {numbers}, which have another "
                f"shape than blade {r.peak.blade + 1}: their stress and utilisation are not known"
            )
        )
    return said


def _stress_words(one: DecidingBlade) -> str:
    place = ", ".join(f"{1e3 * x:.1f}" for x in one.worst.place)
    return (
        f"{1e-6 * one.worst.largest:.4g} MPa at ({place}) mm, estimated error of the mesh there "
        f"{percent(one.worst.mesh_error)}"
    )


def _own_mesh_words(one: DecidingBlade) -> str:
    """What there is to say of a blade of another shape, empty for one of the tuned shape."""
    if one.own_stress is None:
        return ""
    return (
        "; that blade has another shape, and its stress is that of its own mesh, where "
        f"{1e-6 * one.stress.largest:.4g} MPa is that of the same motion on the others'; "
        "wheel and blade disagree about its own motion by "
        f"{percent(one.own_stress.mismatch)} of its inertia"
    )


def _mean_sentence(r: PatternResponse, held_means: bool) -> str:
    """How the mean displacements of the dampers count at the highest point."""
    free = r.free_means
    if free is not None and not np.isnan(free.change):
        walks = (
            f"{free.walking} of {len(r.deviation)} dampers walk there, by up to "
            f"{1e3 * free.speed:.2g} mm/s"
            if free.walking
            else "no damper walks there"
        )
        if abs(free.change) < NOTICEABLE_CHANGE:
            against = f"the same within {100 * NOTICEABLE_CHANGE:g} %"
        else:
            against = f"{1e6 * free.held:.4g} um, from which free ones differ by " + (
                f"{100 * free.change:+.2g} %"
            )
        return (
            "the highest point of the whole wheel has free mean displacements, searched again "
            f"round that of held ones; {walks}; held in the preload state they give {against}"
        )
    if np.isnan(r.sector_difference):
        moved = "where engine orders beyond the tuned sector's excite as well"
    elif held_means:
        moved = "as the tuned curves do (model.static): what free ones change is not known"
    else:
        moved = f"which moves the tuned resonance by {percent(abs(r.sector_difference))}"
    lost = "" if free is None else "; with free ones no balance was found at its resonance"
    return f"the whole wheel holds mean displacements in the preload state, {moved}{lost}"

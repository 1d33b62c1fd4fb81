"""What a reader of the results has to know: how they were found, and where they may be wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...scene.tables import Scene
from ...scene.units import newton_range, newtons, show
from ...util.message import method, warning
from ...util.percent import percent
from ..adaptive.settings import Settings
from .best_load import BestLoad, studied_load
from .curve import Curve, load_of
from .damped_motion import DampedStress
from .load_interval import interval_sentence
from .load_remarks import LoadRemark, sentences_of_kinds
from .resonance_list import reach_sentence
from .stability_remarks import (
    Disturbances,
    doubtful_sentence,
    folded_sentence,
    lower_sentence,
    ripple_sentence,
    stability_sentence,
    undriven_sentence,
    unjudged_sentence,
    unmarched_sentence,
    unstable_sentences,
)

# largest estimated error by the mesh of a stress that is no warning
TRUSTED_STRESS = 0.2
# relative difference at the probe between the motion of all modes and the balance's: a stress of
# the same motion is off by less than 1e-5
SAME_MOTION = 0.02
# sentences on the search of one curve that are quoted
MAX_NOTES = 3
# fields of a curve that are parts of its estimated error, and what lowers them
LARGEST_PARTS = {
    "halved": (
        "what half as many contact points change, which a finer contact mesh lowers "
        "(mesh.seat_elements, mesh.contact_size)"
    ),
    "body_mesh": (
        "the estimated error of the mesh of the bodies, which a finer one lowers (mesh.size, "
        "mesh.scale)"
    ),
    "layer_law": (
        "what the tangent of a layer that stiffens leaves out, or the softer layer that stands for "
        "a stiff one where contacts lift off; compare with a linear, softer layer (contact.kn_area)"
    ),
}


def response_remarks(
    scene: Scene,
    settings: Settings,
    curves: list[Curve],
    nodes: int,
    judged: Disturbances,
) -> list[str]:
    """What a reader of the results has to know.

    Args:
        nodes: contact points of a seat.
        judged: what verdicts looked at.
    """
    methods = []
    if scene.study.stability:
        verdicts = [(c.stability, c.multiplier) for c in curves]
        methods.append(stability_sentence(verdicts, judged))
    methods += [ripple_sentence(curves, scene.accuracy), undriven_sentence(curves)]
    warnings = [
        folded_sentence(curves),
        lower_sentence(curves),
        *unstable_sentences(curves, scene.accuracy),
        *sentences_of_kinds(map(_of_march, curves)),
        unjudged_sentence(curves),
        unmarched_sentence(curves),
        doubtful_sentence(curves, judged.reason),
        unconverged_sentence(curves),
        single_motion_sentence(curves),
        *map(search_sentence, curves),
        *map(reach_sentence, curves),
        stiff_layer_sentence(curves),
        *resonance_warnings(curves, scene.accuracy),
        beyond_tolerance(curves),
    ]
    return [
        *_of_settings(scene, settings, curves, nodes),
        *map(method, filter(None, methods)),
        *history_remarks(curves),
        *map(warning, filter(None, warnings)),
    ]


def _of_settings(scene: Scene, settings: Settings, curves: list[Curve], nodes: int) -> list[str]:
    """The model and the method, and how sure the resonances are."""
    remarks: list[str] = [
        method(settings.sentence(nodes, _errors_of_loads(settings, curves))),
        method(settings.method),
    ]
    if scene.model.static == "uncoupled":
        remarks.append(
            method(
                "mean displacements held as the static contact solution left them (model.static)"
            )
        )
    return remarks


def _errors_of_loads(settings: Settings, curves: Sequence[Curve]) -> str:
    """Range of the estimated errors that the design table has, and of the harmonics under its
    loads.
    """
    counts = {c.settings.harmonics for c in curves}
    more = ""
    if counts != {settings.harmonics}:
        ends = sorted({min(counts), max(counts)})
        more = f"; {' to '.join(map(str, ends))} harmonics under the loads"
    errors = [c.error for c in curves if c.error is not None]
    if not errors:
        return f"not estimated{more}"
    known = [error for error in errors if np.isfinite(error)]
    unknown = [load_of(c) for c in curves if c.error is not None and np.isinf(c.error)]
    missing = f"unknown under {', '.join(unknown)}"
    if not known:
        return f"estimated errors of the resonances {missing}{more}"
    low, high = percent(min(known)), percent(max(known))
    span = low if low == high else f"{low.removesuffix(' %')} to {high}"
    rest = f", {missing}" if unknown else ""
    return f"estimated errors of the resonances with those of the meshes {span}{rest}{more}"


def search_sentence(curve: Curve) -> str:
    """What the search for the motions of a curve left open, or ""."""
    if not curve.notes:
        return ""
    said = "; ".join(curve.notes[:MAX_NOTES])
    more = len(curve.notes) - MAX_NOTES
    return f"load {load_of(curve)}: {said}" + (f"; and {more} more of the kind" if more > 0 else "")


def stiff_layer_sentence(curves: Sequence[Curve]) -> str:
    """Where the stiff layer itself resonates, under loads whose curve is a softer one's, or ""."""
    shifted = [c for c in curves if np.isfinite(c.layer_shift)]
    reached = ", ".join(
        f"{1e6 * c.peak_amplitude:.4g} um at {c.peak_frequency:.5g} Hz in place of "
        f"{1e6 * c.curve_amplitude:.4g} um at {c.peak.frequency:.5g} Hz under {load_of(c)}"
        for c in shifted
        if c.reaches_layer
    )
    left = ", ".join(
        f"{(1 + c.layer_shift) * c.peak_frequency:.5g} Hz in place of {c.peak_frequency:.5g} Hz "
        f"under {load_of(c)}"
        for c in shifted
        if not c.reaches_layer
    )
    said = [
        f"the resonance given is that of the stiff one, followed from there: {reached}"
        if reached
        else "",
        f"the resonance given is its own; followed towards the stiff one it lies at {left}"
        if left
        else "",
    ]
    if not shifted:
        return ""
    return "contacts lift off, and the curve is that of a softer layer; " + "; ".join(
        filter(None, said)
    )


def _of_march(curve: Curve) -> LoadRemark | None:
    """How the resonance was sought where balances do not give it."""
    found = curve.resonance_by_march
    return (
        None if found is None else LoadRemark(found.search, f"under {load_of(curve)} {found.band}")
    )


def history_remarks(curves: Sequence[Curve]) -> list[str]:
    """What the loading history changes, where that was asked for."""
    known = [(c.load, c.interval) for c in curves if c.interval is not None]
    return [interval_sentence(*zip(*known, strict=True))] if known else []


def unconverged_sentence(curves: Sequence[Curve]) -> str:
    """How many points did not converge, or ""."""
    lost = sum(int((~c.converged).sum()) for c in curves)
    if not lost:
        return ""
    return (
        f"{lost} of {sum(len(c.frequency) for c in curves)} response points did not converge; they "
        "are marked in tables and pictures"
    )


def single_motion_sentence(curves: Sequence[Curve]) -> str:
    """Under which loads one motion a frequency was seen, where there may be several, or ""."""
    single = [load_of(c) for c in curves if c.folds_not_followed]
    if not single:
        return ""
    return (
        f"under {', '.join(single)} contacts lift off, and the response was not followed round "
        "folds: a sweep sees one motion a frequency, a higher one may exist"
    )


def beyond_tolerance(curves: list[Curve]) -> str:
    """A sentence where points away from the resonance are estimated to be wrong by more than the
    scene's accuracy of the highest amplitude; empty where all keep it.
    """
    missed = {}
    for c in curves:
        beyond = c.converged & (c.estimated > c.tolerated) & (c.frequency != c.peak.frequency)
        if beyond.any():
            missed[load_of(c)] = f"{beyond.sum()} of {len(beyond)} points"
    if not missed:
        return ""
    each = ", ".join(f"{load} ({count})" for load, count in missed.items())
    return (
        "away from the resonance, points of the curves are estimated to be off by more than the "
        f"accuracy of the highest amplitude: {each}; columns estimated_error and tolerated_error "
        "of points.csv"
    )


def resonance_warnings(curves: list[Curve], accuracy: float) -> Iterator[str]:
    """Why the highest points of curves may be wrong: one sentence a reason, with all its loads."""
    next_to_unsolved = [
        load_of(c) for c in curves if c.resonance_by_march is None and _beside_unsolved(c)
    ]
    if next_to_unsolved:
        yield (
            f"under {', '.join(next_to_unsolved)} the highest point that was solved lies next to "
            "one that was not; the resonance may be higher"
        )
    for c in curves:
        if c.error_march is not None:
            yield in_time_sentence(c)
    unknown = [load_of(c) for c in curves if c.error == np.inf]
    if unknown:
        yield (
            f"under {', '.join(unknown)} the error of the resonance amplitude is unknown: "
            "neither richer models of it nor an integration in time give it; no setting was made "
            "finer for it"
        )
    # as it is reported, with two digits: no estimate is known better
    above = [
        c for c in curves if c.error is not None and accuracy < float(f"{c.error:.2g}") < np.inf
    ]
    if above:
        each = ", ".join(f"{load_of(c)} {percent(c.error or 0)}" for c in above)
        yield (
            "estimated error of the resonance amplitude above the wanted "
            f"{percent(accuracy)}: {each}{_largest_parts(above)}"
        )


def in_time_sentence(c: Curve) -> str:
    """What the estimated error of a resonance was taken from, where that is a march."""
    band = c.error_march
    assert band is not None
    more = "" if band.points is None else f" with {band.points} contact points a seat"
    return (
        f"under {load_of(c)} contacts lift off and balances with more harmonics do not give the "
        f"error of the resonance amplitude, {1e6 * c.peak_amplitude:.4g} um; it is estimated from "
        f"a march in time from there{more}, which keeps between {1e6 * band.lowest:.4g} and "
        f"{1e6 * band.highest:.4g} um"
    )


def _largest_parts(curves: list[Curve]) -> str:
    """Parts of estimated errors that no richer balance lowers, where one is half of the error or
    more.
    """
    text = ""
    for part, meaning in LARGEST_PARTS.items():
        sizes = [
            f"{percent(getattr(c, part))} under {load_of(c)}"
            for c in curves
            if np.isfinite(getattr(c, part)) and getattr(c, part) >= (c.error or 0) / 2
        ]
        if sizes:
            text += f"; {', '.join(sizes)} are {meaning}"
    return text


def _beside_unsolved(c: Curve) -> bool:
    """Whether a point next to the highest one did not converge."""
    near = np.flatnonzero(c.frequency == c.peak.frequency)[0] + np.array([-1, 1])
    return not c.converged[near[(near >= 0) & (near < len(c.frequency))]].all()


def best_load_remarks(scene: Scene, best: tuple[BestLoad, ...]) -> Iterator[str]:
    """How the best load was found, or why it was not."""
    for b in best:
        damper = "" if b.mass is None else f" of a damper of {1e3 * b.mass:.4g} g"
        lowest, highest = (show(bound, "N") for bound in b.searched)
        if b.reason:
            yield (f"best load{damper}: not found between {lowest} and {highest}, since {b.reason}")
            continue
        start, end = b.between
        error = f"{b.settings.error_words} of the balance, meshes apart"
        tolerated = ""
        if np.isfinite([start, end]).all():
            share = f"{100 * scene.accuracy:.3g} %"
            tolerated = f", and from {newton_range(start, end)} it keeps within {share} of that"
        yield (
            f"search for the best load{damper}: it ended at {newtons(b.load, 4)}, between {lowest} "
            f"and {highest}, with {len(b.tried)} loads and {b.points} points; no load near it "
            f"lowers the amplitude, by harmonic balance, by more than {percent(b.tolerance)}"
            f"{tolerated}; "
            f"{b.settings.sentence(error_text=error)}"
        )
        if b.kept is not None:
            yield (
                f"best load{damper}: the blade does not keep to the periodic vibration that "
                f"harmonic balance finds under {newtons(b.load, 4)}; of the vibrations "
                f"that it keeps those under {newtons(b.kept.load, 4)} are the lowest, and another "
                f"load lowers them by {percent(b.kept.tolerance)} at most, if amplitude over load "
                "is convex there"
            )


def lower_studied_remarks(
    scene: Scene, best: Sequence[BestLoad], curves: Sequence[Curve]
) -> Iterator[str]:
    """Loads studied whose highest motion, stable or not, is lower than under the best load; or
    under which the blade was marched to less.
    """
    for b in (b for b in best if not b.reason):
        own = [c for c in curves if c.mass == b.mass]
        tops = [(float(c.amplitude[c.converged].max()), c.load) for c in own]
        kept = [(c.peak_amplitude, c.load) for c in own]
        there = next((c.peak_amplitude for c in own if c.load == studied_load(b)), 0.0)
        for heights, found, why in (
            (tops, b.amplitude, "the search ended beside it"),
            (kept, there, "the search compares balances, to which the blade does not keep"),
        ):
            height, load = min(heights, default=(np.inf, 0.0))
            if (1 + scene.accuracy) * height < found:
                yield warning(
                    f"best load: {1e6 * found:.4g} um under {newtons(b.load, 4)} is more than the "
                    f"{1e6 * height:.4g} um under {newtons(load, 4)} studied: {why}"
                )
                break


def stress_message(found: DampedStress, over_balance: float = 1.0) -> str:
    """The stress at the best load, and how far it can be trusted.

    Args:
        over_balance: the amplitude given over that of the motion which has this stress.
    """
    largest = 1e-6 * over_balance * found.largest
    place = ", ".join(f"{1e3 * x:.1f}" for x in found.place)
    text = (
        f"alternating stress at the best load, {newtons(found.load, 4)}: {largest:.4g} MPa "
        f"at ({place}) mm, of all modes, harmonics and damper forces; estimated error of the mesh "
        f"there {percent(found.mesh_error)}"
    )
    if found.mismatch > SAME_MOTION:
        return warning(
            f"{text}; the motion that has it differs by {percent(found.mismatch)} from that of the "
            "balance at the probe"
        )
    if found.mesh_error <= TRUSTED_STRESS:
        return text
    return warning(f"{text}: too large to rely on, at a sharp edge or on too coarse a mesh")

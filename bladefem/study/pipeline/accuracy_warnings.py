"""Where points of curves, or the resonances they give, are less sure than was wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...util.percent import percent
from .curve import Curve, load_of
from .load_remarks import LoadRemark, Reason

# notes on the search of one curve that are quoted
MAX_NOTES = 3
UNCONVERGED = Reason(
    "response points did not converge, and no peak is sought there, under {loads}",
    "give model.harmonics, or a narrower study.band round the resonance",
    "They are crosses in the pictures, and marked in the tables",
)
SINGLE_MOTION = Reason(
    "under {loads} a higher resonance may exist: contacts lift off, and the response was not "
    "followed round folds",
    "take fewer contact.points or model.harmonics, so that all motions of the band are followed",
    "A sweep sees one motion a frequency",
)
UNFINISHED_SEARCH = Reason(
    "under {loads} the search for all motions of the curve left some open",
    "compare with a run of a narrower study.band round the resonance",
)
SOFTER_CURVE = Reason(
    "under {loads} contacts lift off, and the curve is that of a softer layer; the resonance given "
    "is that of the stiff one, followed from there",
    "use the resonance as given, and the flanks of the curve for its shape alone",
)
SOFTER_RESONANCE = Reason(
    "under {loads} contacts lift off, and curve and resonance are those of a softer layer than the "
    "one given",
    "use the amplitude with its error, and the stiff layer's frequency from the details",
)
BESIDE_UNSOLVED = Reason(
    "under {loads} the resonance may be higher than the one given: a point next to it was not "
    "solved",
    UNCONVERGED.advice,
)
ERROR_IN_TIME = Reason(
    "under {loads} the estimated error of the resonance amplitude is that of an integration in "
    "time (a march)",
    "use the amplitude with this error; more contact.points may lower it",
    "Contacts lift off, and balances with more harmonics do not give it",
)
UNKNOWN_ERROR = Reason(
    "under {loads} the error of the resonance amplitude is unknown, and the amplitude is no result "
    "until it is known",
    "take fewer contact.points",
    "Neither richer models of it nor an integration in time give the error; no setting was made "
    "finer for it",
)
INEXACT_FLANKS = Reason(
    "away from the resonance, points of the curves are estimated to be off by more than the "
    "accuracy of the resonance amplitude under {loads}",
    "take a smaller accuracy or more model.harmonics where flanks matter; the resonances are not "
    "concerned",
    "Columns estimated_error and tolerated_error of points.csv have each point",
)
# parts of an estimated error that no richer balance lowers, by field of a curve: what lowers them,
# and what they are
LARGEST_PARTS = {
    "halved": (
        "take a finer contact mesh (mesh.seat_elements, mesh.contact_size), which lowers the "
        "larger part of it",
        "what half as many contact points change",
    ),
    "body_mesh": (
        "take a finer mesh of the bodies (mesh.size, mesh.scale), which lowers the larger part of "
        "it",
        "the estimated error of the mesh of the bodies",
    ),
    "layer_law": (
        "compare with a linear, softer layer (contact.kn_area): no finer model lowers the larger "
        "part of it",
        "what the tangent of a layer that stiffens leaves out, or the softer layer that stands for "
        "a stiff one where contacts lift off",
    ),
}


def unconverged_points(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Curves with points that did not converge, and how many."""
    for c in curves:
        lost = int((~c.converged).sum())
        if lost:
            yield LoadRemark(UNCONVERGED, load_of(c), figure=f"{lost} of {len(c.frequency)}")


def single_motions(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Loads under which one motion a frequency was seen, where there may be several."""
    return (LoadRemark(SINGLE_MOTION, load_of(c)) for c in curves if c.folds_not_followed)


def unfinished_searches(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """What the search for the motions of a curve left open."""
    for c in curves:
        more = len(c.notes) - MAX_NOTES
        rest = [f"{more} more of the kind"] if more > 0 else []
        if c.notes:
            said = ", ".join([*c.notes[:MAX_NOTES], *rest])
            yield LoadRemark(UNFINISHED_SEARCH, load_of(c), said)


def softer_layers(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Where the stiff layer itself resonates, under loads whose curve is a softer one's."""
    for c in curves:
        if not np.isfinite(c.layer_shift):
            continue
        if c.reaches_layer:
            stiff = f"{1e6 * c.peak_amplitude:.4g} um at {c.peak_frequency:.5g} Hz"
            soft = f"{1e6 * c.curve_amplitude:.4g} um at {c.peak.frequency:.5g} Hz"
            yield LoadRemark(SOFTER_CURVE, load_of(c), f"{stiff} in place of {soft}")
        else:
            stiff = f"{(1 + c.layer_shift) * c.peak_frequency:.5g} Hz"
            soft = f"{c.peak_frequency:.5g} Hz"
            yield LoadRemark(
                SOFTER_RESONANCE,
                load_of(c),
                f"followed towards the stiff layer it lies at {stiff} in place of {soft}",
            )


def beside_unsolved(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances next to a point that did not converge."""
    for c in curves:
        if c.resonance_by_march is None and _is_beside_unsolved(c):
            yield LoadRemark(BESIDE_UNSOLVED, load_of(c))


def _is_beside_unsolved(c: Curve) -> bool:
    near = np.flatnonzero(c.frequency == c.peak.frequency)[0] + np.array([-1, 1])
    return not c.converged[near[(near >= 0) & (near < len(c.frequency))]].all()


def errors_in_time(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances whose estimated error was taken from a march."""
    for c in curves:
        band = c.error_march
        if band is None:
            continue
        more = "" if band.points is None else f" with {band.points} contact points a seat"
        yield LoadRemark(
            ERROR_IN_TIME,
            load_of(c),
            f"{1e6 * c.peak_amplitude:.4g} um; marched from there{more}, it keeps between "
            f"{1e6 * band.lowest:.4g} and {1e6 * band.highest:.4g} um",
        )


def unknown_errors(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Resonances whose error no estimate bounds."""
    return (LoadRemark(UNKNOWN_ERROR, load_of(c)) for c in curves if c.error == np.inf)


def errors_above(curves: Sequence[Curve], wanted: float) -> Iterator[LoadRemark]:
    """Resonances whose estimated error exceeds the accuracy wanted, with the part of it that no
    richer balance lowers, where that is half of it or more.
    """
    text = (
        "the estimated error of the resonance amplitude exceeds the wanted "
        f"{percent(wanted)} under {{loads}}"
    )
    plain = "use these amplitudes with their errors; more contact.points may lower them"
    for c in curves:
        # as it is reported, with two digits: no estimate is known better
        if c.error is None or not wanted < float(f"{c.error:.2g}") < np.inf:
            continue
        advice, detail = plain, ""
        part = _largest_part(c)
        if part:
            advice, meaning = LARGEST_PARTS[part]
            detail = f"{percent(getattr(c, part))} of {percent(c.error)} are {meaning}"
        yield LoadRemark(Reason(text, advice), load_of(c), detail, percent(c.error))


def _largest_part(c: Curve) -> str:
    """Field of the largest of the parts that no richer balance lowers; "" below half of the error,
    and where none is known.
    """
    sizes = {part: float(getattr(c, part)) for part in LARGEST_PARTS}
    known = {part: size for part, size in sizes.items() if size >= (c.error or 0) / 2}
    return max(known, key=lambda part: known[part], default="")


def inexact_flanks(curves: Sequence[Curve]) -> Iterator[LoadRemark]:
    """Curves whose points away from the resonance are estimated to be wrong by more than the
    accuracy of the highest amplitude.
    """
    for c in curves:
        beyond = c.converged & (c.estimated > c.tolerated) & (c.frequency != c.peak.frequency)
        if beyond.any():
            count = f"{beyond.sum()} of {len(beyond)} points"
            yield LoadRemark(INEXACT_FLANKS, load_of(c), figure=count)

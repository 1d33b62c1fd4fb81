"""What a reader of the results has to know: how they were found, and where they may be wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from ...scene.tables import Scene
from ...util.message import method
from ...util.percent import percent
from ..adaptive.settings import Settings
from . import accuracy_warnings as accuracy
from . import motion_warnings as motions
from .curve import Curve, load_of
from .load_interval import interval_sentence
from .load_remarks import LoadRemark, load_warnings
from .stability_remarks import (
    Disturbances,
    ripple_sentence,
    stability_sentence,
    undriven_sentence,
)


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
    verdicts = [(c.stability, c.multiplier) for c in curves]
    ripples = ripple_sentence(curves, scene.accuracy), undriven_sentence(curves)
    return [
        *_of_settings(scene, settings, curves, nodes),
        *([stability_sentence(verdicts, judged)] if scene.study.stability else []),
        *map(method, filter(None, ripples)),
        *history_remarks(curves),
        *load_warnings(warnings_of_curves(curves, scene.accuracy, judged)),
    ]


def warnings_of_curves(
    curves: Sequence[Curve], wanted: float, judged: Disturbances
) -> Iterator[LoadRemark]:
    """Where the resonances may be wrong, then where the curves may be.

    Args:
        wanted: relative accuracy of the resonance amplitude.
        judged: what verdicts looked at.
    """
    return chain(
        motions.folded_curves(curves),
        motions.lower_motions(curves),
        motions.unstable_resonances(curves, wanted),
        motions.resonances_in_time(curves),
        motions.unjudged_resonances(curves),
        motions.unmarched_motions(curves),
        motions.doubtful_resonances(curves, judged.reason),
        motions.selective_sweeps(curves),
        accuracy.unconverged_points(curves),
        accuracy.single_motions(curves),
        accuracy.unfinished_searches(curves),
        accuracy.softer_layers(curves),
        accuracy.beside_unsolved(curves),
        accuracy.errors_in_time(curves),
        accuracy.unknown_errors(curves),
        accuracy.errors_above(curves, wanted),
        accuracy.inexact_flanks(curves),
    )


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


def history_remarks(curves: Sequence[Curve]) -> list[str]:
    """What the loading history changes, where that was asked for."""
    known = [(c.load, c.interval) for c in curves if c.interval is not None]
    return [interval_sentence(*zip(*known, strict=True))] if known else []

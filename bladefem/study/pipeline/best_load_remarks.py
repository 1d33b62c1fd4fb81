"""What is said of the best load: how it was found, studied loads that are lower, and its stress."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...scene.tables import Scene
from ...scene.units import newton_range, newtons, show
from ...util.message import Message, warning
from ...util.percent import percent
from .best_load import BestLoad, studied_load
from .curve import Curve
from .damped_motion import DampedStress

# largest estimated error by the mesh of a stress that is no warning
TRUSTED_STRESS = 0.2
# relative difference at the probe between the motion of all modes and the balance's: a stress of
# the same motion is off by less than 1e-5
SAME_MOTION = 0.02


def best_load_remarks(scene: Scene, best: tuple[BestLoad, ...]) -> Iterator[str]:
    """How the best load was found, or why it was not."""
    for b in best:
        damper = "" if b.mass is None else f" of a damper of {1e3 * b.mass:.4g} g"
        lowest, highest = (show(bound, "N") for bound in b.searched)
        if b.reason:
            yield (f"best load{damper}: not found between {lowest} and {highest}, since {b.reason}")
            continue
        start, end = b.between
        tolerated = ""
        if np.isfinite([start, end]).all():
            share = f"{100 * scene.accuracy:.3g} %"
            tolerated = f", and from {newton_range(start, end)} it keeps within {share} of that"
        error = f"{b.settings.error_words} of the balance, meshes apart"
        yield Message(
            f"search for the best load{damper}: it ended at {newtons(b.load, 4)}; no load near it "
            f"lowers the amplitude, by harmonic balance, by more than {percent(b.tolerance)}"
            f"{tolerated}",
            detail=f"searched between {lowest} and {highest} with {len(b.tried)} loads and "
            f"{b.points} points; {b.settings.sentence(error_text=error)}",
        )
        if b.kept is not None:
            yield Message(
                f"best load{damper}: under {newtons(b.load, 4)} the blade does not keep to the "
                "periodic vibration of the harmonic balance; of the vibrations that it keeps those "
                f"under {newtons(b.kept.load, 4)} are the lowest",
                detail=f"another load lowers them by {percent(b.kept.tolerance)} at most, if "
                "amplitude over load is convex there",
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
                    f"{1e6 * height:.4g} um under {newtons(load, 4)} studied: {why}",
                    f"take study.loads round {newtons(load, 4)}, and the lowest of the table",
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
            "balance at the probe",
            "give more model.modes, and compare the stress",
        )
    if found.mesh_error <= TRUSTED_STRESS:
        return text
    return warning(
        f"{text}: too large to rely on, at a sharp edge or on too coarse a mesh",
        "give a finer mesh (mesh.size, mesh.scale), or a fillet (aerofoil.fillet) where the place "
        "is a sharp edge",
    )

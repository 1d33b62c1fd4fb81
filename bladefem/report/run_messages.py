"""Sentences of a run's report: which methods were used, what they leave out, and why a number is as
it is.
"""

from __future__ import annotations

import numpy as np

from ..contact.state_table import quasi_static
from ..study.pipeline.contact_cycle import ContactCycle
from ..study.pipeline.coriolis import CORIOLIS_SHARE, has_coriolis
from ..study.pipeline.curve import load_of
from ..study.pipeline.linear_limits import full_stick
from ..study.pipeline.run_records import SolvedRun
from ..study.pipeline.state_check import state_sentence
from ..util.message import method, warning
from ..util.percent import percent
from .influences import influence_sentence
from .linear import linear_sentence
from .nodes import wear_sentence

# relative difference of frequencies that no search resolves
SAME_FREQUENCY = 1e-4
MESH_ERROR_NOTE = (
    "the estimated errors are those of modes, harmonics, samples, contact points, damper model and "
    "of the mesh, of seats and blade; other meshes are compared by 'bladefem modes --converge' "
    "(frequencies) and 'bladefem chart --mesh' (resonance)"
)


def run_messages(result: SolvedRun, cycles: list[ContactCycle]) -> list[str]:
    """What the run had to say, and how far its models reach."""
    coefficient = result.scene.contact.wear_coefficient
    messages = [
        *result.messages,
        method(MESH_ERROR_NOTE),
        _static_contact(result),
        *coriolis_messages(result),
        *damper_spin_messages(result),
        method(_states(result)),
        method(linear_sentence(cycles)),
        *beyond_stick(result),
    ]
    if result.response.influences:
        messages.append(influence_sentence(result.response.influences))
    if coefficient is not None:
        messages.append(wear_sentence(cycles, coefficient))
    return messages


def _static_contact(result: SolvedRun) -> str:
    """Whether the contact may be taken as quasi-static up to the last harmonic kept of the highest
    frequency.
    """
    patch = next(iter(result.contact.maps.values()))[0].patch
    highest = max(
        curve.settings.harmonics * float(np.max(curve.frequency))
        for curve in result.response.curves
    )
    found = quasi_static(patch, result.scene.material.blade, highest)
    if found.holds:
        return method(found.sentence)
    return warning(
        found.sentence, "take fewer model.harmonics, or a dynamic analysis of the contact faces"
    )


def coriolis_messages(result: SolvedRun) -> list[str]:
    """Whether responses have Coriolis forces, and what they do."""
    shift = result.strength.coriolis
    if not shift > 0:
        return []
    share = (
        f"Coriolis forces move the waves of mode {result.strength.mode} by {percent(shift)} of "
        "its frequency"
    )
    if has_coriolis(result.reduced):
        return [method(f"{share}; responses have them.")]
    if shift <= CORIOLIS_SHARE * result.scene.accuracy:
        return [method(f"{share}; they are left out of the responses.")]
    return [
        warning(
            f"{share}, and are left out of the responses by operation.coriolis = false: resonances "
            "lie that much lower or higher, and amplitudes may differ",
            "set operation.coriolis = true; 'bladefem modes --campbell' has both waves",
        )
    ]


def damper_spin_messages(result: SolvedRun) -> list[str]:
    """What the rotation does to resonances through the damper, and whether responses have it."""
    spin = result.reduced.damper_spin
    if spin is None:
        return []
    mode = result.scene.excitation.mode
    least = CORIOLIS_SHARE * result.scene.accuracy
    share = (
        f"Coriolis forces of the damper move the resonance of mode {mode} in full stick by "
        f"{percent(spin.coriolis)} of its frequency, and change its amplitude with friction by "
        f"some {percent(spin.amplitude)}"
    )
    said: list[str] = []
    if result.reduced.damper.damping is not None:
        said.append(method(f"{share}; responses have them."))
    elif max(spin.coriolis, spin.amplitude) > least:
        said.append(
            warning(
                f"{share}, and are left out of the responses by operation.coriolis = false",
                "set operation.coriolis = true",
            )
        )
    elif spin.coriolis > 0:
        said.append(method(f"{share}; they are left out of the responses."))
    if max(spin.softening, spin.softening_amplitude) > least:
        said.append(
            warning(
                f"spin softening of the damper, which neither responses nor their estimated errors "
                f"count, lowers the resonance of "
                f"mode {mode} in full stick by some {percent(spin.softening)} of its frequency, "
                f"and changes its amplitude with friction by some "
                f"{percent(spin.softening_amplitude)}",
                "count both as further errors of the resonance",
            )
        )
    return said


def _states(result: SolvedRun) -> str:
    """Whether the paper's table of states would do for the loads of the run and the normal motion
    at its resonances.
    """
    motions = [
        c.peak.w[:, 0, 1:]
        for c in result.response.curves
        if c.peak.w.shape[1] == result.mesh.dimension
    ]
    travel = max((float(np.abs(w).max()) for w in motions), default=0.0)
    return state_sentence(
        result.scene, result.contact.problem, list(result.contact.maps), travel or 1e-6
    )


def beyond_stick(result: SolvedRun) -> list[str]:
    """Why resonances lie above that of full stick, where the static load leaves points open."""
    opened = {
        load
        for load, maps in result.contact.maps.items()
        if any((one.force <= 0).any() for one in maps)
    }
    above = [
        load_of(curve)
        for curve in result.response.curves
        if curve.load in opened
        and curve.peak_frequency
        > (1 + SAME_FREQUENCY) * full_stick(result.response.limits, curve.mass).peak_frequency
    ]
    if not above:
        return []
    return [
        f"resonances above that of full stick under {', '.join(above)}: contact points that the "
        "static load leaves open close in vibration, and count as open in full stick"
    ]

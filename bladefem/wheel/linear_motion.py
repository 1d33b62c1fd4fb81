"""Motion of the wheel without friction: all contacts sticking, or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Elements
from ..friction.fourier import to_complex
from .check_point import check_point
from .flexibility import WheelFlexibility, wheel_flexibility
from .model import TUNED_PATTERN, Pattern, Wheel, pattern_elements
from .solution import WheelSolution


def stuck_wheel(
    wheel: Wheel,
    omega: float,
    H: int = 1,
    pattern: Pattern = TUNED_PATTERN,
) -> np.ndarray:
    """(N, H+1, probes) amplitudes with all contacts closed and sticking [m]."""
    check_point(wheel, omega, H, 1, pattern)
    flex = wheel_flexibility(wheel, omega, H, pattern)
    return linear_motion(wheel, flex, "probe").swapaxes(1, 2)


def free_wheel(
    wheel: Wheel,
    omega: float,
    H: int = 1,
    pattern: Pattern = TUNED_PATTERN,
) -> np.ndarray:
    """(N, H+1, probes) amplitudes without contact forces [m]."""
    blades = replace(pattern, elements=None, damper_mass=None, start=None)
    return stuck_wheel(without_contact(wheel), omega, H, blades)


def without_contact(wheel: Wheel) -> Wheel:
    """The wheel with elements that carry nothing, and no damper; made once."""
    if "free" not in wheel.kept:
        e = wheel.elements
        nothing = np.zeros(len(e.kt))
        open_contacts = Elements(nothing, nothing, nothing, nothing, e.tangents)
        wheel.kept["free"] = replace(wheel, elements=open_contacts, damper=None)
    return wheel.kept["free"]


def linear_motion(
    wheel: Wheel,
    flex: WheelFlexibility,
    port: str,
) -> np.ndarray:
    """(N, rows, H+1) motion of a port by the excitation, all contacts sticking [m]."""
    return flex.motion(excitation_forces(wheel, flex), getattr(flex.parts, port), flex.parts.load)


def excitation_forces(wheel: Wheel, flex: WheelFlexibility) -> np.ndarray:
    """(N, loads, H+1) amplitudes of the excitation on all blades [N]."""
    harmonics = flex.T.shape[1]
    parts = flex.parts
    force = np.zeros((wheel.count, parts.load.stop - parts.load.start, harmonics), dtype=complex)
    for h, amplitudes in wheel.excitation.items():
        if h < harmonics:
            force[:, :, h] = amplitudes
    return force


def deviation_forces(
    wheel: Wheel,
    pattern: Pattern,
    point: WheelSolution,
) -> np.ndarray:
    """(N, q, H+1) forces of the blades' deviations on the port "blade" at a solved point; see
    `Pattern`.
    """
    flex = wheel_flexibility(wheel, point.omega, point.probe.shape[1] - 1, pattern)
    count = wheel.count
    beyond = point.f - wheel.springs[:, :, None] * point.w
    beyond[..., 0] -= wheel.preload(pattern_elements(wheel, pattern))
    forces = to_complex(beyond.reshape(count, -1, beyond.shape[3]))
    blade = flex.parts.blade
    if not len(flex.factors):
        return np.zeros((count, blade.stop - blade.start, forces.shape[2]), dtype=complex)
    readings = flex.motion(excitation_forces(wheel, flex), flex.deviating, flex.parts.load)
    readings = readings - flex.motion(forces, flex.deviating, flex.parts.contact)
    found = -np.einsum("hnij,njh->nih", flex.E, readings)
    # what the dampers' own deviations do comes by the contacts
    return found[:, : blade.stop - blade.start]

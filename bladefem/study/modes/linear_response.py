"""Linear forced response of the tuned wheel to one engine order: all of the motion, before any
friction.

Engine order EO reaches blade k with the phase k EO 2 pi / N, so the wheel answers in one nodal
diameter. Modes carry the resonance, the static answer of the modes left out completes it:

    u(w) = sum of phi (phi^H f) / (omega_r^2 - w^2 + damping) + (K^-1 f - sum of phi (phi^H f) /
    omega_r^2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.mesh import Mesh, sector_of

from ...data import ModeSet
from ...errors import InputError
from ...hbm.linear_resonances import wave_frequencies
from ...hbm.model import Damping
from ...reduction.assemble import folded_diameter
from ...util.arrays import RealArray, RealOrComplex
from ..pipeline.bodies import Bodies, is_wheel
from ..pipeline.coriolis import coriolis_in_response
from ..pipeline.ports import blade_ports

if TYPE_CHECKING:
    from ...fem.flexibility import Flexibility
    from ...fem.steady_state import SteadyState

DEFAULT_MODES = 20


@dataclass(frozen=True)
class Forced:
    """A load that turns with an engine order, seen from this blade, and what answers it."""

    engine_order: int
    # (m,) natural circular frequencies of the excited nodal diameter [rad/s]
    omega: RealArray
    # (m, n_points, 3) as the wave runs, conjugated where EO folds back [kg^-1/2]
    shapes: RealOrComplex
    # (m,) phi^H f [N kg^-1/2]
    modal_load: RealOrComplex
    # (n_points, 3) static displacement that the modes do not hold [m]
    rest: RealOrComplex
    damping: Damping
    nodal_diameter: int | None
    # (m, m) Coriolis forces [1/s], as the wave runs; None where they are left out
    coriolis: RealOrComplex | None = None

    @property
    def waves(self) -> RealArray:
        """(m,) circular frequencies at which the excited wave resonates without damping [rad/s]."""
        return self.omega if self.coriolis is None else wave_frequencies(self.omega, self.coriolis)


def excitation_load(bodies: Bodies) -> np.ndarray:
    """(n_points*dim,) the scene's excitation [N]: its force shared by the nodes of
    ``excitation.at``.
    """
    excitation = bodies.scene.excitation
    ports = blade_ports(bodies.mesh, [], excitation)
    return excitation.force * ports.matrix[:, ports.names["load"]].toarray()[:, 0]


def pressure_load(
    bodies: Bodies,
    face: str,
    amplitude: complex,
) -> np.ndarray:
    """(n_points*dim,) nodal forces [N] of a pressure wave on a face, complex amplitude [Pa],
    towards the body.
    """
    from ...fem.loads import surface_load

    unit = surface_load(bodies.still_blade, face, pressure=1.0)
    return amplitude * unit if np.imag(amplitude) else np.real(amplitude) * unit


def linear_response(
    bodies: Bodies,
    load: np.ndarray | None = None,
    damping: Damping | None = None,
    modes: int = DEFAULT_MODES,
) -> Forced:
    """What is needed for the response at any frequency: one factorisation and some modes.

    Args:
        load: (n_points*dim,) complex amplitudes on this blade [N]; the scene's excitation when left
            out. Loads add.
        damping: modal, structural or Rayleigh; the scene's modal damping when left out.
        modes: modes kept.

    Raises:
        InputError: the load does not fit the mesh, or is zero.
    """
    from ...fem.modes import modes as normal_modes

    scene = bodies.scene
    mesh = bodies.mesh
    load = excitation_load(bodies) if load is None else np.asarray(load)
    if (
        load.shape != (mesh.dimension * len(mesh.points),)
        or not np.isfinite(load).all()
        or not load.any()
    ):
        raise InputError(
            f"load of shape {load.shape}, expected {mesh.dimension * len(mesh.points)} finite "
            "values, not all zero"
        )
    order = scene.excitation.engine_order
    n, mirrored = folded_diameter(1, order, sector_of(mesh).count) if is_wheel(mesh) else (0, False)
    flex = bodies.factorised(n)
    found = normal_modes(flex.con, modes, flex)
    if not found.frequencies.all():
        raise InputError("the body floats, expected one that is clamped for its forced response")
    # the opposite wave is the conjugate of this one
    seen = load.conj() if mirrored else load
    omega = 2 * np.pi * found.frequencies
    modal = _modal_forces(mesh, found, seen)
    rest = _static_motion(flex, seen) - np.tensordot(modal / omega**2, found.shapes, 1)
    parts = (found.shapes, modal, rest)
    shapes, modal, rest = (np.conj(part) for part in parts) if mirrored else parts
    coriolis = coriolis_in_response(bodies, found)
    return Forced(
        order,
        omega,
        shapes,
        modal,
        rest,
        damping or Damping(ratio=scene.operation.damping),
        n if is_wheel(mesh) else None,
        coriolis.conj() if mirrored and coriolis is not None else coriolis,
    )


def displacement_at(response: Forced, frequency: float) -> np.ndarray:
    """(n_points, 3) complex amplitudes [m] of this blade at a frequency [Hz]; stresses come from
    fem.stress.
    """
    return np.tensordot(_modal_amplitudes(response, frequency), response.shapes, 1) + response.rest


def probe_response(
    response: Forced,
    vector: np.ndarray,
    frequencies: np.ndarray,
) -> np.ndarray:
    """(k,) complex amplitudes of vector . u [m] at frequencies [Hz]; amplitude is their size, phase
    their angle.

    Args:
        vector: (n_points*dim,) real, such as a column of ``ports.blade_ports``; pressure on a face
            gives the work.
    """
    points = response.rest.shape[0]
    weight = np.zeros((points, 3))
    weight[:, : len(vector) // points] = np.reshape(vector, (points, -1))
    seen = np.einsum("mni,ni->m", response.shapes, weight)
    rest = np.einsum("ni,ni->", response.rest, weight)
    return np.array([_modal_amplitudes(response, f) @ seen + rest for f in frequencies])


def find_linear_peak(
    response: Forced,
    vector: np.ndarray,
    mode: int = 1,
) -> tuple[float, float]:
    """Resonance of a mode: frequency [Hz] and amplitude [m] of vector . u, by golden section round
    the mode.

    Raises:
        InputError: no such mode.
    """
    from scipy.optimize import minimize_scalar

    if not 1 <= mode <= len(response.omega):
        raise InputError(f"mode is {mode}, expected 1 to {len(response.omega)}")
    w = response.waves[mode - 1]
    width = np.clip(6 * half_widths(response)[mode - 1], 1e-6, 0.05)
    f = w / (2 * np.pi)
    best = minimize_scalar(
        lambda x: -abs(probe_response(response, vector, np.array([x * f]))[0]),
        bounds=(1 - width, 1 + width),
        method="bounded",
        options={"xatol": 1e-10},
    )
    return float(best.x * f), float(-best.fun)


def half_widths(response: Forced) -> np.ndarray:
    """(m,) half of the half-power bandwidth of each mode over its frequency: its damping ratio at
    resonance.
    """
    w = response.omega
    return abs(np.array([_damping_terms(response, x)[i] for i, x in enumerate(w)])) / (2 * w**2)


def static_offset(bodies: Bodies, load: np.ndarray | None = None) -> np.ndarray:
    """(n_points, dim) linear displacement [m] by rotation, heat and a steady load [N] that is the
    same on all blades.
    """
    offset = bodies.scene.operation.speed**2 * bodies.swell + bodies.thermal_displacement
    if load is None:
        return offset
    return (
        offset
        + _static_motion(bodies.factorised(0), np.real(load))[:, : bodies.mesh.dimension].real
    )


def steady_state(bodies: Bodies) -> SteadyState:
    """The state of rotation and heat that stresses are of: the nonlinear preload where the
    modes vibrate about it, else the linear answer.

    A leaning blade straightens: at 800 rad/s the linear answer of a twisted one of 200 mm that
    leans by 20 mm is 45 mm, where it moves by 14.
    """
    from ...fem.steady_state import SteadyState

    if bodies.state is not None and bodies.on_large_state:
        return bodies.state
    return SteadyState(static_offset(bodies), bodies.scene.operation.speed)


def _modal_amplitudes(response: Forced, frequency: float) -> np.ndarray:
    """(m,) modal amplitudes."""
    w = 2 * np.pi * frequency
    single = response.omega**2 - w**2 + _damping_terms(response, w)
    if response.coriolis is None:
        return response.modal_load / single
    return np.linalg.solve(np.diag(single) + 1j * w * response.coriolis, response.modal_load)


def _damping_terms(response: Forced, w: float) -> np.ndarray:
    """(m,) what damping adds to omega_r^2 - w^2; a loss factor does not act at rest [1/s^2]."""
    omega = response.omega
    damping = response.damping
    return 1j * (w * damping.viscous(omega) + np.sign(w) * damping.structural * omega**2)


def _modal_forces(
    mesh: Mesh,
    modes: ModeSet,
    load: np.ndarray,
) -> np.ndarray:
    force = load.reshape(len(mesh.points), -1)
    return np.einsum("mni,ni->m", modes.shapes[:, :, : force.shape[1]].conj(), force)


def _static_motion(flex: Flexibility, load: np.ndarray) -> np.ndarray:
    """(n_points, 3) K^-1 f."""
    from ...fem.constraint import expand_to_mesh, restrict_load
    from ...fem.flexibility import compliance

    u = expand_to_mesh(
        flex.con,
        compliance(
            flex,
            restrict_load(flex.con, load.reshape(-1, 1)).astype(
                complex if np.iscomplexobj(load) else flex.con.dtype
            ),
        ),
    )[:, :, 0]
    return np.concatenate([u, np.zeros((len(u), 3 - u.shape[1]))], axis=1)

"""One family of blade modes of a tuned wheel, mode by nodal diameter, and what everything else at
the contacts gives way to forces: the ground on which the law of one damper stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import PortModel, RigidBody
from ..errors import InputError
from ..hbm.linear.bodies import modal_flexibility, receptance_block, rigid_stack, stack_bodies
from ..reduction.assemble import folded_diameter
from ..util.arrays import ComplexArray, RealArray, RealOrComplex
from .model import Wheel
from .tuned import travelling_order


@dataclass(frozen=True)
class ModeFamily:
    """One family of modes of the tuned wheel, in coordinates a of the blade readings; N sectors."""

    # (N,) nodal diameters 0..N-1: circular frequency [rad/s], viscous damping [1/s], loss term
    # [1/s^2], reading of the mode and its shape at the probe over that reading
    omega: RealArray
    viscous: RealOrComplex
    hysteretic: RealArray
    reading: RealArray
    probe: ComplexArray
    # (N,) modal force of the first harmonic by diameter, over the reading
    force: ComplexArray
    # (m,) motion of the contacts of a damper by the blade before it and the one after it
    before: RealArray
    after: RealArray
    # (H, m, m) flexibility of everything else at the contacts [m/N], of harmonics 1..H: of all
    # other modes and the damper in the first, of all modes and the damper in the others
    flexibility: ComplexArray
    # (q,) readings of the blade over the one that is followed, in the order's diameter
    readings: RealOrComplex
    # (q, q) what all other modes and the residual flexibility read for forces on the readings, at
    # the frequency of the first flexibility, without contacts
    reading_flexibility: ComplexArray
    # circular frequency of both [rad/s]
    at: float


def family_of_modes(wheel: Wheel, omega: float, mode: int = 0, harmonics: int = 1) -> ModeFamily:
    """The family of one mode of the order's nodal diameter: in all others the mode whose blade
    moves most alike.

    Args:
        omega: circular frequency at which everything else gives way [rad/s].
        mode: number of the mode, from 0.
        harmonics: of the contact forces. The h-th one moves the tuned wheel in a wave of h times
            the order's nodal diameters, whose flexibility it has.

    Raises:
        InputError: the forces are no travelling wave of one harmonic, or the blades have no
            readings.
    """
    order = travelling_order(wheel)
    if order is None or set(wheel.excitation) != {1}:
        raise InputError(
            "damper law: expected one engine order, statistics of other forces take the whole wheel"
        )
    count = wheel.count
    own, _ = folded_diameter(1, order, count)
    pattern = _blade_shapes(wheel.sectors[own])[:, mode]
    ports = wheel.sectors[own].ports
    readings = wheel.sectors[own].shapes[ports["blade"], mode] if "blade" in ports else np.zeros(0)
    if not len(readings):
        raise InputError("damper law: expected the port 'blade' in the wheel's sectors")
    read = int(np.argmax(abs(readings)))
    rows = []
    for d in range(count):
        body, mirrored = wheel.wave(d)
        rows.append(_mode_of(wheel, body, pattern, read, mirrored))
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    force = np.fft.fft(wheel.excitation[1], axis=0)
    theta = 2 * np.pi * np.arange(count) / count
    before, after = _blade_motions(values["contact"], theta, order)
    body, mirrored = wheel.wave(order)
    left_out = int(values["number"][order])
    flexibility = [_contact_flexibility(wheel, order, omega, left_out)]
    flexibility += [
        _contact_flexibility(wheel, h * order % count, h * omega) for h in range(2, harmonics + 1)
    ]
    return ModeFamily(
        values["omega"],
        values["viscous"],
        values["hysteretic"],
        values["reading"],
        values["probe"],
        (values["load"].conj() * force).sum(axis=1),
        before,
        after,
        np.array(flexibility),
        (readings.conj() if mirrored else readings) / abs(readings[read]),
        _other_modes(wheel, body, ports["blade"], left_out, omega, mirrored),
        omega,
    )


def _blade_shapes(body: PortModel) -> np.ndarray:
    """(rows, modes) shapes at the blade's readings and at the probe, each mode of length 1."""
    rows = [body.shapes[body.ports[name]] for name in ("blade", "probe") if name in body.ports]
    shapes = np.concatenate(rows)
    return shapes / np.maximum(np.linalg.norm(shapes, axis=0), np.finfo(float).tiny)


def _mode_of(
    wheel: Wheel,
    body: PortModel,
    pattern: np.ndarray,
    read: int,
    mirrored: bool,
) -> dict[str, np.ndarray]:
    """The mode of one diameter that moves the blade like a pattern, its shapes over one reading."""
    everything = np.arange(len(body.residual))
    blade = everything[body.ports["blade"]]
    number = int(np.argmax(abs(pattern.conj() @ _blade_shapes(body))))
    shape = body.shapes[:, number].conj() if mirrored else body.shapes[:, number]
    shape = shape / shape[blade[read]]
    viscous = np.broadcast_to(wheel.damping.viscous(body.omega), body.omega.shape)[number]
    if body.damping is not None:
        viscous = viscous + _own_damping(body, mirrored)[number]
    omega = body.omega[number]
    return {
        "number": np.array(number),
        "omega": np.array(omega),
        "viscous": np.array(viscous),
        "hysteretic": np.array(wheel.damping.structural * omega**2),
        "reading": np.array(abs(body.shapes[blade[read], number])),
        "contact": shape[everything[body.ports["contact"]][wheel.rows]],
        "load": shape[everything[body.ports["load"]]],
        "probe": np.array(shape[everything[body.ports["probe"]][0]]),
    }


def _own_damping(body: PortModel, mirrored: bool) -> np.ndarray:
    """(m,) damping of each mode by itself [1/s]; imaginary where Coriolis forces move its wave."""
    if body.damping is None:
        return np.zeros(len(body.omega))
    own = body.damping if body.damping.ndim == 1 else np.diag(body.damping)
    return own.conj() if mirrored else own


def _blade_motions(
    contact: np.ndarray,
    theta: np.ndarray,
    order: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Real alpha and beta (m,) with contact = alpha + beta e^{i theta}: exact at the order's
    diameter where that is not 0 or N/2, in the least squares with its neighbours there.
    """
    count = len(theta)
    near = [order] if 0 < 2 * order % count else [order - 1, order, order + 1]
    system = []
    right = []
    for d in near:
        turn = np.exp(1j * theta[d % count])
        system += [[1.0, turn.real], [0.0, turn.imag]]
        right += [contact[d % count].real, contact[d % count].imag]
    found, _, _, _ = np.linalg.lstsq(np.array(system), np.array(right), rcond=None)
    return found[0], found[1]


def _contact_flexibility(
    wheel: Wheel,
    diameter: int,
    omega: float,
    left_out: int | None = None,
) -> np.ndarray:
    """(m, m) flexibility at the contacts of all modes but one, or of all, and of the damper in a
    wave of some nodal diameters [m/N].
    """
    body, mirrored = wheel.wave(diameter)
    rows = np.arange(len(body.residual))[body.ports["contact"]][wheel.rows]
    G = _other_modes(wheel, body, rows, left_out, omega, mirrored)
    damper = wheel.damper
    if damper is None:
        return G
    other = (
        rigid_stack(damper, wheel.rows)
        if isinstance(damper, RigidBody)
        else stack_bodies((damper,), wheel.damper_damping, wheel.rows)
    )
    flexible = modal_flexibility(other, np.array([omega]))
    return G + receptance_block(other, flexible, other.contact, other.contact)[0]


def _other_modes(
    wheel: Wheel,
    body: PortModel,
    rows: slice | np.ndarray,
    left_out: int | None,
    omega: float,
    mirrored: bool,
) -> np.ndarray:
    """(m, m) flexibility of all modes but one, or of all, without damper, at some rows of the ports
    [m/N].
    """
    own = wheel.damping.viscous(body.omega) + _own_damping(body, mirrored)
    Z = body.omega**2 * (1 + 1j * wheel.damping.structural) - omega**2 + 1j * omega * own
    others = np.arange(len(Z)) != left_out
    shapes = body.shapes[rows][:, others]
    residual = body.residual[rows][:, rows]
    if mirrored:
        # the conjugate wave, in time as before
        shapes, residual = shapes.conj(), residual.conj()
    return (shapes / Z[others]) @ shapes.conj().T + residual

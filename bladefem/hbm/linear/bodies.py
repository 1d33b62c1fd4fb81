"""Linear bodies at all harmonics of one frequency: modal flexibilities, receptances, motions under
forces at the ports.

The ports that the balance uses are in the order contact, load, probe. Arrays carry the harmonic
on their first axis, of length 1 where one body serves all harmonics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...data import PortModel, RigidBody
from ...errors import InputError, NotSolvedError
from ...util.arrays import RealArray, RealOrComplex

# frequency of the modes that fill up a harmonic which has fewer [rad/s]: nothing moves them
UNUSED_MODE_FREQUENCY = 1e100


@dataclass(frozen=True)
class Damping:
    """Damping of the modes of a body, all contributions added: the term i w c of each mode's
    receptance.

    Raises:
        InputError: a negative number, or none.
    """

    # share of critical damping of each mode [1]
    ratio: float | np.ndarray = 0.0
    # loss factor: i eta omega_r^2, not for the mean [1]
    structural: float | np.ndarray = 0.0
    # Rayleigh, proportional to the mass [1/s]
    mass: float = 0.0
    # Rayleigh, proportional to the stiffness [s]
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        for name in ("ratio", "structural", "mass", "stiffness"):
            value = np.asarray(getattr(self, name))
            if not (np.isfinite(value).all() and np.all(value >= 0)):
                raise InputError(
                    f"damping.{name} = {value}: expected finite numbers, none of them negative"
                )

    def viscous(self, omega: np.ndarray) -> np.ndarray:
        """(m,) viscous part: 2 zeta omega_r + alpha + beta omega_r^2 [1/s]."""
        return 2 * self.ratio * omega + self.mass + self.stiffness * omega**2


@dataclass(frozen=True)
class Stack:
    """One body in the nodal diameters of harmonics 0..H; S = 1 for all of them, else H+1. m modes,
    P ports.
    """

    # (S, m) [rad/s]; filled up with UNUSED_MODE_FREQUENCY where a harmonic has fewer modes
    omega: RealArray
    # (S, m) modal damping [1/s]
    viscous: RealArray
    # (S, m) loss factor times omega^2 [1/s^2]
    hysteretic: RealArray
    # (S, m, m) viscous damping that couples modes [1/s]
    coupled: RealOrComplex | None
    # (S, P, m) [kg^-1/2]
    shapes: RealOrComplex
    # (S, P, P) [m/N]
    residual: RealOrComplex
    contact: slice
    load: slice
    probe: slice
    # (S, m, m) forces of the displacements that have no energy [1/s^2]
    circulatory: RealOrComplex | None = None

    def first(self, count: int) -> Stack:
        """The body in the first nodal diameters."""
        names = ("omega", "viscous", "hysteretic", "coupled", "circulatory", "shapes", "residual")
        return replace(
            self,
            **{name: part[:count] for name in names if (part := getattr(self, name)) is not None},
        )


def stack_bodies(
    bodies: tuple[PortModel, ...],
    damping: Damping,
    rows: np.ndarray,
) -> Stack:
    """The bodies of the harmonics as one; `rows` of the contact port enter the balance."""
    first = _port_slices(bodies[0], rows)
    ports = [
        first if body.ports == bodies[0].ports else _port_slices(body, rows) for body in bodies
    ]
    if len({tuple(map(len, parts)) for parts in ports}) > 1:
        raise InputError(
            "sides: the bodies of the harmonics have ports of different sizes, expected the same"
        )
    most = max(len(body.omega) for body in bodies)
    order = [np.concatenate(parts) for parts in ports]
    omega = np.array([_fill_modes(body.omega, most, UNUSED_MODE_FREQUENCY) for body in bodies])
    own = [
        np.zeros(len(body.omega))
        if body.damping is None or body.damping.ndim == 2
        else body.damping
        for body in bodies
    ]
    viscous = np.array(
        [
            _fill_modes(damping.viscous(body.omega) + c, most)
            for body, c in zip(bodies, own, strict=True)
        ]
    )
    hysteretic = np.array(
        [_fill_modes(damping.structural * body.omega**2, most) for body in bodies]
    )
    coupled = None
    if any(body.damping is not None and body.damping.ndim == 2 for body in bodies):
        coupled = np.array([_square_damping(body, most) for body in bodies])
    circulatory = None
    if any(body.circulatory is not None for body in bodies):
        circulatory = np.array([_padded_circulation(body, most) for body in bodies])
    shapes = np.array(
        [_padded_shapes(body.shapes[p], most) for body, p in zip(bodies, order, strict=True)]
    )
    residual = np.array(
        [body.residual[p[:, None], p] for body, p in zip(bodies, order, strict=True)]
    )
    a, b, c = np.cumsum([len(part) for part in ports[0]])
    return Stack(
        omega,
        viscous,
        hysteretic,
        coupled,
        shapes,
        residual,
        slice(0, a),
        slice(a, b),
        slice(b, c),
        circulatory,
    )


def rigid_modes(body: RigidBody, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Shapes (m, r) of the modes of mass 1 and frequency zero that a rigid body is, at some rows of
    its contacts, and what gyroscopic forces couple them by (r, r) [1/s]; None without.
    """
    half = np.linalg.cholesky(body.mass)
    shapes = np.linalg.solve(half, body.B[rows].T).T
    if body.gyroscopic is None:
        return shapes, None
    return shapes, np.linalg.solve(half, np.linalg.solve(half, body.gyroscopic).T).T


def rigid_stack(body: RigidBody, rows: np.ndarray) -> Stack:
    """A rigid body by modes of frequency zero; `rows` of its contacts enter the balance."""
    shapes, coupled = rigid_modes(body, rows)
    m, r = shapes.shape
    none = np.zeros((1, r))
    return Stack(
        none,
        none,
        none,
        None if coupled is None else coupled[None],
        shapes[None],
        np.zeros((1, m, m)),
        slice(0, m),
        slice(m, m),
        slice(m, m),
    )


def modal_flexibility(stack: Stack, w: np.ndarray) -> np.ndarray:
    """(k, m), or (k, m, m) for coupled modes: inverse modal impedances at the circular
    frequencies w (k,) [s^2].

    Rigid modes count as immovable at w = 0.

    Raises:
        NotSolvedError: a resonance without damping is hit exactly.
    """
    w = w[:, None]
    Z = stack.omega**2 - w**2 + 1j * (w * stack.viscous + np.sign(w) * stack.hysteretic)
    still = (w == 0) & (stack.omega == 0)
    if stack.coupled is None and stack.circulatory is None:
        hit = np.any((Z == 0) & ~still, axis=1)
        if hit.any():
            raise NotSolvedError(
                f"a resonance without damping is hit exactly, at {w[hit][0, 0]:.10g} rad/s: "
                "expected some damping, or another frequency"
            )
        return np.divide(1.0, Z, out=np.zeros_like(Z), where=~still)
    full = np.zeros((*Z.shape, Z.shape[1]), dtype=complex)
    if stack.coupled is not None:
        full += 1j * w[:, :, None] * stack.coupled
    if stack.circulatory is not None:
        full += stack.circulatory
    modes = np.arange(Z.shape[1])
    full[:, modes, modes] += np.where(still, 1.0, Z)
    flexible = np.linalg.inv(full)
    flexible[:, modes, modes] *= ~still
    return flexible


def receptance_block(
    stack: Stack,
    flexible: np.ndarray,
    rows: slice,
    columns: slice,
) -> np.ndarray:
    """(k, rows, columns) receptances [m/N]."""
    left = stack.shapes[:, rows]
    right = stack.shapes[:, columns].conj().swapaxes(1, 2)
    residual = stack.residual[:, rows, columns]
    if flexible.ndim == 3:
        return left @ flexible @ right + residual
    # two real products in one, half the work of a complex one
    if len(left) == 1 and np.isrealobj(left):
        parts = np.concatenate([flexible.real, flexible.imag])[:, None, :] * left
        parts = (parts.reshape(-1, left.shape[2]) @ right[0]).reshape(
            2, len(flexible), left.shape[1], right.shape[2]
        )
        result = np.empty(parts.shape[1:], dtype=complex)
        np.add(parts[0], residual, out=result.real)
        result.imag = parts[1]
        return result
    return (left * flexible[:, None, :]) @ right + residual


def modal_amplitudes(
    stack: Stack,
    flexible: np.ndarray,
    forces: np.ndarray,
) -> np.ndarray:
    """(k, m) modal amplitudes under forces (k, P) at the ports."""
    push = (forces[:, None, :] @ stack.shapes.conj())[:, 0]
    return flexible * push if flexible.ndim == 2 else (flexible @ push[:, :, None])[:, :, 0]


def port_motion(
    stack: Stack,
    modal: np.ndarray,
    forces: np.ndarray,
    rows: slice,
) -> np.ndarray:
    """(k, rows) displacements by modal amplitudes (k, m) and by forces (k, P) on the residual
    flexibility [m].
    """
    return (
        stack.shapes[:, rows] @ modal[:, :, None] + stack.residual[:, rows] @ forces[:, :, None]
    )[:, :, 0]


def impedance_rate(
    stack: Stack,
    w: np.ndarray,
    modal: np.ndarray,
) -> np.ndarray:
    """(k, m) derivative with w of the modal impedances, times modal amplitudes (k, m)."""
    rate = (-2 * w[:, None] + 1j * stack.viscous) * modal
    return (
        rate if stack.coupled is None else rate + 1j * (stack.coupled @ modal[:, :, None])[:, :, 0]
    )


def damping_rate(
    stack: Stack,
    w: np.ndarray,
    modal: np.ndarray,
) -> np.ndarray:
    """(k, m) the damping's part of the modal impedances, times modal amplitudes (k, m).

    Gyroscopic and Coriolis forces, which are no damping, have none.
    """
    w = w[:, None]
    rate = 1j * (w * stack.viscous + np.sign(w) * stack.hysteretic) * modal
    if stack.coupled is None:
        return rate
    loss = stack.coupled - gyroscopic_part(stack.coupled)
    return rate + 1j * w * (loss @ modal[:, :, None])[:, :, 0]


def gyroscopic_part(coupled: np.ndarray) -> np.ndarray:
    """(..., m, m) the part of a viscous matrix that does no work: skew-Hermitian."""
    return (coupled - coupled.conj().swapaxes(-1, -2)) / 2


def port_receptance(
    body: PortModel,
    damping: Damping,
    w: float,
    rows: np.ndarray | slice,
    columns: np.ndarray | slice,
) -> np.ndarray:
    """(rows, columns) displacement [m] of one body by unit harmonic forces [N]; at w = 0 without
    the rigid modes.
    """
    both = [np.arange(len(body.residual))[part] for part in (rows, columns)]
    ports = {"contact": np.concatenate(both)}
    stack = stack_bodies(
        (replace(body, ports=ports),),
        damping,
        np.arange(len(ports["contact"])),
    )
    split = len(both[0])
    return receptance_block(
        stack, modal_flexibility(stack, np.array([w])), slice(0, split), slice(split, None)
    )[0]


def _port_slices(body: PortModel, rows: np.ndarray) -> list[np.ndarray]:
    everything = np.arange(len(body.residual))
    return [everything[body.ports["contact"]][rows]] + [
        everything[body.ports.get(name, slice(0, 0))] for name in ("load", "probe")
    ]


def _padded_shapes(shapes: np.ndarray, count: int) -> np.ndarray:
    """Shapes (P, m) filled up with zeros to (P, count)."""
    spare = count - shapes.shape[1]
    return np.pad(shapes, ((0, 0), (0, spare))) if spare else shapes


def _fill_modes(
    values: np.ndarray,
    count: int,
    value: float = 0.0,
) -> np.ndarray:
    spare = count - len(values)
    return np.concatenate([values, np.full(spare, value)]) if spare else values


def _padded_circulation(body: PortModel, count: int) -> np.ndarray:
    """(count, count) of the body's m modes."""
    if body.circulatory is None:
        return np.zeros((count, count))
    return np.pad(body.circulatory, ((0, count - len(body.omega)),) * 2)


def _square_damping(body: PortModel, count: int) -> np.ndarray:
    pad = count - len(body.omega)
    if body.damping is None or body.damping.ndim == 1:
        return np.zeros((count, count))
    return np.pad(body.damping, ((0, pad), (0, pad)))

"""Flexibility of the tuned wheel, contacts closed, by nodal diameters.

In nodal diameter d the sector with its damper has, for forces F on its ports,

    x = (A_d + U_d T_dh U_d^H) F,    A = (1 + R K)^-1 R,    U = (1 + R K)^-1 L,    T = (Z + N)^-1,

R the residual flexibilities of both bodies, L their modes, Z(h omega) modal impedances, K the
springs of full stick, N = L^H K U (Sherman, Morrison and Woodbury). Only T depends on the
frequency and the harmonic; d > N/2 are the conjugates of N - d. Sums over sectors are FFTs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..data import PortModel, RigidBody
from ..errors import NotSolvedError
from ..hbm.linear.bodies import Damping, gyroscopic_part, rigid_modes
from ..hbm.linear.woodbury import frequency_independent_parts
from ..util.arrays import ComplexArray, RealArray, RealOrComplex
from .model import Wheel
from .partition import Partition

# rigid motions that the contact springs resist less than this, relatively, are left out
NEGLIGIBLE_STIFFNESS_SHARE = 1e-12


@dataclass(frozen=True)
class DiameterParts:
    """Modes and residual flexibility by nodal diameter, the same at all frequencies; P ports,
    k modes of both bodies.

    Ports are in the order contact, blade, modes of the damper, load, probe.
    """

    partition: Partition
    # (D, P, P) residual flexibility with contact springs, of the D nodal diameters among 0..N/2
    # that this rank has [m/N]
    A: ComplexArray
    # (N, P, k) modes with contact springs [kg^-1/2]
    U: ComplexArray
    # (N, k, k) stiffness of the contact springs in the modes [1/s^2]
    N: ComplexArray
    # (N, k) squared circular frequencies, those of a flow's shift in them [1/s^2]
    stiffness: RealArray
    # (N, k, k) viscous damping, with that of the flow [1/s]
    viscous: ComplexArray
    # (N, k) loss factor times squared frequency [1/s^2]
    hysteretic: RealArray
    # (N, k, k) T of the mean [s^2]
    mean: RealOrComplex
    contact: slice
    blade: slice
    damper: slice
    load: slice
    probe: slice

    def deviating(self, dampers: bool) -> slice:
        """The readings of the blades, with those of the dampers or without."""
        return slice(self.blade.start, self.damper.stop if dampers else self.blade.stop)


def diameter_parts(wheel: Wheel) -> DiameterParts:
    """The parts of a wheel, made once."""
    if "parts" not in wheel.kept:
        wheel.kept["parts"] = _made_parts(wheel)
    return wheel.kept["parts"]


def _made_parts(wheel: Wheel) -> DiameterParts:
    partition = wheel.partition
    own = range(partition.half.start, partition.half.stop)
    diameters = [wheel.sectors[d] for d in own]
    most = max(len(body.omega) for body in wheel.sectors.values())
    sizes = _port_sizes(wheel)
    ends = np.cumsum(sizes)
    R, L = _residual_and_modes(wheel, diameters, most, int(ends[-1]))
    springs = np.zeros(ends[-1])
    springs[: ends[0]] = wheel.springs.ravel()
    A, U, _, N = frequency_independent_parts(R, L, springs)
    count = wheel.count
    stiffness, viscous, hysteretic = _modal_terms(wheel, most)
    # the flow does nothing to the mean
    still, _, _ = _modal_terms(replace(wheel, influence=None), most)
    contact = slice(sizes[0])
    mean = np.array(
        [
            _mean_flexibility(still[d], L[i, contact], springs[contact], N[i], wheel.hold)
            for i, d in enumerate(own)
        ]
    ).reshape(N.shape)
    U, N, mean = (partition.join(part) for part in (U, N, mean))
    slices = [slice(int(e - s), int(e)) for s, e in zip(sizes, ends, strict=True)]
    return DiameterParts(
        partition,
        A,
        _all_diameters(U, count),
        _all_diameters(N, count),
        stiffness,
        viscous,
        hysteretic,
        _all_diameters(mean if wheel.coupled else np.zeros_like(mean), count),
        *slices,
    )


def _port_sizes(wheel: Wheel) -> list[int]:
    body = wheel.sectors[0]
    everything = np.arange(len(body.residual))
    blade, load, probe = (
        len(everything[body.ports.get(n, slice(0, 0))]) for n in ("blade", "load", "probe")
    )
    return [len(wheel.rows), blade, damper_modes(wheel), load, probe]


def damper_modes(wheel: Wheel) -> int:
    """Modes of a damper, rigid ones included."""
    damper = wheel.damper
    if damper is None:
        return 0
    return len(damper.mass) if isinstance(damper, RigidBody) else len(damper.omega)


def damper_gyroscopic(wheel: Wheel) -> np.ndarray:
    """(k, k) what gyroscopic forces couple the damper's modes of mass 1 by [1/s]."""
    damper = wheel.damper
    found = None
    if isinstance(damper, RigidBody):
        _, found = rigid_modes(damper, wheel.rows)
    elif damper is not None and damper.damping is not None and damper.damping.ndim == 2:
        found = gyroscopic_part(damper.damping)
    return np.zeros((damper_modes(wheel),) * 2) if found is None else found


def _residual_and_modes(
    wheel: Wheel,
    diameters: list[PortModel],
    most: int,
    ports: int,
) -> tuple[np.ndarray, np.ndarray]:
    """R (D, P, P) and L (D, P, k) of the blades and the damper, which moves against them."""
    damper = wheel.damper
    contact = np.arange(len(wheel.rows))
    other: RealOrComplex
    flexibility: RealOrComplex
    if isinstance(damper, RigidBody):
        other, _ = rigid_modes(damper, wheel.rows)
        flexibility = np.zeros((len(contact), len(contact)))
    elif damper is not None:
        rows = np.arange(len(damper.residual))[damper.ports["contact"]][wheel.rows]
        other = damper.shapes[rows]
        flexibility = damper.residual[np.ix_(rows, rows)]
    else:
        other = np.zeros((len(contact), 0))
        flexibility = np.zeros((len(contact), len(contact)))
    modes = other.shape[1]
    R = np.zeros((len(diameters), ports, ports), dtype=complex)
    L = np.zeros((len(diameters), ports, most + modes), dtype=complex)
    for d, body in enumerate(diameters):
        order, rows = _port_order(wheel, body)
        R[d][np.ix_(rows, rows)] = body.residual[np.ix_(order, order)]
        R[d][np.ix_(contact, contact)] += flexibility
        L[d, rows, : len(body.omega)] = body.shapes[order]
        L[d, contact, most:] = -other
        # the rows between blade and load read the damper's modes
        own = np.setdiff1d(np.arange(ports), rows)
        L[d, own, most:] = np.eye(modes)
    return R, L


def _port_order(wheel: Wheel, body: PortModel) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the body's ports in the wheel's order, and their places there."""
    everything = np.arange(len(body.residual))
    parts = [everything[body.ports["contact"]][wheel.rows]]
    parts += [everything[body.ports.get(name, slice(0, 0))] for name in ("blade", "load", "probe")]
    order = np.concatenate(parts)
    places = np.arange(len(order))
    behind = places >= len(parts[0]) + len(parts[1])
    return order, places + damper_modes(wheel) * behind


def _modal_terms(
    wheel: Wheel,
    most: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squared frequencies (N, k), viscous damping (N, k, k) and loss terms (N, k)."""
    damper = wheel.damper
    extra: tuple[np.ndarray, np.ndarray | None]
    if isinstance(damper, RigidBody):
        _, coupled = rigid_modes(damper, wheel.rows)
        extra = (np.zeros(len(damper.mass)), coupled)
    elif damper is not None:
        extra = (damper.omega, damper.damping)
    else:
        extra = (np.zeros(0), None)
    k = most + len(extra[0])
    stiffness = np.zeros((wheel.count, k))
    viscous = np.zeros((wheel.count, k, k), dtype=complex)
    hysteretic = np.zeros((wheel.count, k))
    for d in range(wheel.count):
        body, mirrored = wheel.wave(d)
        for start, omega, own, law in (
            (0, body.omega, body.damping, wheel.damping),
            (most, *extra, wheel.damper_damping),
        ):
            part = slice(start, start + len(omega))
            stiffness[d, part] = omega**2
            viscous[d, part, part] = _damping_matrix(omega, own, law)
            hysteretic[d, part] = law.structural * omega**2
        if mirrored:
            viscous[d] = viscous[d].conj()
        # diameters with fewer modes: nothing moves these
        stiffness[d, len(body.omega) : most] = 1e200
    return stiffness, viscous, hysteretic


def _damping_matrix(
    omega: np.ndarray,
    own: np.ndarray | None,
    law: Damping,
) -> np.ndarray:
    viscous = np.diag(np.broadcast_to(law.viscous(omega), omega.shape))
    if own is None:
        return viscous
    return viscous + (np.diag(own) if own.ndim == 1 else own)


def _mean_flexibility(
    stiffness: np.ndarray,
    L: np.ndarray,
    springs: np.ndarray,
    N: np.ndarray,
    hold: float,
) -> np.ndarray:
    """(k, k) T of the mean in one nodal diameter: rigid motions are held by a share of what the
    contact springs do, and left out where these do not resist them.
    """
    k = len(stiffness)
    rigid = np.flatnonzero(stiffness == 0)
    B = L[:, rigid]
    stiff = B.conj().T @ (springs[:, None] * B)
    Z = np.diag(stiffness).astype(complex)
    Z[np.ix_(rigid, rigid)] = hold * stiff
    size = np.sqrt(np.where(np.diag(stiff).real > 0, np.diag(stiff).real, 1.0))
    values, vectors = np.linalg.eigh(stiff / np.outer(size, size))
    seen = np.zeros((k, int((values > NEGLIGIBLE_STIFFNESS_SHARE).sum())), dtype=complex)
    seen[rigid] = (vectors / size[:, None])[:, values > NEGLIGIBLE_STIFFNESS_SHARE]
    V = np.column_stack([np.eye(k)[:, stiffness > 0], seen])
    return V @ np.linalg.inv(V.conj().T @ (Z + N) @ V) @ V.conj().T


def _all_diameters(half: np.ndarray, count: int) -> np.ndarray:
    """Nodal diameters 0..N-1 from 0..N/2."""
    return np.concatenate([half, half[count - len(half) : 0 : -1].conj()])


def modal_impedance(
    parts: DiameterParts,
    omega: float,
    harmonics: int,
) -> np.ndarray:
    """(N, H+1, k, k) modal impedance Z of the free bodies at the harmonics of omega [1/s^2]."""
    _count, k = parts.stiffness.shape
    w = omega * np.arange(harmonics + 1)
    Z = 1j * w[None, :, None, None] * parts.viscous[:, None]
    diagonal = parts.stiffness[:, None, :] - (w**2)[None, :, None]
    diagonal = diagonal + 1j * np.sign(w)[None, :, None] * parts.hysteretic[:, None, :]
    modes = np.arange(k)
    Z[:, :, modes, modes] += diagonal
    return Z


def modal_flexibility(parts: DiameterParts, Z: np.ndarray) -> np.ndarray:
    """(N, H+1, k, k) T = (Z + N)^-1, of the mean as `DiameterParts` has it.

    Raises:
        NotSolvedError: a resonance without damping is hit exactly.
    """
    T = np.zeros_like(Z)
    T[:, 0] = parts.mean
    try:
        T[:, 1:] = np.linalg.inv(Z[:, 1:] + parts.N[:, None])
    except np.linalg.LinAlgError:
        raise NotSolvedError(
            "flexibility of the wheel is singular: a resonance without damping is hit exactly"
        ) from None
    return T


def ring_product(blocks: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(N, k, H+1) products of blocks (N, H+1, k, k) with amplitudes x (N, k, H+1)."""
    return (blocks @ x.swapaxes(1, 2)[..., None])[..., 0].swapaxes(1, 2)


def residual_product(
    partition: Partition,
    A: np.ndarray,
    f: np.ndarray,
) -> np.ndarray:
    """(own, P, K) A_d f_d of this rank's nodal diameters from its A (D, P, P) and f (N, P, K)."""
    forward, backward = partition.diameters
    K = f.shape[2]
    # both ways of a wave at once: each A is read from memory only once
    both = np.zeros((len(A), f.shape[1], 2 * K), dtype=complex)
    both[:, :, :K] = f[forward]
    both[partition.paired, :, K:] = f[backward][::-1].conj()
    moved = A @ both
    return np.concatenate([moved[:, :, :K], moved[partition.paired, :, K:][::-1].conj()])


def modal_forces(
    parts: DiameterParts,
    f: np.ndarray,
    columns: slice,
) -> np.ndarray:
    """(own, k, H+1) forces on the modes by forces f (N, columns, H+1) at some ports."""
    found = [
        (parts.U[some, columns].swapaxes(1, 2) @ f[some].conj()).conj()
        for some in parts.partition.diameters
    ]
    return np.concatenate(found)


def modal_motion(
    parts: DiameterParts,
    q: np.ndarray,
    rows: slice,
) -> np.ndarray:
    """(own, rows, H+1) motions at some ports by motions of the modes q (own, k, H+1)."""
    forward, backward = parts.partition.diameters
    first = forward.stop - forward.start
    return np.concatenate([parts.U[forward, rows] @ q[:first], parts.U[backward, rows] @ q[first:]])


def tuned_product(
    parts: DiameterParts,
    T: np.ndarray,
    f: np.ndarray,
    rows: slice,
    columns: slice,
) -> np.ndarray:
    """(own, rows, H+1) motions of the tuned wheel in this rank's nodal diameters, by forces f (N,
    columns, H+1) in all.
    """
    modal = ring_product(parts.partition.own(T), modal_forces(parts, f, columns))
    out = modal_motion(parts, modal, rows)
    out += residual_product(parts.partition, parts.A[:, rows, columns], f)
    return out

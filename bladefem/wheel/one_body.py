"""A small mistuned wheel as one body with its own normal modes, for the balance of `bladefem.hbm`:
the compiled way where few contacts are solved at thousands of points.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from ..data import PortModel, RigidBody
from ..errors import InputError
from ..hbm.linear.bodies import Damping
from ..hbm.model import ReducedModel
from ..hbm.sector_modes import real_form
from ..reduction.assemble import join_bodies
from .model import Pattern, Wheel, heavier_damper, pattern_elements

# residual flexibility of the blade readings over that of their modes: no deviation acts on it
NEGLIGIBLE_FLEXIBILITY_SHARE = 1e-9
PORT_GROUPS = ("contact", "blade", "load", "probe")


def one_body_model(
    wheel: Wheel,
    pattern: Pattern,
    coupled_damping: bool = False,
) -> ReducedModel:
    """The balance's model of all sectors, blade after blade in every port.

    Args:
        coupled_damping: keep what couples the mistuned modes of the tuned modes' damping; small
            next to the frequency differences for a small scatter, and expensive.

    Raises:
        InputError: deviations act on a residual flexibility, or the damping or the aerodynamic
            influence has no such form.
    """
    if wheel.influence is not None or np.any(wheel.damping.structural):
        raise InputError("influence, damping.structural: expected neither in a wheel as one body")
    shapes, omega, viscous = _real_modes(wheel)
    rows = _port_rows(wheel)
    residual = _real_residual(wheel)
    values, V = _mistuned_modes(pattern, omega, shapes, residual, rows["blade"])
    if values.min() < 0:
        raise InputError("pattern: deviations make a blade unstable, expected smaller ones")
    C = V.T @ viscous @ V
    # Coriolis forces couple the modes of a pair whatever the scatter
    whole = coupled_damping or any(
        body.damping is not None and body.damping.ndim == 2 for body in wheel.sectors.values()
    )
    order = np.concatenate([rows[name] for name in ("contact", "load", "probe")])
    ends = np.cumsum([0] + [len(rows[name]) for name in ("contact", "load", "probe")])
    ports = {
        name: slice(int(a), int(b))
        for name, a, b in zip(("contact", "load", "probe"), ends[:-1], ends[1:], strict=True)
    }
    body = PortModel(
        np.sqrt(values),
        shapes[order] @ V,
        residual[np.ix_(order, order)],
        ports,
        damping=C if whole else np.diag(C).copy(),
    )
    return ReducedModel(
        (body,),
        pattern_elements(wheel, pattern),
        {h: np.asarray(f).ravel() for h, f in wheel.excitation.items()},
        Damping(),
        _all_dampers(wheel, pattern),
        wheel.damper_damping,
        coupled=wheel.coupled,
        start=pattern.start,
    )


def _all_dampers(wheel: Wheel, pattern: Pattern) -> RigidBody | tuple[PortModel, ...] | None:
    factors = np.ones(wheel.count)
    if pattern.damper_mass is not None:
        factors = factors + pattern.damper_mass
    if isinstance(wheel.damper, RigidBody):
        mass = np.asarray(np.kron(np.diag(factors), wheel.damper.mass), float)
        B = np.asarray(np.kron(np.eye(wheel.count), wheel.damper.B), float)
        turning = wheel.damper.gyroscopic
        gyroscopic = None if turning is None else np.asarray(np.kron(np.diag(factors), turning))
        return RigidBody(mass, B, gyroscopic=gyroscopic)
    dampers = [heavier_damper(wheel.damper, factor) for factor in factors]
    bodies = tuple(one for one in dampers if isinstance(one, PortModel))
    return (join_bodies(bodies),) if bodies else None


def _port_rows(wheel: Wheel) -> dict[str, np.ndarray]:
    """Rows of each port in arrays that hold all ports of sector 0, then of sector 1, ..."""
    body = wheel.sectors[0]
    size = len(body.residual)
    sectors = size * np.arange(wheel.count)[:, None]
    everything = np.arange(size)
    return {
        name: (sectors + everything[body.ports.get(name, slice(0, 0))]).ravel()
        for name in PORT_GROUPS
    }


def _real_modes(wheel: Wheel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shapes (N P, N k), circular frequencies (N k,) and damping (N k, N k) of the tuned wheel,
    real.
    """
    count = wheel.count
    columns = []
    omega = []
    viscous = []
    for d, body in wheel.sectors.items():
        turn = np.exp(2j * np.pi * d * np.arange(count) / count)
        wave = (turn[:, None, None] * body.shapes).reshape(-1, len(body.omega)) / np.sqrt(count)
        single = 2 * d % count == 0
        parts = [wave.real] if single else [np.sqrt(2) * wave.real, np.sqrt(2) * wave.imag]
        damping = np.diag(np.broadcast_to(wheel.damping.viscous(body.omega), body.omega.shape))
        if body.damping is not None:
            damping = damping + (np.diag(body.damping) if body.damping.ndim == 1 else body.damping)
        columns += parts
        omega += [body.omega] * len(parts)
        viscous.append(damping.real if single else real_form(damping))
    return np.hstack(columns), np.concatenate(omega), linalg.block_diag(*viscous)


def _real_residual(wheel: Wheel) -> np.ndarray:
    """(N P, N P) residual flexibility of all sectors."""
    count = wheel.count
    half = np.array([wheel.sectors[d].residual for d in range(count // 2 + 1)])
    blocks = np.concatenate([half, half[count - len(half) : 0 : -1].conj()])
    by_distance = np.fft.ifft(blocks, axis=0).real
    sectors = np.arange(count)
    full = by_distance[(sectors[:, None] - sectors) % count]
    return full.transpose(0, 2, 1, 3).reshape(count * half.shape[1], -1)


def _mistuned_modes(
    pattern: Pattern,
    omega: np.ndarray,
    shapes: np.ndarray,
    residual: np.ndarray,
    rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and vectors of the mistuned wheel in its tuned modes."""
    K = np.diag(omega**2)
    M = np.eye(len(omega))
    if pattern.stiffness is None and pattern.mass is None:
        return omega**2, M
    readings = shapes[rows]
    static = (readings[:, omega > 0] / omega[omega > 0] ** 2) @ readings[:, omega > 0].T
    if abs(residual[np.ix_(rows, rows)]).max() > NEGLIGIBLE_FLEXIBILITY_SHARE * abs(static).max():
        raise InputError("pattern: expected all modes of the blade readings in a wheel as one body")
    for matrix, change in ((K, pattern.stiffness), (M, pattern.mass)):
        if change is not None:
            matrix += readings.T @ linalg.block_diag(*change) @ readings
    return linalg.eigh(K, M)

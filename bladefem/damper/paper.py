"""The paper's loop (Fig. 14): blade by harmonic balance, damper by time integration, in turns.

The damper sees the motion u of the platforms and answers with forces f(u), its own motion included.
The loop replaces them by an equivalent stiffness and damping, f = (K_ad + i h w C_ad) u, balances
the blade again and so defines the map u' = g(u) of Eq. 33, whose fixed point ``accelerate.iterate``
looks for. Two things are wrong with that map near zeros of u: where a node hardly moves the
quotient f / u blows up and pins the node (a spurious fixed point), and one averaged K_ad cannot
serve several harmonics (measured on F05-F10 of the tests). The additive equation

    r(u) = u - u_free + G f(u) = 0

has neither fault; every result carries its residual, evaluated with the periodic motion of the
damper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from bladefem.data import RigidBody
from bladefem.errors import InputError
from bladefem.hbm.linear.bodies import port_receptance
from bladefem.hbm.model import ReducedModel, require_rigid_damper

from ..friction.equivalent_linear import from_harmonics, matrices_by_harmonic
from ..friction.fourier import to_real
from ..time.event_integrator import State
from ..time.shooting import periodic_solution
from ..time.system import damper_on_platforms
from .explicit import damper_cycle, stable_steps


@dataclass(frozen=True)
class PlatformSide:
    """The blade side at one frequency, harmonics 1..H, n contact dofs, r independent platform
    motions.
    """

    model: ReducedModel
    # [rad/s]
    omega: float
    # (H, n, n) displacement at the contact by unit forces on it [m/N]
    G: np.ndarray
    # (H, n) displacement without contact forces [m]
    free: np.ndarray
    # (H, n, r) all displacements from the independent ones [1]
    T: np.ndarray
    # (r,) contact dofs that carry the independent motions
    rows: np.ndarray


@dataclass(frozen=True)
class DamperResponse:
    """Forces of the damper on moving platforms."""

    # (H, n) harmonics 1..H of the friction force on the damper [N]
    force: np.ndarray
    # to start the next evaluation from
    start: State
    # change over the last period, relative [1]
    residual: float
    # integrated
    periods: int
    # "periodic", or why not
    reason: str


def platform(
    model: ReducedModel,
    omega: float,
    harmonics: int,
) -> PlatformSide:
    """Flexibility and free motion of the platforms.

    Raises:
        InputError: the model is not one of tangential elements with one direction and a rigid
            damper of one freedom.
    """
    damper = model.damper
    if not (model.tangential and model.elements.tangents == 1):
        raise InputError(
            "model.elements: the paper's loop expects tangential elements with one direction"
        )
    if not (
        isinstance(damper, RigidBody) and damper.mass.shape == (1, 1) and np.ptp(damper.B) == 0
    ):
        raise InputError(
            "model.damper: the paper's loop expects a rigid damper with one tangential freedom"
        )
    G = []
    free = []
    for h in range(1, harmonics + 1):
        side = model.side(h)
        rows = np.arange(len(side.residual))[side.ports["contact"]]
        G.append(port_receptance(side, model.damping, h * omega, rows, rows))
        load = model.excitation.get(
            h, np.zeros(len(np.arange(len(side.residual))[side.ports["load"]]))
        )
        free.append(
            port_receptance(side, model.damping, h * omega, rows, side.ports["load"]) @ load
        )
    rows = _independent_rows(np.column_stack([*G, *[f[:, None] for f in free]]))
    T = [np.linalg.lstsq(g[rows].T, g.T, rcond=1e-10)[0].T for g in G]
    return PlatformSide(
        model, omega, np.array(G, complex), np.array(free, complex), np.array(T), rows
    )


def damper_response(
    side: PlatformSide,
    u: np.ndarray,
    how: str = "shooting",
    steps: int = 512,
) -> DamperResponse:
    """Forces of the damper on platforms that move with harmonics u (H, n).

    Args:
        how: "march" for explicit time integration from rest (the paper's), "shooting" for the exact
            periodic motion.
        steps: time steps a period of the march.
    """
    model = side.model
    motion = np.concatenate([np.zeros((1, u.shape[1])), u]).T
    damper = require_rigid_damper(model)
    scale = float(damper.B[0, 0]) or 1.0
    system = damper_on_platforms(motion, model.elements, float(damper.mass[0, 0]) / scale**2)
    H = len(u)
    if how == "march":
        steps = max(steps, stable_steps(system, side.omega), 4 * H)
        cycle = damper_cycle(system, side.omega, steps)
        return DamperResponse(
            _harmonic_lines(cycle.force, H),
            cycle.state,
            cycle.residual,
            cycle.periods,
            cycle.reason,
        )
    if how != "shooting":
        raise InputError(f"how = '{how}': expected 'march' or 'shooting'")
    solution = periodic_solution(system, side.omega, samples=max(256, 16 * H))
    return DamperResponse(
        _harmonic_lines(solution.trajectory.force, H),
        solution.start,
        solution.residual,
        solution.periods,
        solution.reason,
    )


def equivalent(
    force: np.ndarray,
    u: np.ndarray,
    omega: float,
    averaged: bool = True,
) -> np.ndarray:
    """Complex stiffness (H, n) with force = stiffness * u in the best sense [N/m].

    Averaged: K_ad + i h w C_ad of Eq. 16, with the factor k that is missing in the printed C.
    Otherwise each harmonic gets its own quotient. Nodes that do not move get zero.
    """
    mean = np.zeros((1, u.shape[1]))
    u, force = (to_real(np.vstack([mean, x]).T) for x in (u, force))
    fit = (from_harmonics if averaged else matrices_by_harmonic)(u, force, omega)
    h = np.arange(1, u.shape[1] // 2 + 1)[:, None]
    return np.nan_to_num(fit.stiffness.T + 1j * h * omega * fit.damping.T)


def balance(side: PlatformSide, stiffness: np.ndarray) -> np.ndarray:
    """Platform motion (H, n) with the equivalent stiffness (H, n) on the contact dofs [m]."""
    n = side.free.shape[1]
    return np.array(
        [
            np.linalg.solve(np.eye(n) + G * z, free)
            for G, z, free in zip(side.G, stiffness, side.free, strict=True)
        ]
    )


def residual(
    side: PlatformSide,
    u: np.ndarray,
    force: np.ndarray,
) -> np.ndarray:
    """u - u_free + G f, (H, n) [m]: zero in equilibrium, whatever the loop thinks."""
    return u - side.free + np.einsum("hij,hj->hi", side.G, force)


def _harmonic_lines(signal: np.ndarray, H: int) -> np.ndarray:
    return 2 * np.fft.rfft(signal, axis=0)[1 : H + 1] / len(signal)


def _independent_rows(columns: np.ndarray) -> np.ndarray:
    """Rows whose motion fixes that of all others: pivots of a rank-revealing factorisation."""
    _, R, pivots = linalg.qr(columns.conj().T, pivoting=True, mode="economic")
    size = np.abs(np.diag(R))
    return np.sort(pivots[: int(np.count_nonzero(size > 1e-9 * size[0]))])

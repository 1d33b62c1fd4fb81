"""The mistuned wheel at one frequency, contacts closed: the tuned wheel by nodal diameters, and
the deviations of the blades eliminated exactly.

With y the readings of all blades, tuned y = y0 - A_yy z, and the forces of the deviations z = E y,
    (1 + E A_yy) z = E y0:
one small system of all blades a harmonic, factorised once a frequency. A_yy is block-circulant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..errors import NotSolvedError
from .by_diameter import (
    DiameterParts,
    damper_gyroscopic,
    diameter_parts,
    modal_flexibility,
    modal_impedance,
    tuned_product,
)
from .model import Pattern, Wheel


@dataclass(frozen=True)
class WheelFlexibility:
    """Motions of the wheel by forces at one frequency; N sectors, H harmonics, k modes a sector."""

    omega: float
    parts: DiameterParts
    # (N, H+1, k, k) inverse of the modal impedance of the bodies
    T: np.ndarray
    # (H+1, N, q, q) dynamic stiffness of the deviations, and LU factors of 1 + E A_yy in the
    # readings that deviate, None of a mean that takes no part; empty: tuned
    E: np.ndarray
    factors: tuple[tuple[np.ndarray, np.ndarray] | None, ...]
    # (N q,) true where a reading deviates in some harmonic
    active: np.ndarray
    # readings of blades and dampers that the deviations act on
    deviating: slice
    # whether the mean takes part in the balance
    coupled: bool

    def contact_motion(self, force: np.ndarray) -> np.ndarray:
        """(N, m, H+1) relative displacements by forces (N, m, H+1) at the contacts [m]."""
        return self.motion(force, self.parts.contact, self.parts.contact)

    def motion(
        self,
        force: np.ndarray,
        rows: slice,
        columns: slice,
    ) -> np.ndarray:
        """(N, rows, H+1) motions at some ports by forces (N, columns, H+1) at others [m]."""
        parts = self.parts
        f = to_diameters(force)
        out = tuned_product(parts, self.T, f, rows, columns)
        if len(self.factors):
            read = tuned_product(parts, self.T, f, self.deviating, columns)
            y = from_diameters(parts.partition.join_diameters(read))
            z = to_diameters(self.deviation_forces(y))
            out -= tuned_product(parts, self.T, z, rows, self.deviating)
        out = parts.partition.join_diameters(out)
        if not self.coupled:
            out[:, :, 0] = 0.0
        return from_diameters(out)

    def deviation_forces(self, y: np.ndarray) -> np.ndarray:
        """(N, q, H+1) forces of the deviations for tuned readings y (N, q, H+1)."""
        z = np.zeros_like(y)
        for h, factors in enumerate(self.factors):
            if factors is None:
                continue
            right = (self.E[h] @ y[:, :, h, None]).ravel()
            solved = np.zeros_like(right)
            solved[self.active] = linalg.lu_solve(factors, right[self.active], check_finite=False)
            z[:, :, h] = solved.reshape(y.shape[:2])
        return z


def wheel_flexibility(
    wheel: Wheel,
    omega: float,
    harmonics: int,
    pattern: Pattern,
) -> WheelFlexibility:
    """Flexibility of harmonics 0..H at circular frequency omega [rad/s].

    Raises:
        NotSolvedError: a resonance without damping is hit exactly.
    """
    parts = diameter_parts(wheel)
    key = ("tuned", omega, harmonics)
    # patterns of many wheels meet at the same frequencies
    if wheel.kept.get("last", (None,))[0] != key:
        Z = modal_impedance(parts, omega, harmonics)
        wheel.kept["last"] = (key, modal_flexibility(parts, Z), {})
    _, T, shared = wheel.kept["last"]
    E = np.zeros((0, 0, 0, 0))
    factors: tuple[tuple[np.ndarray, np.ndarray] | None, ...] = ()
    active = np.zeros(0, dtype=bool)
    dampers = pattern.heavier_dampers
    deviating = parts.deviating(dampers)
    if not pattern.tuned:
        if dampers not in shared:
            shared[dampers] = [
                _reading_matrix(parts, T, h, deviating) if h > 0 or wheel.coupled else None
                for h in range(harmonics + 1)
            ]
        readings = parts.blade.stop - parts.blade.start
        damper = damper_gyroscopic(wheel) if dampers else np.zeros((0, 0))
        E = np.array([pattern.change(h * omega, readings, damper) for h in range(harmonics + 1)])
        # one blade of another shape has many readings, the others none or few
        active = E.any(axis=(0, 3)).ravel()
        factors = tuple(
            None if A is None else _factorise_blocks(A, E[h], active)
            for h, A in enumerate(shared[dampers])
        )
    return WheelFlexibility(omega, parts, T, E, factors, active, deviating, wheel.coupled)


def to_diameters(x: np.ndarray) -> np.ndarray:
    """Amplitudes of the sectors (N, ...) as nodal diameters (N, ...)."""
    return np.fft.fft(x, axis=0)


def from_diameters(x: np.ndarray) -> np.ndarray:
    """Nodal diameters (N, ...) as amplitudes of the sectors (N, ...)."""
    return np.fft.ifft(x, axis=0)


def _reading_matrix(
    parts: DiameterParts,
    T: np.ndarray,
    h: int,
    rows: slice,
) -> np.ndarray:
    """(N q, N q) flexibility among the readings of all sectors, tuned."""
    count = len(T)
    U = parts.U[:, rows]
    blocks = U @ T[:, h] @ U.conj().swapaxes(1, 2)
    half = parts.partition.join(parts.A[:, rows, rows])
    blocks += np.concatenate([half, half[count - len(half) : 0 : -1].conj()])
    by_distance = np.fft.ifft(blocks, axis=0)
    sectors = np.arange(count)
    q = blocks.shape[1]
    full = by_distance[(sectors[:, None] - sectors) % count]
    return full.transpose(0, 2, 1, 3).reshape(count * q, count * q)


def _factorise_blocks(
    A: np.ndarray, E: np.ndarray, active: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """LU factors of 1 + E A for E (N, q, q), in the readings (N q,) in which E is not zero."""
    count, q = E.shape[:2]
    own = np.ascontiguousarray(A[:, active]).reshape(count, q, -1)
    system = np.asfortranarray((E @ own).reshape(count * q, -1)[active])
    system[np.diag_indices_from(system)] += 1.0
    factors = linalg.lu_factor(system, overwrite_a=True, check_finite=False)
    if not abs(np.diag(factors[0])).min() > 0:
        raise NotSolvedError("a resonance of the mistuned wheel without damping is hit exactly")
    return factors

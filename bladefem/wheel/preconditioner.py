"""Preconditioner of the Newton steps of a wheel: the modes' part of 1 + A C, harmonic by harmonic.

About a travelling wave the derivative of a tuned wheel falls into nodal diameters; off it, C
averaged over the sectors keeps it so, (T^-1 + U^H C U)^-1 of a few modes for each diameter and
harmonic. In harmonics where blades resonate sectors differ too much for an average: there all
diameters are coupled by the C of each sector and by the deviations of the blades, in one dense
matrix of the modes that the springs of the contacts can move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..friction.fourier import to_complex, to_real
from .by_diameter import modal_forces, modal_motion
from .flexibility import WheelFlexibility, from_diameters, to_diameters

# |T N| from which a harmonic is dynamically amplified, and couples all diameters; the mean does
# always, since dampers that slip throughout have nearly no stiffness in it
AMPLIFIED_HARMONIC_LIMIT = 3.0
# |T N| below which a mode is left out of the dense matrix
NEGLIGIBLE_MODE_LIMIT = 1e-2
# unknowns of the dense matrix: 2 s of factorisation
MAX_DENSE_UNKNOWNS = 2500


@dataclass(frozen=True)
class Preconditioner:
    """Approximate inverse of 1 + A C for one derivative C of the contact forces."""

    flex: WheelFlexibility
    # (H+1, N n, d, d) complex part of C that keeps to its harmonic
    C: np.ndarray
    # (N, H+1, k, k) in nodal diameters
    by_diameter: np.ndarray
    # harmonic to the modes that take part, and LU factors of all diameters
    dense: dict[int, tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]]

    def apply(self, r: np.ndarray) -> np.ndarray:
        """The approximate inverse times real coefficients r (N, m, K)."""
        parts = self.flex.parts
        amplitudes = to_complex(r)
        partition = parts.partition
        push = modal_forces(parts, to_diameters(self.forces(amplitudes)), parts.contact)
        push = partition.join_diameters(push)
        modal = (self.by_diameter @ push.swapaxes(1, 2)[..., None])[..., 0].swapaxes(1, 2)
        for h, (kept, factors) in self.dense.items():
            found = linalg.lu_solve(factors, push[:, kept, h].ravel(), check_finite=False)
            modal[:, :, h] = 0.0
            modal[:, kept, h] = found.reshape(len(push), -1)
        moved = modal_motion(parts, partition.own(modal), parts.contact)
        return r - to_real(from_diameters(partition.join_diameters(moved)))

    def forces(self, amplitudes: np.ndarray) -> np.ndarray:
        """(N, m, H+1) forces of C by displacements (N, m, H+1)."""
        count, m, harmonics = amplitudes.shape
        d = self.C.shape[2]
        x = amplitudes.reshape(-1, d, harmonics).transpose(2, 0, 1)
        out = (self.C @ x[..., None])[..., 0]
        return out.transpose(1, 2, 0).reshape(count, m, harmonics)


def make_preconditioner(flex: WheelFlexibility, change: np.ndarray) -> Preconditioner:
    """The preconditioner for derivatives change (own n, dK, dK) of the contact forces of this
    rank's sectors.
    """
    harmonics = flex.T.shape[1]
    count = len(flex.T)
    parts = flex.parts
    partition = parts.partition
    C = partition.join(_harmonic_part(change, harmonics), axis=1)
    U = partition.own(parts.U[:, parts.contact])
    by_diameter = np.zeros_like(flex.T)
    dense = {}
    for h in range(harmonics):
        amplified = abs(np.einsum("nii,nii->ni", flex.T[:, h], parts.N))
        kept = np.flatnonzero(amplified.max(axis=0) > NEGLIGIBLE_MODE_LIMIT)
        coupled = h == 0 or amplified.max() > AMPLIFIED_HARMONIC_LIMIT
        if coupled and 0 < count * len(kept) <= MAX_DENSE_UNKNOWNS:
            dense[h] = (kept, _dense_factors(flex, C[h].reshape(count, -1, *C.shape[2:]), h, kept))
            continue
        mean = C[h].reshape(count, -1, *C.shape[2:]).mean(axis=0)
        moved = (mean @ U.reshape(len(U), *mean.shape[:2], U.shape[2])).reshape(U.shape)
        stiff = U.conj().swapaxes(1, 2) @ moved
        T = partition.own(flex.T[:, h])
        by_diameter[:, h] = partition.join_diameters(
            T @ np.linalg.inv(np.eye(T.shape[1]) + stiff @ T)
        )
    return Preconditioner(flex, C, by_diameter, dense)


def _harmonic_part(change: np.ndarray, harmonics: int) -> np.ndarray:
    """(H+1, nodes, d, d) complex maps of each harmonic to itself: the part of a real map of cosines
    and sines that commutes with a shift of phase.
    """
    nodes, size = change.shape[:2]
    K = 2 * harmonics - 1
    d = size // K
    split = change.reshape(nodes, d, K, d, K)
    C = np.empty((harmonics, nodes, d, d), dtype=complex)
    C[0] = split[:, :, 0, :, 0]
    for h in range(1, harmonics):
        c = 2 * h - 1
        s = 2 * h
        C[h] = (split[:, :, c, :, c] + split[:, :, s, :, s]) / 2
        C[h] += 0.5j * (split[:, :, c, :, s] - split[:, :, s, :, c])
    return C


def _dense_factors(
    flex: WheelFlexibility,
    C: np.ndarray,
    h: int,
    kept: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """LU factors (N k', N k') of T^-1 + U^H C U + U_b^H E U_b over all nodal diameters."""
    parts = flex.parts
    count = len(C)
    k = len(kept)
    U = parts.U[:, parts.contact][:, :, kept]
    turned = U.conj().swapaxes(1, 2)
    shifts = range(count)[parts.partition.sectors]
    spectrum = np.fft.fft(C, axis=0) / count
    readings = parts.U[:, flex.deviating][:, :, kept]
    deviations = np.fft.fft(flex.E[h], axis=0) / count if len(flex.factors) else None
    blocks = np.empty((len(shifts), count, k, k), dtype=complex)
    diameters = np.arange(count)
    tuned = np.linalg.pinv(flex.T[:, h][:, kept[:, None], kept])
    for i, shift in enumerate(shifts):
        moved = (spectrum[shift] @ U.reshape(count, -1, C.shape[2], k)).reshape(U.shape)
        to = (diameters + shift) % count
        block = turned[to] @ moved
        if deviations is not None:
            block += readings[to].conj().swapaxes(1, 2) @ deviations[shift] @ readings
        if shift == 0:
            block += tuned
        blocks[i] = block
    system = np.empty((count, k, count, k), dtype=complex)
    for shift, block in enumerate(parts.partition.join(blocks)):
        system[(diameters + shift) % count, :, diameters] = block
    return linalg.lu_factor(
        system.reshape(count * k, count * k), overwrite_a=True, check_finite=False
    )

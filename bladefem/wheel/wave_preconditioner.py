"""Preconditioner of the Newton steps of a wheel that an engine order excites: the modes' part of
1 + A C with all harmonics coupled, sector by sector averaged in the frame of the travelling wave.

Slipping contacts couple all harmonics of a sector; where the engine order's multiples meet lightly
damped modes that coupling decides, and a preconditioner that takes one harmonic after the other
leaves GMRES nothing to converge on. In the frame of the wave, in which blade s is ahead by s times
the phase between neighbours, all blades of a tuned wheel do the same: C averaged there over the
sectors couples harmonic h of diameter d + h EO with all others of the same d, and falls into N
matrices of (2H+1) k unknowns. Mistuning is left to GMRES.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..friction.fourier import to_complex, to_real
from .by_diameter import modal_forces, modal_motion, ring_product
from .flexibility import WheelFlexibility, from_diameters, to_diameters

# unknowns of one matrix of all contacts, with which residual flexibility counts too
MAX_CONTACT_UNKNOWNS = 500
# unknowns of one matrix of modes: a second of factorisation for the diameters of a large wheel
MAX_WAVE_UNKNOWNS = 900


@dataclass(frozen=True)
class WavePreconditioner:
    """Approximate inverse of 1 + A C for one derivative C of the contact forces."""

    flex: WheelFlexibility
    # (own n, dK, dK) C at the dampers of this rank's sectors [N/m]
    change: np.ndarray
    # of the engine order: diameter of harmonic h in wave d is d + h order
    order: int
    # LU factors ((2H+1) k, (2H+1) k) of 1 + U^H C U T of this rank's waves among 0..N/2, or
    # ((2H+1) m, (2H+1) m) of 1 + A C
    factors: list[tuple[np.ndarray, np.ndarray]]
    # 1 + A C
    of_contacts: bool

    def apply(self, r: np.ndarray) -> np.ndarray:
        """The approximate inverse times real coefficients r (N, m, K)."""
        flex = self.flex
        parts = flex.parts
        partition = parts.partition
        if self.of_contacts:
            return to_real(from_diameters(self._solved(to_diameters(to_complex(r)))))
        own = r[partition.sectors].reshape(*self.change.shape[:2], 1)
        forces = partition.join((self.change @ own).reshape(-1, *r.shape[1:]))
        push = modal_forces(parts, to_diameters(to_complex(forces)), parts.contact)
        found = self._solved(partition.join_diameters(push))
        modal = ring_product(partition.own(flex.T), partition.own(found))
        moved = partition.join_diameters(modal_motion(parts, modal, parts.contact))
        return r - to_real(from_diameters(moved))

    def _solved(self, push: np.ndarray) -> np.ndarray:
        """(N, k, H+1) by diameters that the waves make of push (N, k, H+1)."""
        partition = self.flex.parts.partition
        count, _, harmonics = push.shape
        waves = _to_waves(push, self.order)
        forward = np.empty((len(self.factors), *waves.shape[1:]), dtype=complex)
        own = range(count)[partition.half]
        for i, (d, factors) in enumerate(zip(own, self.factors, strict=True)):
            solved = linalg.lu_solve(factors, waves[d].ravel(), check_finite=False)
            forward[i] = solved.reshape(waves.shape[1:])
        # wave -d is the conjugate of wave d, harmonic -h of harmonic h
        backward = forward[partition.paired][::-1, ::-1].conj()
        joined = partition.join_diameters(np.concatenate([forward, backward]))
        return _from_waves(joined, self.order, harmonics)


def make_wave_preconditioner(
    flex: WheelFlexibility,
    change: np.ndarray,
    order: int,
) -> WavePreconditioner | None:
    """The preconditioner for derivatives change (own n, dK, dK) of the contact forces of this
    rank's sectors; None where its matrices would be too large.

    Args:
        order: engine order of harmonic 1, with which all harmonics travel.
    """
    parts = flex.parts
    partition = parts.partition
    count, harmonics, k, _ = flex.T.shape
    K = 2 * harmonics - 1
    if K * k > MAX_WAVE_UNKNOWNS:
        return None
    C = _averaged(flex, change, order, K)
    n, d = C.shape[1], C.shape[3]
    hs = np.arange(K) - (harmonics - 1)
    U = parts.U[:, parts.contact].reshape(count, n, d, k)
    of_contacts = K * n * d <= MAX_CONTACT_UNKNOWNS
    A = _contact_flexibility(flex) if of_contacts else None
    factors = []
    for wave in range(count)[partition.half]:
        diameters = (wave + order * hs) % count
        shapes = U[diameters]
        T = np.where(
            (hs >= 0)[:, None, None],
            flex.T[diameters, abs(hs)],
            flex.T[-diameters % count, abs(hs)].conj(),
        )
        moved = shapes.reshape(K, n * d, k) @ T
        if A is not None:
            system = _contact_system(A[diameters], shapes.reshape(K, n * d, k), moved, C)
            if not flex.coupled:
                middle = slice((K // 2) * n * d, (K // 2 + 1) * n * d)
                system[middle] = np.eye(K * n * d)[middle]
            factors.append(linalg.lu_factor(system, overwrite_a=True, check_finite=False))
            continue
        # (b, n, da, k) forces of all harmonics a by the modes of harmonic b
        forces = C @ moved.reshape(K, n, d, k)
        forces = forces.reshape(K, n, d, K, k).transpose(3, 1, 2, 0, 4).reshape(K, n * d, K * k)
        system = (shapes.reshape(K, n * d, k).conj().swapaxes(1, 2) @ forces).reshape(K * k, K * k)
        system[np.diag_indices_from(system)] += 1.0
        factors.append(linalg.lu_factor(system, overwrite_a=True, check_finite=False))
    return WavePreconditioner(flex, change, order, factors, of_contacts)


def _contact_flexibility(flex: WheelFlexibility) -> np.ndarray:
    """(N, m, m) residual flexibility among the contacts in all diameters."""
    parts = flex.parts
    half = parts.partition.join(parts.A[:, parts.contact, parts.contact])
    return np.concatenate([half, half[len(flex.T) - len(half) : 0 : -1].conj()])


def _contact_system(
    residual: np.ndarray, shapes: np.ndarray, moved: np.ndarray, C: np.ndarray
) -> np.ndarray:
    """((2H+1) m, (2H+1) m) 1 + A C of one wave.

    Args:
        residual: (K, m, m) residual flexibility in the diameter of each harmonic.
        shapes: (K, m, k) U, and moved: U T.
        C: of `_averaged`.
    """
    K, m, _ = residual.shape
    _, n, _, d = C.shape
    A = residual + moved @ shapes.conj().swapaxes(1, 2)
    # (a, m, n, d) flexibility by nodes, times (b, n, d, a, d) of the node
    blocks = C.reshape(K, n, d, K, d)
    product = np.einsum("amni,bniaj->ambnj", A.reshape(K, m, n, d), blocks, optimize=True)
    system = product.reshape(K * m, K * m)
    system[np.diag_indices_from(system)] += 1.0
    return system


def _averaged(
    flex: WheelFlexibility,
    change: np.ndarray,
    order: int,
    K: int,
) -> np.ndarray:
    """(K, n, dK, d) complex C of one damper averaged in the wave's frame: forces of harmonics
    -H..H, by the displacements of each of them.
    """
    partition = flex.parts.partition
    H = K // 2
    sectors = np.arange(partition.count)[partition.sectors]
    d = change.shape[1] // K
    n = len(change) // max(len(sectors), 1)
    split = change.reshape(len(sectors), n, d, K, d, K)
    to, back = two_sided_maps(H)
    hs = np.arange(K) - H
    total = np.zeros((n, d, K, d, K), dtype=complex)
    for sector, own in zip(sectors, split, strict=True):
        turn = np.exp(-2j * np.pi * order * sector * hs / partition.count)
        total += _turned(own, turn, to, back)
    total = partition.join(total[None]).sum(axis=0) / partition.count
    return total.transpose(4, 0, 1, 2, 3).reshape(K, n, d * K, d)


def _turned(own: np.ndarray, turn: np.ndarray, to: np.ndarray, back: np.ndarray) -> np.ndarray:
    """(n, d, K, d, K) complex maps in the wave's frame from real ones of cosines and sines."""
    blocks = own.swapaxes(2, 3)
    found = (turn[:, None] * to) @ blocks @ (back * turn.conj())
    return found.swapaxes(2, 3)


def two_sided_maps(H: int) -> tuple[np.ndarray, np.ndarray]:
    """(2H+1, 2H+1) complex amplitudes of harmonics -H..H from mean, cos 1, sin 1, ..., and the
    inverse.
    """
    to = np.zeros((2 * H + 1, 2 * H + 1), dtype=complex)
    to[H, 0] = 1.0
    for h in range(1, H + 1):
        to[H + h, 2 * h - 1 : 2 * h + 1] = 0.5, -0.5j
        to[H - h, 2 * h - 1 : 2 * h + 1] = 0.5, 0.5j
    return to, np.linalg.inv(to)


def _to_waves(x: np.ndarray, order: int) -> np.ndarray:
    """(N, 2H+1, k) of waves and harmonics -H..H from diameters and harmonics 0..H (N, k, H+1)."""
    count, k, harmonics = x.shape
    out = np.empty((count, 2 * harmonics - 1, k), dtype=complex)
    d = np.arange(count)
    H = harmonics - 1
    out[:, H] = x[:, :, 0]
    for h in range(1, harmonics):
        out[:, H + h] = 0.5 * x[(d + order * h) % count, :, h]
        out[:, H - h] = 0.5 * x[(order * h - d) % count, :, h].conj()
    return out


def _from_waves(waves: np.ndarray, order: int, harmonics: int) -> np.ndarray:
    """(N, k, H+1) of diameters and harmonics 0..H from those of `_to_waves`."""
    count, _, k = waves.shape
    out = np.empty((count, k, harmonics), dtype=complex)
    d = np.arange(count)
    H = harmonics - 1
    out[:, :, 0] = waves[:, H]
    for h in range(1, harmonics):
        out[:, :, h] = 2 * waves[(d - order * h) % count, H + h]
    return out

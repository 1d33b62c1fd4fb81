"""Preconditioner of the Newton steps of a wheel: the modes' part of 1 + A C with all harmonics and
all nodal diameters coupled, for the modes that amplify most.

Where multiples of the engine order meet lightly damped modes, slipping contacts couple harmonics
and blades that are not alike couple nodal diameters, both at once: an average over the sectors or
one harmonic after the other then leaves GMRES hundreds of products. Few modes do that, and theirs
is one dense real matrix, T^-1 + U^H C U + U_b^H E U_b over harmonics 1..H and diameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ..friction.fourier import to_complex, to_real
from ..util.arrays import ComplexArray, IntegerArray, RealArray
from .by_diameter import modal_forces, modal_motion
from .flexibility import WheelFlexibility, from_diameters, to_diameters
from .wave_preconditioner import two_sided_maps

# real unknowns of the matrix: a second of factorisation
MAX_COUPLED_UNKNOWNS = 4000
# |T N| from which a mode takes part in a harmonic
AMPLIFIED_MODE_LIMIT = 1.0
# relative size of shapes at the contacts that are left out of the basis in which C is written
NEGLIGIBLE_SHAPE = 1e-6


@dataclass(frozen=True)
class CoupledPreconditioner:
    """Approximate inverse of 1 + A C for one derivative C of the contact forces; means are held."""

    flex: WheelFlexibility
    # (own n, dK, dK) C at the dampers of this rank's sectors [N/m]
    change: RealArray
    # (p,) harmonics 1..H and modes that take part
    harmonics: IntegerArray
    modes: IntegerArray
    # LU factors (2 N p, 2 N p), by real and imaginary parts of diameters and these pairs
    factors: tuple[RealArray, IntegerArray]

    def apply(self, r: np.ndarray) -> np.ndarray:
        """The approximate inverse times real coefficients r (N, m, K)."""
        parts = self.flex.parts
        partition = parts.partition
        own = r[partition.sectors].reshape(*self.change.shape[:2], 1)
        forces = partition.join((self.change @ own).reshape(-1, *r.shape[1:]))
        push = modal_forces(parts, to_diameters(to_complex(forces)), parts.contact)
        push = partition.join_diameters(push)
        wanted = push[:, self.modes, self.harmonics].ravel()
        right = np.concatenate([wanted.real, wanted.imag])
        real, imaginary = np.split(
            linalg.lu_solve(self.factors, right, check_finite=False), [len(wanted)]
        )
        modal = np.zeros_like(push)
        modal[:, self.modes, self.harmonics] = (real + 1j * imaginary).reshape(len(push), -1)
        moved = modal_motion(parts, partition.own(modal), parts.contact)
        return r - to_real(from_diameters(partition.join_diameters(moved)))


def make_coupled_preconditioner(
    flex: WheelFlexibility, change: np.ndarray
) -> CoupledPreconditioner | None:
    """The preconditioner for derivatives change (own n, dK, dK) of the contact forces of this
    rank's sectors; None where means are free or no mode amplifies.
    """
    harmonics, modes = _amplifying_modes(flex)
    if flex.coupled or not len(modes):
        return None
    same, other = _contact_blocks(flex, change, harmonics, modes)
    _add_bodies(flex, same, harmonics, modes)
    size = same.shape[0] * same.shape[1]
    # same z + other conj(z) in real and imaginary parts
    same, other = same.reshape(size, size), other.reshape(size, size)
    system = np.empty((2 * size, 2 * size), order="F")
    system[:size, :size] = same.real + other.real
    system[:size, size:] = other.imag - same.imag
    system[size:, :size] = same.imag + other.imag
    system[size:, size:] = same.real - other.real
    factors = linalg.lu_factor(system, overwrite_a=True, check_finite=False)
    return CoupledPreconditioner(flex, change, harmonics, modes, factors)


def _amplifying_modes(flex: WheelFlexibility) -> tuple[IntegerArray, IntegerArray]:
    """(p,) harmonics and modes that amplify most, as many as the matrix may have."""
    count = len(flex.T)
    amplified = abs(np.einsum("nhii,nii->nhi", flex.T[:, 1:], flex.parts.N)).max(axis=0)
    most = MAX_COUPLED_UNKNOWNS // (2 * count)
    order = np.argsort(-amplified, axis=None)[:most]
    order = np.sort(order[amplified.ravel()[order] > AMPLIFIED_MODE_LIMIT])
    h, modes = np.unravel_index(order, amplified.shape)
    return h + 1, modes


def _contact_blocks(
    flex: WheelFlexibility, change: np.ndarray, harmonics: np.ndarray, modes: np.ndarray
) -> tuple[ComplexArray, ComplexArray]:
    """(N, p, N, p) U^H C U by the motions of the modes, and by their conjugates."""
    parts = flex.parts
    count = len(flex.T)
    H = flex.T.shape[1] - 1
    U = parts.U[:, parts.contact]
    basis = _shape_basis(U[:, :, np.unique(modes)])
    C = _in_basis(flex, change, basis)
    spectrum = np.fft.fft(C, axis=0) / count
    used, place = np.unique(harmonics, return_inverse=True)
    kept, mode = np.unique(modes, return_inverse=True)
    W = (basis.T @ U)[:, :, kept]
    turned = W.conj().swapaxes(1, 2)
    diameters = np.arange(count)
    blocks = []
    for sign in (1, -1):
        # of motions: harmonic -h of diameter d is the conjugate of harmonic h of diameter -d
        part = spectrum[:, H + used][:, :, H + sign * used]
        block = np.empty((count, len(modes), count, len(modes)), dtype=complex)
        for shift in range(count):
            to = (diameters + shift) % count
            moved = part[shift] @ W[:, None, None]
            found = turned[to][:, None, None] @ moved
            pairs = found[:, place[:, None], place, mode[:, None], mode]
            block[to, :, (sign * diameters) % count] = pairs
        blocks.append(block)
    return blocks[0], blocks[1]


def _shape_basis(U: np.ndarray) -> RealArray:
    """(m, r) orthonormal basis of modes' shapes (N, m, k) at the contacts in all diameters."""
    shapes = U.transpose(1, 0, 2).reshape(U.shape[1], -1)
    sizes = np.maximum(np.linalg.norm(shapes, axis=0), np.finfo(float).tiny)
    both = np.hstack([shapes.real, shapes.imag]) / np.tile(sizes, 2)
    left, values, _ = np.linalg.svd(both, full_matrices=False)
    return left[:, values > NEGLIGIBLE_SHAPE * values[0]]


def _in_basis(flex: WheelFlexibility, change: np.ndarray, basis: np.ndarray) -> ComplexArray:
    """(N, K, K, r, r) C of each damper, forces of harmonics -H..H by the displacements of each."""
    partition = flex.parts.partition
    own = len(range(partition.count)[partition.sectors])
    K = 2 * flex.T.shape[1] - 1
    d = change.shape[1] // K
    n = len(basis) // d
    V = basis.reshape(n, d, -1)
    split = change.reshape(own, n, d, K, d, K)
    half = np.einsum("sndaeb,nej->sndabj", split, V, optimize=True)
    found = partition.join(np.einsum("ndi,sndabj->sabij", V, half, optimize=True))
    to, back = two_sided_maps(K // 2)
    return np.einsum("ap,spqij,qb->sabij", to, found, back, optimize=True)


def _add_bodies(
    flex: WheelFlexibility, same: ComplexArray, harmonics: np.ndarray, modes: np.ndarray
) -> None:
    """Add T^-1 and the deviations of blades and dampers to the blocks (N, p, N, p)."""
    parts = flex.parts
    count = len(flex.T)
    diameters = np.arange(count)
    readings = parts.U[:, flex.deviating]
    for h in np.unique(harmonics):
        own = np.flatnonzero(harmonics == h)
        kept = modes[own]
        rows, columns = own[None, :, None], own[None, None, :]
        d = diameters[:, None, None]
        same[d, rows, d, columns] += np.linalg.pinv(flex.T[:, h][:, kept[:, None], kept])
        if not len(flex.factors):
            continue
        spectrum = np.fft.fft(flex.E[h], axis=0) / count
        read = readings[:, :, kept]
        for shift in range(count):
            to = (diameters + shift) % count
            block = read[to].conj().swapaxes(1, 2) @ spectrum[shift] @ read
            same[to[:, None, None], rows, d, columns] += block

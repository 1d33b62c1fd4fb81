"""The whole displacement field under harmonic loads, from few modes and static solves.

Modes carry what resonates. The remainder is the static one and what its inertia adds,

    u = sum of phi q + r,   (1 - w^2 D) r = r_0,   D = K^-1 M without the modes,

with w^2 D below 1 where all modes up to w are kept. (Modal acceleration and its higher orders:
Camarda, Haftka and Riley 1987, doi:10.1016/0045-7949(87)90002-1.) D is self-adjoint in the products
of M: Lanczos vectors need three terms, and serve a complex w^2 too. The series r_0 + w^2 D r_0 +
..., which spans the same spaces, shrinks by (w / w_m+1)^2 a term when m modes are kept, and takes
up to three times the solves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import ModeSet
from ..errors import NotSolvedError
from .compat import MPI
from .constraint import expand_to_mesh, restrict_load
from .flexibility import Flexibility, compliance, unknown_places
from .linalg import apply_block, column_norms, inner_products, subtract_product

# of the displacement: the last term that is still added
TERM_TOLERANCE = 1e-9
# bounds the Lanczos vectors; a motion that needs more has a mode missing near its frequency
MAX_TERMS = 40


@dataclass(frozen=True)
class ForcedMotion:
    """Displacement fields of harmonic motion, u(t) = Re(u e^{j w t})."""

    # (n_points, dim, k) complex [m]
    displacement: np.ndarray


def forced_motion(
    flex: Flexibility,
    modes: ModeSet,
    loads: np.ndarray,
    omega: np.ndarray,
    damping: np.ndarray,
) -> ForcedMotion:
    """Displacements of a clamped body, or of a sector in one nodal diameter, under several loads.

    Args:
        flex: the body's factorised stiffness, in the nodal diameter of the modes.
        modes: all modes up to some frequency above omega, mass-normalised.
        loads: (n_points*dim, k) complex amplitudes [N].
        omega: (k,) circular frequency of each load [rad/s]; 0 for a static one, negative for the
            conjugate motion, complex for damping in proportion to the mass.
        damping: (m,) viscous damping of the modes kept [1/s], 2 zeta omega_r for a damping ratio;
            (m, m) where it couples them, as Coriolis forces do.

    Raises:
        NotSolvedError: a mode below a frequency is missing.
    """
    con = flex.con
    dim = con.body.dim
    natural = 2 * np.pi * modes.frequencies
    shapes = modes.shapes[:, :, :dim].reshape(len(natural), -1)
    X = np.ascontiguousarray(shapes[:, unknown_places(con)].T[con.own])
    MX = apply_block(con.M, X)
    force = restrict_load(con, np.asarray(loads, dtype=complex))
    motion = _modal_motion(natural, inner_products(con.body.comm, X, force), omega, damping)
    u = np.asfortranarray(X @ motion)
    beyond = _Beyond(flex, np.asfortranarray(X, complex), np.asfortranarray(MX, complex))
    failed = beyond.add_motion(u, force, np.asarray(omega))
    if failed is None:
        return ForcedMotion(expand_to_mesh(con, u))
    raise NotSolvedError(
        f"the motion at {failed / (2 * np.pi):.5g} Hz is not covered by {len(natural)} modes up to "
        f"{natural[-1] / (2 * np.pi):.5g} Hz: expected modes beyond the frequency"
    )


@dataclass(frozen=True)
class _Beyond:
    """What the modes leave of a motion."""

    flex: Flexibility
    # (n_own, m) the modes, and their products by the mass; complex
    X: np.ndarray
    MX: np.ndarray

    def add_motion(self, u: np.ndarray, force: np.ndarray, omega: np.ndarray) -> float | None:
        """Add what the modes leave of the motions under loads (n_own, k) to u (n_own, k).

        In the Lanczos vectors of D from r_0 it is a tridiagonal T; with 1 - w^2 T = L diag(pivots)
        L^T the solution is a sum of terms that each new vector adds to.

        Returns:
            the frequency of a motion that was not found [rad/s]; None where all were.
        """
        comm, M = self.flex.con.body.comm, self.flex.con.M
        vector = self._static(force)
        still = omega == 0
        u[:, still] += vector[:, still]
        image = apply_block(M, vector)
        # of the part of the Lanczos vectors that the next term has
        share = _lengths(comm, vector, image)
        # loads whose motion is not whole yet
        some = np.flatnonzero(~still & (share > 0))
        square, share = omega[some] ** 2, share[some]
        vector, image = vector[:, some] / share, image[:, some] / share
        before = direction = np.zeros_like(vector)
        beside, lower = np.zeros(len(some)), np.zeros(len(some))
        for _ in range(MAX_TERMS):
            if not len(some):
                return None
            moved = self._static(image)
            middle = _products(comm, image, moved)
            direction = vector - lower * direction
            pivot = 1 - square * (middle - lower * beside)
            if (pivot.real <= 0).any():
                return float(abs(omega[some[int(pivot.real.argmin())]]))
            term = share / pivot * direction
            u[:, some] += term
            rest = column_norms(comm, term) > TERM_TOLERANCE * column_norms(comm, u[:, some])
            moved = moved - middle * vector - beside * before
            before, moved, direction = vector[:, rest], moved[:, rest], direction[:, rest]
            some, square = some[rest], square[rest]
            image = apply_block(M, moved)
            beside = _lengths(comm, moved, image)
            lower = -square * beside / pivot[rest]
            share = -lower * share[rest]
            size = np.maximum(beside, np.finfo(float).tiny)
            vector, image = moved / size, image / size
        return float(abs(omega[some[-1]])) if len(some) else None

    def _static(self, force: np.ndarray) -> np.ndarray:
        """(n_own, k) displacements under static loads, without their part in the modes."""
        found = np.asfortranarray(compliance(self.flex, force), complex)
        part = inner_products(self.flex.con.body.comm, self.MX, found)
        return subtract_product(found, [self.X], part)


def _modal_motion(
    natural: np.ndarray,
    force: np.ndarray,
    omega: np.ndarray,
    damping: np.ndarray,
) -> np.ndarray:
    """(m, k) modal amplitudes under modal forces (m, k)."""
    single = natural[:, None] ** 2 - omega**2
    if damping.ndim == 1:
        return force / (single + 1j * omega * damping[:, None])
    impedance = 1j * omega[:, None, None] * damping
    modes = np.arange(len(natural))
    impedance[:, modes, modes] += single.T
    return np.linalg.solve(impedance, force.T[:, :, None])[:, :, 0].T


def _products(comm: MPI.Comm, image: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(k,) real products of columns with images by a Hermitian matrix, over all ranks."""
    found = (image.real * v.real + image.imag * v.imag).sum(axis=0)
    return np.asarray(comm.allreduce(found) if comm.size > 1 else found)


def _lengths(comm: MPI.Comm, v: np.ndarray, image: np.ndarray) -> np.ndarray:
    """(k,) lengths of columns in the products of the mass."""
    return np.sqrt(np.maximum(_products(comm, image, v), 0.0))

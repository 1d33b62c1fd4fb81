"""The whole displacement field under harmonic loads, from few modes and static solves.

Modes carry what resonates. The remainder is static and corrected for its inertia term by term,

    u = sum of phi q + r_0 + w^2 D r_0 + (w^2 D)^2 r_0 + ...,   D = K^-1 M without the modes,

a series that shrinks by (w / w_m+1)^2 a term when m modes are kept, so that it ends at the
full-order solution with modal damping of the modes kept. (Modal acceleration and its higher orders:
Camarda, Haftka and Riley 1987, doi:10.1016/0045-7949(87)90002-1.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import ModeSet
from ..errors import NotSolvedError
from .compat import MPI
from .constraint import expand_to_mesh, restrict_load
from .flexibility import Flexibility, compliance, unknown_places
from .linalg import apply_block, inner_products

# of the displacement: the last term of the series that is still added
SERIES_TOLERANCE = 1e-9
# bounds the terms; a series that needs more has a mode missing below the frequency
SERIES_TERMS = 40


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
            conjugate motion.
        damping: (m,) viscous damping of the modes kept [1/s], 2 zeta omega_r for a damping ratio;
            (m, m) where it couples them, as Coriolis forces do.

    Raises:
        NotSolvedError: the series does not converge: a mode below a frequency is missing.
    """
    con = flex.con
    comm = con.body.comm
    dim = con.body.dim
    natural = 2 * np.pi * modes.frequencies
    shapes = modes.shapes[:, :, :dim].reshape(len(natural), -1)
    X = np.ascontiguousarray(shapes[:, unknown_places(con)].T[con.own])
    MX = apply_block(con.M, X)
    force = restrict_load(con, np.asarray(loads, dtype=complex))

    def without_modes(v: np.ndarray) -> np.ndarray:
        return v - X @ inner_products(comm, MX, v)

    u = X @ _modal_motion(natural, inner_products(comm, X, force), omega, damping)
    term = without_modes(compliance(flex, force))
    size = np.ones(len(omega))
    for count in range(SERIES_TERMS + 1):
        u = u + term
        before = size
        size = _column_norms(comm, term) / np.maximum(_column_norms(comm, u), np.finfo(float).tiny)
        open_ends = (size >= SERIES_TOLERANCE) & (omega != 0)
        if not open_ends.any():
            return ForcedMotion(expand_to_mesh(con, u))
        growing = open_ends & (size > before)
        if count > 2 and growing.any():
            open_ends = growing
            break
        term = omega**2 * without_modes(compliance(flex, apply_block(con.M, term)))
    worst = int(np.argmax(np.where(open_ends, size, 0.0)))
    raise NotSolvedError(
        f"the motion at {abs(omega[worst]) / (2 * np.pi):.5g} Hz is not covered by {len(natural)} "
        f"modes up to {natural[-1] / (2 * np.pi):.5g} Hz (last term {size[worst]:.1e}): expected "
        "modes beyond the frequency"
    )


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


def _column_norms(comm: MPI.Comm, v: np.ndarray) -> np.ndarray:
    """(k,) of the columns over all ranks."""
    return np.sqrt(
        abs(np.array([inner_products(comm, v[:, [i]], v[:, [i]])[0, 0] for i in range(v.shape[1])]))
    )

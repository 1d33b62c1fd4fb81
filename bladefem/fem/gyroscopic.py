"""Coriolis forces in the rotating frame: one mode of the body at rest becomes a forward and a
backward wave.

M q'' + Omega G q' + K(Omega) q = 0, G skew: 2 rho v . (a x u) over the body, a the axis. On the
modes of one nodal diameter, mass-normalised, with g = Phi^H G Phi and the eigenvalues lambda of
K(Omega), a motion z e^{j w t} obeys

    (lambda - w^2 + j w Omega g) z = 0,

Hermitian, so that every w is real (Meirovitch, AIAA J. 12 (1974), doi:10.2514/3.49486). Sector k
carries the factor e^{j k n theta}: w > 0 travels against the count of the sectors, w < 0 with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import ModeSet
from ..errors import InputError
from .body import Body
from .constraint import Constrained, expand_to_mesh
from .linalg import apply_block, inner_products
from .steady_state import AXIS


@dataclass(frozen=True)
class Spin:
    """A steady rotation of the frame in which bodies vibrate."""

    axis: tuple[float, float, float]
    # [rad/s], positive where the sectors are counted in the sense of the rotation
    speed: float


@dataclass(frozen=True)
class Waves:
    """Travelling waves of one nodal diameter in the rotating frame; a standing mode has the same
    frequency in both.
    """

    nodal_diameter: int | None
    # [rad/s]
    speed: float
    # (m,) [Hz], waves that run round faster than the wheel, ascending
    forward: np.ndarray
    # (m,) [Hz], ascending
    backward: np.ndarray


def coupling(
    body: Body,
    modes: ModeSet,
    axis: tuple[float, float, float] = AXIS,
) -> np.ndarray:
    """(m, m) skew-Hermitian g = Phi^H G Phi [1], real where the modes are.

    Args:
        modes: mass-normalised shapes on the nodes of the body's mesh.
    """
    return project_coriolis(body, own_rows(body, modes.shapes), axis)


def constrained_coupling(
    con: Constrained,
    X: np.ndarray,
    axis: tuple[float, float, float] = AXIS,
) -> np.ndarray:
    """(m, m) the same of fields given by this rank's unknowns (n_own, m) of a constrained body."""
    shapes = np.moveaxis(expand_to_mesh(con, X), 2, 0)
    return project_coriolis(con.body, own_rows(con.body, shapes), axis)


def project_coriolis(
    body: Body,
    X: np.ndarray,
    axis: tuple[float, float, float] = AXIS,
) -> np.ndarray:
    """(m, m) X^H G X of this rank's rows (n_own, m), skew-Hermitian.

    The mass of a node is the same in all directions, so that G = 2 M (a x): no matrix of its own.
    """
    g = inner_products(body.comm, X, _coriolis_forces(body, X, axis))
    return (g - g.conj().T) / 2


def coriolis_loads(
    body: Body,
    shapes: np.ndarray,
    axis: tuple[float, float, float] = AXIS,
) -> np.ndarray:
    """(n_points*dim, m) the forces G u of fields (m, n_points, 2 or 3) in mesh numbering, on every
    rank (collective).
    """
    parts = body.comm.allgather(_coriolis_forces(body, own_rows(body, shapes), axis))
    forces = np.concatenate(parts)
    out = np.zeros((len(body.scalar_rows), forces.shape[1]), forces.dtype)
    out[_row_order(body)] = forces
    return out


def _coriolis_forces(
    body: Body,
    X: np.ndarray,
    axis: tuple[float, float, float],
) -> np.ndarray:
    """G X of this rank's rows (n_own, m)."""
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    turn = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])[: body.dim, : body.dim]
    nodal = X.reshape(-1, body.dim, X.shape[1])
    crossed = np.asfortranarray(np.einsum("ij,njm->nim", turn, nodal).reshape(X.shape))
    return 2 * apply_block(body.mass, crossed)


def own_rows(body: Body, shapes: np.ndarray) -> np.ndarray:
    """(rows of this rank, m) of fields (m, n_points, 2 or 3) in mesh numbering, for products with
    the body's matrices.

    Sums over the rows of one sector are sums over its body, both cut faces included.
    """
    first, last = body.K.owner_range
    order = _row_order(body)[first:last]
    return np.asfortranarray(shapes[:, :, : body.dim].reshape(len(shapes), -1)[:, order].T)


def _row_order(body: Body) -> np.ndarray:
    """(rows of all ranks,) degree of freedom in mesh numbering of each row."""
    outside = np.count_nonzero(body.scalar_rows < 0)
    return np.argsort(body.scalar_rows, kind="stable")[outside:]


def waves(
    modes: ModeSet,
    g: np.ndarray,
    speed: float,
    sense: int = 1,
) -> Waves:
    """Forward and backward waves made of the modes of one nodal diameter.

    Args:
        modes: of the body with its stiffness at this speed.
        g: their Coriolis coupling, :func:`coupling`.
        speed: [rad/s], about the axis of ``g``.
        sense: +1 where the sectors are counted in the sense of the rotation, else -1.

    Raises:
        InputError: the coupling does not fit the modes.
    """
    m = len(modes.frequencies)
    if g.shape != (m, m):
        raise InputError(f"Coriolis coupling of shape {g.shape}, expected ({m}, {m}) for {m} modes")
    root = np.diag(2 * np.pi * modes.frequencies)
    # ascending: the first half is negative
    w = np.linalg.eigvalsh(np.block([[np.zeros((m, m)), root], [root, 1j * speed * g]]))
    turned = [np.sort(abs(part)) / (2 * np.pi) for part in (w[:m], w[m:])]
    forward, backward = turned if sense > 0 else turned[::-1]
    return Waves(modes.nodal_diameter, speed, forward, backward)

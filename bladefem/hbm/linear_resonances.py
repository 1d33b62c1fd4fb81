"""Natural frequencies of the two linear limits: where a frequency sweep has to look."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from ..data import RigidBody
from .linear.woodbury import bodies_of
from .model import ReducedModel

# circular frequencies below this share of the highest are those of rigid modes
RIGID_SHARE = 1e-9


def free_resonances(model: ReducedModel, h: int = 1) -> np.ndarray:
    """(m,) circular frequencies omega at which harmonic h meets a mode of the blades without
    contact [rad/s].
    """
    side = model.side(h)
    omega = side.omega
    if side.damping is not None and side.damping.ndim == 2:
        omega = wave_frequencies(omega, side.damping)
    return omega[omega > 0] / h


def wave_frequencies(omega: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """(m,) circular frequencies [rad/s] of the waves e^{j w t}, w > 0, that modes become under
    Coriolis forces, ascending; 0 of rigid modes.

    Args:
        omega: (m,) without Coriolis forces [rad/s].
        damping: (m, m) modal damping, of which the skew-Hermitian part acts here [1/s].
    """
    return _gyroscopic_modes(omega, damping)[0]


def _gyroscopic_modes(omega: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (m,) as `wave_frequencies`, and the waves (m, m) in the modes, columns of
    length 1.

    (L - w^2 + j w S) z = 0, S skew-Hermitian, is Hermitian in (root(L) z / w, z): all w are real.
    """
    m = len(omega)
    skew = (damping - damping.conj().T) / 2
    root = np.diag(omega)
    w, vectors = np.linalg.eigh(np.block([[np.zeros((m, m)), root], [root, 1j * skew]]))
    upper = vectors[m:, m:]
    size = np.maximum(np.linalg.norm(upper, axis=0), np.finfo(float).tiny)
    # a mode without frequency or coupling comes as a pair about zero
    found = np.where(w[m:] > RIGID_SHARE * w[-1], w[m:], 0.0)
    return found, upper / size


def stuck_resonances(model: ReducedModel, h: int = 1) -> np.ndarray:
    """(m,) circular frequencies omega at which harmonic h meets a mode with all contacts sticking
    [rad/s].
    """
    return stuck_modes(model, h)[0].copy()


def stuck_partners(model: ReducedModel) -> np.ndarray:
    """(m,) circular frequency of the stuck mode that has most of each free mode in it, by kinetic
    energy [rad/s].

    It need not be the one of the same number: on soft contacts a damper has modes of its own below
    the blade's.
    """
    omega, shapes = stuck_modes(model)
    blade = model.side(1).omega
    return omega[np.argmax(np.abs(shapes[: len(blade)][blade > 0]), axis=1)]


def stuck_modes(model: ReducedModel, h: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Circular frequencies (m,) omega at which harmonic h meets a mode with all contacts sticking
    [rad/s], and shapes (n, m) of mass 1, the blade's modes first, then the damper's.

    Each sweep, its band and the search of a peak ask for them: they are made once.
    """
    return model.once(("stuck modes", h), lambda: _stuck_modes(model, h))


def _stuck_modes(model: ReducedModel, h: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (m,) [rad/s] and shapes (n, m) of mass 1, the blade's modes first, with all
    contacts sticking.

    The springs are in series with the residual flexibility, so that the modes see (K^-1 + R)^-1.
    """
    side = model.side(h)
    rows = np.arange(len(side.residual))[side.ports["contact"]][model.rows]
    shapes = [side.shapes[rows]]
    stiffness: list[np.ndarray] = [side.omega**2]
    flexibility = side.residual[np.ix_(rows, rows)]
    masses: list[np.ndarray] = [np.eye(len(side.omega))]
    viscous: list[np.ndarray | None] = [side.damping]
    if isinstance(model.damper, RigidBody):
        shapes.append(-model.damper.B[model.rows])
        stiffness.append(np.zeros(len(model.damper.mass)))
        masses.append(model.damper.mass)
        viscous.append(model.damper.gyroscopic)
    elif model.damper is not None:
        damper = model.damper[h if len(model.damper) > 1 else 0]
        rows = np.arange(len(damper.residual))[damper.ports["contact"]][model.rows]
        shapes.append(-damper.shapes[rows])
        stiffness.append(damper.omega**2)
        masses.append(np.eye(len(damper.omega)))
        viscous.append(damper.damping)
        flexibility = flexibility + damper.residual[np.ix_(rows, rows)]
    springs = model.springs.ravel()
    closed = np.flatnonzero(springs > 0)
    contact = np.linalg.inv(np.diag(1 / springs[closed]) + flexibility[np.ix_(closed, closed)])
    relative = np.column_stack(shapes)[closed]
    K = np.diag(np.concatenate(stiffness)) + relative.conj().T @ contact @ relative
    values, shapes = linalg.eigh((K + K.conj().T) / 2, linalg.block_diag(*masses))
    elastic = values > 1e-9 * values[-1]
    omega = np.sqrt(values[elastic])
    shapes = shapes[:, elastic]
    if any(part is not None and part.ndim == 2 for part in viscous):
        coupling = _joined_coupling(viscous, [len(mass) for mass in masses])
        omega, waves = _gyroscopic_modes(omega, shapes.conj().T @ coupling @ shapes)
        shapes = shapes @ waves
    return omega / h, shapes


def stuck_motion(model: ReducedModel, shapes: np.ndarray, h: int = 1) -> np.ndarray:
    """(nodes, directions, k) displacements of the contact springs in stuck modes (n, k) [m], the
    residual flexibilities in series.
    """
    blades, *dampers = bodies_of(model, h)
    rows = [blades.shapes[min(h, len(blades.shapes) - 1), blades.contact]]
    flexibility = blades.residual[min(h, len(blades.residual) - 1), blades.contact, blades.contact]
    for damper in dampers:
        own = min(h, len(damper.shapes) - 1)
        rows.append(-damper.shapes[own, damper.contact])
        flexibility = flexibility + damper.residual[own, damper.contact, damper.contact]
    moved = np.hstack(rows) @ shapes
    springs = model.springs.ravel()
    held = np.linalg.solve(np.eye(len(moved)) + flexibility * springs, moved)
    return np.asarray(held.reshape(*model.springs.shape, -1))


def _joined_coupling(viscous: list[np.ndarray | None], sizes: list[int]) -> np.ndarray:
    """(n, n) what couples the coordinates of each body, none where its damping is modal."""
    blocks = [
        np.zeros((size, size)) if part is None or part.ndim == 1 else part
        for part, size in zip(viscous, sizes, strict=True)
    ]
    return np.asarray(linalg.block_diag(*blocks))

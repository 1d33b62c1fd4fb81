"""The complete coupled system in time: modes, dampers and one-dimensional friction elements with a
normal load.

    q'' + D q' + L q = p(t) - W^T f - R^T (max(N, 0) - n0),    w = W q + g(t),    N = n(t) + V q

q are mass-normalised coordinates (modes of the blades, sqrt(mass) times the motion of rigid
dampers), w the tangential displacement of blade minus damper, N the normal force and f the friction
force that the damper feels: stick f = k_t (w - z), slip f = +-mu N, separation f = 0 where N <= 0.
With contact springs k_n that follow the motion, R reads the normal displacement and V = k_n R; n0
is the mean of n, carried by the preload state.

All periodic inputs are real Fourier coefficients [mean, cos, sin, cos 2, sin 2, ...] of one base
frequency.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bladefem.data import Elements, PortModel
from bladefem.errors import InputError
from bladefem.friction.law_table import require_coulomb

from ..util.arrays import RealArray


@dataclass(frozen=True)
class System:
    """Matrices of the equations above; d coordinates, n elements, H harmonics of the inputs."""

    # (d,) L, squared circular frequencies [1/s^2]
    stiffness: RealArray
    # (d, d) D [1/s]
    damping: RealArray
    # (n, d) tangential readings [kg^-1/2]
    W: RealArray
    # (n,) [N/m]
    kt: RealArray
    # (n,) [1]
    mu: RealArray
    # (d, 2H+1) p [N kg^-1/2]
    force: RealArray
    # (n, 2H+1) g, prescribed part of w [m]
    drive: RealArray
    # (n, 2H+1) n, prescribed part of N [N]
    normal: RealArray
    # (n, d) normal force for each coordinate [N kg^-1/2 / m]; zero when prescribed
    V: RealArray
    # (k, d) readings of interest [kg^-1/2]
    probe: RealArray
    # (n, d) normal readings, where normal forces react on q [kg^-1/2]; empty: zeros
    R: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        n, d = self.W.shape
        shapes = {
            "stiffness": (d,),
            "damping": (d, d),
            "kt": (n,),
            "mu": (n,),
            "V": (n, d),
            "force": (d, self.coefficients),
            "drive": (n, self.coefficients),
            "normal": (n, self.coefficients),
        }
        if self.R.size == 0:
            object.__setattr__(self, "R", np.zeros((n, d)))
        for name, shape in (shapes | {"R": (n, d)}).items():
            value = getattr(self, name)
            if value.shape != shape or not np.isfinite(value).all():
                raise InputError(
                    f"System.{name} of shape {value.shape}: expected {shape} finite numbers"
                )
        if np.any(self.kt <= 0) or np.any(self.mu < 0):
            raise InputError(
                "System.kt, System.mu: expected stiffnesses above zero and no negative friction"
            )

    @property
    def coefficients(self) -> int:
        """2H+1"""
        return self.force.shape[1]

    @property
    def fastest(self) -> float:
        """Highest circular frequency, all elements stuck [rad/s]."""
        K = np.diag(self.stiffness) + (self.W.T * self.kt) @ self.W + self.R.T @ self.V
        return float(np.sqrt(np.linalg.eigvalsh((K + K.T) / 2).max()))


def blade_ring(
    body: PortModel,
    ratio: float,
    elements: Elements,
    mass: float,
    excitation: complex,
    blades: int = 1,
    waves: int = 0,
) -> System:
    """Blades in a ring with a rigid tangential damper between each two, under a travelling force.

    The contact port of ``body`` holds the elements on its own damper first, then those on the
    damper of the blade before, half and half; the force on blade b is Re(excitation e^{j (t + 2 pi
    waves b / blades)}) on the load port.

    Args:
        ratio: modal damping ratio [1].
        elements: for one blade, tangents = 1, both halves (n,).
        mass: of one damper [kg].

    Raises:
        InputError: the residual flexibility is not zero (keep all modes, or leave it out
            knowingly), or an odd port.
    """
    require_coulomb(elements, "the ring of blades in time")
    if np.abs(body.residual).max() > 0:
        raise InputError(
            "body.residual: a massless flexibility has no place in time integration; keep all "
            "modes, or replace it by zeros"
        )
    m = len(body.omega)
    n = len(elements.kt)
    contact = _contact_halves(body, n)
    size = m + 1
    W = _ring_readings(contact, mass, blades)
    force = _travelling_force(body.shapes[body.ports["load"]][0], excitation, blades, waves)
    probe = np.zeros((1, blades * size))
    probe[0, :m] = body.shapes[body.ports["probe"]][0]
    omega: np.ndarray = np.tile(np.r_[body.omega, 0.0], blades)
    damping = _ring_damping(body, ratio, blades)
    return System(
        np.square(omega),
        damping,
        W,
        np.tile(elements.kt, blades),
        np.tile(elements.mu, blades),
        force,
        np.zeros((blades * n, 3)),
        np.tile(elements.n0[:, None] * [1.0, 0.0, 0.0], (blades, 1)),
        np.zeros_like(W),
        probe,
    )


def _ring_damping(body: PortModel, ratio: float, blades: int) -> np.ndarray:
    """(coordinates, coordinates) viscous matrix [1/s] of blades and undamped dampers."""
    m = len(body.omega)
    extra = np.zeros((m, m)) if body.damping is None else np.real(body.damping)
    one = np.pad(np.diag(2 * ratio * body.omega) + extra, (0, 1))
    return np.kron(np.eye(blades), one)


def _travelling_force(
    shape: np.ndarray,
    excitation: complex,
    blades: int,
    waves: int,
) -> np.ndarray:
    """(coordinates, 3) mean, cosine and sine of the modal forces; shape (modes,) at the load port.
    The coordinate of each damper, after the modes of its blade, carries none.
    """
    m = len(shape)
    size = m + 1
    force = np.zeros((blades * size, 3))
    for b in range(blades):
        turned = excitation * np.exp(2j * np.pi * waves * b / blades)
        amplitude = turned * shape
        force[b * size : b * size + m, 1] = amplitude.real
        force[b * size : b * size + m, 2] = -amplitude.imag
    return force


def _contact_halves(body: PortModel, elements: int) -> np.ndarray:
    """(elements, modes) real shapes of a contact port of two equal halves."""
    contact = body.shapes[body.ports["contact"]]
    if contact.shape[0] != elements or elements % 2 or np.iscomplexobj(contact):
        raise InputError(
            f"contact port of {contact.shape[0]} dofs for {elements} elements: expected two equal "
            "halves, real"
        )
    return contact


def _ring_readings(contact: np.ndarray, mass: float, blades: int) -> np.ndarray:
    """(elements, coordinates) relative displacements from contact shapes (n, m): of each blade the
    first half to its own damper, the second to the damper of the blade before.
    """
    n, m = contact.shape
    size = m + 1
    half = n // 2
    W = np.zeros((blades * n, blades * size))
    for b in range(blades):
        before = (b - 1) % blades
        rows = slice(b * n, (b + 1) * n)
        W[rows, b * size : b * size + m] = contact
        W[b * n : b * n + half, b * size + m] -= mass**-0.5
        W[b * n + half : (b + 1) * n, before * size + m] -= mass**-0.5
    return W


def damper_on_platforms(
    motion: np.ndarray,
    elements: Elements,
    mass: float,
) -> System:
    """A rigid damper with one degree of freedom on platforms whose motion is prescribed (the
    paper's Fig. 13).

    Args:
        motion: (n, H+1) complex harmonics 0..H of the platform at each element [m].
        mass: of the damper [kg].
    """
    require_coulomb(elements, "the damper in time")
    n = len(elements.kt)
    coefficients = 2 * motion.shape[1] - 1
    drive = np.zeros((n, coefficients))
    drive[:, 0], drive[:, 1::2], drive[:, 2::2] = (
        motion[:, 0].real,
        motion[:, 1:].real,
        -motion[:, 1:].imag,
    )
    normal = np.zeros((n, coefficients))
    normal[:, 0] = elements.n0
    W = np.full((n, 1), -(mass**-0.5))
    return System(
        np.zeros(1),
        np.zeros((1, 1)),
        W,
        elements.kt,
        elements.mu,
        np.zeros((1, coefficients)),
        drive,
        normal,
        np.zeros((n, 1)),
        np.full((1, 1), mass**-0.5),
    )

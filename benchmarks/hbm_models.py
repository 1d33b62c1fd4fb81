"""The four problems on which harmonic balance codes are compared, as plain matrices and as reduced
models.

Every problem is (M, C, K, load dof, force, contacts): what pyHarm, an integrator and bladefem all
understand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bladefem.data import Elements
from bladefem.hbm.model import ReducedModel
from bladefem.reduction.beam import beam_matrices
from bladefem.reduction.matrices import port_model_from_matrices

# along a patch, that neighbours in a wheel move it by
SMOOTH_FUNCTIONS = 24


@dataclass(frozen=True)
class Problem:
    """M x'' + C x' + K x = F cos(omega t) e_load - contact forces; contacts against the ground or
    between dofs.
    """

    name: str
    M: np.ndarray
    C: np.ndarray
    K: np.ndarray
    load: int
    force: float
    contact: (
        np.ndarray
    )  # (contact dofs, dofs) relative displacements, node-major (normal, t1[, t2])
    elements: Elements
    band: tuple[float, float]  # [rad/s]

    @property
    def model(self) -> ReducedModel:
        """The same for bladefem."""
        tip = np.array([self.load])
        side = port_model_from_matrices(
            self.M, self.K, {"contact": self.contact, "load": tip, "probe": tip}, C=self.C
        )
        return ReducedModel((side,), self.elements, {1: np.array([self.force])})


def single_mass(kt: float = 1.0, limit: float = 0.5) -> Problem:
    """One dof on a spring, a Jenkins element of constant normal load to the ground."""
    one = np.eye(1)
    elements = Elements(np.array([kt]), np.zeros(1), np.ones(1), np.array([limit]), tangents=1)
    return Problem("single mass", one, 0.02 * one, one, 0, 1.0, one, elements, (0.5, 2.0))


def beam(limit: float = 1.4) -> Problem:
    """The reference blade of 20 elements with one Jenkins element from its platform to the
    ground.
    """
    K, M = beam_matrices()
    M[10, 10] += 0.05
    elements = Elements(np.array([1e6]), np.zeros(1), np.ones(1), np.array([limit]), tangents=1)
    contact = np.zeros((1, len(K)))
    contact[0, 10] = 1.0
    return Problem(
        "beam",
        M,
        1.0 * M + 5e-7 * K,
        K,
        len(K) - 2,
        1.0,
        contact,
        elements,
        (2 * np.pi * 1150, 2 * np.pi * 1600),
    )


def chain(n0: float = 0.6, masses: int = 24) -> Problem:
    """Masses that move along and across: 2 x 24 dofs, springs between neighbours and to the ground.

    Every mass presses on the ground with n0 + kn w and rubs with kt; at n0 0.6 most of them lift
    off, at 4 none does.
    """
    link = 2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    K = np.kron(link, np.diag([2.0, 3.0])) + np.kron(
        np.eye(masses), np.array([[1.0, 0.3], [0.3, 0.6]])
    )
    kt, kn, mu, load = (np.full(masses, value) for value in (0.5, 0.8, 0.4, n0))
    elements = Elements(kt, kn, mu, load, tangents=1)
    dofs = 2 * masses
    return Problem(
        "chain",
        np.eye(dofs),
        0.01 * np.eye(dofs) + 0.01 * K,
        K,
        2 * (masses // 3) + 1,
        4.0,
        np.eye(dofs),
        elements,
        (0.6, 1.6),
    )


def patch(side: int = 10, inner: int = 34, n0: float = 1.0, seed: int = 3) -> Problem:
    """A square patch of side x side 3-D contacts on an elastic layer over `inner` heavy nodes; 402
    dofs by default.
    """
    rng = np.random.default_rng(seed)
    nodes = side**2 + inner
    links = [(i, i + 1) for i in range(side**2) if (i + 1) % side] + [
        (i, i + side) for i in range(side**2 - side)
    ]
    links += [(i, side**2 + i * inner // side**2) for i in range(side**2)]
    links += [(side**2 + i, side**2 + i + 1) for i in range(inner - 1)]
    L = np.zeros((nodes, nodes))
    for a, b in links:
        k = rng.uniform(1.5, 2.5)
        L[[a, b], [a, b]] += k
        L[[a, b], [b, a]] -= k
    L[np.arange(side**2, nodes), np.arange(side**2, nodes)] += 0.5
    skew = np.array([[1.0, 0.2, 0.1], [0.2, 0.8, 0.1], [0.1, 0.1, 0.9]])
    K = np.kron(L, skew)
    M = np.kron(np.diag(np.concatenate([np.full(side**2, 0.2), np.full(inner, 2.0)])), np.eye(3))
    contact = np.zeros((3 * side**2, 3 * nodes))
    contact[:, : 3 * side**2] = np.eye(3 * side**2)
    elements = Elements(
        np.full(side**2, 0.3),
        np.full(side**2, 0.5),
        np.full(side**2, 0.4),
        n0 * rng.uniform(0.3, 1.0, side**2),
    )
    return Problem(
        "3-D patch",
        M,
        0.02 * M + 0.01 * K,
        K,
        3 * (side**2 + inner // 2) + 1,
        40.0,
        contact,
        elements,
        (0.3, 1.5),
    )


def pressed_patch() -> Problem:
    """The patch under four times the load, at a frequency where 68 of its 100 contacts slip and
    none lifts off.
    """
    return replace(patch(n0=4.0), name="3-D patch, pressed", band=(0.7, 0.7))


PROBLEMS = {
    "single mass": single_mass,
    "beam": beam,
    "chain": partial(chain, 4.0),
    "chain with lift-off": chain,
    "3-D patch": patch,
    "3-D patch, pressed": pressed_patch,
}


def sectors(model: ReducedModel, harmonics: int) -> ReducedModel:
    """The model as a sector of a wheel whose wave repeats after four blades: the harmonics 0..H
    fall into nodal diameters 0, n, 2 n, -n, 0, ...

    What neighbours add to the residual flexibility is smooth over the patch, as through a disc, and
    complex but for the diameters of standing waves; so are the modes' shapes.
    """
    side = model.sides[0]
    contact = side.ports["contact"]
    place = np.linspace(0, 1, contact.stop - contact.start)
    smooth = np.cos(np.pi * np.outer(place, np.arange(SMOOTH_FUNCTIONS)))
    size = 0.3 * abs(side.residual).max() / SMOOTH_FUNCTIONS**2
    random = np.random.default_rng(5)
    real, imaginary = random.standard_normal((2, SMOOTH_FUNCTIONS, SMOOTH_FUNCTIONS))
    bodies = []
    for wave in (0, 1, 0, -1):
        half = real + 1j * wave * imaginary + len(bodies) % 3 * np.eye(SMOOTH_FUNCTIONS)
        residual = side.residual.astype(complex)
        residual[contact, contact] += smooth @ (size * half @ half.conj().T) @ smooth.T
        shapes = side.shapes.astype(complex)
        shapes[contact] *= np.exp(0.3j * wave * place)[:, None]
        bodies.append(replace(side, residual=residual, shapes=shapes))
    return replace(model, sides=tuple(bodies[h % 4] for h in range(harmonics + 1)))

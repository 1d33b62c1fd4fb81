"""What one solved point knows about itself."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..util.arrays import ComplexArray, RealArray
from .linear.bodies import Stack, modal_amplitudes, modal_flexibility, port_motion
from .model import ReducedModel


@dataclass(frozen=True)
class Work:
    """Work in one period [J]; in a solved balance  input = damping + friction  for the harmonics
    that are kept.
    """

    # of the excitation on the blades
    input: float
    # lost in the linear bodies
    damping: float
    # of the balanced force harmonics on the relative motion
    friction: float
    # in the contacts, from the sampled motion with all its harmonics
    dissipated: float

    @property
    def imbalance(self) -> float:
        """|input - damping - friction| over the input work."""
        return abs(self.input - self.damping - self.friction) / max(
            abs(self.input), float(np.finfo(float).tiny)
        )


@dataclass(frozen=True)
class Solution:
    """A point of a response: converged, or the best that was found, with the reason."""

    # [rad/s]
    omega: float
    # H
    harmonics: int
    # a period
    samples: int
    # (n, d, 2H+1) relative displacements: mean, cos 1, sin 1, ... [m]
    w: RealArray
    # (n, d, 2H+1) contact forces, with the preload in the mean of the normal ones [N]
    f: RealArray
    # (H+1, probes) complex amplitudes, Re(q e^{i h omega t}) [m]
    probe: ComplexArray
    converged: bool
    reason: str
    # "newton" or the fallback that reached the point
    method: str
    # Newton steps, of all attempts
    iterations: int
    # over the size of the motion [1]
    residual: float
    # largest entry of the residual [m]
    residual_displacement: float
    # the same times the contact stiffness [N]
    residual_force: float
    # how fast a free damper walks: step a period times frequency, of the contact that moves most
    # [m/s]
    drift: float
    # number of nodes that stick, slip, lift off, are open
    states: dict[str, int]
    work: Work
    # the way of `bladefem.hbm.policy` that ran: loop, linear solvers
    route: str = ""
    # number of the piece of a response with several motions that the point lies on, from 1 on; 0
    # where one motion was looked for
    branch: int = 0
    # (m, z) motions along which the damper walks; there the mean of w is no position but the step a
    # period (`bladefem.hbm.solver.residual`). None: no contact walks
    walk: np.ndarray | None = None

    @property
    def amplitude(self) -> np.ndarray:
        """(H+1, probes) amplitude of each harmonic [m]."""
        return abs(self.probe)

    @property
    def frequency(self) -> float:
        """[Hz]"""
        return self.omega / (2 * np.pi)


def size(solution: Solution, probe: int = 0) -> float:
    """Root of the sum of squares of the moving harmonics' amplitudes at a probe: what a peak is
    measured by [m].
    """
    moving = solution.probe[1:, probe]
    return math.sqrt(np.vdot(moving, moving).real)


def lifts_off(solution: Solution) -> bool:
    """Contacts open and close within a period."""
    return solution.states["lift"] > 0


def mostly_lifts_off(solution: Solution) -> bool:
    """At least half of the contacts open and close within a period."""
    return 2 * solution.states["lift"] >= len(solution.w)


def moving_contacts(solution: Solution) -> int:
    """Number of contacts that slip or lift off within a period."""
    return solution.states["slip"] + solution.states["lift"]


def probe_motion(
    model: ReducedModel,
    omega: float,
    force: np.ndarray,
    rigid: np.ndarray,
) -> np.ndarray:
    """(H+1, probes) amplitudes at the probes by the excitation and contact forces (H+1, m) beyond
    the preload.
    """
    return at_probes(blade_motion(model, omega, force), rigid)


def at_probes(blade: tuple[Stack, np.ndarray, np.ndarray], rigid: np.ndarray) -> np.ndarray:
    """(H+1, probes) from the blades' motion, with the mean rigid motion added."""
    blades, ports, modal = blade
    modal = modal.copy()
    modal[0, blades.omega[0] == 0] += rigid[: np.count_nonzero(blades.omega[0] == 0)]
    return port_motion(blades, modal, ports, blades.probe)


def blade_motion(
    model: ReducedModel,
    omega: float,
    force: np.ndarray,
    flexible: np.ndarray | None = None,
    excited: bool = True,
) -> tuple[Stack, np.ndarray, np.ndarray]:
    """Blades under the excitation and contact forces (H+1, m): stack, forces at all ports (H+1, P),
    modes (H+1, m).

    Args:
        flexible: `modal_flexibility` of the blades at this frequency, where it is known.
        excited: False leaves the excitation out.
    """
    H = len(force) - 1
    blades = model.blades(H)
    ports = np.zeros((H + 1, blades.shapes.shape[1]), dtype=complex)
    ports[:, blades.contact] = -force
    if excited:
        ports[:, blades.load] = model.loads(H)
    if flexible is None:
        flexible = modal_flexibility(blades, omega * np.arange(H + 1))
    return blades, ports, modal_amplitudes(blades, flexible, ports)

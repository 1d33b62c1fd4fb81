"""Dampers of a wheel that walk: the motions that nothing but friction holds, and the balance in
which some dampers go on along them by a step in each period.

Where every contact of a damper slips its mean position along such a motion b (with b^T K b = 1) has
no influence on the forces, and the step has. As in one sector (`hbm.solver.residual`) the component
b^T K w_0 of the mean displacement then stands for the step, of each damper its own: the number of
unknowns stays, and the derivative gains one term of low rank a damper. Preconditioners are those of
dampers that springs hold: without the step, nothing else would.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..data import PortModel, RigidBody
from ..friction.law_table import forgets_position
from ..hbm.solver.residual import WALK_DIFFERENCE
from ..hbm.solver.walking import UNRESISTED_NORMAL, unresisted
from ..util.arrays import BooleanArray, RealArray
from .by_diameter import diameter_parts
from .flexibility import WheelFlexibility
from .model import Wheel

# motions that the contact springs resist less than this, relatively, are left out
UNRESISTED_SHARE = 1e-12
# springs on rigid motions over those of the contacts, in preconditioners
HOLDING_SHARE = 0.3


@dataclass(frozen=True)
class WheelWalk:
    """Which dampers walk, and along which motions."""

    # (n, d, z) of the contacts of one damper, b^T K b = 1
    motions: RealArray
    # (n, d) contact stiffness [N/m]
    springs: RealArray
    # friction elements have so many tangents
    tangents: int
    # (N,) True for a damper that walks
    dampers: BooleanArray

    def steps(self, w: np.ndarray) -> RealArray:
        """(N, z) along the motions, from the mean of displacements w (N, n, d, K); zero of dampers
        that rest.
        """
        found = np.einsum("ndz,nd,snd->sz", self.motions, self.springs, w[..., 0])
        return np.asarray(found * self.dampers[:, None])

    def ramp(self, steps: np.ndarray) -> RealArray:
        """(N n, tangents) by which the contacts go on in each period [m]."""
        first = self.motions.shape[1] - self.tangents
        moved = np.einsum("ntz,sz->snt", self.motions[:, first:], steps)
        return np.asarray(moved.reshape(-1, self.tangents))

    def without_steps(self, w: np.ndarray) -> np.ndarray:
        """w (N, n, d, K) with a walk of zero."""
        still = w.copy()
        still[..., 0] -= np.einsum("ndz,sz->snd", self.motions, self.steps(w))
        return still


def unheld_motions(wheel: Wheel) -> RealArray:
    """(n, d, z) motions of a damper's contacts that no normal spring resists; z = 0 where there is
    none, the means are held, or a friction law knows the position.
    """
    n, d = wheel.nodes, wheel.directions
    rigid = _rigid_motions(wheel)
    if not wheel.coupled or not rigid.shape[1] or not forgets_position(wheel.elements):
        return np.zeros((n, d, 0))
    springs = wheel.springs.ravel()
    held = rigid.T @ (springs[:, None] * rigid)
    # metres and radians alike
    size = np.sqrt(np.where(np.diag(held) > 0, np.diag(held), 1.0))
    values, vectors = np.linalg.eigh(held / np.outer(size, size))
    kept = values > UNRESISTED_SHARE
    B = rigid @ (vectors[:, kept] / np.sqrt(values[kept]) / size[:, None])
    normal = np.zeros((n, d), dtype=bool)
    normal[:, : d - wheel.elements.tangents] = True
    return unresisted(B, springs, normal.ravel(), UNRESISTED_NORMAL).reshape(n, d, -1)


def with_free_means(wheel: Wheel) -> Wheel | None:
    """The wheel with free mean displacements; None where no damper has a motion that friction alone
    resists.
    """
    free = replace(wheel, coupled=True)
    return free if unheld_motions(free).shape[2] else None


def _rigid_motions(wheel: Wheel) -> np.ndarray:
    """(n d, r) of the damper's contacts."""
    damper = wheel.damper
    if isinstance(damper, RigidBody):
        return np.asarray(-damper.B[wheel.rows])
    if isinstance(damper, PortModel):
        rows = np.arange(len(damper.residual))[damper.ports["contact"]][wheel.rows]
        return np.asarray(-damper.shapes[rows][:, damper.omega == 0].real)
    return np.zeros((len(wheel.rows), 0))


def slipping_dampers(shares: np.ndarray) -> BooleanArray:
    """(N,) True where every contact slips or lifts off, from the shares (N, n, 3) of stick, slip
    and separation.
    """
    held = (shares[..., 1] == 0) & (shares[..., 2] == 0)
    return np.asarray(~held.any(axis=1))


def walk_rates(
    walk: WheelWalk,
    w: np.ndarray,
    f: np.ndarray,
    forces: Callable[[np.ndarray], np.ndarray],
) -> RealArray:
    """(z, N, n, d, K) derivatives of the contact forces with the steps, by differences [N/m].

    Args:
        w, f: (N, n, d, K) displacements [m] and forces [N].
        forces: the same forces with another ramp (N n, tangents).
    """
    steps = walk.steps(w)
    first = walk.motions.shape[1] - walk.tangents
    size = WALK_DIFFERENCE * max(abs(w[:, :, first:, 1:]).max(), np.finfo(float).tiny)
    rates = []
    for j in range(steps.shape[1]):
        # away from a walk of zero, where the law has a corner
        change = np.copysign(size / abs(walk.motions[..., j]).max(), steps[:, j]) * walk.dampers
        moved = steps.copy()
        moved[:, j] += change
        rate = np.zeros_like(f)
        own = walk.dampers
        apart = forces(walk.ramp(moved))[own] - f[own]
        rate[own] = apart / change[own, None, None, None]
        rates.append(rate)
    return np.array(rates)


def held_flexibility(wheel: Wheel, flex: WheelFlexibility) -> WheelFlexibility:
    """The flexibility with springs on the mean of rigid motions, for preconditioners."""
    key = "held mean"
    if key not in wheel.kept:
        wheel.kept[key] = diameter_parts(replace(wheel, hold=HOLDING_SHARE)).mean
    T = flex.T.copy()
    T[:, 0] = wheel.kept[key]
    return replace(flex, T=T)

"""What the contact nodes do in one period at a resonance: stick, slip, separation, friction work, hysteresis loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..contact.stiffness import aggregation
from ..data import Elements, Patch
from ..friction.aft import evaluate
from ..friction.energy import free_static_force
from ..friction.harmonics import synthesis
from .family import joined
from .joint import LoadCase
from .loads import Curve

__all__ = ["ContactCycle", "Loop", "contact_cycle", "labels"]

SMOOTH = 63     # harmonics that draw the corners of a loop; the balance has fewer


@dataclass(frozen=True)
class Loop:
    """Hysteresis of a whole patch along the direction in which it mostly slides, over one period."""

    displacement: np.ndarray    # (s,) mean of the nodes by their stiffness, less its mean in time [m]
    force: np.ndarray           # (s,) friction force of the patch on the damper [N]


@dataclass(frozen=True)
class ContactCycle:
    """One period of all contact nodes, patch after patch; nodes of one friction element share its values."""

    load: float             # [N]
    mass: float | None      # of the damper [kg]
    frequency: float        # of the resonance [Hz]
    shares: np.ndarray      # (nodes, 3) share of the period in stick, slip and separation [1]
    state: np.ndarray       # (nodes,) SEPARATED, STICK, PARTIAL_SLIP or GROSS_SLIP of friction.aft
    work: np.ndarray        # (nodes,) friction work a period and area, the wear-work map [J/m^2]
    spare: np.ndarray       # (nodes,) size up to which the static friction force of their element is free [N]
    loops: dict[str, Loop]  # name of the patch to its hysteresis

    def wear(self, coefficient: float) -> np.ndarray:
        """(nodes,) depth worn off in an hour of this resonance [m], both faces together.

        The worn volume is the coefficient [m^3/J] times the friction work (Fouvry, Kapsa, Vincent, Wear 200, 1996):
        Archard's law, whose coefficient for each newton of pressure and metre of slip is mu times as much.
        """
        return 3600.0 * self.frequency * coefficient * self.work


def contact_cycle(case: LoadCase, curve: Curve, patches: Sequence[Patch], points: int | None) -> ContactCycle:
    """The period at the highest point of a response curve.

    Args:
        case: the load of the curve.
        points: friction elements that the scene allows each patch (``contact.points``), None for all nodes.
    """
    area = np.concatenate([patch.area for patch in patches])
    elements, groups = case.elements, labels(patches, points)
    if len(elements.kt) == len(area):       # of all nodes; the choice may have joined some
        groups = labels(patches, curve.settings.points)
        elements = joined(elements, groups)
    elements, w = _in_all_directions(elements, curve.peak.w)
    forces = evaluate(elements, w, curve.peak.samples or 512, jacobian=False)
    starts = np.cumsum([0] + [len(patch.area) for patch in patches])
    rows = [np.unique(groups[a:b]) for a, b in pairwise(starts)]
    return ContactCycle(case.load, case.mass, curve.peak.frequency, forces.shares[groups], forces.state[groups],
                        (forces.dissipated / np.bincount(groups, area))[groups], free_static_force(elements, w)[groups],
                        {patch.name: _loop(elements, w, some) for patch, some in zip(patches, rows, strict=True)})


def _loop(elements: Elements, w: np.ndarray, rows: np.ndarray) -> Loop:
    """Hysteresis of some elements; their motion is that of the balance, their force has all its harmonics."""
    fine = np.zeros((len(rows), w.shape[1], 2 * SMOOTH + 1))
    fine[..., :w.shape[2]] = w[rows]
    some = replace(elements, **{name: np.broadcast_to(getattr(elements, name), len(w))[rows]
                                for name in ("kt", "kn", "mu", "n0")})
    force = evaluate(some, fine, 8 * SMOOTH + 8, jacobian=False).f[:, 1:].sum(0)
    share = some.kt / some.kt.sum()
    mean = np.einsum("n,ndk->dk", share, fine[:, 1:])
    mean[:, 0] = 0.0
    direction = np.linalg.svd(mean)[0][:, 0]
    T = synthesis(SMOOTH, 8 * SMOOTH + 8)
    return Loop(T @ (direction @ mean), T @ (direction @ force))


def labels(patches: Sequence[Patch], points: int | None) -> np.ndarray:
    """(nodes of all patches,) number of the element that each belongs to, ``points`` elements on each patch."""
    parts = [aggregation(patch, points) for patch in patches]
    starts = np.cumsum([0] + [part.shape[1] for part in parts])
    return np.concatenate([start + part.indices for start, part in zip(starts, parts, strict=False)])


def _in_all_directions(elements: Elements, w: np.ndarray) -> tuple[Elements, np.ndarray]:
    """Elements and motion in all directions; without normal motion the load keeps its static value."""
    missing = 1 + elements.tangents - w.shape[1]
    if missing == 0:
        return elements, w
    w = np.concatenate([np.zeros((len(w), missing, w.shape[2])), w], axis=1)
    return replace(elements, kn=np.zeros_like(elements.kn)), w

"""What the contact nodes do in one period at a resonance: stick, slip, separation, friction work,
hysteresis loops.

Next to them the linear element that comes closest to each friction element there (the paper's K_ad,
C_ad, F_c0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...contact.joined_points import element_labels
from ...contact.numerical_stiffness import physical_stiffness
from ...data import Elements, Patch
from ...friction.aft import Forces, evaluate
from ...friction.energy import free_static_force
from ...friction.equivalent_linear import (
    Approximation,
    from_harmonics,
    matrices_by_harmonic,
    work_of,
)
from ...friction.fourier import synthesis
from ...friction.law_table import select_elements
from ...util.arrays import IntegerArray, RealArray
from ..adaptive.family import joined_elements
from .assemble_model import LoadCase
from .curve import Curve

# harmonics that draw the corners of a loop; the balance has fewer
DRAWN_HARMONICS = 63


@dataclass(frozen=True)
class Loop:
    """Hysteresis of a whole patch along the direction in which it mostly slides, over one
    period.
    """

    # (s,) mean of the nodes by their stiffness, less its mean in time [m]
    displacement: RealArray
    # (s,) friction force of the patch on the damper [N]
    force: RealArray


@dataclass(frozen=True)
class ContactCycle:
    """One period of all contact nodes, patch after patch; nodes of one friction element share its
    values.

    Its stiffness, static load and linear approximation are shared out by area, so that the sum over
    the nodes is that of the element.
    """

    # [N]
    load: float
    # of the damper [kg]
    mass: float | None
    # of the resonance [Hz]
    frequency: float
    # (nodes, 3) share of the period in stick, slip and separation [1]
    shares: RealArray
    # (nodes,) SEPARATED, STICK, PARTIAL_SLIP or GROSS_SLIP of friction.aft
    state: IntegerArray
    # (nodes,) friction work a period and area, the wear-work map [J/m^2]; where the resonance given
    # is not the balance, as large in all as that of the resonance
    work: RealArray
    # (nodes,) size up to which the static friction force of their element is free [N]
    spare: RealArray
    # name of the patch to its hysteresis
    loops: dict[str, Loop]
    # (nodes, tangents) K_ad, C_ad, F_c0 averaged over the harmonics; nan at rest
    linear: Approximation
    # (nodes, tangents, H) K_ad, C_ad of each harmonic alone; nan where the motion does not have it
    harmonic: Approximation
    # (nodes,) what the period was computed with; an element's own mu, shares of the rest
    elements: Elements
    # largest |work of the approximation - friction work| over the largest friction work [1]
    mismatch: float
    # the resonance given is what a march keeps to; the period is that of a balance
    is_march: bool = False

    def wear(self, coefficient: float) -> np.ndarray:
        """(nodes,) depth worn off in an hour of this resonance [m], both faces together.

        The worn volume is the coefficient [m^3/J] times the friction work (Fouvry, Kapsa, Vincent,
        Wear 200, 1996): Archard's law, whose coefficient for each newton of pressure and metre of
        slip is mu times as much.
        """
        return 3600.0 * self.frequency * coefficient * self.work


def contact_cycle(
    case: LoadCase,
    curve: Curve,
    patches: Sequence[Patch],
    points: int | None,
) -> ContactCycle:
    """The period at the highest point of a response curve, of its balance.

    Args:
        case: the load of the curve.
        points: friction elements that the scene allows each patch (``contact.points``), None for
            all nodes.
    """
    area = np.concatenate([patch.area for patch in patches])
    elements = case.elements
    layer = physical_stiffness(elements, case.series)
    groups = element_labels(patches, points)
    # of all nodes; the choice may have joined some
    if len(elements.kt) == len(area):
        groups = element_labels(patches, curve.settings.points)
        elements = joined_elements(elements, groups)
        layer = joined_elements(layer, groups)
    series = 1.0 / layer.kt - 1.0 / elements.kt
    elements, w = _in_all_directions(elements, curve.peak.w)
    layer = replace(layer, kn=np.where(elements.kn > 0, layer.kn, 0.0))
    # the friction law starts from the static friction force
    started = w.copy()
    started[:, 1:, 0] += elements.traction / elements.kt[:, None]
    forces = evaluate(elements, started, curve.peak.samples or 512, jacobian=False)
    starts = np.cumsum([0] + [len(patch.area) for patch in patches])
    rows = [np.unique(groups[a:b]) for a, b in pairwise(starts)]
    part = area / np.bincount(groups, area)[groups]
    averaged, each, mismatch = _linear(forces, w, series, 2 * np.pi * curve.peak.frequency)
    return ContactCycle(
        case.load,
        case.mass,
        curve.peak_frequency,
        forces.shares[groups],
        forces.state[groups],
        part / area * curve.work_over_balance * forces.dissipated[groups],
        free_static_force(elements, w)[groups],
        {
            patch.name: _loop(elements, started, series, some)
            for patch, some in zip(patches, rows, strict=True)
        },
        _dealt(averaged, groups, part),
        _dealt(each, groups, part),
        _dealt_elements(layer, groups, part),
        mismatch,
        curve.is_march,
    )


def _dealt_elements(
    elements: Elements,
    groups: np.ndarray,
    part: np.ndarray,
) -> Elements:
    """The elements of all nodes, each with its part of that of its group."""
    each = select_elements(elements, groups)
    t0 = None if each.t0 is None else each.t0 * part[:, None]
    return replace(each, kt=each.kt * part, kn=each.kn * part, n0=each.n0 * part, t0=t0)


def _linear(
    forces: Forces,
    w: np.ndarray,
    series: np.ndarray,
    omega: float,
) -> tuple[Approximation, Approximation, float]:
    """Optimal approximation of the tangential forces (n, d, K), averaged and by harmonic, and its
    error in work.

    Args:
        series: (n,) compliance of the layer in addition to that of the elements [m/N].
    """
    f = forces.f[:, 1:]
    u = w[:, 1:] + series[:, None, None] * f
    averaged = from_harmonics(u, f, omega)
    spent = forces.dissipated
    apart = np.abs(work_of(averaged, u, omega).sum(1) - spent).max() / max(spent.max(), 1e-300)
    return (
        averaged,
        matrices_by_harmonic(u, f, omega),
        float(apart) if (forces.shares[:, 1] > 0).any() else 0.0,
    )


def _dealt(
    approximation: Approximation,
    groups: np.ndarray,
    part: np.ndarray,
) -> Approximation:
    """The approximation (elements, ...) shared out to the nodes of its elements, part (nodes,)
    [1].
    """
    return Approximation(
        *(
            x[groups] * part.reshape(-1, *[1] * (x.ndim - 1))
            for x in (approximation.stiffness, approximation.damping, approximation.constant)
        )
    )


def _loop(
    elements: Elements,
    w: np.ndarray,
    series: np.ndarray,
    rows: np.ndarray,
) -> Loop:
    """Hysteresis of some elements; their motion is that of the balance, their force has all its
    harmonics.

    Args:
        series: (n,) compliance of the layer in addition to that of the elements [m/N].
    """
    fine = np.zeros((len(rows), w.shape[1], 2 * DRAWN_HARMONICS + 1))
    fine[..., : w.shape[2]] = w[rows]
    some = select_elements(elements, rows)
    friction = evaluate(some, fine, 8 * DRAWN_HARMONICS + 8, jacobian=False).f[:, 1:]
    force = friction.sum(0)
    share = some.kt / some.kt.sum()
    across = fine[:, 1:] + series[rows, None, None] * friction
    mean = np.einsum("n,ndk->dk", share, across)
    mean[:, 0] = 0.0
    direction = np.linalg.svd(mean)[0][:, 0]
    T = synthesis(DRAWN_HARMONICS, 8 * DRAWN_HARMONICS + 8)
    return Loop(T @ (direction @ mean), T @ (direction @ force))


def _in_all_directions(elements: Elements, w: np.ndarray) -> tuple[Elements, np.ndarray]:
    """Elements and motion in all directions; without normal motion the load keeps its static
    value.
    """
    missing = 1 + elements.tangents - w.shape[1]
    if missing == 0:
        return elements, w
    w = np.concatenate([np.zeros((len(w), missing, w.shape[2])), w], axis=1)
    return replace(elements, kn=np.zeros_like(elements.kn)), w

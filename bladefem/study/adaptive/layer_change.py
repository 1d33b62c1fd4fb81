"""What the tangent of a layer that stiffens with pressure leaves out of a resonance.

The elements of a balance take the layer's stiffness at rest. Springs that carry the mean force and
the work of the law itself in the motion at the resonance (``contact.equivalent_layer``) take their
place, the resonance is looked for again, and so on until its height stays: the change is an
estimate of the error, and counts in the reported one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...contact.equivalent_layer import LayerState, Sliding, equivalent_springs, tangential_growth
from ...contact.numerical_stiffness import physical_stiffness
from ...data import Elements
from ...friction.fourier import synthesis
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution, size
from .changed_peak import changed_peak
from .family import Family, family_member
from .settings import Settings

# resonances looked for with springs of the motion of the one before
MAX_PASSES = 5
# relative change of the height at which these end
PEAK_TOLERANCE = 2e-3
# of the stiffness of all springs: less than that is not worth a search
SAME_STIFFNESS = 1e-3
# instants of a period at least
INSTANTS = 128


def layer_change(
    family: Family,
    settings: Settings,
    top: Solution,
    decay: np.ndarray | None,
) -> float:
    """Relative change of a resonance amplitude with the layer's law in place of its tangent; inf
    where that was not solved.

    What the last pass still changed is added. 0 where the layer is linear or its motion too small
    to tell the two apart. Of the tangential stiffness at the mean force, and of that whose friction
    is closest to the law's at each instant, the one that changes more: where the pressure follows
    the sliding the second alone sees too little.

    Args:
        settings, top: of the resonance, and its highest point.
        decay: (n,) of ``contact.equivalent_layer.decay_lengths`` for the finest elements [m]; None
            for a linear layer.
    """
    member = family_member(family, settings)
    tangent = member.model
    if decay is None or not (np.isfinite(decay).any() and tangent.elements.kn.any()):
        return 0.0
    # elements are on one seat each, which has one length
    decay = decay[np.unique(member.groups, return_index=True)[1]]
    changes = (_change(tangent, settings, top, decay, instants) for instants in (False, True))
    return max(changes)


def _change(
    tangent: ReducedModel,
    settings: Settings,
    top: Solution,
    decay: np.ndarray,
    instants: bool,
) -> float:
    """The change with one of the two tangential stiffnesses of ``followed_law``."""
    model = followed_law(tangent, tangent, top, decay, instants)
    same = (
        np.allclose(getattr(model.elements, k), getattr(tangent.elements, k), SAME_STIFFNESS, 0.0)
        for k in ("kn", "kt")
    )
    if all(same):
        return 0.0
    point, height, left = top, size(top), np.inf
    for _ in range(MAX_PASSES):
        peak = changed_peak(model, settings, point, point.omega, PEAK_TOLERANCE)
        if peak is None:
            return np.inf
        left = abs(peak.height / height - 1)
        point, height = peak.solution, peak.height
        if left < PEAK_TOLERANCE:
            break
        model = followed_law(tangent, model, point, decay, instants)
    return abs(height / size(top) - 1) + left


def followed_law(
    tangent: ReducedModel,
    model: ReducedModel,
    point: Solution,
    decay: np.ndarray,
    instants: bool = False,
) -> ReducedModel:
    """The model with the springs of the layer's law in the motion of a point.

    Args:
        tangent: whose elements have the stiffness at rest.
        model: that the point solves, this one or of an earlier pass.
        decay: (n,) of its elements [m].
        instants: with the tangential stiffness whose friction is closest to that of a layer that
            stiffens at each instant; that at the mean force otherwise.
    """
    elements, series = tangent.elements, tangent.series
    layer = physical_stiffness(elements, series)
    count = max(INSTANTS, 8 * (point.harmonics + 1))
    across = point.w[:, 0] @ synthesis(point.harmonics, count).T
    closing = np.zeros(len(across)) if model.closing is None else model.closing
    force = model.elements.kn[:, None] * (across + closing[:, None]) + elements.n0[:, None]
    force = np.maximum(force, 0.0)
    rest = np.maximum(elements.n0, 0.0)
    # what a split layer leaves to the bodies is closure of the layer all the same
    added = np.zeros(len(rest)) if series is None else series[:, 0]
    motion = across + added[:, None] * (force - rest[:, None])
    mean = np.maximum(point.f[:, 0, 0], 0.0)
    found = equivalent_springs(LayerState(decay, layer.kn, layer.n0, motion, mean))
    growth = found.growth
    if instants:
        growth = tangential_growth(found, _sliding(tangent, layer, point, count))
    share = 1.0 - found.stiffness * added
    kn = found.stiffness / share
    load = (found.load - found.stiffness * added * rest) / share
    return replace(
        tangent,
        elements=replace(elements, kn=kn, kt=_tangential(tangent, layer, growth)),
        closing=(load - elements.n0) / kn,
    )


def _sliding(tangent: ReducedModel, layer: Elements, point: Solution, count: int) -> Sliding:
    """How the layer moves along its faces in the motion of a point, over so many instants."""
    back = synthesis(point.harmonics, count).T
    motion = point.w[:, 1:] @ back
    if tangent.series is not None:
        # what a split layer leaves to the bodies is sliding of the layer all the same
        motion = motion + tangent.series[:, 1, None, None] * (point.f[:, 1:] @ back)
    return Sliding(layer.kt, layer.mu, layer.traction, motion)


def _tangential(tangent: ReducedModel, layer: Elements, growth: np.ndarray) -> np.ndarray:
    """(n,) tangential stiffness of the elements [N/m], that of the layer times its growth."""
    compliance = 1.0 / (layer.kt * growth)
    if tangent.series is not None:
        compliance = compliance - tangent.series[:, 1]
    return np.asarray(1.0 / compliance)

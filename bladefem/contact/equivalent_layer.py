"""A layer that stiffens with pressure, as the linear springs that stand for it in one vibration.

The friction elements of a balance press with max(n + k w, 0). For the motion of a node they carry
the mean force and the work on that motion of the law itself,

    <max(n + k w, 0)> = <p(c)>,    <max(n + k w, 0) w> = <p(c) w>,

which is exact for one harmonic (equivalent linearisation). The mean closure follows from the mean
force, which equilibrium decides: a layer that stiffens pushes its faces apart as they vibrate. For
p = F exp(c / s) and a closure that moves by a cos(wt) about its mean, k is 2 I1(x) / (x I0(x)) of
the tangent, x = a / s, as long as the spring stays closed (I0, I1 modified Bessel functions).

Tangentially the layer is as much stiffer as its pressure is higher at each instant. A node that
slips mostly while it is hardly pressed and turns while it is pressed hard sees more than the
stiffness at its mean force: the constant one whose friction, by the same return map in the same
motion, is closest to that of the law takes its place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..data import Elements, PressureMap
from ..scene.tables import Contact
from .interface_elements import doubling_force, seat_contact
from .interface_law import InterfaceLaw, force_of, stiffness_at
from .joined_points import aggregation_matrix

# halvings of an interval in which a root lies: down to rounding
HALVINGS = 60
# of the force at rest: the force at first touch at least
SMALLEST_TOUCH = 1e-9
# of the length over which the stiffness grows: less motion than that sees the tangent
STILL_SHARE = 1e-6
# tangential stiffnesses that are tried, over that at the mean force, and periods of the motion
# after which its friction repeats
TRIED_GROWTHS = np.geomspace(0.2, 5.0, 33)
FRICTION_PERIODS = 3
# [N] no force
TINY = 1e-300


@dataclass(frozen=True)
class LayerState:
    """The layer of each element, and how it vibrates."""

    # (n,) length over which the stiffness grows by e [m]; infinite for a linear layer
    decay: np.ndarray
    # (n,) tangent stiffness at rest [N/m]
    stiffness: np.ndarray
    # (n,) force at rest [N]; negative means an initial gap of -force / stiffness
    rest: np.ndarray
    # (n, S) closure over a period, beyond that at rest [m]
    motion: np.ndarray
    # (n,) mean force over the period [N]
    mean: np.ndarray


@dataclass(frozen=True)
class EquivalentSprings:
    """Springs max(load + stiffness w, 0) for the closure w beyond that at rest."""

    # (n,) [N/m]
    stiffness: np.ndarray
    # (n,) [N]
    load: np.ndarray
    # (n,) tangent of the law at the mean force over that at rest
    growth: np.ndarray
    # (n, S) normal force of the law over the period [N], that of the springs, and the tangent of
    # the law over that at rest
    force: np.ndarray
    carried: np.ndarray
    tangent: np.ndarray


@dataclass(frozen=True)
class Sliding:
    """The layer of each element along its faces, and how it vibrates there."""

    # (n,) tangential stiffness at rest [N/m], friction coefficient
    stiffness: np.ndarray
    mu: np.ndarray
    # (n, tangents) friction force at rest [N]
    start: np.ndarray
    # (n, tangents, S) displacement over a period [m]
    motion: np.ndarray


def decay_lengths(
    elements: Elements,
    maps: Sequence[PressureMap],
    contact: Contact,
) -> np.ndarray:
    """(n,) length [m] over which the stiffness of the layer grows by e, of each element of
    ``friction_elements``; infinite where it is linear or the normal load prescribed.
    """
    decay = np.full(len(elements.kn), np.inf)
    if contact.stiffness == "rigid":
        return decay
    doubling = np.concatenate(
        [
            doubling_force(
                seat_contact(contact, m.patch.name),
                np.bincount(aggregation_matrix(m.patch, contact.points).indices, m.patch.area),
            )
            for m in maps
        ]
    )
    # the tangent is (doubling + force) / decay
    force = np.maximum(elements.n0, 0.0)
    np.divide(doubling + force, elements.kn, out=decay, where=elements.kn > 0)
    return decay


def equivalent_springs(state: LayerState) -> EquivalentSprings:
    """The linear springs closest to the law in this motion; those of a linear layer, and of
    elements that never press, stay as they are.
    """
    stiffness = np.array(state.stiffness, dtype=float)
    load = np.array(state.rest, dtype=float)
    growth = np.ones(len(load))
    carried = np.maximum(load[:, None] + stiffness[:, None] * state.motion, 0.0)
    force, tangents = carried.copy(), np.ones_like(carried)
    chosen = np.flatnonzero(np.isfinite(state.decay) & (state.mean > 0))
    if not len(chosen):
        return EquivalentSprings(stiffness, load, growth, force, carried, tangents)
    decay, mean = state.decay[chosen, None], state.mean[chosen, None]
    tangent, rest = stiffness[chosen, None], load[chosen, None]
    # above zero where the layer of almost no first touch is known to rounding only
    doubling = np.maximum(decay * tangent - np.maximum(rest, 0.0), SMALLEST_TOUCH * decay * tangent)
    law = InterfaceLaw(doubling / decay, doubling)
    swing = state.motion[chosen] - state.motion[chosen].mean(axis=1, keepdims=True)
    closure = _mean_closure(law, swing, mean)
    fitted, threshold = _fitted(law, closure, swing, mean, decay)
    closure_at_rest = np.where(
        rest > 0, decay * np.log1p(np.maximum(rest, 0.0) / doubling), rest / tangent
    )
    moved = closure - closure_at_rest
    stiffness[chosen] = fitted[:, 0]
    load[chosen] = (-fitted * (threshold + moved))[:, 0]
    growth[chosen] = (stiffness_at(law, mean) / tangent)[:, 0]
    force[chosen] = force_of(law, closure + swing)
    carried[chosen] = fitted * np.maximum(swing - threshold, 0.0)
    tangents[chosen] = stiffness_at(law, force[chosen]) / tangent
    return EquivalentSprings(stiffness, load, growth, force, carried, tangents)


def tangential_growth(springs: EquivalentSprings, sliding: Sliding) -> np.ndarray:
    """(n,) tangential stiffness over that at rest with which the friction of the springs is closest
    to that of the law, whose stiffness follows its pressure at each instant.
    """
    growth = TRIED_GROWTHS[:, None] * springs.growth
    constant = np.broadcast_to(growth[..., None], (*growth.shape, springs.force.shape[1]))
    left = _friction(springs.carried, constant, sliding)
    left -= _friction(springs.force, springs.tangent[None], sliding)
    # a constant part is no vibration
    left -= left.mean(axis=-1, keepdims=True)
    best = np.argmin((left**2).sum(axis=(-2, -1)), axis=0)
    moves = np.ptp(sliding.motion, axis=2).max(axis=1) > 0
    return np.where(moves, growth[best, np.arange(len(best))], springs.growth)


def _friction(normal: np.ndarray, growth: np.ndarray, sliding: Sliding) -> np.ndarray:
    """(layers, n, tangents, S) friction force [N] over the last of some periods, by a return map.

    Args:
        normal: (n, S) force [N].
        growth: (layers, n, S) tangential stiffness over that at rest.
    """
    instants = normal.shape[1]
    out = np.zeros((len(growth), *sliding.motion.shape))
    force = np.broadcast_to(sliding.start, out.shape[:-1])
    limit = sliding.mu[:, None] * normal
    stiffness = sliding.stiffness[:, None] * growth
    moved = sliding.motion - np.roll(sliding.motion, 1, axis=2)
    for i in range(FRICTION_PERIODS * instants):
        k = i % instants
        force = force + stiffness[..., k, None] * moved[..., k]
        size = np.maximum(np.linalg.norm(force, axis=-1), TINY)
        force = force * np.minimum(1.0, limit[:, k] / size)[..., None]
        out[..., k] = force
    return out


def _mean_closure(law: InterfaceLaw, swing: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """(n, 1) mean closure [m] at which the law presses with this mean force."""
    low = -swing.max(axis=1, keepdims=True)
    high = law.doubling / law.stiffness * np.log1p(mean / law.doubling)
    high = high - swing.min(axis=1, keepdims=True)

    # forces beyond the largest number are too large in any case
    def too_closed(closure: np.ndarray) -> np.ndarray:
        with np.errstate(over="ignore"):
            return force_of(law, closure + swing).mean(axis=1, keepdims=True) > mean

    return _root(too_closed, low, high)


def _fitted(
    law: InterfaceLaw,
    closure: np.ndarray,
    swing: np.ndarray,
    mean: np.ndarray,
    decay: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness (n, 1) [N/m] and threshold (n, 1) [m] of springs k max(swing - threshold, 0) with
    the mean force of the law and its work on the swing.
    """
    square = (swing**2).mean(axis=1, keepdims=True)
    still = square < (STILL_SHARE * decay) ** 2
    swing = np.where(still, 0.0, swing)
    work = (force_of(law, closure + swing) * swing).mean(axis=1, keepdims=True)
    slope = np.where(still, stiffness_at(law, mean), work / np.where(still, 1.0, square))
    # of a spring that stays closed
    closed = -mean / slope
    top = swing.max(axis=1, keepdims=True)

    def too_open(threshold: np.ndarray) -> np.ndarray:
        pressed = np.maximum(swing - threshold, 0.0)
        own = (pressed * swing).mean(axis=1, keepdims=True)
        return own * mean > work * pressed.mean(axis=1, keepdims=True)

    lifts = closed > swing.min(axis=1, keepdims=True)
    threshold = np.where(lifts, _root(too_open, np.minimum(closed, top), top), closed)
    pressed = np.maximum(swing - threshold, 0.0).mean(axis=1, keepdims=True)
    return mean / pressed, threshold


def _root(
    above: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Values at which a condition turns true between two ends, in their shape, by halving."""
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        beyond = above(middle)
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return low

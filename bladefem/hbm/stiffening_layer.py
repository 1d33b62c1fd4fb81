"""Contact forces at the end of a step in time of a layer that stiffens with its pressure.

The law is that of `bladefem.contact.interface_law`, f(c) = F (exp(c / s) - 1) for a closure c above
zero, and the layer is as much stiffer along its faces as it is across them, at each instant. In a
step each node takes the tangent of the law at a force that is guessed, the forces are found as
those of linear springs (`bladefem.hbm.step_forces`), and the tangents are taken anew there until
these are forces of the law: Newton's method, which a force that rises makes in the closure for a
force and one that falls in the force for a closure, so that it overshoots neither way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..errors import InputError
from ..friction.simd.node_steps import KN, KT
from ..util.numba_options import INNER_KERNEL, KERNEL
from .linear.array_copy import copy_vector
from .model import ReducedModel
from .ring_contacts import in_places, places_of_nodes
from .step_forces import add_parabola, largest_force, note_forces, note_start, settled_forces

# most times that tangents are taken in a step, and from which one on half of the way to the next is
# gone
TANGENTS = 60
DAMPED_FROM = 12
# where forces on tangents are not found: those at so much of the forces, and times the change that
# counts as none
SOFTER = 0.3
LOOSER = 2.0
# over the largest force: what a force may miss of the law, and change that counts as none of forces
# on the tangents
OFF_THE_LAW = 1e-4
SETTLED = 1e-5
# of the stiffness at rest: force over decay length that first touch has at least
SMALLEST_TOUCH = 1e-9
# exponent of the law beyond which a force is too large in any case
LARGEST_EXPONENT = 50.0
# operations of the tangent of a node
TANGENT_OPERATIONS = 60.0


class RingLayer(NamedTuple):
    """The layer of a blade, in places (width,) of `bladefem.hbm.ring_contacts`."""

    # length over which the stiffness grows by e [m]; infinite: linear, and where no node is
    decay: np.ndarray
    # force at which the stiffness is twice that at first touch [N]
    doubling: np.ndarray
    # force at rest [N], and closure [m], below zero where there is a gap
    rest: np.ndarray
    closure: np.ndarray
    # tangential stiffness at first touch [N/m]
    tangential: np.ndarray
    # (2, width) compliance across and along the faces that the bodies' flexibility has [m/N]
    series: np.ndarray
    # largest normal force in a march of all blades [N], changed by its steps
    reached: np.ndarray


def ring_layer(model: ReducedModel) -> RingLayer | None:
    """The stiffening layer of a model; None where it is linear.

    Raises:
        InputError: a part of the normal load is prescribed.
    """
    decay = model.decay
    if decay is None or not np.isfinite(decay).any():
        return None
    if model.normal:
        raise InputError("a prescribed normal load on a layer that stiffens, expected none")
    e = model.elements
    stiffens = np.isfinite(decay)
    series = np.zeros((len(decay), 2)) if model.series is None else model.series[:, :2]
    # elements and what of the layer's compliance the bodies have are in series
    compliance = 1.0 / np.column_stack([e.kn, e.kt]) + series
    kn, kt = 1.0 / np.where(stiffens[:, None], compliance, 1.0).T
    length = np.where(stiffens, decay, 1.0)
    rest = np.maximum(e.n0, 0.0)
    doubling = np.maximum(length * kn - rest, SMALLEST_TOUCH * length * kn)
    # the gap of an open element is that of its own spring
    closure = np.where(e.n0 > 0, length * np.log1p(rest / doubling), e.n0 / e.kn)
    places = places_of_nodes(len(decay))
    return RingLayer(
        in_places(np.where(stiffens, decay, np.inf), places, np.inf),
        in_places(doubling, places),
        in_places(rest, places),
        in_places(closure, places),
        in_places(kt * doubling / (doubling + rest), places),
        in_places(np.ascontiguousarray(series.T), places),
        in_places(rest, places),
    )


def reached_springs(model: ReducedModel, layer: RingLayer) -> np.ndarray:
    """(n, 3) normal and tangential stiffness of the contacts [N/m] at the largest forces that a
    march had.
    """
    e = model.elements
    places = places_of_nodes(len(e.kt))
    springs = np.column_stack([e.kn, e.kt, e.kt])
    for place in np.flatnonzero((places >= 0) & np.isfinite(layer.decay)):
        kn, kt = _tangent_springs(layer, place, layer.reached[place])
        springs[places[place]] = kn, kt, kt
    return springs


@njit(_nrt=False, **KERNEL)
def stiffening_forces(c, contacts, layer, kept, w, f, change, extra, load0, load1, work, room):
    """As `bladefem.hbm.step_forces.contact_forces`, by the law of a layer (`RingLayer`); the tables
    of the contacts become its tangents.
    """
    note_start(f, w, room)
    largest = largest_force(contacts.preload, f)
    add_parabola(change.reshape(2, f.size), f.reshape(f.size))
    tangent_at, loads = room.tangents, room.loads
    for b in range(len(f)):
        for i in range(len(load0[b])):
            tangent_at[b, i] = max(f[b, 0, i], 0.0)
            loads[0, b, i], loads[1, b, i] = load0[b, i], load1[b, i]
    found = False
    settled = SETTLED
    for turn in range(TANGENTS):
        for b in range(len(w)):
            start = room.forces[b], room.displacements[b]
            table = contacts.table[b]
            _take_tangents(layer, tangent_at[b], *start, table, loads[0, b], loads[1, b])
        work[0] += TANGENT_OPERATIONS * tangent_at.size
        limit = settled * largest
        if not settled_forces(c, contacts, kept, w, f, loads[0], loads[1], limit, work, room):
            # springs too stiff for their forces to be found: softer ones, and less exactly
            copy_vector(room.forces.reshape(f.size), f.reshape(f.size))
            for b in range(len(f)):
                for i in range(len(load0[b])):
                    tangent_at[b, i] *= SOFTER
            settled = min(settled * LOOSER, OFF_THE_LAW)
            continue
        # an impact raises all forces far above those before
        largest = max(largest, largest_force(contacts.preload, f))
        off = 0.0
        share = 1.0 if turn < DAMPED_FROM else 0.5
        for b in range(len(w)):
            off = max(off, _off_the_law(layer, w[b], f[b, 0], share, tangent_at[b]))
        if off <= OFF_THE_LAW * largest:
            found = True
            break
    note_forces(contacts.preload, f, change, extra, room)
    for b in range(len(f)):
        for i in range(len(layer.reached)):
            layer.reached[i] = max(layer.reached[i], f[b, 0, i])
    return found


@njit(_nrt=False, **INNER_KERNEL)
def _take_tangents(layer, at, f_before, w_before, table, load0, load1):
    """Stiffnesses (3, width) of the table, and loads (width,) at zero displacement before and after
    the step, become those of tangents of the law at forces (width,).

    Args:
        f_before: (3, width) forces and w_before: (3 width,) displacements before the step.
    """
    for i in range(len(at)):
        if not np.isfinite(layer.decay[i]):
            continue
        stiffness = (layer.doubling[i] + at[i]) / layer.decay[i]
        closure = layer.decay[i] * np.log1p(at[i] / layer.doubling[i])
        across = layer.series[0, i]
        # f = at + stiffness (closure at rest + w + across (f - rest) - closure)
        moved = layer.closure[i] - across * layer.rest[i] - closure
        load1[i] = (at[i] + stiffness * moved) / (1.0 - stiffness * across)
        kn, kt = _tangent_springs(layer, i, at[i])
        table[KN, i] = kn
        table[KT, i] = kt
        normal = f_before[0, i]
        if normal <= 0.0:
            normal = min(load1[i] + kn * w_before[i], 0.0)
        load0[i] = normal - kn * w_before[i]


@njit(_nrt=False, **KERNEL)
def _tangent_springs(layer, i, force):
    """Normal and tangential stiffness of the element in place i at a normal force, less the
    compliance that the bodies have.
    """
    growth = 1.0 + force / layer.doubling[i]
    normal = growth * layer.doubling[i] / layer.decay[i]
    tangential = growth * layer.tangential[i]
    normal /= 1.0 - normal * layer.series[0, i]
    return normal, tangential / (1.0 - tangential * layer.series[1, i])


@njit(_nrt=False, **INNER_KERNEL)
def _off_the_law(layer, w, f, share, at):
    """How far the forces (width,) on the tangents are from the law at most [N]; the next tangents
    are to be taken at forces ``at`` (width,), changed by a share of the way there.
    """
    most = 0.0
    for i in range(len(f)):
        if not np.isfinite(layer.decay[i]):
            continue
        closure = layer.closure[i] + w[i] + layer.series[0, i] * (f[i] - layer.rest[i])
        by_law = 0.0
        if closure > 0.0:
            exponent = min(closure / layer.decay[i], LARGEST_EXPONENT)
            by_law = layer.doubling[i] * np.expm1(exponent)
        most = max(most, abs(by_law - f[i]))
        at[i] += share * ((f[i] if f[i] > at[i] else by_law) - at[i])
    return most

"""The steps of a march of a ring of blades, in one compiled call.

In a step the bodies move as modes do under forces that are linear in it, or constant
(`bladefem.hbm.linearised_flow.linear_steps`); the contacts give the forces at its end
(`bladefem.hbm.step_forces`, `bladefem.hbm.stiffening_layer`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..util.numba_options import INNER_KERNEL, KERNEL
from .blade_forces import BladeFactors
from .linear.array_copy import clear_vector, copy_vector
from .ring_contacts import RingContacts
from .ring_readings import ReadingRoom, RingReadings, push, read, reading_room
from .step_forces import StepRoom, contact_forces, inner_product, less_preload, step_room
from .stiffening_layer import stiffening_forces


class StepTerms(NamedTuple):
    """A matrix as terms with one entry of each row: few, unless the damping couples the modes."""

    # (terms, rows)
    columns: np.ndarray
    values: np.ndarray


def step_terms(matrix: np.ndarray) -> StepTerms:
    """Of a matrix."""
    used = matrix != 0
    terms = max(1, int(used.sum(axis=1).max()))
    # entries of each row first
    columns = np.argsort(~used, axis=1, kind="stable")[:, :terms]
    values = np.take_along_axis(matrix, columns, axis=1)
    return StepTerms(columns.T.copy(), values.T.copy())


class MarchRoom(NamedTuple):
    """What the steps of a march fill anew, kept so that none makes arrays."""

    # of the contacts (`bladefem.hbm.step_forces`), and of readings (`bladefem.hbm.ring_readings`)
    step: StepRoom
    reading: ReadingRoom
    # (M,) modal forces, (2 M,) modal displacements and velocities after the step
    modal: np.ndarray
    moved: np.ndarray
    # (r, 3 width) contact forces beyond the preload, and displacements without them
    extra: np.ndarray
    free: np.ndarray
    # (2, r, 3, width) changes of the forces in the last steps
    change: np.ndarray


def march_room(readings: RingReadings, blades: int, width: int) -> MarchRoom:
    """Of r blades with nodes in rows of ``width``."""
    M = len(readings.by_mode)
    rows = blades, 3 * width
    return MarchRoom(
        step_room(blades, width),
        reading_room(readings),
        modal=np.zeros(M),
        moved=np.zeros(2 * M),
        extra=np.zeros(rows),
        free=np.zeros(rows),
        change=np.zeros((2, blades, 3, width)),
    )


class Ring(NamedTuple):
    """Blades and contacts at S instants a period, in places (width,) of
    `bladefem.hbm.ring_contacts`.
    """

    # (r, 3 width) relative displacements, changed by the steps
    displacements: np.ndarray
    # of `linear_steps`: of the state, and for contact forces in the modes before and after a step
    flow: StepTerms
    before: StepTerms
    after: StepTerms
    # of the contacts; their flexibility is that for the forces after a step
    readings: RingReadings
    contacts: RingContacts
    # from step to step, changed
    kept: BladeFactors
    # (S, r, width) normal load at zero displacement
    load: np.ndarray
    # (S, r, 3 width) motion without contact forces
    free: np.ndarray
    # of the probe of each blade: readings (r, M), flexibility (r, r 3 width), and motion without
    # contact forces (S, r)
    probe: np.ndarray
    probe_flexibility: np.ndarray
    probe_free: np.ndarray
    room: MarchRoom


@njit(_nrt=False, **KERNEL)
def march_steps(y, f, ring, layer, motion, friction_work, work):
    """Fill motion (periods, S, r), and friction_work (periods,) of all blades, step by step.

    Args:
        y: (2M,) modal displacements and velocities, changed.
        f: (r, 3, width) contact forces, changed.
        layer: that stiffens; None: linear, on its own since this decides what is compiled.
        work: (1,) takes the operations of the contact forces.

    Returns:
        the number of the step whose forces were not found; periods S where all were.
    """
    w, contacts, readings, room = ring.displacements, ring.contacts, ring.readings, ring.room
    moved, modal, c, extra = room.moved, room.modal, room.free, room.extra
    periods, S, _ = motion.shape
    for b in range(len(w)):
        less_preload(f[b].reshape(extra.shape[1]), contacts.preload, extra[b])
    clear_vector(room.change.reshape(room.change.size))
    push(readings, extra, modal, room.reading)
    for k in range(periods * S):
        for b in range(len(ring.probe)):
            seen = inner_product(ring.probe[b], y)
            given = inner_product(ring.probe_flexibility[b], extra.reshape(extra.size))
            motion[k // S, k % S, b] = ring.probe_free[k % S, b] + seen - given
        j = (k + 1) % S
        clear_vector(moved)
        _add_product(ring.flow, y, moved)
        _add_product(ring.before, modal, moved)
        read(readings, moved, c, room.reading)
        for b in range(len(c)):
            for place in range(c.shape[1]):
                c[b, place] += ring.free[j, b, place]
        forces = w, f, room.change, extra, ring.load[k % S], ring.load[j], work, room.step
        if layer is None:
            found = contact_forces(c, contacts, ring.kept, *forces)
        else:
            found = stiffening_forces(c, contacts, layer, ring.kept, *forces)
        if not found:
            return k
        friction_work[k // S] += _work_of_step(room.step.forces, room.step.displacements, f, w)
        push(readings, extra, modal, room.reading)
        _add_product(ring.after, modal, moved)
        copy_vector(moved, y)
    return periods * S


@njit(_nrt=False, **INNER_KERNEL)
def _work_of_step(f_before, w_before, f, w):
    """Work of the tangential forces (r, 3, width) on displacements (r, 3 width) in a step, by the
    trapezoidal rule [J].
    """
    total = 0.0
    width = f.shape[2]
    for b in range(len(f)):
        for d in range(1, 3):
            for k in range(width):
                moved = w[b, d * width + k] - w_before[b, d * width + k]
                total += 0.5 * (f_before[b, d, k] + f[b, d, k]) * moved
    return total


@njit(_nrt=False, **INNER_KERNEL)
def _add_product(terms, x, target):
    """target (n,) becomes target plus the matrix (n, k) times x (k,)."""
    for term in range(len(terms.columns)):
        for i in range(len(target)):
            target[i] += terms.values[term, i] * x[terms.columns[term, i]]

"""Stress of an aerofoil of another shape on its own mesh.

The wheel tells how the blade-alone modes and the root of that blade move, y and r in the tuned
coordinates. On its own mesh it moves as Phi' T^-1 y + Psi' r: its own modes held at the root, and
the static motions that follow it (`other_blades`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...util.arrays import ComplexArray, RealArray
from .other_blades import by_tuned_modes

if TYPE_CHECKING:
    from ...fem.held_part import HeldPart


@dataclass(frozen=True)
class OwnStress:
    """Alternating stress of one aerofoil over a period; n nodes of it."""

    # largest von Mises stress [Pa], its place (3,) [m], and the estimated relative error by the
    # mesh there
    largest: float
    place: RealArray
    mesh_error: float
    # (n, 3) [m] and (n,) [Pa]
    points: RealArray
    field: RealArray


def own_motion(tuned: HeldPart, other: HeldPart, coordinates: ComplexArray) -> ComplexArray:
    """(H, n, 3) displacements of the other aerofoil's nodes [m].

    Args:
        coordinates: (H, q + p) readings of the blade in harmonics 1..H.
    """
    q = len(tuned.omega)
    T, _ = by_tuned_modes(tuned, other)
    modal = np.linalg.solve(T, coordinates[:, :q].T).T
    moving: ComplexArray = np.einsum("hq,qni->hni", modal, other.shapes)
    return moving + np.einsum("hp,pni->hni", coordinates[:, q:], other.static)


def own_stress(tuned: HeldPart, other: HeldPart, coordinates: ComplexArray) -> OwnStress:
    """The stress of `own_motion`, which has the arguments."""
    from ...fem.alternating_stress import alternating_stress

    fields = other.on_mesh(own_motion(tuned, other, coordinates))
    found = alternating_stress(other.body, fields)
    return OwnStress(
        found.largest, found.place, found.mesh_error, other.points, found.field[other.numbers]
    )

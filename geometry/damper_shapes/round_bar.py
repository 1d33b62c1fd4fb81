"""A round bar worn flat on both sides: the circle through the ends of both flanks.

A bar that is not worn yet touches along a line of each seat: give contact.crown_across its radius,
and the seats open on both sides of that line.
"""

from __future__ import annotations

from math import ceil, pi

import numpy as np

from bladefem.errors import InputError

from .record import DamperShape

# of the circle [rad]: each side of the polygon that is drawn for it
POLYGON_ANGLE = pi / 9
# of the seat's width: the ends of both flanks lie on one circle to this accuracy
ROUNDNESS_TOLERANCE = 1e-6


def bar_outline(flanks: np.ndarray, base: float) -> np.ndarray:
    """Both flanks, and arcs between their outer and their inner ends.

    Raises:
        InputError: flanks that no circle fits, since their angles or widths differ.
    """
    (inner, outer), (inner_next, outer_next) = flanks
    centre = _centre_between(inner, outer)
    radius = float(np.linalg.norm(outer - centre))
    other = np.linalg.norm(flanks[1] - centre, axis=1)
    if np.abs(other - radius).max() > ROUNDNESS_TOLERANCE * np.linalg.norm(outer - inner):
        raise InputError(
            "damper.shape = 'round bar': no circle fits between these seats, expected one angle "
            "and width on both sides"
        )
    top = _arc_points(centre, radius, outer, outer_next)
    bottom = _arc_points(centre, radius, inner_next, inner)
    return np.vstack([inner, outer, top, outer_next, inner_next, bottom])


def _centre_between(inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """The point midway between the blades that is as far from one end as from the other."""
    radial = (outer @ outer - inner @ inner) / (2 * (outer[0] - inner[0]))
    return np.array([radial, 0.0])


def _arc_points(
    centre: np.ndarray,
    radius: float,
    start: np.ndarray,
    end: np.ndarray,
) -> np.ndarray:
    """Points (m, 2) of the circle between two of its points, in the sense of a bar's outline."""
    first = np.arctan2(*(start - centre)[::-1])
    last = np.arctan2(*(end - centre)[::-1])
    # across = 0 is passed once: the outline turns from negative to positive across at the top
    turn = (last - first) % (2 * pi)
    angles = first + np.linspace(0, turn, max(2, ceil(turn / POLYGON_ANGLE) + 1))[1:-1]
    return centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])


SHAPE = DamperShape("round bar", bar_outline)

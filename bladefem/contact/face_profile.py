"""Seats that are not flat: crowned faces and eased edges, as the gap that they leave before
anything presses.

A crown of radius R leaves s^2 / (2 R) at the distance s from the middle of the seat; an eased edge
leaves (b - e)^2 / (2 r) at the distance e < b from the edge, r its radius and b the width of its
strip. Both are parabolas in place of circles, as in Hertz' theory: heights are small compared with
the radii.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import Mesh

from ..data import Patch
from ..errors import InputError
from ..scene.limits import unless_at_least
from ..scene.tables import Contact
from ..scene.units import show
from .patch import patch_means

# width of the eased strip over the element size, at least
MIN_STRIP_OVER_ELEMENT_SIZE = 1.0


def seat_gap(
    patch: Patch,
    mesh: Mesh,
    contact: Contact,
) -> np.ndarray:
    """(n,) gap [m] of a seat with the crowns and edges of [contact], means over what each node
    represents.

    Distances count from the middle and the edges of the rectangle round the seat, along its t1 (the
    slope) and t2 (the engine axis).

    Raises:
        InputError: the eased strip is narrower than the elements, or a crown's radius than half of
            the seat.
    """
    means = patch_means(patch, mesh)
    own = np.unique(means.nonzero()[0])
    axes = patch.frame.mean(axis=0)[1 : mesh.dimension]
    s = mesh.points @ axes.T
    low = s[own].min(axis=0)
    high = s[own].max(axis=0)
    s = s - (low + high) / 2
    gap = np.zeros(len(s))
    for k, name in enumerate(("crown_across", "crown")[: len(axes)]):
        radius = getattr(contact, name)
        if radius is not None:
            _check_crown(name, radius, float(high[k] - low[k]))
            gap += s[:, k] ** 2 / (2 * radius)
    if contact.edge_radius is not None and contact.edge_width is not None:
        _check_width(patch, mesh, contact.edge_width)
        beyond = np.clip(
            np.abs(s) - ((high - low) / 2 - contact.edge_width), 0.0, contact.edge_width
        )
        gap += (beyond**2).sum(axis=1) / (2 * contact.edge_radius)
    return means.T @ gap


def _check_crown(
    name: str,
    radius: float,
    length: float,
) -> None:
    """No circle of a smaller radius reaches from end to end."""
    if expected := unless_at_least(radius, length / 2, digits=3):
        raise InputError(
            f"contact.{name} = {show(radius, 'm')}: a circle that cannot span the seat of "
            f"{show(length, 'm', 3)}, expected a radius of {expected}"
        )


def _check_width(
    patch: Patch,
    mesh: Mesh,
    width: float,
) -> None:
    """A strip that falls between two nodes would be felt at random."""
    narrowest = MIN_STRIP_OVER_ELEMENT_SIZE * element_size(patch, mesh.depth)
    if expected := unless_at_least(width, narrowest, digits=2):
        raise InputError(
            f"contact.edge_width = {show(width, 'm')}: narrower than the elements of the seats, "
            f"expected {expected}, or a smaller mesh.contact_size"
        )


def element_size(patch: Patch, depth: float) -> float:
    """Typical distance of its nodes [m]."""
    size = float(np.median(patch.area))
    return size / depth if patch.faces.shape[1] == 2 else size**0.5

"""Seats that are not flat: crowned faces and eased edges, as the gap that they leave before anything presses.

A crown of radius R leaves s^2 / (2 R) at the distance s from the middle of the seat; an eased edge leaves
(b - e)^2 / (2 r) at the distance e < b from the edge, r its radius and b the width of its strip. Both are parabolas in
place of circles, as in Hertz' theory: heights are small beside the radii.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from geometry.mesh import Mesh

from ..data import Patch, PressureMap
from ..errors import InputError
from ..scene import Contact, Scene
from ..units import show
from .hertz import FINEST, contact_modulus, line_width, point_radius
from .patch import patch_means

__all__ = ["seat_gap", "unresolved_crown"]

RESOLVED = 1.0          # width of the eased strip over the element size, at least
WANTED = 4.0            # half width of a crown's contact over the element size that is advised


def seat_gap(patch: Patch, mesh: Mesh, contact: Contact) -> np.ndarray:
    """(n,) gap [m] of a seat with the crowns and edges of [contact], means over what each node stands for.

    Distances count from the middle and the edges of the rectangle round the seat, along its t1 (the slope) and t2 (the
    engine axis).

    Raises:
        InputError: the eased strip is narrower than the elements, or a crown's radius than half of the seat.
    """
    means = patch_means(patch, mesh)
    own = np.unique(means.nonzero()[0])
    axes = patch.frame.mean(axis=0)[1:mesh.dimension]
    s = (mesh.points @ axes.T)
    low, high = s[own].min(axis=0), s[own].max(axis=0)
    s = s - (low + high) / 2
    gap = np.zeros(len(s))
    for k, name in enumerate(("crown_across", "crown")[:len(axes)]):
        radius = getattr(contact, name)
        if radius is not None:
            _check_crown(name, radius, float(high[k] - low[k]))
            gap += s[:, k]**2 / (2 * radius)
    if contact.edge_radius is not None and contact.edge_width is not None:
        _check_width(patch, mesh, contact.edge_width)
        beyond = np.clip(np.abs(s) - ((high - low) / 2 - contact.edge_width), 0.0, contact.edge_width)
        gap += (beyond**2).sum(axis=1) / (2 * contact.edge_radius)
    return means.T @ gap


def unresolved_crown(maps: Mapping[float, Sequence[PressureMap]], scene: Scene, depth: float = 1.0) -> str:
    """A warning where Hertz' contact of a crowned seat is too narrow for its elements to give the peak pressure.

    Args:
        maps: mean normal load of a seat [N] to the maps of its patches.
        depth: of a plane mesh [m], 1 for solids.

    Returns:
        a sentence about the narrowest contact, or "" where seats are flat, bedded, or finely meshed.
    """
    contact, modulus = scene.contact, contact_modulus(scene.material.blade, scene.material.damper)
    if contact.bedded or not maps:
        return ""
    load = min(maps)
    worst, size = min(((_half_width(m, contact, modulus, depth), _element_size(m.patch, depth)) for m in maps[load]),
                      key=lambda found: found[0] / found[1])
    if worst >= FINEST * size:
        return ""
    wanted = float(f"{worst / WANTED:.2g}")
    return (f"peak pressure not resolved: under {show(load, 'N')} Hertz' contact on the crowned seats has a half width "
            f"of {show(float(f'{worst:.2g}'), 'm')}, their elements have {show(float(f'{size:.2g}'), 'm')}; expected "
            f"mesh.contact_size <= {show(wanted, 'm')}, or a larger crown radius")


def _half_width(pressure: PressureMap, contact: Contact, modulus: float, depth: float) -> float:
    """Smaller half width of Hertz' contact [m]; infinite where no crown leaves a part of the seat open.

    A line across the whole seat or an ellipse that ends before its edges, whichever is wider; Johnson (1985),
    Eq. 4.28, gives the ratio of the ellipse's axes to a few per cent.
    """
    load, plane = float(pressure.force.sum()), pressure.patch.faces.shape[1] == 2
    axes = pressure.patch.frame.mean(axis=0)[1:2 if plane else 3]
    lengths = [*np.ptp(pressure.patch.points @ axes.T, axis=0), *([depth] if plane else [])]
    radii = [contact.crown_across, None if plane else contact.crown]
    widths = []
    for radius, length, other in zip(radii, lengths, lengths[::-1], strict=True):
        if radius is not None:
            width = line_width(load / other, radius, modulus)
            if None not in radii:
                width = max(width, point_radius(load, np.prod(radii)**0.5, modulus) * (radius / max(radii))**(1 / 3))
            widths.append(width if width < length / 2 else np.inf)
    return min(widths, default=np.inf)


def _check_crown(name: str, radius: float, length: float) -> None:
    """No circle of a smaller radius reaches from end to end."""
    if radius < length / 2:
        raise InputError(f"contact.{name} = {show(radius, 'm')}: a circle that cannot span the seat of "
                         f"{show(float(f'{length:.3g}'), 'm')}, expected a radius above half of that")


def _check_width(patch: Patch, mesh: Mesh, width: float) -> None:
    """A strip that falls between two nodes would be felt at random."""
    size = _element_size(patch, mesh.depth)
    if width < RESOLVED * size:
        raise InputError(f"contact.edge_width = {show(width, 'm')}: narrower than the elements of the seats, expected "
                         f"at least {show(float(f'{RESOLVED * size:.2g}'), 'm')}, or a smaller mesh.contact_size")


def _element_size(patch: Patch, depth: float) -> float:
    """Typical distance of its nodes [m]."""
    size = float(np.median(patch.area))
    return size / depth if patch.faces.shape[1] == 2 else size**0.5

"""Can the largest pressure of a map be believed? Not where its place is narrower than the elements,
or a sharp edge.

Forces and mean pressures are those of the whole seat and far less sensitive. On the shipped wedge,
bedded and under 80 N, the peak stands at the inner edge and grows from 0.88 over 1.07, 1.31, 1.49
to 1.76 MPa as the elements shrink from 3 over 2, 1.5, 1 to 0.75 mm, like the pressure under the
edge of a flat punch; the pressed share of the seat is 76, 64, 67, 64, 63 %.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..data import Patch, PressureMap
from ..scene.tables import Contact, Scene
from ..scene.units import show
from .face_profile import element_size
from .hertz import FINEST, contact_modulus, line_width, point_radius

__all__ = ["at_edge", "edge_sentence", "narrow_sentence", "peak_remarks"]

# half width of a crown's contact over the element size that is advised
WANTED = 4.0

# mean normal load of a seat [N] to the maps of its patches
Maps = Mapping[float, Sequence[PressureMap]]


def peak_remarks(maps: Maps, scene: Scene, depth: float = 1.0) -> list[str]:
    """Why peak pressures are not to be relied on; empty where nothing is known against them.

    Args:
        depth: of a plane mesh [m], 1 for solids.
    """
    return [
        said
        for said in (narrow_sentence(maps, scene, depth), edge_sentence(maps, scene.contact))
        if said
    ]


def edge_sentence(maps: Maps, contact: Contact) -> str:
    """A warning where the peak stands at a sharp edge of a seat, or ""."""
    sharp = contact.bedded or contact.edge_radius is None
    there = [load for load, seats in maps.items() if any(at_edge(m) for m in seats)]
    if not sharp or not there:
        return ""
    return (
        f"peak pressure: under {len(there)} of {len(maps)} loads it stands at a sharp edge of a "
        "seat, where it may "
        "grow without bound as mesh.contact_size falls; judge by the mean pressure, or ease the "
        "edges "
        "(contact.edge_radius)"
    )


def at_edge(pressure: PressureMap) -> bool:
    """Whether the largest pressure is at the boundary of its patch."""
    return bool(pressure.force.any() and _boundary(pressure.patch)[np.argmax(pressure.pressure)])


def _boundary(patch: Patch) -> np.ndarray:
    """(n,) bool, nodes on sides that belong to one face only; the two ends of a plane seat."""
    faces = patch.faces
    k = patch.faces.shape[1]
    sides = (
        faces.reshape(-1, 1)
        if k == 2
        else np.concatenate([faces[:, [i, (i + 1) % k]] for i in range(k)])
    )
    sides, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    out = np.zeros(len(patch.area), bool)
    out[sides[count == 1]] = True
    return out


def narrow_sentence(maps: Maps, scene: Scene, depth: float = 1.0) -> str:
    """A warning where Hertz' contact of crowned seats is too narrow for their elements, or "".

    Args:
        depth: of a plane mesh [m], 1 for solids.
    """
    contact = scene.contact
    modulus = contact_modulus(scene.material.blade, scene.material.damper)
    if contact.bedded or not maps:
        return ""
    load = min(maps)
    worst, size = min(
        (
            (_half_width(m, contact, modulus, depth), element_size(m.patch, depth))
            for m in maps[load]
        ),
        key=lambda found: found[0] / found[1],
    )
    if worst >= FINEST * size:
        return ""
    wanted = float(f"{worst / WANTED:.2g}")
    return (
        f"peak pressure not resolved: under {show(load, 'N')} Hertz' contact on the crowned seats "
        "has a half width "
        f"of {show(float(f'{worst:.2g}'), 'm')}, their elements have "
        f"{show(float(f'{size:.2g}'), 'm')}; expected "
        f"mesh.contact_size <= {show(wanted, 'm')}, or a larger crown radius"
    )


def _half_width(pressure: PressureMap, contact: Contact, modulus: float, depth: float) -> float:
    """Smaller half width of Hertz' contact [m]; infinite where no crown leaves a part of the seat
    open.

    A line across the whole seat or an ellipse that ends before its edges, whichever is wider;
    Johnson (1985), Eq. 4.28, gives the ratio of the ellipse's axes to a few per cent.
    """
    load = float(pressure.force.sum())
    plane = pressure.patch.faces.shape[1] == 2
    axes = pressure.patch.frame.mean(axis=0)[1 : 2 if plane else 3]
    lengths = [*np.ptp(pressure.patch.points @ axes.T, axis=0), *([depth] if plane else [])]
    radii = [contact.crown_across, None if plane else contact.crown]
    widths = []
    for radius, length, other in zip(radii, lengths, lengths[::-1], strict=True):
        if radius is not None:
            width = line_width(load / other, radius, modulus)
            if None not in radii:
                width = max(
                    width,
                    point_radius(load, np.prod(radii) ** 0.5, modulus)
                    * (radius / max(radii)) ** (1 / 3),
                )
            widths.append(width if width < length / 2 else np.inf)
    return min(widths, default=np.inf)

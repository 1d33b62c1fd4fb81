"""Where the largest pressure of a map is not to be relied on: its place is narrower than the
elements, or stiff faces end in a sharp edge.

Forces and mean pressures are those of the whole seat and far less sensitive. Between rigid faces
the pressure of the shipped wedge, bedded and under 80 N, grows at the inner edge from 0.88 over
1.07, 1.31, 1.49 to 1.76 MPa as the elements shrink from 3 over 2, 1.5, 1 to 0.75 mm, like the
pressure under the edge of a flat punch. An interface layer bounds it: pressure then varies over the
length E* / kn, which elements resolve or not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..data import Patch, PressureMap
from ..scene.material_table import operating_materials
from ..scene.tables import Contact, Scene
from ..scene.units import show
from .face_profile import element_size
from .hertz import MIN_ELEMENTS_PER_RADIUS, contact_modulus, line_width, point_radius
from .interface_elements import interface_law, pair_ratio
from .interface_law import stiffness_at

# half width of a crown's contact over the element size that is advised
ADVISED_ELEMENTS_PER_HALF_WIDTH = 4.0
# elements in the length E* / kn from which the pressure at a sharp edge is resolved
EDGE_ELEMENTS = 4.0

# mean normal load of a seat [N] to the maps of its patches
Maps = Mapping[float, Sequence[PressureMap]]


def peak_remarks(
    maps: Maps,
    scene: Scene,
    depth: float = 1.0,
) -> list[str]:
    """Why peak pressures are not to be relied on; empty where nothing is known against them.

    Args:
        depth: of a plane mesh [m], 1 for solids.
    """
    return [
        said
        for said in (narrow_sentence(maps, scene, depth), edge_sentence(maps, scene, depth))
        if said
    ]


def edge_sentence(
    maps: Maps,
    scene: Scene,
    depth: float = 1.0,
) -> str:
    """A warning where the peak is at a sharp edge of a seat and its layer too stiff for the mesh,
    or "".
    """
    contact = scene.contact
    sharp = contact.bedded or contact.edge_radius is None
    there = [load for load, seats in maps.items() if any(at_edge(m) for m in seats)]
    if not sharp or not there:
        return ""
    modulus = contact_modulus(*operating_materials(scene))
    if all(
        modulus / areal_stiffness(m, scene) >= EDGE_ELEMENTS * element_size(m.patch, depth)
        for seats in maps.values()
        for m in seats
    ):
        return ""
    return (
        f"peak pressure: under {len(there)} of {len(maps)} loads it lies at a sharp edge of a "
        "seat, where it may grow without bound as mesh.contact_size falls; judge by the mean "
        "pressure, or ease the edges (contact.edge_radius)"
    )


def areal_stiffness(pressure: PressureMap, scene: Scene) -> float:
    """Largest normal stiffness of the interface layer [N/m^3]; infinite for rigid faces."""
    ratio = pair_ratio(*operating_materials(scene))
    law = interface_law([pressure.patch], scene.contact, ratio)
    return float((stiffness_at(law, pressure.force) / pressure.patch.area).max())


def at_edge(pressure: PressureMap) -> bool:
    """Whether the largest pressure is at the boundary of its patch."""
    return bool(
        pressure.force.any() and _boundary_nodes(pressure.patch)[np.argmax(pressure.pressure)]
    )


def _boundary_nodes(patch: Patch) -> np.ndarray:
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


def narrow_sentence(
    maps: Maps,
    scene: Scene,
    depth: float = 1.0,
) -> str:
    """A warning where Hertz' contact of crowned seats is too narrow for their elements, or "".

    Args:
        depth: of a plane mesh [m], 1 for solids.
    """
    contact = scene.contact
    modulus = contact_modulus(*operating_materials(scene))
    if contact.bedded or not maps:
        return ""
    load = min(maps)
    worst, size = min(
        (
            (
                max(
                    _half_width(m, contact, modulus, depth),
                    _layer_half_width(m, contact, areal_stiffness(m, scene), depth),
                ),
                element_size(m.patch, depth),
            )
            for m in maps[load]
        ),
        key=lambda found: found[0] / found[1],
    )
    if worst >= MIN_ELEMENTS_PER_RADIUS * size:
        return ""
    wanted = float(f"{worst / ADVISED_ELEMENTS_PER_HALF_WIDTH:.2g}")
    return (
        f"peak pressure not resolved: under {show(load, 'N')} Hertz' contact on the crowned seats "
        f"has a half width of {show(float(f'{worst:.2g}'), 'm')}, their elements have "
        f"{show(float(f'{size:.2g}'), 'm')}; expected mesh.contact_size <= {show(wanted, 'm')}, or "
        "a larger crown radius"
    )


def _layer_half_width(
    pressure: PressureMap,
    contact: Contact,
    stiffness: float,
    depth: float,
) -> float:
    """Smallest half width [m] of the contact of crowned rigid faces on the interface layer alone.

    Pressure kn (approach - x^2 / 2 R), whose integral is the load: of a line P / L = 2 kn a^3 /
    (3 R), of an ellipse P = pi kn approach^2 sqrt(R1 R2).

    Args:
        stiffness: of the layer [N/m^3].
    """
    load = float(pressure.force.sum())
    plane = pressure.patch.faces.shape[1] == 2
    radii = [r for r in (contact.crown_across, None if plane else contact.crown) if r is not None]
    if len(radii) == 2:
        approach = (load / (np.pi * stiffness * np.prod(radii) ** 0.5)) ** 0.5
        return float((2.0 * min(radii) * approach) ** 0.5)
    if not radii:
        return np.inf
    axes = pressure.patch.frame.mean(axis=0)[1 : 2 if plane else 3]
    lengths = [*np.ptp(pressure.patch.points @ axes.T, axis=0), *([depth] if plane else [])]
    length = lengths[1] if contact.crown_across is not None else lengths[0]
    return float((1.5 * load / length * radii[0] / stiffness) ** (1 / 3))


def _half_width(
    pressure: PressureMap,
    contact: Contact,
    modulus: float,
    depth: float,
) -> float:
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
    both = [radius for radius in radii if radius is not None]
    widths = []
    for radius, length, other in zip(radii, lengths, lengths[::-1], strict=True):
        if radius is not None:
            width = line_width(load / other, radius, modulus)
            if len(both) == 2:
                mean = float(np.prod(both)) ** 0.5
                ellipse = (radius / max(both)) ** (1 / 3)
                width = max(width, point_radius(load, mean, modulus) * ellipse)
            widths.append(width if width < length / 2 else np.inf)
    return min(widths, default=np.inf)

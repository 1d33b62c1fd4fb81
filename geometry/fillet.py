"""The radius of the fillet between aerofoil and platform where a scene leaves it open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .parameters import Aerofoil, Disc, MeshSize, Platform, Shank, Wedge
from .profile import Profile, sector_profile
from .section import section_outline

# radius over the thickness of the root section
OF_THICKNESS = 0.3
# of that radius: a platform that leaves less room keeps a sharp edge
LEAST = 0.3
# element size over the radius: larger elements cannot see a fillet, and would only be distorted
COARSEST = 2.0
# of the platform's thickness, between the root and the platform's edge: less leaves a sliver
EDGE = 0.1
# of the span
HIGHEST = 0.125


def with_fillet(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    size: MeshSize,
) -> Aerofoil:
    """The aerofoil with the radius of its fillet given.

    A radius that is left open is 0.3 times the thickness of the root section, or what the platform
    leaves room for; 0 where less than a third of that fits, and where elements of the size that is
    asked for are too large to see it. A factor ``mesh.scale`` changes nothing, so that meshes of
    one refinement study have one shape.

    Raises:
        InputError: the damper's shape does not fit between the seats.
    """
    if aerofoil.fillet is not None:
        return aerofoil
    wanted = min(
        OF_THICKNESS * aerofoil.thickness_root * aerofoil.chord_root,
        HIGHEST * aerofoil.span,
        _highest_radius(),
    )
    radius = _fitting_radius(
        aerofoil, platform, sector_profile(platform, shank, disc, wedge), wanted
    )
    if radius < LEAST * wanted or (size.size or 0.0) > COARSEST * radius:
        radius = 0.0
    return replace(aerofoil, fillet=radius)


def _fitting_radius(
    aerofoil: Aerofoil,
    platform: Platform,
    section: Profile,
    wanted: float,
) -> float:
    """The radius, as far as the platform has room for it [m].

    The outline of the root moves outwards in proportion to the radius, at the corners of a blunt
    trailing edge faster than by the radius itself.
    """
    sharp = platform_room(replace(aerofoil, fillet=0.0), platform, section)
    round_root = platform_room(replace(aerofoil, fillet=wanted), platform, section)
    shares = [
        before / (before - after)
        for before, after in zip(sharp, round_root, strict=True)
        if after < 0
    ]
    return wanted * max(min(shares, default=1.0), 0.0)


def platform_room(
    blade: Aerofoil,
    platform: Platform,
    section: Profile,
) -> tuple[float, float]:
    """Distances of the root section with its fillet from the edge of the platform, axially and
    circumferentially [m]; negative where it overhangs.
    """
    root = np.abs(section_outline(blade, section.top, 0.0, blade.fillet_radius)).max(axis=0)
    edge = EDGE * platform.thickness
    across = float(np.abs(section.corners[:, 1]).min())
    return platform.length / 2 - edge - root[2], across - edge - root[1]


def _highest_radius() -> float:
    """Upper end of the field's range [m]."""
    return float(Aerofoil.__dataclass_fields__["fillet"].metadata["high"])

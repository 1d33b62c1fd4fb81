"""All that a wedge sector is drawn from: its checked parts, and the outlines that follow from
them.
"""

from __future__ import annotations

from dataclasses import dataclass

from bladefem.util.arrays import RealArray

from .fillet import with_fillet
from .parameters import Aerofoil, Disc, MeshSize, Platform, Root, Shank, Shroud, Wedge
from .profile import Profile, sector_profile
from .root import root_slots
from .sector_check import check_sector
from .shroud import Block, shroud_block


@dataclass(frozen=True)
class SectorShape:
    """The parts of a sector that can be drawn."""

    # with the radius of its fillet given
    aerofoil: Aerofoil
    platform: Platform
    shank: Shank
    disc: Disc
    wedge: Wedge
    root: Root
    # cross-section of disc, shank, platform and damper
    profile: Profile
    # of the shroud; None without one
    block: Block | None
    # of the root, (n, 2) corners in the plane z = 0 each [m]
    slots: list[RealArray]


def sector_shape(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    size: MeshSize,
    root: Root,
    shroud: Shroud,
) -> SectorShape:
    """The shape of a sector from the tables of a scene; ``size`` decides on an open fillet.

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    check_sector(aerofoil, platform, shank, disc, wedge, root, shroud)
    aerofoil = with_fillet(aerofoil, platform, shank, disc, wedge, size)
    profile = sector_profile(platform, shank, disc, wedge)
    return SectorShape(
        aerofoil,
        platform,
        shank,
        disc,
        wedge,
        root,
        profile,
        shroud_block(shroud, aerofoil, disc, profile.top),
        root_slots(root, shank, disc),
    )

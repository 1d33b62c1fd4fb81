"""The widest seat that fits under a platform next to the shank."""

from __future__ import annotations

from math import cos, pi, sin, tan

from .parameters import Disc, Platform, Shank, Wedge

# of the platform's overhang: what a seat may take of it
SEAT_SHARE = 0.98


def widest_seat(
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
) -> float:
    """The largest platform.seat_width [m]; not positive where the platform does not overhang.

    A wider seat reaches further out, so that the overhang grows with it. Both are linear in the
    width: the seat spans w sin(slope) of the circumference, and the platform overhangs the shank by
    a part without seat and w cos(slope) tan(theta).
    """
    theta = pi / disc.sectors
    underside = disc.rim_radius + shank.height
    bare = underside * tan(theta) - platform.gap / 2 / cos(theta) - shank.width / 2
    slopes = [angle + theta for angle in wedge.angles]
    spanned = sin(max(slopes))
    return min(
        SEAT_SHARE * bare / (spanned - SEAT_SHARE * cos(slope) * tan(theta)) for slope in slopes
    )

"""The cross-section of a wedge sector as points: disc, shank, platform with inclined seats, and the
damper between.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, tan

import numpy as np

from bladefem.util.arrays import RealArray

from .damper_shapes import SHAPES
from .parameters import Disc, Platform, Shank, Wedge


@dataclass(frozen=True)
class Profile:
    """Corners in the plane z = 0, in the axes of the blade (x radial, y circumferential) [m]."""

    # half the angle of a sector [rad]
    theta: float
    # radius of the platform's flat underside [m]
    underside: float
    # radius of the platform's top [m]
    top: float
    # (2, 2, 2) ends of the blade's seats, seat_right (y > 0) first: inner, where the flat underside
    # starts, and outer, where the edge of the plate starts
    seats: RealArray
    # (2, 2) top corners of the plate, on the side of seat_right and of seat_left
    corners: RealArray
    # (10, 2) shank and platform, anticlockwise seen from +z
    blade: RealArray
    # (n, 2) damper in contact, anticlockwise, from this blade's flank to the next one's
    damper: RealArray


def turn_about_axis(angle: float) -> np.ndarray:
    """Rotation matrix (3, 3) about the engine axis z."""
    c = cos(angle)
    s = sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def sector_profile(
    platform: Platform,
    shank: Shank,
    disc: Disc,
    damper: Wedge,
) -> Profile:
    """Corners of the section; a flank leaves the radial plane between two blades at the angle
    alpha.

    Raises:
        InputError: the damper's shape does not fit between the seats.
    """
    theta = pi / disc.sectors
    underside = disc.rim_radius + shank.height
    # of the seats against the blade's own radial direction
    slopes = [angle + theta for angle in damper.angles]

    def edge(x: float) -> np.ndarray:
        return np.array([x, x * tan(theta) - platform.gap / 2 / cos(theta)])

    # as on the side of seat_right
    outer = [edge(underside + platform.seat_width * cos(slope)) for slope in slopes]
    inner = [
        end - platform.seat_width * np.array([cos(slope), sin(slope)])
        for end, slope in zip(outer, slopes, strict=True)
    ]
    top = max(end[0] for end in outer) + platform.thickness
    neck = np.array([[disc.rim_radius, shank.width / 2], [underside, shank.width / 2]])
    right, left = (np.vstack([neck, inner[side], outer[side], edge(top)]) for side in (0, 1))
    mirror = np.array([1.0, -1.0])
    seats = np.array([right[2:4], left[2:4] * mirror])
    return Profile(
        theta,
        underside,
        top,
        seats,
        np.array([right[4], left[4] * mirror]),
        np.vstack([right, left[::-1] * mirror])[::-1],
        _damper_corners(seats, theta, damper),
    )


def clearing_shift(wedge: Wedge, profile: Profile) -> np.ndarray:
    """(2,) motion of the damper that opens both flanks by wedge.clearance [m]."""
    # unit normals of the flanks, out of the damper, in the axes of the radial plane midway
    normals = np.array(
        [
            [np.sin(angle), side * np.cos(angle)]
            for angle, side in zip(wedge.angles, (-1, 1), strict=True)
        ]
    )
    # the shortest one: flanks in one plane leave the motion along them open
    radial, across = np.linalg.lstsq(normals, np.full(2, -wedge.clearance), rcond=1e-9)[0]
    c = np.cos(profile.theta)
    s = np.sin(profile.theta)
    return np.array([radial * c - across * s, radial * s + across * c])


def _damper_corners(
    seats: np.ndarray,
    theta: float,
    damper: Wedge,
) -> np.ndarray:
    """The damper's outline between this blade's seat_right and the next blade's seat_left."""
    radial = np.array([cos(theta), sin(theta)])
    across = np.array([-sin(theta), cos(theta)])
    axes = np.column_stack([radial, across])
    # the next blade's seat is this one's turned on, or its mirror image mirrored midway
    mirrored = seats[1] * [1, -1] @ axes * [1, -1]
    flanks = np.stack([seats[0] @ axes, mirrored])
    return SHAPES[damper.shape].outline(flanks, damper.base) @ axes.T

"""The cross-section of a wedge sector as points: disc, shank, platform with inclined seats, and the
wedge between.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, tan

import numpy as np

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
    # (2,) inner end of this blade's seat_right, where the flat underside starts
    inner: np.ndarray
    # (2,) outer end of seat_right, where the edge of the plate starts
    outer: np.ndarray
    # (2,) top corner of the plate
    corner: np.ndarray
    # (10, 2) shank and platform, anticlockwise seen from +z
    blade: np.ndarray
    # (6, 2) damper in contact, anticlockwise: foot, inner, outer; outer, inner, foot
    wedge: np.ndarray


def turn(angle: float) -> np.ndarray:
    """Rotation matrix (3, 3) about the engine axis z."""
    c = cos(angle)
    s = sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def profile(
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
) -> Profile:
    """Corners of the section; a flank leaves the radial plane between two blades at the angle
    alpha.
    """
    theta = pi / disc.sectors
    underside = disc.rim_radius + shank.height
    # of the seat against the blade's own radial direction
    slope = wedge.angle + theta

    def edge(x):
        return np.array([x, x * tan(theta) - platform.gap / 2 / cos(theta)])

    outer = edge(underside + platform.seat_width * cos(slope))
    inner = outer - platform.seat_width * np.array([cos(slope), sin(slope)])
    corner = edge(outer[0] + platform.thickness)
    half = np.array(
        [[disc.rim_radius, shank.width / 2], [underside, shank.width / 2], inner, outer, corner]
    )
    mirror = half[::-1] * [1, -1]
    return Profile(
        theta,
        underside,
        corner[0],
        inner,
        outer,
        corner,
        np.vstack([half, mirror])[::-1],
        _wedge_corners(inner, outer, theta, wedge.base),
    )


def _wedge_corners(
    inner: np.ndarray,
    outer: np.ndarray,
    theta: float,
    base: float,
) -> np.ndarray:
    """Six corners, mirrored at the radial plane between the blades, anticlockwise seen from +z."""
    radial = np.array([cos(theta), sin(theta)])
    across = np.array([-sin(theta), cos(theta)])
    local = np.array([[p @ radial, p @ across] for p in (inner, outer)])
    foot = local[0] - [base, 0.0]
    # foot, inner and outer end on this blade's side (Y < 0)
    this = np.vstack([foot, local])
    other = this[::-1] * [1, -1]
    corners = np.vstack([this, other])
    return corners[:, :1] * radial + corners[:, 1:] * across

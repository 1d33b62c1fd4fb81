"""Aerofoil sections as points: thickness and camber laws, placed on the blade by stagger, twist,
lean and sweep.
"""

from __future__ import annotations

import numpy as np

from .parameters import DEG, Aerofoil

# trailing edge over largest thickness: a spline closed by a short straight edge meshes well
TRAILING_EDGE_RATIO = 0.2
# a fillet meets the platform at this angle, since tangent faces are hard on Boolean unions
FILLET_ANGLE = 15 * DEG
# points on each side
POINTS_PER_SIDE = 24


def half_thickness(
    family: str,
    x: np.ndarray,
    thickness: float,
) -> np.ndarray:
    """Half thickness over chord at x = 0..1 along the chord.

    The NACA law is the four-digit one (NACA report 460) with its last coefficient opened to a blunt
    trailing edge; the biconvex law is a parabola on a rounded base.
    """
    if family == "naca":
        last = 0.1036 - 0.1 * TRAILING_EDGE_RATIO
        return (
            5
            * thickness
            * (0.2969 * np.sqrt(x) - 0.1260 * x - 0.3516 * x**2 + 0.2843 * x**3 - last * x**4)
        )
    rounded = np.sqrt(1 - (1 - np.minimum(x / (2 * TRAILING_EDGE_RATIO * thickness), 1.0)) ** 2)
    return (
        thickness
        / 2
        * ((1 - TRAILING_EDGE_RATIO) * 4 * x * (1 - x) + TRAILING_EDGE_RATIO * rounded)
    )


def chord_places(
    family: str,
    thickness: float,
    points: int,
) -> np.ndarray:
    """Places (points,) along the chord, even in arc length plus turning angle, so that every nose
    is drawn round.
    """
    x = np.linspace(0, 1, 2000) ** 3
    dx = np.diff(x)
    dy = np.diff(half_thickness(family, x, thickness))
    arc = np.hypot(dx, dy)
    angle = np.arctan2(dy, dx)
    turn = np.abs(np.diff(angle, prepend=np.pi / 2))
    measure = np.concatenate([[0.0], np.cumsum(arc / arc.sum() + turn / turn.sum())])
    return np.interp(np.linspace(0, measure[-1], points), measure, x)


def closed_section(
    family: str,
    thickness: float,
    camber: float,
) -> np.ndarray:
    """Closed section over chord, (2 POINTS_PER_SIDE - 1, 2): trailing edge (suction side), leading
    edge, trailing edge.

    Columns: along the chord (0 leading, 1 trailing edge) and across it (suction side positive).
    """
    x = chord_places(family, thickness, POINTS_PER_SIDE)
    half = half_thickness(family, x, thickness)
    line = 4 * camber * x * (1 - x)
    slope = 4 * camber * (1 - 2 * x)
    normal = np.column_stack([-slope, np.ones_like(x)]) / np.hypot(1, slope)[:, None]
    middle = np.column_stack([x, line])
    upper = middle + half[:, None] * normal
    lower = middle - half[:, None] * normal
    return np.vstack([upper[::-1], lower[1:]])


def centroid(polygon: np.ndarray) -> np.ndarray:
    """Centre of area of a simple polygon (n, 2)."""
    a = polygon
    b = np.roll(polygon, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    return ((a + b) * cross[:, None]).sum(axis=0) / (3 * cross.sum())


def section_frame(
    blade: Aerofoil,
    radius: float,
    t: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Frame of the section at the share t = 0..1 of the span; ``radius`` [m] is the platform's top.

    Returns: origin (3,) [m], directions along the chord (to the trailing edge) and across it (3,),
    chord [m].
    """
    angle = blade.stagger + t * blade.twist
    height = t * blade.span
    chord = (1 - t) * blade.chord_root + t * blade.chord_tip
    origin = np.array([radius + height, height * np.tan(blade.lean), height * np.tan(blade.sweep)])
    along = np.array([0.0, np.sin(angle), np.cos(angle)])
    across = np.array([0.0, np.cos(angle), -np.sin(angle)])
    return origin, along, across, chord


def place_section(
    blade: Aerofoil,
    radius: float,
    t: float,
    plane: np.ndarray,
) -> np.ndarray:
    """Points (n, 3) [m] of chord coordinates (n, 2) in the section at share t, stacked on the
    centres of area.
    """
    origin, along, across, chord = section_frame(blade, radius, t)
    local = chord * (plane - centroid(section_shape(blade, t)))
    return origin + local[:, :1] * along + local[:, 1:] * across


def section_shape(blade: Aerofoil, t: float) -> np.ndarray:
    """Section over chord at the share t of the span, (n, 2)."""
    return closed_section(
        blade.section, (1 - t) * blade.thickness_root + t * blade.thickness_tip, blade.camber
    )


def section_outline(
    blade: Aerofoil,
    radius: float,
    t: float,
    grow: float = 0.0,
) -> np.ndarray:
    """Section in space at the share t of the span, (n, 3) [m], its outline moved outwards by
    ``grow`` [m].
    """
    chord = (1 - t) * blade.chord_root + t * blade.chord_tip
    return place_section(blade, radius, t, grown_outline(section_shape(blade, t), grow / chord))


def grown_outline(polygon: np.ndarray, distance: float) -> np.ndarray:
    """Open outline (n, 2), anticlockwise from the trailing edge, moved outwards; its ends keep the
    corner.
    """
    tangent = np.gradient(polygon, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    outwards = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    blunt = polygon[0] - polygon[-1]
    back = np.array([blunt[1], -blunt[0]]) / np.linalg.norm(blunt)
    moved = polygon + distance * outwards
    moved[[0, -1]] += distance * back
    return moved

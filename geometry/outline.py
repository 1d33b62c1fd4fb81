"""Drawings of every part as plain arrays: outlines, and dimension lines with the parameter that each one shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .parameters import Aerofoil, Disc, HertzPair, Plane, Platform, Punch, Shank, Wedge, ZMass
from .plane import blade_corners, damper_corners
from .profile import profile, turn
from .section import centroid, place, shape
from .zmass import z_corners

__all__ = ["Dimension", "Drawing", "drawings"]


@dataclass(frozen=True)
class Dimension:
    """A labelled length or angle of a drawing."""

    name: str               # the parameter, "aerofoil.span"
    start: np.ndarray       # (2,) [m]
    end: np.ndarray         # (2,) [m]; for an angle the end of the arm that the angle is measured from
    corner: np.ndarray | None = None    # (2,) [m] for an angle: its apex; None for a length


@dataclass(frozen=True)
class Drawing:
    """Outlines in one plane."""

    title: str
    axes: tuple[str, str]                       # what the two coordinates are
    curves: dict[str, np.ndarray]               # name -> (n, 2) [m]; closed when the last point is the first
    dimensions: tuple[Dimension, ...]


def drawings(scene: Any) -> tuple[Drawing, ...]:
    """The drawings of a scene's parts, by its ``kind``; none for imported geometry."""
    kinds = {"wedge sector": _sector, "plane blades": lambda s: (plane_view(s.plane),),
             "z mass": lambda s: (z_view(s.z_mass),), "hertz": lambda s: (hertz_view(s.hertz),),
             "punch": lambda s: (punch_view(s.punch),)}
    return kinds.get(scene.kind, lambda s: ())(scene)


def _sector(scene: Any) -> tuple[Drawing, ...]:
    parts = scene.platform, scene.shank, scene.disc, scene.damper
    return (section_view(scene.aerofoil), top_view(scene.aerofoil), side_view(scene.aerofoil, *parts),
            front_view(*parts), wedge_view(*parts))


def _closed(points: np.ndarray) -> np.ndarray:
    points = np.asarray(points, dtype=float)
    return np.vstack([points, points[:1]])


def _length(name: str, start: Any, end: Any) -> Dimension:
    return Dimension(name, np.asarray(start, dtype=float), np.asarray(end, dtype=float))


def _rectangle(x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    return _closed([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])


def section_view(blade: Aerofoil) -> Drawing:
    """Root section in its own axes, along and across the chord."""
    chord = blade.chord_root
    points = chord * shape(blade, 0)
    x = np.linspace(0, 1, 60)
    camber = chord * np.column_stack([x, 4 * blade.camber * x * (1 - x)])
    widest = np.argmax(np.linalg.norm(points - points[::-1], axis=1))      # opposite points stand on one normal
    thick = points[[widest, -1 - widest]]
    return Drawing("Section of the aerofoil", ("along the chord", "across the chord"),
                   {"section": _closed(points), "camber line": camber},
                   (_length("aerofoil.chord_root", [0, -0.15 * chord], [chord, -0.15 * chord]),
                    _length("aerofoil.thickness_root", *thick),
                    _length("aerofoil.camber", [chord / 2, 0], [chord / 2, blade.camber * chord])))


def top_view(blade: Aerofoil) -> Drawing:
    """Root and tip section seen from outside, circumference over axis."""
    flat = lambda t: place(blade, 0.0, t, shape(blade, t))[:, [2, 1]]       # noqa: E731
    arms = {}
    for name, t in (("root chord", 0.0), ("tip chord", 1.0)):
        arms[name] = place(blade, 0.0, t, np.array([[0.0, 0.0], [1.0, 0.0]]))[:, [2, 1]]
    root, tip = arms["root chord"], arms["tip chord"]
    axis = root[0] + [blade.chord_root, 0]
    angles = (Dimension("aerofoil.stagger", root[1], axis, root[0]),
              Dimension("aerofoil.twist", tip[1], tip[0] + root[1] - root[0], tip[0]))
    return Drawing("Aerofoil from outside", ("axial", "circumferential"),
                   {"root": _closed(flat(0.0)), "tip": _closed(flat(1.0)), **arms},
                   (*angles, _length("aerofoil.chord_tip", *tip)))


def side_view(blade: Aerofoil, platform: Platform, shank: Shank, disc: Disc, wedge: Wedge) -> Drawing:
    """Blade, platform, shank, disc and damper seen along the circumference, radius over axis."""
    form = profile(platform, shank, disc, wedge)
    edges = np.array([[place(blade, form.top, t, np.array([[s, 0.0]]))[0, [2, 0]] for t in np.linspace(0, 1, 21)]
                      for s in (0.0, 1.0)])
    box = lambda length, low, high: _rectangle((-length / 2, length / 2), (low, high))      # noqa: E731
    stack = place(blade, form.top, 1.0, centroid(shape(blade, 1))[None])[0, [2, 0]]
    right = max(platform.length, disc.width) / 2
    low = form.underside - wedge.base
    return Drawing("Side view", ("axial", "radial"), {
        "aerofoil": _closed(np.vstack([edges[0], edges[1][::-1]])),
        "platform": box(platform.length, form.underside, form.top),
        "shank": box(shank.length, disc.rim_radius, form.underside),
        "disc": box(disc.width, disc.bore_radius, disc.rim_radius),
        "damper": box(wedge.length, low, form.outer[0])}, (
        _length("aerofoil.span", [right, form.top], [right, form.top + blade.span]),
        Dimension("aerofoil.sweep", stack, np.array([0.0, form.top + blade.span]), np.array([0.0, form.top])),
        _length("platform.length", [-platform.length / 2, form.top], [platform.length / 2, form.top]),
        _length("shank.length", *[[s * shank.length / 2, disc.rim_radius] for s in (-1, 1)]),
        _length("shank.height", [0, disc.rim_radius], [0, form.underside]),
        _length("disc.width", *[[s * disc.width / 2, disc.bore_radius] for s in (-1, 1)]),
        _length("damper.length", *[[s * wedge.length / 2, low] for s in (-1, 1)])))


def front_view(platform: Platform, shank: Shank, disc: Disc, wedge: Wedge) -> Drawing:
    """Cross-section of two neighbouring sectors and the damper between them, seen along the engine axis."""
    form = profile(platform, shank, disc, wedge)
    angles = np.linspace(-form.theta, form.theta, 30)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    segment = _closed(np.vstack([disc.bore_radius * ring, disc.rim_radius * ring[::-1]]))
    on = turn(2 * form.theta)[:2, :2].T
    swap = lambda points: points[:, ::-1]                                   # noqa: E731
    curves = {"disc": swap(segment), "blade": swap(_closed(form.blade)), "damper": swap(_closed(form.wedge)),
              "next disc": swap(segment @ on), "next blade": swap(_closed(form.blade) @ on)}
    half, across = shank.width / 2, np.array([-np.sin(form.theta), np.cos(form.theta)])
    return Drawing("Cross-section", ("circumferential", "radial"), curves, (
        _length("disc.bore_radius", [0, 0], [0, disc.bore_radius]),
        _length("disc.rim_radius", [0, 0], np.array([np.sin(-form.theta), np.cos(form.theta)]) * disc.rim_radius),
        _length("shank.width", *[[s * half, (disc.rim_radius + form.underside) / 2] for s in (-1, 1)]),
        _length("shank.height", [-half, disc.rim_radius], [-half, form.underside]),
        _length("platform.thickness", form.outer[::-1] * [-1, 1], form.corner[::-1] * [-1, 1]),
        _length("platform.gap", form.corner[::-1], (form.corner + platform.gap * across)[::-1]),
        Dimension("disc.sectors", swap(ring[-1:] * disc.rim_radius)[0], swap(ring[:1] * disc.rim_radius)[0],
                  np.zeros(2))))


def wedge_view(platform: Platform, shank: Shank, disc: Disc, wedge: Wedge) -> Drawing:
    """The damper in its own axes, the radial plane between the two blades upright."""
    form = profile(platform, shank, disc, wedge)
    back = turn(np.pi / 2 - form.theta)[:2, :2].T
    points = form.wedge @ back
    points = points - [0, points[:, 1].min()]
    foot, inner, outer = points[:3]
    apex = np.array([inner[0], inner[1] + 1.4 * (outer[1] - inner[1])])
    return Drawing("Wedge damper", ("circumferential", "radial"), {"damper": _closed(points)}, (
        Dimension("damper.angle", outer, apex, inner),
        _length("damper.base", foot, inner),
        _length("platform.seat_width", inner, outer)))


def plane_view(plane: Plane) -> Drawing:
    """Two plane blades and the flat damper between them."""
    swap = lambda points: points[:, ::-1]                                   # noqa: E731
    blade, damper = _closed(blade_corners(plane)), _closed(damper_corners(plane))
    low, high, wide = plane.platform_height, plane.platform_height + plane.platform_thickness, plane.platform_width / 2
    on = np.array([plane.pitch, 0])
    return Drawing("Plane blades with a flat damper", ("circumferential", "radial"),
                   {"blade": swap(blade), "next blade": swap(blade) + on, "damper": swap(damper)}, (
        _length("plane.length", [-1.2 * wide, 0], [-1.2 * wide, plane.length]),
        _length("plane.thickness", *[[s * plane.thickness / 2, 0.9 * plane.length] for s in (-1, 1)]),
        _length("plane.platform_height", [-0.6 * wide, 0], [-0.6 * wide, low]),
        _length("plane.platform_width", [-wide, high], [wide, high]),
        _length("plane.platform_thickness", [-wide, low], [-wide, high]),
        _length("plane.pitch", [0, plane.length], [plane.pitch, plane.length]),
        _length("plane.seat_width", [wide - plane.seat_width, low], [wide, low]),
        _length("plane.damper_height", [plane.pitch / 2, low - plane.damper_height], [plane.pitch / 2, low])))


def z_view(z: ZMass) -> Drawing:
    """The footprint."""
    w, h = z.width / 2, z.height / 2
    return Drawing("Z-shaped mass", ("x", "y"), {"footprint": _closed(z_corners(z))}, (
        _length("z_mass.width", [-w, -1.1 * h], [w, -1.1 * h]), _length("z_mass.height", [1.1 * w, -h], [1.1 * w, h]),
        _length("z_mass.bar", [w, -h], [w, z.bar - h])))


def hertz_view(hertz: HertzPair) -> Drawing:
    """Half section of sphere or cylinder and block."""
    w, r = hertz.half_width, hertz.radius
    x = np.linspace(0, w, 60)
    cap = np.column_stack([x, r - np.sqrt(r**2 - x**2)])
    return Drawing("Hertz pair", ("x", "up"), {"damper": _closed(np.vstack([cap, [[w, w], [0, w]]])),
                                               "blade": _rectangle((0, w), (-w, 0))}, (
        _length("hertz.radius", [0, r], cap[40]), _length("hertz.half_width", [0, -w], [w, -w]),
        _length("hertz.contact_radius", [0, 0], [hertz.contact_radius, 0])))


def punch_view(punch: Punch) -> Drawing:
    """Half section of punch and block."""
    w, a = punch.half_width, punch.radius
    return Drawing("Flat punch", ("x", "up"),
                   {"damper": _rectangle((0, a), (0, a)), "blade": _rectangle((0, w), (-w, 0))},
                   (_length("punch.radius", [0, a], [a, a]), _length("punch.half_width", [0, -w], [w, -w])))

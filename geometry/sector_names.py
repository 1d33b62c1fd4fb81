"""Names on a wedge sector: which surface is which, which faces match, where the tip's nodes are."""

from __future__ import annotations

from dataclasses import replace
from math import sin
from types import ModuleType

import numpy as np

from .draw import centres, face_at, tie
from .extract import Groups
from .finish import Motion
from .mesh import Mesh, Sector
from .parameters import Aerofoil, Disc, Wedge
from .profile import Profile, turn
from .section import centroid, outline, place, placement, shape

__all__ = ["link", "mark_tip", "motions", "moved", "name_faces", "nose", "seat", "sector", "split_skin",
           "trailing_curves"]


def seat(profile: Profile, length: float, side: int) -> np.ndarray:
    """Corners (4, 3) [m] of the contact face on this blade, side +1 towards +y."""
    (xi, yi), (xo, yo), z = profile.inner, profile.outer, length / 2
    return np.array([[xi, side * yi, -z], [xo, side * yo, -z], [xo, side * yo, z], [xi, side * yi, z]])


def name_faces(gmsh: ModuleType, blade: int, damper: int, aerofoil: Aerofoil, disc: Disc, wedge: Wedge,
               profile: Profile) -> Groups:
    """Find every named face by where its centre must be."""
    theta, tolerance = profile.theta, 1e-6 * profile.top
    middle = (disc.bore_radius + disc.rim_radius) / 2
    cut = np.array([middle * np.cos(theta), middle * np.sin(theta), 0])
    low, high = (seat(profile, wedge.length, side).mean(axis=0) for side in (-1, 1))
    on_blade = centres(gmsh, blade)
    faces = {name: face_at(on_blade, where, tolerance, name) for name, where in {
        "cyclic_low": cut * [1, -1, 1], "cyclic_high": cut, "seat_left": low, "seat_right": high,
        "clamp": np.array([disc.bore_radius * sin(theta) / theta, 0, 0])}.items()}
    on_damper = centres(gmsh, damper)
    faces["damper_left"] = face_at(on_damper, high, tolerance, "damper_left")
    faces["damper_right"] = face_at(on_damper, turn(2 * theta) @ low, tolerance, "damper_right")
    faces["tip"] = [t for t, c in on_blade.items() if abs(c[0] - profile.top - aerofoil.span) < tolerance]
    above = {t: c[0] - profile.top for t, c in on_blade.items() if c[0] > profile.top + tolerance}
    if aerofoil.fillet:
        faces["fillet"] = [t for t, height in above.items() if height < aerofoil.fillet]
    sides = [t for t, height in above.items() if height > aerofoil.fillet + tolerance]
    by_area = sorted(set(sides) - set(faces["tip"]), key=lambda t: gmsh.model.occ.getMass(2, t))
    faces["aerofoil"], faces["trailing_edge"] = [by_area[-1]], by_area[:-1]
    return Groups({"blade": [blade], "damper": [damper]}, faces)


def trailing_curves(gmsh: ModuleType, groups: Groups) -> list[int]:
    """Curves round the blunt trailing edge."""
    faces = [(2, tag) for tag in groups.faces["trailing_edge"]]
    return [abs(tag) for _, tag in gmsh.model.getBoundary(faces, oriented=False)]


def sector(count: int) -> Sector:
    """The way to the next blade of a wheel."""
    return Sector(count, turn(2 * np.pi / count), np.zeros(3))


def motions(profile: Profile) -> dict[str, Motion]:
    """Faces that match, with the motion from master to slave."""
    on, stay, still = turn(2 * profile.theta), np.eye(3), np.zeros(3)
    return {"cyclic": ("cyclic_low", "cyclic_high", on, still),
            "this": ("seat_right", "damper_left", stay, still),
            "next": ("seat_left", "damper_right", on, still)}


def link(gmsh: ModuleType, groups: Groups, profile: Profile) -> None:
    """Tell gmsh to copy the mesh of each master face onto its slave."""
    for master, slave, rotation, shift in motions(profile).values():
        tie(gmsh, 2, groups.faces[master], groups.faces[slave], rotation, shift)


def split_skin(mesh: Mesh, aerofoil: Aerofoil, profile: Profile) -> Mesh:
    """The mesh with the aerofoil's skin split into its two sides at the camber line."""
    skin = mesh.faces["aerofoil"]
    above = _above_camber(mesh.points[skin[:, :3]].mean(axis=1), aerofoil, profile.top)
    faces = {name: f for name, f in mesh.faces.items() if name != "aerofoil"}
    return replace(mesh, faces=faces | {"suction_side": skin[above], "pressure_side": skin[~above]})


def mark_tip(gmsh: ModuleType, groups: Groups, aerofoil: Aerofoil, profile: Profile) -> Groups:
    """Groups with three points of the tip that are nodes of any mesh.

    tip_leading is the end of the camber line, where the tip's edge was cut; tip_trailing is the corner of the blunt
    edge on the suction side; tip_mid (on the camber line at half chord) is embedded.
    """
    tip = groups.faces["tip"][0]
    corners = {tag: np.array(gmsh.model.getValue(0, tag, []))
               for _, tag in gmsh.model.getBoundary([(2, tip)], oriented=False, recursive=True)}
    edge = outline(aerofoil, profile.top, 1)
    leading, trailing = (min(corners, key=lambda tag, p=p: np.linalg.norm(corners[tag] - p))
                         for p in (nose(aerofoil, profile), edge[0]))
    middle = gmsh.model.occ.addPoint(*place(aerofoil, profile.top, 1, np.array([[0.5, aerofoil.camber]]))[0])
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.embed(0, [middle], 2, tip)
    return replace(groups, points={"tip_leading": [leading], "tip_mid": [middle], "tip_trailing": [trailing]})


def nose(aerofoil: Aerofoil, profile: Profile) -> np.ndarray:
    """Leading edge at the tip, (3,) [m]."""
    return place(aerofoil, profile.top, 1, np.zeros((1, 2)))[0]


def _above_camber(points: np.ndarray, aerofoil: Aerofoil, top: float) -> np.ndarray:
    """Mask (n,) of points [m] on the suction side of the camber line of the section at their height."""
    t = (points[:, 0] - top) / aerofoil.span
    stations = np.linspace(0, 1, 41)
    centres = np.array([centroid(shape(aerofoil, s)) for s in stations])
    frames = [placement(aerofoil, top, s) for s in t]
    away = points - np.array([frame[0] for frame in frames])
    u, v = (np.array([a @ frame[1 + k] / frame[3] for a, frame in zip(away, frames, strict=True)])
            + np.interp(t, stations, centres[:, k]) for k in (0, 1))
    return v > 4 * aerofoil.camber * u * (1 - u)


def moved(mesh: Mesh, wedge: Wedge, profile: Profile) -> Mesh:
    """The mesh with the damper moved inwards so that both flanks clear their seats by wedge.clearance."""
    shift = -wedge.clearance / sin(wedge.angle) * np.array([np.cos(profile.theta), np.sin(profile.theta), 0])
    points = mesh.points.copy()
    points[np.unique(mesh.bodies["damper"])] += shift
    pairs = {n: replace(p, shift=p.shift + shift) if n != "cyclic" else p for n, p in mesh.pairs.items()}
    return replace(mesh, points=points, pairs=pairs)

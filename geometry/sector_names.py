"""Names on a wedge sector: which surface is which, which faces match, where the tip's nodes are."""

from __future__ import annotations

from dataclasses import replace
from math import sin
from types import ModuleType

import numpy as np

from bladefem.errors import InputError

from .draw import boundary_centres, face_at, tie_meshes
from .extract_arrays import Groups
from .matching import FaceMotion
from .mesh import Mesh, Sector
from .parameters import Aerofoil, Disc, Wedge
from .profile import Profile, clearing_shift, turn_about_axis
from .section import place_section, section_frame, section_outline
from .sector_shape import SectorShape
from .shroud import Block


def seat_face_corners(
    profile: Profile,
    length: float,
    side: int,
) -> np.ndarray:
    """Corners (4, 3) [m] of the contact face on this blade, side +1 towards +y."""
    inner, outer = profile.seats[0 if side > 0 else 1]
    z = length / 2
    return np.array([[*inner, -z], [*outer, -z], [*outer, z], [*inner, z]])


def name_faces(
    gmsh: ModuleType,
    blade: int,
    damper: int,
    shape: SectorShape,
) -> Groups:
    """Bodies, and every named face by where its centre must be.

    Args:
        blade, damper: tags of the solids.
    """
    aerofoil, disc, profile = shape.aerofoil, shape.disc, shape.profile
    theta = profile.theta
    tolerance = 1e-6 * profile.top
    middle = (disc.bore_radius + disc.rim_radius) / 2
    cut = np.array([middle * np.cos(theta), middle * np.sin(theta), 0])
    low, high = (
        seat_face_corners(profile, shape.wedge.length, side).mean(axis=0) for side in (-1, 1)
    )
    on_blade = boundary_centres(gmsh, blade)
    faces = {
        name: face_at(on_blade, where, tolerance, name)
        for name, where in {
            "cyclic_low": cut * [1, -1, 1],
            "cyclic_high": cut,
            "seat_left": low,
            "seat_right": high,
            "clamp": np.array([disc.bore_radius * sin(theta) / theta, 0, 0]),
        }.items()
    }
    on_damper = boundary_centres(gmsh, damper)
    faces["damper_left"] = face_at(on_damper, high, tolerance, "damper_left")
    faces["damper_right"] = face_at(
        on_damper, turn_about_axis(2 * theta) @ low, tolerance, "damper_right"
    )
    faces["tip"] = [
        t for t, c in on_blade.items() if abs(c[0] - profile.top - aerofoil.span) < tolerance
    ]
    shroud = shroud_faces(gmsh, list(on_blade), shape.block)
    faces |= {name: tags for name, tags in shroud.items() if name}
    on_block = {tag for tags in shroud.values() for tag in tags}
    above = {
        t: c[0] - profile.top
        for t, c in on_blade.items()
        if c[0] > profile.top + tolerance and t not in on_block
    }
    if aerofoil.fillet:
        faces["fillet"] = [t for t, height in above.items() if height < aerofoil.fillet_radius]
    sides = [
        t
        for t, height in above.items()
        if height > aerofoil.fillet_radius + tolerance and t not in faces["tip"]
    ]
    faces |= _aerofoil_faces(gmsh, sides, aerofoil)
    return Groups({"blade": [blade], "damper": [damper]}, faces)


def shroud_faces(
    gmsh: ModuleType,
    candidates: list[int],
    block: Block | None,
) -> dict[str, list[int]]:
    """Faces of a shroud's block: its circumferential ends by name, towards the neighbours, and
    the others under the name "".
    """
    if block is None:
        return {}
    tolerance = 1e-6 * float(block.high[0])
    found: dict[str, list[int]] = {"shroud_left": [], "shroud_right": [], "": []}
    for tag in candidates:
        # boxes of faces that splines bound are loose: their centres, in planes, decide
        centre = np.array(gmsh.model.occ.getCenterOfMass(2, tag))
        outside = (centre < block.low - tolerance).any() or (centre > block.high + tolerance).any()
        if outside or gmsh.model.getType(2, tag) != "Plane":
            continue
        if centre[1] < block.low[1] + tolerance:
            found["shroud_left"].append(tag)
        elif centre[1] > block.high[1] - tolerance:
            found["shroud_right"].append(tag)
        else:
            found[""].append(tag)
    return found


def _aerofoil_faces(
    gmsh: ModuleType,
    sides: list[int],
    aerofoil: Aerofoil,
) -> dict[str, list[int]]:
    """The three faces of the skin: the smallest is the trailing edge, the suction side lies across
    the chord.
    """
    if len(sides) != 3:
        raise InputError(
            f"aerofoil: joined with the platform its skin has {len(sides)} faces, expected 3; "
            "change aerofoil.lean, aerofoil.sweep or aerofoil.fillet"
        )
    trailing, *both = sorted(sides, key=lambda tag: gmsh.model.occ.getMass(2, tag))
    across = section_frame(aerofoil, 0.0, 0.5)[2]
    pressure, suction = sorted(
        both, key=lambda tag: across @ np.array(gmsh.model.occ.getCenterOfMass(2, tag))
    )
    return {"trailing_edge": [trailing], "suction_side": [suction], "pressure_side": [pressure]}


def edge_curves(gmsh: ModuleType, groups: Groups) -> tuple[list[int], list[int]]:
    """Curves along the leading edge, and round the blunt trailing edge."""
    trailing, suction, pressure = (
        {
            abs(tag)
            for _, tag in gmsh.model.getBoundary([(2, groups.faces[name][0])], oriented=False)
        }
        for name in ("trailing_edge", "suction_side", "pressure_side")
    )
    return sorted(suction & pressure), sorted(trailing)


def foot_curves(gmsh: ModuleType, profile: Profile) -> list[int]:
    """Curves along the re-entrant edges between shank and rim."""
    rim, half = np.abs(profile.blade[profile.blade[:, 0].argmin()])
    height = np.sqrt(rim**2 - half**2)
    # gmsh's boxes are 1e-7 larger than the curves
    tolerance = 1e-6 * rim + 2e-7
    found = []
    for _, curve in gmsh.model.getEntities(1):
        box = np.array(gmsh.model.getBoundingBox(1, curve)).reshape(2, 3)
        at_height = np.abs(box[:, 0] - height).max() < tolerance
        if at_height and np.abs(np.abs(box[:, 1]) - half).max() < tolerance:
            found.append(curve)
    return found


def slot_curves(
    gmsh: ModuleType,
    slots: list[np.ndarray],
    disc: Disc,
) -> list[int]:
    """Curves of a root's slots, those on the faces of the disc included."""
    corners = np.vstack(slots)
    low = np.append(corners.min(axis=0), -disc.width / 2)
    high = np.append(corners.max(axis=0), disc.width / 2)
    high[0] = disc.rim_radius
    tolerance = 1e-6 * disc.rim_radius + 2e-7
    found = []
    for _, curve in gmsh.model.getEntities(1):
        box = np.array(gmsh.model.getBoundingBox(1, curve)).reshape(2, 3)
        if (box[0] > low - tolerance).all() and (box[1] < high + tolerance).all():
            found.append(curve)
    return found


def next_sector_motion(count: int) -> Sector:
    """The way to the next blade of a wheel."""
    return Sector(count, turn_about_axis(2 * np.pi / count), np.zeros(3))


def face_motions(profile: Profile) -> dict[str, FaceMotion]:
    """Faces that match, by the name of the pair."""
    on = turn_about_axis(2 * profile.theta)
    return {
        "cyclic": FaceMotion("cyclic_low", "cyclic_high", on),
        "this": FaceMotion("seat_right", "damper_left"),
        "next": FaceMotion("seat_left", "damper_right", on),
    }


def link_faces(
    gmsh: ModuleType,
    groups: Groups,
    profile: Profile,
) -> None:
    """Tell gmsh to copy the mesh of each master face onto its slave."""
    for motion in face_motions(profile).values():
        tie_meshes(gmsh, 2, groups.faces, motion)


def mark_tip(
    gmsh: ModuleType,
    groups: Groups,
    shape: SectorShape,
) -> Groups:
    """Groups with three points of the tip that are nodes of any mesh.

    tip_leading is the end of the leading edge; tip_trailing is the corner of the blunt edge on the
    suction side; tip_mid (on the camber line at half chord) is embedded, and so are all of them in
    the outer face of a tip shroud.
    """
    aerofoil, top = shape.aerofoil, shape.profile.top
    tip = groups.faces["tip"][0]
    corners = {
        tag: np.array(gmsh.model.getValue(0, tag, []))
        for _, tag in gmsh.model.getBoundary([(2, tip)], oriented=False, recursive=True)
    }
    edge = section_outline(aerofoil, top, 1)
    middle = place_section(aerofoil, top, 1, np.array([[0.5, aerofoil.camber]]))[0]
    wanted = {"tip_leading": edge[len(edge) // 2], "tip_mid": middle, "tip_trailing": edge[0]}
    tags = {}
    added = []
    for name, point in wanted.items():
        nearest = _nearest_tag(corners, point)
        if np.linalg.norm(corners[nearest] - point) < 1e-6 * top:
            tags[name] = nearest
        else:
            tags[name] = gmsh.model.occ.addPoint(*point)
            added.append(tags[name])
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.embed(0, added, 2, tip)
    return replace(groups, points={name: [tag] for name, tag in tags.items()})


def _nearest_tag(places: dict[int, np.ndarray], point: np.ndarray) -> int:
    return min(places, key=lambda tag: float(np.linalg.norm(places[tag] - point)))


def damper_moved_inwards(
    mesh: Mesh,
    wedge: Wedge,
    profile: Profile,
) -> Mesh:
    """The mesh with the damper moved inwards so that both flanks clear their seats by
    wedge.clearance.
    """
    shift = np.append(clearing_shift(wedge, profile), 0.0)
    points = mesh.points.copy()
    points[np.unique(mesh.bodies["damper"])] += shift
    pairs = {
        n: replace(p, shift=p.shift + shift) if n != "cyclic" else p for n, p in mesh.pairs.items()
    }
    return replace(mesh, points=points, pairs=pairs)

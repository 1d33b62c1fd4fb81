"""Element sizes of a wedge sector: fine at the seats and round the edges of the aerofoil, coarser
in the disc.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from types import ModuleType
from typing import Any

from bladefem.errors import InputError

from .extract_arrays import Groups
from .parameters import Aerofoil, Disc, MeshSize, Platform, Shank, Wedge
from .profile import Profile
from .section import FILLET_ANGLE, TRAILING_EDGE_RATIO
from .sector_names import foot_curves, shroud_faces, slot_curves
from .sector_shape import SectorShape
from .size_fields import box_field, threshold_field

# element along the leading edge over those of the aerofoil
LEADING_EDGE_SIZE = 0.6
# elements along a seat at least
MIN_ELEMENTS_ACROSS_SEAT = 8
MIN_ELEMENTS_ALONG_SEAT = 6
# length of elements along a seat over the height of the damper's straight part: at 25 its cells
# have a shape quality of 0.02
MAX_LENGTH_OVER_BASE = 12.0
# cells above the rim at the finest, when the size is left open
MAX_AUTOMATIC_CELLS = 40_000
# elements over the arc of a fillet: its largest stress is then within some 5 % of the limit
ARC_ELEMENTS = 4
# of the elements along a fillet over those of its arc, round which stress varies slowly
FILLET_STRETCH = 2.0
# growth of elements with the distance from a fillet
FILLET_GROWTH = 1.0
# elements along the foot of the shank over the automatic size, and their growth with the distance:
# half of the error of the lowest frequencies came from this re-entrant edge
FOOT_SIZE = 0.6
FOOT_GROWTH = 0.6
# elements along the slots of a root over their clearance, and their growth with the distance
SLOT_SIZE = 1.5
SLOT_GROWTH = 0.6
# of elements larger than the automatic size, on the slots at most: larger ones become flat
SLOT_COARSENING = 1.5
# elements of an aerofoil with a fillet over the automatic size: they bend as exactly (frequencies
# change by less than 2e-4), and what they save pays for the fillet
AEROFOIL_COARSENING = 1.6


@dataclass(frozen=True)
class Refined:
    """Curves or faces with small elements, which grow with the distance."""

    # "CurvesList" or "SurfacesList"
    kind: str
    tags: list[int]
    # [m]
    size: float
    growth: float
    # elements grow up to 10 times this distance [m]
    reach: float


@dataclass(frozen=True)
class Sizes:
    """Target element sizes [m]."""

    # aerofoil, platform and shank
    base: float
    # seats and wedge
    contact: float
    # far from the platform
    disc: float
    # along the leading edge
    nose: float
    # along the trailing edge
    edge: float
    # where the surface curves most
    least: float
    # above the foot of the aerofoil
    aerofoil: float
    # over the arc of the fillet; 0 without one
    fillet: float
    # elements over that arc
    arc_elements: float
    # along the re-entrant edges between shank and rim; 0 where the user gives the size of all
    foot: float
    # of the elements along the slots of a root, over their automatic size
    coarsening: float


def sector_sizes(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    size: MeshSize,
) -> Sizes:
    """Sizes from the thinnest part of the sector where the user leaves them open, in bounds of
    MAX_AUTOMATIC_CELLS cells.
    """
    tip = aerofoil.thickness_tip * aerofoil.chord_tip
    root = aerofoil.thickness_root * aerofoil.chord_root
    thin = 0.6 * min((tip + root) / 2, platform.thickness, shank.width / 2)
    automatic = max(thin, _affordable_size(aerofoil, platform, shank, disc))
    base = size.size or automatic
    contact = size.contact_size or min(base, platform.seat_width, seat_length(wedge))
    arc_elements = size.fillet_elements or max(1, round(ARC_ELEMENTS * automatic / base))
    slender = AEROFOIL_COARSENING if aerofoil.fillet and size.size is None else 1.0
    return Sizes(
        base,
        contact,
        max(base, min(3 * base, (disc.rim_radius - disc.bore_radius) / 3)),
        slender * LEADING_EDGE_SIZE * base,
        slender * min(base, 6 * TRAILING_EDGE_RATIO * tip),
        base / 3,
        slender * base,
        (pi / 2 - FILLET_ANGLE) * aerofoil.fillet_radius / arc_elements,
        arc_elements,
        0.0 if size.size else FOOT_SIZE * base,
        min(max(base / automatic, 1.0), SLOT_COARSENING),
    )


def blade_volume(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
) -> float:
    """About the volume of everything above the rim [m^3]."""
    chord = (aerofoil.chord_root + aerofoil.chord_tip) / 2
    thickness = (aerofoil.thickness_root + aerofoil.thickness_tip) / 2
    pitch = 2 * pi / disc.sectors * (disc.rim_radius + shank.height)
    return (
        0.7 * thickness * chord**2 * aerofoil.span
        + shank.height * shank.width * shank.length
        + pitch * platform.length * (platform.thickness + platform.seat_width / 2)
    )


def _affordable_size(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
) -> float:
    """Element size [m] that fills everything above the rim with MAX_AUTOMATIC_CELLS tetrahedra."""
    return (blade_volume(aerofoil, platform, shank, disc) / (0.12 * MAX_AUTOMATIC_CELLS)) ** (1 / 3)


def set_sizes(
    gmsh: ModuleType,
    profile: Profile,
    wedge: Wedge,
    sizes: Sizes,
    edges: tuple[list[int], list[int]],
    details: list[Refined],
) -> None:
    """Boxes round both seats, one for all above the rim, and elements that follow the curvature.

    Args:
        edges: curves along the leading edge, and round the trailing edge.
        details: parts with smaller elements.
    """
    field = gmsh.model.mesh.field
    boxes = _sector_boxes(field, profile, wedge, sizes)
    boxes += [
        threshold_field(
            field,
            "CurvesList",
            curves,
            (size, 10 * sizes.aerofoil),
            (size / 2, 20 * sizes.aerofoil),
        )
        for curves, size in zip(edges, (sizes.nose, sizes.edge), strict=True)
    ]
    boxes += [
        threshold_field(
            field,
            one.kind,
            one.tags,
            (one.size, one.size + 10 * one.reach * one.growth),
            (0.0, 10 * one.reach),
        )
        for one in details
        if one.tags and one.size > 0
    ]
    least = field.add("Min")
    field.setNumbers(least, "FieldsList", boxes)
    field.setAsBackgroundMesh(least)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8)
    finest = min([one.size for one in details if one.size > 0], default=1.0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", min(sizes.least, sizes.contact, finest))
    gmsh.option.setNumber("Mesh.MeshSizeMax", sizes.disc)


def _sector_boxes(field: Any, profile: Profile, wedge: Wedge, sizes: Sizes) -> list[int]:
    """Fields for all above the rim, for the aerofoil, and round both seats."""
    reach = 4 * sizes.base
    z = wedge.length / 2
    radii = profile.seats[..., 0]
    y_in = float(abs(profile.seats[:, 0, 1]).max())
    below = sizes.disc, 5 * sizes.base
    boxes = [
        box_field(field, sizes.base, *below, [profile.underside, profile.top, -10, 10, -10, 10]),
        box_field(field, sizes.aerofoil, *below, [profile.underside, 10, -10, 10, -10, 10]),
    ]
    for low, high in ((y_in, 2 * y_in), (-2 * y_in, -y_in)):
        boxes.append(
            box_field(
                field,
                sizes.contact,
                sizes.disc,
                reach,
                [radii.min() - wedge.base, radii.max(), low, high, -z, z],
            )
        )
    return boxes


def refined_parts(
    gmsh: ModuleType,
    groups: Groups,
    shape: SectorShape,
    sizes: Sizes,
) -> list[Refined]:
    """Fillet, foot of the shank, slots of the root and shroud, those that the sector has."""
    fillet = groups.faces.get("fillet", [])
    details = [
        Refined("SurfacesList", fillet, sizes.fillet, FILLET_GROWTH, sizes.base),
        Refined(
            "CurvesList",
            foot_curves(gmsh, shape.profile),
            sizes.foot,
            FOOT_GROWTH,
            2 * sizes.base,
        ),
    ]
    if shape.root.lobes:
        inside = slot_curves(gmsh, shape.slots, shape.disc)
        wide = SLOT_SIZE * shape.root.clearance * sizes.coarsening
        details.append(Refined("CurvesList", inside, wide, SLOT_GROWTH, sizes.base))
    block = shape.block
    if block is not None:
        faces = [t for tags in shroud_faces(gmsh, _all_faces(gmsh), block).values() for t in tags]
        thick = min(sizes.aerofoil, float(block.high[0] - block.low[0]))
        details.append(Refined("SurfacesList", faces, thick, SLOT_GROWTH, sizes.base))
    return details


def _all_faces(gmsh: ModuleType) -> list[int]:
    return [tag for _, tag in gmsh.model.getEntities(2)]


def set_grids(
    gmsh: ModuleType,
    seats: list[int],
    wedge: Wedge,
    size: MeshSize,
) -> None:
    """Mesh rectangular seats in a grid, much finer across them than along.

    A wedge that rolls on its seats presses a strip of their width only: a few nodes there decide
    who slips and lifts.

    Raises:
        InputError: a seat is no rectangle with one edge on each side.
    """
    along = max(2, round(wedge.length / (size.scale * (size.contact_size or seat_length(wedge)))))
    wanted = size.seat_elements or MIN_ELEMENTS_ACROSS_SEAT
    across = max(2, round(wanted / size.scale))
    for seat in seats:
        edges = {abs(tag) for _, tag in gmsh.model.getBoundary([(2, seat)], oriented=False)}
        if len(edges) != 4:
            raise InputError(
                f"mesh.seat_elements = {wanted}: a seat has {len(edges)} edges, "
                "expected 4; give mesh.contact_size alone for free triangles"
            )
        for edge in edges:
            _, _, low, _, _, high = gmsh.model.getBoundingBox(1, edge)
            count = along if high - low > wedge.length / 2 else across
            gmsh.model.mesh.setTransfiniteCurve(edge, count + 1)
        # One direction of all diagonals: hat functions of inner nodes then have equal areas, where
        # alternating ones give 1:2, which the pressure of rigid faces follows.
        gmsh.model.mesh.setTransfiniteSurface(seat, "Left")


def seat_length(wedge: Wedge) -> float:
    """Length of the elements along a seat where it is left open [m]."""
    return min(wedge.length / MIN_ELEMENTS_ALONG_SEAT, MAX_LENGTH_OVER_BASE * wedge.base)


def set_fillet_grid(
    gmsh: ModuleType,
    faces: list[int],
    sizes: Sizes,
    size: MeshSize,
) -> None:
    """Mesh the faces of a fillet in a grid, finer over the arc than along it.

    Raises:
        InputError: a face has no four edges.
    """
    for face in faces:
        edges = [abs(tag) for _, tag in gmsh.model.getBoundary([(2, face)], oriented=False)]
        if len(edges) != 4:
            raise InputError(
                f"aerofoil.fillet: a face of it has {len(edges)} edges once it is joined with the "
                "platform, expected 4; change aerofoil.fillet"
            )
        around = [edge for edge in edges if _radial_extent(gmsh, edge) < sizes.fillet / 2]
        arcs = [edge for edge in edges if edge not in around]
        # opposite edges of a grid have as many elements
        longest = max(gmsh.model.occ.getMass(1, edge) for edge in around)
        along = max(1, round(longest / (size.scale * FILLET_STRETCH * sizes.fillet)))
        over = max(1, round(sizes.arc_elements / size.scale))
        for curves, count in ((around, along), (arcs, over)):
            for curve in curves:
                gmsh.model.mesh.setTransfiniteCurve(curve, count + 1)
        gmsh.model.mesh.setTransfiniteSurface(face, "Alternate")


def _radial_extent(gmsh: ModuleType, curve: int) -> float:
    """Radial extent of a curve [m]."""
    low, _, _, high, _, _ = gmsh.model.getBoundingBox(1, curve)
    return high - low


def count_sector_cells(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    mesh: MeshSize,
) -> float:
    """A lower bound: the volume above the rim in elements of the base size, and the seats."""
    parts = (aerofoil, platform, shank, disc)
    sizes = sector_sizes(*parts, wedge, mesh)
    solid = blade_volume(*parts) / (0.12 * (mesh.scale * sizes.base) ** 3)
    seats = 2 * platform.seat_width * wedge.length
    return solid + seats / (0.43 * (mesh.scale * sizes.contact) ** 2)

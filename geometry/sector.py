"""A bladed sector with its underplatform wedge damper, drawn with OpenCASCADE and meshed so that
all pairs match.
"""

from __future__ import annotations

from math import pi
from types import ModuleType

import numpy as np

from bladefem.errors import InputError

from .draw import clear_leftovers, draw_polygon, draw_prism, imprint_marks
from .extract_arrays import Groups
from .finalise_mesh import complete_mesh, mesh_model
from .mesh import Mesh
from .parameters import Aerofoil, Disc, MeshSize, Platform, Root, Shank, Shroud, Wedge
from .section import FILLET_ANGLE, section_outline
from .sector_check import NO_SHROUD, PLAIN
from .sector_names import (
    damper_moved_inwards,
    edge_curves,
    face_motions,
    link_faces,
    mark_tip,
    name_faces,
    next_sector_motion,
    seat_face_corners,
)
from .sector_shape import SectorShape, sector_shape
from .session import gmsh_session, gmsh_step
from .sizing import (
    Sizes,
    refined_parts,
    sector_sizes,
    set_fillet_grid,
    set_grids,
    set_sizes,
)

SEATS = ("seat_left", "seat_right", "damper_left", "damper_right")


def wedge_sector(
    aerofoil: Aerofoil,
    platform: Platform,
    shank: Shank,
    disc: Disc,
    wedge: Wedge,
    size: MeshSize,
    root: Root = PLAIN,
    shroud: Shroud = NO_SHROUD,
) -> Mesh:
    """Blade, platform, shank and disc segment as body "blade", the wedge towards the next blade as
    "damper".

    The wedge is meshed in contact; a clearance c then moves it inwards by c / sin(alpha).

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    shape = sector_shape(aerofoil, platform, shank, disc, wedge, size, root, shroud)
    sizes = sector_sizes(shape.aerofoil, platform, shank, disc, wedge, size)
    profile = shape.profile
    with gmsh_session() as gmsh:
        groups = _draw_bodies(gmsh, shape)
        groups = mark_tip(gmsh, groups, shape)
        link_faces(gmsh, groups, profile)
        _prescribe_sizes(gmsh, groups, shape, sizes, size)
        with gmsh_step("mesh.size", "mesh this geometry"):
            mesh = mesh_model(gmsh, groups, 3, size)
    mesh = complete_mesh(
        mesh,
        face_motions(profile),
        size.scale * sizes.base,
        next_sector_motion(disc.sectors),
        flat=SEATS,
    )
    return damper_moved_inwards(mesh, wedge, profile) if wedge.clearance else mesh


def _draw_bodies(gmsh: ModuleType, shape: SectorShape) -> Groups:
    """Blade, with its seats imprinted, and damper; returns bodies and faces by name."""
    blade = blade_solid(gmsh, shape)
    wedge = shape.wedge
    marks = [
        (2, draw_polygon(gmsh, seat_face_corners(shape.profile, wedge.length, side))[0])
        for side in (-1, 1)
    ]
    with gmsh_step("damper.length", "imprint the seats on the platform"):
        blade = imprint_marks(gmsh, blade, marks)
    damper = draw_prism(gmsh, shape.profile.damper, -wedge.length / 2, wedge.length / 2)
    clear_leftovers(gmsh)
    gmsh.model.occ.synchronize()
    return name_faces(gmsh, blade, damper, shape)


def _prescribe_sizes(
    gmsh: ModuleType,
    groups: Groups,
    shape: SectorShape,
    sizes: Sizes,
    size: MeshSize,
) -> None:
    """Element sizes of the volumes, grids on fillet and seats."""
    details = refined_parts(gmsh, groups, shape, sizes)
    set_sizes(gmsh, shape.profile, shape.wedge, sizes, edge_curves(gmsh, groups), details)
    with gmsh_step("aerofoil.fillet", "mesh the fillet in a grid"):
        set_fillet_grid(gmsh, groups.faces.get("fillet", []), sizes, size)
    # an element size on the seats without a number across asks for free triangles
    if size.seat_elements or size.contact_size is None:
        set_grids(gmsh, [groups.faces[name][0] for name in SEATS], shape.wedge, size)


def disc_segment(
    gmsh: ModuleType,
    disc: Disc,
    theta: float,
) -> int:
    """Ring segment between -theta and +theta."""
    occ = gmsh.model.occ
    z = -disc.width / 2
    centre = occ.addPoint(0, 0, z)
    ends = [
        [occ.addPoint(r * np.cos(a), r * np.sin(a), z) for a in (-theta, theta)]
        for r in (disc.bore_radius, disc.rim_radius)
    ]
    arcs = [occ.addCircleArc(a, centre, b) for a, b in ends]
    sides = [occ.addLine(inner, outer) for inner, outer in zip(*ends, strict=True)]
    face = occ.addPlaneSurface([occ.addCurveLoop([sides[0], arcs[1], -sides[1], -arcs[0]])])
    occ.remove([(0, centre)])
    return next(tag for dim, tag in occ.extrude([(2, face)], 0, 0, disc.width) if dim == 3)


def _draw_aerofoil(
    gmsh: ModuleType,
    blade: Aerofoil,
    top: float,
    end: float = 1.0,
) -> int:
    """Solid lofted from platform to a share of the span; with a fillet, two lofts sewn at a common
    ring: flared foot and blade.

    One loft through all rings oscillates, and a Boolean union of two tangent lofts takes 10 s
    instead of 0.1 s.
    """
    occ = gmsh.model.occ
    foot = blade.fillet_radius / blade.span
    stations = np.linspace(foot, end, 3 + int(np.ceil(abs(blade.twist) / (12 * pi / 180))))
    with gmsh_step("aerofoil.twist", "loft the sections of the aerofoil"):
        rings = [_profile_wire(gmsh, section_outline(blade, top, t)) for t in stations]
        if not foot:
            return next(tag for dim, tag in occ.addThruSections(rings, makeSolid=True) if dim == 3)
    with gmsh_step("aerofoil.fillet", "round the root of the aerofoil"):
        # from the platform's plane to the blade's skin
        arc = np.linspace(FILLET_ANGLE, pi / 2, 6)[:-1]
        flare = [
            _profile_wire(gmsh, section_outline(blade, top, t, grow))
            for t, grow in zip(
                foot * (1 - np.cos(arc) / np.cos(FILLET_ANGLE)),
                blade.fillet_radius * (1 - np.sin(arc)),
                strict=True,
            )
        ]
        skin = [
            tag
            for wires in ([*flare, rings[0]], rings)
            for _, tag in occ.addThruSections(wires, makeSolid=False)
        ]
        ends = [occ.addPlaneSurface([ring]) for ring in (flare[0], rings[-1])]
        return occ.addVolume([occ.addSurfaceLoop(skin + ends, sewing=True)])


def _profile_wire(gmsh: ModuleType, points: np.ndarray) -> int:
    """Closed wire through points (n, 3): a spline each for suction and pressure side, and the blunt
    trailing edge.

    The splines meet at the leading edge, so that mesh nodes lie on it; a skin without a curve there
    is meshed with notches. Their ends are free: they meet within a degree, and end tangents, as
    OpenCASCADE scales them, make a flared ring bulge by 0.3 mm.
    """
    occ = gmsh.model.occ
    middle = len(points) // 2
    tags = [occ.addPoint(*p) for p in points]
    sides = [occ.addSpline(tags[: middle + 1]), occ.addSpline(tags[middle:])]
    return occ.addWire([*sides, occ.addLine(tags[-1], tags[0])])


def blade_solid(gmsh: ModuleType, shape: SectorShape) -> int:
    """One solid of disc segment, shank, platform, aerofoil and shroud, less the slots of its
    root.
    """
    occ = gmsh.model.occ
    platform, shank, disc, profile = shape.platform, shape.shank, shape.disc, shape.profile
    half = shank.width / 2
    foot = np.sqrt(disc.rim_radius**2 - half**2) - 0.2 * (disc.rim_radius - disc.bore_radius)
    right, left = (
        np.vstack([seat, corner])
        for seat, corner in zip(profile.seats, profile.corners, strict=True)
    )
    neck = np.array(
        [[foot, -half], [profile.underside, -half], [profile.underside, half], [foot, half]]
    )
    parts = [
        draw_prism(gmsh, neck, -shank.length / 2, shank.length / 2),
        draw_prism(
            gmsh,
            np.vstack([right, left[::-1]]),
            -platform.length / 2,
            platform.length / 2,
        ),
        _draw_aerofoil(gmsh, shape.aerofoil, profile.top, _aerofoil_end(shape)),
    ]
    if shape.block is not None:
        parts.append(occ.addBox(*shape.block.low, *(shape.block.high - shape.block.low)))
    with gmsh_step("aerofoil", "join aerofoil, platform, shank and disc"):
        solid, _ = occ.fuse([(3, disc_segment(gmsh, disc, profile.theta))], [(3, p) for p in parts])
    if shape.slots:
        with gmsh_step("root", "cut the slots of the root"):
            cut = [(3, draw_prism(gmsh, slot, -disc.width, disc.width)) for slot in shape.slots]
            solid, _ = occ.cut(solid, cut)
    volumes = [tag for dim, tag in solid if dim == 3]
    if len(volumes) != 1:
        raise InputError(
            f"aerofoil: joined with the platform it gives {len(volumes)} solids, expected one; "
            "change aerofoil.stagger or platform.length"
        )
    return volumes[0]


def _aerofoil_end(shape: SectorShape) -> float:
    """Share of the span at which the loft ends: the middle of a tip shroud, whose outer face then
    is the tip.
    """
    block = shape.block
    if block is None or not block.at_tip:
        return 1.0
    return float((block.low[0] + block.high[0]) / 2 - shape.profile.top) / shape.aerofoil.span

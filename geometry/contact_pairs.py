"""Two bodies that touch in a known way: a sphere or cylinder on a block, a flat punch on a block.

The block is the "blade" (below), the indenter the "damper" (above). In 3-D they face each other at
z = 0 round the z axis and only the quarter x, y > 0 is meshed; in 2-D they face at y = 0 and the
half x > 0 is meshed. Faces: "seat_right" (block) and "damper_left" (indenter) carry the pair
"this"; "clamp" is the far face of the block, "load" that of the indenter; "symmetry_x" is x = 0 (of
both bodies), "symmetry_y" is y = 0 in 3-D.
"""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import numpy as np

from bladefem.errors import InputError
from bladefem.scene.limits import unless_at_most
from bladefem.scene.units import show

from .draw import (
    boundary_centres,
    draw_polygon,
    draw_prism,
    imprint_marks,
    tie_meshes,
)
from .extract_arrays import Groups
from .finalise_mesh import complete_mesh, mesh_model
from .matching import FaceMotion
from .mesh import Mesh
from .parameters import HertzPair, MeshSize, Punch
from .quality import quality_report
from .session import gmsh_session, gmsh_step
from .size_fields import set_size_formula

# seat of the Hertz pair over the expected contact radius
SEAT_RATIO = 2.0
SEAT_TO_DAMPER = FaceMotion("seat_right", "damper_left")


def hertz_pair(hertz: HertzPair, size: MeshSize) -> Mesh:
    """Sphere (3-D) or cylinder (2-D) on a block; contact is possible within twice the expected
    radius.

    Both bodies are meshed as blocks with the same nodes on the seat; the upper one is then bent to
    its curvature, so that facing nodes have the same x (and y): the initial gap is their distance
    along the last axis.

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    check_hertz(hertz, size)
    fine = size.contact_size or hertz.contact_radius / 10
    mesh = _mesh_facing_bodies(
        hertz.dimension,
        hertz.half_width,
        SEAT_RATIO * hertz.contact_radius,
        hertz.half_width,
        (fine, 1.2 * hertz.contact_radius),
        size,
    )
    points = _bend_indenter(mesh, hertz.radius, hertz.half_width)
    bent = replace(mesh, points=points)
    notes = {name: mesh.report[name] for name in ("notes",) if name in mesh.report}
    found = quality_report(bent, mesh.report["straightened"], mesh.report["size"])
    return replace(bent, report={**found, **notes})


def mesh_punch(block: Punch, size: MeshSize) -> Mesh:
    """Flat punch, as wide as high, on a block; the edge of the contact lies on element edges.

    Raises:
        InputError: a parameter has to change; the message names it.
    """
    check_punch(block, size)
    fine = size.contact_size or block.radius / 10
    return _mesh_facing_bodies(
        block.dimension,
        block.half_width,
        block.radius,
        None,
        (fine, 1.1 * block.radius),
        size,
    )


def check_hertz(hertz: HertzPair, size: MeshSize) -> None:
    """Refuse a contact that is too wide for its bodies, or smaller than an element.

    Raises:
        InputError: the first rule that is broken.
    """
    _check_range(
        "hertz.contact_radius",
        hertz.contact_radius,
        hertz.half_width / 2.5,
        "hertz.half_width / 2.5",
    )
    _check_range("hertz.half_width", hertz.half_width, 0.7 * hertz.radius, "70 % of hertz.radius")
    fine = size.contact_size or hertz.contact_radius / 10
    _check_range("mesh.contact_size", fine, hertz.contact_radius, "hertz.contact_radius")


def check_punch(block: Punch, size: MeshSize) -> None:
    """Refuse a punch that is too wide for its block, or smaller than an element.

    Raises:
        InputError: the first rule that is broken.
    """
    _check_range("punch.radius", block.radius, block.half_width / 2, "half of punch.half_width")
    fine = size.contact_size or block.radius / 10
    _check_range("mesh.contact_size", fine, block.radius, "punch.radius")


def _check_range(
    name: str,
    value: float,
    limit: float,
    meaning: str,
) -> None:
    if expected := unless_at_most(value, limit):
        raise InputError(f"{name} = {show(value, 'm')}: expected {expected} ({meaning})")


def _bend_indenter(
    mesh: Mesh,
    radius: float,
    height: float,
) -> np.ndarray:
    """Points [m] with the indenter's lower side on its sphere or cylinder, its far face still
    plane.
    """
    points = mesh.points.copy()
    nodes = np.unique(mesh.bodies["damper"])
    up = mesh.dimension - 1
    away = np.square(points[nodes, :up]).sum(axis=1)
    sag = away / (radius + np.sqrt(radius**2 - away))
    points[nodes, up] += sag * (1 - points[nodes, up] / height)
    return points


def _mesh_facing_bodies(
    dimension: int,
    width: float,
    seat: float,
    upper: float | None,
    fine: tuple[float, float],
    size: MeshSize,
) -> Mesh:
    """Mesh of the two bodies.

    Args:
        width: of the block, and its height [m].
        seat: radius of the possible contact [m].
        upper: width and height of the indenter; None for a punch as wide as the seat [m].
        fine: element size and the radius in which it holds [m].
    """
    far = size.size or width / 4
    with gmsh_session() as gmsh:
        draw = _draw_solids if dimension == 3 else _draw_plates
        blade, damper = draw(gmsh, width, seat, upper)
        groups = _name_faces(
            gmsh,
            dimension,
            blade,
            damper,
            (width, upper or seat),
            seat,
        )
        tie_meshes(gmsh, dimension - 1, groups.faces, SEAT_TO_DAMPER)
        distance = "Sqrt(x*x + y*y + z*z)"
        set_size_formula(
            gmsh,
            f"Min({far}, {fine[0]} + 0.3 * Max(0, {distance} - {fine[1]}))",
            fine[0] / 2,
        )
        with gmsh_step("mesh.contact_size", "mesh this geometry"):
            mesh = mesh_model(gmsh, groups, dimension, size)
    return complete_mesh(
        mesh,
        {"this": SEAT_TO_DAMPER},
        size.scale * far,
        flat=("seat_right", "damper_left"),
    )


def _square_corners(width: float) -> np.ndarray:
    return np.array([[0.0, 0.0], [width, 0.0], [width, width], [0.0, width]])


def _draw_solids(
    gmsh: ModuleType,
    width: float,
    seat: float,
    upper: float | None,
) -> tuple[int, int]:
    """Quarter blocks with the seat imprinted, or a quarter round punch above."""
    blade = imprint_marks(
        gmsh,
        draw_prism(gmsh, _square_corners(width), -width, 0.0),
        [(2, _quarter_disc(gmsh, seat))],
    )
    if upper is None:
        solid = gmsh.model.occ.extrude([(2, _quarter_disc(gmsh, seat))], 0, 0, seat)
        damper = next(tag for dim, tag in solid if dim == 3)
    else:
        damper = imprint_marks(
            gmsh,
            draw_prism(gmsh, _square_corners(upper), 0.0, upper),
            [(2, _quarter_disc(gmsh, seat))],
        )
    gmsh.model.occ.synchronize()
    return blade, damper


def _quarter_disc(gmsh: ModuleType, radius: float) -> int:
    occ = gmsh.model.occ
    centre = occ.addPoint(0, 0, 0)
    a = occ.addPoint(radius, 0, 0)
    b = occ.addPoint(0, radius, 0)
    loop = [occ.addLine(centre, a), occ.addCircleArc(a, centre, b), occ.addLine(b, centre)]
    return occ.addPlaneSurface([occ.addCurveLoop(loop)])


def _draw_plates(
    gmsh: ModuleType,
    width: float,
    seat: float,
    upper: float | None,
) -> tuple[int, int]:
    """Half plates; the end of the seat is a corner of each."""
    low = np.array([[0, 0], [0, -width], [width, -width], [width, 0], [seat, 0]])
    high = (
        [[0, 0], [seat, 0], [upper, 0], [upper, upper], [0, upper]]
        if upper
        else [[0, 0], [seat, 0], [seat, seat], [0, seat]]
    )
    blade, damper = (
        draw_polygon(gmsh, np.array(corners, dtype=float))[0] for corners in (low, high)
    )
    gmsh.model.occ.synchronize()
    return blade, damper


def _name_faces(
    gmsh: ModuleType,
    dimension: int,
    blade: int,
    damper: int,
    sizes: tuple[float, float],
    seat: float,
) -> Groups:
    """Faces by where their centres are; the seat is the contact face whose centre is nearest to the
    axis.
    """
    up = dimension - 1
    faces = {}
    ends = ((blade, -sizes[0], "seat_right", "clamp"), (damper, sizes[1], "damper_left", "load"))
    for body, end, contact, far in ends:
        found = boundary_centres(gmsh, body, dimension)
        level = [tag for tag, c in found.items() if abs(c[up]) < 1e-6 * seat]
        faces[contact] = [_nearest_axis({tag: found[tag] for tag in level})]
        faces[far] = [tag for tag, c in found.items() if abs(c[up] - end) < 1e-6 * seat]
        for axis, name in enumerate(("symmetry_x", "symmetry_y")[:up]):
            faces.setdefault(name, []).extend(
                tag for tag, c in found.items() if abs(c[axis]) < 1e-6 * seat
            )
    return Groups({"blade": [blade], "damper": [damper]}, faces)


def count_hertz_cells(pair: HertzPair, mesh: MeshSize) -> float:
    """A lower bound of the number of cells."""
    return _seat_cells(pair.contact_radius, pair.dimension, mesh)


def count_punch_cells(pair: Punch, mesh: MeshSize) -> float:
    """A lower bound of the number of cells."""
    return _seat_cells(pair.radius, pair.dimension, mesh)


def _seat_cells(
    radius: float,
    dimension: int,
    mesh: MeshSize,
) -> float:
    """Three layers of elements of the contact size on the seats of both bodies."""
    fine = mesh.scale * (mesh.contact_size or radius / 10)
    if dimension == 3:
        return 6 * np.pi / 4 * radius**2 / (0.43 * fine**2)
    return 6 * radius / fine


def _nearest_axis(places: dict[int, np.ndarray]) -> int:
    return min(places, key=lambda tag: float(np.linalg.norm(places[tag])))

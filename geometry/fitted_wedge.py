"""The parametric damper between the platforms of an imported blade: drawn between two plane faces,
with seats cut into them that match its flanks.

The flanks are as the platforms are: inclined alike or not (a wedge, an asymmetric wedge), or in one
plane (a flat damper). The damper is a prism along the line in which the two planes meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from bladefem.errors import InputError, suggestion
from bladefem.scene.limits import unless_at_most
from bladefem.scene.units import show

from .damper_shapes import SHAPES
from .draw import boundary_centres, draw_polygon, imprint_marks
from .parameters import Wedge
from .session import gmsh_step

# (dimension, name) to entities
Named = dict[tuple[int, str], list[int]]
# sine between two planes below which they are one plane
PARALLEL_SINE = 1e-6
# of a length: what is left of rounding in a STEP file
ROUNDING_TOLERANCE = 1e-6
# of a face's size: how far a plane may be from flat
FLATNESS_TOLERANCE = 1e-6


@dataclass(frozen=True)
class FittedDamper:
    """A damper to draw between two platform faces of a blade."""

    # faces towards the next blade and towards the previous one
    seats: tuple[str, str]
    # its length, base; the angles are those of the faces
    wedge: Wedge
    # from the platform's edge inwards [m]; of the narrower face when None
    seat_width: float | None = None


@dataclass(frozen=True)
class PlaneFace:
    """A plane face of a solid."""

    # (3,) [m]
    centre: np.ndarray
    # (3,) unit vector
    normal: np.ndarray
    # (n, 3) [m]
    corners: np.ndarray

    def turned(self, rotation: np.ndarray) -> PlaneFace:
        """The face turned by a rotation (3, 3)."""
        return PlaneFace(rotation @ self.centre, rotation @ self.normal, self.corners @ rotation.T)


@dataclass(frozen=True)
class Flanks:
    """Both flanks of a damper, in the axes of the wheel, the second one under the next blade."""

    # (2, 2, 3) flank, inner and outer end: corners in the section at the damper's lower end [m]
    ends: np.ndarray
    # (3,) along the damper, from its lower to its upper end [m]
    along: np.ndarray
    # (3,) unit vector out of the wheel's axis
    outward: np.ndarray

    @property
    def width(self) -> float:
        """Of a seat, across the damper [m]."""
        return float(np.linalg.norm(self.ends[0, 1] - self.ends[0, 0]))

    @property
    def length(self) -> float:
        """Of a seat, along the damper [m]."""
        return float(np.linalg.norm(self.along))

    def rectangle(self, flank: int) -> np.ndarray:
        """(4, 3) corners of a flank's seat [m]."""
        inner, outer = self.ends[flank]
        return np.array([inner, outer, outer + self.along, inner + self.along])

    def section(self, damper: Wedge) -> np.ndarray:
        """(n, 3) corners of the damper's lower end [m]."""
        across = np.cross(self.along, self.outward)
        across /= np.linalg.norm(across)
        origin = self.ends[:, 0].mean(axis=0)
        if (self.ends[1, 0] - origin) @ across < 0:
            across = -across
        axes = np.column_stack([self.outward, across])
        outline = SHAPES[damper.shape].outline((self.ends - origin) @ axes, damper.base)
        return origin + outline @ axes.T


def fit_wedge(
    gmsh: ModuleType,
    named: Named,
    fitted: FittedDamper,
    on: np.ndarray,
    axis: np.ndarray,
) -> Named:
    """Cut the seats into the blade and draw the damper; returns the names with these added.

    Args:
        named: solids and faces of the file, by name.
        on: rotation (3, 3) from a blade to the next one.
        axis: (3,) unit vector of the engine axis.

    Raises:
        InputError: faces that are not there, not plane or not opposite each other, or a damper that
            does not fit.
    """
    seats = fitted.seats
    right, left = (_single_face(gmsh, named, name) for name in seats)
    faces = faces_about_damper(gmsh, right, left, on)
    flanks = flanks_between(faces, fitted.wedge, fitted.seat_width, axis)
    blade = _owning_solid(gmsh, right)
    before = _solid_faces(gmsh, blade)
    marks = [
        (2, draw_polygon(gmsh, flanks.rectangle(0))[0]),
        (2, draw_polygon(gmsh, flanks.rectangle(1) @ on)[0]),
    ]
    with gmsh_step("imported.seats", "cut the seats into the platforms"):
        cut = imprint_marks(gmsh, blade, marks)
        base, _, _ = draw_polygon(gmsh, flanks.section(fitted.wedge))
        drawn = gmsh.model.occ.extrude([(2, base)], *flanks.along)
    damper = next(tag for dim, tag in drawn if dim == 3)
    gmsh.model.occ.synchronize()
    result = _carried_over(gmsh, named, before, blade, cut)
    middles = [flanks.rectangle(side).mean(axis=0) for side in (0, 1)]
    found = {
        "seat_right": _face_at(gmsh, cut, middles[0], flanks, seats[0]),
        "seat_left": _face_at(gmsh, cut, middles[1] @ on, flanks, seats[1]),
        "damper_left": _face_at(gmsh, damper, middles[0], flanks, "damper"),
        "damper_right": _face_at(gmsh, damper, middles[1], flanks, "damper"),
    }
    return result | {(3, "damper"): [damper]} | {(2, name): [face] for name, face in found.items()}


def faces_about_damper(
    gmsh: ModuleType,
    right: int,
    left: int,
    on: np.ndarray,
) -> tuple[PlaneFace, PlaneFace]:
    """The face ``right`` of this blade and the face ``left`` of the next one.

    Raises:
        InputError: the next blade is not on the side of the first face.
    """
    here = _plane_face(gmsh, right)
    there = _plane_face(gmsh, left)
    # the neighbour may be in either sense of the rotation
    turned = min(
        (on, on.T), key=lambda turn: float(np.linalg.norm(turn @ there.centre - here.centre))
    )
    if not np.allclose(turned, on):
        raise InputError(
            "imported.seats: the first face looks towards the previous blade, expected the face "
            "towards the next one first; exchange the two names"
        )
    return here, there.turned(on)


def flanks_between(
    faces: tuple[PlaneFace, PlaneFace],
    wedge: Wedge,
    width: float | None,
    axis: np.ndarray,
) -> Flanks:
    """Where the damper touches two faces.

    Args:
        width: of the seats [m]; of the narrower face when None.
        axis: (3,) unit vector of the engine axis.

    Raises:
        InputError: the damper does not fit between them.
    """
    along = _damper_direction(faces, axis)
    middle = (sum(_common_extent(faces, along, wedge.length)) - wedge.length) / 2
    acrosses = [_across_flank(faces, along, i) for i in (0, 1)]
    extents = [
        _extent_along(face.corners, across) for face, across in zip(faces, acrosses, strict=True)
    ]
    wanted = _seat_width(extents, width)
    ends = []
    for face, across, (_, top) in zip(faces, acrosses, extents, strict=True):
        place = face.centre
        origin = place - (place @ across) * across - (place @ along) * along
        foot = origin + middle * along
        ends.append([foot + (top - wanted) * across, foot + top * across])
    between = (faces[0].centre + faces[1].centre) / 2
    outward = between - (between @ axis) * axis
    outward -= (outward @ along) * along
    flanks = Flanks(np.array(ends), wedge.length * along, outward / np.linalg.norm(outward))
    _refuse_crossed(flanks)
    return flanks


def _damper_direction(faces: tuple[PlaneFace, PlaneFace], axis: np.ndarray) -> np.ndarray:
    """(3,) unit vector along the line in which both planes meet, in the sense of the axis; the
    axis in one plane.
    """
    along = np.cross(faces[0].normal, faces[1].normal)
    if np.linalg.norm(along) < PARALLEL_SINE:
        along = axis - (axis @ faces[0].normal) * faces[0].normal
    along /= np.linalg.norm(along)
    return along if along @ axis >= 0 else -along


def _seat_width(extents: list[tuple[float, float]], width: float | None) -> float:
    """Width of the seats [m]: the one given, or that of the narrower face.

    Args:
        extents: of both faces across the damper [m].
    """
    narrowest = min(top - bottom for bottom, top in extents)
    wanted = narrowest if width is None else width
    if expected := unless_at_most(wanted, narrowest, tolerance=ROUNDING_TOLERANCE):
        raise InputError(
            f"imported.seat_width = {show(wanted, 'm')}: expected {expected}, the width of the "
            "narrower platform face"
        )
    return wanted


def _common_extent(
    faces: tuple[PlaneFace, PlaneFace],
    along: np.ndarray,
    length: float,
) -> tuple[float, float]:
    """Where both faces are, along the damper [m]."""
    extents = [_extent_along(face.corners, along) for face in faces]
    low = max(extent[0] for extent in extents)
    high = min(extent[1] for extent in extents)
    if expected := unless_at_most(length, high - low, tolerance=ROUNDING_TOLERANCE):
        raise InputError(
            f"damper.length = {show(length, 'm')}: expected {expected}, the length that both "
            "platform faces have in common"
        )
    return low, high


def _across_flank(
    faces: tuple[PlaneFace, PlaneFace],
    along: np.ndarray,
    flank: int,
) -> np.ndarray:
    """Unit vector in a flank's plane, across the damper, towards the other flank."""
    direction = np.cross(faces[flank].normal, along)
    direction /= np.linalg.norm(direction)
    towards = faces[1 - flank].centre - faces[flank].centre
    return direction if direction @ towards >= 0 else -direction


def _refuse_crossed(flanks: Flanks) -> None:
    """The outer ends leave a gap, and the damper is wider inside than outside, or as wide."""
    inner = flanks.ends[1, 0] - flanks.ends[0, 0]
    outer = flanks.ends[1, 1] - flanks.ends[0, 1]
    if not inner @ outer > 0 or np.linalg.norm(inner) < np.linalg.norm(outer):
        raise InputError(
            "imported.seats: the two faces cross each other or open outwards, so that no damper "
            "would be pressed on them; expected the inclined undersides of neighbouring platforms"
        )


def _extent_along(points: np.ndarray, direction: np.ndarray) -> tuple[float, float]:
    along = points @ direction
    return float(along.min()), float(along.max())


def _single_face(
    gmsh: ModuleType,
    named: Named,
    name: str,
) -> int:
    """The one plane face of that name."""
    known = {word.lower(): tags for (dim, word), tags in named.items() if dim == 2}
    if name.lower() not in known:
        raise InputError(f"imported.seats: the file has no face '{name}'{suggestion(name, known)}")
    tags = known[name.lower()]
    if len(tags) != 1 or not _is_plane(gmsh, tags[0]):
        raise InputError(
            f"imported.seats: '{name}' is not one plane face, expected the plane underside of a "
            "platform"
        )
    return tags[0]


def _is_plane(gmsh: ModuleType, face: int) -> bool:
    """By its points: CAD systems write planes as splines too."""
    plane = _plane_face(gmsh, face)
    low, high = gmsh.model.getParametrizationBounds(2, face)
    across = [a + (b - a) * np.linspace(0.05, 0.95, 5) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*across), axis=-1).reshape(-1, 2).ravel().tolist()
    points = np.array(gmsh.model.getValue(2, face, grid)).reshape(-1, 3)
    size = np.ptp(plane.corners, axis=0).max()
    away = np.abs((np.concatenate([points, plane.corners]) - plane.centre) @ plane.normal).max()
    return bool(away < FLATNESS_TOLERANCE * size)


def _plane_face(gmsh: ModuleType, face: int) -> PlaneFace:
    """A face that is plane."""
    centre = np.array(gmsh.model.occ.getCenterOfMass(2, face))
    normal = np.array(gmsh.model.getNormal(face, gmsh.model.getParametrization(2, face, centre)))
    points = gmsh.model.getBoundary([(2, face)], oriented=False, recursive=True)
    corners = np.array([gmsh.model.getValue(0, tag, []) for _, tag in points])
    return PlaneFace(centre, normal / np.linalg.norm(normal), corners)


def _owning_solid(gmsh: ModuleType, face: int) -> int:
    """The solid that a face bounds."""
    upward, _ = gmsh.model.getAdjacencies(2, face)
    return int(upward[0])


def _solid_faces(gmsh: ModuleType, volume: int) -> dict[int, tuple[np.ndarray, float]]:
    """Centre and area of each face of a solid."""
    return {
        tag: (centre, float(gmsh.model.occ.getMass(2, tag)))
        for tag, centre in boundary_centres(gmsh, volume).items()
    }


def _carried_over(
    gmsh: ModuleType,
    named: Named,
    before: dict[int, tuple[np.ndarray, float]],
    blade: int,
    cut: int,
) -> Named:
    """The names after the cut: faces are found again by centre and area, what was cut is not."""
    after = _solid_faces(gmsh, cut)
    scale = max(np.linalg.norm(centre) for centre, _ in before.values())
    now = {}
    for tag, (centre, area) in before.items():
        same = [
            other
            for other, (place, size) in after.items()
            if np.linalg.norm(place - centre) < ROUNDING_TOLERANCE * scale
            and abs(size / area - 1) < ROUNDING_TOLERANCE
        ]
        if same:
            now[tag] = same[0]
    result: Named = {}
    for (dim, name), tags in named.items():
        if dim == 3:
            result[dim, name] = [cut if tag == blade else tag for tag in tags]
            continue
        kept = [now.get(tag, tag) for tag in tags if tag in now or tag not in before]
        if kept:
            result[dim, name] = kept
    return result


def _face_at(
    gmsh: ModuleType,
    volume: int,
    middle: np.ndarray,
    flanks: Flanks,
    name: str,
) -> int:
    """The face with the seat's centre and area."""
    area = flanks.width * flanks.length
    found = [
        tag
        for tag, (centre, size) in _solid_faces(gmsh, volume).items()
        if np.linalg.norm(centre - middle) < 1e-3 * flanks.width and abs(size / area - 1) < 1e-4
    ]
    if len(found) != 1:
        raise InputError(
            f"imported.seats: a seat of {1e3 * flanks.width:.4g} mm by {1e3 * flanks.length:.4g} "
            f"mm does not lie wholly on '{name}', expected a smaller imported.seat_width or "
            "damper.length"
        )
    return found[0]

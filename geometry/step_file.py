"""STEP files through OpenCASCADE: import, names, periodic meshing, and then the same road as any
imported mesh.

Names come from the file (step_names.py): the solids' (MANIFOLD_SOLID_BREP, else the product's name)
and the faces' (ADVANCED_FACE). What has no name is called body_1, body_2, ... and face_1, face_2,
... in gmsh's numbering, the order of the file. When no face is called cyclic_low, cyclic_high or
clamp, they are looked for: two faces that the rotation to the next sector carries onto each other;
the blade's face nearest to the engine axis, all of them where several are. The user may name what
the file does not. Solids are meshed separately: bodies that touch are not glued.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

import numpy as np

from bladefem.errors import InputError, missing_file

from .curving import second_order
from .draw import boundary_centres, tie_meshes
from .finalise_mesh import check_count
from .fitted_wedge import FittedDamper, Named, fit_wedge
from .imported import check_extent, mesh_of_raw
from .matching import FaceMotion
from .mesh import Mesh
from .parameters import MeshSize
from .raw_mesh import RawMesh, from_gmsh_model
from .renaming import read_names, rename_groups
from .session import gmsh_path, gmsh_session, gmsh_step
from .size_fields import threshold_field
from .step_names import solids_of_volumes, written_solids
from .step_unit import file_unit

CONTACT_FACES = ("seat_left", "seat_right", "damper_left", "damper_right")
# what to do about a file that gmsh cannot read
STEP_REMEDY = "expected a STEP file of solids; export it anew from CAD"
# elements along a model that is only looked at
PREVIEW_ELEMENTS = 30
# of the largest radius: faces that are as near to the axis as the nearest one
NEAREST_TOLERANCE = 1e-6


def read_step(
    file: str | Path,
    size: MeshSize,
    scale: float = 1.0,
    sectors: int = 0,
    axis: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 1.0),
    names: Iterable[str] = (),
    fitted: FittedDamper | None = None,
) -> Mesh:
    """Mesh of a STEP file with second-order tetrahedra.

    Args:
        scale: factor from the file's numbers to metres; 1 leaves it to the unit that the file
            states.
        sectors: blades on the wheel, 0 for a single body.
        axis: engine axis through the origin.
        names: "new = old" for faces and solids that the file calls otherwise, see renaming.py.
        fitted: a damper to draw between two platform faces of the blade.

    Raises:
        InputError: the file cannot be read or meshed, or groups are missing.
    """
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    with gmsh_session() as gmsh:
        named = _drawn_entities(gmsh, Path(file), scale, sectors, unit, names, fitted)
        _tie_faces(gmsh, named, sectors, unit)
        contact = [
            tag
            for (dim, name), tags in named.items()
            if dim == 2 and name.lower() in CONTACT_FACES
            for tag in tags
        ]
        with gmsh_step("mesh.size", f"mesh '{file}'"):
            _generate_mesh(gmsh, size, contact)
        for (dimension, name), tags in named.items():
            gmsh.model.setPhysicalName(
                dimension, gmsh.model.addPhysicalGroup(dimension, tags), name
            )
        raw = from_gmsh_model(gmsh)
    return mesh_of_raw(raw, 1.0, sectors, unit, str(file))


def step_face_names(
    file: str | Path,
    scale: float = 1.0,
    sectors: int = 0,
    axis: np.ndarray | tuple[float, float, float] = (0.0, 0.0, 1.0),
    names: Iterable[str] = (),
    fitted: FittedDamper | None = None,
) -> frozenset[str]:
    """Names of the faces of a STEP file as :func:`read_step` draws it, without a mesh.

    Raises:
        InputError: as `read_step` before it meshes.
    """
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    with gmsh_session() as gmsh:
        named = _drawn_entities(gmsh, Path(file), scale, sectors, unit, names, fitted)
    return frozenset(name for dimension, name in named if dimension == 2)


def _drawn_entities(
    gmsh: ModuleType,
    path: Path,
    scale: float,
    sectors: int,
    axis: np.ndarray,
    names: Iterable[str],
    fitted: FittedDamper | None,
) -> Named:
    """Solids and faces of a STEP file and of the damper drawn to it, by name; arguments as those of
    :func:`read_step`, with a unit vector as the axis.
    """
    if not path.is_file():
        raise InputError(f"imported.file = '{path}': {missing_file(path)}")
    text = path.read_text(errors="replace")
    with gmsh_step("imported.file", f"import '{path}'", STEP_REMEDY):
        _import_shapes(gmsh, path, 1.0 if scale == 1.0 else scale / file_unit(text))
    # shapes of another size are more than the drawing library can handle
    box = np.array(gmsh.model.getBoundingBox(-1, -1))
    check_extent(float(np.max(box[3:] - box[:3])), scale)
    named = _apply_names(_named_entities(gmsh, text), read_names(names))
    if fitted is not None:
        on = axis_rotation(axis, 2 * np.pi / sectors)
        named = fit_wedge(gmsh, named, fitted, on, axis)
    return named | _find_faces(gmsh, named, sectors, axis)


def coarse_step(file: str | Path) -> RawMesh:
    """Every solid and face of a STEP file by name, coarsely meshed, to look at; lengths in metres.

    Raises:
        InputError: the file cannot be read or meshed.
    """
    path = Path(file)
    if not path.is_file():
        raise InputError(f"'{file}': there is no such file")
    with gmsh_session() as gmsh:
        with gmsh_step("imported.file", f"import '{file}'", STEP_REMEDY):
            _import_shapes(gmsh, path, 1.0)
        for (dimension, name), tags in _named_entities(
            gmsh, path.read_text(errors="replace")
        ).items():
            gmsh.model.addPhysicalGroup(dimension, tags, name=name)
        low, high = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
        gmsh.option.setNumber(
            "Mesh.MeshSizeMax", float(np.linalg.norm(high - low)) / PREVIEW_ELEMENTS
        )
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 6)
        with gmsh_step("imported.file", f"mesh '{file}'"):
            gmsh.model.mesh.generate(3)
        return from_gmsh_model(gmsh)


def _import_shapes(
    gmsh: ModuleType,
    path: Path,
    factor: float,
) -> None:
    """Shapes in metres."""
    gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
    gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    shapes = gmsh.model.occ.importShapes(gmsh_path(path))
    if not any(dim == 3 for dim, _ in shapes):
        raise InputError(f"imported.file = '{path}': no solids inside, expected at least one")
    if factor != 1.0:
        gmsh.model.occ.dilate(
            shapes,
            0,
            0,
            0,
            factor,
            factor,
            factor,
        )
    gmsh.model.occ.synchronize()


def _named_entities(gmsh: ModuleType, text: str) -> Named:
    """(dimension, name) -> entities, by the names in the file where they can be distinguished."""
    named: dict[tuple[int, str], list[int]] = {}
    volumes = [tag for _, tag in gmsh.model.getEntities(3)]
    faces_of = [
        sorted(tag for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False))
        for volume in volumes
    ]
    drawn = [
        (len(faces), _corners(gmsh, volume))
        for volume, faces in zip(volumes, faces_of, strict=True)
    ]
    found = solids_of_volumes(written_solids(text), drawn)
    for volume, faces, solid in zip(volumes, faces_of, found, strict=True):
        body, words = ("", ()) if solid is None else (solid.name, solid.faces)
        words = words if len(words) == len(faces) else ("",) * len(faces)
        label = gmsh.model.getEntityName(3, volume).split("/")[-1]
        named.setdefault((3, body or label or f"body_{volume}"), []).append(volume)
        for face, word in zip(faces, words, strict=True):
            named.setdefault((2, word or f"face_{face}"), []).append(face)
    return named


def _corners(gmsh: ModuleType, volume: int) -> np.ndarray:
    """(n, 3) corners of a solid [m]."""
    points = gmsh.model.getBoundary([(3, volume)], oriented=False, recursive=True)
    return np.array([gmsh.model.getValue(0, tag, []) for _, tag in points]).reshape(-1, 3)


def _apply_names(named: Named, wanted: dict[str, list[str]]) -> Named:
    """The user's names for solids and faces; a new name belongs to the dimension of its first old
    one.
    """
    solids = {name.lower() for dim, name in named if dim == 3}
    result: Named = {}
    for dim in (3, 2):
        groups = {name: tags for (d, name), tags in named.items() if d == dim}
        here = {
            new: olds for new, olds in wanted.items() if (olds[0].lower() in solids) == (dim == 3)
        }
        result |= {(dim, name): tags for name, tags in rename_groups(groups, here).items()}
    return result


def _find_faces(
    gmsh: ModuleType,
    named: dict[tuple[int, str], list[int]],
    sectors: int,
    axis: np.ndarray,
) -> dict[tuple[int, str], list[int]]:
    """Cyclic faces and clamp by where they are, when no face has these names."""
    words = {name.lower() for dim, name in named if dim == 2}
    body = [
        tag
        for (dim, name), tags in named.items()
        if dim == 3 and name.lower() != "damper"
        for tag in tags
    ]
    middle = {tag: c for volume in body for tag, c in boundary_centres(gmsh, volume).items()}
    found: dict[tuple[int, str], list[int]] = {}
    if sectors and not {"cyclic_low", "cyclic_high"} & words:
        low, high = _turned_faces(gmsh, middle, axis_rotation(axis, 2 * np.pi / sectors))
        if not low:
            raise InputError(
                f"imported.sectors = {sectors}: no face of the file comes onto another one by a "
                f"{sectors}th of a turn about imported.axis, as cut faces do; expected the number "
                "of blades of the wheel, which 'bladefem look' guesses from the file"
            )
        found |= {(2, "cyclic_low"): low, (2, "cyclic_high"): high}
    if sectors and "clamp" not in words:
        radius = {
            tag: np.linalg.norm(c - (c @ axis) * axis)
            for tag, c in middle.items()
            if not any(tag in tags for tags in found.values())
        }
        # CAD systems write a bore in several pieces
        nearest = min(radius.values()) + NEAREST_TOLERANCE * max(radius.values())
        found[2, "clamp"] = [tag for tag in radius if radius[tag] <= nearest]
    return found


def _turned_faces(
    gmsh: ModuleType,
    middle: dict[int, np.ndarray],
    on: np.ndarray,
) -> tuple[list[int], list[int]]:
    """Faces that the rotation carries onto each other: same area, centre turned."""
    scale = max(np.linalg.norm(c) for c in middle.values())
    area = {tag: gmsh.model.occ.getMass(2, tag) for tag in middle}
    pairs = [
        (a, b)
        for a, p in middle.items()
        for b, q in middle.items()
        if a != b
        and np.linalg.norm(on @ p - q) < 1e-6 * scale
        and abs(area[a] / area[b] - 1) < 1e-6
    ]
    if pairs and (pairs[0][1], pairs[0][0]) in pairs:
        # half a turn carries each onto the other: low ones are those on the side of the first
        first = middle[pairs[0][0]] - on @ middle[pairs[0][0]]
        pairs = [(a, b) for a, b in pairs if middle[a] @ first > 0]
    return [a for a, _ in pairs], [b for _, b in pairs]


def axis_rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation (3, 3) about a unit axis (Rodrigues)."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _tie_faces(
    gmsh: ModuleType,
    named: dict[tuple[int, str], list[int]],
    sectors: int,
    axis: np.ndarray,
) -> None:
    """Tie cyclic faces and contact faces where both sides are named and the motion fits."""
    tags = {name.lower(): t for (dim, name), t in named.items() if dim == 2}
    on = axis_rotation(axis, 2 * np.pi / sectors) if sectors else np.eye(3)
    for master, slave, motions in (
        ("cyclic_low", "cyclic_high", (on, on.T)),
        ("seat_right", "damper_left", (np.eye(3),)),
        ("seat_left", "damper_right", (on, on.T)),
    ):
        if master not in tags or slave not in tags or len(tags[master]) != len(tags[slave]):
            continue
        start, end = (
            np.mean([gmsh.model.occ.getCenterOfMass(2, t) for t in tags[n]], axis=0)
            for n in (master, slave)
        )
        best = min(motions, key=lambda r, a=start, b=end: np.linalg.norm(r @ a - b))
        with gmsh_step("imported.file", f"match the faces {master} and {slave}"):
            tie_meshes(gmsh, 2, tags, FaceMotion(master, slave, best))


def _refine_faces(
    gmsh: ModuleType,
    faces: list[int],
    fine: float,
    base: float,
) -> None:
    """Size ``fine`` on some faces [m], growing to ``base`` within five of its elements."""
    field = gmsh.model.mesh.field
    threshold = threshold_field(field, "SurfacesList", faces, (fine, base), (fine, 5 * base))
    field.setAsBackgroundMesh(threshold)


def _generate_mesh(
    gmsh: ModuleType,
    size: MeshSize,
    contact: list[int],
) -> None:
    """Elements that follow the curvature, of ``size.contact_size`` on the contact faces and coarser
    away from them.
    """
    low, high = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
    base = size.size or float(np.linalg.norm(high - low)) / 40
    gmsh.option.setNumber("Mesh.MeshSizeMax", base)
    gmsh.option.setNumber("Mesh.MeshSizeMin", min(base / 4, size.contact_size or base))
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 10)
    if size.contact_size and contact:
        _refine_faces(gmsh, contact, size.contact_size, base)
    check_count(gmsh, 3, size.scale * base)
    gmsh.option.setNumber("Mesh.MeshSizeFactor", size.scale)
    gmsh.model.mesh.generate(3)
    if size.order == 2:
        second_order(gmsh, size.curved)

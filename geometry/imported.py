"""A user's own mesh or STEP file as a Mesh: names, axes, pairs.

Names are read without regard to case, blanks count as underscores. Volumes: every cell outside
"damper" belongs to the body "blade", whatever its volume is called; the names are kept as its
parts, which may have materials of their own. Faces, edges and node sets: the names of
geometry.mesh.Mesh; others are kept. A node set becomes a face too when it holds all corners of
outer facets (Abaqus NSET, Ansys components). The model is turned so that the engine axis is z and
+x is midway between the cyclic faces. Pairs are matched, not made: the mesh must be periodic from
cyclic_low to cyclic_high (either sense). Seats and flanks of a wheel may have nodes of their own,
which leaves their pair without matched nodes; those of other models must match.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from bladefem.errors import InputError, suggestion
from bladefem.util.arrays import IntegerArray

from .face_distance import distance_to_face
from .imported_check import STEP_SUFFIXES
from .jacobian import straight_jacobian
from .joined_files import joined_files
from .matching import FaceMotion, match_faces, snap_slaves
from .mesh import Mesh, Pair, Sector, padded_numbers
from .named_facets import named_facets
from .parameters import MeshSize, Wedge
from .profile import turn_about_axis
from .quality import quality_report, straighten_cells
from .raw_mesh import RawMesh, read_raw
from .renaming import read_names, renamed_raw
from .solid_cells import SolidCells, solid_cells
from .topology import CORNERS, DIMENSION, FACETS, FAMILY, boundary_facets, outward_faces
from .whole_cells import without_halves

# files carry few digits; a match within this share of the face is a match, and is then snapped
MATCH_TOLERANCE = 1e-4
# cut faces whose nodes differ: gap between the surfaces, which a curved face and its facets leave
CUT_GAP = 1e-3
# cosine between outward normals of two faces that look at each other
OPPOSITE_COSINE = -0.98
# of a model [m]: beyond these its unit was taken for another
MIN_MODEL_SIZE = 1e-4
MAX_MODEL_SIZE = 20.0
FLIPPED_CORNERS = {
    "tetra": [0, 2, 1, 3],
    "tetra10": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8],
    "triangle": [0, 2, 1],
    "triangle6": [0, 2, 1, 5, 4, 3],
}
Axis: TypeAlias = np.ndarray | tuple[float, float, float]


def read_geometry(
    imported: Any,
    size: MeshSize,
    wedge: Wedge,
) -> Mesh:
    """The mesh of a scene's [imported] table: STEP files are meshed, mesh files are read.

    Args:
        imported: has file, more, scale, sectors, axis, names, linear, tolerance, cut_gap, seats
            and seat_width.
        wedge: the damper to draw between the faces ``seats`` of a STEP file, where they are named.

    Raises:
        InputError: the file, its groups or its periodicity are not usable; one sentence.
    """
    if Path(imported.file).suffix.lower() in STEP_SUFFIXES:
        from .step_file import read_step

        return read_step(imported.file, size, **_drawing_options(imported, wedge))
    return _mesh_of_file(imported)


def file_names(imported: Any, wedge: Wedge) -> frozenset[str]:
    """Names of the faces and node sets that the mesh of a scene's [imported] table has; a STEP file
    is drawn for them and not meshed.

    Args:
        imported: as for :func:`read_geometry`.
        wedge: likewise.

    Raises:
        InputError: as `read_geometry`, except for what only the mesher refuses.
    """
    if Path(imported.file).suffix.lower() in STEP_SUFFIXES:
        from .step_file import step_face_names

        drawn = step_face_names(imported.file, **_drawing_options(imported, wedge))
        return frozenset(map(_family_word, drawn))
    mesh = _mesh_of_file(imported)
    return frozenset((*mesh.faces, *mesh.nodes))


def _drawing_options(imported: Any, wedge: Wedge) -> dict[str, Any]:
    """Arguments of the functions that draw a STEP file."""
    from .fitted_wedge import FittedDamper

    fitted = None
    if imported.seats is not None:
        fitted = FittedDamper(imported.seats, wedge, imported.seat_width)
    return {
        "scale": imported.scale,
        "sectors": imported.sectors,
        "axis": imported.axis,
        "names": imported.names or (),
        "fitted": fitted,
    }


def _mesh_of_file(imported: Any) -> Mesh:
    """What a mesh file and the others of its model hold."""
    return read_mesh(
        imported.file,
        imported.scale,
        imported.sectors,
        np.asarray(imported.axis, dtype=float),
        imported.names or (),
        imported.linear,
        imported.tolerance,
        imported.more or (),
        imported.cut_gap,
    )


def read_mesh(
    file: str | Path,
    scale: float = 1.0,
    sectors: int = 0,
    axis: Axis = (0.0, 0.0, 1.0),
    names: Iterable[str] = (),
    linear: str = "refuse",
    tolerance: float = MATCH_TOLERANCE,
    more: Iterable[str] = (),
    cut_gap: float = CUT_GAP,
) -> Mesh:
    """Mesh from .msh, .med, .unv, .inp, .bdf, .nas, .vtu or .cdb.

    Args:
        scale: factor from the file's unit to metres.
        sectors: blades on the wheel, 0 for a single body.
        axis: engine axis through the origin.
        names: "new = old" for groups, node sets and surfaces that the file calls otherwise, see
            renaming.py.
        linear: what becomes of first-order solids, see solid_cells.py.
        tolerance: largest distance of matched nodes, as a share of the face's size.
        more: other files of the same model, "path" or "damper = path", see joined_files.py.
        cut_gap: largest gap between cut faces whose nodes differ, as a share of the face's size.

    Raises:
        InputError: as `read_geometry`.
    """
    wanted = read_names(names)
    olds = [old for parts in wanted.values() for old in parts]
    raw = joined_files(read_raw(Path(file)), more, olds)
    if wanted:
        raw = renamed_raw(raw, wanted)
    return mesh_of_raw(
        raw,
        scale,
        sectors,
        axis,
        str(file),
        linear,
        tolerance,
        frozenset(wanted),
        cut_gap,
    )


def check_extent(across: float, scale: float) -> None:
    """Refuse a model of a size [m] that no blade has: its scale or unit is wrong.

    Raises:
        InputError: with the scale to change.
    """
    if not MIN_MODEL_SIZE < across < MAX_MODEL_SIZE:
        raise InputError(
            f"imported.scale = {scale:g}: the model would be {across:.3g} m across, expected the "
            "factor from the file's unit to metres (0.001 for millimetres)"
        )


def mesh_of_raw(
    raw: RawMesh,
    scale: float,
    sectors: int,
    axis: Axis,
    source: str,
    linear: str = "keep",
    tolerance: float = MATCH_TOLERANCE,
    wanted: frozenset[str] = frozenset(),
    cut_gap: float = CUT_GAP,
) -> Mesh:
    """Names, axes, directions and pairs on what a file holds.

    Args:
        wanted: names given by the user; their faces join groups, surfaces and node sets.
    """
    solids = solid_cells(raw, source, linear, np.asarray(axis, dtype=float))
    mesh = _split_bodies(raw, solids, source)
    mesh = _turned(
        replace(mesh, points=mesh.points * scale), _axis_turn(np.asarray(axis, dtype=float))
    )
    check_extent(float(np.ptp(mesh.points[np.unique(solids.cells)], axis=0).max()), scale)
    mesh = _with_faces(mesh, raw, wanted)
    mesh = _find_pairs(mesh, sectors, source, tolerance, cut_gap)
    points, straightened = straighten_cells(
        replace(mesh, points=snap_slaves(mesh.points, mesh.pairs))
    )
    mesh = replace(mesh, points=points)
    words = {"source": source, "notes": (*raw.notes, *solids.notes, *_tie_notes(mesh))}
    return replace(mesh, report={**quality_report(mesh, straightened, _edge_length(mesh)), **words})


def _family_word(name: str) -> str:
    return "_".join(name.lower().split())


def _split_bodies(
    raw: RawMesh,
    solids: SolidCells,
    source: str,
) -> Mesh:
    """Solid cells in bodies, in file order."""
    rows = _rows_of_groups(raw, solids)
    damper = np.unique(rows.get("damper", np.empty(0, dtype=int)))
    blade = np.setdiff1d(np.arange(len(solids.cells)), damper)
    if "blade" in rows and np.intersect1d(rows["blade"], damper).size:
        raise InputError(
            f"imported.file = '{source}': groups blade and damper share cells, expected separate "
            "bodies"
        )
    if not blade.size:
        raise InputError(
            f"imported.file = '{source}': all cells belong to the group 'damper', expected a blade"
        )
    bodies = {"blade": solids.cells[blade]}
    if damper.size:
        bodies["damper"] = solids.cells[damper]
    parts: dict[str, IntegerArray] = {
        name: np.searchsorted(blade, np.unique(some))
        for name, some in rows.items()
        if some.size and not np.isin(some, damper).any()
    }
    whole = {}
    if solids.whole is not None:
        whole = {"blade": solids.whole[blade], "damper": solids.whole[damper]}
    return Mesh(
        solids.points,
        solids.cell_type,
        {n: _positive_cells(solids.points, c, solids.cell_type, source) for n, c in bodies.items()},
        parts=parts,
        numbers=padded_numbers(raw.numbers, len(solids.points)),
        whole={name: whole[name] for name in bodies if name in whole},
    )


def _rows_of_groups(raw: RawMesh, solids: SolidCells) -> dict[str, IntegerArray]:
    """Solid cells of each group, those of names that differ in case or blanks together; shells and
    beams that a group holds besides them are left out.
    """
    used = set(np.unique(solids.block).tolist())
    rows: dict[str, IntegerArray] = {}
    for name, parts in raw.groups.items():
        own = [
            np.flatnonzero((solids.block == b) & np.isin(solids.row, some))
            for b, some in parts
            if b in used
        ]
        if own:
            word = _family_word(name)
            rows[word] = np.unique(np.concatenate([rows.get(word, own[0]), *own]))
    return rows


def _positive_cells(
    points: np.ndarray,
    cells: np.ndarray,
    word: str,
    source: str,
) -> np.ndarray:
    """Cells with positive volume; a simplex of the other sense is renumbered."""
    negative = straight_jacobian(points, cells, word) < 0
    if not negative.any():
        return cells
    if word not in FLIPPED_CORNERS:
        raise InputError(
            f"imported.file = '{source}': {negative.sum()} cells of type {word} are inside out"
        )
    result = cells.copy()
    result[negative] = cells[negative][:, FLIPPED_CORNERS[word]]
    return result


def _axis_turn(axis: np.ndarray) -> np.ndarray | None:
    """(3, 3) rotation that brings the engine axis to z; None where it is there."""
    z = axis / np.linalg.norm(axis)
    if abs(z[2] - 1) < 1e-12:
        return None
    radial = np.linalg.svd(z[None])[2][1]
    return np.array([radial, np.cross(z, radial), z])


def _turned(mesh: Mesh, turn: np.ndarray | None) -> Mesh:
    """The mesh in turned axes, which remembers how it was turned."""
    if turn is None:
        return mesh
    whole = turn if mesh.turn is None else turn @ mesh.turn
    return replace(mesh, points=mesh.points @ turn.T, turn=whole)


def _with_faces(
    mesh: Mesh,
    raw: RawMesh,
    wanted: frozenset[str],
) -> Mesh:
    """Named faces and node sets; nodes that no body uses are dropped."""
    cells = np.vstack(list(mesh.bodies.values()))
    used = np.unique(cells)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    points = mesh.points[used]
    cells = number[cells]
    mesh = replace(
        mesh,
        points=points,
        bodies={n: number[c] for n, c in mesh.bodies.items()},
        whole={n: np.where(c < 0, -1, number[c]) for n, c in mesh.whole.items()},
    )
    sets: dict[str, IntegerArray] = {}
    for name, nodes in raw.node_sets.items():
        inside = number[nodes][number[nodes] >= 0]
        word = _family_word(name)
        sets[word] = np.union1d(sets[word], inside) if word in sets else inside
    faces = named_facets(cells, mesh.cell_type, _corners_of_faces(raw, mesh.dimension, number))
    skin = boundary_facets(cells, mesh.cell_type) if sets else np.empty((0, 0), int)
    joined = {_family_word(name) for name in wanted}
    for name, nodes in sets.items():
        if name in faces and name not in joined:
            continue
        on_set = np.isin(skin, nodes)[:, : _facet_corners(mesh.cell_type)].all(axis=1)
        # three corners of a quadrilateral are no face
        held = without_halves(mesh, skin[on_set])
        if not len(held):
            continue
        faces[name] = np.vstack([faces[name], held]) if name in faces else held
        # new nodes in the middle of edges and faces belong to the set too
        sets[name] = np.union1d(nodes, faces[name])
    return replace(
        mesh,
        nodes=sets,
        faces={n: outward_faces(points, cells, mesh.cell_type, f) for n, f in faces.items()},
    )


def _facet_corners(cell_type: str) -> int:
    return len(FACETS[FAMILY[cell_type]][0])


def _corners_of_faces(
    raw: RawMesh,
    dimension: int,
    number: np.ndarray,
) -> dict[str, list[np.ndarray]]:
    """Corner nodes of all named facets: groups of cells of one dimension less, and surfaces.

    Raises:
        InputError: a face away from the bodies.
    """
    corners: dict[str, list[np.ndarray]] = {}
    for name, parts in raw.groups.items():
        words = [raw.blocks[b][0] for b, _ in parts]
        if words and all(DIMENSION[FAMILY[word]] == dimension - 1 for word in words):
            corners.setdefault(_family_word(name), []).extend(
                raw.blocks[b][1][rows][:, : CORNERS[FAMILY[raw.blocks[b][0]]]] for b, rows in parts
            )
    for name, surface in raw.surfaces.items():
        if surface:
            corners.setdefault(_family_word(name), []).extend(surface)
    for name, some in corners.items():
        corners[name] = [number[part] for part in some]
        if any((part < 0).any() for part in corners[name]):
            raise InputError(
                f"imported.file: face {name} has nodes that no cell uses, expected faces on the "
                "bodies"
            )
    return corners


def _find_pairs(
    mesh: Mesh,
    sectors: int,
    source: str,
    tolerance: float,
    cut_gap: float,
) -> Mesh:
    """Cyclic and contact pairs, as far as the names are there."""
    on = turn_about_axis(2 * np.pi / sectors) if sectors else np.eye(3)
    pairs: dict[str, Pair] = {}
    if sectors:
        for name in ("cyclic_low", "cyclic_high"):
            if name not in mesh.faces:
                raise InputError(
                    f"imported.file = '{source}': no face group '{name}', needed with "
                    f"imported.sectors = {sectors}{suggestion(name, mesh.faces)}"
                )
        mesh, pairs["cyclic"] = _cyclic_pair(mesh, on, tolerance, cut_gap)
        mesh = _turned(mesh, _centring_turn(mesh))
    shift = _row_pitch(mesh) if not sectors else np.zeros(3)
    motions = {
        "this": FaceMotion("seat_right", "damper_left"),
        "next": FaceMotion("seat_left", "damper_right", on, shift),
    }
    for name, motion in motions.items():
        if motion.master in mesh.faces and motion.slave in mesh.faces:
            pairs[name] = _matched_contact(mesh, motion, sectors, tolerance)
    row = Sector(sectors, on, shift) if sectors or shift.any() else None
    return replace(mesh, pairs=pairs, sector=row)


def _matched_contact(
    mesh: Mesh,
    motion: FaceMotion,
    sectors: int,
    tolerance: float,
) -> Pair:
    """A contact pair; without matched nodes where those of a wheel's seat and flank differ but lie
    on each other.

    Raises:
        InputError: neither; with a hint when the number of sectors was left out.
    """
    try:
        return match_faces(mesh.points, mesh.faces, motion, mesh.dimension, tolerance)
    except InputError as error:
        if sectors and _faces_look(mesh, motion):
            return motion.pair()
        hint = _side_hint(mesh, motion, sectors)
        raise InputError(f"{error}{hint}") from None


def _side_hint(mesh: Mesh, motion: FaceMotion, sectors: int) -> str:
    """What to change where the flank lies one sector before its seat, as in a mirrored model."""
    if not sectors:
        return "; on a wheel, imported.sectors must be given"
    seat, flank = (mesh.points[np.unique(mesh.faces[name])].mean(axis=0) for name in motion.names)
    back = turn_about_axis(-2 * np.pi / sectors)
    if np.linalg.norm(back @ seat - flank) > _measure_face(mesh, motion.master)[0]:
        return ""
    if np.array_equal(motion.rotation, np.eye(3)):
        return (
            f"; the damper is the one on the other side of the blade: expected it turned by "
            f"{360 / sectors:.6g} deg about imported.axis, between {motion.master} and the next "
            "blade"
        )
    return (
        "; blades follow each other the other way round about imported.axis: expected the axis in "
        "the opposite direction, about which the next blade is on the side of seat_right"
    )


def _faces_look(mesh: Mesh, motion: FaceMotion) -> bool:
    """Two faces look at each other, and half of the smaller one's nodes are within an edge of the
    other's.
    """
    master, slave = (mesh.points[np.unique(mesh.faces[name])] for name in motion.names)
    edges, normals = zip(*(_measure_face(mesh, name) for name in motion.names), strict=True)
    there = motion.image_back(slave)
    apart = cKDTree(master).query(there)[0]
    back = cKDTree(there).query(master)[0]
    near = max((apart < max(edges)).mean(), (back < max(edges)).mean())
    return bool(near > 0.5 and normals[0] @ (normals[1] @ motion.rotation) < OPPOSITE_COSINE)


def _measure_face(mesh: Mesh, name: str) -> tuple[float, np.ndarray]:
    """Longest edge [m] and mean outward normal (3,) of a face group, from its elements' corners."""
    x = mesh.points[mesh.faces[name][:, : mesh.dimension]]
    first = x[:, 1] - x[:, 0]
    last = x[:, -1] - x[:, 0]
    normal = np.cross(first, last if mesh.dimension == 3 else [0.0, 0.0, 1.0]).sum(axis=0)
    edge = max(np.linalg.norm(first, axis=1).max(), np.linalg.norm(last, axis=1).max())
    return float(edge), normal / np.linalg.norm(normal)


def _row_pitch(mesh: Mesh) -> np.ndarray:
    """Shift [m] from seat_left to damper_right: a straight row of blades; zero when the faces are
    not there.
    """
    if not {"seat_left", "damper_right"} <= set(mesh.faces):
        return np.zeros(3)
    low, high = (np.unique(mesh.faces[name]) for name in ("seat_left", "damper_right"))
    return mesh.points[high].mean(axis=0) - mesh.points[low].mean(axis=0)


def _cyclic_pair(
    mesh: Mesh,
    on: np.ndarray,
    tolerance: float,
    cut_gap: float,
) -> tuple[Mesh, Pair]:
    """The cyclic pair; the names are swapped when the file has them the other way round. Without
    matched nodes where they differ, but the faces lie on each other.

    Raises:
        InputError: neither.
    """
    motion = FaceMotion("cyclic_low", "cyclic_high", on)
    names = motion.names
    swapped = replace(
        mesh,
        faces={**mesh.faces, names[0]: mesh.faces[names[1]], names[1]: mesh.faces[names[0]]},
    )
    errors = []
    for some in (mesh, swapped):
        try:
            found = match_faces(some.points, some.faces, motion, mesh.dimension, tolerance)
            return some, found
        except InputError as error:
            errors.append(error)
    gaps = [_largest_gap(some, names, on) for some in (mesh, swapped)]
    best = int(np.argmin(gaps))
    if gaps[best] > cut_gap:
        hint = "" if np.isinf(gaps[best]) else f"; their surfaces are {gaps[best]:.2g} of it apart"
        raise InputError(
            f"{errors[0]}, or faces within imported.cut_gap = {cut_gap:g} of their size, which a "
            f"mortar ties{hint}"
        )
    return (mesh, swapped)[best], motion.pair()


def _largest_gap(
    mesh: Mesh,
    names: tuple[str, str],
    on: np.ndarray,
) -> float:
    """Largest distance of a node of one cut face from the other face, as a share of its size."""
    if mesh.dimension == 2:
        return np.inf
    low, high = (mesh.faces[name] for name in names)
    if np.intersect1d(low, high).size:
        return np.inf
    back = mesh.points @ on
    nodes = np.unique(low), np.unique(high)
    size = np.ptp(mesh.points[nodes[0]], axis=0).max()
    there = distance_to_face(back[nodes[1]], mesh.points, low)
    here = distance_to_face(mesh.points[nodes[0]], back, high)
    return float(max(there.max(), here.max()) / size)


def _tie_notes(mesh: Mesh) -> Iterator[str]:
    """What the user has to know of cut faces that do not match."""
    if "cyclic" in mesh.pairs and not mesh.pairs["cyclic"].nodes.size:
        low, high = (len(np.unique(mesh.faces[name])) for name in ("cyclic_low", "cyclic_high"))
        yield (
            f"the nodes of the cut faces do not match ({low} and {high}): they are tied in the "
            "mean by a mortar, which costs accuracy as coarser elements there would"
        )


def _centring_turn(mesh: Mesh) -> np.ndarray | None:
    """(3, 3) rotation about z that brings +x midway between the cyclic faces; None where it is."""
    low, high = (
        mesh.points[np.unique(mesh.faces[name])].mean(axis=0)[:2]
        for name in ("cyclic_low", "cyclic_high")
    )
    middle = low / np.linalg.norm(low) + high / np.linalg.norm(high)
    angle = np.arctan2(middle[1], middle[0])
    return None if abs(angle) < 1e-9 else turn_about_axis(-angle)


def _edge_length(mesh: Mesh) -> float:
    """Mean length [m] of the first edge of the cells."""
    cells = np.vstack(list(mesh.bodies.values()))
    return float(np.linalg.norm(mesh.points[cells[:, 1]] - mesh.points[cells[:, 0]], axis=1).mean())

"""What a mesh file holds and what a run would still need: bodies, cells, unit, sets, numbered
faces, cut faces and their number of sectors; and a scene to start from.

Everything here is a guess to be looked at: nothing of it decides a run.
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bladefem.errors import InputError, missing_file
from bladefem.util.arrays import RealArray

from .imported_check import STEP_SUFFIXES
from .numbered_faces import NumberedFaces, face_corners, face_word, numbered_faces
from .raw_mesh import SUFFIX_READERS, RawMesh, read_raw
from .step_file import NEAREST_TOLERANCE, coarse_step
from .topology import CORNERS, DIMENSION, FAMILY, NODES

# lengths [m] of blades and sectors: a factor to metres is right that brings the model between them
PLAUSIBLE_LENGTHS = (0.01, 3.0)
# factors to metres, the likeliest first
UNIT_FACTORS = (1.0, 1e-3, 0.0254, 1e-2)
# what no mesh tells, with values to start from: left out, the blade would turn at a default speed
STARTING_PHYSICS = (
    "",
    "[material.blade]".ljust(32) + "# steel; yours",
    'E = "210 GPa"',
    "nu = 0.3",
    'rho = "7850 kg/m^3"',
    "",
    "[operation]",
    'speed = "0 rpm"'.ljust(32) + "# at rest; yours",
)
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# of the model's size: distance of nodes that match after a turn
MATCH_TOLERANCE = 1e-3
# of the largest coordinate of a face's centre
ROUNDOFF_SHARE = 1e-6
# from a whole number of sectors
WHOLE_NUMBER_TOLERANCE = 0.01
MAX_SECTORS = 400
# what a scene says in addition to a STEP file
SEATS_NEED = "imported.seats = two plane platform faces: the damper is drawn between them"
# where no cut faces were found in it
UNCUT_SECTOR_NEEDS = (
    "imported.sectors = number of blades, for a sector of a wheel; 0 for a single blade"
)
# names that a task needs, and what they are for
NEEDED_NAMES = {
    "clamp": "face or node set that is held; support.clamp = '' where nothing is",
    "cyclic_low": "cut face of a sector of a wheel, with cyclic_high on the other side; a single "
    "blade has none",
    "tip_mid": "node set or face that the excitation acts on (excitation.at), for responses",
    "seat_left": "platform face that the damper of the blade before presses on, for a damper",
    "seat_right": "platform face that this blade's damper presses on, for a damper",
    "damper": "body of the damper, with faces damper_left and damper_right, for a damper",
}
# words of a set's name that stand for a name in a file of a single blade
USUAL_WORDS = {"clamp": {"root", "bore", "hub", "fixed"}, "tip_mid": {"tip"}}
# the other names that a set of the file may be meant for
FURTHER_NAMES = ("cyclic_high", "damper_left", "damper_right")


@dataclass(frozen=True)
class FacePart:
    """One numbered face; lengths in the file's unit."""

    # "face_1", ...; "outer_face_1", ... where the file has sets of such names
    name: str
    facets: int
    area: float
    # (3,)
    centre: RealArray
    # (3,) mean outward unit normal, zero of a closed face
    normal: RealArray
    # all facets look the same way
    plane: bool


@dataclass(frozen=True)
class CutFaces:
    """Faces that a turn about an axis of the file carries onto each other."""

    # "x", "y" or "z"
    axis: str
    sectors: int
    # names of faces, in the same order
    low: tuple[str, ...]
    high: tuple[str, ...]


@dataclass(frozen=True)
class Look:
    """What is in a file; lengths in the file's unit."""

    file: Path
    raw: RawMesh
    # meshio's word -> number of cells, all dimensions
    cells: dict[str, int]
    # cells of each connected body, the largest first
    bodies: tuple[int, ...]
    # (2, 3) lowest and highest coordinates
    box: RealArray
    # factor to metres, guessed
    scale: float
    # name -> what it is and how much it holds
    sets: dict[str, str]
    outside: NumberedFaces
    faces: tuple[FacePart, ...]
    cut: CutFaces | None
    # names of the faces nearest to the axis, when there are cut faces
    bore: tuple[str, ...]
    # name that a task needs -> the one set of the file whose name contains it
    alike: dict[str, str]
    # one sentence each
    missing: tuple[str, ...]


def look_at(file: str | Path) -> Look:
    """Everything that a mesh file says about itself.

    Raises:
        InputError: the file cannot be read, or holds no solids.
    """
    _check_kind(Path(file))
    drawing = is_drawing(Path(file))
    raw = coarse_step(file) if drawing else read_raw(Path(file))
    solid = [cells for word, cells in raw.blocks if DIMENSION.get(FAMILY.get(word, "")) == 3]
    if not solid:
        there = "; ".join([*_flat_words(raw), *raw.notes]) or "it has none at all"
        raise InputError(
            f"'{file}': no solid cells ({there}), expected tetrahedra, hexahedra, wedges or "
            "pyramids"
        )
    used = np.unique(np.concatenate([cells.ravel() for cells in solid]))
    box = np.stack([raw.points[used].min(axis=0), raw.points[used].max(axis=0)])
    outside = numbered_faces(raw)
    names = [f"{face_word(raw)}{number + 1}" for number in range(outside.count)]
    if drawing:
        outside, names = _drawn_faces(raw, outside)
    faces = tuple(_face_part(outside, number, name) for number, name in enumerate(names))
    size = float(np.ptp(box, axis=0).max())
    cut = _cut_faces(raw, outside, faces, size, by_outline=drawing)
    if cut is None:
        # nodes inside of faces need not match, which are then tied by a mortar
        cut = _cut_faces(raw, outside, faces, size, by_outline=True)
    bore = () if cut is None else _bore_faces(raw, outside, faces, cut)
    alike = {} if drawing else _alike_names(raw)
    if not drawing and cut is None:
        alike |= _usual_names(raw, alike)
    tip = _tip_face(raw, outside, faces, cut)
    return Look(
        Path(file),
        raw,
        _cell_counts(raw),
        _body_sizes(raw),
        box,
        # a STEP file states its unit
        1.0 if drawing else _guessed_scale(size),
        _set_kinds(raw),
        outside,
        faces,
        cut,
        bore,
        alike,
        _missing_in_drawing(cut, tip) if drawing else _missing_names(raw, alike, cut, bore, tip),
    )


def _flat_words(raw: RawMesh) -> list[str]:
    """Such as "120 triangle6"."""
    return [f"{count} {word}" for word, count in _cell_counts(raw).items()]


def _check_kind(file: Path) -> None:
    """Refuse a file that is not there, or of which there is no reader."""
    if not file.is_file():
        raise InputError(f"{file}: {missing_file(file)}")
    known = sorted((*SUFFIX_READERS, *STEP_SUFFIXES))
    if file.suffix.lower() not in known:
        raise InputError(f"{file}: unknown kind of mesh; known are {', '.join(known)}")


def is_drawing(file: Path) -> bool:
    """Whether a file is a STEP file, by its ending."""
    return file.suffix.lower() in STEP_SUFFIXES


def starting_scene(look: Look, folder: Path | None = None) -> str:
    """Text of a scene that holds what was guessed, with the rest as comments.

    Args:
        folder: where the scene will be; file names in it start there. That of the file when None.
    """
    file = os.path.relpath(look.file, folder or look.file.parent)
    names = [f"{new} = {old}" for new, old in look.alike.items()]
    taken = _names_of(look.raw) | set(look.alike)
    if look.cut is not None:
        wanted = {"cyclic_low": look.cut.low, "cyclic_high": look.cut.high}
        if look.bore:
            wanted["clamp"] = look.bore
        names += [f"{new} = {' + '.join(old)}" for new, old in wanted.items() if new not in taken]
    axis = AXES[look.cut.axis] if look.cut else AXES["z"]
    # which states its unit
    drawing = is_drawing(look.file)
    origin = "guessed from cut faces" if look.cut else "no cut faces were found"
    lines = [
        f"title = {_quoted(look.file.stem)}",
        'kind = "imported"',
        "",
        "[imported]",
        f"file = {_quoted(file)}",
        *([] if drawing else [f"scale = {look.scale:g}".ljust(32) + "# guessed: to metres"]),
        f"sectors = {look.cut.sectors if look.cut else 0}".ljust(32) + f"# {origin}",
        f"axis = {[float(v) for v in axis]}".ljust(32) + "# of the engine",
    ]
    if names:
        lines += ["names = [".ljust(32) + "# guessed", *(f'    "{name}",' for name in names), "]"]
    if not drawing and any(
        NODES[w] == CORNERS[FAMILY[w]] for w in look.cells if DIMENSION[FAMILY[w]] == 3
    ):
        lines.append('linear = "promote"'.ljust(32) + "# first-order cells get mid-side nodes")
    lines += STARTING_PHYSICS
    missing = ["", "# still missing:", *(f"# {sentence}" for sentence in look.missing)]
    return "\n".join([*lines, *(missing if look.missing else []), ""])


def _quoted(text: str) -> str:
    """A basic string of TOML, which has the escapes of JSON."""
    return json.dumps(text, ensure_ascii=False)


def _cell_counts(raw: RawMesh) -> dict[str, int]:
    counts: dict[str, int] = {}
    for word, cells in raw.blocks:
        counts[word] = counts.get(word, 0) + len(cells)
    return counts


def _body_sizes(raw: RawMesh) -> tuple[int, ...]:
    """Cells of each connected body, the largest first."""
    rows = []
    columns = []
    start = 0
    for word, cells in raw.blocks:
        if DIMENSION.get(FAMILY.get(word, "")) != 3:
            continue
        corners = cells[:, : CORNERS[FAMILY[word]]]
        rows.append(np.repeat(start + np.arange(len(cells)), corners.shape[1]))
        columns.append(corners.ravel())
        start += len(cells)
    cell = np.concatenate(rows)
    node = np.concatenate(columns)
    size = start + len(raw.points)
    graph = coo_matrix((np.ones(len(cell)), (cell, start + node)), shape=(size, size))
    label = connected_components(graph, directed=False)[1][:start]
    return tuple(sorted(np.unique(label, return_counts=True)[1].tolist(), reverse=True))


def _guessed_scale(size: float) -> float:
    """Factor to metres that makes the model as large as blades are."""
    fitting = [s for s in UNIT_FACTORS if PLAUSIBLE_LENGTHS[0] <= s * size <= PLAUSIBLE_LENGTHS[1]]
    return fitting[0] if fitting else 1.0


def _set_kinds(raw: RawMesh) -> dict[str, str]:
    found = {}
    for name, parts in raw.groups.items():
        words = sorted({FAMILY.get(raw.blocks[b][0], "cell") for b, _ in parts})
        count = sum(len(rows) for _, rows in parts)
        found[name] = f"{count} cells ({', '.join(words)})"
    for name, surface in raw.surfaces.items():
        found[name] = f"surface of {sum(len(part) for part in surface)} facets"
    for name, nodes in raw.node_sets.items():
        found.setdefault(name, f"{len(nodes)} nodes")
    return found


def _drawn_faces(raw: RawMesh, outside: NumberedFaces) -> tuple[NumberedFaces, list[str]]:
    """The outer facets by the faces of the drawing, in its order, with their names."""
    known: dict[tuple[int, ...], int] = {}
    names: list[str] = []
    for name, parts in raw.groups.items():
        blocks = [
            (block, rows) for block, rows in parts if DIMENSION[_cell_family(raw, block)] == 2
        ]
        for block, rows in blocks:
            for corners in np.sort(raw.blocks[block][1][rows][:, :3], axis=1).tolist():
                known[tuple(corners)] = len(names)
        names += [name] if blocks else []
    facets = np.sort(outside.corners[:, :3], axis=1).tolist()
    number = np.array([known.get(tuple(corners), -1) for corners in facets])
    return replace(outside, number=number), names


def _cell_family(raw: RawMesh, block: int) -> str:
    return FAMILY[raw.blocks[block][0]]


def _face_part(
    outside: NumberedFaces,
    number: int,
    name: str,
) -> FacePart:
    mine = outside.number == number
    normals = outside.normals[mine]
    area = np.linalg.norm(normals, axis=1)
    total = float(area.sum())
    mean = normals.sum(axis=0)
    length = float(np.linalg.norm(mean))
    centre = np.average(outside.centres[mine], axis=0, weights=np.maximum(area, 1e-300))
    # round-off is no coordinate
    centre[np.abs(centre) < ROUNDOFF_SHARE * np.abs(centre).max(initial=0.0)] = 0.0
    return FacePart(
        name,
        int(mine.sum()),
        total,
        centre,
        mean / length if length > 1e-6 * total else np.zeros(3),
        bool(length > (1 - 1e-6) * total),
    )


def _cut_faces(
    raw: RawMesh,
    outside: NumberedFaces,
    faces: tuple[FacePart, ...],
    size: float,
    by_outline: bool,
) -> CutFaces | None:
    """Pairs of faces on which nodes match after one turn about an axis through the origin.

    Args:
        by_outline: only the nodes on the edges of faces match, as those of a drawing, whose mesh is
            made for this look face by face.
    """
    best: CutFaces | None = None
    most = 0.0
    # face by face is quick to rule out by area and place; nodes are compared for what is left
    alike = [
        (i, j)
        for i, j in permutations(range(len(faces)), 2)
        if _similar_faces(faces[i], faces[j], by_outline)
    ]
    for axis in AXES:
        pairs: dict[int, list[tuple[int, int]]] = {}
        for i, j in alike:
            sectors = _sector_count(faces[i].centre, faces[j].centre, axis, size)
            if sectors and _cut_faces_match(raw, outside, (i, j), axis, sectors, size, by_outline):
                pairs.setdefault(sectors, []).append((i, j))
        for sectors, some in pairs.items():
            low, high = ([one[k] for one in some] for k in (0, 1))
            # faces that are carried on by a second turn are no cut faces
            if set(low) & set(high):
                continue
            area = sum(faces[i].area for i in low)
            # an axis that matches as much as an earlier one, to rounding, does not replace it
            if area > most * (1 + 1e-9):
                most = area
                names = (tuple(faces[i].name for i in side) for side in (low, high))
                best = CutFaces(axis, sectors, *names)
    return best


def _similar_faces(one: FacePart, other: FacePart, by_outline: bool) -> bool:
    alike = by_outline or one.facets == other.facets
    return alike and abs(one.area - other.area) < 1e-3 * one.area


def _sector_count(
    start: np.ndarray,
    end: np.ndarray,
    axis: str,
    size: float,
) -> int:
    """How many turns from one place to the other make a wheel, 0 when no whole number does."""
    k = "xyz".index(axis)
    a, b = (k + 1) % 3, (k + 2) % 3
    radii = [np.hypot(x[a], x[b]) for x in (start, end)]
    if (
        abs(start[k] - end[k]) > MATCH_TOLERANCE * size
        or abs(radii[0] - radii[1]) > MATCH_TOLERANCE * size
    ):
        return 0
    angle = (np.arctan2(end[b], end[a]) - np.arctan2(start[b], start[a])) % (2 * np.pi)
    # the other way round is found with the faces exchanged
    if radii[0] < MATCH_TOLERANCE * size or not 2 * np.pi / MAX_SECTORS < angle < np.pi * 0.7:
        return 0
    count = 2 * np.pi / angle
    return (
        round(count)
        if abs(count - round(count)) < WHOLE_NUMBER_TOLERANCE * max(count / 36, 1.0)
        else 0
    )


def _cut_faces_match(
    raw: RawMesh,
    outside: NumberedFaces,
    pair: tuple[int, int],
    axis: str,
    sectors: int,
    size: float,
    by_outline: bool,
) -> bool:
    """Whether the corner nodes of one face, turned, lie on those of the other."""
    chosen = _edge_nodes if by_outline else _corner_nodes
    one, other = (chosen(outside, i) for i in pair)
    if len(one) != len(other):
        return False
    k = "xyz".index(axis)
    a, b = (k + 1) % 3, (k + 2) % 3
    angle = 2 * np.pi / sectors
    x = raw.points[one].copy()
    first = x[:, a].copy()
    x[:, a] = np.cos(angle) * first - np.sin(angle) * x[:, b]
    x[:, b] = np.sin(angle) * first + np.cos(angle) * x[:, b]
    return bool(cKDTree(raw.points[other]).query(x)[0].max() < MATCH_TOLERANCE * size)


def _corner_nodes(outside: NumberedFaces, number: int) -> np.ndarray:
    """Nodes at the corners of a face's facets."""
    return np.unique(np.concatenate([c.ravel() for c in face_corners(outside, number)]))


def _edge_nodes(outside: NumberedFaces, number: int) -> np.ndarray:
    """Nodes on the outline of a face: the sides that one of its facets has alone."""
    sides = np.concatenate(
        [
            np.sort(np.stack([c, np.roll(c, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
            for c in face_corners(outside, number)
        ]
    )
    found, count = np.unique(sides, axis=0, return_counts=True)
    return np.unique(found[count == 1])


def _bore_faces(
    raw: RawMesh,
    outside: NumberedFaces,
    faces: tuple[FacePart, ...],
    cut: CutFaces,
) -> tuple[str, ...]:
    """The face whose farthest node is nearest to the axis, all of them where several are: a disc is
    held there, and CAD systems write a bore in several pieces.
    """
    radius = _radii(raw, cut.axis)
    reach = {
        face.name: max(radius[c].max() for c in face_corners(outside, i))
        for i, face in enumerate(faces)
        if face.name not in (*cut.low, *cut.high)
    }
    nearest = min(reach.values(), default=0.0) + NEAREST_TOLERANCE * float(radius.max())
    return tuple(name for name in reach if reach[name] <= nearest)


def _tip_face(
    raw: RawMesh,
    outside: NumberedFaces,
    faces: tuple[FacePart, ...],
    cut: CutFaces | None,
) -> str | None:
    """The face whose nearest node is farthest from the axis; unknown without an axis."""
    if cut is None:
        return None
    radius = _radii(raw, cut.axis)
    start = {
        face.name: min(radius[c].min() for c in face_corners(outside, i))
        for i, face in enumerate(faces)
    }
    return max(start, key=lambda name: start[name])


def _radii(raw: RawMesh, axis: str) -> np.ndarray:
    """(n,) distance of all nodes from an axis of the file."""
    k = "xyz".index(axis)
    return np.asarray(np.hypot(raw.points[:, (k + 1) % 3], raw.points[:, (k + 2) % 3]))


def _names_of(raw: RawMesh) -> set[str]:
    every = (*raw.groups, *raw.node_sets, *raw.surfaces)
    return {"_".join(name.lower().split()) for name in every}


def _alike_names(raw: RawMesh) -> dict[str, str]:
    """Names that a task needs and no set has as they are, with the one set whose name contains
    them: "seat_left" with "PART-1.Seat-Left".
    """
    there = _names_of(raw)
    solids = {
        name
        for name, parts in raw.groups.items()
        if any(DIMENSION[_cell_family(raw, block)] == 3 for block, _ in parts)
    }
    found = {}
    for wanted in (*NEEDED_NAMES, *FURTHER_NAMES):
        among = solids if wanted == "damper" else {*raw.groups, *raw.node_sets, *raw.surfaces}
        fitting = [name for name in among if _letters(wanted) in _letters(name)]
        if wanted not in there and len(fitting) == 1:
            found[wanted] = fitting[0]
    return found


def _usual_names(raw: RawMesh, alike: dict[str, str]) -> dict[str, str]:
    """Names that a task needs and neither a set nor a guess has, with the one set of faces or nodes
    that has a word for it in its name: "clamp" with "BLADE_ROOT". Of a sector the bore is the
    better guess.
    """
    there = _names_of(raw) | set(alike)
    flat = {
        name
        for name, parts in raw.groups.items()
        if all(DIMENSION[_cell_family(raw, block)] == 2 for block, _ in parts)
    }
    among = flat | {*raw.node_sets, *raw.surfaces} - set(raw.groups)
    found = {}
    for wanted, words in USUAL_WORDS.items():
        fitting = [name for name in among if words & set(re.findall("[a-z]+", name.lower()))]
        if wanted not in there and len(fitting) == 1:
            found[wanted] = fitting[0]
    return found


def _letters(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _missing_in_drawing(cut: CutFaces | None, tip: str | None) -> tuple[str, ...]:
    """What a run of a STEP file needs and its faces do not tell."""
    example = "'tip = face_7'" if tip is None else f"'tip = {tip}', the face farthest out"
    names = f"imported.names, such as {example}, for the face of excitation.at"
    return (*(() if cut is not None else (UNCUT_SECTOR_NEEDS,)), names, SEATS_NEED)


def _missing_names(
    raw: RawMesh,
    alike: dict[str, str],
    cut: CutFaces | None,
    bore: tuple[str, ...],
    tip: str | None,
) -> tuple[str, ...]:
    """What a run needs and neither a set of the file nor a guess provides."""
    there = _names_of(raw) | set(alike)
    if cut is not None:
        there |= {"cyclic_low", "clamp"} if bore else {"cyclic_low"}
    needed = [name for name in NEEDED_NAMES if name not in there]
    hints = {} if tip is None else {"tip_mid": f"; 'tip_mid = {tip}' is the face farthest out"}
    return tuple(f"{name}: {NEEDED_NAMES[name]}{hints.get(name, '')}" for name in needed)

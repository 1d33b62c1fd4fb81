"""Reader of Abaqus and CalculiX decks (.inp): nodes, elements, sets and surfaces, flat or in parts
and instances.

Materials, sections, boundary conditions and steps are skipped: they belong to the scene. Elements
without volume or area (springs, masses, beams, rigid bodies) are left out and counted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bladefem.errors import InputError

from .abaqus_deck import Keyword, deck_error, keywords_of
from .raw_mesh import RawMesh, from_vtk_order
from .second_order_cells import edges_of_quads
from .topology import CORNERS, NODES, QUADS

# element type up to its first letter behind the number of nodes -> meshio's word
SOLID_TYPES = {
    "C3D4": "tetra",
    "C3D10": "tetra10",
    "C3D8": "hexahedron",
    "C3D20": "hexahedron20",
    "C3D27": "hexahedron27",
    "C3D6": "wedge",
    "C3D15": "wedge15",
    "C3D5": "pyramid",
    "C3D13": "pyramid13",
}
# triangles and quadrilaterals: shells, membranes, surface elements, plane elements
FLAT_CELLS = {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8"}
FLAT_PREFIXES = ("S", "SFM3D", "M3D", "CPS", "CPE", "CPEG", "CAX", "STRI", "R3D", "DS", "CPT")
# corners of the faces S1, S2, ... of a cell
CELL_FACES: dict[str, list[tuple[int, ...]]] = {
    "tetra": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    "hexahedron": [
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ],
    "wedge": [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)],
    "pyramid": [(0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)],
}
# keywords that make nodes and elements without listing them, or change what coordinates mean
MESH_MAKERS = ("ELCOPY", "ELGEN", "NCOPY", "NFILL", "NGEN", "NMAP", "SYSTEM")
# of one range of a set: more is a slip of the pen, and fills the memory
MOST_MEMBERS = 50_000_000
# a node or element: instance ("" outside instances), its number there
Key = tuple[str, int]


@dataclass
class _Scope:
    """A part, or the deck outside parts."""

    nodes: dict[Key, list[float]] = field(default_factory=dict)
    # meshio's word, node keys, where it is written
    elements: dict[Key, tuple[str, list[Key]]] = field(default_factory=dict)
    node_sets: dict[str, list[Key]] = field(default_factory=dict)
    element_sets: dict[str, list[Key]] = field(default_factory=dict)
    # (element set or number, face label) of each line
    surfaces: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    # type -> number of elements left out
    left_out: dict[str, int] = field(default_factory=dict)
    # surfaces made of nodes -> names of node sets
    node_surfaces: dict[str, list[str]] = field(default_factory=dict)


def read_inp(file: Path) -> RawMesh:
    """Nodes, elements, sets and surfaces of a deck.

    Raises:
        InputError: a line that cannot be understood, with its file and number.
    """
    root = _Scope()
    parts: dict[str, _Scope] = {}
    scope = root
    for keyword in keywords_of(file):
        if keyword.name == "PART":
            scope = parts.setdefault(keyword.options.get("NAME", "").upper(), _Scope())
        elif keyword.name in ("END PART", "ASSEMBLY"):
            scope = root
        elif keyword.name == "INSTANCE":
            _add_instance(root, parts, keyword)
        elif keyword.name in MESH_MAKERS and keyword.data:
            raise deck_error(
                keyword.file,
                keyword.line,
                f"*{keyword.name} is not followed, expected a deck that lists all nodes and "
                "elements, in one system of coordinates",
            )
        elif keyword.name in KEYWORD_READERS:
            if "INPUT" in keyword.options:
                raise deck_error(
                    keyword.file,
                    keyword.line,
                    f"*{keyword.name} with INPUT is not followed, expected its lines in the deck, "
                    "or *INCLUDE",
                )
            KEYWORD_READERS[keyword.name](scope, keyword)
    return _raw_mesh(root, file)


def _read_nodes(scope: _Scope, keyword: Keyword) -> None:
    name = keyword.options.get("NSET", "")
    system = keyword.options.get("SYSTEM", "").upper() or "R"
    if system not in CARTESIAN:
        raise deck_error(
            keyword.file,
            keyword.line,
            f"*NODE, SYSTEM={system}: expected R, C or S (rectangular, cylindrical, spherical)",
        )
    for line, fields in keyword.data:
        try:
            tag = int(fields[0])
            place = [float(v.replace("D", "E").replace("d", "e") or 0) for v in fields[1:4]]
        except ValueError:
            raise deck_error(
                keyword.file, line, f"'{', '.join(fields)}' is no node, expected number, x, y, z"
            ) from None
        scope.nodes["", tag] = CARTESIAN[system](*[*place, 0.0, 0.0, 0.0][:3])
        if name:
            scope.node_sets.setdefault(name, []).append(("", tag))


def _of_cylinder(radius: float, angle: float, height: float) -> list[float]:
    """x, y, z of radius, angle from x [degrees] and z."""
    turn = np.radians(angle)
    return [radius * float(np.cos(turn)), radius * float(np.sin(turn)), height]


def _of_sphere(radius: float, angle: float, elevation: float) -> list[float]:
    """x, y, z of radius, angle from x and elevation above the x-y plane [degrees]."""
    up = np.radians(elevation)
    return _of_cylinder(radius * float(np.cos(up)), angle, radius * float(np.sin(up)))


# x, y, z from the three coordinates of *NODE, SYSTEM=...
CARTESIAN: dict[str, Callable[[float, float, float], list[float]]] = {
    "R": lambda x, y, z: [x, y, z],
    "C": _of_cylinder,
    "S": _of_sphere,
}


def _read_elements(scope: _Scope, keyword: Keyword) -> None:
    kind = keyword.options.get("TYPE", "").upper()
    word = _word_of(kind)
    if word is None:
        count = len(keyword.data)
        scope.left_out[kind] = scope.left_out.get(kind, 0) + count
        if keyword.options.get("ELSET"):
            # other sets may name it
            scope.element_sets.setdefault(keyword.options["ELSET"], [])
        return
    needed = int(NODE_COUNT[word])
    name = keyword.options.get("ELSET", "")
    values: list[int] = []
    for line, fields in keyword.data:
        try:
            values += [int(v) for v in fields if v]
        except ValueError:
            raise deck_error(
                keyword.file, line, f"'{', '.join(fields)}' is no element, expected whole numbers"
            ) from None
        if len(values) > needed + 1:
            raise deck_error(
                keyword.file,
                line,
                f"element {values[0]} has {len(values) - 1} nodes, expected {needed} of a {kind}",
            )
        if len(values) == needed + 1:
            scope.elements["", values[0]] = (word, [("", v) for v in values[1:]])
            if name:
                scope.element_sets.setdefault(name, []).append(("", values[0]))
            values = []
    if values:
        raise deck_error(
            keyword.file,
            keyword.data[-1][0],
            f"element {values[0]} has {len(values) - 1} nodes, expected {needed} of a {kind}",
        )


NODE_COUNT = {
    **{word: int(kind[3:]) for kind, word in SOLID_TYPES.items()},
    **{word: count for count, word in FLAT_CELLS.items()},
}


def _word_of(kind: str) -> str | None:
    """meshio's word of an element type, None for one without volume or area."""
    letters = kind.rstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
    if letters in SOLID_TYPES:
        return SOLID_TYPES[letters]
    digits = letters[len(letters.rstrip("0123456789")) :]
    prefix = letters[: len(letters) - len(digits)]
    if prefix in FLAT_PREFIXES and digits and int(digits) in FLAT_CELLS:
        return FLAT_CELLS[int(digits)]
    return None


def _read_node_set(scope: _Scope, keyword: Keyword) -> None:
    _read_set(scope.node_sets, keyword, "NSET", "node")


def _read_element_set(scope: _Scope, keyword: Keyword) -> None:
    _read_set(scope.element_sets, keyword, "ELSET", "element")


def _read_set(
    sets: dict[str, list[Key]],
    keyword: Keyword,
    option: str,
    what: str,
) -> None:
    """Add the members of an *NSET or *ELSET to its set: numbers, ranges, and names of other sets.

    Args:
        option: that names the set, "NSET" or "ELSET".
        what: "node" or "element", for messages.
    """
    name = keyword.options.get(option)
    if not name:
        raise deck_error(keyword.file, keyword.line, f"*{option} without a name")
    instance = keyword.options.get("INSTANCE", "").upper()
    # Abaqus does not tell upper and lower case apart
    known = {other.upper(): other for other in sets}
    members = sets.setdefault(known.get(name.upper(), name), [])
    for line, fields in keyword.data:
        words = [v.strip("\"'") for v in fields if v]
        if "GENERATE" in keyword.options:
            members += [(instance, tag) for tag in _generated_range(words, keyword, line)]
            continue
        for word in words:
            if word.lstrip("-").isdigit():
                members.append((instance, int(word)))
            elif word.upper() in known:
                members += sets[known[word.upper()]]
            else:
                members.append(_instance_member(word, keyword, line, what))


def _generated_range(
    words: list[str],
    keyword: Keyword,
    line: int,
) -> range:
    try:
        low, high, step = [*map(int, words), 1][:3]
        found = range(low, high + 1, step)
    except ValueError:
        raise deck_error(
            keyword.file, line, f"'{', '.join(words)}', expected first, last, step"
        ) from None
    if len(found) > MOST_MEMBERS:
        raise deck_error(
            keyword.file,
            line,
            f"'{', '.join(words)}' are {len(found)} members, expected at most {MOST_MEMBERS}",
        )
    return found


def _instance_member(
    word: str,
    keyword: Keyword,
    line: int,
    what: str,
) -> Key:
    """A member written as "instance.number"."""
    instance, dot, tag = word.rpartition(".")
    if not (dot and tag.isdigit()):
        raise deck_error(
            keyword.file, line, f"there is no {what} set '{word}', expected one defined before"
        )
    return instance.upper(), int(tag)


def _read_surface(scope: _Scope, keyword: Keyword) -> None:
    name = keyword.options.get("NAME")
    if not name:
        raise deck_error(keyword.file, keyword.line, "*SURFACE without a name")
    kind = keyword.options.get("TYPE", "ELEMENT").upper()
    for _, fields in keyword.data:
        first = fields[0].strip("\"'")
        if kind == "NODE":
            scope.node_surfaces.setdefault(name, []).append(first)
        elif kind == "ELEMENT":
            label = fields[1].upper() if len(fields) > 1 else ""
            scope.surfaces.setdefault(name, []).append((first, label))


KEYWORD_READERS = {
    "NODE": _read_nodes,
    "ELEMENT": _read_elements,
    "NSET": _read_node_set,
    "ELSET": _read_element_set,
    "SURFACE": _read_surface,
}


def _add_instance(
    root: _Scope,
    parts: dict[str, _Scope],
    keyword: Keyword,
) -> None:
    """Copy a part into the assembly, moved as the data lines say."""
    name = keyword.options.get("NAME", "").upper()
    part = parts.get(keyword.options.get("PART", "").upper())
    if part is None:
        raise deck_error(
            keyword.file,
            keyword.line,
            f"*INSTANCE of the part '{keyword.options.get('PART', '')}' that is not there",
        )
    motion = _instance_motion(keyword)

    def moved(key: Key) -> Key:
        return (name, key[1])

    for key, place in part.nodes.items():
        root.nodes[moved(key)] = motion[0] @ np.array(place) + motion[1]
    for key, (word, nodes) in part.elements.items():
        root.elements[moved(key)] = (word, [moved(node) for node in nodes])
    for mine, theirs in (
        (root.node_sets, part.node_sets),
        (root.element_sets, part.element_sets),
    ):
        for label, members in theirs.items():
            mine.setdefault(label, []).extend(moved(key) for key in members)
    for label, lines in part.surfaces.items():
        found = root.surfaces.setdefault(label, [])
        found += [(f"{name}.{first}" if first.isdigit() else first, face) for first, face in lines]
    for label, names in part.node_surfaces.items():
        root.node_surfaces.setdefault(label, []).extend(names)
    for kind, count in part.left_out.items():
        root.left_out[kind] = root.left_out.get(kind, 0) + count


def _instance_motion(keyword: Keyword) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and shift of an instance: a translation, then a turn about an axis by two points."""
    rotation = np.eye(3)
    shift = np.zeros(3)
    for line, fields in keyword.data:
        try:
            values = np.array([float(v) for v in fields if v])
        except ValueError:
            raise deck_error(keyword.file, line, "expected the numbers of a motion") from None
        if len(values) == 3:
            shift = values
        elif len(values) == 7:
            turn = _axis_rotation(values[3:6] - values[:3], np.radians(values[6]))
            rotation = turn
            shift = turn @ (shift - values[:3]) + values[:3]
    return rotation, shift


def _axis_rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation (3, 3) about an axis (Rodrigues)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _raw_mesh(root: _Scope, file: Path) -> RawMesh:
    place = {key: i for i, key in enumerate(root.nodes)}
    kinds: dict[str, list[list[int]]] = {}
    where: dict[Key, tuple[str, int]] = {}
    for key, (word, nodes) in root.elements.items():
        missing = [node for node in nodes if node not in place]
        if missing:
            inside = f" of the instance {key[0]}" if key[0] else ""
            raise InputError(
                f"imported.file = '{file}': element {key[1]}{inside} has the node "
                f"{missing[0][1]}, which is not defined"
            )
        rows = kinds.setdefault(word, [])
        where[key] = (word, len(rows))
        rows.append([place[node] for node in nodes])
    words = list(kinds)
    groups = {}
    for name, members in root.element_sets.items():
        found: dict[str, list[int]] = {}
        for key in members:
            if key in where:
                word, row = where[key]
                found.setdefault(word, []).append(row)
        groups[name] = [(words.index(word), np.array(rows)) for word, rows in found.items()]
    sets = {
        name: np.array([place[key] for key in members if key in place], dtype=int)
        for name, members in root.node_sets.items()
    }
    notes = tuple(
        f"{count} elements of type {kind or 'unknown'} were left out"
        for kind, count in root.left_out.items()
    )
    points = np.array(list(root.nodes.values()), dtype=float).reshape(-1, 3)
    return RawMesh(
        points,
        [(word, _gmsh_order(word, np.array(rows), points, file)) for word, rows in kinds.items()],
        groups,
        sets | _node_surfaces(root, sets, place),
        {name: _surface_facets(root, lines, place) for name, lines in root.surfaces.items()},
        notes,
        _node_numbers(root),
    )


def _gmsh_order(
    word: str,
    cells: np.ndarray,
    points: np.ndarray,
    file: Path,
) -> np.ndarray:
    """Cells (nc, k) with their nodes in gmsh's order.

    Of 27 nodes Abaqus lists the middle of the cell before those of the faces, programs that follow
    VTK at the end: the places of the last seven decide.
    """
    if word != "hexahedron27":
        return from_vtk_order(word, cells)
    listed = NODES["hexahedron20"]
    outer = from_vtk_order("hexahedron20", cells[:, :listed])
    corner = points[outer[:, : CORNERS["hexahedron"]]]
    middle = points[outer[:, CORNERS["hexahedron"] :]]
    around = middle[:, np.array(edges_of_quads("hexahedron"))].sum(axis=2) / 2
    faces = around - corner[:, np.array(QUADS["hexahedron"])].sum(axis=2) / 4
    inside = (middle.sum(axis=1) - corner.sum(axis=1)) / 4
    wanted = np.concatenate([faces, inside[:, None]], axis=1)
    rest = cells[:, listed:]
    nearest = np.linalg.norm(wanted[:, :, None] - points[rest][:, None], axis=3).argmin(axis=2)
    if (np.sort(nearest, axis=1) != np.arange(rest.shape[1])).any():
        raise InputError(
            f"imported.file = '{file}': the last seven nodes of an element C3D27 are not near the "
            "middles of its faces and its own, expected each of them there"
        )
    return np.hstack([outer, np.take_along_axis(rest, nearest, axis=1)])


def _node_numbers(root: _Scope) -> np.ndarray | None:
    """(n,) numbers of the nodes; None where two instances have nodes of one number."""
    numbers = np.array([number for _, number in root.nodes], dtype=int)
    return numbers if len(np.unique(numbers)) == len(numbers) else None


def _node_surfaces(
    root: _Scope,
    sets: dict[str, np.ndarray],
    place: dict[Key, int],
) -> dict[str, np.ndarray]:
    """Surfaces of TYPE=NODE as node sets; a name that a node set has already stays with it."""
    known = {name.upper(): nodes for name, nodes in sets.items()}

    def nodes_of(word: str) -> np.ndarray:
        if word.upper() in known:
            return known[word.upper()]
        found = place.get(("", int(word))) if word.isdigit() else None
        return np.array([] if found is None else [found], dtype=int)

    return {
        name: np.unique(np.concatenate([np.empty(0, dtype=int), *map(nodes_of, members)]))
        for name, members in root.node_surfaces.items()
        if name.upper() not in known
    }


def _surface_facets(
    root: _Scope,
    lines: list[tuple[str, str]],
    place: dict[Key, int],
) -> list[np.ndarray]:
    """Corner nodes (nf, 3) and (nf, 4) of the facets of a surface."""
    known = {name.upper(): members for name, members in root.element_sets.items()}
    found: list[np.ndarray] = []
    for first, label in lines:
        instance, _, tag = first.rpartition(".")
        alone = [(instance.upper(), int(tag))] if tag.isdigit() else []
        corners: dict[int, list[list[int]]] = {3: [], 4: []}
        for key in known.get(first.upper(), alone):
            if key not in root.elements:
                continue
            word, nodes = root.elements[key]
            for facet in _faces_of_label(word, label):
                corners[len(facet)].append([place[nodes[i]] for i in facet])
        rows = [np.array(some) for some in corners.values() if some]
        # without a label: the outside of the set
        found += rows if label else [_single_facets(some) for some in rows]
    return found


def _single_facets(facets: np.ndarray) -> np.ndarray:
    """Facets (nf, k) that no other one coincides with."""
    key = np.sort(facets, axis=1)
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    return facets[first[count == 1]]


def _faces_of_label(word: str, label: str) -> list[tuple[int, ...]]:
    """Local corners of the faces that a label means; all of them without a label."""
    family = word.rstrip("0123456789")
    if family in ("triangle", "quad"):
        return [tuple(range(3 if family == "triangle" else 4))]
    faces = CELL_FACES[family]
    if label.startswith("S") and label[1:].isdigit() and 0 < int(label[1:]) <= len(faces):
        return [faces[int(label[1:]) - 1]]
    return faces if not label else []

"""Meshes as files hold them: points, cells by name, faces by name, node sets by name, in gmsh's
node order.

Each reader only reads; what the names mean is decided in imported.py, what becomes of the cells in
solid_cells.py.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

import numpy as np

from bladefem.errors import InputError, missing_file

from .session import gmsh_path, gmsh_session
from .topology import CORNERS, DIMENSION, EDGES, FAMILY, GMSH_TYPES, NODES

# corner pairs of the edges in the order of VTK, meshio, Abaqus, Ansys and Nastran
VTK_EDGES = {
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "hexahedron": [
        (0, 1),
        (1, 2),
        (2, 3),
        (3, 0),
        (4, 5),
        (5, 6),
        (6, 7),
        (7, 4),
        (0, 4),
        (1, 5),
        (2, 6),
        (3, 7),
    ],
    "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "pyramid": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
}


@dataclass(frozen=True)
class RawMesh:
    """What a file holds; lengths in the file's own unit."""

    # (n, 3)
    points: np.ndarray
    # (cell type, (nc, k) node numbers), all dimensions
    blocks: list[tuple[str, np.ndarray]]
    # name -> (block, rows of it)
    groups: dict[str, list[tuple[int, np.ndarray]]]
    # name -> node numbers
    node_sets: dict[str, np.ndarray]
    # name -> corner nodes of facets, arrays (nf, 3) and (nf, 4)
    surfaces: dict[str, list[np.ndarray]] = field(default_factory=dict)
    # what the file holds and was left out, one sentence each
    notes: tuple[str, ...] = ()
    # (n,) numbers of the points in the file; None where its reader does not know them
    numbers: np.ndarray | None = None


def read_raw(file: Path) -> RawMesh:
    """Any mesh file, by its suffix.

    Raises:
        InputError: no such file, an unknown suffix, or a file that cannot be read.
    """
    if not file.is_file():
        raise InputError(f"imported.file = '{file}': {missing_file(file)}")
    suffix = file.suffix.lower()
    if suffix not in SUFFIX_READERS:
        raise InputError(
            f"imported.file = '{file}': unknown kind of mesh; known are "
            f"{', '.join(sorted(SUFFIX_READERS))}"
        )
    said = io.StringIO()
    try:
        # readers of foreign files print and raise whatever they like, SystemExit too
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            raw = SUFFIX_READERS[suffix](file)
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        # some readers raise without words from what says why
        own = "" if isinstance(error, SystemExit) else str(error) or str(error.__context__ or "")
        words = f"{own} {said.getvalue()}".split()
        reason = " ".join(words[:60]) or type(error).__name__
        raise InputError(
            f"imported.file = '{file}': cannot be read as {suffix} ({reason})"
        ) from error
    _check_nodes(raw, file)
    return raw


def _check_nodes(raw: RawMesh, file: Path) -> None:
    """Refuse cells whose nodes are not there, and coordinates that are no numbers."""
    for word, cells in raw.blocks:
        if cells.size and not 0 <= cells.min() <= cells.max() < len(raw.points):
            raise InputError(f"imported.file = '{file}': a cell of type {word} has unknown nodes")
    bad = np.flatnonzero(~np.isfinite(raw.points).all(axis=1))
    if len(bad):
        raise InputError(
            f"imported.file = '{file}': the coordinates of {len(bad)} nodes are not finite numbers"
        )


def read_by_gmsh(file: Path) -> RawMesh:
    """.msh (versions 1, 2 and 4, text or binary), .med, .unv: physical groups become names."""
    with gmsh_session() as gmsh:
        gmsh.option.setNumber("Mesh.IgnorePeriodicity", 1)
        gmsh.merge(gmsh_path(file))
        return from_gmsh_model(gmsh)


def from_gmsh_model(gmsh: ModuleType) -> RawMesh:
    """The mesh of the current gmsh model; a physical group without a name is called by its
    number.
    """
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    place = np.full(int(tags.max(initial=0)) + 1, -1)
    place[tags.astype(int)] = np.arange(len(tags))
    blocks: list[tuple[str, np.ndarray]] = []
    of_entity: dict[tuple[int, int], list[int]] = {}
    for dim, entity in gmsh.model.getEntities():
        for kind, nodes in zip(
            *(gmsh.model.mesh.getElements(dim, entity)[i] for i in (0, 2)), strict=True
        ):
            word = GMSH_TYPES.get(int(kind), f"gmsh type {kind}")
            if dim and word in NODES:
                of_entity.setdefault((dim, entity), []).append(len(blocks))
                blocks.append((word, place[nodes.astype(int)].reshape(-1, NODES[word])))
    of_dimension: list[dict[str, list[int]]] = [{}, {}, {}, {}]
    sets: dict[str, np.ndarray] = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        name = (
            gmsh.model.getPhysicalName(dim, tag)
            or f"{'point curve surface volume'.split()[dim]}_{tag}"
        )
        if dim == 0:
            nodes = place[gmsh.model.mesh.getNodesForPhysicalGroup(0, tag)[0].astype(int)]
            sets[name] = np.union1d(sets.get(name, nodes), nodes)
            continue
        # several groups of one dimension may have one name
        of_dimension[dim].setdefault(name, []).extend(
            b
            for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)
            for b in of_entity.get((dim, int(e)), [])
        )
    groups: dict[str, list[tuple[int, np.ndarray]]] = {}
    surfaces: dict[str, list[np.ndarray]] = {}
    top = max((dim for dim, names in enumerate(of_dimension) if names), default=0)
    for dim in range(top, 0, -1):
        for name, parts in of_dimension[dim].items():
            if name in groups and dim == top - 1:
                # a face that is called as its body
                surfaces[name] = [_corners(*blocks[b]) for b in parts]
            elif name not in groups:
                groups[name] = [(b, np.arange(len(blocks[b][1]))) for b in parts]
    return RawMesh(xyz.reshape(-1, 3), blocks, groups, sets, surfaces, numbers=tags.astype(int))


def _corners(word: str, cells: np.ndarray) -> np.ndarray:
    """(nc, k) corner nodes of cells."""
    return cells[:, : CORNERS[FAMILY[word]]]


def read_by_meshio(file: Path) -> RawMesh:
    """.bdf/.nas (property numbers as "pid_1"), .vtu: what meshio knows about names."""
    import meshio

    # the reader itself: meshio.read hides why one failed
    vtu = file.suffix.lower() == ".vtu"
    if not vtu:
        _check_coordinate_systems(file)
    mesh = meshio.vtu.read(file) if vtu else meshio.nastran.read(io.StringIO(_bulk_data(file)))
    blocks = [(block.type, from_vtk_order(block.type, block.data)) for block in mesh.cells]
    groups = {
        name: [
            (b, np.asarray(rows, dtype=int))
            for b, rows in enumerate(parts)
            if rows is not None and len(rows)
        ]
        for name, parts in mesh.cell_sets.items()
    }
    for b, reference in enumerate(mesh.cell_data.get("nastran:ref", [])):
        for number in np.unique(reference):
            groups.setdefault(f"pid_{number}", []).append((b, np.flatnonzero(reference == number)))
    sets = {name: np.asarray(nodes, dtype=int) for name, nodes in mesh.point_sets.items()}
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    return RawMesh(points, blocks, groups, sets)


def _bulk_data(file: Path) -> str:
    """The bulk data of a file between the statements that meshio asks for, capital ones: those to
    be included have none, as gmsh writes them, and meshio refuses bulk data without an end.
    """
    lines = file.read_text(errors="replace").splitlines()
    words = [line.strip().upper() for line in lines]
    first = next((i + 1 for i, word in enumerate(words) if word.startswith("BEGIN BULK")), 0)
    bulk = range(first, len(lines))
    last = next((i for i in bulk if words[i].startswith("ENDDATA")), len(lines))
    return "\n".join(["BEGIN BULK", *lines[first:last], "ENDDATA", ""])


def _check_coordinate_systems(file: Path) -> None:
    """Refuse bulk data whose nodes are given in other coordinates than the basic ones: meshio reads
    radius and angle as x and y.
    """
    for number, line in enumerate(file.read_text(errors="replace").splitlines(), 1):
        card = line[:8].split(",")[0].strip().upper()
        if card not in ("GRID", "GRID*", "GRDSET", "GRDSET*"):
            continue
        if "," in line:
            system = [*line.split(","), "", ""][2]
        else:
            system = line[24:40] if card.endswith("*") else line[16:24]
        if system.strip() not in ("", "0"):
            raise InputError(
                f"imported.file = '{file}', line {number}: coordinates in the system "
                f"{system.strip()}, expected the basic one (CP blank or 0) for all nodes"
            )


def from_vtk_order(word: str, cells: np.ndarray) -> np.ndarray:
    """Cells whose nodes are in VTK's order, in gmsh's.

    Raises:
        InputError: a cell type that has no use here.
    """
    family = FAMILY.get(word, word.rstrip("0123456789"))
    cells = np.asarray(cells, dtype=int)
    if family not in VTK_EDGES:
        if word not in NODES and DIMENSION.get(family, 3) == 3:
            raise InputError(
                f"imported.file: cells of type {word} are not supported, expected tetrahedra, "
                "hexahedra, wedges or pyramids of first or second order"
            )
        return cells
    k = CORNERS[family]
    edges = len(EDGES[family])
    if word not in NODES or (NODES[word] > k + edges and family != "hexahedron"):
        raise InputError(
            f"imported.file: cells of type {word} are not supported, expected one node on each "
            "edge at most"
        )
    if NODES[word] == k:
        return cells
    row = {frozenset(pair): i for i, pair in enumerate(VTK_EDGES[family])}
    middle = [k + row[frozenset(pair)] for pair in EDGES[family]]
    # centres of faces: VTK lists -x +x -y +y -z +z, then the cell's
    rest = [24, 22, 20, 21, 23, 25, 26] if NODES[word] == NODES["hexahedron27"] else []
    return cells[:, [*range(k), *middle, *rest]]


def _read_ansys(file: Path) -> RawMesh:
    from .ansys_cdb import read_cdb

    return read_cdb(file)


def _read_abaqus(file: Path) -> RawMesh:
    from .abaqus_inp import read_inp

    return read_inp(file)


SUFFIX_READERS: dict[str, Callable[[Path], RawMesh]] = {
    ".msh": read_by_gmsh,
    ".med": read_by_gmsh,
    ".unv": read_by_gmsh,
    ".inp": _read_abaqus,
    ".bdf": read_by_meshio,
    ".nas": read_by_meshio,
    ".vtu": read_by_meshio,
    ".cdb": _read_ansys,
}

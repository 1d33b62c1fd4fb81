"""Meshes as they stand in files: points, cells by name, faces by name, node sets by name, in gmsh's
node order.

Each reader only reads; what the names mean is decided in imported.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bladefem.errors import InputError

from .session import gmsh_session
from .topology import DIMENSION, FAMILY, GMSH_TYPES, NODES

__all__ = ["RawMesh", "from_gmsh_model", "read_by_gmsh", "read_by_meshio", "read_raw"]

# Rows: gmsh's place <- VTK's (meshio's, Abaqus', Ansys', Nastran's) number, where they differ.
FROM_VTK = {
    "tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8],
    "hexahedron20": [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14],
}
# Element type -> corners of each face without a middle node, in the order in which gmsh numbers
# these nodes -> the nodes in the middle of its edges.
WITHOUT_CENTRE = {
    "quad8": {(0, 1, 2, 3): (4, 5, 6, 7)},
    "hexahedron20": {
        (0, 3, 2, 1): (9, 13, 11, 8),
        (0, 1, 5, 4): (8, 12, 16, 10),
        (0, 4, 7, 3): (10, 17, 15, 9),
        (1, 2, 6, 5): (11, 14, 18, 12),
        (2, 3, 7, 6): (13, 15, 19, 14),
        (4, 5, 6, 7): (16, 18, 19, 17),
    },
}
COMPLETE = {"quad8": "quad9", "hexahedron20": "hexahedron27"}


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


def read_raw(file: Path) -> RawMesh:
    """Any mesh file, by its suffix.

    Raises:
        InputError: no such file, an unknown suffix, or a file that cannot be read.
    """
    if not file.is_file():
        raise InputError(f"imported.file = '{file}': there is no such file")
    suffix = file.suffix.lower()
    if suffix not in READERS:
        raise InputError(
            f"imported.file = '{file}': unknown kind of mesh; known are "
            f"{', '.join(sorted(READERS))}"
        )
    try:
        return completed(READERS[suffix](file))
    except InputError:
        raise
    except Exception as error:
        # readers of foreign files raise whatever they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"imported.file = '{file}': cannot be read as {suffix} ({reason})"
        ) from error


def read_by_gmsh(file: Path) -> RawMesh:
    """.msh (versions 1, 2 and 4, text or binary), .med, .unv: physical groups become names."""
    with gmsh_session() as gmsh:
        gmsh.option.setNumber("Mesh.IgnorePeriodicity", 1)
        gmsh.merge(str(file))
        return from_gmsh_model(gmsh)


def from_gmsh_model(gmsh: object) -> RawMesh:
    """The mesh of the current gmsh model; a physical group without a name is called by its
    number.
    """
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    place = np.full(int(tags.max(initial=0)) + 1, -1)
    place[tags.astype(int)] = np.arange(len(tags))
    blocks = []
    of_entity = {}
    for dim, entity in gmsh.model.getEntities():
        for kind, nodes in zip(
            *(gmsh.model.mesh.getElements(dim, entity)[i] for i in (0, 2)), strict=True
        ):
            word = GMSH_TYPES.get(int(kind), f"gmsh type {kind}")
            if dim and word in NODES:
                of_entity.setdefault((dim, entity), []).append(len(blocks))
                blocks.append((word, place[nodes.astype(int)].reshape(-1, NODES[word])))
    groups = {}
    sets = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        name = (
            gmsh.model.getPhysicalName(dim, tag)
            or f"{'point curve surface volume'.split()[dim]}_{tag}"
        )
        if dim == 0:
            sets[name] = place[gmsh.model.mesh.getNodesForPhysicalGroup(0, tag)[0].astype(int)]
            continue
        parts = [
            b
            for e in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)
            for b in of_entity.get((dim, int(e)), [])
        ]
        groups[name] = [(b, np.arange(len(blocks[b][1]))) for b in parts]
    return RawMesh(xyz.reshape(-1, 3), blocks, groups, sets)


def read_by_meshio(file: Path) -> RawMesh:
    """.inp (ELSET and NSET), .bdf/.nas (property numbers as "pid_1"), .vtu: what meshio knows about
    names.
    """
    import meshio

    mesh = meshio.read(file)
    blocks = [(block.type, _to_gmsh(block.type, block.data)) for block in mesh.cells]
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


def completed(raw: RawMesh) -> RawMesh:
    """Hexahedra of 20 nodes and faces of 8 get the nodes in the middle of faces and cells that 27
    and 9 have.

    They lie where the serendipity shape functions put them (corners -1/4; middles of edges 1/2 on a
    face, 1/4 in a cell), so the shape stays and the displacements get richer.
    """
    if not any(kind in WITHOUT_CENTRE for kind, _ in raw.blocks):
        return raw
    x = raw.points
    corner = np.vstack(
        [cells[:, face] for kind, cells in raw.blocks for face in WITHOUT_CENTRE.get(kind, {})]
    )
    middle = np.vstack(
        [
            cells[:, edges]
            for kind, cells in raw.blocks
            for edges in WITHOUT_CENTRE.get(kind, {}).values()
        ]
    )
    _, first, number = np.unique(
        np.sort(corner, axis=1), axis=0, return_index=True, return_inverse=True
    )
    points = [x, x[middle[first]].sum(1) / 2 - x[corner[first]].sum(1) / 4]
    number = number.ravel() + len(x)
    size = len(x) + len(first)
    start = 0
    blocks = []
    for kind, cells in raw.blocks:
        more = [cells]
        for _ in WITHOUT_CENTRE.get(kind, {}):
            more.append(number[start : start + len(cells)])
            start += len(cells)
        if kind == "hexahedron20":
            points.append(x[cells[:, 8:]].sum(1) / 4 - x[cells[:, :8]].sum(1) / 4)
            more.append(size + np.arange(len(cells)))
            size += len(cells)
        blocks.append((COMPLETE.get(kind, kind), np.column_stack(more)))
    return RawMesh(np.vstack(points), blocks, raw.groups, raw.node_sets)


def _to_gmsh(word: str, cells: np.ndarray) -> np.ndarray:
    """Cells in gmsh's node order.

    Raises:
        InputError: a cell type that has no use here.
    """
    if word not in NODES and DIMENSION.get(FAMILY.get(word, word), 3) == 3:
        raise InputError(
            f"imported.file: cells of type {word} are not supported, expected tetrahedra or "
            "hexahedra"
        )
    cells = np.asarray(cells, dtype=int)
    return cells[:, FROM_VTK[word]] if word in FROM_VTK else cells


def _cdb(file: Path) -> RawMesh:
    from .ansys_cdb import read_cdb

    points, blocks, groups, sets = read_cdb(file)
    return RawMesh(points, [(word, _to_gmsh(word, cells)) for word, cells in blocks], groups, sets)


READERS = {
    ".msh": read_by_gmsh,
    ".med": read_by_gmsh,
    ".unv": read_by_gmsh,
    ".inp": read_by_meshio,
    ".bdf": read_by_meshio,
    ".nas": read_by_meshio,
    ".vtu": read_by_meshio,
    ".cdb": _cdb,
}

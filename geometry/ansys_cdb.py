"""Reader of Ansys .cdb archives (CDWRITE, blocked) by mapdl-archive: nodes, solid elements, node
and element components.

Solids are distinguished by their number of nodes and by repeated ones (element reference, SOLID185
and SOLID186: wedges, pyramids and tetrahedra are hexahedra with repeated nodes).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bladefem.errors import InputError

from .raw_mesh import RawMesh, from_vtk_order

# nodes of an element -> (shape, pairs of equal places, places of the nodes that are left in VTK's
# order); the first that fits
SHAPES_BY_NODE_COUNT: dict[int, list[tuple[str, list[tuple[int, int]], list[int]]]] = {
    4: [("tetra", [], [0, 1, 2, 3])],
    10: [("tetra10", [], list(range(10)))],
    8: [
        ("tetra", [(2, 3), (4, 5), (5, 6), (6, 7)], [0, 1, 2, 4]),
        ("pyramid", [(4, 5), (5, 6), (6, 7)], [0, 1, 2, 3, 4]),
        ("wedge", [(2, 3), (6, 7)], [0, 1, 2, 4, 5, 6]),
        ("hexahedron", [], list(range(8))),
    ],
    20: [
        ("tetra10", [(2, 3), (4, 5), (5, 6), (6, 7)], [0, 1, 2, 4, 8, 9, 11, 16, 17, 18]),
        (
            "pyramid13",
            [(4, 5), (5, 6), (6, 7)],
            [0, 1, 2, 3, 4, 8, 9, 10, 11, 16, 17, 18, 19],
        ),
        (
            "wedge15",
            [(2, 3), (6, 7)],
            [0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18],
        ),
        ("hexahedron20", [], list(range(20))),
    ],
}
# structural solids (MAPDL element library); an archive without ET holds what its node counts say
SOLID_ELEMENTS = (45, 62, 64, 65, 72, 73, 92, 95, 185, 186, 187, 190, 285)
# integers before the nodes of an element, and which of them are its type and number
HEADER_INTEGERS = 10
TYPE_POSITION = 1
NUMBER_POSITION = 8


def read_cdb(file: Path) -> RawMesh:
    """Nodes, solid elements and components.

    Raises:
        InputError: no NBLOCK or EBLOCK of solids, or elements with repeated or missing nodes.
    """
    head = file.read_text(errors="replace").upper()
    if "NBLOCK" not in head or "EBLOCK" not in head:
        raise InputError(
            f"imported.file = '{file}': no blocked nodes and solid elements, expected CDWRITE's "
            ".cdb with NBLOCK and EBLOCK,...,SOLID"
        )
    from mapdl_archive import Archive

    archive = Archive(str(file), parse_vtk=False)
    rows, left_out = _solid_rows(archive)
    blocks, tags = _cell_blocks(rows, np.asarray(archive.nnum), file)
    place = {int(tag): i for i, tag in enumerate(archive.nnum)}
    where = {int(tag): (b, i) for b, some in enumerate(tags) for i, tag in enumerate(some)}
    notes = (f"{left_out} elements that are no solids were left out",) if left_out else ()
    return RawMesh(
        np.asarray(archive.nodes, dtype=float)[:, :3],
        blocks,
        _element_components(archive, where),
        _node_components(archive, place),
        notes=notes,
        numbers=np.asarray(archive.nnum, dtype=int),
    )


def _solid_rows(archive: Any) -> tuple[dict[int, np.ndarray], int]:
    """Rows of the solid elements by their number of nodes, and how many others there are."""
    keys = np.asarray(archive.ekey).reshape(-1, 2)
    library = {int(number): int(kind) for number, kind in keys}
    found: dict[int, list[np.ndarray]] = {}
    left_out = 0
    for row in archive.elem:
        kind = library.get(int(row[TYPE_POSITION]))
        count = len(row) - HEADER_INTEGERS
        if (kind is None or kind in SOLID_ELEMENTS) and count in SHAPES_BY_NODE_COUNT:
            found.setdefault(count, []).append(row)
        else:
            left_out += 1
    return {count: np.array(rows) for count, rows in found.items()}, left_out


def _cell_blocks(
    rows: dict[int, np.ndarray],
    numbers: np.ndarray,
    file: Path,
) -> tuple[list[tuple[str, np.ndarray]], list[np.ndarray]]:
    """Cells of each shape in gmsh's node order, and their element numbers."""
    blocks = []
    tags = []
    for count, table in rows.items():
        nodes = table[:, HEADER_INTEGERS:]
        rest = np.ones(len(nodes), dtype=bool)
        for word, equal, kept in SHAPES_BY_NODE_COUNT[count]:
            fits = rest.copy()
            for a, b in equal:
                fits &= nodes[:, a] == nodes[:, b]
            rest &= ~fits
            if fits.any():
                cells = nodes[fits][:, kept]
                _check_nodes(cells, table[fits, NUMBER_POSITION], numbers, file)
                order = np.argsort(numbers)
                place = order[np.searchsorted(numbers, cells, sorter=order)]
                blocks.append((word, from_vtk_order(word, place)))
                tags.append(table[fits, NUMBER_POSITION])
    return blocks, tags


def _check_nodes(
    cells: np.ndarray,
    tags: np.ndarray,
    numbers: np.ndarray,
    file: Path,
) -> None:
    """Refuse elements without some of their mid-side nodes (written as 0) or of unknown shape."""
    ordered = np.sort(cells, axis=1)
    bad = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1) | ~np.isin(cells, numbers).all(axis=1)
    if bad.any():
        raise InputError(
            f"imported.file = '{file}': element {int(tags[bad][0])} has missing or repeated nodes, "
            "expected whole tetrahedra, hexahedra, wedges or pyramids"
        )


def _element_components(
    archive: Any, where: dict[int, tuple[int, int]]
) -> dict[str, list[tuple[int, np.ndarray]]]:
    groups = {}
    for name, members in archive.element_components.items():
        found: dict[int, list[int]] = {}
        for tag in np.asarray(members).tolist():
            if tag in where:
                block, row = where[tag]
                found.setdefault(block, []).append(row)
        groups[str(name).strip()] = [(b, np.array(rows)) for b, rows in found.items()]
    return groups


def _node_components(archive: Any, place: dict[int, int]) -> dict[str, np.ndarray]:
    return {
        str(name).strip(): np.array(
            [place[tag] for tag in np.asarray(members).tolist() if tag in place], dtype=int
        )
        for name, members in archive.node_components.items()
    }

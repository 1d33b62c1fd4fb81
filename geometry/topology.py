"""Cells and their facets: node counts, edges, orderings (gmsh's), and which way a face looks."""

from __future__ import annotations

import numpy as np

# gmsh's number of an element type -> meshio's word
GMSH_TYPES = {
    1: "line",
    8: "line3",
    2: "triangle",
    9: "triangle6",
    3: "quad",
    16: "quad8",
    10: "quad9",
    4: "tetra",
    11: "tetra10",
    5: "hexahedron",
    17: "hexahedron20",
    12: "hexahedron27",
    6: "wedge",
    18: "wedge15",
    13: "wedge18",
    7: "pyramid",
    19: "pyramid13",
    14: "pyramid14",
    15: "vertex",
}
FAMILY = {word: word.rstrip("0123456789") for word in GMSH_TYPES.values()}
DIMENSION = {
    "vertex": 0,
    "line": 1,
    "triangle": 2,
    "quad": 2,
    "tetra": 3,
    "hexahedron": 3,
    "wedge": 3,
    "pyramid": 3,
}
CORNERS = {
    "vertex": 1,
    "line": 2,
    "triangle": 3,
    "quad": 4,
    "tetra": 4,
    "hexahedron": 8,
    "wedge": 6,
    "pyramid": 5,
}
NODES = {
    "vertex": 1,
    "line": 2,
    "line3": 3,
    "triangle": 3,
    "triangle6": 6,
    "quad": 4,
    "quad8": 8,
    "quad9": 9,
    "tetra": 4,
    "tetra10": 10,
    "hexahedron": 8,
    "hexahedron20": 20,
    "hexahedron27": 27,
    "wedge": 6,
    "wedge15": 15,
    "wedge18": 18,
    "pyramid": 5,
    "pyramid13": 13,
    "pyramid14": 14,
}
# Corner pairs of the edges; row i carries the mid-side node number CORNERS + i of the second-order
# cell.
EDGES: dict[str, list[tuple[int, ...]]] = {
    "line": [(0, 1)],
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra": [(0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)],
    "hexahedron": [
        (0, 1),
        (0, 3),
        (0, 4),
        (1, 2),
        (1, 5),
        (2, 3),
        (2, 6),
        (3, 7),
        (4, 5),
        (4, 7),
        (5, 6),
        (6, 7),
    ],
    "wedge": [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)],
    "pyramid": [(0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)],
}
# Corners of the quadrilateral faces; row i carries the centre node CORNERS + edges + i.
QUADS: dict[str, list[tuple[int, ...]]] = {
    "quad": [(0, 1, 2, 3)],
    "hexahedron": [
        (0, 3, 2, 1),
        (0, 1, 5, 4),
        (0, 4, 7, 3),
        (1, 2, 6, 5),
        (2, 3, 7, 6),
        (4, 5, 6, 7),
    ],
    "wedge": [(0, 1, 4, 3), (0, 3, 5, 2), (1, 2, 5, 4)],
    "pyramid": [(0, 3, 2, 1)],
}
FACETS: dict[str, list[tuple[int, ...]]] = {
    "triangle": EDGES["triangle"],
    "quad": EDGES["quad"],
    "tetra": [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)],
    "hexahedron": [
        (0, 3, 2, 1),
        (0, 1, 5, 4),
        (1, 2, 6, 5),
        (2, 3, 7, 6),
        (3, 0, 4, 7),
        (4, 5, 6, 7),
    ],
    "wedge": [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2)],
    "pyramid": [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
}
REVERSED = {
    "line": [1, 0],
    "line3": [1, 0, 2],
    "triangle": [0, 2, 1],
    "triangle6": [0, 2, 1, 5, 4, 3],
    "quad": [0, 3, 2, 1],
    "quad8": [0, 3, 2, 1, 7, 6, 5, 4],
    "quad9": [0, 3, 2, 1, 7, 6, 5, 4, 8],
}
FACE_WORDS = {
    1: {2: "line", 3: "line3"},
    2: {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8", 9: "quad9"},
}


def corner_count(cell_type: str) -> int:
    """Number of corner nodes of a cell type given by meshio's word."""
    return CORNERS[FAMILY[cell_type]]


def face_word(nodes: int, dimension: int) -> str:
    """meshio's word of a face with so many nodes, of a body of the given dimension."""
    return FACE_WORDS[dimension - 1][nodes]


def facet_owners(
    cells: np.ndarray,
    cell_type: str,
    faces: np.ndarray,
) -> np.ndarray:
    """For each face (nf, kc corners) the row of the cell that has it as a facet, -1 where there is
    none.
    """
    table = np.array(FACETS[FAMILY[cell_type]])
    facets = np.sort(cells[:, table].reshape(-1, table.shape[1]), axis=1)
    stacked = np.vstack([facets, np.sort(faces, axis=1)])
    _, inverse = np.unique(stacked, axis=0, return_inverse=True)
    inverse = inverse.ravel()
    cell_of = np.full(inverse.max() + 1, -1)
    cell_of[inverse[: len(facets)]] = np.repeat(np.arange(len(cells)), len(table))
    return cell_of[inverse[len(facets) :]]


def face_normals(
    points: np.ndarray,
    faces: np.ndarray,
    dimension: int,
) -> np.ndarray:
    """Normals (nf, 3) of faces by their corners, length = area (3-D) or edge length (2-D); outward
    after `outward_faces`.
    """
    kc = corner_count(face_word(faces.shape[1], dimension))
    x = points[faces[:, :kc]]
    if dimension == 2:
        edge = x[:, 1] - x[:, 0]
        return np.column_stack([edge[:, 1], -edge[:, 0], np.zeros(len(edge))])
    if kc == 3:
        return np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2
    return np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]) / 2


def outward_faces(
    points: np.ndarray,
    cells: np.ndarray,
    cell_type: str,
    faces: np.ndarray,
) -> np.ndarray:
    """The faces (nf, k) reordered so that their normals leave the cells (in 2-D: the body lies on
    the left).

    Raises:
        ValueError: a face is not a facet of any cell.
    """
    dimension = DIMENSION[FAMILY[cell_type]]
    word = face_word(faces.shape[1], dimension)
    kc = corner_count(word)
    owner = facet_owners(cells[:, : corner_count(cell_type)], cell_type, faces[:, :kc])
    if np.any(owner < 0):
        raise ValueError(f"{np.count_nonzero(owner < 0)} faces are not facets of a cell")
    inside = points[cells[owner][:, : corner_count(cell_type)]].mean(axis=1)
    away = points[faces[:, :kc]].mean(axis=1) - inside
    wrong = np.einsum("ij,ij->i", face_normals(points, faces, dimension), away) < 0
    result = faces.copy()
    result[wrong] = faces[wrong][:, REVERSED[word]]
    return result


def facets_of(cells: np.ndarray, cell_type: str) -> np.ndarray:
    """All facets (nc * facets, k) of the cells with every node that lies on them, cell by cell.

    Cells whose facets all have the same shape only: no wedges, no pyramids.
    """
    table = np.array(facet_nodes(cell_type))
    return cells[:, table].reshape(-1, table.shape[1])


def facet_nodes(cell_type: str) -> list[list[int]]:
    """Local numbers of the nodes on each facet: corners, mid-side nodes, the centre of a
    quadrilateral.
    """
    family = FAMILY[cell_type]
    k = CORNERS[family]
    edges = {frozenset(pair): k + i for i, pair in enumerate(EDGES[family])}
    first_centre = k + len(EDGES[family])
    centres = {frozenset(quad): first_centre + i for i, quad in enumerate(QUADS.get(family, []))}
    table = []
    for facet in FACETS[family]:
        nodes = list(facet)
        if NODES[cell_type] > k:
            ring = zip(facet, facet[1:] + facet[:1], strict=True) if len(facet) > 2 else [facet]
            nodes += [edges[frozenset(pair)] for pair in ring]
        if NODES[cell_type] > first_centre and frozenset(facet) in centres:
            nodes.append(centres[frozenset(facet)])
        table.append(nodes)
    return table


def boundary_facets(cells: np.ndarray, cell_type: str) -> np.ndarray:
    """Outer facets (nf, k) of the cells with all their nodes: facets that one cell has for
    itself.
    """
    facets = facets_of(cells, cell_type)
    key = np.sort(facets[:, : len(FACETS[FAMILY[cell_type]][0])], axis=1)
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    return facets[first[count == 1]]

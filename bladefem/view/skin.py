"""The outside of a mesh as plane triangles, with the body and the named face that each belongs to:
plain numpy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bladefem.errors import InputError
from geometry.mesh import Mesh, sector_of
from geometry.topology import CORNERS, EDGES

SIDES = {
    "tetra": ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
    "hexahedron": (
        (0, 3, 2, 1),
        (0, 1, 5, 4),
        (1, 2, 6, 5),
        (2, 3, 7, 6),
        (3, 0, 4, 7),
        (4, 5, 6, 7),
    ),
}
# cells that are drawn
# of a wheel whose number of sectors is not known
SHOWN_SECTORS = 5
DRAWN_CELLS = ("triangle", "quad", "tetra", "hexahedron")


@dataclass(frozen=True)
class Skin:
    """Triangles on the outside of a mesh, for drawing."""

    # (n,) node numbers in the mesh
    nodes: np.ndarray
    # (n, 3) [m]
    points: np.ndarray
    # (t, 3) rows of points
    triangles: np.ndarray
    # (t,) numbers of names
    labels: np.ndarray
    # bodies first, then named faces
    names: tuple[str, ...]
    # (e, 2) rows of points: the element edges
    edges: np.ndarray


def family(cell_type: str) -> str:
    """meshio's word without its node count: tetra10 -> tetra."""
    return cell_type.rstrip("0123456789")


def outer_faces(cells: np.ndarray, cell_type: str) -> np.ndarray:
    """(nf, k) faces that belong to one cell only; corners in a loop, then the mid-side nodes. Plane
    cells: themselves.

    Args:
        cells: (nc, nodes of a cell) in gmsh's order.
        cell_type: meshio's word.
    """
    shape = family(cell_type)
    if shape not in SIDES:
        return cells[:, : 2 * CORNERS[shape]]
    quadratic = cells.shape[1] > CORNERS[shape]
    middle = {frozenset(edge): CORNERS[shape] + i for i, edge in enumerate(EDGES[shape])}
    loops = [
        side
        + tuple(middle[frozenset(e)] for e in zip(side, side[1:] + side[:1], strict=True))
        * quadratic
        for side in SIDES[shape]
    ]
    corners = cells[:, SIDES[shape]].reshape(-1, len(SIDES[shape][0]))
    _, first, count = np.unique(row_keys(corners), return_index=True, return_counts=True)
    cell, side = np.divmod(np.sort(first[count == 1]), len(loops))
    return np.take_along_axis(cells[cell], np.array(loops)[side], axis=1)


def row_keys(rows: np.ndarray) -> np.ndarray:
    """(n,) whole numbers that are the same for rows (n, k) of the same node numbers in any order:
    numpy finds equal ones several times faster than equal rows.
    """
    ordered = np.sort(rows, axis=1).astype(np.int64)
    count = int(ordered.max(initial=0)) + 1
    if count ** ordered.shape[1] > np.iinfo(np.int64).max:
        return np.asarray(np.unique(ordered, axis=0, return_inverse=True)[1]).ravel()
    return np.asarray(ordered @ (count ** np.arange(ordered.shape[1])[::-1]))


def split_faces(
    faces: np.ndarray,
    corners: int,
    coarse: bool = False,
) -> np.ndarray:
    """(nf, m, 3) plane triangles of faces given as a corner loop and, for quadratic faces, a loop
    of mid-side nodes.
    """
    if coarse or faces.shape[1] < 2 * corners:
        pattern = [(0, i, i + 1) for i in range(1, corners - 1)]
    else:
        ring = [(i, corners + i, corners + (i - 1) % corners) for i in range(corners)]
        pattern = ring + [(corners, corners + i, corners + i + 1) for i in range(1, corners - 1)]
    return faces[:, pattern]


def face_corners(mesh: Mesh) -> int:
    """Corners of the outer faces: of the sides of solids, of the cells of plane meshes.

    Raises:
        InputError: cells that cannot be drawn.
    """
    shape = family(mesh.cell_type)
    if shape not in DRAWN_CELLS:
        raise InputError(
            f"cells of type '{mesh.cell_type}' cannot be drawn, expected {', '.join(DRAWN_CELLS)}"
        )
    return len(SIDES[shape][0]) if shape in SIDES else CORNERS[shape]


def skin(
    mesh: Mesh,
    coarse: bool = False,
    without: tuple[str, ...] = (),
) -> Skin:
    """The outer triangles of all bodies, labelled by body or named face.

    Args:
        mesh: plane or solid.
        coarse: corners only, four times fewer triangles for second-order meshes.
        without: named faces to leave out (the cut faces of a wheel).
    """
    corners = face_corners(mesh)
    faces = [outer_faces(cells, mesh.cell_type) for cells in mesh.bodies.values()]
    labels = np.repeat(np.arange(len(faces)), [len(f) for f in faces])
    faces = np.concatenate(faces)
    names = (*mesh.bodies, *mesh.faces)
    if mesh.dimension == 3:
        labels = label_faces(faces[:, :corners], labels, mesh, corners)
    keep = ~np.isin(labels, [i for i, name in enumerate(names) if name in without])
    faces = faces[keep]
    labels = labels[keep]
    triangles = split_faces(faces, corners, coarse)
    nodes, local = np.unique(triangles, return_inverse=True)
    edges = np.searchsorted(nodes, face_edges(faces, corners, coarse))
    return Skin(
        nodes,
        mesh.points[nodes],
        local.reshape(-1, 3),
        np.repeat(labels, triangles.shape[1]),
        names,
        edges,
    )


def label_faces(
    faces: np.ndarray,
    labels: np.ndarray,
    mesh: Mesh,
    corners: int,
) -> np.ndarray:
    """Number of the named face where there is one, of the body elsewhere."""
    labels = labels.copy()
    named = [some[:, :corners] for some in mesh.faces.values()]
    keys = row_keys(np.concatenate([faces, *named]))
    ends = np.cumsum([len(faces), *map(len, named)])
    for number, some in enumerate(np.split(keys, ends[:-1])[1:], start=len(mesh.bodies)):
        labels[np.isin(keys[: len(faces)], some)] = number
    return labels


def face_edges(
    faces: np.ndarray,
    corners: int,
    coarse: bool,
) -> np.ndarray:
    """(e, 2) straight pieces of the faces' edges, each once; through the mid-side nodes when there
    are any.
    """
    start = faces[:, :corners]
    end = np.roll(start, -1, axis=1)
    if coarse or faces.shape[1] < 2 * corners:
        pieces = np.stack([start, end], axis=2).reshape(-1, 2)
    else:
        middle = faces[:, corners : 2 * corners]
        pieces = np.concatenate(
            [np.stack([start, middle], axis=2), np.stack([middle, end], axis=2)]
        ).reshape(-1, 2)
    # in the order of their nodes
    first = np.unique(row_keys(pieces), return_index=True)[1]
    return np.sort(pieces[first], axis=1)


def sector_motion(mesh: Mesh, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and shift (3,) [m] from the meshed sector to the k-th next one."""
    rotation = np.eye(3)
    shift = np.zeros(3)
    for _ in range(k):
        step = sector_of(mesh)
        shift = step.rotation @ shift + step.shift
        rotation = step.rotation @ rotation
    return rotation, shift


def wheel_count(mesh: Mesh) -> int:
    """Sectors in the picture of a wheel: all of them, or a few of a row without end."""
    if mesh.sector is None:
        return 1
    return mesh.sector.count or SHOWN_SECTORS


def wheel_skin(mesh: Mesh) -> Skin:
    """The skin of the full wheel, copies of one sector in order; ``nodes`` repeats the sector's
    node numbers.
    """
    one = skin(mesh, coarse=True, without=("cyclic_low", "cyclic_high"))
    count = wheel_count(mesh)
    n = len(one.points)
    motions = [sector_motion(mesh, k) for k in range(count)]
    points = np.concatenate([one.points @ rotation.T + shift for rotation, shift in motions])
    offsets = (np.arange(count) * n)[:, None, None]
    return replace(
        one,
        nodes=np.tile(one.nodes, count),
        points=points,
        labels=np.tile(one.labels, count),
        triangles=(one.triangles + offsets).reshape(-1, 3),
        edges=(one.edges + offsets).reshape(-1, 2),
    )

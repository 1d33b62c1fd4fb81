"""Values at places on the faces of a mesh, from its nodes: carries motions and, transposed, forces
between meshes that share a face.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from geometry.mesh import Mesh

from ..errors import InputError
from .face_elements import LINEAR, corner_count, face_shape_functions

# of the face's size: places so near to a node are that node
SAME_NODE = 1e-7
# of the face's size: no place may be farther from all of its elements
FARTHEST = 0.02
# elements looked at for each place
NEAR_ELEMENTS = 12
# of Newton's method to the place on a curved element
STEPS = 6


def face_values(mesh: Mesh, names: Sequence[str], places: np.ndarray) -> sp.csr_matrix:
    """(m, n_points) weights of the nodes of some faces at places (m, 3) on them [m].

    Rows sum to one, so that transposed they give nodal forces with the same resultant; on flat
    elements they have the same moment too.

    Raises:
        InputError: a place is on none of the faces.
    """
    nodes = np.unique(np.concatenate([mesh.faces[name].ravel() for name in names]))
    size = float(np.ptp(mesh.points[nodes], axis=0).max())
    distance, nearest = cKDTree(mesh.points[nodes]).query(places)
    same = distance <= SAME_NODE * size
    rows = [np.flatnonzero(same)]
    columns = [nodes[nearest[same]]]
    weights = [np.ones(len(rows[0]))]
    for row in np.flatnonzero(~same):
        found, values, far = _nearest_element(mesh, names, places[row])
        if far > FARTHEST * size:
            raise InputError(
                f"faces {', '.join(names)}: the place {places[row].round(6)} m is {1e3 * far:.3g} "
                "mm away from them, expected the same faces in both meshes"
            )
        rows.append(np.full(len(found), row))
        columns.append(found)
        weights.append(values)
    where = np.concatenate(rows), np.concatenate(columns)
    return sp.coo_matrix(
        (np.concatenate(weights), where), shape=(len(places), len(mesh.points))
    ).tocsr()


def _nearest_element(
    mesh: Mesh, names: Sequence[str], place: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Nodes and weights of the element that comes nearest to a place, and how near [m]."""
    best: tuple[np.ndarray, np.ndarray, float] | None = None
    for name in names:
        faces = mesh.faces[name]
        corners = corner_count(mesh.dimension, faces.shape[1])
        middle = mesh.points[faces[:, :corners]].mean(axis=1)
        order = np.argsort(np.linalg.norm(middle - place, axis=1))[:NEAR_ELEMENTS]
        for face in faces[order]:
            values, far = _projected(mesh.points[face], corners, place)
            if best is None or far < best[2]:
                best = face, values, far
    assert best is not None
    return best


def _projected(x: np.ndarray, corners: int, place: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights of an element's nodes (k, 3) at its point next to a place, and the distance [m]."""
    start = np.full((1, 1 if corners == 2 else 2), 1 / 3 if corners == 3 else 0.0)
    # the flat element first: it is the curved one where its edges are straight
    for nodes, steps in ((corners, 2), (len(x), STEPS if len(x) > corners else 0)):
        for _ in range(steps):
            values, slope = face_shape_functions(nodes, corners, start)
            tangents = slope[0].T @ x[:nodes]
            missing = place - values[0] @ x[:nodes]
            start = start + np.linalg.lstsq(tangents.T, missing, rcond=None)[0]
            start = _inside(start, corners)
    values, _ = face_shape_functions(len(x), corners, start)
    return values[0], float(np.linalg.norm(values[0] @ x - place))


def _inside(at: np.ndarray, corners: int) -> np.ndarray:
    """Reference coordinates (1, d) moved to the element where they are outside."""
    if corners != 3:
        return np.clip(at, -1.0, 1.0)
    shares = np.clip(LINEAR[3](at)[0], 0.0, None)
    return (shares / shares.sum())[:, 1:]

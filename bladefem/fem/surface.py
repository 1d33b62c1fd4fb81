"""Geometry of contact faces: quadrature over them, which way is out, and the frames of their
nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from geometry.mesh import Mesh

from ..errors import InputError
from ..util.arrays import IntegerArray, RealArray
from .face_elements import corner_count, face_quadrature, face_shape_functions, traction_shape

BODY_CORNERS = {"triangle": 3, "quad": 4, "tetra": 4, "hexahedron": 8, "wedge": 6, "pyramid": 5}


@dataclass(frozen=True)
class FaceRule:
    """Quadrature over the faces (or pieces of faces) of a patch, seen from one of its bodies."""

    # (f, m) nodes of the body
    nodes: IntegerArray
    # (f, k) nodes of the patch that carry the traction
    columns: IntegerArray
    # (f, q, m) the body's shape functions
    shape: RealArray
    # (f, q, k) traction functions times weights [m^2]
    traction: RealArray
    # (f, q, 3) unit vectors out of the master
    normal: RealArray


def surface_quadrature(mesh: Mesh, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normal vectors times quadrature weight and depth (nf, q, 3) [m^2], and traction functions (q,
    corners).
    """
    corners = corner_count(mesh.dimension, faces.shape[1])
    points, weights = face_quadrature(corners)
    _, dN = face_shape_functions(faces.shape[1], corners, points)
    tangents = np.einsum("qkd,fki->fqdi", dN, mesh.points[faces])
    if mesh.dimension == 2:
        normals = np.cross(tangents[:, :, 0], [0.0, 0.0, mesh.depth])
    else:
        normals = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return normals * weights[:, None], traction_shape(corners, points)


def outward_signs(
    mesh: Mesh,
    faces: np.ndarray,
    normals: np.ndarray,
) -> np.ndarray:
    """Sign (nf,) that makes each face's normal point out of the body that owns it."""
    k = corner_count(mesh.dimension, faces.shape[1])
    kind = next((v for name, v in BODY_CORNERS.items() if mesh.cell_type.startswith(name)), None)
    if kind is None:
        raise InputError(
            f"cell type '{mesh.cell_type}' has no contact faces; known are "
            f"{', '.join(BODY_CORNERS)}"
        )
    on_face = np.zeros(len(mesh.points), dtype=bool)
    on_face[faces[:, :k]] = True
    inside = {}
    for cells in mesh.bodies.values():
        corner = cells[:, :kind]
        for cell in corner[on_face[corner].sum(axis=1) >= k]:
            for face in map(frozenset, combinations(cell[on_face[cell]].tolist(), k)):
                inside[face] = mesh.points[cell].mean(axis=0)
    sign = np.empty(len(faces))
    for i, face in enumerate(faces[:, :k]):
        owner = inside.get(frozenset(face.tolist()))
        if owner is None:
            raise InputError(
                f"contact face with nodes {face.tolist()} does not belong to any body of the mesh"
            )
        sign[i] = np.sign(normals[i] @ (mesh.points[face].mean(axis=0) - owner))
    return sign


def tangent_frames(
    normals: np.ndarray,
    dimension: int,
    like: np.ndarray | None = None,
) -> np.ndarray:
    """Frames (n, 3, 3) with rows normal, t1, t2; ``like`` are the normals (k, 3) that decide which
    axis gives t2.
    """
    axis = np.zeros_like(normals)
    like = normals if like is None else like
    axis[:, 2] = 1.0
    if dimension == 3 and np.abs(like[:, 2]).max() > np.cos(np.radians(25)):
        axis[:] = [0.0, 1.0, 0.0]
    t2 = axis - normals * np.einsum("ni,ni->n", axis, normals)[:, None]
    t2 /= np.linalg.norm(t2, axis=1, keepdims=True)
    return np.stack([normals, np.cross(normals, t2), t2], axis=1)

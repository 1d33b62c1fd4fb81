"""Contact faces whose meshes do not match: patches and quadrature rules on the exact overlap of
their elements (`fem.face_overlap`).

The contact patch test holds: a uniform pressure loads both bodies with their own consistent nodal
forces. Source of the method: Puso and Laursen, DOI 10.1016/j.cma.2003.10.010.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import Mesh

from ..data import Patch
from ..errors import InputError
from ..fem.face_elements import LINEAR, corner_count, face_shape_functions, traction_shape
from ..fem.face_overlap import Overlap, face_overlap
from ..fem.surface import FaceRule, outward_signs, surface_quadrature, tangent_frames


def mortar_patch(mesh: Mesh, pair: str) -> Patch:
    """The patch of a pair that does not match: master corners that carry part of the overlap."""
    d = mesh.dimension
    o = _triangle_overlap(mesh, pair)
    used = np.unique(o.face[:, 0])
    faces = o.master[used]
    nodes, numbers = np.unique(faces[:, :d], return_inverse=True)
    weighted, _ = surface_quadrature(mesh, faces)
    normals = np.zeros((len(mesh.points), 3))
    direction = weighted.sum(axis=1) * outward_signs(mesh, faces, weighted.sum(axis=1))[:, None]
    np.add.at(normals, faces[:, :d], direction[:, None, :])
    area: np.ndarray = np.bincount(
        o.master[o.face[:, 0], :d].ravel(),
        np.einsum("sqk,sq->sk", _traction_functions(o), o.weight).ravel(),
        len(mesh.points),
    )
    normal = normals[nodes] / np.linalg.norm(normals[nodes], axis=1, keepdims=True)
    return Patch(
        pair,
        mesh.points[nodes],
        area[nodes],
        tangent_frames(normal, d),
        numbers.reshape(-1, d),
        nodes,
    )


def mortar_faces(
    patch: Patch,
    mesh: Mesh,
    side: str,
) -> FaceRule:
    """The quadrature rule of the patch on one of its sides."""
    o = _triangle_overlap(mesh, patch.name)
    s = 0 if side == "blade" else 1
    faces = (o.master, o.slave)[s][o.face[:, s]]
    d = o.at[s].shape[2] + 1
    q = o.at[s].shape[1]
    N, _ = face_shape_functions(faces.shape[1], d, o.at[s].reshape(-1, d - 1))
    number = np.full(len(mesh.points), -1)
    number[patch.blade_nodes] = np.arange(len(patch.blade_nodes))
    return FaceRule(
        faces,
        number[o.master[o.face[:, 0], :d]],
        N.reshape(len(faces), q, -1),
        _traction_functions(o) * o.weight[:, :, None],
        o.normal,
    )


def _traction_functions(o: Overlap) -> np.ndarray:
    """Traction functions (s, q, k) on the pieces: hats on faces covered in part, where the others
    could be negative.
    """
    s, q, dim = o.at[0].shape
    flat = o.at[0].reshape(-1, dim)
    hats = LINEAR[dim + 1](flat)[0]
    chi = traction_shape(dim + 1, flat)
    return np.where(
        o.covered[o.face[:, 0], None, None], chi.reshape(s, q, -1), hats.reshape(s, q, -1)
    )


def _triangle_overlap(mesh: Mesh, pair: str) -> Overlap:
    """The overlap of a pair of lines or triangles, whose traction functions are known on pieces."""
    p = mesh.pairs[pair]
    d = mesh.dimension
    if any(corner_count(d, mesh.faces[name].shape[1]) != d for name in (p.master, p.slave)):
        raise InputError(
            f"contact pair '{pair}' does not match and has quadrilaterals, expected lines or "
            "triangles"
        )
    return face_overlap(mesh, pair)

"""Contact faces whose meshes do not match: both sides are integrated over the exact overlap of
their elements.

Both faces are seen along the mean normal of the master, and the slave's faces are clipped by the
master's; shape functions of both are integrated over the pieces, on the curved master with its own
normal at each point. So a uniform pressure loads both bodies with their own consistent nodal forces
and a linear displacement of either is measured without error: the contact patch test holds, on
curved faces too where both lie on one surface and the edges of one are straight in the coordinates
of the other. Source of the method: Puso and Laursen, DOI 10.1016/j.cma.2003.10.010.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from geometry.mesh import Mesh

from ..data import Patch
from ..errors import InputError
from ..util.arrays import BooleanArray, IntegerArray, RealArray
from .face_elements import (
    LINEAR,
    corner_count,
    face_quadrature,
    face_shape_functions,
    traction_shape,
)
from .surface import FaceRule, outward_signs, surface_quadrature, tangent_frames

# pieces below this part of a face's area are dropped
SLIVER_AREA = 1e-9
MIN_FACING_COSINE = np.cos(np.radians(75))
# of Newton's method to the place on a curved face
MAX_PROJECTION_STEPS = 8
# a face counts as covered when less than this part of it is left over
COVERED_AREA_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Overlap:
    """Pieces of overlap with q quadrature points each."""

    # (nf, k) master faces
    master: IntegerArray
    # (nf, k) slave faces
    slave: IntegerArray
    # (s, 2) which master and which slave face a piece belongs to
    face: IntegerArray
    # two (s, q, d) reference coordinates on the master and on the slave face
    at: tuple[np.ndarray, np.ndarray]
    # (s, q) [m^2]
    weight: RealArray
    # (s, q, 3) unit vectors out of the master
    normal: RealArray
    # (nf,) bool, master faces that are covered by slaves
    covered: BooleanArray


def mortar_overlap(mesh: Mesh, pair: str) -> Overlap:
    """Cut the two faces of a pair against each other.

    Raises:
        InputError: faces that are not lines or triangles, that do not overlap, or a master that
            turns by more than 75 degrees from its mean normal.
    """
    p = mesh.pairs[pair]
    d = mesh.dimension
    master = mesh.faces[p.master]
    slave = mesh.faces[p.slave]
    if corner_count(d, master.shape[1]) != d or corner_count(d, slave.shape[1]) != d:
        raise InputError(
            f"contact pair '{pair}' does not match and has quadrilaterals, expected lines or "
            "triangles"
        )
    places = (mesh.points, (mesh.points - p.shift) @ p.rotation)
    X = places[0][master[:, :d]]
    Y = places[1][slave[:, :d]]
    weighted, _ = surface_quadrature(mesh, master)
    sign = outward_signs(mesh, master, weighted.sum(axis=1))
    view = _view_axes(weighted.sum(axis=1) * sign[:, None], d, pair)
    close = np.array(_close_pairs(X, Y), dtype=int).reshape(-1, 2)
    # The corners of the slave in the master's own coordinates, in which its edges are taken as
    # straight.
    corners = _locate_points(places[0][master[close[:, 0]]], Y[close[:, 1]] @ view.T, view)
    cut = _cut_line if d == 2 else _cut_triangle
    pieces = [
        (i, j, piece)
        for (i, j), polygon in zip(close, corners, strict=True)
        for piece in cut(polygon)
    ]
    if not pieces:
        raise InputError(
            f"contact pair '{pair}': faces '{p.master}' and '{p.slave}' do not overlap"
        )
    face = np.array([piece[:2] for piece in pieces])
    nodes = places[0][master[face[:, 0]]], places[1][slave[face[:, 1]]]
    at, vector = _piece_quadrature(*nodes, np.array([piece[2] for piece in pieces]), view)
    vector = vector * ((mesh.depth if d == 2 else 1.0) * sign[face[:, 0], None, None])
    weight = np.linalg.norm(vector, axis=2)
    whole = np.linalg.norm(weighted, axis=2).sum(axis=1)
    found = np.bincount(face[:, 0], weight.sum(axis=1), len(master))
    return Overlap(
        master,
        slave,
        face,
        at,
        weight,
        vector / weight[:, :, None],
        found > whole * (1 - COVERED_AREA_TOLERANCE),
    )


def mortar_patch(mesh: Mesh, pair: str) -> Patch:
    """The patch of a pair that does not match: master corners that carry part of the overlap.

    `damper_nodes` are the nearest slave nodes; they serve pictures only.
    """
    p = mesh.pairs[pair]
    d = mesh.dimension
    o = mortar_overlap(mesh, pair)
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
    across = np.unique(mesh.faces[p.slave])
    nearest = cKDTree((mesh.points[across] - p.shift) @ p.rotation).query(mesh.points[nodes])[1]
    return Patch(
        pair,
        mesh.points[nodes],
        area[nodes],
        tangent_frames(normal, d),
        numbers.reshape(-1, d),
        nodes,
        across[nearest],
    )


def mortar_faces(
    patch: Patch,
    mesh: Mesh,
    side: str,
) -> FaceRule:
    """The quadrature rule of the patch on one of its sides."""
    o = mortar_overlap(mesh, patch.name)
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


def _close_pairs(X: np.ndarray, Y: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of faces (corners (n, k, 3)) whose spheres touch."""
    cx = X.mean(axis=1)
    cy = Y.mean(axis=1)
    rx, ry = (np.linalg.norm(Z - Z.mean(axis=1, keepdims=True), axis=2).max(axis=1) for Z in (X, Y))
    near = cKDTree(cy).query_ball_point(cx, rx + ry.max())
    return [
        (i, j)
        for i, js in enumerate(near)
        for j in sorted(js)
        if np.linalg.norm(cx[i] - cy[j]) < rx[i] + ry[j]
    ]


def _cut_line(ends: np.ndarray) -> list[np.ndarray]:
    """The part (2, 1) of a line (2, 1) within the reference line."""
    a, b = np.sort(ends[:, 0]).clip(-1, 1)
    return [np.array([[a], [b]])] if b - a > 2 * SLIVER_AREA else []


def _cut_triangle(triangle: np.ndarray) -> list[np.ndarray]:
    """The part of a triangle (3, 2) within the reference triangle as triangles (3, 2)
    (Sutherland-Hodgman).
    """
    polygon = list(triangle)
    levels: tuple[Callable[[np.ndarray], float], ...] = (
        lambda p: p[0],
        lambda p: p[1],
        lambda p: 1 - p[0] - p[1],
    )
    for level in levels:
        polygon = _clip_polygon(polygon, level)
        if len(polygon) < 3:
            return []
    fan = [np.array([polygon[0], polygon[i], polygon[i + 1]]) for i in range(1, len(polygon) - 1)]
    return [f for f in fan if abs(np.linalg.det(f[1:] - f[0])) > SLIVER_AREA]


def _clip_polygon(
    polygon: list[np.ndarray], level: Callable[[np.ndarray], float]
) -> list[np.ndarray]:
    """The part of a convex polygon where a linear function is not negative."""
    kept = []
    for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        la = level(a)
        lb = level(b)
        if la >= 0:
            kept.append(a)
        if la * lb < 0:
            kept.append(a + (b - a) * la / (la - lb))
    return kept


def _view_axes(
    normals: np.ndarray,
    d: int,
    pair: str,
) -> np.ndarray:
    """(d - 1, 3) axes across the mean of the outward normals (nf, 3)."""
    axis = normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
    if (normals @ axis < MIN_FACING_COSINE * np.linalg.norm(normals, axis=1)).any():
        raise InputError(
            f"contact pair '{pair}' does not match and its master turns by more than 75 degrees "
            "from its mean normal, expected a face seen from one side: split it"
        )
    if d == 2:
        return np.array([[-axis[1], axis[0], 0.0]])
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first)])


def _piece_quadrature(
    X: np.ndarray,
    Y: np.ndarray,
    pieces: np.ndarray,
    view: np.ndarray,
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Reference points on both faces and area vectors (s, q, 3), from pieces (s, k, d) in the
    master's coordinates.

    X, Y (s, m, 3): the faces' nodes.
    """
    d = pieces.shape[2]
    points, w = face_quadrature(d + 1)
    on_master = np.einsum("qk,skd->sqd", LINEAR[d + 1](points)[0], pieces)
    place, tangents = _map_points(X, on_master)
    edges = pieces[:, 1:] - pieces[:, :1]
    if d == 1:
        vector = np.cross(tangents[:, :, 0], [0.0, 0.0, 1.0]) * (edges[:, :, 0] / 2)[:, :, None]
    else:
        vector = (
            np.cross(tangents[:, :, 0], tangents[:, :, 1])
            * np.abs(np.linalg.det(edges))[:, None, None]
        )
    return (on_master, _locate_points(Y, place @ view.T, view)), vector * w[:, None]


def _locate_points(
    nodes: np.ndarray,
    target: np.ndarray,
    view: np.ndarray,
) -> np.ndarray:
    """Reference points (s, q, d) where faces with nodes (s, m, 3) are seen at target (s, q, d),
    also beyond the faces.

    The first step of Newton's method is the last on straight faces.
    """
    s, q, d = target.shape
    at = np.full((s, q, d), 0.0 if d == 1 else 1 / 3)
    for _ in range(MAX_PROJECTION_STEPS):
        there, slopes = _map_points(nodes, at)
        off = (target - there @ view.T)[..., None]
        slopes = (slopes @ view.T).swapaxes(2, 3)
        if (
            np.abs(np.linalg.det(slopes)) < SLIVER_AREA * np.abs(slopes).max(axis=(2, 3)) ** d
        ).any():
            raise InputError(
                "a face of a contact pair that does not match is seen edge-on along the master's "
                "mean normal, expected faces seen from the front: split the pair"
            )
        at = at + np.linalg.solve(slopes, off)[..., 0]
    return at


def _map_points(nodes: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (s, q, 3) and tangents (s, q, d, 3) on faces with nodes (s, m, 3) at reference points
    (s, q, d).
    """
    s, q, d = at.shape
    m = nodes.shape[1]
    N, dN = face_shape_functions(m, d + 1, at.reshape(-1, d))
    return (
        np.einsum("sqm,smi->sqi", N.reshape(s, q, m), nodes),
        np.einsum("sqmd,smi->sqdi", dN.reshape(s, q, m, d), nodes),
    )

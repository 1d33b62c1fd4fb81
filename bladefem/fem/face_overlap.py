"""Overlap of two faces whose meshes do not match: both sides are integrated over the exact overlap
of their elements.

Both faces are seen along the mean normal of the master, and the slave's faces are clipped by the
master's; shape functions of both are integrated over the pieces, on the curved master with its own
normal at each point. So a uniform pressure loads both bodies with their own consistent nodal forces
and a linear displacement of either is measured without error, on curved faces too where both lie on
one surface and the edges of one are straight in the coordinates of the other. Source of the method:
Puso and Laursen, DOI 10.1016/j.cma.2003.10.010.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from geometry.mesh import Mesh

from ..errors import InputError
from ..util.arrays import BooleanArray, IntegerArray, RealArray
from .face_elements import LINEAR, corner_count, face_quadrature, face_shape_functions
from .surface import outward_signs, surface_quadrature

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


def face_overlap(mesh: Mesh, pair: str) -> Overlap:
    """Cut the two faces of a pair against each other.

    Raises:
        InputError: faces that do not overlap, or a master that turns by more than 75 degrees from
            its mean normal.
    """
    p = mesh.pairs[pair]
    d = mesh.dimension
    master = mesh.faces[p.master]
    slave = mesh.faces[p.slave]
    k = corner_count(d, master.shape[1])
    places = (mesh.points, (mesh.points - p.shift) @ p.rotation)
    X = places[0][master[:, :k]]
    Y = places[1][slave[:, : corner_count(d, slave.shape[1])]]
    weighted, _ = surface_quadrature(mesh, master)
    sign = outward_signs(mesh, master, weighted.sum(axis=1))
    view = _view_axes(weighted.sum(axis=1) * sign[:, None], d, pair)
    close = np.array(_close_pairs(X, Y), dtype=int).reshape(-1, 2)
    # The corners of the slave in the master's own coordinates, in which its edges are taken as
    # straight.
    corners = _locate_points(places[0][master[close[:, 0]]], Y[close[:, 1]] @ view.T, view)
    cut = CUTS[k]
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


def _cut_triangle(corners: np.ndarray) -> list[np.ndarray]:
    """The part of a convex polygon (k, 2) within the reference triangle, as triangles (3, 2)."""
    return _cut_polygon(corners, (lambda p: p[0], lambda p: p[1], lambda p: 1 - p[0] - p[1]))


def _cut_square(corners: np.ndarray) -> list[np.ndarray]:
    """The part of a convex polygon (k, 2) within the reference square, as triangles (3, 2)."""
    return _cut_polygon(
        corners,
        (lambda p: 1 + p[0], lambda p: 1 - p[0], lambda p: 1 + p[1], lambda p: 1 - p[1]),
    )


def _cut_polygon(
    corners: np.ndarray, levels: tuple[Callable[[np.ndarray], float], ...]
) -> list[np.ndarray]:
    """The part of a convex polygon (k, 2) where all levels are positive, as triangles (3, 2)
    (Sutherland-Hodgman).
    """
    polygon = list(corners)
    for level in levels:
        polygon = _clip_polygon(polygon, level)
        if len(polygon) < 3:
            return []
    fan = [np.array([polygon[0], polygon[i], polygon[i + 1]]) for i in range(1, len(polygon) - 1)]
    return [f for f in fan if abs(np.linalg.det(f[1:] - f[0])) > SLIVER_AREA]


# by the corners of the master's faces
CUTS = {2: _cut_line, 3: _cut_triangle, 4: _cut_square}


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
    at = np.full((s, q, d), 1 / 3 if corner_count(d + 1, nodes.shape[1]) == 3 else 0.0)
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
    N, dN = face_shape_functions(m, corner_count(d + 1, m), at.reshape(-1, d))
    return (
        np.einsum("sqm,smi->sqi", N.reshape(s, q, m), nodes),
        np.einsum("sqmd,smi->sqdi", dN.reshape(s, q, m, d), nodes),
    )

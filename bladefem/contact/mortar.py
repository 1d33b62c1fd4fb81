"""Contact faces whose meshes do not match: both sides are integrated over the exact overlap of their elements.

Each slave face is laid onto the plane of each master face and clipped by it; shape functions of both are integrated
over the pieces, so a uniform pressure loads both bodies with their own consistent nodal forces and a linear
displacement of either is measured without error: the contact patch test holds. Faces are taken as flat between their
corners. Source of the method: Puso and Laursen, DOI 10.1016/j.cma.2003.10.010.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from geometry.mesh import Mesh

from ..data import Patch
from ..errors import InputError
from .shape import LINEAR, corner_count, face_quadrature, shape, traction_shape
from .surface import frames, outward, surface

__all__ = ["Overlap", "mortar_means", "mortar_patch", "overlap"]

SLIVER = 1e-9           # pieces below this part of a face's area are dropped
COVERED = 1e-6          # a face counts as covered when less than this part of it is left over


@dataclass(frozen=True)
class Overlap:
    """Pieces of overlap with q quadrature points each."""

    master: np.ndarray              # (nf, k) master faces
    slave: np.ndarray               # (nf, k) slave faces
    face: np.ndarray                # (s, 2) which master and which slave face a piece belongs to
    at: tuple[np.ndarray, np.ndarray]   # two (s, q, d) reference coordinates on the master and on the slave face
    weight: np.ndarray              # (s, q) [m^2]
    covered: np.ndarray             # (nf,) bool, master faces that are covered by slaves


def overlap(mesh: Mesh, pair: str) -> Overlap:
    """Cut the two faces of a pair against each other.

    Raises:
        InputError: faces that are not lines or triangles, or that do not overlap.
    """
    p, d = mesh.pairs[pair], mesh.dimension
    master, slave = mesh.faces[p.master], mesh.faces[p.slave]
    if corner_count(d, master.shape[1]) != d or corner_count(d, slave.shape[1]) != d:
        raise InputError(f"contact pair '{pair}' does not match and has quadrilaterals, expected lines or triangles")
    X = mesh.points[master[:, :d]]
    Y = (mesh.points[slave[:, :d]] - p.shift) @ p.rotation
    pieces = [(i, j, cut) for i, j in _close(X, Y) for cut in (_cut_line if d == 2 else _cut_triangle)(X[i], Y[j])]
    if not pieces:
        raise InputError(f"contact pair '{pair}': faces '{p.master}' and '{p.slave}' do not overlap")
    face = np.array([piece[:2] for piece in pieces])
    at, weight = _quadrature(X[face[:, 0]], Y[face[:, 1]], np.array([piece[2] for piece in pieces]))
    weight = weight * (mesh.depth if d == 2 else 1.0)
    whole = np.linalg.norm(surface(mesh, master)[0], axis=2).sum(axis=1)
    found = np.bincount(face[:, 0], weight.sum(axis=1), len(master))
    return Overlap(master, slave, face, at, weight, found > whole * (1 - COVERED))


def mortar_patch(mesh: Mesh, pair: str) -> Patch:
    """The patch of a pair that does not match: master corners that carry part of the overlap.

    `damper_nodes` are the nearest slave nodes; they serve pictures only.
    """
    p, d, o = mesh.pairs[pair], mesh.dimension, overlap(mesh, pair)
    used = np.unique(o.face[:, 0])
    faces = o.master[used]
    nodes, numbers = np.unique(faces[:, :d], return_inverse=True)
    weighted, _ = surface(mesh, faces)
    normals = np.zeros((len(mesh.points), 3))
    direction = weighted.sum(axis=1) * outward(mesh, faces, weighted.sum(axis=1))[:, None]
    np.add.at(normals, faces[:, :d], direction[:, None, :])
    area = np.bincount(o.master[o.face[:, 0], :d].ravel(),
                       np.einsum("sqk,sq->sk", _traction(o), o.weight).ravel(), len(mesh.points))
    normal = normals[nodes] / np.linalg.norm(normals[nodes], axis=1, keepdims=True)
    across = np.unique(mesh.faces[p.slave])
    nearest = cKDTree((mesh.points[across] - p.shift) @ p.rotation).query(mesh.points[nodes])[1]
    return Patch(pair, mesh.points[nodes], area[nodes], frames(normal, d), numbers.reshape(-1, d), nodes,
                 across[nearest])


def mortar_means(patch: Patch, mesh: Mesh, o: Overlap, side: str) -> sp.csr_matrix:
    """W (n_points, n) as in ``patch.patch_means``."""
    s = 0 if side == "blade" else 1
    faces = (o.master, o.slave)[s][o.face[:, s]]
    d, q = o.at[s].shape[2] + 1, o.at[s].shape[1]
    N, _ = shape(faces.shape[1], d, o.at[s].reshape(-1, d - 1))
    blocks = np.einsum("sq,sqm,sqk->smk", o.weight, N.reshape(len(faces), q, -1), _traction(o))
    number = np.full(len(mesh.points), -1)
    number[patch.blade_nodes] = np.arange(len(patch.blade_nodes))
    columns = number[o.master[o.face[:, 0], :d]]
    W = sp.coo_matrix((blocks.ravel(), (np.repeat(faces, d, axis=1).ravel(),
                                        np.repeat(columns[:, None, :], faces.shape[1], axis=1).ravel())),
                      shape=(len(mesh.points), len(patch.area)))
    return W.tocsr() @ sp.diags(1 / patch.area)


def _traction(o: Overlap) -> np.ndarray:
    """Traction functions (s, q, k) on the pieces: hats on faces covered in part, where the others could be negative."""
    s, q, dim = o.at[0].shape
    flat = o.at[0].reshape(-1, dim)
    hats, chi = LINEAR[dim + 1](flat)[0], traction_shape(dim + 1, flat)
    return np.where(o.covered[o.face[:, 0], None, None], chi.reshape(s, q, -1), hats.reshape(s, q, -1))


def _close(X: np.ndarray, Y: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of faces (corners (n, k, 3)) whose spheres touch."""
    cx, cy = X.mean(axis=1), Y.mean(axis=1)
    rx, ry = (np.linalg.norm(Z - Z.mean(axis=1, keepdims=True), axis=2).max(axis=1) for Z in (X, Y))
    near = cKDTree(cy).query_ball_point(cx, rx + ry.max())
    return [(i, j) for i, js in enumerate(near) for j in sorted(js) if np.linalg.norm(cx[i] - cy[j]) < rx[i] + ry[j]]


def _cut_line(x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
    """Common part of two lines as (2, 1) reference coordinates on the first, laid onto it."""
    t = x[1] - x[0]
    a, b = np.sort((y - x[0]) @ t / (t @ t)).clip(0, 1)
    return [np.array([[2 * a - 1], [2 * b - 1]])] if b - a > SLIVER else []


def _cut_triangle(x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
    """Common part of two triangles as triangles (3, 2) in reference coordinates of the first (Sutherland-Hodgman)."""
    polygon = (y - x[0]) @ np.linalg.pinv(x[1:] - x[0])
    for level in (lambda p: p[0], lambda p: p[1], lambda p: 1 - p[0] - p[1]):
        polygon = _clip(polygon, level)
        if len(polygon) < 3:
            return []
    fan = [np.array([polygon[0], polygon[i], polygon[i + 1]]) for i in range(1, len(polygon) - 1)]
    return [f for f in fan if abs(np.linalg.det(f[1:] - f[0])) > SLIVER]


def _clip(polygon: list[np.ndarray] | np.ndarray, level: object) -> list[np.ndarray]:
    """The part of a convex polygon where a linear function is not negative."""
    kept = []
    for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        la, lb = level(a), level(b)
        if la >= 0:
            kept.append(a)
        if la * lb < 0:
            kept.append(a + (b - a) * la / (la - lb))
    return kept


def _quadrature(X: np.ndarray, Y: np.ndarray, pieces: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Reference points on both faces and weights [m, m^2], from pieces (s, k, d) in the master's coordinates."""
    d = pieces.shape[2]
    points, w = face_quadrature(d + 1)
    L, _ = LINEAR[d + 1](points)
    on_master = np.einsum("qk,skd->sqd", L, pieces)
    place = np.einsum("sqk,ski->sqi", LINEAR[d + 1](on_master.reshape(-1, d))[0].reshape(*on_master.shape[:2], -1), X)
    tangents = Y[:, 1:] - Y[:, :1]
    local = np.einsum("sqi,sid->sqd", place - Y[:, :1], np.linalg.pinv(tangents))
    on_slave = 2 * local - 1 if d == 1 else local
    side = np.einsum("skd,sdi->ski", pieces[:, 1:] - pieces[:, :1], (X[:, 1:] - X[:, :1]) / (2 if d == 1 else 1))
    normal = side[:, 0] / 2 if d == 1 else np.cross(side[:, 0], side[:, 1])
    return (on_master, on_slave), np.linalg.norm(normal, axis=1)[:, None] * w

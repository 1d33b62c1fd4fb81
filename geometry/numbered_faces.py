"""The outside of a mesh cut into faces along its edges and numbered, for files without names.

Outer facets that share an edge belong to one face unless they meet there at more than CREASE_ANGLE.
Faces are numbered from the largest: face_1, face_2, ..., or outer_face_1, ... where sets of the
file have such names themselves. The numbers depend on the file alone, not on what becomes of its
cells, so that a scene may name faces by them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from bladefem.util.arrays import IntegerArray, RealArray

from .raw_mesh import RawMesh
from .topology import CORNERS, DIMENSION, FACETS, FAMILY

# before the number of a face, and where the file has sets of such names
FACE_WORD = "face_"
OTHER_FACE_WORD = "outer_face_"
# [rad] between normals of neighbours across an edge of the body
CREASE_ANGLE = np.radians(30.0)
# digits to which areas and places count when faces are ordered
COMPARED_DIGITS = 6


@dataclass(frozen=True)
class NumberedFaces:
    """Outer facets of the solid cells and the face that each belongs to."""

    # (nf, 4) corner nodes, -1 in place of the fourth of a triangle
    corners: IntegerArray
    # (nf,) from 0, the largest face first
    number: IntegerArray
    # (nf, 3) outward, as long as the facet's area
    normals: RealArray
    # (nf, 3)
    centres: RealArray

    @property
    def count(self) -> int:
        """Number of faces."""
        return int(self.number.max(initial=-1)) + 1


def numbered_faces(raw: RawMesh) -> NumberedFaces:
    """Faces of the solid cells of a file; none of a plane mesh."""
    corners, inside = _outer_facets(raw)
    centres, normals = _measure_facets(raw.points, corners, inside)
    part = _smooth_parts(corners, normals)
    order = _by_size(part, centres, normals, raw.points)
    return NumberedFaces(corners, order[part], normals, centres)


def face_word(raw: RawMesh) -> str:
    """What stands before the number of a face."""
    names = (*raw.groups, *raw.node_sets, *raw.surfaces)
    taken = any(re.fullmatch(rf"{FACE_WORD}\d+", name.lower()) for name in names)
    return OTHER_FACE_WORD if taken else FACE_WORD


def with_numbered_faces(raw: RawMesh, names: Iterable[str], before: str = "") -> RawMesh:
    """Faces that are named by their numbers, as surfaces of the file.

    Args:
        names: those of other groups and files are left alone.
        before: what stands before "face_3", such as "damper.".
    """
    there = {name.lower() for name in (*raw.groups, *raw.node_sets, *raw.surfaces)}
    word = f"{before}{face_word(raw)}"
    start = word.lower()
    asked = {name.lower() for name in names} - there
    ends = {name[len(start) :] for name in asked if name.startswith(start)}
    numbers = sorted(int(end) for end in ends if end.isdigit())
    if not numbers:
        return raw
    faces = numbered_faces(raw)
    found = {f"{word}{n}": face_corners(faces, n - 1) for n in numbers if 0 < n <= faces.count}
    return replace(raw, surfaces={**raw.surfaces, **found})


def face_corners(faces: NumberedFaces, number: int) -> list[np.ndarray]:
    """Corner nodes (nf, 3) and (nf, 4) of one face, as RawMesh.surfaces holds them."""
    mine = faces.corners[faces.number == number]
    triangles = mine[:, 3] < 0
    parts = [mine[triangles][:, :3], mine[~triangles]]
    return [part for part in parts if len(part)]


def _outer_facets(raw: RawMesh) -> tuple[np.ndarray, np.ndarray]:
    """Corners (nf, 4) of the facets of one cell alone, and the centres (nf, 3) of these cells."""
    corners = [np.empty((0, 4), dtype=int)]
    inside = [np.empty((0, 3))]
    for word, cells in raw.blocks:
        family = FAMILY.get(word, "")
        if DIMENSION.get(family) != 3:
            continue
        middle = raw.points[cells[:, : CORNERS[family]]].mean(axis=1)
        for facet in FACETS[family]:
            row = np.full((len(cells), 4), -1)
            row[:, : len(facet)] = cells[:, facet]
            corners.append(row)
            inside.append(middle)
    every = np.vstack(corners)
    _, first, count = np.unique(
        np.sort(every, axis=1), axis=0, return_index=True, return_counts=True
    )
    outer = np.sort(first[count == 1])
    return every[outer], np.vstack(inside)[outer]


def _measure_facets(
    points: np.ndarray,
    corners: np.ndarray,
    inside: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Centres and outward normals (nf, 3) of facets."""
    last = np.where(corners[:, 3] < 0, corners[:, 2], corners[:, 3])
    a, b, c, d = (points[nodes] for nodes in (*corners[:, :3].T, last))
    quads = corners[:, 3:] >= 0
    centres = np.where(quads, (a + b + c + d) / 4, (a + b + c) / 3)
    normals = np.where(quads, np.cross(c - a, d - b), np.cross(b - a, c - a)) / 2
    inward = np.einsum("ij,ij->i", normals, centres - inside) < 0
    normals[inward] *= -1
    return centres, normals


def _smooth_parts(corners: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(nf,) part of the outside, its facets joined across smooth edges."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = normals / np.maximum(length, np.finfo(float).tiny)
    triangle = corners[:, 3] < 0
    edges = []
    owner = []
    for i in range(4):
        start = corners[:, i]
        end = np.where(triangle & (i == 2), corners[:, 0], corners[:, (i + 1) % 4])
        there = ~triangle | (i < 3)
        edges.append(np.sort(np.column_stack([start, end])[there], axis=1))
        owner.append(np.flatnonzero(there))
    every = np.concatenate(owner)
    _, number, count = np.unique(np.vstack(edges), axis=0, return_inverse=True, return_counts=True)
    number = number.ravel()
    order = np.argsort(number, kind="stable")
    order = order[count[number[order]] == 2]
    one, other = every[order].reshape(-1, 2).T
    smooth = np.einsum("ij,ij->i", unit[one], unit[other]) > np.cos(CREASE_ANGLE)
    n = len(corners)
    graph = coo_matrix((np.ones(smooth.sum()), (one[smooth], other[smooth])), shape=(n, n))
    return connected_components(graph, directed=False)[1]


def _by_size(
    part: np.ndarray,
    centres: np.ndarray,
    normals: np.ndarray,
    points: np.ndarray,
) -> np.ndarray:
    """(parts,) rank of each part: by area, ties by place."""
    if not len(part):
        return np.empty(0, dtype=int)
    area = np.bincount(part, np.linalg.norm(normals, axis=1))
    members = np.bincount(part)
    size = np.ptp(points, axis=0).max()
    keys = [np.round(np.bincount(part, x) / members / size, COMPARED_DIGITS) for x in centres.T]
    rank = np.empty(len(area), dtype=int)
    rank[np.lexsort([*keys, -np.round(area / area.max(), COMPARED_DIGITS)])] = np.arange(len(area))
    return rank

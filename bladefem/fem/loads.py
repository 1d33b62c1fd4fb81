"""Volumes and load vectors by quadrature in NumPy, in mesh numbering, the same on every rank."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Mesh
from geometry.whole_cells import own_cells, own_facets

from ..errors import InputError, suggestion
from . import shape_functions as shape
from .cell_functions import geometry
from .temperature import density_at, point_temperatures

if TYPE_CHECKING:
    from .body import Body

# of the force of a rotation: a shape function, a place and the Jacobian of a curved quadratic
# element, which is exact for simplices and for all hexahedra but very distorted ones
SIMPLEX_DEGREE = 7
TENSOR_DEGREE = 8


def body_volume(mesh: Mesh, name: str) -> float:
    """Volume of a body [m^3], plane meshes with their depth.

    Raises:
        InputError: the mesh has no such body.
    """
    if name not in mesh.bodies:
        raise InputError(f"the mesh has no body '{name}'{suggestion(name, mesh.bodies)}")
    parts = [_quadrature_measure(mesh, own.word, own.cells, 6) for own in own_cells(mesh, (name,))]
    return float(sum(weight.sum() for _, weight, _ in parts))


def body_mass(body: Body) -> float:
    """Mass of a body [kg]."""
    if body.pieces:
        return sum(body_mass(piece.body) for piece in body.pieces)
    total = 0.0
    for name, material in body.material.items():
        cells = body.mesh.bodies[name]
        values, weight, _ = _quadrature_measure(body.mesh, body.mesh.cell_type, cells, 6)
        rho = density_at(material, point_temperatures(body.heat, cells, values))
        total += float((rho * weight).sum())
    return total


def centrifugal(
    body: Body,
    speed: float,
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> np.ndarray:
    """(n_points*dim,) consistent nodal forces [N] of a steady rotation.

    Args:
        speed: [rad/s].
        axis, centre: direction of the axis and a point on it [m].
    """
    if body.pieces:
        parts = [piece.back(centrifugal(piece.body, speed, axis, centre)) for piece in body.pieces]
        return np.asarray(sum(parts))
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    across = np.eye(3) - np.outer(unit, unit)
    force = np.zeros((len(body.mesh.points), body.dim))
    for name, material in body.material.items():
        cells = body.mesh.bodies[name]
        simplex = body.mesh.cell_type.startswith(("tri", "tet"))
        degree = SIMPLEX_DEGREE if simplex else TENSOR_DEGREE
        values, weight, x = _quadrature_measure(body.mesh, body.mesh.cell_type, cells, degree)
        rho = density_at(material, point_temperatures(body.heat, cells, values))
        field = ((x - centre) @ across)[:, :, : body.dim] * (rho[..., None] * speed**2)
        # (nc, d, k)
        share = np.tensordot(field * weight[:, :, None], values, axes=([1], [0]))
        np.add.at(force, cells, share.transpose(0, 2, 1))
    return force.ravel()


def surface_load(
    body: Body,
    face: str,
    traction: tuple[float, ...] | np.ndarray | None = None,
    pressure: float | None = None,
) -> np.ndarray:
    """(n_points*dim,) consistent nodal forces [N] on a named face.

    Args:
        traction: (dim,) force per unit area [Pa].
        pressure: [Pa], positive towards the body.

    Raises:
        InputError: no such face, or not exactly one of traction and pressure given.
    """
    if (traction is None) == (pressure is None):
        raise InputError("surface_load needs traction or pressure, expected exactly one of them")
    d = body.dim
    depth = body.mesh.depth if d == 2 else 1.0
    force = np.zeros((len(body.mesh.points), d))
    for word, facets in facets_by_shape(body, _face_facets(body, face)):
        values, tangents, w = shape.geometry(word, body.mesh.points[facets][:, :, :d], 8)
        normal = _outward_normals(body, word, facets, _area_normals(tangents))
        if pressure is not None:
            field = -pressure * normal
        else:
            field = np.linalg.norm(normal, axis=2)[:, :, None] * np.asarray(traction, float)[:d]
        np.add.at(force, facets, depth * np.einsum("qk,q,cqd->ckd", values, w, field))
    return force.ravel()


def facets_by_shape(body: Body, facets: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Facets (nf, k) of the mesh as those of the cells that are solved: meshio's word and nodes.

    A triangle that is half of a quadrilateral, without the other half, is a triangle.
    """
    own, halves = own_facets(body.mesh, tuple(body.material), facets)
    found = list(own.items())
    return [*found, (shape.FACET_OF[body.mesh.cell_type], halves)] if len(halves) else found


def _quadrature_measure(
    mesh: Mesh,
    word: str,
    cells: np.ndarray,
    degree: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shape values (q, k), volumes (nc, q) and places (nc, q, 3) of the quadrature points."""
    d = mesh.dimension
    values, tangents, w = geometry(word, mesh.points[cells][:, :, :d], degree)
    weight = np.abs(_determinants(tangents)) * w * (mesh.depth if d == 2 else 1.0)
    places = np.tensordot(mesh.points[cells], values, axes=([1], [1])).transpose(0, 2, 1)
    return values, weight, places


def _determinants(J: np.ndarray) -> np.ndarray:
    """(...) of matrices (..., d, d) of two or three rows."""
    if J.shape[-1] == 2:
        return J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]
    out: np.ndarray = np.einsum("...i,...i->...", J[..., 0], np.cross(J[..., 1], J[..., 2]))
    return out


def _face_facets(body: Body, face: str) -> np.ndarray:
    faces = body.mesh.faces
    if face not in faces:
        raise InputError(f"the mesh has no face '{face}'{suggestion(face, faces)}")
    facets = faces[face][(body.rows[faces[face]] >= 0).all(1)]
    if not len(facets):
        raise InputError(f"face '{face}' does not lie on body '{body.name}'")
    return facets


def _area_normals(tangents: np.ndarray) -> np.ndarray:
    """(nf, q, d) normals with the length of the surface element."""
    if tangents.shape[3] == 1:
        t = tangents[..., 0]
        return np.stack([t[..., 1], -t[..., 0]], axis=-1)
    return np.cross(tangents[..., 0], tangents[..., 1])


def _outward_normals(
    body: Body,
    word: str,
    facets: np.ndarray,
    normal: np.ndarray,
) -> np.ndarray:
    """Normals pointed away from the cell behind each facet."""
    mesh = body.mesh
    d = body.dim
    cells = np.concatenate([mesh.bodies[n] for n in body.material])
    corner = facets[:, : shape.corner_count(word)]
    shared = _cell_incidence(corner, len(mesh.points)) @ _cell_incidence(cells, len(mesh.points)).T
    behind = np.asarray(shared.argmax(axis=1)).ravel()
    inward = mesh.points[cells[behind]].mean(1) - mesh.points[corner].mean(1)
    side = np.einsum("cd,cd->c", normal.mean(1), inward[:, :d])
    return normal * -np.sign(side)[:, None, None]


def _cell_incidence(cells: np.ndarray, n: int) -> sp.csr_matrix:
    rows = np.repeat(np.arange(len(cells)), cells.shape[1])
    return sp.csr_matrix((np.ones(cells.size), (rows, cells.ravel())), shape=(len(cells), n))

"""The potential of a rotating, heated body, its derivatives, and matrices of them.

In the rotating frame a Saint Venant-Kirchhoff body has the potential

    integral of  E : C : E / 2  -  rho Omega^2 |P (X + u)|^2 / 2,      E = (F^T F - 1) / 2,
    F = 1 + grad u,

P the projection across the axis. In a body that is not at reference temperature, E less the thermal
strain takes the place of E. Its first derivative is the balance of the preload, its second the
stiffness of small vibrations about it: stress stiffening and spin softening in one matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .body import Body, body_properties, cells_of, degrees, sum_matrices
from .compat import PETSc, assemble_matrix, assemble_vector, compile_form, dolfinx, ufl
from .thermal_strain import thermal_strain


@dataclass(frozen=True)
class PotentialForms:
    """The potential's derivatives on cells of one shape, compiled, with the displacement and the
    squared speed to be set.
    """

    body: Body
    u: Any
    speed2: Any
    # share of the thermal strain
    heating: Any
    force: Any
    stiffness: Any
    # (local blocks,) mesh node of each block of this rank, ghosts included
    node_of: np.ndarray


def elastic_degrees(body: Body, quadrature: str) -> tuple[int, int]:
    """Quadrature degrees of the elastic integrals, which are of fourth power in grad u, and of the
    inertial ones.
    """
    stiff, mass = degrees(body.mesh, cells_of(body), quadrature, body.heat)
    if quadrature == "exact" and stiff < 4:
        stiff *= 2
    return stiff, mass


def integral_measures(body: Body, degree: tuple[int, int]) -> tuple[Any, Any]:
    """Measures for the elastic and the inertial integrals."""
    elastic, inertial = (
        ufl.Measure("dx", body.space.mesh, metadata={"quadrature_degree": d}) for d in degree
    )
    return elastic, inertial


def across_axis(body: Body, axis: tuple[float, float, float]) -> Any:
    """(dim, dim) projection across the axis."""
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    return ufl.as_matrix((np.eye(3) - np.outer(unit, unit))[: body.dim, : body.dim].tolist())


def potential_forms(
    body: Body,
    axis: tuple[float, float, float],
    quadrature: str,
) -> list[PotentialForms]:
    """First and second derivative of the potential, one of each piece of a body of mixed shapes."""
    if body.pieces:
        parts = [potential_forms(piece.body, axis, quadrature) for piece in body.pieces]
        return [forms for part in parts for forms in part]
    domain = body.space.mesh
    u = dolfinx.fem.Function(body.space)
    speed2 = dolfinx.fem.Constant(domain, 0.0)
    v = ufl.TestFunction(body.space)
    w = ufl.TrialFunction(body.space)
    degree = elastic_degrees(body, quadrature)
    stress, rho, depth = body_properties(body, degree)
    heating = dolfinx.fem.Constant(domain, 0.0)
    # F^T F - 1 would cancel small strains
    E = ufl.sym(ufl.grad(u)) + ufl.grad(u).T * ufl.grad(u) / 2
    # of free expansion: ((1 + strain)^2 - 1) / 2, of symmetric matrices
    free = heating * thermal_strain(body, degree[0])
    E = E - (free + free * free / 2)
    place = across_axis(body, axis) * (ufl.SpatialCoordinate(domain) + u)
    elastic, inertial = integral_measures(body, degree)
    potential = (
        depth / 2 * ufl.inner(stress(E), E) * elastic
        - depth * rho * speed2 / 2 * ufl.inner(place, place) * inertial
    )
    force = ufl.derivative(potential, u, v)
    own = PotentialForms(
        body,
        u,
        speed2,
        heating,
        compile_form(force),
        compile_form(ufl.derivative(force, u, w)),
        _block_nodes(body),
    )
    return [own]


def set_heating(forms: Sequence[PotentialForms], share: float) -> None:
    """How much of the thermal strain is there."""
    for part in forms:
        part.heating.value = share


def unbalanced_force(
    body: Body,
    forms: Sequence[PotentialForms],
    u: np.ndarray,
    speed2: float,
) -> np.ndarray:
    """(n_points*dim, 1) unbalanced force in mesh numbering [N]."""
    if body.pieces:
        parts = [
            piece.back(_elastic_force(own, piece.onto(u), speed2))
            for piece, own in zip(body.pieces, forms, strict=True)
        ]
        force = np.asarray(sum(parts))
    else:
        force = _elastic_force(forms[0], u, speed2)
    if body.spring is not None:
        force = force + _spring_force(body, body.spring, u)
    return force.reshape(-1, 1)


def _elastic_force(forms: PotentialForms, u: np.ndarray, speed2: float) -> np.ndarray:
    """(n_points*dim,) unbalanced force of cells of one shape in mesh numbering [N]."""
    _set_state(forms, u, speed2)
    return in_mesh_numbering(forms.body, assemble_vector(forms.force).array).ravel()


def _spring_force(body: Body, spring: PETSc.Mat, u: np.ndarray) -> np.ndarray:
    """(n_points*dim,) the springs' forces in mesh numbering [N]."""
    moved, force = spring.createVecs()
    moved.array = u[_block_nodes(body)].ravel()[: moved.getLocalSize()]
    spring.mult(moved, force)
    return in_mesh_numbering(body, force.array).ravel()


def in_mesh_numbering(body: Body, part: np.ndarray) -> np.ndarray:
    """(n_points, dim) of an assembled vector's share of this rank; the same on every rank."""
    rows = np.concatenate(body.comm.allgather(part))
    out = np.zeros((body.rows.size, body.dim))
    inside = body.rows >= 0
    out[inside] = rows.reshape(-1, body.dim)[body.rows[inside]]
    return out


def tangent_matrix(
    body: Body,
    forms: Sequence[PotentialForms],
    u: np.ndarray,
    speed2: float,
) -> PETSc.Mat:
    if not body.pieces:
        return with_springs(body, _elastic_tangent(forms[0], u, speed2))
    parts = (
        _elastic_tangent(own, piece.onto(u), speed2)
        for piece, own in zip(body.pieces, forms, strict=True)
    )
    return with_springs(body, sum_matrices(body, parts))


def _elastic_tangent(forms: PotentialForms, u: np.ndarray, speed2: float) -> PETSc.Mat:
    """Second derivative of the potential on cells of one shape."""
    _set_state(forms, u, speed2)
    return assemble_matrix(forms.stiffness)


def with_springs(body: Body, stiffness: PETSc.Mat) -> PETSc.Mat:
    """The stiffness with that of the springs to the ground, in its own memory."""
    if body.spring is not None:
        stiffness.axpy(1.0, body.spring, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    return stiffness


def _set_state(
    forms: PotentialForms,
    u: np.ndarray,
    speed2: float,
) -> None:
    forms.u.x.array[:] = u[forms.node_of].ravel()
    forms.speed2.value = speed2


def displacement_function(body: Body, u: np.ndarray) -> Any:
    """A displacement in mesh numbering as a function of the body's space."""
    function = dolfinx.fem.Function(body.space)
    function.x.array[:] = u[_block_nodes(body)].ravel()
    return function


def _block_nodes(body: Body) -> np.ndarray:
    """(local blocks,) mesh node of each block of this rank, ghosts included."""
    index_map = body.space.dofmap.index_map
    node_of = np.empty(index_map.size_global, np.int64)
    inside = np.flatnonzero(body.rows >= 0)
    node_of[body.rows[inside]] = inside
    return node_of[
        index_map.local_to_global(
            np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        )
    ]

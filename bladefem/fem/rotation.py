"""Steady rotation and heat: preload, stress stiffening and spin softening of an elastic body.

In the rotating frame a Saint Venant-Kirchhoff body has the potential

    integral of  E : C : E / 2  -  rho Omega^2 |P (X + u)|^2 / 2,      E = (F^T F - 1) / 2,
    F = 1 + grad u,

P the projection across the axis. In a body that is not at reference temperature, E less the thermal
strain takes the place of E. Its first derivative is the balance of the preload, its second the
stiffness of small vibrations about it: stress stiffening and spin softening in one matrix.

The linear preload, which other codes call a perturbation step, takes u0 from the linear balance K
u0 = f and puts K_L(u0) + K_geo(u0) - Omega^2 M_P in the place of the second derivative: material
stiffness on the moved body, and the stress of the linear strain. The two are never mixed: the
potential's second derivative at a linear u0 contains stresses of order |grad u0|^2 that the linear
balance knows nothing of, and is wrong by a factor on a twisted blade.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError, NotSolvedError
from ..scene.material_table import expands_by_axes
from ..scene.units import show
from ..util.newton import Outcome, StepError, iterate_newton
from . import shape_functions as shape
from .body import Body, body_properties, cells_of, degrees, sum_matrices
from .compat import PETSc, assemble_matrix, assemble_vector, compile_form, dolfinx, ufl
from .constraint import Constrained, expand_to_mesh, in_step, restrict_load
from .flexibility import Flexibility, compliance, flexible
from .loads import centrifugal
from .temperature import (
    cell_temperatures,
    evaluate_materials,
    form_coefficient,
    material_numbers,
    strain_at,
    strain_tensor_at,
)

AXIS = (0.0, 0.0, 1.0)
# Newton steps of one load step
MAX_NEWTON_STEPS = 25
# of the load step before giving up
MAX_LOAD_HALVINGS = 8
# times the tolerance: an error that falls no further below this is rounding
ROUNDING_OVER_TOLERANCE = 1e3


@dataclass(frozen=True)
class SteadyState:
    """What small vibrations are about, whose stiffness is `linear_tangent` or `tangent`."""

    # (n_points, dim) static displacement [m]
    displacement: np.ndarray
    # [rad/s]
    speed: float
    axis: tuple[float, float, float] = AXIS
    # Green's strain: of a nonlinear preload
    large: bool = False


@dataclass(frozen=True)
class Preload:
    """The static state under rotation and heat."""

    # (n_points, dim) [m], the same on every rank
    displacement: np.ndarray
    # [rad/s]
    speed: float
    # Newton steps of all load steps
    iterations: int
    # load steps
    steps: int
    # |unbalanced force| over |centrifugal and thermal force|
    residual: float


@dataclass(frozen=True)
class _Forms:
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


def unit_speed_displacement(
    flex: Flexibility, axis: tuple[float, float, float] = AXIS
) -> np.ndarray:
    """(n_points, dim) linear displacement [m s^2] for unit rotation; times the speed squared it is
    the preload.

    Args:
        flex: the factorised body in nodal diameter 0 or without cyclic symmetry.
    """
    load = centrifugal(flex.con.body, 1.0, axis)
    return _static_displacement(flex, load, "a rotation loads all sectors alike")


def has_thermal_strain(body: Body) -> bool:
    """Some of the body is not at reference temperature."""
    return body.heat is not None and body.heat.strains


def thermal_force(body: Body, quadrature: str = "exact") -> np.ndarray:
    """(n_points*dim,) nodal forces [N] that hold against the thermal strain; the same on every
    rank.

    Args:
        quadrature: "exact" or "ccx", as in :func:`bladefem.fem.body.assemble`.

    Raises:
        InputError: the expansion of a material is not known.
    """
    if not has_thermal_strain(body):
        return np.zeros(body.dim * len(body.mesh.points))
    if body.pieces:
        parts = [piece.back(thermal_force(piece.body, quadrature)) for piece in body.pieces]
        return np.asarray(sum(parts))
    degree = degrees(body.mesh, cells_of(body), quadrature, body.heat)
    stress, _, depth = body_properties(body, degree)
    v = ufl.TestFunction(body.space)
    measure = ufl.Measure("dx", body.space.mesh, metadata={"quadrature_degree": degree[0]})
    hot = stress(_thermal_strain(body, degree[0]))
    form = compile_form(depth * ufl.inner(hot, ufl.sym(ufl.grad(v))) * measure)
    return in_mesh_numbering(body, assemble_vector(form).array).ravel()


def thermal_displacement(flex: Flexibility, quadrature: str = "exact") -> np.ndarray:
    """(n_points, dim) linear displacement [m] by the thermal strain.

    Args:
        flex: the factorised body in nodal diameter 0 or without cyclic symmetry.
    """
    load = thermal_force(flex.con.body, quadrature)
    return _static_displacement(flex, load, "the temperature is that of all sectors")


def _static_displacement(flex: Flexibility, load: np.ndarray, reason: str) -> np.ndarray:
    """(n_points, dim) linear displacement [m] by forces (n_points*dim,) [N], the same in all
    sectors.

    Args:
        reason: why no other nodal diameter is loaded, for the message.
    """
    con = flex.con
    if con.nodal_diameter not in (None, 0):
        raise InputError(f"nodal_diameter is {con.nodal_diameter}, expected 0: {reason}")
    solved = compliance(flex, restrict_load(con, load.reshape(-1, 1)))
    return expand_to_mesh(con, solved)[:, :, 0].real


def _thermal_strain(body: Body, degree: int) -> Any:
    """(dim, dim) thermal strain [1] at the quadrature points of a degree, as a function of forms; 0
    without temperatures.
    """
    domain = body.space.mesh
    heat = body.heat
    temperature = cell_temperatures(body.mesh, body.material, domain, heat, degree)
    if heat is None or temperature is None or not heat.strains:
        return dolfinx.fem.Constant(domain, 0.0) * ufl.Identity(body.dim)
    owner = material_numbers(body.mesh, body.material, domain)
    if not any(expands_by_axes(material) for material in body.material.values()):
        values = evaluate_materials(
            body.material, owner, temperature, lambda m, t: strain_at(m, heat, np.asarray(t))
        )
        return form_coefficient(domain, values, degree) * ufl.Identity(body.dim)
    tensors = evaluate_materials(
        body.material,
        owner,
        temperature,
        lambda m, t: strain_tensor_at(m, heat, np.asarray(t), body.dim),
    )
    axes = range(body.dim)
    parts = {
        (i, j): form_coefficient(domain, tensors[..., i, j], degree)
        for i in axes
        for j in axes
        if i <= j
    }
    return ufl.as_tensor([[parts[min(i, j), max(i, j)] for j in axes] for i in axes])


def linear_tangent(
    body: Body,
    u0: np.ndarray,
    speed: float,
    axis: tuple[float, float, float] = AXIS,
    quadrature: str = "exact",
) -> PETSc.Mat:
    """Stiffness of small vibrations about a linear preload, spin softening included [N/m].

    Args:
        u0: (n_points, dim) linear displacement [m], of :func:`unit_speed_displacement` and
            :func:`thermal_displacement`.
        quadrature: "exact" or "ccx", as in :func:`bladefem.fem.body.assemble`.
    """
    if body.pieces:
        parts = (
            linear_tangent(piece.body, piece.onto(u0), speed, axis, quadrature)
            for piece in body.pieces
        )
        return _with_springs(body, sum_matrices(body, parts))
    v = ufl.TestFunction(body.space)
    w = ufl.TrialFunction(body.space)
    degree = _elastic_degrees(body, quadrature)
    stress, rho, depth = body_properties(body, degree)
    speed2 = dolfinx.fem.Constant(body.space.mesh, float(speed) ** 2)
    across = _across_axis(body, axis)
    gradient = ufl.grad(_displacement_function(body, u0))
    F = ufl.Identity(body.dim) + gradient

    moved = ufl.inner(stress(ufl.sym(F.T * ufl.grad(v))), ufl.sym(F.T * ufl.grad(w)))
    strain = ufl.sym(gradient) - _thermal_strain(body, degree[0]) * ufl.Identity(body.dim)
    geometric = ufl.inner(ufl.grad(v) * stress(strain), ufl.grad(w))
    elastic, inertial = _integral_measures(body, degree)
    stiffness = assemble_matrix(
        depth * (moved + geometric) * elastic
        - depth * rho * speed2 * ufl.inner(across * v, w) * inertial
    )
    return _with_springs(body, stiffness)


def preload(
    body: Body,
    speed: float,
    clamp: str | None = "clamp",
    axis: tuple[float, float, float] = AXIS,
    tolerance: float = 1e-10,
    quadrature: str = "exact",
    given: np.ndarray | None = None,
) -> Preload:
    """The nonlinear static state under a steady rotation and heat, by Newton's method with load
    steps that halve when it fails.

    A body with the pair "cyclic" moves alike in all sectors (nodal diameter 0). Springs to the
    ground keep the directions that they have on the body at rest.

    Args:
        speed: [rad/s].
        clamp: face or node set held fast.
        tolerance: wanted |unbalanced force| over |centrifugal and thermal force|; rounding may
            leave more in slender bodies.
        quadrature: "exact" or "ccx", as in :func:`bladefem.fem.body.assemble`.
        given: (n_points, dim) displacement [m] that the clamp keeps, and that Newton's method
            starts from elsewhere; zero when left out.

    Raises:
        InputError: speed is negative or not finite, no such face.
        NotSolvedError: the state buckles or tears before the speed and temperature are reached;
            the message says where.
    """
    _check_speed(speed)
    if given is None and speed == 0 and not has_thermal_strain(body):
        return Preload(np.zeros((len(body.mesh.points), body.dim)), speed, 0, 0, 0.0)
    forms = _potential_forms(body, axis, quadrature)
    con = in_step(body, clamp)
    load = centrifugal(body, speed, axis) + thermal_force(body, quadrature)
    size = _vector_length(con, restrict_load(con, load.reshape(-1, 1)))
    if given is None:
        given = np.zeros((len(body.mesh.points), body.dim))
    u, iterations, steps, misfit = _load_steps(con, clamp, forms, speed, tolerance * size, given)
    return Preload(u, speed, iterations, steps, misfit / size)


def _load_steps(
    con: Constrained,
    clamp: str | None,
    forms: Sequence[_Forms],
    speed: float,
    limit: float,
    given: np.ndarray,
) -> tuple[np.ndarray, int, int, float]:
    """The state at a speed, Newton iterations, load steps, and the unbalanced force left [N]."""
    u = np.zeros((len(con.body.mesh.points), con.body.dim))
    done = 0.0
    part = 1.0
    iterations = 0
    steps = 0
    halvings = 0
    misfit = 0.0
    while done < 1.0:
        target = min(done + part, 1.0)
        _set_heating(forms, target)
        start = u + (target - done) * given
        trial, used, error = _solve_newton(con, clamp, forms, start, target * speed**2, limit)
        iterations += used
        if isinstance(error, str):
            halvings = halvings + 1
            part = part / 2
            if halvings > MAX_LOAD_HALVINGS:
                heated = f" and {done:.0%} of the heat" if has_thermal_strain(con.body) else ""
                raise NotSolvedError(
                    f"operation.speed = {show(speed, 'rad/s')}: the nonlinear preload was not "
                    f"found, beyond {np.sqrt(done):.0%} of the speed{heated} {error}"
                )
            continue
        u = trial
        misfit = error
        done = target
        steps = steps + 1
    return u, iterations, steps, misfit


def tangent(
    body: Body,
    state: Preload | SteadyState,
    axis: tuple[float, float, float] = AXIS,
    quadrature: str = "exact",
) -> PETSc.Mat:
    """Stiffness of small vibrations about a nonlinear preload, spin softening included [N/m]."""
    forms = _potential_forms(body, axis, quadrature)
    _set_heating(forms, 1.0)
    return _tangent_matrix(body, forms, state.displacement, state.speed**2)


def state_tangent(body: Body, state: SteadyState) -> PETSc.Mat:
    """Stiffness of small vibrations about a steady state, spin softening included [N/m]."""
    if state.large:
        return tangent(body, state, state.axis)
    return linear_tangent(body, state.displacement, state.speed, state.axis)


def body_about(body: Body, state: SteadyState) -> Body:
    """The body at rest with the stiffness that it has about a steady state; mass and nodes stay."""
    return replace(body, K=state_tangent(body, state), state=state)


def body_under_rotation(
    body: Body,
    speed: float,
    clamp: str | None = "clamp",
    axis: tuple[float, float, float] = AXIS,
    linear: bool = False,
) -> Body:
    """The body with the stiffness that it has under a steady rotation and its temperatures; mass
    and nodes stay.

    Args:
        speed: [rad/s].
        clamp: face or node set held fast in the preload.
        linear: first-order preload and stiffness (one static solve) instead of Newton's method.

    Raises:
        InputError, NotSolvedError: see :func:`preload`.
    """
    _check_speed(speed)
    if speed == 0 and not has_thermal_strain(body):
        return body
    if not linear:
        found = preload(body, speed, clamp, axis)
        return body_about(body, SteadyState(found.displacement, speed, axis, large=True))
    flex = flexible(in_step(body, clamp))
    u0 = speed**2 * unit_speed_displacement(flex, axis) + thermal_displacement(flex)
    return body_about(body, SteadyState(u0, speed, axis))


def _check_speed(speed: float) -> None:
    if not (np.isfinite(speed) and speed >= 0):
        raise InputError(f"speed is {speed} rad/s, expected a number not below 0")


@dataclass(frozen=True)
class _Trial:
    """A displacement on the way to equilibrium."""

    # (n_points, dim) [m]
    u: np.ndarray
    # (n_own, 1) unbalanced force of the unknowns [N]
    unbalanced: np.ndarray
    # its length [N], and that of the trial before
    error: float
    before: float


def _solve_newton(
    con: Constrained,
    clamp: str | None,
    forms: Sequence[_Forms],
    u: np.ndarray,
    speed2: float,
    limit: float,
) -> tuple[np.ndarray, int, float | str]:
    """Newton's method from ``u``: the state, the steps taken, and the error left or the reason of a
    failure.
    """

    def trial(u: np.ndarray, before: float) -> _Trial:
        r = restrict_load(con, _unbalanced_force(con.body, forms, u, speed2))
        return _Trial(u, r, _vector_length(con, r), before)

    def error_beyond_rounding(state: _Trial) -> float:
        near = state.error < ROUNDING_OVER_TOLERANCE * limit
        return 0.0 if near and state.error > state.before / 2 else state.error

    def advance(state: _Trial) -> _Trial:
        stiffness = _tangent_matrix(con.body, forms, state.u, speed2)
        held = in_step(replace(con.body, K=stiffness), clamp)
        try:
            step = compliance(flexible(held, settled=False), -state.unbalanced)
        except NotSolvedError as failure:
            raise StepError(
                Outcome.SINGULAR,
                "the stiffness is no longer positive definite (buckling, or spin softening)",
            ) from failure
        return trial(state.u + expand_to_mesh(held, step)[:, :, 0].real, state.error)

    run = iterate_newton(trial(u, np.inf), error_beyond_rounding, advance, limit, MAX_NEWTON_STEPS)
    if run.outcome is Outcome.SINGULAR:
        return run.state.u, run.iterations, run.reason
    if not run.converged:
        return run.state.u, run.iterations, f"Newton's method ends: {run.reason}"
    turned_over = _turned_over(con.body, run.state.u)
    return run.state.u, run.iterations, "elements turn over" if turned_over else run.state.error


def _turned_over(body: Body, u: np.ndarray) -> bool:
    """Whether a state that balances has gone through itself."""
    if body.pieces:
        return any(_turned_over(piece.body, piece.onto(u)) for piece in body.pieces)
    cells = cells_of(body)
    before, after = (
        np.linalg.det(shape.geometry(body.mesh.cell_type, x[cells], 2)[1])
        for x in (body.mesh.points[:, : body.dim], body.mesh.points[:, : body.dim] + u)
    )
    return bool((before * after <= 0).any())


def _vector_length(con: Constrained, r: np.ndarray) -> float:
    return float(np.sqrt(con.body.comm.allreduce(float((np.abs(r) ** 2).sum()))))


def _elastic_degrees(body: Body, quadrature: str) -> tuple[int, int]:
    """Quadrature degrees of the elastic integrals, which are of fourth power in grad u, and of the
    inertial ones.
    """
    stiff, mass = degrees(body.mesh, cells_of(body), quadrature, body.heat)
    if quadrature == "exact" and stiff < 4:
        stiff *= 2
    return stiff, mass


def _integral_measures(body: Body, degree: tuple[int, int]) -> tuple[Any, Any]:
    """Measures for the elastic and the inertial integrals."""
    elastic, inertial = (
        ufl.Measure("dx", body.space.mesh, metadata={"quadrature_degree": d}) for d in degree
    )
    return elastic, inertial


def _across_axis(body: Body, axis: tuple[float, float, float]) -> Any:
    """(dim, dim) projection across the axis."""
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    return ufl.as_matrix((np.eye(3) - np.outer(unit, unit))[: body.dim, : body.dim].tolist())


def _potential_forms(
    body: Body,
    axis: tuple[float, float, float],
    quadrature: str,
) -> list[_Forms]:
    """First and second derivative of the potential, one of each piece of a body of mixed shapes."""
    if body.pieces:
        parts = [_potential_forms(piece.body, axis, quadrature) for piece in body.pieces]
        return [forms for part in parts for forms in part]
    domain = body.space.mesh
    u = dolfinx.fem.Function(body.space)
    speed2 = dolfinx.fem.Constant(domain, 0.0)
    v = ufl.TestFunction(body.space)
    w = ufl.TrialFunction(body.space)
    degree = _elastic_degrees(body, quadrature)
    stress, rho, depth = body_properties(body, degree)
    heating = dolfinx.fem.Constant(domain, 0.0)
    # F^T F - 1 would cancel small strains
    E = ufl.sym(ufl.grad(u)) + ufl.grad(u).T * ufl.grad(u) / 2
    # of free expansion: ((1 + strain)^2 - 1) / 2, of symmetric matrices
    free = heating * _thermal_strain(body, degree[0])
    E = E - (free + free * free / 2)
    place = _across_axis(body, axis) * (ufl.SpatialCoordinate(domain) + u)
    elastic, inertial = _integral_measures(body, degree)
    potential = (
        depth / 2 * ufl.inner(stress(E), E) * elastic
        - depth * rho * speed2 / 2 * ufl.inner(place, place) * inertial
    )
    force = ufl.derivative(potential, u, v)
    own = _Forms(
        body,
        u,
        speed2,
        heating,
        compile_form(force),
        compile_form(ufl.derivative(force, u, w)),
        _block_nodes(body),
    )
    return [own]


def _set_heating(forms: Sequence[_Forms], share: float) -> None:
    """How much of the thermal strain is there."""
    for part in forms:
        part.heating.value = share


def _unbalanced_force(
    body: Body,
    forms: Sequence[_Forms],
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


def _elastic_force(forms: _Forms, u: np.ndarray, speed2: float) -> np.ndarray:
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


def _tangent_matrix(
    body: Body,
    forms: Sequence[_Forms],
    u: np.ndarray,
    speed2: float,
) -> PETSc.Mat:
    if not body.pieces:
        return _with_springs(body, _elastic_tangent(forms[0], u, speed2))
    parts = (
        _elastic_tangent(own, piece.onto(u), speed2)
        for piece, own in zip(body.pieces, forms, strict=True)
    )
    return _with_springs(body, sum_matrices(body, parts))


def _elastic_tangent(forms: _Forms, u: np.ndarray, speed2: float) -> PETSc.Mat:
    """Second derivative of the potential on cells of one shape."""
    _set_state(forms, u, speed2)
    return assemble_matrix(forms.stiffness)


def _with_springs(body: Body, stiffness: PETSc.Mat) -> PETSc.Mat:
    """The stiffness with that of the springs to the ground, in its own memory."""
    if body.spring is not None:
        stiffness.axpy(1.0, body.spring, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    return stiffness


def _set_state(
    forms: _Forms,
    u: np.ndarray,
    speed2: float,
) -> None:
    forms.u.x.array[:] = u[forms.node_of].ravel()
    forms.speed2.value = speed2


def _displacement_function(body: Body, u: np.ndarray) -> Any:
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

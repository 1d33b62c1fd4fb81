"""Linear preload of a rotating, heated body, which other codes call a perturbation step.

It takes u0 from the linear balance K u0 = f, and puts K_L(u0) + K_geo(u0) - Omega^2 M_P in place of
the second derivative of the potential: material stiffness on the moved body, and the stress of the
linear strain.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .body import Body, body_properties, cells_of, degrees, sum_matrices
from .compat import PETSc, assemble_matrix, assemble_vector, compile_form, dolfinx, ufl
from .constraint import expand_to_mesh, restrict_load
from .flexibility import Flexibility, compliance
from .loads import centrifugal
from .rotating_forms import (
    across_axis,
    displacement_function,
    elastic_degrees,
    in_mesh_numbering,
    integral_measures,
    with_springs,
)
from .steady_state import AXIS
from .thermal_strain import has_thermal_strain, thermal_strain


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
    hot = stress(thermal_strain(body, degree[0]))
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
        return with_springs(body, sum_matrices(body, parts))
    v = ufl.TestFunction(body.space)
    w = ufl.TrialFunction(body.space)
    degree = elastic_degrees(body, quadrature)
    stress, rho, depth = body_properties(body, degree)
    speed2 = dolfinx.fem.Constant(body.space.mesh, float(speed) ** 2)
    across = across_axis(body, axis)
    gradient = ufl.grad(displacement_function(body, u0))
    F = ufl.Identity(body.dim) + gradient

    moved = ufl.inner(stress(ufl.sym(F.T * ufl.grad(v))), ufl.sym(F.T * ufl.grad(w)))
    strain = ufl.sym(gradient) - thermal_strain(body, degree[0]) * ufl.Identity(body.dim)
    geometric = ufl.inner(ufl.grad(v) * stress(strain), ufl.grad(w))
    elastic, inertial = integral_measures(body, degree)
    stiffness = assemble_matrix(
        depth * (moved + geometric) * elastic
        - depth * rho * speed2 * ufl.inner(across * v, w) * inertial
    )
    return with_springs(body, stiffness)

"""Nonlinear preload of a rotating, heated body, by Newton's method with load steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import NotSolvedError
from ..scene.units import show
from ..util.newton import Outcome, StepError, iterate_newton
from . import shape_functions as shape
from .body import Body, cells_of
from .compat import PETSc
from .constraint import Constrained, expand_to_mesh, in_step, restrict_load
from .flexibility import compliance, flexible
from .linear_preload import thermal_force
from .loads import centrifugal
from .rotating_forms import (
    PotentialForms,
    potential_forms,
    set_heating,
    tangent_matrix,
    unbalanced_force,
)
from .steady_state import AXIS, SteadyState, check_speed
from .thermal_strain import has_thermal_strain

# Newton steps of one load step
MAX_NEWTON_STEPS = 25
# of the load step before giving up
MAX_LOAD_HALVINGS = 8
# times the tolerance: an error that falls no further below this is rounding
ROUNDING_OVER_TOLERANCE = 1e3


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
    check_speed(speed)
    if given is None and speed == 0 and not has_thermal_strain(body):
        return Preload(np.zeros((len(body.mesh.points), body.dim)), speed, 0, 0, 0.0)
    forms = potential_forms(body, axis, quadrature)
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
    forms: Sequence[PotentialForms],
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
        set_heating(forms, target)
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
    forms = potential_forms(body, axis, quadrature)
    set_heating(forms, 1.0)
    return tangent_matrix(body, forms, state.displacement, state.speed**2)


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
    forms: Sequence[PotentialForms],
    u: np.ndarray,
    speed2: float,
    limit: float,
) -> tuple[np.ndarray, int, float | str]:
    """Newton's method from ``u``: the state, the steps taken, and the error left or the reason of a
    failure.
    """

    def trial(u: np.ndarray, before: float) -> _Trial:
        r = restrict_load(con, unbalanced_force(con.body, forms, u, speed2))
        return _Trial(u, r, _vector_length(con, r), before)

    def error_beyond_rounding(state: _Trial) -> float:
        near = state.error < ROUNDING_OVER_TOLERANCE * limit
        return 0.0 if near and state.error > state.before / 2 else state.error

    def advance(state: _Trial) -> _Trial:
        stiffness = tangent_matrix(con.body, forms, state.u, speed2)
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

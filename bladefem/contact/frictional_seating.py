"""Seating with Coulomb friction: normal and tangential forces of a damper after a history of
speeds, in load steps.

The relative displacement of the faces (damper minus blade) at all ports of both seats, normal and
tangential, is

    s = s0 + C f + B q,    B^T f + load = 0,

with f the forces on the damper. The layer carries f in series with the bodies, as the friction
elements of the vibration do: where pressed, s_n + c(f_n) = 0, and the slip of a step,
-(ds_t + df_t / kt), is along f_t and only where |f_t| = mu f_n; kt grows with the normal force f_n
at the end of the step as the normal stiffness of the layer does. All conditions of a step are one
system of projections, solved by Newton's method (Alart, Curnier 1991, DOI
10.1016/0045-7825(91)90022-X).

The slip of a face is that of the damper against it. A symmetric damper that is pressed outwards
slides up both faces as the layers give way, so that friction points inwards on both and carries a
part of its load, 2 mu N cos a of a wedge with half angle a. The forces on the two seats are mirror
images, of opposite sign along t1, which runs towards +y on both: the same sign there would be a
couple and a force along y, which nothing balances.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from geometry.mesh import Mesh, spin_axis

from ..data import Patch, PressureMap
from ..errors import InputError, NotSolvedError
from ..fem.flexibility import Flexibility
from ..fem.loads import body_mass, centrifugal
from ..scene.units import newtons
from ..util.arrays import RealArray
from .condensed_bodies import (
    CondensedBodies,
    condense_blade,
    condense_body,
    held_motions,
    rigid_and_load,
)
from .interface_law import InterfaceLaw, closure_of, compliance_at
from .patch import initial_gap, port_matrix
from .seating import ContactProblem

# accepted residual of a step, over the largest force
RESIDUAL_TOLERANCE = 1e-10
# Newton steps of a load step, and halvings of one
MAX_NEWTON_STEPS = 60
MAX_HALVINGS = 8
# halvings of a load step that is not solved
MAX_SPLITS = 3
# load steps of each change of speed: first and most tried
FIRST_STEPS = 4
MOST_STEPS = 64
# change of the tangential forces, over the largest friction limit, at which the steps are enough
FORCE_CHANGE_TOLERANCE = 1e-3
# of the scale of the damper's load
MIN_LOAD_SHARE = 1e-9


@dataclass(frozen=True)
class FrictionalProblem(CondensedBodies):
    """Two bodies at all ports of their patches, node-major (normal, tangents)."""


@dataclass(frozen=True)
class FrictionalSeating:
    """The state at the end of a history."""

    # with the tangential forces of each patch
    maps: list[PressureMap]
    # load on the damper over that of the meshed damper at this speed
    scale: float
    # share of the damper's centrifugal load that friction carries; negative where it pushes
    # outwards
    share: float
    # nodes that slipped in the last load step
    slipping: int
    # load steps of each change of speed, and the change of the tangential forces by the last
    # doubling of them, over the largest friction limit
    steps: int
    change: float


@dataclass(frozen=True)
class _Interface:
    """The layer and its friction, (n,) each."""

    law: InterfaceLaw
    # at first touch
    kt: RealArray
    mu: RealArray


@dataclass(frozen=True)
class _History:
    """How a load comes about."""

    # [rad/s], passed in this order from rest
    speeds: Sequence[float]
    # load on the damper over that of the meshed damper
    scale: float
    # gaps, and displacements by the rotation, open nothing
    bedded: bool


@dataclass(frozen=True)
class _State:
    """After a load step."""

    # (n, d) normal, tangential
    force: RealArray
    # (r,)
    rigid: RealArray
    # (n, d) damper minus blade
    moved: RealArray
    slips: int


def frictional_problem(
    mesh: Mesh,
    patches: Sequence[Patch],
    blade: Flexibility,
    damper: Flexibility,
    clearance: float | np.ndarray = 0.0,
    swell: np.ndarray | None = None,
) -> FrictionalProblem:
    """Condense two bodies onto all ports of their patches, as ``seating.contact_problem`` does onto
    the normal ones.
    """
    body = damper.con.body
    pull = centrifugal(body, 1.0, spin_axis(mesh))
    C, blade_swell = condense_blade(blade, port_matrix(patches, mesh), mesh, swell)
    C_damper, damper_swell = condense_body(damper, port_matrix(patches, mesh, "damper"), pull)
    rigid, load = rigid_and_load(mesh, patches, body, pull)
    gap = np.concatenate([initial_gap(p, mesh) for p in patches]) + clearance
    return FrictionalProblem(
        tuple(patches), C + C_damper, gap, -blade_swell, damper_swell, rigid, load, body_mass(body)
    )


def normal_part(problem: FrictionalProblem) -> ContactProblem:
    """The frictionless problem of the same bodies."""
    d = len(problem.flexibility) // len(problem.clearance)
    return ContactProblem(
        problem.patches,
        problem.flexibility[::d, ::d],
        problem.clearance,
        problem.blade_swell[::d],
        problem.damper_swell[::d],
        problem.rigid[::d],
        problem.load,
        problem.mass,
    )


def seat_with_friction(
    problem: FrictionalProblem,
    law: InterfaceLaw,
    kt: np.ndarray,
    mu: np.ndarray,
    speeds: Sequence[float],
    normal: float | None = None,
    bedded: bool = False,
) -> FrictionalSeating:
    """Normal and tangential forces at the last of some speeds, passed in this order from rest.

    Args:
        law: of the layer, all ports.
        kt, mu: (n,) tangential stiffness of the layer at first touch [N/m] and friction
            coefficient [1].
        speeds: [rad/s]; the last one is that of the result.
        normal: wanted mean normal load of a seat at the end [N]; the damper's load is scaled by one
            factor throughout the history. None: the load of its own mass.
        bedded: gaps, and displacements by the rotation, open nothing.

    Raises:
        InputError: a speed that presses nothing.
        NotSolvedError: a step of the history lifts the damper or was not solved; the message says
            at which speed.
    """
    if not len(speeds) or not all(np.isfinite(s) and s > 0 for s in speeds):
        raise InputError(
            f"speeds {list(speeds)}: expected at least one, and all positive: at rest nothing "
            "presses the damper on its seats"
        )
    face = _Interface(law, np.asarray(kt, dtype=float), np.asarray(mu, dtype=float))
    if normal is None:
        return _refined(problem, face, _History(speeds, 1.0, bedded))
    scale = _frictionless_scale(problem, speeds[-1], normal)
    for _ in range(30):
        found = _refined(problem, face, _History(speeds, scale, bedded))
        error = float(np.mean([m.force.sum() for m in found.maps])) / normal - 1
        if abs(error) < MIN_LOAD_SHARE:
            return found
        scale = scale / (1 + error)
    raise NotSolvedError(
        f"normal load {newtons(normal)} on each seat: no damper load was found that presses so "
        f"after the history of speeds, {error:.1e} is left"
    )


def _frictionless_scale(
    problem: FrictionalProblem,
    speed: float,
    normal: float,
) -> float:
    """First guess of the load: that the outward force goes half and half into the seats."""
    outward = float(np.linalg.norm(problem.load[:2]))
    if not outward > 0:
        raise InputError("the damper has no centrifugal load, expected mass off the engine axis")
    return normal / (outward * speed**2)


def _refined(
    problem: FrictionalProblem,
    face: _Interface,
    history: _History,
) -> FrictionalSeating:
    """With as many load steps as the tangential forces need."""
    steps = FIRST_STEPS
    solved = problem if face.mu.any() else _held_problem(problem)
    before = _pass_through(solved, face, history, steps)
    while True:
        steps *= 2
        after = _pass_through(solved, face, history, steps)
        limit = float((face.mu * after.force[:, 0]).max())
        apart = float(np.abs(after.force[:, 1:] - before.force[:, 1:]).max())
        change = apart / limit if limit > 0 else 0.0
        if change < FORCE_CHANGE_TOLERANCE or steps >= MOST_STEPS:
            break
        before = after
    share = _carried_share(problem, after, history.scale * history.speeds[-1] ** 2)
    maps = _maps(problem, face, after)
    return FrictionalSeating(maps, history.scale, share, after.slips, steps, change)


def _held_problem(problem: FrictionalProblem) -> FrictionalProblem:
    """The problem without the motions that seats do not hold which have no friction at all: nothing
    would bound these, and what rounding leaves of their gaps then counts.
    """
    d = len(problem.flexibility) // len(problem.clearance)
    held = held_motions(problem.rigid[::d], problem.load)
    return replace(problem, rigid=problem.rigid @ held, load=problem.load @ held)


def _pass_through(
    problem: FrictionalProblem,
    face: _Interface,
    history: _History,
    steps: int,
) -> _State:
    """March through the speeds in even steps of their squares."""
    scale = history.scale
    n = len(problem.clearance)
    d = len(problem.flexibility) // n
    gap = np.zeros((n, d))
    swell = np.zeros((n, d))
    if not history.bedded:
        gap[:, 0] = problem.clearance
        swell = (problem.blade_swell + scale * problem.damper_swell).reshape(n, d)
    state = _State(np.zeros((n, d)), np.zeros(problem.rigid.shape[1]), gap, 0)

    def step_to(square: float, before: _State) -> _State:
        return _step(problem, face, before, gap + square * swell, scale * square)

    last = 0.0
    for speed in history.speeds:
        ends = last + (speed**2 - last) * np.arange(steps + 1) / steps
        for first, square in pairwise(ends):
            try:
                state = _split_step(step_to, first, square, state)
            except NotSolvedError as error:
                raise NotSolvedError(
                    f"seating with friction at {np.sqrt(square) * 30 / np.pi:.5g} rpm on the way "
                    f"to {speed * 30 / np.pi:.5g} rpm: {error}"
                ) from error
        last = speed**2
    return state


def _split_step(
    step_to: Callable[[float, _State], _State],
    first: float,
    last: float,
    state: _State,
    halvings: int = MAX_SPLITS,
) -> _State:
    """A load step from one squared speed to another, in halves where Newton's method fails: it may
    go in circles under one load and not under those beside it.

    Raises:
        NotSolvedError: the smallest parts fail too.
    """
    try:
        return step_to(last, state)
    except NotSolvedError:
        if not halvings:
            raise
    middle = (first + last) / 2
    state = _split_step(step_to, first, middle, state, halvings - 1)
    return _split_step(step_to, middle, last, state, halvings - 1)


def _step(
    problem: FrictionalProblem,
    face: _Interface,
    before: _State,
    s0: np.ndarray,
    scale: float,
) -> _State:
    """One load step, by Newton's method on the projections with a line search."""
    n, d = s0.shape
    load = scale * problem.load
    size = float(np.abs(load).max())
    x = np.concatenate([before.force.ravel(), before.rigid])
    if not before.force.any():
        x = _first_guess(problem, face, s0, load)
    residual, jacobian, slips = _projections(problem, face, before, s0, load, x)
    for _ in range(MAX_NEWTON_STEPS):
        force = x[: n * d].reshape(n, d)
        if np.abs(residual).max() <= RESIDUAL_TOLERANCE * max(size, np.abs(force).max()):
            if not (force[:, 0] > 0).any():
                raise NotSolvedError("the damper has lifted off its seats")
            return _State(force, x[n * d :], _moved(problem, s0, x), slips)
        step = _solved(jacobian, residual)
        share = 1.0
        for _ in range(MAX_HALVINGS):
            trial = x - share * step
            found = _projections(problem, face, before, s0, load, trial)
            if np.linalg.norm(found[0]) < (1 - 0.1 * share) * np.linalg.norm(residual):
                break
            share /= 2
        else:
            # a projection may have to get worse once before it gets better
            trial = x - step
            found = _projections(problem, face, before, s0, load, trial)
        x = trial
        residual, jacobian, slips = found
    raise NotSolvedError(
        f"the load step stopped after {MAX_NEWTON_STEPS} iterations, {np.abs(residual).max():.1e} "
        "N are left; expected a history that keeps the damper on its seats"
    )


def _first_guess(
    problem: FrictionalProblem,
    face: _Interface,
    s0: np.ndarray,
    load: np.ndarray,
) -> np.ndarray:
    """Even normal forces of about the load, and the rigid motion that closes the faces under them:
    without contact nothing would hold the damper in the first derivative.
    """
    n, d = s0.shape
    x = np.zeros(n * d + len(load))
    x[: n * d : d] = np.linalg.norm(load) / n
    opened = _moved(problem, s0, x)[:, 0] + closure_of(face.law, x[: n * d : d])
    x[n * d :] = np.linalg.lstsq(problem.rigid[::d], -opened, rcond=1e-6)[0]
    return x


def _solved(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """The Newton step; that of least norm where nothing holds a motion."""
    try:
        step = np.linalg.solve(jacobian, residual)
    except np.linalg.LinAlgError:
        step = np.full(len(residual), np.nan)
    if np.isfinite(step).all():
        return step
    return np.linalg.lstsq(jacobian, residual, rcond=1e-12)[0]


def _moved(
    problem: FrictionalProblem,
    s0: np.ndarray,
    x: np.ndarray,
) -> np.ndarray:
    m = s0.size
    return s0 + (problem.flexibility @ x[:m] + problem.rigid @ x[m:]).reshape(s0.shape)


def _projections(
    problem: FrictionalProblem,
    face: _Interface,
    before: _State,
    s0: np.ndarray,
    load: np.ndarray,
    x: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Residual (m + r,) in newtons, its derivative, and the number of nodes that slip.

    Normal: f_n = max(0, f_n - rho gap); tangential: f_t = the point of the disc of radius
    mu max(0, f_n - rho gap) next to f_t + rho slip.
    """
    n, d = s0.shape
    m = n * d
    r = problem.rigid.shape[1]
    f = x[:m].reshape(n, d)
    s = _moved(problem, s0, x)
    by_x = np.hstack([problem.flexibility, problem.rigid]).reshape(n, d, m + r)
    unit = np.eye(m, m + r).reshape(n, d, m + r)
    own = np.diag(problem.flexibility).reshape(n, d)
    pressed = np.maximum(f[:, 0], 0.0)
    layer = compliance_at(face.law, pressed)
    rho = 1 / (own[:, 0] + layer)
    raised = f[:, 0] - rho * (s[:, 0] + closure_of(face.law, pressed))
    by_gap = by_x[:, 0] + layer[:, None] * unit[:, 0]
    raised_by = unit[:, 0] - rho[:, None] * by_gap
    closed = raised > 0
    residual = np.empty((n, d))
    slope = np.empty((n, d, m + r))
    residual[:, 0] = f[:, 0] - np.maximum(raised, 0.0)
    slope[:, 0] = unit[:, 0] - closed[:, None] * raised_by
    tau, tau_by = _sticking_forces(face, before, f, s, (own[:, 1:], by_x[:, 1:], unit))
    length = np.linalg.norm(tau, axis=1)
    limit = face.mu * np.maximum(raised, 0.0)
    sticks = closed & (length <= limit)
    along = tau / np.maximum(length, np.finfo(float).tiny)[:, None]
    ratio = limit / np.maximum(length, np.finfo(float).tiny)
    across = np.einsum("nt,ntx->nx", along, tau_by)
    turned = ratio[:, None, None] * (tau_by - along[:, :, None] * across[:, None])
    grown = along[:, :, None] * (face.mu * closed)[:, None, None] * raised_by[:, None]
    kept = sticks[:, None]
    residual[:, 1:] = f[:, 1:] - np.where(kept, tau, limit[:, None] * along)
    slope[:, 1:] = unit[:, 1:] - np.where(kept[:, :, None], tau_by, turned + grown)
    balance = problem.rigid.T @ x[:m] + load
    held = np.hstack([problem.rigid.T, np.zeros((r, r))])
    return (
        np.concatenate([residual.ravel(), balance]),
        np.vstack([slope.reshape(m, m + r), held]),
        int((closed & ~sticks).sum()),
    )


def _sticking_forces(
    face: _Interface,
    before: _State,
    f: np.ndarray,
    s: np.ndarray,
    bodies: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """f_t + sigma slip (n, d-1) of the nodes, where the friction disc cuts nothing off, and its
    derivative (n, d-1, m + r).

    Args:
        f, s: (n, d) forces and displacements.
        bodies: (n, d-1) own tangential flexibility; derivatives of s_t (n, d-1, m + r) and of f
            (n, d, m + r).
    """
    own, moved_by, unit = bodies
    kt = (face.kt * (1.0 + np.maximum(f[:, 0], 0.0) / face.law.doubling))[:, None]
    kt_by_force = np.where(f[:, 0] > 0, face.kt / face.law.doubling, 0.0)[:, None]
    # its size does not move the solution
    sigma = 1 / (own.mean(axis=1) + 1 / face.kt)[:, None]
    change = (f - before.force)[:, 1:]
    slip = -(s - before.moved)[:, 1:] - change / kt
    slip_by = (
        -moved_by
        - unit[:, 1:] / kt[:, :, None]
        + (change * kt_by_force / kt**2)[:, :, None] * unit[:, :1]
    )
    return f[:, 1:] + sigma * slip, unit[:, 1:] + sigma[:, :, None] * slip_by


def _carried_share(problem: FrictionalProblem, state: _State, pull: float) -> float:
    """Share of the damper's load that friction carries.

    Args:
        pull: of the damper, over its load for unit rotation [rad^2/s^2].
    """
    d = state.force.shape[1]
    # without the rotations: fewer translations than directions where one is held
    translations = len(problem.load) - (1 if d == 2 else 3)
    load = problem.load[:translations]
    outward = load / np.linalg.norm(load)
    tangential = state.force.copy()
    tangential[:, 0] = 0.0
    carried = -(problem.rigid.T @ tangential.ravel())[:translations] @ outward
    return float(carried / (pull * np.linalg.norm(load)))


def _maps(problem: FrictionalProblem, face: _Interface, state: _State) -> list[PressureMap]:
    """One map a patch, with its tangential forces."""
    closure = closure_of(face.law, state.force[:, 0])
    gap = np.maximum(state.moved[:, 0] + closure, 0.0)
    gap[state.force[:, 0] > 0] = 0.0
    return [
        PressureMap(patch, f[:, 0], g, RESIDUAL_TOLERANCE, f[:, 1:])
        for patch, f, g in zip(
            problem.patches, problem.by_patch(state.force), problem.by_patch(gap), strict=True
        )
    ]

"""The reduced model in time: modes and rigid dampers with 1-D elements, for shooting where the
balance finds no way.

A periodic solution in time has all harmonics; cut to those of the balance it is a start that Newton
seldom misses.
"""

from __future__ import annotations

import numpy as np

from ..data import RigidBody
from ..errors import InputError, NotSolvedError
from ..friction.fourier import to_real
from ..friction.law_table import require_coulomb
from ..time.shooting import periodic_solution
from ..time.system import System
from .linear.bodies import Stack, rigid_stack
from .model import ReducedModel
from .policy import SHOOTING_SIZE
from .solver.residual import Balance

# highest frequency over the excitation's up to which shooting is tried: 1 s an iteration
FASTEST_RATIO = 1e4
# residual flexibility, over that of the contact springs, that is left out
MASSLESS_FLEXIBILITY = 1e-9


def time_system(model: ReducedModel, H: int) -> System:
    """The model with its excitation and prescribed loads up to harmonic H as equations in time.

    Raises:
        InputError: the model has no such form; the message says why.
    """
    bodies = _bodies_in_time(model)
    blades = bodies[0]
    e = model.elements
    shapes = [
        body.shapes[0, body.contact].real * sign
        for body, sign in zip(bodies, (1.0, -1.0), strict=False)
    ]
    contact = np.hstack(shapes)
    d = model.directions
    W = contact[d - 1 :: d]
    R = contact[::d] if d == 2 else np.zeros_like(contact)
    still = np.zeros(contact.shape[1] - blades.omega.shape[1])
    force = np.zeros((contact.shape[1], 2 * H + 1))
    force[: blades.omega.shape[1]] = to_real(
        blades.shapes[0, blades.load].real.T @ model.loads(H).T
    )
    # an open contact carries nothing in the preload state
    force[:, 0] += R.T @ (np.maximum(e.n0, 0.0) - e.n0)
    # the preload state balances its static friction forces
    force[:, 0] += W.T @ e.traction[:, 0]
    own = np.concatenate([body.omega[0] for body in bodies])
    damping = np.zeros((len(own), len(own)))
    start = 0
    for body in bodies:
        part = slice(start, start := start + body.omega.shape[1])
        damping[part, part] = np.diag(body.viscous[0]) + (
            0.0 if body.coupled is None else body.coupled[0].real
        )
    probe = np.pad(blades.shapes[0, blades.probe].real, ((0, 0), (0, len(still))))
    return System(
        own**2,
        damping,
        W,
        e.kt,
        e.mu,
        force,
        np.zeros((len(W), 2 * H + 1)),
        model.normal_load(H),
        e.kn[:, None] * R,
        probe,
        R,
    )


def shooting_start(balance: Balance) -> np.ndarray:
    """(n, d, K) displacements of a periodic solution in time.

    Raises:
        InputError: the model cannot be put into time. NotSolvedError: shooting did not close the
            period.
    """
    model = balance.model
    H = len(balance.linear.stuck) - 1
    system = time_system(model, H)
    if sum(system.W.shape) > SHOOTING_SIZE:
        raise InputError(
            f"{sum(system.W.shape)} coordinates and elements are too many, expected at most "
            f"{SHOOTING_SIZE}"
        )
    ratio = system.fastest / balance.linear.omega
    if ratio > FASTEST_RATIO:
        raise InputError(
            f"motions {ratio:.1g} times as fast as the excitation, expected at most "
            f"{FASTEST_RATIO:.0e}"
        )
    solution = periodic_solution(system, balance.linear.omega, samples=max(256, 8 * H))
    if not solution.converged:
        raise NotSolvedError(solution.reason)
    readings = np.stack([system.R, system.W], axis=1)[:, 2 - model.directions :]
    lines = np.fft.rfft(solution.trajectory.q @ readings.reshape(-1, system.W.shape[1]).T, axis=0)[
        : H + 1
    ]
    lines *= np.where(np.arange(H + 1) == 0, 1, 2)[:, None] / len(solution.trajectory.q)
    return to_real(lines.T).reshape(*model.springs.shape, 2 * H + 1)


def _bodies_in_time(model: ReducedModel) -> list[Stack]:
    """Blades and damper as single real bodies with all their inertia."""
    require_coulomb(model.elements, "the model in time")
    if model.elements.tangents != 1:
        raise InputError("elements with two tangents, expected tangents = 1")
    if len(model.sides) > 1 or (isinstance(model.damper, tuple) and len(model.damper) > 1):
        raise InputError("one body for each harmonic, expected a single one for all of them")
    if model.circulatory:
        raise InputError("unsymmetric stiffness, expected a symmetric one for the model in time")
    damper = model.elastic_damper(0)
    bodies = [model.blades(0)] + ([] if damper is None else [damper])
    if isinstance(model.damper, RigidBody):
        bodies.append(rigid_stack(model.damper, model.rows))
    for body in bodies:
        if (
            abs(body.residual[0] * max(model.springs.max(), 1e-300)).max(initial=0.0)
            > MASSLESS_FLEXIBILITY
        ):
            raise InputError(
                "a residual flexibility without inertia, expected all modes to be kept"
            )
        if np.any(body.hysteretic) or np.abs(body.shapes.imag).max(initial=0.0) > 0:
            raise InputError(
                "structural damping or complex modes, expected real modes with viscous damping"
            )
    return bodies

"""Ways to solve one frequency of a reduced model, each as a function of (model, frequency) to
complex harmonics.

The balance takes any model. Event-exact evaluation takes elements of one direction; the paper's
iteration, direct integration and shooting take tangential elements with a rigid damper of one
freedom and blades in phase.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...damper.accelerate import Rules, iterate
from ...damper.direct import direct
from ...damper.paper import platform
from ...data import PortModel, RigidBody
from ...errors import InputError, NotSolvedError
from ...hbm.model import ReducedModel, require_rigid_damper
from ...hbm.solve import solve
from ...reduction.truncate import truncate_modes
from ...time.event_integrator import stuck_start
from ...time.shooting import periodic_solution, probe_harmonics
from ...time.system import System, blade_ring

HARMONICS = (1, 3, 5, 7, 9, 15, 31)
# most that are integrated at one frequency
MAX_PERIODS = 500
# relative difference of the damper's motion at its contacts that is none
RIGID_MOTION = 1e-6
# frequency of the modes that represent the residual flexibility, over the excitation's
RESIDUAL_MODE_FREQUENCY_RATIO = 30.0


@dataclass(frozen=True)
class Point:
    """One solved frequency."""

    # first harmonic at the probe [m]
    first: complex
    converged: bool
    reason: str
    # what the next frequency may start from
    start: object = None


@dataclass(frozen=True)
class Method:
    """A named way to solve one frequency."""

    name: str
    family: str
    run: Callable[[ReducedModel, float, object], Point]


def chart_methods(one_dimensional: bool) -> Iterator[Method]:
    """All methods of the chart, from cheap to expensive within each family."""
    for H in HARMONICS:
        yield Method(f"H {H}", "balance, harmonics", sampled_balance(H, max(512, 32 * (H + 1))))
    for samples in (64, 128, 256, 1024, 4096):
        yield Method(f"H 7, {samples} samples", "balance, samples", sampled_balance(7, samples))
    if not one_dimensional:
        return
    for H in (1, 3, 7, 15):
        yield Method(f"H {H} exact", "balance, exact events", exact_balance(H))
    for H, averaged in ((1, True), (3, True), (3, False), (5, True), (5, False)):
        kind = "" if H == 1 else ", averaged" if averaged else ", each harmonic"
        yield Method(f"paper H {H}{kind}", "paper's iteration", paper_iteration(H, averaged))
    for steps in (32, 64, 256):
        yield Method(f"Newmark {steps}", "integration, Newmark", time_steps(steps, explicit=False))
    for steps in (512, 2048):
        yield Method(f"explicit {steps}", "integration, explicit", time_steps(steps, explicit=True))
    yield Method("shooting", "shooting", exact_shooting)


def obstacle_in_time(model: ReducedModel) -> str:
    """Why the methods in time and the paper's iteration do not take a model; empty where they
    do.
    """
    damper = model.damper
    if model.elements.tangents != 1 or model.directions != 1:
        return (
            "contacts have more than one tangential direction, or their normal load follows the "
            "motion"
        )
    if not (isinstance(damper, RigidBody) and damper.mass.shape == (1, 1)):
        return "the damper is not a rigid mass with one freedom"
    if np.ptp(damper.B[model.rows]) > RIGID_MOTION * abs(damper.B[model.rows]).max():
        return "the damper's motion is not along one direction on all contacts"
    if np.iscomplexobj(model.side(1).shapes):
        return "blades are not in phase"
    return ""


def tangential_model(model: ReducedModel) -> ReducedModel:
    """The model without the normal dofs of its ports, and the damper's freedom scaled to
    contact displacement.
    """
    sides = tuple(_only(body, model.rows) for body in model.sides)
    damper = model.damper
    if isinstance(damper, RigidBody) and damper.mass.shape == (1, 1):
        B = damper.B[model.rows]
        scale = float(B[0, 0]) or 1.0
        # joined points leave rounding
        B = np.ones_like(B) if np.ptp(B) < RIGID_MOTION * abs(scale) else B / scale
        damper = replace(damper, B=B, mass=damper.mass / scale**2)
    return replace(model, sides=sides, damper=damper)


def sampled_balance(H: int, samples: int) -> Callable[[ReducedModel, float, object], Point]:
    """Full balance with sampled forces."""

    def run(
        model: ReducedModel,
        omega: float,
        start: Any,
    ) -> Point:
        s = solve(model, omega, H, samples, start=start)
        return Point(complex(s.probe[1, 0]), s.converged, s.reason, s if s.converged else None)

    return run


def exact_balance(H: int) -> Callable[[ReducedModel, float, object], Point]:
    """Full balance with forces exact to rounding, for elements of one direction."""
    return sampled_balance(H, 0)


def paper_iteration(H: int, averaged: bool) -> Callable[[ReducedModel, float, object], Point]:
    """The paper's loop, Eq. 34 in amplitude form with its stopping rule; the damper solved for its
    periodic motion.
    """

    def run(
        model: ReducedModel,
        omega: float,
        start: Any,
    ) -> Point:
        end = iterate(platform(model, omega, H), "amplitude", Rules(averaged=averaged))
        first = complex(end.probe[1, 0])
        reason = end.reason
        if end.false:
            reason += f", false: the equilibrium is violated by {end.residual:.1e}"
        return Point(first, end.converged and np.isfinite(first), reason)

    return run


def time_steps(steps: int, explicit: bool) -> Callable[[ReducedModel, float, object], Point]:
    """Time steps until the motion repeats; the next frequency starts from the last one's end.

    A stuck damper without damping may ring for ever: after MAX_PERIODS the last one counts, and the
    reason says so.
    """

    def run(
        model: ReducedModel,
        omega: float,
        start: Any,
    ) -> Point:
        system = in_time(model, omega)
        try:
            cycle = direct(
                system,
                omega,
                steps,
                _fitting(start, system) or stuck_start(system, omega),
                MAX_PERIODS,
                1e-5,
                explicit,
            )
        except (InputError, NotSolvedError) as error:
            return Point(np.nan, False, str(error))
        lines = 2 * np.fft.rfft(cycle.q @ system.probe.T, axis=0) / len(cycle.q)
        return Point(
            complex(lines[1, 0]), bool(np.isfinite(lines[1, 0])), cycle.reason, cycle.state
        )

    return run


def exact_shooting(
    model: ReducedModel,
    omega: float,
    start: Any,
) -> Point:
    """Periodic solution of the exact flow."""
    system = in_time(model, omega)
    end = periodic_solution(system, omega, _fitting(start, system), samples=512)
    return Point(
        complex(probe_harmonics(end, system, 1)[0, 1]), end.converged, end.reason, end.start
    )


def _fitting(start: Any, system: System) -> Any:
    """The last frequency's end, unless a mode has become a stiff one since."""
    return start if start is not None and len(start.q) == len(system.stiffness) else None


def in_time(model: ReducedModel, omega: float) -> System:
    """The coupled system; faster modes and residual flexibility become stiff modes, quasi-static to
    (1 / RESIDUAL_MODE_FREQUENCY_RATIO)^2.
    """
    damping = model.damping
    damper = require_rigid_damper(model)
    return blade_ring(
        _with_stiff_modes(model.side(1), RESIDUAL_MODE_FREQUENCY_RATIO * omega),
        float(np.mean(damping.ratio)),
        model.elements,
        float(damper.mass[0, 0] / damper.B[0, 0] ** 2),
        complex(model.excitation[1][0]),
    )


def _with_stiff_modes(body: PortModel, at: float) -> PortModel:
    body = truncate_modes(body, max(1, int((body.omega < at).sum())))
    values, vectors = np.linalg.eigh(body.residual)
    kept = values > 1e-6 * values[-1] if values[-1] > 0 else np.zeros(len(values), dtype=bool)
    more = vectors[:, kept] * np.sqrt(values[kept]) * at
    return replace(
        body,
        omega=np.concatenate([body.omega, np.full(more.shape[1], at)]),
        shapes=np.hstack([body.shapes, more]),
        residual=np.zeros_like(body.residual),
    )


def _only(body: PortModel, rows: np.ndarray) -> PortModel:
    """The body with some of its contact dofs, which then come first."""
    every = np.arange(len(body.residual))
    order = []
    ports = {}
    start = 0
    for name, part in body.ports.items():
        order.append(every[part][rows] if name == "contact" else every[part])
        ports[name] = slice(start, start := start + len(order[-1]))
    order = np.concatenate(order)
    return replace(
        body,
        shapes=body.shapes[order],
        residual=body.residual[np.ix_(order, order)],
        ports=ports,
        static_offset=None,
    )

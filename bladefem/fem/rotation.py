"""Small vibrations of a body about a steady rotation and its temperatures.

The preload is linear (``linear_preload``) or not (``preload``). The two are never mixed: the
potential's second derivative at a linear u0 contains stresses of order |grad u0|^2 that the linear
balance knows nothing of, and is wrong by a factor on a twisted blade.
"""

from __future__ import annotations

from dataclasses import replace

from .body import Body
from .compat import PETSc
from .constraint import in_step
from .flexibility import flexible
from .linear_preload import linear_tangent, thermal_displacement, unit_speed_displacement
from .preload import preload, tangent
from .steady_state import AXIS, SteadyState, check_speed
from .thermal_strain import has_thermal_strain


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
    check_speed(speed)
    if speed == 0 and not has_thermal_strain(body):
        return body
    if not linear:
        found = preload(body, speed, clamp, axis)
        return body_about(body, SteadyState(found.displacement, speed, axis, large=True))
    flex = flexible(in_step(body, clamp))
    u0 = speed**2 * unit_speed_displacement(flex, axis) + thermal_displacement(flex)
    return body_about(body, SteadyState(u0, speed, axis))

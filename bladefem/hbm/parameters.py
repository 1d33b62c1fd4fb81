"""One model turned into another by one parameter: what continuation, peak tracking and
sensitivities speak about.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..data import Elements, PortModel, RigidBody
from ..errors import InputError, suggestion
from .linear.bodies import gyroscopic_part
from .model import Damping, ReducedModel


def _changing_elements(
    change: Callable[[Elements, float], Elements],
) -> Callable[[ReducedModel, float], ReducedModel]:
    return lambda model, value: replace(model, elements=change(model.elements, value))


def _scale_stiffness(name: str) -> Callable[[ReducedModel, float], ReducedModel]:
    """Scale the stiffness of the whole layer, also where part of its compliance is in series."""

    def scaled(model: ReducedModel, factor: float) -> ReducedModel:
        stiffness = getattr(model.elements, name)
        # 1 / k_num + change of 1 / k: the part in series stays as it is
        changed = stiffness / (1.0 + (1.0 / factor - 1.0) * layer_share(model, name))
        return replace(model, elements=replace(model.elements, **{name: changed}))

    return scaled


def layer_share(model: ReducedModel, name: str) -> np.ndarray:
    """(nodes,) compliance of the whole layer over that of its element, for "kt" or "kn" [1].

    1 where nothing is in series, 0 for rigid faces. It is also the derivative of ln k_num by ln k
    with a fixed compliance in series.
    """
    stiffness = getattr(model.elements, name)
    if model.series is None:
        return np.ones(len(stiffness))
    return 1.0 + stiffness * model.series[:, 0 if name == "kn" else 1]


def _scale_force(model: ReducedModel, factor: float) -> ReducedModel:
    return replace(
        model, excitation={h: factor * np.asarray(force) for h, force in model.excitation.items()}
    )


def _scale_mass(model: ReducedModel, factor: float) -> ReducedModel:
    if model.damper is None:
        raise InputError("mass: expected a model with a damper")
    if isinstance(model.damper, RigidBody):
        return replace(model, damper=scale_inertia(model.damper, factor))
    return replace(model, damper=tuple(scale_density(body, factor) for body in model.damper))


def scale_inertia(body: RigidBody, factor: float) -> RigidBody:
    """The rigid body with another density."""
    gyroscopic = None if body.gyroscopic is None else factor * body.gyroscopic
    return replace(body, mass=factor * body.mass, gyroscopic=gyroscopic)


def scale_density(body: PortModel, factor: float) -> PortModel:
    """The elastic body with another density: modes keep their form, the viscous matrix its values,
    and gyroscopic forces go with the mass.
    """
    root = float(np.sqrt(factor))
    damping = body.damping
    if damping is not None and damping.ndim == 2:
        own = gyroscopic_part(damping)
        damping = own + (damping - own) / factor
    elif damping is not None:
        damping = damping / factor
    circulatory = None if body.circulatory is None else body.circulatory / factor
    return replace(
        body,
        omega=body.omega / root,
        shapes=body.shapes / root,
        damping=damping,
        circulatory=circulatory,
    )


def _scale_load(model: ReducedModel, factor: float) -> ReducedModel:
    normal = {h: factor * np.asarray(force) for h, force in model.normal.items()}
    elements = replace(model.elements, n0=factor * model.elements.n0)
    if elements.t0 is not None:
        elements = replace(elements, t0=factor * elements.t0)
    start = None if model.start is None else factor * model.start
    return replace(model, elements=elements, normal=normal, start=start)


def _scale_damping(model: ReducedModel, factor: float) -> ReducedModel:
    def scaled(body: PortModel) -> PortModel:
        if body.damping is None or body.damping.ndim == 1:
            return body if body.damping is None else replace(body, damping=factor * body.damping)
        # Coriolis forces are no damping
        loss = body.damping - gyroscopic_part(body.damping)
        return replace(body, damping=body.damping + (factor - 1) * loss)

    ours, theirs = (
        Damping(factor * d.ratio, factor * d.structural, factor * d.mass, factor * d.stiffness)
        for d in (model.damping, model.damper_damping)
    )
    damper = tuple(map(scaled, model.damper)) if isinstance(model.damper, tuple) else model.damper
    return replace(
        model,
        sides=tuple(map(scaled, model.sides)),
        damping=ours,
        damper=damper,
        damper_damping=theirs,
    )


SCALED_PARAMETERS: dict[str, Callable[[ReducedModel, float], ReducedModel]] = {
    # factor of all excitations
    "force": _scale_force,
    # factor of all normal loads
    "load": _scale_load,
    # factor
    "mu": _changing_elements(lambda e, factor: replace(e, mu=factor * e.mu)),
    # factor
    "kt": _scale_stiffness("kt"),
    # factor
    "kn": _scale_stiffness("kn"),
    # added opening [m]
    "gap": _changing_elements(lambda e, gap: replace(e, n0=e.n0 - e.kn * gap)),
    # factor of the damper's mass
    "mass": _scale_mass,
    # factor of the bodies' damping
    "damping": _scale_damping,
}


# parameters that are no factors
SHIFTED_PARAMETERS = ("omega", "gap")


def vary(
    model: ReducedModel,
    name: str,
    value: float,
) -> ReducedModel:
    """The model with one parameter changed: a factor on its present value, or for "gap" an added
    opening [m].

    Raises:
        InputError: unknown name, a parameter that the model does not have, or a negative factor.
    """
    if name not in SHIFTED_PARAMETERS and not 0 <= value < np.inf:
        raise InputError(f"{name} {value}: expected a finite factor, not negative")
    return SCALED_PARAMETERS[check_parameter(name)](model, value)


def check_parameter(name: str, also: tuple[str, ...] = ()) -> str:
    """The name, if it is known."""
    known = (*SCALED_PARAMETERS, *also)
    if name not in known:
        raise InputError(f"parameter '{name}' is unknown{suggestion(name, known)}")
    return name


def path_coordinate(name: str, value: float) -> float:
    """The coordinate in which a parameter is followed and derived: omega and the gap themselves,
    else a logarithm.
    """
    return value if name in SHIFTED_PARAMETERS else float(np.log(value))


def parameter_value(name: str, x: float) -> float:
    """The value of a parameter at such a coordinate."""
    return x if name in SHIFTED_PARAMETERS else float(np.exp(x))

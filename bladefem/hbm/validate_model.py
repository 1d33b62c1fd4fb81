"""What a model must fulfil before anything is solved; every fault is one sentence with field, value
and expectation.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Elements, PortModel, RigidBody
from ..errors import InputError
from ..friction.law_table import laws_of_nodes, require_coulomb

if TYPE_CHECKING:
    from .model import ReducedModel


def check_model(model: ReducedModel) -> None:
    """Raise InputError where parts of the model do not fit each other."""
    _check_bodies("sides", model.sides, ("contact", "load", "probe"))
    dofs = port_size(model.sides[0], "contact")
    _check_elements(model.elements, dofs)
    _check_traction("start", model.start, model.elements)
    if model.closing is not None:
        closing = np.asarray(model.closing)
        if closing.shape != np.shape(model.elements.kt) or not np.isfinite(closing).all():
            raise InputError(
                f"closing of shape {closing.shape}: expected one finite number [m] for each node"
            )
    _check_amplitudes("excitation", model.excitation, port_size(model.sides[0], "load"), 0)
    if not model.coupled and 0 in model.excitation:
        raise InputError(
            "excitation of harmonic 0 with coupled = False: expected the static load in elements.n0"
        )
    _check_amplitudes("normal", model.normal, len(model.elements.kt), 1)
    if isinstance(model.damper, RigidBody):
        _check_rigid(model.damper, dofs)
    elif model.damper is not None:
        _check_bodies("damper", model.damper, ("contact",))
        if port_size(model.damper[0], "contact") != dofs:
            raise InputError(
                f"damper: contact port of {port_size(model.damper[0], 'contact')} dofs, expected "
                f"{dofs}, as the sides have"
            )
    _check_ratio("damping", model.damping.ratio, model.sides)
    if isinstance(model.damper, tuple):
        _check_ratio("damper_damping", model.damper_damping.ratio, model.damper)


def check_point(
    model: ReducedModel,
    omega: float,
    H: int,
    samples: int,
) -> None:
    """Raise InputError where frequency, harmonics or samples are out of range."""
    if not isinstance(omega, Real) or not 0 < omega < np.inf:
        raise InputError(f"omega {omega}: expected a positive circular frequency")
    if not isinstance(H, Integral) or H < 1:
        raise InputError(f"H {H}: expected a whole number of harmonics, at least 1")
    if not isinstance(samples, Integral) or samples < 0:
        raise InputError(
            f"samples {samples}: expected a whole number a period, or 0 to locate transitions "
            "exactly"
        )
    if samples == 0 and model.elements.tangents > 1:
        raise InputError(
            "samples 0: transitions are located exactly for elements with one tangent only, "
            "expected samples above 0 with two"
        )
    if samples == 0:
        require_coulomb(model.elements, "samples = 0, which locates transitions exactly,")
    highest = max((*model.excitation, *model.normal), default=0)
    if highest > H:
        raise InputError(
            f"H {H}: expected at least {highest}, the highest harmonic of excitation and normal "
            "load"
        )


def check_probe(model: ReducedModel, probe: int) -> None:
    """Raise InputError where the model has no such probe."""
    count = port_size(model.sides[0], "probe")
    if not 0 <= probe < count:
        raise InputError(f"probe {probe}: expected a number from 0 to {count - 1}")


def port_size(model: PortModel, name: str) -> int:
    """Degrees of freedom of a port."""
    if name not in model.ports:
        raise InputError(f"ports {', '.join(model.ports)}: expected a port '{name}'")
    return len(range(*model.ports[name].indices(len(model.residual))))


def _check_bodies(
    name: str,
    bodies: Any,
    ports: tuple[str, ...],
) -> None:
    if (
        not isinstance(bodies, tuple)
        or not bodies
        or not all(isinstance(body, PortModel) for body in bodies)
    ):
        raise InputError(
            f"{name} of type {type(bodies).__name__}: expected a tuple of PortModel, one for all "
            "harmonics or one for each"
        )
    for port in ports:
        if port_size(bodies[0], port) == 0:
            raise InputError(f"{name}: the port '{port}' is empty, expected at least one dof")


def _check_elements(elements: Elements, dofs: int) -> None:
    nodes = len(elements.kt)
    if (
        elements.tangents not in (1, 2)
        or nodes == 0
        or dofs not in (nodes * elements.tangents, nodes * (elements.tangents + 1))
    ):
        raise InputError(
            f"contact port of {dofs} dofs with {nodes} elements of {elements.tangents} tangents: "
            "expected one or two tangents, or normal and tangents, for each element"
        )
    for name in ("kt", "kn", "mu", "n0"):
        value = getattr(elements, name)
        if (
            value.shape != (nodes,)
            or not np.isfinite(value).all()
            or (name != "n0" and value.min() < 0)
        ):
            wrong = (
                f"of shape {value.shape}" if value.shape != (nodes,) else f"from {value.min():.4g}"
            )
            raise InputError(
                f"elements.{name} {wrong}: expected {nodes} finite "
                f"numbers{'' if name == 'n0' else ', none of them negative'}"
            )
    laws_of_nodes(elements)
    _check_traction("elements.t0", elements.t0, elements)
    if elements.t0 is not None:
        require_coulomb(elements, "a static friction force (elements.t0)")
    if dofs == nodes * elements.tangents and np.any(elements.kn > 0):
        raise InputError(
            "elements.kn > 0 with tangential contact dofs only: expected normal dofs in the port"
        )


def _check_traction(
    name: str,
    traction: Any,
    elements: Elements,
) -> None:
    """Friction forces that the tangential springs can carry."""
    if traction is None:
        return
    wanted = (len(elements.kt), elements.tangents)
    if np.shape(traction) != wanted or not np.isfinite(traction).all():
        raise InputError(
            f"{name} of shape {np.shape(traction)}: expected {wanted} finite numbers, the friction "
            "force of each node and tangent"
        )
    if np.any(np.asarray(traction)[elements.kt == 0]):
        raise InputError(f"{name}: a node of kt = 0 carries no friction force, expected 0 N there")


def _check_amplitudes(
    name: str,
    loads: Any,
    count: int,
    lowest: int,
) -> None:
    if not isinstance(loads, Mapping):
        raise InputError(
            f"{name} of type {type(loads).__name__}: expected a dict of harmonic to {count} "
            "amplitudes"
        )
    for h, force in loads.items():
        whole = isinstance(h, (int, np.integer)) and h >= lowest
        if not whole or np.shape(force) != (count,) or not np.isfinite(force).all():
            raise InputError(
                f"{name} of harmonic {h}: expected {count} finite amplitudes, as an array of shape "
                f"({count},), of a whole harmonic >= {lowest}"
            )


def _check_rigid(damper: RigidBody, dofs: int) -> None:
    damper_dofs = len(damper.mass)
    if damper.B.shape != (dofs, damper_dofs) or not np.isfinite(damper.B).all():
        raise InputError(
            f"damper.B of shape {damper.B.shape}: expected ({dofs}, {damper_dofs}) finite numbers"
        )
    symmetric = np.shape(damper.mass) == (damper_dofs, damper_dofs) and np.allclose(
        damper.mass, damper.mass.T
    )
    if not symmetric or np.linalg.eigvalsh(damper.mass)[0] <= 0:
        raise InputError("damper.mass: expected a symmetric positive definite matrix")
    if damper.gyroscopic is None:
        return
    turning = np.asarray(damper.gyroscopic)
    skew = turning.shape == damper.mass.shape and np.isfinite(turning).all()
    if not skew or not np.allclose(turning, -turning.T, atol=1e-9 * abs(turning).max()):
        raise InputError(
            f"damper.gyroscopic of shape {turning.shape}: expected a skew-symmetric matrix of "
            f"shape {damper.mass.shape}"
        )


def _check_ratio(
    name: str,
    ratio: Any,
    bodies: tuple[PortModel, ...],
) -> None:
    if np.ndim(ratio) and any(np.shape(ratio) != body.omega.shape for body in bodies):
        raise InputError(
            f"{name}.ratio of shape {np.shape(ratio)}: expected one number, or one for each of the "
            f"{len(bodies[0].omega)} modes"
        )

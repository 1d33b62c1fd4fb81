"""How the balance changes with a parameter at fixed displacements: exact, without
differences.

The friction law scales: f is homogeneous of degree one in (kt, kn, n0), and a function of kt w_t,
kn w_n + n0 and mu N. Euler's relation therefore gives every derivative with a contact parameter
from f and df/dw.

Parameters and their units: "omega" [rad/s]; "gap" is an opening [m]; all others are logarithms of
factors [1].
"""

from __future__ import annotations

import numpy as np

from ..data import RigidBody
from ..errors import InputError
from .linear.bodies import (
    Damping,
    Stack,
    damping_rate,
    gyroscopic_part,
    impedance_rate,
    modal_amplitudes,
    port_motion,
)
from .linear.condensation import Linear
from .linear.contact_flexibility import flexibility_product
from .linear.woodbury import bodies_of
from .model import ReducedModel
from .parameters import check_parameter, layer_share, vary
from .policy import uses_coulomb_kernels
from .solution import blade_motion
from .solver.residual import (
    Balance,
    State,
    as_amplitudes,
    as_coefficients,
    contact_forces,
    walk_ramp,
    walking_force_change,
)

# parameters that the contact law does not see
LINEAR_PARAMETERS = ("omega", "force", "mass", "damping")
# step in the logarithm of a parameter where a law is differentiated by differences
DIFFERENCE_STEP = 1e-5


def residual_rate(
    balance: Balance,
    state: State,
    name: str,
) -> np.ndarray:
    """(n, d, K) derivative of the residual with a parameter at fixed displacements, at a solved
    state [m].
    """
    linear = balance.linear
    check_parameter(name, also=("omega",))
    if name == "force":
        # the motion in full stick is linear in the loads
        return -as_coefficients(linear.stuck, state.w.shape)
    if name in LINEAR_PARAMETERS:
        moved, _ = body_rate(
            balance.model, linear, as_amplitudes(contact_load(balance.model, state)), name
        )
        return residual_rate_of_bodies(balance, state, moved)
    return flexibility_product(linear.condensed.flex, contact_rate(balance, state, name))


def residual_rate_of_bodies(balance: Balance, state: State, moved: np.ndarray) -> np.ndarray:
    """(n, d, K) derivative of the residual from that of the contact displacements (H+1, m) under
    constant forces, the first of `body_rate` [m].
    """
    linear = balance.linear
    motion = as_coefficients(moved, state.w.shape)
    springs = linear.springs.reshape(*motion.shape[:2], 1)
    return flexibility_product(linear.condensed.flex, springs * motion) - motion


def contact_load(model: ReducedModel, state: State) -> np.ndarray:
    """(n, d, K) contact forces beyond the preload [N]."""
    load = state.forces.f.copy()
    load[:, :, 0] -= model.preload.reshape(load.shape[:2])
    return load


def contact_rate(
    balance: Balance,
    state: State,
    name: str,
) -> np.ndarray:
    """(n, d, K) derivative of the contact forces beyond the preload with a contact parameter [N,
    N/m].
    """
    model = balance.model
    elements = model.elements
    if not uses_coulomb_kernels(model):
        return _rate_by_differences(balance, state, name)
    f = state.forces.f
    D = state.forces.jacobian
    w = state.w
    # where the tangents begin
    first = model.directions - elements.tangents
    by_tangents = np.einsum("nakbl,nbl->nak", D[:, :, :, first:], w[:, first:])
    by_tangents += walking_force_change(balance, state, w)
    by_normal = np.einsum("nakl,nl->nak", D[:, :, :, 0], w[:, 0]) if first else np.zeros_like(f)
    if name == "kt":
        return layer_share(model, name)[:, None, None] * by_tangents
    if name == "kn":
        return layer_share(model, name)[:, None, None] * by_normal
    if name == "mu":
        # f is of degree one in (kt w + start, mu): the start of the march counts as a displacement
        offset = model.offset.reshape(w.shape[:2])[:, first:]
        rate = f - by_tangents - np.einsum("nakb,nb->nak", D[:, :, :, first:, 0], offset)
        rate[:, :first] = 0.0
        return rate
    if name == "load":
        rate = f - by_tangents - by_normal
        rate[:, :, 0] -= model.preload.reshape(rate.shape[:2])
        return rate
    if not first:
        raise InputError("gap: a prescribed normal load has no gap, expected elements.kn > 0")
    # an opening is a mean normal displacement the other way
    rate = -D[:, :, :, 0, 0].copy()
    rate[:, 0, 0] += elements.kn * (elements.n0 > 0)
    return rate


def _rate_by_differences(
    balance: Balance,
    state: State,
    name: str,
) -> np.ndarray:
    """Derivative for laws that need not be homogeneous, by central differences of the forces."""
    model = balance.model
    walk = walk_ramp(balance, state.w)
    if name == "gap" and model.loads_prescribed:
        raise InputError("gap: a prescribed normal load has no gap, expected elements.kn > 0")
    step = DIFFERENCE_STEP * (model.compression if name == "gap" else 1.0)
    ends = []
    for sign in (1.0, -1.0):
        value = sign * step if name == "gap" else float(np.exp(sign * step))
        changed = vary(model, name, value)
        force = contact_forces(changed, state.w, balance.samples, walk=walk).f
        force[:, :, 0] -= changed.preload.reshape(force.shape[:2])
        ends.append(force)
    return (ends[0] - ends[1]) / (2 * step)


def body_rate(
    model: ReducedModel,
    linear: Linear,
    force: np.ndarray,
    name: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the bodies' motion under constant contact forces (H+1, m), with a parameter of
    LINEAR_PARAMETERS.

    Args:
        linear: the bodies at the frequency of the point.

    Returns:
        (H+1, m) of the relative contact displacements and (H+1, probes) of the probes.
    """
    omega = linear.omega
    count = model.blades(len(force) - 1).omega.shape[1]
    flexible = linear.modal_part(0, count)
    if name == "force":
        force = np.zeros_like(force)
    blades, ports, modal = blade_motion(model, omega, force, flexible)
    if name in ("omega", "damping"):
        modal = _modal_rate(blades, flexible, omega, modal, name)
        ports = np.zeros_like(ports)
    elif name == "mass":
        modal = np.zeros_like(modal)
        ports = np.zeros_like(ports)
    contact = port_motion(blades, modal, ports, blades.contact) - _damper_rate(
        model, linear, force, name
    )
    return contact, port_motion(blades, modal, ports, blades.probe)


def _modal_rate(
    body: Stack,
    flexible: np.ndarray,
    omega: float,
    modal: np.ndarray,
    name: str,
) -> np.ndarray:
    """(H+1, m) derivative of modal amplitudes under constant forces."""
    orders = np.arange(len(modal))
    if name == "omega":
        push = impedance_rate(body, omega * orders, modal) * orders[:, None]
    else:
        push = damping_rate(body, omega * orders, modal)
    return _pushed_modes(flexible, push)


def _damper_rate(
    model: ReducedModel,
    linear: Linear,
    force: np.ndarray,
    name: str,
) -> np.ndarray:
    """(H+1, m) derivative of the damper's contact displacements under constant forces."""
    if name == "mass" and model.damper is None:
        raise InputError("mass: expected a model with a damper")
    if name == "force" or model.damper is None:
        return np.zeros_like(force)
    omega = linear.omega
    w = omega * np.arange(len(force))
    damper = bodies_of(model, len(force) - 1)[1]
    ports = np.zeros((len(force), damper.shapes.shape[1]), dtype=complex)
    ports[:, damper.contact] = force
    first = model.blades(len(force) - 1).omega.shape[1]
    flexible = linear.modal_part(first, first + damper.omega.shape[1])
    modal = modal_amplitudes(damper, flexible, ports)
    if name == "mass":
        push = _inertia_rate(model, damper, w, modal)
        rate = _pushed_modes(flexible, push)
    else:
        rate = _modal_rate(damper, flexible, omega, modal, name)
    return port_motion(damper, rate, np.zeros_like(ports), damper.contact)


def _inertia_rate(
    model: ReducedModel, damper: Stack, w: np.ndarray, modal: np.ndarray
) -> np.ndarray:
    """(H+1, k) derivative of the damper's modal impedances with the logarithm of its mass, times
    modal amplitudes: omega^2 m, half of 2 zeta sqrt(k m), alpha m and gyroscopic forces.
    """
    # a rigid damper has no damping of its own
    law = Damping() if isinstance(model.damper, RigidBody) else model.damper_damping
    w = w[:, None]
    push = (-(w**2) + 1j * w * (law.ratio * damper.omega + law.mass)) * modal
    if damper.coupled is None:
        return push
    return push + 1j * w * (gyroscopic_part(damper.coupled) @ modal[:, :, None])[:, :, 0]


def _pushed_modes(flexible: np.ndarray, push: np.ndarray) -> np.ndarray:
    """(H+1, m) derivative of modal amplitudes from that of the impedance times the amplitudes; none
    of the mean.
    """
    rate = -(flexible * push if flexible.ndim == 2 else (flexible @ push[:, :, None])[:, :, 0])
    rate[0] = 0.0
    return rate

"""Exact derivatives of a solved response with its parameters: one more solve with the Jacobian for
each of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .model import ReducedModel
from .parameter_derivatives import (
    LINEAR_PARAMETERS,
    body_rate,
    contact_load,
    contact_rate,
    residual_rate,
    residual_rate_of_bodies,
)
from .solution import Solution, at_probes, blade_motion
from .solver.path_compiled import frequency_slope
from .solver.residual import (
    Balance,
    Inverse,
    State,
    as_amplitudes,
    force_change,
    linearise_balance,
    solved_balance,
)


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives with one parameter, in the units of `bladefem.hbm.parameter_derivatives`."""

    # (n, d, K) of the relative displacements
    w: np.ndarray
    # (H+1, probes) of the complex amplitudes at the probes
    probe: np.ndarray
    # (probes,) of the root of the sum of squares of the moving harmonics
    size: np.ndarray


def sensitivities(
    model: ReducedModel,
    solution: Solution,
    names: Iterable[str],
) -> dict[str, Sensitivity]:
    """Derivatives of a converged solution with the named parameters.

    Raises:
        InputError: the solution is not converged, or a parameter is unknown or absent in the model.
    """
    if not solution.converged:
        raise InputError(
            f"solution at {solution.frequency:.6g} Hz is not converged: expected a solved point"
        )
    names = list(names)
    if names == ["omega"]:
        found = frequency_slope(model, solution)
        if found is not None:
            return {"omega": _sensitivity(solution, *found)}
    balance, state = solved_balance(model, solution)
    inverse = linearise_balance(balance, state)
    return {name: _one_sensitivity(balance, state, inverse, solution, name) for name in names}


def _sensitivity(solution: Solution, dw: np.ndarray, probe: np.ndarray) -> Sensitivity:
    """The record of derivatives of displacements (n, d, K) and probes (H+1, probes)."""
    size = np.linalg.norm(solution.probe[1:], axis=0)
    slope = np.sum((solution.probe[1:].conj() * probe[1:]).real, axis=0) / np.maximum(
        size, np.finfo(float).tiny
    )
    return Sensitivity(dw, probe, slope)


def _one_sensitivity(
    balance: Balance,
    state: State,
    inverse: Inverse,
    solution: Solution,
    name: str,
) -> Sensitivity:
    model = balance.model
    linear = balance.linear
    probe = np.zeros_like(solution.probe)
    direct = np.zeros_like(linear.free)
    if name in LINEAR_PARAMETERS:
        load = as_amplitudes(contact_load(model, state))
        direct, probe = body_rate(model, linear, load, name)
    # the motion in full stick is linear in the loads: `residual_rate` has it from there
    rate = (
        residual_rate_of_bodies(balance, state, direct)
        if name in LINEAR_PARAMETERS and name != "force"
        else residual_rate(balance, state, name)
    )
    dw = -inverse(rate, 1e-9)
    df = force_change(balance, state, dw)
    if name not in LINEAR_PARAMETERS:
        df = df + contact_rate(balance, state, name)
    force = as_amplitudes(df)
    rigid = np.zeros(len(linear.rigid))
    if linear.B.shape[1]:
        gap = as_amplitudes(dw)[0] - direct[0] + linear.bodies.mean_G @ force[0]
        rigid = linear.rigid @ (linear.B.T @ (linear.springs * gap.real))
    flexible = linear.modal_part(0, model.blades(len(force) - 1).omega.shape[1])
    moved = blade_motion(model, linear.omega, force, flexible, excited=False)
    return _sensitivity(solution, dw, probe + at_probes(moved, rigid))

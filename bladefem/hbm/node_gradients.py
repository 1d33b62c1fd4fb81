"""Which node matters: the gradient of the response by the parameters of every contact node, from
one adjoint solve.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..errors import InputError
from .linear.bodies import modal_flexibility, receptance_block
from .linear.contact_flexibility import flexibility_product, transposed_flexibility
from .model import ReducedModel
from .parameter_derivatives import LINEAR_PARAMETERS, contact_rate
from .parameters import check_parameter
from .solution import Solution
from .solver.residual import (
    adjoint_inverse,
    as_coefficients,
    solved_balance,
    transposed_force_change,
)


def node_gradients(
    model: ReducedModel,
    solution: Solution,
    names: Iterable[str],
) -> dict[str, np.ndarray]:
    """(n,) derivatives of the response's size at a probe by the contact parameters of each node:
    maps for a designer.

    With s the size, y = ds/df and J the derivative of the balance,  ds/dp = (y - A^T J^-T (df/dw)^T
    y) . df/dp  holds for every parameter p; df/dp of one node is its own part of that of all nodes.
    The sum over the nodes is the derivative that `bladefem.hbm.sensitivity` gives.

    Args:
        names: of "load", "mu", "kt", "kn", "gap", in the units of
            `bladefem.hbm.parameter_derivatives`.

    Raises:
        InputError: the solution is not converged, or a parameter does not belong to nodes.
    """
    if not solution.converged:
        raise InputError(
            f"solution at {solution.frequency:.6g} Hz is not converged: expected a solved point"
        )
    names = [check_parameter(name) for name in names]
    if set(names) & set(LINEAR_PARAMETERS):
        raise InputError(
            f"parameters {names}: expected contact parameters, not {', '.join(LINEAR_PARAMETERS)}"
        )
    balance, state = solved_balance(model, solution)
    by_force = size_by_force(model, solution, probe=0)
    by_motion = transposed_force_change(balance, state, by_force)
    back = adjoint_inverse(balance, state)(by_motion, 1e-9)
    turned = transposed_flexibility(balance.linear.condensed.flex)
    weight = by_force - flexibility_product(turned, back)
    return {
        name: np.sum(weight * contact_rate(balance, state, name), axis=(1, 2)) for name in names
    }


def size_by_force(
    model: ReducedModel,
    solution: Solution,
    probe: int,
) -> np.ndarray:
    """(n, d, K) derivative of the size by the coefficients of the contact forces [m/N]."""
    blades = model.blades(solution.harmonics)
    flexible = modal_flexibility(blades, solution.omega * np.arange(solution.harmonics + 1))
    rows = slice(blades.probe.start + probe, blades.probe.start + probe + 1)
    across = receptance_block(blades, flexible, rows, blades.contact)[:, 0]
    share = solution.probe[:, probe] / np.linalg.norm(solution.probe[1:, probe])
    share[0] = 0.0
    return as_coefficients(-across.conj() * share[:, None], solution.w.shape)

"""Compile the kernels of the balance before anyone waits for them:  python -m
bladefem.hbm.precompile

Numba keeps what it compiled; afterwards a first solve takes about a second. The installation runs
this once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data import Elements
from ..reduction.matrices import port_model_from_matrices
from .linear.condensation import condense
from .model import Damping, ReducedModel
from .solve import solve
from .solver.newton import newton
from .solver.residual import Balance, evaluate_balance, start_in_stick
from .sweep import response
from .truncation_indicator import overtones

__all__ = ["compile_kernels"]


def compile_kernels() -> None:
    """Solve the smallest models that together reach every kernel, with and without a prescribed
    normal load.
    """
    ports = {"contact": np.arange(2), "load": np.array([1]), "probe": np.array([1])}
    body = port_model_from_matrices(np.eye(3), np.diag([1.0, 1.2, 1.4]) + 0.1, ports)
    one = Elements(np.ones(1), np.ones(1), np.full(1, 0.4), np.full(1, 0.5), tangents=1)
    line = ReducedModel((body,), one, {1: np.ones(1)}, Damping(0.01))
    for samples in (64, 0):
        point = solve(line, 1.0, 2, samples)
        balance = Balance(line, condense(line, 1.0, 2), samples)
        for merit in ("step", "residual"):
            newton(balance, start_in_stick(balance), merit=merit)
    overtones(line, [point], 5)
    list(response(line, [1.0, 1.1], 2, 64))
    ports["contact"] = np.arange(3)
    body = port_model_from_matrices(np.eye(3), np.diag([1.0, 1.2, 1.4]) + 0.1, ports)
    plane = ReducedModel((body,), replace(one, tangents=2), {1: np.ones(1)}, Damping(0.01))
    for force in (0.5, 1.0, 2.0):
        solve(replace(plane, excitation={1: np.full(1, force)}), 1.0, 2, 64)
    balance = Balance(plane, condense(plane, 1.0, 2), 64)
    # with the derivative in double, as rates take it
    evaluate_balance(balance, start_in_stick(balance))


if __name__ == "__main__":
    compile_kernels()

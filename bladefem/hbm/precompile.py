"""Compile the kernels of the balance before anyone waits for them:  python -m
bladefem.hbm.precompile

Numba keeps what it compiled; afterwards a first solve takes about a second. The installation runs
this once. The kernels of 1-D and of 2-D elements are compiled by two processes at the same time;
both keep what they compiled on disk, where the other one finds what it shares.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..data import Elements
from ..reduction.matrices import port_model_from_matrices
from .linear.condensation import condense
from .linear.condensation_compiled import linear_part
from .linear.packed_bodies import prepared_bodies
from .model import Damping, ReducedModel
from .solve import solve
from .solver.newton import newton
from .solver.residual import Balance, evaluate_balance, start_in_stick
from .sweep import response
from .truncation_indicator import truncation_indicator


def compile_kernels() -> None:
    """Solve the smallest models that together reach every kernel, with and without a prescribed
    normal load.
    """
    for part in PARTS.values():
        part()


def compile_in_parallel() -> int:
    """The same in one process for each part; returns the first exit code that is not 0."""
    command = [sys.executable, "-m", "bladefem.hbm.precompile"]
    running = [subprocess.Popen([*command, name]) for name in PARTS]
    codes = [process.wait() for process in running]
    return next((code for code in codes if code), 0)


def _line_model() -> ReducedModel:
    """A body of three degrees of freedom on one 1-D element with normal motion."""
    ports = {"contact": np.arange(2), "load": np.array([1]), "probe": np.array([1])}
    body = port_model_from_matrices(np.eye(3), np.diag([1.0, 1.2, 1.4]) + 0.1, ports)
    one = Elements(np.ones(1), np.ones(1), np.full(1, 0.4), np.full(1, 0.5), tangents=1)
    return ReducedModel((body,), one, {1: np.ones(1)}, Damping(0.01))


def _compile_1d() -> None:
    """Newton first: what goes before it in a compiled point is compiled by the other process."""
    line = _line_model()
    for samples in (64, 0):
        balance = Balance(line, condense(line, 1.0, 2), samples)
        for merit in ("step", "residual"):
            newton(balance, start_in_stick(balance), merit=merit)
    point = solve(line, 1.0, 2, 64)
    truncation_indicator(line, [point], 5)
    list(response(line, [1.0, 1.1], 2, 64))


def _compile_2d() -> None:
    """The linear part of compiled points, then the kernels of 2-D elements."""
    line = _line_model()
    linear_part(1.0, prepared_bodies(line, 2), line.springs.ravel(), 2)
    ports = {"contact": np.arange(3), "load": np.array([1]), "probe": np.array([1])}
    body = port_model_from_matrices(np.eye(3), np.diag([1.0, 1.2, 1.4]) + 0.1, ports)
    elements = replace(line.elements, tangents=2)
    plane = ReducedModel((body,), elements, {1: np.ones(1)}, Damping(0.01))
    for force in (0.5, 1.0, 2.0):
        solve(replace(plane, excitation={1: np.full(1, force)}), 1.0, 2, 64)
    balance = Balance(plane, condense(plane, 1.0, 2), 64)
    # with the derivative in double precision, as sensitivities take it
    evaluate_balance(balance, start_in_stick(balance))


PARTS: dict[str, Callable[[], None]] = {"1d": _compile_1d, "2d": _compile_2d}


if __name__ == "__main__":
    if len(sys.argv) > 1:
        PARTS[sys.argv[1]]()
    else:
        sys.exit(compile_in_parallel())

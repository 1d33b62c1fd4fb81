"""Compile the kernels of the balance before anyone waits for them:  python -m
bladefem.hbm.precompile [later]

Numba keeps what it compiled; afterwards a first solve takes about a second. The installation waits
for the kernels of 2-D elements and their solvers, which the main job (`scenes/wedge.toml`) calls.
Those of 1-D elements, whose points are compiled as a whole, and marches with a layer that stiffens
follow in the background ("later"); who needs them sooner compiles them on the first call.

Two processes compile at the same time; both keep what they compiled on disk, where the other one
finds what it shares.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..data import Elements, RigidBody
from ..friction.aft import evaluate
from ..reduction.matrices import port_model_from_matrices
from .flow_map import flow_map
from .linear.condensation import condense
from .linear.contact_flexibility import by_harmonic
from .model import Damping, ReducedModel
from .response import response
from .ring_march import march_ring, state_of_solution
from .sector_modes import sector_modes
from .sensitivity import sensitivities
from .solution import Solution
from .solve import as_solution, solve
from .solver.fallback import Attempt
from .solver.newton import newton
from .solver.newton_krylov import iterative_inverse
from .solver.residual import Balance, evaluate_balance, linearise_balance, start_in_stick
from .solver.walking import tangential_motions
from .stability import linearised_contacts, stability_verdict
from .truncation_indicator import truncation_indicator

# argument of the command line for the kernels of 1-D elements
LATER_ARGUMENT = "later"


def compile_kernels() -> None:
    """Reach every kernel by the smallest models, with and without a prescribed normal load."""
    for part in (*KERNEL_GROUPS.values(), compile_later):
        part()


def compile_in_parallel() -> int:
    """The kernels of the main job, one process for each part; returns the first exit code that is
    not 0.
    """
    command = [sys.executable, "-m", "bladefem.hbm.precompile"]
    running = [subprocess.Popen([*command, name]) for name in KERNEL_GROUPS]
    codes = [process.wait() for process in running]
    return next((code for code in codes if code), 0)


def compile_later() -> None:
    """What the main job does not call: 1-D elements, points of small models whose dampers cannot
    walk, and marches with a layer that stiffens.
    """
    compile_1d()
    list(response(_plane_model(), [1.0, 1.1], 2, 64))
    plane = replace(_plane_model(), decay=np.ones(1))
    march_ring(plane, state_of_solution(plane, solve(plane, 1.0, 2, 64)), 1)


def compile_1d() -> None:
    """Kernels of 1-D elements: sampled and with transitions located, compiled points and Newton,
    and steps of a path.
    """
    line = _line_model()
    for samples in (64, 0):
        balance = Balance(line, condense(line, 1.0, 2), samples)
        for merit in ("step", "residual"):
            newton(balance, start_in_stick(balance), merit=merit)
    point = solve(line, 1.0, 2, 64)
    truncation_indicator(line, [point], 5)
    list(response(line, [1.0, 1.1], 2, 64))
    sensitivities(line, point, ["omega"])


def compile_2d() -> None:
    """Kernels of 2-D elements with the derivative in single precision, as Newton takes it; then all
    that solves, measures and judges a point, what a damper that walks adds, and what judges
    resonances in time. By then `compile_linear` has left the linear part on disk.
    """
    evaluate(_plane_model().elements, np.full((1, 3, 5), 0.1), 64, precision="single")
    for force in (0.5, 1.0, 2.0):
        plane = replace(_plane_model(), excitation={1: np.full(1, force)})
        point = _plain_point(plane)
    truncation_indicator(plane, [point], 5)
    stability_verdict(plane, point)
    free = _free_model()
    balance = Balance(free, condense(free, 1.0, 2), 64)
    balance = replace(balance, walk=tangential_motions(free))
    w = start_in_stick(balance)
    linearise_balance(balance, evaluate_balance(balance, w, "single"))
    march_ring(plane, state_of_solution(plane, point), 1)


def compile_linear() -> None:
    """The linear part and iterations for many unknowns; then the kernels of 2-D elements with the
    derivative in double precision, as sensitivities take it: by then `compile_2d` has left what
    both share on disk; last the steps of a path.
    """
    plane = _plane_model()
    # its flexibility without springs is a kernel of its own
    _ = condense(plane, 1.0, 2).G
    flexibility = np.eye(3, dtype=complex)[None].repeat(3, axis=0)
    inverse = iterative_inverse(
        by_harmonic(flexibility), np.eye(15)[None], motions=np.eye(3)[:, :1].copy()
    )
    inverse(np.ones((3, 5)), 1e-6)
    evaluate(plane.elements, np.full((1, 3, 5), 0.1), 64)
    point = _plain_point(plane)
    # the closer look of a verdict: `compile_2d` has the first one, in single precision
    contacts, nodes = linearised_contacts(plane, point, sector_modes(plane), 64)
    flow_map(contacts, nodes, 2 * np.pi / 64, 1)
    # slopes by the same kernel
    sensitivities(plane, point, ["omega"])


def _plain_point(model: ReducedModel) -> Solution:
    """A point by the way that models take which are not small."""
    balance = Balance(model, condense(model, 1.0, 2), 64)
    end = newton(balance, start_in_stick(balance), merit="residual")
    return as_solution(balance, Attempt("newton", end), end.iterations, end.reason)


def _line_model() -> ReducedModel:
    """A body of three degrees of freedom on one 1-D element with normal motion."""
    one = Elements(np.ones(1), np.ones(1), np.full(1, 0.4), np.full(1, 0.5), tangents=1)
    return _model_on(one)


def _plane_model() -> ReducedModel:
    """The same on one 2-D element."""
    one = Elements(np.ones(1), np.ones(1), np.full(1, 0.4), np.full(1, 0.5), tangents=2)
    return _model_on(one)


def _free_model() -> ReducedModel:
    """The same with a rigid damper between, which may walk."""
    damper = RigidBody(np.eye(2), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    return replace(_plane_model(), damper=damper)


def _model_on(elements: Elements) -> ReducedModel:
    directions = 1 + elements.tangents
    ports = {"contact": np.arange(directions), "load": np.array([1]), "probe": np.array([1])}
    body = port_model_from_matrices(np.eye(3), np.diag([1.0, 1.2, 1.4]) + 0.1, ports)
    return ReducedModel((body,), elements, {1: np.ones(1)}, Damping(0.01))


KERNEL_GROUPS: dict[str, Callable[[], None]] = {"2d": compile_2d, "linear": compile_linear}


if __name__ == "__main__":
    if sys.argv[1:] == [LATER_ARGUMENT]:
        compile_later()
    elif len(sys.argv) > 1:
        KERNEL_GROUPS[sys.argv[1]]()
    else:
        sys.exit(compile_in_parallel())

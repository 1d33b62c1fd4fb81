"""The balance of harmonics in the unknown relative displacements of the contact, and its
derivative.

Residual, additive form:  r_h = w_h - stuck_h + A_h p_h,  p = f(w) - K w  [m]. It is (1 + G K)^-1
times the form without springs  w_h - free_h + G_h f_h; both are measured before a point is
accepted. The derivative of p is one block a node, A is one block a harmonic, and both vanish
together at nodes that stick: these are eliminated exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ...friction.aft import Forces, evaluate
from ...friction.fourier import to_complex, to_real
from ...friction.kernel_1d_exact import evaluate_exact
from ...friction.trigonometric_tables import trigonometric_tables
from ..linear.condensation import Linear
from ..model import ReducedModel
from ..policy import DENSE_LU, DETERMINANT_UNKNOWNS, ITERATIONS, linear_solver
from .newton_compiled import (
    balance_residual,
    dense_jacobian,
    moving_nodes,
    spread_to_all_nodes,
)
from .newton_krylov import Memory, iterative_inverse

# of a step by GMRES, relative
STEP_ACCURACY = 1e-5
# a node whose p is below this share of its spring force sticks
STICKING_FORCE_SHARE = 1e-13


Inverse = Callable[..., np.ndarray]


@dataclass(frozen=True)
class Balance:
    """One frequency's equations: H from the linear part, samples a period for the friction
    forces.
    """

    model: ReducedModel
    linear: Linear
    # 0: transitions located exactly, for elements of one tangent
    samples: int


@dataclass(frozen=True)
class State:
    """The balance at one guess of the displacements; n nodes, d directions, K = 2H+1 real
    coefficients.
    """

    # (n, d, K) relative displacements [m]
    w: np.ndarray
    # friction forces and their derivative, of the total load
    forces: Forces
    # (n, d, K) forces beyond preload and springs [N]
    p: np.ndarray
    # (n, d, K) [m]
    residual: np.ndarray
    # residual of both forms over the size of the motion [1]
    error: float


def start_in_stick(balance: Balance) -> np.ndarray:
    """(n, d, K) the displacements of full stick [m]."""
    return _as_node_coefficients(balance, balance.linear.stuck)


def evaluate_balance(
    balance: Balance,
    w: np.ndarray,
    precision: str = "double",
) -> State:
    """Forces and residual at w (n, d, K); precision is that of the forces' derivative."""
    model = balance.model
    linear = balance.linear
    forces = contact_forces(model, w, balance.samples, precision)
    p = np.empty(w.shape)
    residual = np.empty(w.shape)
    flat = (model.springs.size, w.shape[2])
    error = balance_residual(
        np.ascontiguousarray(w, dtype=float).reshape(flat),
        linear.condensed,
        model.preload,
        np.ascontiguousarray(forces.f),
        p.reshape(flat),
        residual.reshape(flat),
    )
    return State(w, forces, p, residual, error)


def contact_forces(
    model: ReducedModel,
    w: np.ndarray,
    samples: int,
    precision: str = "double",
) -> Forces:
    """Friction forces in the directions (n, d, K) of the balance; displacements left out of it stay
    zero.
    """
    w = w.copy()
    w[:, :, 0] += model.offset.reshape(w.shape[:2])
    missing = 1 + model.elements.tangents - model.directions
    if missing:
        w = np.concatenate([np.zeros((len(w), missing, w.shape[2])), w], axis=1)
    load, base = contact_table(model, w.shape[2] // 2, samples)[:2]
    if samples:
        forces = evaluate(
            model.elements, w, samples, load=load if load.shape[1] else None, precision=precision
        )
    else:
        forces = evaluate_exact(model.elements, w, load=base)
    if missing == 0:
        return forces
    return replace(forces, f=forces.f[:, missing:], dfdw=forces.jacobian[:, missing:, :, missing:])


def linearise_balance(
    balance: Balance,
    state: State,
    memory: Memory | None = None,
) -> Inverse:
    """The inverse of the balance's derivative: residual (n, d, K), accuracy [1] to displacement (n,
    d, K) [m].

    A memory carries what iterations know from one derivative to the next. The linear system is
    reduced to the nodes that slip or lift; the others follow from their forces. Raises
    numpy.linalg.LinAlgError where the derivative is singular.
    """
    _, d, K = state.w.shape
    change, active, dofs = _active_nodes(balance, state)
    if len(active) == 0:
        return lambda residual, accuracy=0.0: residual.copy()
    A = _select_dofs(balance.linear.A, dofs)
    if memory is not None and memory.nodes != active.tobytes():
        memory.nodes, memory.blocks, memory.slow = (
            active.tobytes(),
            None,
            memory.slow or memory.blocks is not None,
        )
    inverse = _choose_inverse(A, change, memory, balance.linear.condensed.motions[dofs])

    def solve(residual: np.ndarray, accuracy: float = STEP_ACCURACY) -> np.ndarray:
        step = np.empty(residual.shape)
        x = inverse(residual[active].reshape(-1, K), accuracy)
        spread_to_all_nodes(
            np.ascontiguousarray(x).ravel(),
            np.ascontiguousarray(residual).reshape(-1, K),
            d,
            active,
            change,
            balance.linear.condensed.flex,
            step.reshape(-1, K),
        )
        return step

    return solve


def adjoint_inverse(balance: Balance, state: State) -> Inverse:
    """The transposed inverse of the balance's derivative:  (1 + A C)^-T b = b - C^T (1 + A^T
    C^T)^-1 A^T b.
    """
    K = state.w.shape[2]
    change, active, dofs = _active_nodes(balance, state)
    if len(active) == 0:
        return lambda b, accuracy=0.0: b.copy()
    turned = np.ascontiguousarray(balance.linear.A.conj().swapaxes(1, 2))
    back = np.ascontiguousarray(change.swapaxes(1, 2))
    inverse = _choose_inverse(_select_dofs(turned, dofs), back)

    def solve(b: np.ndarray, accuracy: float = STEP_ACCURACY) -> np.ndarray:
        flexed = _as_node_coefficients(balance, _apply_flexibility(turned, as_amplitudes(b)))[
            active
        ]
        x = inverse(flexed.reshape(-1, K), accuracy)
        result = b.copy()
        result[active] -= (back @ x.reshape(len(active), -1, 1)).reshape(flexed.shape)
        return result

    return solve


def determinant_sign(balance: Balance, state: State) -> float:
    """Sign of the determinant of the balance's derivative; 0 where there are too many unknowns to
    ask.
    """
    change, active, dofs = _active_nodes(balance, state)
    if len(dofs) * state.w.shape[2] > DETERMINANT_UNKNOWNS:
        return 0.0
    # everything sticks: the derivative is the identity
    if not len(dofs):
        return 1.0
    J = dense_jacobian(_select_dofs(balance.linear.A, dofs), change)
    return float(np.linalg.slogdet(J)[0])


def _active_nodes(balance: Balance, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivative of p where it does not vanish (nodes, dK, dK), these nodes, and their dofs."""
    d = state.w.shape[1]
    active, change = moving_nodes(
        np.ascontiguousarray(state.forces.jacobian, dtype=float),
        balance.model.springs.ravel(),
        d,
        STICKING_FORCE_SHARE,
    )
    return change, active, (active[:, None] * d + np.arange(d)).ravel()


def _select_dofs(A: np.ndarray, dofs: np.ndarray) -> np.ndarray:
    """(H+1, a, a) the flexibilities among some of the dofs, in one copy where one is needed."""
    if len(dofs) == A.shape[1]:
        return A
    return np.ascontiguousarray(A[np.ix_(np.arange(len(A)), dofs, dofs)])


def _choose_inverse(
    A: np.ndarray,
    change: np.ndarray,
    memory: Memory | None = None,
    motions: np.ndarray | None = None,
) -> Inverse:
    solver = linear_solver(A.shape[1] * (2 * len(A) - 1))
    memory = Memory() if memory is None else memory
    memory.solvers.add(DENSE_LU if solver == DENSE_LU else ITERATIONS)
    if solver == DENSE_LU:
        return _dense_inverse(A, change)
    iterative = iterative_inverse(A, change, memory, motions)
    if solver == ITERATIONS:
        return iterative
    return _with_factors_at_need(iterative, A, change, memory)


def _with_factors_at_need(
    iterative: Inverse,
    A: np.ndarray,
    change: np.ndarray,
    memory: Memory,
) -> Inverse:
    """GMRES; switches to dense LU after the first failure to converge."""
    dense: Inverse | None = None

    def solve(residual: np.ndarray, accuracy: float) -> np.ndarray:
        nonlocal dense
        if dense is None:
            try:
                return iterative(residual, accuracy)
            except np.linalg.LinAlgError:
                memory.solvers.add(DENSE_LU)
                dense = _dense_inverse(A, change)
        return dense(residual, accuracy)

    return solve


def _dense_inverse(A: np.ndarray, change: np.ndarray) -> Inverse:
    J = dense_jacobian(A, change)
    factors = linalg.lu_factor(J, overwrite_a=True, check_finite=False)
    if not abs(np.diag(factors[0])).min() > 0:
        raise np.linalg.LinAlgError("singular Jacobian")
    return lambda residual, _: linalg.lu_solve(
        factors, residual.ravel(), check_finite=False
    ).reshape(residual.shape)


def contact_table(
    model: ReducedModel,
    H: int,
    samples: int,
) -> tuple:
    """What the compiled loop needs of the elements."""
    return model.once(
        ("contact", H, samples),
        lambda: (
            model.normal_series(samples),
            model.normal_load(H),
            model.table,
            trigonometric_tables(H, samples or 4 * H + 4),
            0 if samples else 12 * (H + 1),
            model.preload,
            model.offset,
        ),
    )


def _apply_flexibility(flexibility: np.ndarray, forces: np.ndarray) -> np.ndarray:
    return (flexibility @ forces[:, :, None])[:, :, 0]


def as_amplitudes(x: np.ndarray) -> np.ndarray:
    """(n, d, K) real coefficients as (H+1, n d) complex amplitudes."""
    return to_complex(x.reshape(-1, x.shape[2])).T


def as_coefficients(q: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(H+1, n d) complex amplitudes as real coefficients of the shape (n, d, K)."""
    return to_real(q.T).reshape(shape)


def _as_node_coefficients(balance: Balance, q: np.ndarray) -> np.ndarray:
    model = balance.model
    return as_coefficients(q, (len(model.springs), model.directions, 2 * len(q) - 1))

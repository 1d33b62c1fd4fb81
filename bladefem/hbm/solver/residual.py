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
from ..linear.contact_flexibility import by_harmonic
from ..model import ReducedModel
from ..policy import DENSE_LU, DETERMINANT_UNKNOWNS, ITERATIONS, linear_solver
from .deflation import common_motions
from .newton_compiled import Condensed
from .newton_krylov import Memory, iterative_inverse

# of a step by GMRES, relative
STEP_ACCURACY = 1e-5
# of the preload's compression: smaller motions drown in its rounding,
SMALL_MOTION_RATIO = 1e-8
# and their residual is measured by this share of it
REST_MOTION_SHARE = 1e-4
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
    p = forces.f - model.springs[:, :, None] * w
    p[:, :, 0] -= model.preload.reshape(p.shape[:2])
    flexed = _as_node_coefficients(balance, _apply_flexibility(linear.A, as_amplitudes(p)))
    residual = w - _as_node_coefficients(balance, linear.stuck) + flexed
    return State(w, forces, p, residual, _relative_error(balance, w, residual))


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
    n, d, K = state.w.shape
    change, active, dofs = _active_nodes(balance, state)
    if len(active) == 0:
        return lambda residual, accuracy=0.0: residual.copy()
    others = np.setdiff1d(np.arange(n), active)
    change = change[active]
    A = _select_dofs(balance.linear.A, dofs)
    if memory is not None and memory.nodes != active.tobytes():
        memory.nodes, memory.blocks, memory.slow = (
            active.tobytes(),
            None,
            memory.slow or memory.blocks is not None,
        )
    inverse = _choose_inverse(A, change, memory, common_motions(balance.model, K // 2)[dofs])

    def solve(residual: np.ndarray, accuracy: float = STEP_ACCURACY) -> np.ndarray:
        step = residual.copy()
        step[active] = inverse(residual[active].reshape(-1, K), accuracy).reshape(-1, d, K)
        if len(others):
            p = np.zeros_like(step)
            p[active] = (change @ step[active].reshape(len(active), d * K, 1)).reshape(-1, d, K)
            step[others] -= _as_node_coefficients(
                balance, _apply_flexibility(balance.linear.A, as_amplitudes(p))
            )[others]
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
    back = np.ascontiguousarray(change[active].swapaxes(1, 2))
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
    J = _dense_jacobian(_select_dofs(balance.linear.A, dofs), change[active])
    J[np.diag_indices_from(J)] += 1.0
    return float(np.linalg.slogdet(J)[0])


def _active_nodes(balance: Balance, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivative of p (n, dK, dK), the nodes where it does not vanish, and their dofs."""
    n, d, _ = state.w.shape
    change = _force_change(balance, state)
    active = np.flatnonzero(
        abs(change).reshape(n, -1).max(axis=1)
        > STICKING_FORCE_SHARE * balance.model.springs.max(axis=1)
    )
    return change, active, (active[:, None] * d + np.arange(d)).ravel()


def _select_dofs(A: np.ndarray, dofs: np.ndarray) -> np.ndarray:
    """(H+1, a, a) the flexibilities among some of the dofs, in one copy where one is needed."""
    return A if len(dofs) == A.shape[1] else A[np.ix_(np.arange(len(A)), dofs, dofs)]


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
    J = _dense_jacobian(A, change)
    J[np.diag_indices_from(J)] += 1.0
    factors = linalg.lu_factor(J, overwrite_a=True, check_finite=False)
    if not abs(np.diag(factors[0])).min() > 0:
        raise np.linalg.LinAlgError("singular Jacobian")
    return lambda residual, _: linalg.lu_solve(
        factors, residual.ravel(), check_finite=False
    ).reshape(residual.shape)


def compiled_arguments(balance: Balance) -> Condensed:
    """The linear part as the compiled loop takes it."""
    linear = balance.linear
    G = linear.G.copy()
    none = np.zeros((0, 0, 0), dtype=complex)
    G[0] = 0.0
    return Condensed(
        by_harmonic(linear.A),
        G,
        to_real(linear.stuck.T),
        linear.springs,
        _motion_scale(linear),
        none,
        none,
        none.reshape(0, 0),
        common_motions(balance.model, len(G) - 1),
    )


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


def _motion_scale(linear: Linear) -> float:
    return float(
        max(np.linalg.norm(linear.free), np.linalg.norm(linear.stuck), np.finfo(float).tiny)
    )


def _force_change(balance: Balance, state: State) -> np.ndarray:
    """(n, dK, dK) derivative of p."""
    n, d, K = state.w.shape
    change = state.forces.jacobian.reshape(n, d * K, d * K).copy()
    change[:, np.arange(d * K), np.arange(d * K)] -= np.repeat(balance.model.springs, K, axis=1)
    return change


def _dense_jacobian(A: np.ndarray, change: np.ndarray) -> np.ndarray:
    """(a K, a K) real matrix of  p -> A p  times `change` (nodes, dK, dK), for a = nodes * d
    dofs.
    """
    nodes, size = change.shape[:2]
    H = A.shape[0] - 1
    a = A.shape[1]
    d = a // nodes
    K = 2 * H + 1
    # (K, nodes, d, dK)
    rows = change.reshape(nodes, d, K, size).transpose(2, 0, 1, 3)
    rows = np.concatenate([rows[:1].astype(complex), rows[1::2] - 1j * rows[2::2]])
    # (H+1, nodes, a, d)
    blocks = A.reshape(H + 1, a, nodes, d).transpose(0, 2, 1, 3)
    product = (blocks @ rows).transpose(0, 2, 1, 3).reshape(H + 1, a, nodes * size)
    J = np.empty((a, K, nodes * size))
    J[:, 0] = product[0].real
    J[:, 1::2] = product[1:].real.transpose(1, 0, 2)
    J[:, 2::2] = -product[1:].imag.transpose(1, 0, 2)
    return J.reshape(a * K, nodes * size)


def _relative_error(
    balance: Balance,
    w: np.ndarray,
    residual: np.ndarray,
) -> float:
    linear = balance.linear
    r = as_amplitudes(residual)
    size = float(np.linalg.norm(as_amplitudes(w)))
    scale = _motion_scale(linear)
    pressed = balance.model.compression
    if scale < SMALL_MOTION_RATIO * pressed:
        size = max(size, REST_MOTION_SHARE * pressed)
        scale = max(scale, REST_MOTION_SHARE * pressed)
    with_springs = float(np.linalg.norm(r)) / max(size, float(np.finfo(float).tiny))
    r[1:] += _apply_flexibility(linear.G[1:], linear.springs * r[1:])
    return max(with_springs, float(np.linalg.norm(r)) / scale)


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

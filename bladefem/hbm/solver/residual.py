"""The balance of harmonics in the unknown relative displacements of the contact, and its
derivative.

Residual, additive form:  r_h = w_h - stuck_h + A_h p_h,  p = f(w) - K w  [m]. It is (1 + G K)^-1
times the form without springs  w_h - free_h + G_h f_h; both are measured before a point is
accepted. The derivative of p is one block a node, A is one block a harmonic, and both vanish
together at nodes that stick: these are eliminated exactly.

A damper on which every node slips along a motion without stiffness walks: the mean position that
way has no influence on the forces, and the step by which the motion goes on in each period has. The
component of the mean displacement along such a motion b (`Balance.walk`, with b^T K b = 1) then
replaces that step: the law is evaluated with the ramp  b (b^T K w_0)  a period. Equations and
number of unknowns stay the same; the derivative gains a term of low rank, as the ramp of every node
depends on the means of all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg

from ...friction.aft import PERIODIC, Forces, convergence_reason, evaluate
from ...friction.fourier import to_complex, to_real
from ...friction.kernel_1d_exact import evaluate_exact
from ...friction.trigonometric_tables import derivative_patterns, trigonometric_tables
from ...util.arrays import RealArray
from ..linear.condensation import Linear, condense, with_mean
from ..linear.contact_flexibility import (
    Flexibility,
    flexibility_of_mean,
    flexibility_product,
    form_matrices,
    select_nodes,
    sizes,
    transposed_flexibility,
)
from ..model import ReducedModel
from ..policy import DENSE_LU, DETERMINANT_UNKNOWNS, ITERATIONS, linear_solver
from ..solution import Solution
from .balance_2d import Evaluation, evaluate_2d, force_rates
from .balance_residual import balance_residual
from .dense_system import dense_system
from .law_evaluation import PERIODS
from .newton_compiled import dense_jacobian, moving_nodes, spread_to_all_nodes
from .newton_krylov import Memory, iterative_inverse

# of a step by GMRES, relative
STEP_ACCURACY = 1e-5
# a node whose p is below this share of its spring force sticks
STICKING_FORCE_SHARE = 1e-13
# of the size of the motion: step of the walk by which forces are differenced
WALK_DIFFERENCE = 1e-6
# of 2-D elements whose state was not found
NOT_PERIODIC = f"were not periodic after {PERIODS} cycles"

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
    # (m, z) motions along which the damper walks; None: it rests in the mean
    walk: np.ndarray | None = None

    @property
    def walking(self) -> np.ndarray:
        """``walk`` of a balance in which the damper walks."""
        if self.walk is None:
            raise RuntimeError("the damper of this balance does not walk")
        return self.walk


@dataclass(frozen=True)
class State:
    """The balance at one guess of the displacements; n nodes, d directions, K = 2H+1 real
    coefficients.
    """

    # (n, d, K) relative displacements [m]
    w: RealArray
    # friction forces and their derivative, of the total load
    forces: Forces
    # (n, d, K) forces beyond preload and springs [N]
    p: RealArray
    # (n, d, K) [m]
    residual: RealArray
    # residual of both forms over the size of the motion [1]
    error: float
    # what was derived from it, see `walk_rates`
    derived: dict[str, np.ndarray] = field(default_factory=dict, repr=False, compare=False)


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
    # in double precision, which is not Newton's, the kernel would have to be compiled once more
    if precision == "single" and evaluates_2d(balance):
        by_row = np.ascontiguousarray(w, dtype=float).reshape(model.springs.size, -1)
        return state_of_evaluation(balance, evaluate_2d(by_row, *arguments_2d(balance)))
    forces = contact_forces(model, w, balance.samples, precision, walk_ramp(balance, w))
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


def evaluates_2d(balance: Balance) -> bool:
    """True if an evaluation is one compiled call: 2-D elements of Coulomb's law."""
    elements = balance.model.elements
    return elements.tangents == 2 and elements.law is None and balance.samples > 0


def walk_columns(balance: Balance) -> np.ndarray:
    """(m, z) motions of the walk for compiled loops, none where nothing walks."""
    if balance.walk is None:
        return np.zeros((balance.linear.springs.size, 0))
    return np.ascontiguousarray(balance.walk)


def arguments_2d(balance: Balance) -> tuple:
    """What the kernels of `bladefem.hbm.solver.balance_2d` take of a balance: motions of the walk,
    condensed bodies, contact, and patterns of the derivative in single precision.
    """
    linear = balance.linear
    H = len(linear.stuck) - 1
    return (
        walk_columns(balance),
        linear.condensed,
        contact_table(balance.model, H, balance.samples),
        derivative_patterns(H, balance.samples, np.float32),
    )


def state_of_evaluation(balance: Balance, found: Evaluation) -> State:
    """The state that a compiled evaluation leaves."""
    n, d = balance.model.springs.shape
    K = found.w.shape[1]
    missing = 3 - d
    forces = Forces(
        found.F[:, missing:],
        found.J.reshape(n, 3, K, 3, K)[:, missing:, :, missing:],
        found.shares,
        found.dissipated,
        np.abs(found.cycles),
        found.periodic,
        PERIODIC if found.periodic else convergence_reason(found.F, found.cycles, NOT_PERIODIC),
    )
    shape = (n, d, K)
    return State(
        found.w.reshape(shape),
        forces,
        found.p.reshape(shape),
        found.residual.reshape(shape),
        found.error,
    )


def contact_forces(
    model: ReducedModel,
    w: np.ndarray,
    samples: int,
    precision: str = "double",
    walk: np.ndarray | None = None,
    jacobian: bool = True,
) -> Forces:
    """Friction forces in the directions (n, d, K) of the balance; displacements left out of it stay
    zero.

    Args:
        walk: (n, tangents) by which the motion goes on in each period [m].
    """
    w = w.copy()
    w[:, :, 0] += model.offset.reshape(w.shape[:2])
    missing = 1 + model.elements.tangents - model.directions
    if missing:
        w = np.concatenate([np.zeros((len(w), missing, w.shape[2])), w], axis=1)
    load, base = contact_table(model, w.shape[2] // 2, samples)[:2]
    if samples:
        forces = evaluate(
            model.elements,
            w,
            samples,
            jacobian,
            load=load if load.shape[1] else None,
            precision=precision,
            walk=walk,
        )
    else:
        forces = evaluate_exact(model.elements, w, load=base)
    if missing == 0:
        return forces
    f = forces.f[:, missing:]
    return replace(
        forces, f=f, dfdw=forces.jacobian[:, missing:, :, missing:] if jacobian else None
    )


def solved_balance(model: ReducedModel, solution: Solution) -> tuple[Balance, State]:
    """The equations of a solved point and their state there."""
    linear = condense(model, solution.omega, solution.harmonics)
    balance = Balance(model, linear, solution.samples, solution.walk)
    return balance, evaluate_balance(balance, solution.w)


def walk_ramp(balance: Balance, w: np.ndarray) -> np.ndarray | None:
    """(n, tangents) by which the motion goes on in each period [m]; None where nothing walks."""
    if balance.walk is None:
        return None
    return _as_ramp(balance, walk_steps(balance, w))


def walk_steps(balance: Balance, w: np.ndarray) -> np.ndarray:
    """(z,) steps along the motions of the walk, from the mean of w (n, d, K)."""
    return balance.walking.T @ (balance.linear.springs * w[:, :, 0].ravel())


def _as_ramp(balance: Balance, steps: np.ndarray) -> np.ndarray:
    model = balance.model
    first = model.directions - model.elements.tangents
    return (balance.walking @ steps).reshape(model.springs.shape)[:, first:]


def walk_rates(balance: Balance, state: State) -> np.ndarray:
    """(z, n, d, K) derivatives of the forces with the steps of the walk [N/m], by differences; made
    once a state.
    """
    if "walk rates" in state.derived:
        return state.derived["walk rates"]
    first = balance.model.directions - balance.model.elements.tangents
    size = WALK_DIFFERENCE * max(np.abs(state.w[:, first:, 1:]).max(), np.finfo(float).tiny)
    state.derived["walk rates"] = (
        _walk_rates_2d(balance, state, size)
        if evaluates_2d(balance)
        else _walk_rates_one_by_one(balance, state, size)
    )
    return state.derived["walk rates"]


def _walk_rates_2d(balance: Balance, state: State, size: float) -> np.ndarray:
    """`walk_rates` of 2-D elements by one compiled call."""
    n, d, K = state.w.shape
    full = np.zeros((n, 3, K))
    full[:, 3 - d :] = state.forces.f
    flat = np.ascontiguousarray(state.w, dtype=float).reshape(n * d, K)
    return force_rates(flat, full, size, *arguments_2d(balance))[:, :, 3 - d :]


def _walk_rates_one_by_one(balance: Balance, state: State, size: float) -> np.ndarray:
    """`walk_rates`, each by one evaluation of the forces."""
    steps = walk_steps(balance, state.w)
    rates = []
    for j in range(len(steps)):
        # away from a walk of zero, where the law has a corner
        change = np.zeros(len(steps))
        change[j] = np.copysign(size / abs(balance.walking[:, j]).max(), steps[j])
        ramp = _as_ramp(balance, steps + change)
        moved = contact_forces(balance.model, state.w, balance.samples, walk=ramp, jacobian=False).f
        rates.append((moved - state.forces.f) / change[j])
    return np.array(rates)


def walking_force_change(
    balance: Balance,
    state: State,
    dw: np.ndarray,
) -> np.ndarray | float:
    """(n, d, K) change of the forces by the ramps that belong to a change dw of the displacements;
    0 where nothing walks.
    """
    if balance.walk is None:
        return 0.0
    return np.tensordot(walk_steps(balance, dw), walk_rates(balance, state), 1)


def force_change(
    balance: Balance,
    state: State,
    dw: np.ndarray,
) -> np.ndarray:
    """(n, d, K) change of the contact forces by a change dw of the displacements."""
    n, d, K = dw.shape
    change = state.forces.jacobian.reshape(n, d * K, d * K) @ dw.reshape(n, d * K, 1)
    return change.reshape(dw.shape) + walking_force_change(balance, state, dw)


def transposed_force_change(
    balance: Balance,
    state: State,
    y: np.ndarray,
) -> np.ndarray:
    """(n, d, K) the transpose of `force_change` times y."""
    n, d, K = y.shape
    back = state.forces.jacobian.reshape(n, d * K, d * K).swapaxes(1, 2) @ y.reshape(n, d * K, 1)
    back = back.reshape(y.shape).copy()
    if balance.walk is not None:
        weights = np.array([np.vdot(rate, y) for rate in walk_rates(balance, state)])
        mean = balance.linear.springs * (balance.walking @ weights)
        back[:, :, 0] += mean.reshape(n, d)
    return back


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
    memory = Memory() if memory is None else memory
    if linear_solver(state.w.size) == DENSE_LU:
        return _linearise_densely(balance, state, memory)
    if balance.walk is None:
        return _linearise_blocks(balance, state, memory)
    walking = _iterate_with_walk(balance, state, memory)
    held: Inverse | None = None

    def solve(residual: np.ndarray, accuracy: float = STEP_ACCURACY) -> np.ndarray:
        nonlocal walking, held
        if walking is not None:
            try:
                return walking(residual, accuracy)
            except np.linalg.LinAlgError:
                walking = None
        if held is None:
            base = _linearise_blocks(_held_walk(balance), state, memory)
            held = _low_rank_inverse(base, *_walk_terms(balance, state))
        return held(residual, accuracy)

    return solve


def _linearise_densely(balance: Balance, state: State, memory: Memory) -> Inverse:
    """The inverse by one LU of a small balance, walk included."""
    n, d, K = state.w.shape
    rates = np.zeros((0, n, d, K)) if balance.walk is None else walk_rates(balance, state)
    nodes, change, system = dense_system(
        np.ascontiguousarray(state.forces.jacobian, dtype=float),
        balance.linear.condensed,
        d,
        STICKING_FORCE_SHARE,
        walk_columns(balance),
        np.ascontiguousarray(rates).reshape(len(rates), n * d, K),
    )
    if len(nodes) == 0:
        return lambda residual, accuracy=0.0: residual.copy()
    memory.solvers.add(DENSE_LU)
    invert = _factorised(system)
    if len(nodes) == n:
        return lambda residual, accuracy=0.0: invert(residual)
    flex = balance.linear.condensed.flex

    def solve(residual: np.ndarray, accuracy: float = 0.0) -> np.ndarray:
        step = np.empty(residual.shape)
        rows = np.ascontiguousarray(residual).reshape(-1, K)
        x = invert(residual[nodes]).ravel()
        spread_to_all_nodes(x, rows, d, nodes, change, flex, step.reshape(-1, K))
        return step

    return solve


def _iterate_with_walk(balance: Balance, state: State, memory: Memory) -> Inverse | None:
    """The inverse with the walk among the products of the iterations, which takes one solution a
    residual where `_low_rank_inverse` takes one more for each of its terms; None where some nodes
    stick or the system is small.
    """
    n, d, K = state.w.shape
    change, active, dofs = _active_nodes(balance, state)
    if len(active) < n or linear_solver(len(dofs) * K) == DENSE_LU:
        return None
    if memory.nodes != active.tobytes():
        memory.nodes, memory.blocks, memory.level = active.tobytes(), None, None
    memory.solvers.add(ITERATIONS)
    rates = walk_rates(balance, state)
    readings = np.zeros((len(rates), n * d, K))
    readings[:, :, 0] = (balance.linear.springs[:, None] * balance.walking).T
    condensed = balance.linear.condensed
    ramp = rates.reshape(len(rates), -1), readings.reshape(len(rates), -1)
    inverse = iterative_inverse(condensed.flex, change, memory, condensed.motions, ramp)

    def solve(residual: np.ndarray, accuracy: float = STEP_ACCURACY) -> np.ndarray:
        return inverse(residual.reshape(-1, K), accuracy).reshape(residual.shape)

    return solve


def _held_walk(balance: Balance) -> Balance:
    """The balance with  A - b b^T  in place of A: its derivative is regular where the mean position
    along b has no influence.
    """
    linear = balance.linear
    mean = flexibility_of_mean(linear.condensed.flex) - balance.walking @ balance.walking.T
    return replace(balance, linear=with_mean(linear, mean, linear.stuck[0]), walk=None)


def _walk_terms(balance: Balance, state: State) -> tuple[np.ndarray, np.ndarray]:
    """left and right (2z, n, d, K): the derivative of the balance is that of `_held_walk` plus
    the sum of  left_j (right_j . x):  A f_s (b^T K x_0)  of the ramps, and  b (b^T C x)  of what
    was taken from A.
    """
    shape = state.w.shape
    flex = balance.linear.condensed.flex
    steps = [flexibility_product(flex, rate) for rate in walk_rates(balance, state)]
    change = state.forces.jacobian.reshape(shape[0], shape[1] * shape[2], -1)
    springs = balance.model.springs[:, :, None]
    motions = []
    rows = []
    projections = []
    for b in balance.walking.T:
        motion = np.zeros(shape)
        motion[:, :, 0] = b.reshape(shape[:2])
        motions.append(motion)
        flat = motion.reshape(shape[0], -1, 1)
        rows.append((change.swapaxes(1, 2) @ flat).reshape(shape) - springs * motion)
        projection = np.zeros(shape)
        projection[:, :, 0] = (balance.linear.springs * b).reshape(shape[:2])
        projections.append(projection)
    return np.array(steps + motions), np.array(projections + rows)


def _low_rank_inverse(
    base: Inverse,
    left: np.ndarray,
    right: np.ndarray,
) -> Inverse:
    """Inverse of  B + sum left_j right_j^T,  for the inverse of B and (r, n, d, K) vectors."""
    solved: dict[float, np.ndarray] = {}

    def terms(accuracy: float) -> np.ndarray:
        finest = min([accuracy, *solved])
        if finest not in solved:
            solved[finest] = np.array([base(vector, finest) for vector in left])
        return solved[finest]

    def solve(residual: np.ndarray, accuracy: float = STEP_ACCURACY) -> np.ndarray:
        Y = terms(min(accuracy, STEP_ACCURACY))
        x = base(residual, accuracy)
        small = np.eye(len(right)) + np.tensordot(right, Y, axes=([1, 2, 3], [1, 2, 3]))
        parts = np.linalg.solve(small, np.tensordot(right, x, axes=3))
        return x - np.tensordot(parts, Y, 1)

    return solve


def _linearise_blocks(
    balance: Balance,
    state: State,
    memory: Memory | None = None,
) -> Inverse:
    """`linearise_balance` without the walk."""
    _, d, K = state.w.shape
    change, active, dofs = _active_nodes(balance, state)
    if len(active) == 0:
        return lambda residual, accuracy=0.0: residual.copy()
    flex = select_nodes(balance.linear.condensed.flex, active, d)
    if memory is not None and memory.nodes != active.tobytes():
        memory.slow = memory.slow or memory.blocks is not None
        memory.nodes, memory.blocks, memory.level = active.tobytes(), None, None
    inverse = _choose_inverse(flex, change, memory, balance.linear.condensed.motions[dofs])

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
    if balance.walk is None:
        return _adjoint_blocks(balance, state)
    base = _adjoint_blocks(_held_walk(balance), state)
    left, right = _walk_terms(balance, state)
    return _low_rank_inverse(base, right, left)


def _adjoint_blocks(balance: Balance, state: State) -> Inverse:
    """`adjoint_inverse` without the walk."""
    _, d, K = state.w.shape
    change, active, _ = _active_nodes(balance, state)
    if len(active) == 0:
        return lambda b, accuracy=0.0: b.copy()
    turned = transposed_flexibility(balance.linear.condensed.flex)
    back = np.ascontiguousarray(change.swapaxes(1, 2))
    inverse = _choose_inverse(select_nodes(turned, active, d), back)

    def solve(b: np.ndarray, accuracy: float = STEP_ACCURACY) -> np.ndarray:
        flexed = flexibility_product(turned, b)[active]
        x = inverse(flexed.reshape(-1, K), accuracy)
        result = b.copy()
        result[active] -= (back @ x.reshape(len(active), -1, 1)).reshape(flexed.shape)
        return result

    return solve


def determinant_sign(balance: Balance, state: State) -> float:
    """Sign of the determinant of the balance's derivative; 0 where there are too many unknowns to
    ask.
    """
    if balance.walk is not None:
        held = _held_walk(balance)
        sign = determinant_sign(held, state)
        if not sign:
            return 0.0
        left, right = _walk_terms(balance, state)
        base = _linearise_blocks(held, state)
        Y = np.array([base(vector, STEP_ACCURACY) for vector in left])
        small = np.eye(len(right)) + np.tensordot(right, Y, axes=([1, 2, 3], [1, 2, 3]))
        return sign * float(np.sign(np.linalg.det(small)))
    change, active, dofs = _active_nodes(balance, state)
    if len(dofs) * state.w.shape[2] > DETERMINANT_UNKNOWNS:
        return 0.0
    # everything sticks: the derivative is the identity
    if not len(dofs):
        return 1.0
    flex = select_nodes(balance.linear.condensed.flex, active, state.w.shape[1])
    J = dense_jacobian(form_matrices(flex), change)
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


def _choose_inverse(
    flex: Flexibility,
    change: np.ndarray,
    memory: Memory | None = None,
    motions: np.ndarray | None = None,
) -> Inverse:
    harmonics, dofs = sizes(flex)
    solver = linear_solver(dofs * (2 * harmonics - 1))
    memory = Memory() if memory is None else memory
    memory.solvers.add(DENSE_LU if solver == DENSE_LU else ITERATIONS)
    if solver == DENSE_LU:
        return _dense_inverse(flex, change)
    iterative = iterative_inverse(flex, change, memory, motions)
    if solver == ITERATIONS:
        return iterative
    return _with_factors_at_need(iterative, flex, change, memory)


def _with_factors_at_need(
    iterative: Inverse,
    flex: Flexibility,
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
                dense = _dense_inverse(flex, change)
        return dense(residual, accuracy)

    return solve


def _dense_inverse(flex: Flexibility, change: np.ndarray) -> Inverse:
    invert = _factorised(dense_jacobian(form_matrices(flex), change))
    return lambda residual, _: invert(residual)


def _factorised(system: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """The inverse of a matrix by its LU factors, for arrays of any shape; the matrix is lost."""
    factors = linalg.lu_factor(system, overwrite_a=True, check_finite=False)
    if not abs(factors[0].diagonal()).min() > 0:
        raise np.linalg.LinAlgError("singular Jacobian")

    def invert(residual: np.ndarray) -> np.ndarray:
        found = linalg.lu_solve(factors, residual.ravel(), check_finite=False)
        return found.reshape(residual.shape)

    return invert


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


def as_amplitudes(x: np.ndarray) -> np.ndarray:
    """(n, d, K) real coefficients as (H+1, n d) complex amplitudes."""
    return to_complex(x.reshape(-1, x.shape[2])).T


def as_coefficients(q: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(H+1, n d) complex amplitudes as real coefficients of the shape (n, d, K)."""
    return to_real(q.T).reshape(shape)


def _as_node_coefficients(balance: Balance, q: np.ndarray) -> np.ndarray:
    model = balance.model
    return as_coefficients(q, (len(model.springs), model.directions, 2 * len(q) - 1))

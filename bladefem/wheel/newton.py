"""Newton's method with GMRES on the balance of a whole wheel; it always says why it stopped.

Residual  r = w - stuck + A p(w)  in real Fourier coefficients of all relative displacements, A the
mistuned wheel with closed contacts, p what the contact forces differ from full stick. p and its
derivative vanish at contacts that stick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from ..data import Elements
from ..friction.fourier import to_complex, to_real
from ..hbm.solver.newton import Options
from ..util.newton import Outcome, StepError, halve_step, iterate_newton
from .contact_forces import ContactForces, contact_forces
from .coupled_preconditioner import CoupledPreconditioner, make_coupled_preconditioner
from .flexibility import WheelFlexibility
from .model import Wheel
from .preconditioner import Preconditioner, make_preconditioner
from .tuned import travelling_order
from .walking import WheelWalk, held_flexibility, walk_rates
from .wave_preconditioner import WavePreconditioner, make_wave_preconditioner

AnyPreconditioner = Preconditioner | WavePreconditioner | CoupledPreconditioner

# vectors kept by GMRES: at least, at most, and numbers in all of them between (100 MB); where
# blades and harmonics differ much a restart forgets what the next vectors need
LEAST_BASIS = 60
MOST_BASIS = 400
BASIS_NUMBERS = 12_500_000
# products of one solve, at least; more where a larger basis goes without a restart
GMRES_PRODUCTS = 240
# relative accuracy of a step: loose far from the solution, tight near it
LOOSE_STEP_TOLERANCE = 1e-2
TIGHT_STEP_TOLERANCE = 1e-6
# relative accuracy of the step that only measures a trial
TRIAL_TOLERANCE = 0.1
# coefficients of a displacement up to which one harmonic moves, and none are to be coupled
FEW_COEFFICIENTS = 3
# reduction of the residual by one step that needs no further test
QUADRATIC_REDUCTION = 1e-2
# step share below which the search direction is given up
SHORTEST_STEP_SHARE = 2.0**-8
# full steps: at most; error over the lowest one, and error, from which they diverge
FULL_STEPS = 8
MOST_GROWTH = 4.0
DIVERGED = 1e-2
# products of one solve from which a new preconditioner pays, and from which one of the other kind
# is tried
SLOW_SOLVE_PRODUCTS = 12
MANY_PRODUCTS = 40
# products of one solve that the coupled preconditioner's matrix is worth
COUPLED_PRODUCTS = 80


@dataclass(frozen=True)
class WheelBalance:
    """The equations of one frequency."""

    wheel: Wheel
    flex: WheelFlexibility
    # of all dampers
    elements: Elements
    # (N n, tangents) friction forces from which the law starts [N]
    start: np.ndarray
    # (N, n, d, K) displacements of full stick [m]
    stuck: np.ndarray
    # a period, 0: transitions located exactly
    samples: int
    # None: all dampers rest in the mean
    walk: WheelWalk | None = None
    # flexibility products after which Newton is given up; None: as many as it takes
    most_products: int | None = None


@dataclass(frozen=True)
class WheelState:
    """The balance at one guess."""

    # (N, n, d, K) relative displacements [m]
    w: np.ndarray
    forces: ContactForces
    # (N, n, d, K) [m]
    residual: np.ndarray
    # over the size of the motion [1]
    error: float
    # (z, N, n, d, K) derivatives of the forces with the steps of dampers that walk [N/m]
    rates: np.ndarray | None = None


@dataclass(frozen=True)
class WheelNewton:
    """The last state of a run of Newton's method, and why it ended there."""

    state: WheelState
    iterations: int
    # flexibility products of all GMRES solves
    products: int
    converged: bool
    reason: str


def evaluate_wheel(balance: WheelBalance, w: np.ndarray) -> WheelState:
    """Forces and residual at w (N, n, d, K)."""
    walk = balance.walk
    ramp = None if walk is None else walk.ramp(walk.steps(w))
    forces = _forces(balance, w, True, ramp)
    rates = None
    if walk is not None:
        rates = walk_rates(walk, w, forces.f, lambda moved: _forces(balance, w, False, moved).f)
    residual = w - balance.stuck + contact_motions(balance.flex, forces.p)
    return WheelState(w, forces, residual, _error(w, residual, balance.stuck), rates)


def _forces(
    balance: WheelBalance, w: np.ndarray, jacobian: bool, ramp: np.ndarray | None
) -> ContactForces:
    return contact_forces(
        balance.wheel, balance.elements, w, balance.start, balance.samples, jacobian, ramp
    )


def _error(w: np.ndarray, residual: np.ndarray, stuck: np.ndarray) -> float:
    """Relative residual; that of the means is over the displacements, that of the motion over the
    motion: means of dampers that drift are larger by orders, and would hide a motion that is not
    found.
    """
    tiny = np.finfo(float).tiny
    mean = np.linalg.norm(residual[..., 0])
    moving = np.linalg.norm(residual[..., 1:])
    mean /= max(np.linalg.norm(w), np.linalg.norm(stuck), tiny)
    moving /= max(np.linalg.norm(w[..., 1:]), np.linalg.norm(stuck[..., 1:]), tiny)
    return float(np.hypot(mean, moving))


def contact_motions(flex: WheelFlexibility, p: np.ndarray) -> np.ndarray:
    """(N, n, d, K) motions by contact forces of the same shape."""
    count, _, _, K = p.shape
    moved = flex.contact_motion(to_complex(p.reshape(count, -1, K)))
    return to_real(moved).reshape(p.shape)


def newton_wheel(
    balance: WheelBalance,
    w: np.ndarray,
    options: Options,
) -> WheelNewton:
    """Solve the balance from the displacements w (N, n, d, K), by a line search that lowers the
    step which the last derivative would take next: it does not depend on how the equations are
    scaled (Deuflhard, Newton Methods for Nonlinear Problems, 2004, Sect. 3.3).
    """
    steps = _Steps(balance)
    run = iterate_newton(
        evaluate_wheel(balance, w),
        _error_of_state,
        lambda state: _line_search(balance, state, steps),
        options.tolerance,
        options.iterations,
    )
    forces = run.state.forces
    reason = run.reason if forces.converged else forces.reason
    return WheelNewton(run.state, run.iterations, steps.products, run.converged, reason)


def full_newton(balance: WheelBalance, w: np.ndarray, options: Options) -> WheelNewton:
    """Few Newton steps without a line search from the displacements w (N, n, d, K); where they do
    not converge the state with the lowest error.
    """
    steps = _Steps(balance)
    best = evaluate_wheel(balance, w)

    def advance(state: WheelState) -> WheelState:
        nonlocal best
        if state.error < best.error:
            best = state
        elif state.error > max(MOST_GROWTH * best.error, DIVERGED):
            raise StepError(Outcome.STALLED, f"full steps diverge from residual {best.error:.1e}")
        step, _ = steps.step(state)
        if not np.isfinite(step).all():
            raise StepError(Outcome.SINGULAR, "the Newton step is not finite")
        return evaluate_wheel(balance, state.w - step)

    run = iterate_newton(best, _error_of_state, advance, options.tolerance, FULL_STEPS)
    state = run.state if run.converged else best
    return WheelNewton(state, run.iterations, steps.products, run.converged, run.reason)


def _error_of_state(state: WheelState) -> float:
    """Infinite where the contact forces were not found."""
    return state.error if state.forces.converged else float("inf")


class _Steps:
    """Newton steps of one run; the preconditioner is renewed where GMRES takes long.

    Of its kinds that by waves couples the harmonics, that by harmonics what is mistuned, and the
    coupled one, which costs most to make, both: the first is taken where there are harmonics to
    couple, and another where the present one takes long.
    """

    def __init__(self, balance: WheelBalance) -> None:
        self.balance = balance
        self.preconditioner: AnyPreconditioner | None = None
        self.stale = True
        self.products = 0
        self.order = _wave_order(balance.wheel)
        few = balance.stuck.shape[3] <= FEW_COEFFICIENTS
        # in the order in which they are tried
        self.kinds = ["harmonics", "coupled"] if few else ["waves", "coupled", "harmonics"]
        if self.order is None:
            self.kinds = ["harmonics", "coupled"]
        elif few:
            self.kinds.append("waves")
        self.kind = self.kinds[0]
        # products that a new preconditioner of each kind took last
        self.took: dict[str, int] = {}

    def step(self, state: WheelState) -> tuple[np.ndarray, bool]:
        """The step (N, n, d, K), and whether GMRES reached its accuracy."""
        most = self.balance.most_products
        if most is not None and self.products > most:
            text = f"residual {state.error:.1e} after {self.products} flexibility products"
            raise StepError(Outcome.EXHAUSTED, text)
        accuracy = float(np.clip(0.1 * state.error, TIGHT_STEP_TOLERANCE, LOOSE_STEP_TOLERANCE))
        goal = accuracy * float(np.linalg.norm(state.residual))
        new = self.stale
        if new:
            self._choose_kind()
            self._renew(state)
        before = self.products
        found, failed = self._solve(state, state.residual, goal)
        if failed:
            if new:
                self.took[self.kind] = self.products - before
                self._choose_kind()
            self._renew(state)
            before = self.products
            found, failed = self._solve(state, state.residual, goal)
            new = True
        taken = self.products - before
        if new:
            self.took[self.kind] = taken
        self.stale = taken > (COUPLED_PRODUCTS if self.kind == "coupled" else SLOW_SOLVE_PRODUCTS)
        return found, not failed

    def _choose_kind(self) -> None:
        """Take another kind of preconditioner where the present one took long: one that was not
        tried, or the one that took least.
        """
        taken = self.took.get(self.kind, 0)
        if taken <= MANY_PRODUCTS:
            return
        kinds = [kind for kind in self.kinds if kind != "coupled" or taken > COUPLED_PRODUCTS]
        self.kind = min(kinds, key=lambda kind: self.took.get(kind, 0))

    def next_length(
        self,
        state: WheelState,
        residual: np.ndarray,
    ) -> float:
        """Length of the step that the derivative at `state` would take from another residual."""
        found, _ = self._solve(state, residual, TRIAL_TOLERANCE * float(np.linalg.norm(residual)))
        return float(np.linalg.norm(found))

    def _renew(self, state: WheelState) -> AnyPreconditioner:
        flex = self.balance.flex
        if self.balance.walk is not None:
            flex = held_flexibility(self.balance.wheel, flex)
        change = state.forces.jacobian
        made: AnyPreconditioner | None = None
        while made is None:
            if self.kind == "waves" and self.order is not None:
                made = make_wave_preconditioner(flex, change, self.order)
            elif self.kind == "coupled":
                made = make_coupled_preconditioner(flex, change)
            else:
                made = make_preconditioner(flex, change)
            if made is None:
                # too many unknowns, or nothing to couple: nor will it be otherwise in another step
                self.kinds.remove(self.kind)
                self.kind = min(self.kinds, key=lambda kind: self.took.get(kind, 0))
        self.preconditioner = made
        self.stale = False
        return made

    def _solve(
        self,
        state: WheelState,
        residual: np.ndarray,
        goal: float,
    ) -> tuple[np.ndarray, bool]:
        shape = state.residual.shape
        flat = (shape[0], -1, shape[3])
        change = state.forces.jacobian
        partition = self.balance.wheel.partition
        walk = self.balance.walk
        prepare = (self.preconditioner or self._renew(state)).apply

        def product(y: np.ndarray) -> np.ndarray:
            self.products += 1
            x = prepare(y.reshape(flat))
            own = x[partition.sectors].reshape(*change.shape[:2], 1)
            forces = partition.join((change @ own).reshape(-1, *shape[1:]))
            if walk is not None and state.rates is not None:
                steps = walk.steps(x.reshape(shape))
                forces = forces + np.einsum("zsndk,sz->sndk", state.rates, steps)
            return (x.reshape(shape) + contact_motions(self.balance.flex, forces)).ravel()

        size = state.residual.size
        operator = LinearOperator((size, size), matvec=product, dtype=float)
        basis = int(np.clip(BASIS_NUMBERS // max(size, 1), LEAST_BASIS, MOST_BASIS))
        restarts = -(-GMRES_PRODUCTS // basis)
        # SciPy's versions name the relative tolerance differently: atol rules where it is larger
        y, failed = gmres(operator, residual.ravel(), atol=goal, restart=basis, maxiter=restarts)
        return prepare(y.reshape(flat)).reshape(shape), failed != 0


def _wave_order(wheel: Wheel) -> int | None:
    """The engine order with which all harmonics travel, found once; None for other forces."""
    if "wave order" not in wheel.kept:
        wheel.kept["wave order"] = travelling_order(wheel)
    return wheel.kept["wave order"]


def _line_search(
    balance: WheelBalance,
    state: WheelState,
    steps: _Steps,
) -> WheelState | None:
    """The state after the first halving of the step from which the next one is shorter, or None
    where there is none.

    Raises:
        StepError: the step is not finite, or GMRES did not converge and the step leads nowhere.
    """
    step, solved = steps.step(state)
    if not np.isfinite(step).all():
        raise StepError(Outcome.SINGULAR, "the Newton step is not finite")
    before = np.linalg.norm(step)

    def comes_closer(trial: WheelState, share: float) -> bool:
        if trial.error <= QUADRATIC_REDUCTION * state.error:
            return True
        return bool(steps.next_length(state, trial.residual) <= (1 - 0.25 * share) * before)

    better = halve_step(
        lambda share: evaluate_wheel(balance, state.w - share * step),
        comes_closer,
        SHORTEST_STEP_SHARE,
    )
    if better is None and not solved:
        raise StepError(Outcome.SINGULAR, f"GMRES did not converge at residual {state.error:.1e}")
    return better

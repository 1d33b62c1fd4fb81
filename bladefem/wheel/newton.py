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
from .flexibility import WheelFlexibility
from .model import Wheel
from .preconditioner import Preconditioner, make_preconditioner
from .tuned import travelling_order
from .wave_preconditioner import WavePreconditioner, make_wave_preconditioner

# vectors kept by GMRES, and restarts
GMRES_BASIS = 60
GMRES_RESTARTS = 4
# relative accuracy of a step: loose far from the solution, tight near it
LOOSE_STEP_TOLERANCE = 1e-2
TIGHT_STEP_TOLERANCE = 1e-6
# relative accuracy of the step that only measures a trial
TRIAL_TOLERANCE = 0.1
# coefficients of a displacement up to which one harmonic moves, and none are to be coupled
FEW_COEFFICIENTS = 3
# reduction of the residual by one step that needs no further test
QUADRATIC_REDUCTION = 1e-2
# weight of the mean in the residual that the line search lowers
MEAN_WEIGHT = 1e-2
# step share below which the search direction is given up
SHORTEST_STEP_SHARE = 2.0**-8
# products of one solve from which a new preconditioner pays, and from which one of the other kind
# is tried
SLOW_SOLVE_PRODUCTS = 12
MANY_PRODUCTS = 40


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


@dataclass(frozen=True)
class WheelNewton:
    """Where Newton ended."""

    state: WheelState
    iterations: int
    # flexibility products of all GMRES solves
    products: int
    converged: bool
    reason: str


def evaluate_wheel(
    balance: WheelBalance,
    w: np.ndarray,
    jacobian: bool = True,
) -> WheelState:
    """Forces and residual at w (N, n, d, K)."""
    forces = contact_forces(
        balance.wheel, balance.elements, w, balance.start, balance.samples, jacobian
    )
    residual = w - balance.stuck + contact_motions(balance.flex, forces.p)
    return WheelState(w, forces, residual, _error(w, residual, balance.stuck))


def _error(w: np.ndarray, residual: np.ndarray, stuck: np.ndarray) -> float:
    """Of the mean over the displacements, of the motion over the motion: means of dampers that
    drift are larger by orders, and would hide a motion that is not found.
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
    merit: str = "step",
) -> WheelNewton:
    """Solve the balance from the displacements w (N, n, d, K).

    Args:
        merit: what the line search lowers: "step", the step that the last derivative would take
            next, which does not depend on how the equations are scaled (Deuflhard, Newton Methods
            for Nonlinear Problems, 2004, Sect. 3.3), or "residual", which costs no more solves.
    """
    steps = _Steps(balance)
    run = iterate_newton(
        evaluate_wheel(balance, w),
        lambda state: state.error if state.forces.converged else np.inf,
        lambda state: _line_search(balance, state, steps, merit),
        options.tolerance,
        options.iterations,
    )
    forces = run.state.forces
    reason = run.reason if forces.converged else forces.reason
    return WheelNewton(run.state, run.iterations, steps.products, run.converged, reason)


class _Steps:
    """Newton steps of one run; the preconditioner is renewed where GMRES takes long.

    Of its two kinds that by waves couples the harmonics, that by harmonics what is mistuned: the
    first is taken where there are harmonics to couple, and the other where that takes long.
    """

    def __init__(self, balance: WheelBalance) -> None:
        self.balance = balance
        self.preconditioner: Preconditioner | WavePreconditioner | None = None
        self.stale = True
        self.products = 0
        self.order = _wave_order(balance.wheel)
        self.by_waves = self.order is not None and balance.stuck.shape[3] > FEW_COEFFICIENTS
        # products that a new preconditioner of each kind took last
        self.took: dict[bool, int] = {}

    def step(self, state: WheelState) -> tuple[np.ndarray, bool]:
        """The step (N, n, d, K), and whether GMRES reached its accuracy."""
        accuracy = float(np.clip(0.1 * state.error, TIGHT_STEP_TOLERANCE, LOOSE_STEP_TOLERANCE))
        goal = accuracy * float(np.linalg.norm(state.residual))
        new = self.stale
        if new:
            self._choose_kind()
            self._renew(state)
        before = self.products
        found, failed = self._solve(state, state.residual, goal)
        if failed:
            if new and self.order is not None:
                self.took[self.by_waves] = self.products - before
                self.by_waves = not self.by_waves
            self._renew(state)
            before = self.products
            found, failed = self._solve(state, state.residual, goal)
            new = True
        taken = self.products - before
        if new:
            self.took[self.by_waves] = taken
        self.stale = taken > SLOW_SOLVE_PRODUCTS
        return found, not failed

    def _choose_kind(self) -> None:
        """Where the present kind took long, the other one unless that took longer."""
        taken = self.took.get(self.by_waves, 0)
        if self.order is not None and taken > max(
            MANY_PRODUCTS, self.took.get(not self.by_waves, 0)
        ):
            self.by_waves = not self.by_waves

    def next_length(
        self,
        state: WheelState,
        residual: np.ndarray,
    ) -> float:
        """Length of the step that the derivative at `state` would take from another residual."""
        found, _ = self._solve(state, residual, TRIAL_TOLERANCE * float(np.linalg.norm(residual)))
        return float(np.linalg.norm(found))

    def _renew(self, state: WheelState) -> Preconditioner | WavePreconditioner:
        flex = self.balance.flex
        change = state.forces.jacobian
        made: Preconditioner | WavePreconditioner | None = None
        if self.by_waves and self.order is not None:
            made = make_wave_preconditioner(flex, change, self.order)
            if made is None:
                # too many unknowns: nor will there be fewer in another step
                self.by_waves, self.order = False, None
        self.preconditioner = made or make_preconditioner(flex, change)
        self.stale = False
        return self.preconditioner

    def _solve(
        self,
        state: WheelState,
        residual: np.ndarray,
        goal: float,
    ) -> tuple[np.ndarray, bool]:
        shape = state.residual.shape
        flat = (shape[0], -1, shape[3])
        change = state.forces.jacobian
        deal = self.balance.wheel.deal
        prepare = (self.preconditioner or self._renew(state)).apply

        def product(y: np.ndarray) -> np.ndarray:
            self.products += 1
            x = prepare(y.reshape(flat))
            own = x[deal.sectors].reshape(*change.shape[:2], 1)
            forces = deal.join((change @ own).reshape(-1, *shape[1:]))
            return (x.reshape(shape) + contact_motions(self.balance.flex, forces)).ravel()

        size = state.residual.size
        operator = LinearOperator((size, size), matvec=product, dtype=float)
        # SciPy's versions name the relative tolerance differently: atol rules where it is larger
        y, failed = gmres(
            operator, residual.ravel(), atol=goal, restart=GMRES_BASIS, maxiter=GMRES_RESTARTS
        )
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
    merit: str,
) -> WheelState | None:
    """The first halving of the step that lowers the merit, or None where it stalls.

    Raises:
        StepError: the step is not finite, or GMRES did not converge and the step leads nowhere.
    """
    step, solved = steps.step(state)
    if not np.isfinite(step).all():
        raise StepError(Outcome.SINGULAR, "the Newton step is not finite")
    before = np.linalg.norm(step)
    weighted = _moving_first(state.residual)

    def lowers_merit(trial: WheelState, share: float) -> bool:
        if trial.error <= QUADRATIC_REDUCTION * state.error:
            return True
        if merit == "residual":
            return bool(_moving_first(trial.residual) <= (1 - 1e-4 * share) * weighted)
        return bool(steps.next_length(state, trial.residual) <= (1 - 0.25 * share) * before)

    better = halve_step(
        lambda share: evaluate_wheel(balance, state.w - share * step),
        lowers_merit,
        SHORTEST_STEP_SHARE,
    )
    if better is None and not solved:
        raise StepError(Outcome.SINGULAR, f"GMRES did not converge at residual {state.error:.1e}")
    return better


def _moving_first(residual: np.ndarray) -> float:
    """Size of a residual in which the mean counts little: dampers that slip throughout drift far on
    nearly no force.
    """
    mean = np.linalg.norm(residual[..., 0])
    return float(np.hypot(np.linalg.norm(residual[..., 1:]), MEAN_WEIGHT * mean))

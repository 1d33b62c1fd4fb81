"""Newton steps of large patches without a dense Jacobian: iterations on  x + A (dp/dw) x = r.

The springs of full stick inside A already are the preconditioner, with a second level for what the
contacts move in common (`bladefem.hbm.solver.deflation`): compiled conjugate residuals mostly
converge in a few directions. Where they do not, GMRES does, at last with one complex block a
harmonic that is factorised, with the part of dp/dw that keeps to its harmonic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from ...friction.fourier import to_complex, to_real
from ..linear.contact_flexibility import Flexibility, flexibility_product, sizes
from .deflation import no_level, no_ramp, second_level
from .krylov import NOT_FOUND, conjugate_residuals

# vectors kept by GMRES
GMRES_BASIS = 80
# of GMRES, each on what the last one left
GMRES_PASSES = 6
# reduction by one pass from which the next one runs in double precision
POOR_REDUCTION = 0.1
# reduction of the residual by one pass in single precision that can be trusted
SINGLE_PRECISION_REDUCTION = 1e-3
# products of one solve from which new harmonic blocks pay: they cost about as many
RENEWING_PRODUCTS = 80
# passes of conjugate residuals after the first one
MOST_RESTARTS = 6
# directions of one solve from which a second level of an earlier derivative is given up: steps of a
# patch between rigid faces lose 4 of 24 points with up to 20, 7 with 22, 19 with 26
RENEWING_DIRECTIONS = 20


@dataclass
class Memory:
    """Preconditioners of an earlier derivative, which serve the next ones of the same Newton run as
    well.
    """

    # the active nodes that they belong to
    nodes: bytes = b""
    # (H+1, a, a)
    blocks: np.ndarray | None = None
    # the second level of `bladefem.hbm.solver.deflation`
    level: tuple[np.ndarray, ...] | None = None
    # the last system took long: blocks are worth their time
    slow: bool = False
    # linear solvers of the policy that ran so far
    solvers: set[str] = field(default_factory=set)


# flexibility A and change (nodes, dK, dK), in one precision
Parts = tuple[Flexibility, np.ndarray]
# forces and readings (z, a K)
Ramp = tuple[np.ndarray, np.ndarray]


def iterative_inverse(
    flex: Flexibility,
    change: np.ndarray,
    memory: Memory | None = None,
    motions: np.ndarray | None = None,
    ramp: Ramp | None = None,
) -> Callable[[np.ndarray, float], np.ndarray]:
    """The inverse of 1 + A change, applied to residuals (a, K) to a relative accuracy, for a =
    nodes * d dofs.

    The products of GMRES run in single precision, which halves the traffic; what they leave is
    measured in double precision and solved for again, since next to a singular derivative the step
    is far longer than the residual.

    Args:
        flex: flexibility A with contact springs, see `bladefem.hbm.linear.contact_flexibility`
            [m/N].
        change: (nodes, dK, dK) derivative of the forces beyond the springs [N/m].
        memory: of the Newton run; changed in place.
        motions: (a, q) that the contacts have in common, see `bladefem.hbm.solver.deflation`; none
            when left out.
        ramp: vectors of a walk that belong to the system too, see `bladefem.hbm.solver.krylov`;
            then conjugate residuals alone are tried, and numpy.linalg.LinAlgError is raised where
            they do not find the solution.
    """
    system = _System((flex, change), memory or Memory(), motions, ramp or no_ramp())
    return partial(_solve_system, system)


@dataclass
class _System:
    """1 + A change, its preconditioners, and how often GMRES applied it in the present solve."""

    double: Parts
    memory: Memory
    motions: np.ndarray | None
    ramp: Ramp
    count: int = 0
    # the second level belongs to this derivative
    fresh: bool = False

    @cached_property
    def single(self) -> Parts:
        """The preconditioner in single precision."""
        (A, mean, R, U, T), change = self.double
        halved = (
            A.astype(np.complex64),
            mean.astype(np.float32),
            R.astype(np.float32),
            U.astype(np.float32),
            T.astype(np.complex64),
        )
        return halved, change.astype(np.float32)

    def renew_level(self) -> None:
        """The second level of this derivative."""
        flex, change = self.double
        self.fresh = True
        if self.motions is None or self.motions.size == 0:
            self.memory.level = no_level()
            return
        d = len(self.motions) // len(change)
        nodes = np.arange(len(change))
        self.memory.level = second_level(flex, change, self.ramp, self.motions, nodes, d)

    def reach(self, residual: np.ndarray, accuracy: float, x: np.ndarray) -> int:
        """Fill x by conjugate residuals with the present level; the number of directions."""
        flex, change = self.double
        level = self.memory.level
        right = residual.ravel()
        return int(conjugate_residuals(flex, change, self.ramp, right, accuracy, level, x))

    def reach_again(self, residual: np.ndarray, accuracy: float, x: np.ndarray) -> bool:
        """Conjugate residuals restarted on what x leaves, which is changed in place, as long as a
        pass reduces that well; True where they found the solution.

        Slopes of resonances, to 1e-9, take two to five passes of 5 ms with split layers, where one
        solution by GMRES for each vector of a walk takes 0.1 s.
        """
        goal = accuracy * float(np.linalg.norm(residual))
        before = float(np.linalg.norm(residual))
        part = np.empty_like(x)
        for _ in range(MOST_RESTARTS):
            rest = self.left_over(residual, x)
            left = float(np.linalg.norm(rest))
            if left <= goal:
                return True
            if not left <= POOR_REDUCTION * before:
                return False
            self.reach(rest, goal / left, part)
            x += part
            before = left
        return float(np.linalg.norm(self.left_over(residual, x))) <= goal

    def left_over(self, residual: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(N,) what x leaves of the residual, with the vectors of a walk."""
        rest = residual.ravel() - self.product(x, self.double)
        for force, reading in zip(*self.ramp, strict=True):
            moved = (reading @ x) * force.reshape(sizes(self.double[0])[1], -1)
            rest = rest - flexibility_product(self.double[0], moved).ravel()
        return rest

    def directions(
        self,
        residual: np.ndarray,
        accuracy: float,
    ) -> np.ndarray | None:
        """The solution by conjugate residuals, or None where they do not find it.

        The second level is that of an earlier derivative as long as this takes few directions.
        """
        if self.memory.level is None:
            self.renew_level()
        x = np.empty(residual.size)
        count = self.reach(residual, accuracy, x)
        if count == NOT_FOUND and not self.fresh:
            self.renew_level()
            count = self.reach(residual, accuracy, x)
        if count == NOT_FOUND and self.reach_again(residual, accuracy, x):
            return x.reshape(residual.shape)
        if count > RENEWING_DIRECTIONS and not self.fresh:
            self.memory.level = None
        return None if count == NOT_FOUND else x.reshape(residual.shape)

    def product(
        self,
        x: np.ndarray,
        parts: Parts,
    ) -> np.ndarray:
        """The system times x, flat."""
        self.count += 1
        flex, change = parts
        forces = change @ x.reshape(len(change), -1, 1).astype(change.dtype)
        forces = forces.reshape(sizes(flex)[1], -1)
        product = flexibility_product if parts is self.double else _single_product
        return x + product(flex, forces).ravel()

    def prepared(self, x: np.ndarray) -> np.ndarray:
        """The preconditioner times x, flat."""
        blocks = self.memory.blocks
        return x if blocks is None else _by_matrices(blocks, x.reshape(blocks.shape[1], -1)).ravel()

    def krylov(
        self,
        rest: np.ndarray,
        target: float,
        parts: Parts,
    ) -> tuple[np.ndarray, int]:
        """What one pass of GMRES finds, and whether it stopped before the target."""
        y, failed = _run_gmres(lambda y: self.product(self.prepared(y), parts), rest, target)
        return self.prepared(y), failed

    def renew(self) -> None:
        """New harmonic blocks."""
        self.memory.blocks, self.memory.slow = _harmonic_blocks(*self.double), False


def _solve_system(
    system: _System,
    residual: np.ndarray,
    accuracy: float,
) -> np.ndarray:
    memory = system.memory
    target = accuracy * float(np.linalg.norm(residual))
    fresh = system.memory.slow
    if target == 0.0:
        return np.zeros_like(residual)
    found = system.directions(residual, accuracy)
    if found is not None:
        return found
    if len(system.ramp[0]):
        raise np.linalg.LinAlgError("conjugate residuals did not solve for the Newton step")
    if fresh:
        system.renew()
    system.count, parts = 0, system.single
    x = np.zeros(residual.size)
    rest = residual.ravel()
    for _ in range(GMRES_PASSES):
        left = float(np.linalg.norm(rest))
        part, failed = system.krylov(rest, max(target, SINGLE_PRECISION_REDUCTION * left), parts)
        after = rest - system.product(part, system.double)
        gain = np.linalg.norm(after) / left
        if gain < 1:
            x = x + part
            rest = after
        if np.linalg.norm(rest) <= 2 * target:
            memory.slow = memory.slow or system.count > RENEWING_PRODUCTS
            return x.reshape(residual.shape)
        if failed and not fresh:
            fresh = True
            system.renew()
        elif gain > POOR_REDUCTION:
            parts = system.double
    raise np.linalg.LinAlgError("GMRES did not solve for the Newton step")


def _run_gmres(
    product: Callable[[np.ndarray], np.ndarray],
    residual: np.ndarray,
    target: float,
) -> tuple[np.ndarray, int]:
    operator = LinearOperator((residual.size, residual.size), matvec=product, dtype=float)
    # the relative tolerance has two names in the versions of SciPy: left at its default, atol rules
    # where it is larger
    return gmres(operator, residual, atol=target, restart=GMRES_BASIS, maxiter=1)


def _harmonic_blocks(flex: Flexibility, change: np.ndarray) -> np.ndarray:
    """(H+1, a, a) inverses of  1 + A_h D_h  in single precision, D_h what of `change` maps harmonic
    h to h.
    """
    nodes, (count, a) = len(change), sizes(flex)
    d = a // nodes
    split = change.reshape(nodes, d, 2 * count - 1, d, 2 * count - 1)
    inverse = np.empty((count, a, a), dtype=np.complex64)
    for h in range(count):
        c, s = (0, 0) if h == 0 else (2 * h - 1, 2 * h)
        D = (split[:, :, c, :, c] + split[:, :, s, :, s]) / 2
        if h:
            D = D + 0.5j * (split[:, :, c, :, s] - split[:, :, s, :, c])
        by_node = _matrix_of_harmonic(flex, h).reshape(a, nodes, d).transpose(1, 0, 2)
        system = (by_node @ D.astype(np.complex64)).transpose(1, 0, 2).reshape(a, a)
        system[np.arange(a), np.arange(a)] += 1
        inverse[h] = np.linalg.inv(system)
    return inverse


def _matrix_of_harmonic(flex: Flexibility, h: int) -> np.ndarray:
    """(a, a) A_h in single precision; no other harmonic is formed."""
    A, mean, R, U, T = flex
    if len(A):
        return A[h].astype(np.complex64)
    if h == 0:
        return mean.astype(np.complex64)
    shapes = U.astype(np.complex64)
    return R.astype(np.float32) + shapes @ T[h].astype(np.complex64) @ shapes.T


def _single_product(flex: Flexibility, forces: np.ndarray) -> np.ndarray:
    """(a, K) real coefficients of A times the forces (a, K), in the precision of the
    flexibility.
    """
    A, mean, R, U, T = flex
    if len(A):
        return _by_matrices(A, forces)
    modal = T @ to_complex(U.T @ forces).T[:, :, None].astype(T.dtype)
    moved = R @ forces + U @ to_real(modal[:, :, 0].T).astype(U.dtype)
    moved[:, 0] = mean @ forces[:, 0]
    return moved


def _by_matrices(A: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """The product for A (H+1, a, a)."""
    return to_real((A @ to_complex(forces).T[:, :, None].astype(A.dtype))[:, :, 0].T)
